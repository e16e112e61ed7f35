//! OpenEXR files made here and read back.

use crate::common;

use std::io::Cursor;

use common::exr_files::{Kind, encodings, file, part, pixels, stereo, value};
use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_scenes::exr_frame::{
    ChannelName, DepthMeaning, ExrError, ExrOptions, FrameChannels, LoadedFrame, Motion,
    MotionDirection, decode_exr, load_exr, save_exr,
};
use etalon_scenes::{Frame, FrameSize, scene};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer,
    LayerAttributes, LineOrder, SmallVec, WritableImage, f16,
};
use glam::DVec2;

fn texels(image: &ImageData) -> Vec<[f32; 4]> {
    image.to_rgba_f32().unwrap()
}

/// The sample a part holds at a place, 0 outside its window.
fn sample(channel: &str, corner: [i32; 2], size: [i32; 2], x: i32, y: i32) -> f32 {
    let inside = (corner[0]..corner[0] + size[0]).contains(&x)
        && (corner[1]..corner[1] + size[1]).contains(&y);
    if inside { value(channel, x, y) } else { 0.0 }
}

#[test]
fn data_windows_are_placed_within_the_display_window() {
    for encoding in encodings() {
        let bytes = stereo(encoding);
        let loaded = decode_exr(&bytes, &ExrOptions::default()).unwrap();
        assert_eq!(loaded.view.as_deref(), Some("left"));
        assert_eq!(loaded.frame.size(), FrameSize::new(8, 6).unwrap());
        let (colour, depth) = (texels(&loaded.frame.colour), texels(&loaded.frame.depth));
        for (pixel, x, y) in pixels() {
            let expected = ["R", "G", "B", "A"].map(|name| sample(name, [12, -21], [4, 5], x, y));
            // All values here are short enough for half floats.
            assert_eq!(colour[pixel], expected, "{encoding:?} at {x}, {y}");
            let distance = sample("Z", [9, -19], [6, 3], x, y);
            let expected = if distance == 0.0 {
                0.0
            } else {
                0.1 / f64::from(distance.abs())
            };
            assert_eq!(depth[pixel][0], expected as f32, "{encoding:?} at {x}, {y}");
        }
        assert_eq!(loaded.channels.motion, None, "the left view has none");

        let options = ExrOptions {
            view: Some("right".into()),
            ..ExrOptions::default()
        };
        let loaded = decode_exr(&bytes, &options).unwrap();
        let (colour, velocity) = (texels(&loaded.frame.colour), texels(&loaded.frame.velocity));
        for (pixel, x, y) in pixels() {
            let expected = ["R", "G", "B", "A"].map(|name| sample(name, [11, -18], [20, 2], x, y));
            assert_eq!(colour[pixel], expected, "{encoding:?} at {x}, {y}");
            // Pixels to uv, y from up to down, then half precision.
            let u = f16::from_f32(value("forward.u", x, y)).to_f32();
            let expected = [u / 8.0, -value("forward.v", x, y) / 6.0].map(f16::from_f32);
            assert_eq!(
                velocity[pixel][..2],
                expected.map(f16::to_f32),
                "{encoding:?} at {x}, {y}"
            );
        }
        let motion = loaded.channels.motion.unwrap();
        assert_eq!(motion.direction, MotionDirection::Forward);
        assert_eq!(
            motion.channels[0],
            ChannelName::new("forward_right", "forward.u")
        );
        assert_eq!(
            loaded.channels.depth,
            Some(ChannelName::new("depth_right", "Z"))
        );
        assert_eq!(loaded.available.len(), 4 + 1 + 4 + 1 + 2 + 1);
    }
}

#[test]
fn channels_can_be_named() {
    let bytes = stereo(Encoding::SMALL_LOSSLESS);
    let name = |name: &str| Some(ChannelName::from(name));
    let options = ExrOptions {
        channels: FrameChannels {
            colour: Some([name("object.id"), None, name("rgba_right:G"), None]),
            depth: name("depth_right:Z"),
            motion: Some(Motion {
                channels: ["forward.v".into(), "forward.u".into()],
                direction: MotionDirection::Backward,
            }),
            ..FrameChannels::default()
        },
        motion_scale: DVec2::new(1.0, -2.0),
        colour_format: Format::Rgba32Float,
        ..ExrOptions::default()
    };
    let loaded = decode_exr(&bytes, &options).unwrap();
    assert_eq!(loaded.frame.colour.desc.format, Format::Rgba32Float);
    let (colour, velocity) = (texels(&loaded.frame.colour), texels(&loaded.frame.velocity));
    for (pixel, x, y) in pixels() {
        let id = value("object.id", x, y).max(0.0).floor();
        let green = sample("G", [11, -18], [20, 2], x, y);
        assert_eq!(
            colour[pixel],
            [
                id,
                0.0,
                green,
                if id != 0.0 || green != 0.0 { 1.0 } else { 0.0 }
            ]
        );
        // The file holds u as half floats.
        let u = f16::from_f32(value("forward.u", x, y)).to_f32();
        let expected = [-value("forward.v", x, y) / 8.0, -2.0 * u / 6.0].map(f16::from_f32);
        assert_eq!(velocity[pixel][..2], expected.map(f16::to_f32));
    }
    let missing = FrameChannels {
        depth: name("depth_right:W"),
        ..FrameChannels::default()
    };
    match decode_exr(
        &bytes,
        &ExrOptions {
            channels: missing,
            ..ExrOptions::default()
        },
    ) {
        Err(error @ ExrError::NoChannel { .. }) => {
            let message = error.to_string();
            assert!(
                message.contains("depth_right:W") && message.contains("depth_left:Z"),
                "{message}"
            );
        }
        other => panic!("{other:?}"),
    }
    let options = ExrOptions {
        view: Some("middle".into()),
        ..ExrOptions::default()
    };
    assert!(matches!(
        decode_exr(&bytes, &options),
        Err(ExrError::NoView { available, .. }) if available == ["left", "right"]
    ));
}

#[test]
fn depth_can_mean_several_things() {
    let samples = [0.5_f32, -4.0, 0.0, 1e10, f32::INFINITY, f32::NAN];
    let list = [
        AnyChannel::new("Z", FlatSamples::F32(samples.to_vec())),
        AnyChannel::new("R", FlatSamples::F32(vec![1.0; 6])),
    ];
    let attributes = LayerAttributes {
        screen_window_width: 3.0,
        ..LayerAttributes::default()
    };
    let layer = Layer::new(
        (3, 2),
        attributes,
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(SmallVec::from_iter(list)),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .unwrap();
    let bytes = bytes.into_inner();
    let read = |options: &ExrOptions| {
        let loaded = decode_exr(&bytes, options).unwrap();
        let depth: Vec<_> = texels(&loaded.frame.depth)
            .iter()
            .map(|texel| texel[0])
            .collect();
        (depth, loaded)
    };
    let near = ExrOptions {
        near: 0.25,
        ..ExrOptions::default()
    };
    let (depth, loaded) = read(&near);
    assert_eq!(depth[..5], [0.5, 0.0625, 0.0, 0.0, 0.0]);
    assert!(
        depth[5].is_nan(),
        "effects must sanitise what they are given"
    );
    assert_eq!(loaded.nearest, Some(0.5));
    // A picture 3 wide and 2 high at distance 1.
    assert_eq!(
        loaded.frame.camera.projection.scale(),
        DVec2::new(2.0 / 3.0, 1.0)
    );

    let (depth, _) = read(&ExrOptions {
        depth: DepthMeaning::Device,
        ..near.clone()
    });
    assert_eq!(depth[..5], samples[..5]);

    // Pixel centres at distance 1 are at −1, 0, 1 and ±½.
    let (depth, _) = read(&ExrOptions {
        depth: DepthMeaning::Radial,
        ..near.clone()
    });
    let expected = [0.25 * 2.25_f64.sqrt() / 0.5, 0.25 * 1.25_f64.sqrt() / 4.0];
    assert_eq!(depth[..2], expected.map(|depth| depth as f32));

    let (depth, _) = read(&ExrOptions {
        far: 1e11,
        ..near.clone()
    });
    assert_eq!(depth[3], (0.25 / f64::from(1e10_f32)) as f32);

    let fov = ExrOptions {
        vertical_fov: Some(std::f64::consts::FRAC_PI_2),
        ..near
    };
    let scale = read(&fov).1.frame.camera.projection.scale();
    assert!((scale - DVec2::new(2.0 / 3.0, 1.0)).length() < 1e-15);
}

#[test]
fn senseless_options_are_refused() {
    let bytes = stereo(Encoding::FAST_LOSSLESS);
    let fails = |options: ExrOptions| decode_exr(&bytes, &options).unwrap_err();
    let default = ExrOptions::default;
    assert!(matches!(
        fails(ExrOptions {
            near: 0.0,
            ..default()
        }),
        ExrError::Camera(_)
    ));
    assert!(matches!(
        fails(ExrOptions {
            vertical_fov: Some(4.0),
            ..default()
        }),
        ExrError::Camera(_)
    ));
    assert!(matches!(
        fails(ExrOptions {
            far: f64::NAN,
            ..default()
        }),
        ExrError::Option { option: "far", .. }
    ));
    let format = ExrOptions {
        colour_format: Format::Rgba8Unorm,
        ..default()
    };
    assert!(matches!(
        fails(format),
        ExrError::Option {
            option: "colour_format",
            ..
        }
    ));
    let scale = ExrOptions {
        motion_scale: DVec2::NAN,
        ..default()
    };
    assert!(matches!(
        fails(scale),
        ExrError::Option {
            option: "motion_scale",
            ..
        }
    ));
    assert!(matches!(
        fails(ExrOptions {
            max_bytes: 100,
            ..default()
        }),
        ExrError::TooLarge { .. }
    ));
}

#[test]
fn frames_survive_saving_and_loading() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let frame = scene("wet-floor")
        .unwrap()
        .frame(FrameSize::new(67, 41).unwrap())
        .unwrap();
    save_exr(&frame, &path).unwrap();
    let LoadedFrame {
        frame: loaded,
        channels,
        nearest,
        ..
    } = load_exr(&path, &ExrOptions::default()).unwrap();
    for (name, image) in frame.images() {
        let again = loaded.image(name).unwrap();
        if name == "depth" {
            // Two divisions, each stored in single precision.
            for (a, b) in texels(image).iter().zip(texels(again)) {
                assert!(
                    (a[0] - b[0]).abs() <= a[0] * f32::EPSILON * 1.5,
                    "{} {}",
                    a[0],
                    b[0]
                );
            }
        } else {
            assert_eq!(texels(image), texels(again), "{name}");
        }
    }
    let difference = loaded.camera.projection.scale() - frame.camera.projection.scale();
    assert!(
        difference.length() < 1e-6,
        "the header holds single precision"
    );
    assert!(channels.normal.is_some() && channels.specular.is_some() && channels.motion.is_some());
    assert!(nearest.unwrap() > 1.0);

    let missing = load_exr(&folder.path().join("none.exr"), &ExrOptions::default());
    assert!(matches!(missing, Err(ExrError::Io { .. })));
    let nowhere = save_exr(&frame, &folder.path().join("none/frame.exr"));
    assert!(matches!(nowhere, Err(ExrError::Io { .. })));
}

#[test]
fn special_values_survive_saving_and_loading() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hard.exr");
    let frame = scene("hard-inputs")
        .unwrap()
        .frame(FrameSize::new(48, 32).unwrap())
        .unwrap();
    save_exr(&frame, &path).unwrap();
    let loaded = load_exr(&path, &ExrOptions::default()).unwrap().frame;
    for (a, b) in texels(&frame.colour)
        .into_iter()
        .flatten()
        .zip(texels(&loaded.colour).into_iter().flatten())
    {
        assert!(a == b || (a.is_nan() && b.is_nan()), "{a} {b}");
    }
}

#[test]
fn compressions_that_lose_data_are_read() {
    let rgb = [("R", Kind::Half), ("G", Kind::Half), ("B", Kind::Half)];
    for compression in [
        Compression::PXR24,
        Compression::B44,
        Compression::B44A,
        Compression::DWAA(None),
        Compression::DWAB(None),
    ] {
        let encoding = Encoding {
            compression,
            blocks: Blocks::ScanLines,
            line_order: LineOrder::Increasing,
        };
        let bytes = file([part("", None, [10, -20], [8, 6], encoding, &rgb)]);
        let loaded = decode_exr(&bytes, &ExrOptions::default()).unwrap();
        for (pixel, x, y) in pixels() {
            let red = texels(&loaded.frame.colour)[pixel][0];
            let expected = value("R", x, y);
            // B44 keeps about six bits, DWA errs by some percent of the block's range.
            assert!(
                (red - expected).abs() < 0.1 * expected.abs() + 8.0,
                "{compression:?}: {red}, not {expected}"
            );
        }
    }
}

#[test]
fn a_frame_with_incomplete_images_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut frame: Frame = scene("mirror-planes")
        .unwrap()
        .frame(FrameSize::new(4, 4).unwrap())
        .unwrap();
    frame.normal.bytes.truncate(8);
    let result = save_exr(&frame, &folder.path().join("frame.exr"));
    assert!(matches!(result, Err(ExrError::Encode(_))));
}
