//! OpenEXR files with known contents.

use std::io::Cursor;

use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes,
    IntegerBounds, Layer, LayerAttributes, LineOrder, SmallVec, Text, Vec2, WritableImage, f16,
};

pub(crate) type Part = Layer<AnyChannels<FlatSamples>>;

/// Where the files made here say the picture is.
pub(crate) const DISPLAY: ([i32; 2], [usize; 2]) = ([10, -20], [8, 6]);

/// A channel whose samples tell where they are, and which channel they are of.
pub(crate) fn value(channel: &str, x: i32, y: i32) -> f32 {
    let letters: u32 = channel.bytes().map(u32::from).sum();
    letters as f32 + x as f32 * 0.25 + y as f32 * 8.0
}

#[derive(Clone, Copy)]
pub(crate) enum Kind {
    Half,
    Float,
    Uint,
}

pub(crate) fn part(
    name: &str,
    view: Option<&str>,
    corner: [i32; 2],
    size: [usize; 2],
    encoding: Encoding,
    channels: &[(&str, Kind)],
) -> Part {
    let list: SmallVec<[_; 4]> = channels
        .iter()
        .map(|&(name, kind)| {
            let samples = (0..size[1] as i32).flat_map(|y| {
                (0..size[0] as i32).map(move |x| value(name, corner[0] + x, corner[1] + y))
            });
            let samples = match kind {
                Kind::Half => FlatSamples::F16(samples.map(f16::from_f32).collect()),
                Kind::Float => FlatSamples::F32(samples.collect()),
                Kind::Uint => FlatSamples::U32(samples.map(|x| x.max(0.0) as u32).collect()),
            };
            AnyChannel::new(name, samples)
        })
        .collect();
    let attributes = LayerAttributes {
        layer_name: (!name.is_empty()).then(|| Text::from(name)),
        view_name: view.map(Text::from),
        layer_position: Vec2(corner[0], corner[1]),
        ..LayerAttributes::default()
    };
    Layer::new(
        (size[0], size[1]),
        attributes,
        encoding,
        AnyChannels::sort(list),
    )
}

pub(crate) fn file(parts: impl IntoIterator<Item = Part>) -> Vec<u8> {
    let ([x, y], [width, height]) = DISPLAY;
    let attributes = ImageAttributes::new(IntegerBounds::new((x, y), (width, height)));
    let image = Image {
        attributes,
        layer_data: parts.into_iter().collect::<SmallVec<[Part; 2]>>(),
    };
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Stereo, several parts, each with a window of its own.
pub(crate) fn stereo(encoding: Encoding) -> Vec<u8> {
    let rgba = [
        ("R", Kind::Half),
        ("G", Kind::Half),
        ("B", Kind::Half),
        ("A", Kind::Half),
    ];
    file([
        part(
            "rgba_left",
            Some("left"),
            [12, -21],
            [4, 5],
            encoding,
            &rgba,
        ),
        part(
            "depth_left",
            Some("left"),
            [9, -19],
            [6, 3],
            encoding,
            &[("Z", Kind::Float)],
        ),
        part(
            "rgba_right",
            Some("right"),
            [11, -18],
            [20, 2],
            encoding,
            &rgba,
        ),
        part(
            "depth_right",
            Some("right"),
            [10, -20],
            [8, 6],
            encoding,
            &[("Z", Kind::Half)],
        ),
        part(
            "forward_right",
            Some("right"),
            [10, -20],
            [8, 6],
            encoding,
            &[("forward.u", Kind::Half), ("forward.v", Kind::Float)],
        ),
        part(
            "ids",
            None,
            [10, -20],
            [8, 6],
            encoding,
            &[("object.id", Kind::Uint)],
        ),
    ])
}

pub(crate) fn encodings() -> Vec<Encoding> {
    let tiles = Blocks::Tiles(Vec2(3, 2));
    [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
    ]
    .into_iter()
    .flat_map(|compression| {
        [Blocks::ScanLines, tiles].map(|blocks| Encoding {
            compression,
            blocks,
            line_order: LineOrder::Increasing,
        })
    })
    .collect()
}

/// Every pixel of the display window with its place in file coordinates.
pub(crate) fn pixels() -> impl Iterator<Item = (usize, i32, i32)> {
    let ([x0, y0], [width, height]) = DISPLAY;
    (0..width * height).map(move |pixel| {
        (
            pixel,
            x0 + (pixel % width) as i32,
            y0 + (pixel / width) as i32,
        )
    })
}
