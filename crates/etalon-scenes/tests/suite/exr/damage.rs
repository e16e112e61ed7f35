//! OpenEXR files that were cut off, damaged, or lie.

use crate::common;

use std::io::Cursor;

use common::Random;
use common::exr_files::{Kind, encodings, file, part, stereo};
use etalon_scenes::exr_frame::{ExrError, ExrOptions, decode_exr};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, SmallVec, Vec2, WritableImage, f16,
};

#[test]
fn truncated_files_are_errors() {
    for encoding in encodings() {
        let bytes = stereo(encoding);
        for length in (0..bytes.len()).step_by(97).chain([bytes.len() - 1]) {
            let result = decode_exr(&bytes[..length], &ExrOptions::default());
            assert!(
                matches!(
                    result,
                    Err(ExrError::Malformed(_) | ExrError::Unsupported(_))
                ),
                "{encoding:?} cut to {length} of {} bytes: {result:?}",
                bytes.len()
            );
        }
    }
    assert!(matches!(
        decode_exr(b"no such file at all", &ExrOptions::default()),
        Err(ExrError::Malformed(_))
    ));
}

#[test]
fn damaged_files_are_errors_or_pictures() {
    let mut random = Random::new(10);
    let (mut pictures, mut errors) = (0, 0);
    for encoding in encodings() {
        let bytes = stereo(encoding);
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            for _ in 0..1 + random.bits() % 3 {
                let place = random.bits() as usize % damaged.len();
                damaged[place] = match random.bits() % 4 {
                    0 => 0,
                    1 => 255,
                    2 => damaged[place] ^ (1 << (random.bits() % 8)),
                    _ => random.bits() as u8,
                };
            }
            // A small limit, so that a header can ask for little.
            let options = ExrOptions {
                max_bytes: 1 << 24,
                ..ExrOptions::default()
            };
            match decode_exr(&damaged, &options) {
                Ok(_) => pictures += 1,
                Err(_) => errors += 1,
            }
        }
    }
    assert!(
        pictures > 100 && errors > 100,
        "{pictures} pictures, {errors} errors"
    );
}

/// The file with the value of an attribute of the first part replaced.
fn with_attribute(bytes: &[u8], name: &str, value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let place = bytes
        .windows(name.len() + 1)
        .position(|window| window == [name.as_bytes(), &[0]].concat())
        .unwrap();
    // Name, type, both ended by 0, four bytes of size, then the value.
    let kind = place + name.len() + 1;
    let size = kind + bytes[kind..].iter().position(|&byte| byte == 0).unwrap() + 1;
    bytes[size + 4..][..value.len()].copy_from_slice(value);
    bytes
}

fn window(low: [i32; 2], high: [i32; 2]) -> Vec<u8> {
    [low, high]
        .concat()
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect()
}

#[test]
fn lying_headers_are_caught_before_allocation() {
    let rgb = [("R", Kind::Half), ("G", Kind::Half), ("B", Kind::Half)];
    let bytes = file([part(
        "",
        None,
        [10, -20],
        [8, 6],
        Encoding::UNCOMPRESSED,
        &rgb,
    )]);
    let fails = |bytes: &[u8]| decode_exr(bytes, &ExrOptions::default()).unwrap_err();
    // 2³⁰ − 2 pixels wide: 6 GiB a row.
    let wide = with_attribute(&bytes, "dataWindow", &window([0, 0], [(1 << 30) - 3, 5]));
    assert!(
        matches!(fails(&wide), ExrError::TooLarge { .. }),
        "{:?}",
        fails(&wide)
    );
    let both = with_attribute(
        &bytes,
        "dataWindow",
        &window([0, 0], [(1 << 30) - 3, (1 << 30) - 3]),
    );
    assert!(
        matches!(fails(&both), ExrError::TooLarge { .. }),
        "{:?}",
        fails(&both)
    );
    // Within the limit, but with more chunks than fit into the file.
    let high = with_attribute(&bytes, "dataWindow", &window([0, 0], [0, 100_000]));
    assert!(
        matches!(fails(&high), ExrError::Malformed(_)),
        "{:?}",
        fails(&high)
    );
    let display = with_attribute(&bytes, "displayWindow", &window([0, 0], [(1 << 30) - 3, 0]));
    assert!(
        matches!(fails(&display), ExrError::Frame(_)),
        "{:?}",
        fails(&display)
    );
    for (low, high) in [
        ([i32::MIN, 0], [i32::MAX, 0]),
        ([i32::MAX, 0], [i32::MIN, 0]),
        ([0, i32::MIN], [1, -5]),
    ] {
        for name in ["dataWindow", "displayWindow"] {
            let bytes = with_attribute(&bytes, name, &window(low, high));
            assert!(
                decode_exr(&bytes, &ExrOptions::default()).is_err(),
                "{name} {low:?} {high:?}"
            );
        }
    }
    // Tiles as large as an i32 can say.
    let tiles = Encoding {
        blocks: Blocks::Tiles(Vec2(4, 4)),
        ..Encoding::UNCOMPRESSED
    };
    let tiled = file([part("", None, [10, -20], [8, 6], tiles, &rgb)]);
    for size in [
        [i32::MAX, i32::MAX],
        [0, 0],
        [-1, 4],
        [i32::MAX, 1],
        [65536, 65536],
    ] {
        let bytes = with_attribute(&tiled, "tiles", &size.map(i32::to_le_bytes).concat());
        assert!(
            decode_exr(&bytes, &ExrOptions::default()).is_err(),
            "tiles of {size:?}"
        );
    }
    // The same block twice instead of two: each line is a chunk of 8 + 48 bytes.
    let mut twice = bytes.clone();
    let chunk = 8 + 8 * 3 * 2;
    let end = twice.len();
    let (first, last) = (end - 6 * chunk, end - chunk);
    twice.copy_within(first..first + chunk, last);
    assert!(
        matches!(fails(&twice), ExrError::Malformed(message) if message.contains("two blocks"))
    );
}

#[test]
fn a_dwa_block_cannot_claim_more_than_it_can_hold() {
    let encoding = Encoding {
        compression: Compression::DWAA(None),
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    // Large and smooth enough to be stored compressed.
    let size = 64;
    let samples = || {
        FlatSamples::F16(
            (0..size * size)
                .map(|i| f16::from_f32((i % size) as f32 / 64.0))
                .collect(),
        )
    };
    let list = ["R", "G", "B"].map(|name| AnyChannel::new(name, samples()));
    let layer = Layer::new(
        (size, size),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(SmallVec::from_iter(list)),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .unwrap();
    let bytes = bytes.into_inner();
    assert!(decode_exr(&bytes, &ExrOptions::default()).is_ok());
    // The first chunk begins where the first offset, after the header, says:
    // y, size, then counts of eight bytes, of which the first is the version 2.
    let version = 2_u64.to_le_bytes();
    let chunk = bytes
        .windows(16)
        .position(|w| w[..8] == version && w[8..] == [0; 8])
        .unwrap();
    for count in 1..10 {
        let mut lying = bytes.clone();
        lying[chunk + 8 * count..][..8].copy_from_slice(&(1_u64 << 50).to_le_bytes());
        match decode_exr(&lying, &ExrOptions::default()) {
            Err(ExrError::Malformed(message)) => assert!(message.contains("claims"), "{message}"),
            other => panic!("count {count}: {other:?}"),
        }
    }
}
