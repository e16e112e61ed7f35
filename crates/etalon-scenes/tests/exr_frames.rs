//! OpenEXR files made here, read back and damaged.

mod common;

use std::io::Cursor;

use common::Random;
use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_scenes::exr_frame::{
    ChannelName, DepthMeaning, ExrError, ExrOptions, FrameChannels, LoadedFrame, Motion, MotionDirection, decode_exr,
    load_exr, save_exr,
};
use etalon_scenes::{Frame, FrameSize, scene};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, LineOrder, SmallVec, Text, Vec2, WritableImage, f16,
};
use glam::DVec2;

type Part = Layer<AnyChannels<FlatSamples>>;

/// Where the files made here say the picture is.
const DISPLAY: ([i32; 2], [usize; 2]) = ([10, -20], [8, 6]);

/// A channel whose samples tell where they are, and which channel they are of.
fn value(channel: &str, x: i32, y: i32) -> f32 {
    let letters: u32 = channel.bytes().map(u32::from).sum();
    letters as f32 + x as f32 * 0.25 + y as f32 * 8.0
}

#[derive(Clone, Copy)]
enum Kind {
    Half,
    Float,
    Uint,
}

fn part(
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
    Layer::new((size[0], size[1]), attributes, encoding, AnyChannels::sort(list))
}

fn file(parts: impl IntoIterator<Item = Part>) -> Vec<u8> {
    let ([x, y], [width, height]) = DISPLAY;
    let attributes = ImageAttributes::new(IntegerBounds::new((x, y), (width, height)));
    let image = Image { attributes, layer_data: parts.into_iter().collect::<SmallVec<[Part; 2]>>() };
    let mut bytes = Cursor::new(Vec::new());
    image.write().to_buffered(&mut bytes).unwrap();
    bytes.into_inner()
}

/// Stereo, several parts, each with a window of its own.
fn stereo(encoding: Encoding) -> Vec<u8> {
    let rgba = [("R", Kind::Half), ("G", Kind::Half), ("B", Kind::Half), ("A", Kind::Half)];
    file([
        part("rgba_left", Some("left"), [12, -21], [4, 5], encoding, &rgba),
        part("depth_left", Some("left"), [9, -19], [6, 3], encoding, &[("Z", Kind::Float)]),
        part("rgba_right", Some("right"), [11, -18], [20, 2], encoding, &rgba),
        part("depth_right", Some("right"), [10, -20], [8, 6], encoding, &[("Z", Kind::Half)]),
        part(
            "forward_right",
            Some("right"),
            [10, -20],
            [8, 6],
            encoding,
            &[("forward.u", Kind::Half), ("forward.v", Kind::Float)],
        ),
        part("ids", None, [10, -20], [8, 6], encoding, &[("object.id", Kind::Uint)]),
    ])
}

fn encodings() -> Vec<Encoding> {
    let tiles = Blocks::Tiles(Vec2(3, 2));
    [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ]
        .into_iter()
        .flat_map(|compression| {
            [Blocks::ScanLines, tiles].map(|blocks| Encoding { compression, blocks, line_order: LineOrder::Increasing })
        })
        .collect()
}

fn texels(image: &ImageData) -> Vec<[f32; 4]> {
    image.to_rgba_f32().unwrap()
}

/// Every pixel of the display window with its place in file coordinates.
fn pixels() -> impl Iterator<Item = (usize, i32, i32)> {
    let ([x0, y0], [width, height]) = DISPLAY;
    (0..width * height).map(move |pixel| (pixel, x0 + (pixel % width) as i32, y0 + (pixel / width) as i32))
}

/// The sample a part holds at a place, 0 outside its window.
fn sample(channel: &str, corner: [i32; 2], size: [i32; 2], x: i32, y: i32) -> f32 {
    let inside = (corner[0]..corner[0] + size[0]).contains(&x) && (corner[1]..corner[1] + size[1]).contains(&y);
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
            let expected = if distance == 0.0 { 0.0 } else { 0.1 / f64::from(distance.abs()) };
            assert_eq!(depth[pixel][0], expected as f32, "{encoding:?} at {x}, {y}");
        }
        assert_eq!(loaded.channels.motion, None, "the left view has none");

        let options = ExrOptions { view: Some("right".into()), ..ExrOptions::default() };
        let loaded = decode_exr(&bytes, &options).unwrap();
        let (colour, velocity) = (texels(&loaded.frame.colour), texels(&loaded.frame.velocity));
        for (pixel, x, y) in pixels() {
            let expected = ["R", "G", "B", "A"].map(|name| sample(name, [11, -18], [20, 2], x, y));
            assert_eq!(colour[pixel], expected, "{encoding:?} at {x}, {y}");
            // Pixels to uv, then half precision.
            let u = f16::from_f32(value("forward.u", x, y)).to_f32();
            let expected = [u / 8.0, value("forward.v", x, y) / 6.0].map(f16::from_f32);
            assert_eq!(velocity[pixel][..2], expected.map(f16::to_f32), "{encoding:?} at {x}, {y}");
        }
        let motion = loaded.channels.motion.unwrap();
        assert_eq!(motion.direction, MotionDirection::Forward);
        assert_eq!(motion.channels[0], ChannelName::new("forward_right", "forward.u"));
        assert_eq!(loaded.channels.depth, Some(ChannelName::new("depth_right", "Z")));
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
        assert_eq!(colour[pixel], [id, 0.0, green, if id != 0.0 || green != 0.0 { 1.0 } else { 0.0 }]);
        // The file holds u as half floats.
        let u = f16::from_f32(value("forward.u", x, y)).to_f32();
        let expected = [-value("forward.v", x, y) / 8.0, 2.0 * u / 6.0].map(f16::from_f32);
        assert_eq!(velocity[pixel][..2], expected.map(f16::to_f32));
    }
    let missing = FrameChannels { depth: name("depth_right:W"), ..FrameChannels::default() };
    match decode_exr(&bytes, &ExrOptions { channels: missing, ..ExrOptions::default() }) {
        Err(error @ ExrError::NoChannel { .. }) => {
            let message = error.to_string();
            assert!(message.contains("depth_right:W") && message.contains("depth_left:Z"), "{message}");
        }
        other => panic!("{other:?}"),
    }
    let options = ExrOptions { view: Some("middle".into()), ..ExrOptions::default() };
    assert!(matches!(
        decode_exr(&bytes, &options),
        Err(ExrError::NoView { available, .. }) if available == ["left", "right"]
    ));
}

/// What is found among channels of the given names in one part.
fn found(names: &[&str]) -> Result<LoadedFrame, ExrError> {
    let channels: Vec<_> = names.iter().map(|&name| (name, Kind::Half)).collect();
    let part = part("", None, [10, -20], [8, 6], Encoding::FAST_LOSSLESS, &channels);
    decode_exr(&file([part]), &ExrOptions::default())
}

#[test]
fn usual_names_are_recognised() {
    let colour = |names: &[&str]| {
        found(names).unwrap().channels.colour.unwrap().map(|name| name.map_or(String::new(), |name| name.channel))
    };
    assert_eq!(colour(&["A", "B", "G", "R", "Z"]), ["R", "G", "B", "A"]);
    assert_eq!(colour(&["G"]), ["", "G", "", ""]);
    assert_eq!(colour(&["A", "Y"]), ["Y", "Y", "Y", "A"]);
    assert_eq!(colour(&["diffuse.R", "diffuse.G", "diffuse.B", "R", "G", "B"]), ["R", "G", "B", ""]);
    let blender = ["Combined.A", "Combined.B", "Combined.G", "Combined.R"];
    let layers = blender.map(|name| format!("View Layer.{name}"));
    let mut names: Vec<_> = layers.iter().map(String::as_str).collect();
    names.extend(["View Layer.AO.R", "View Layer.AO.G", "View Layer.AO.B", "View Layer.Depth.Z"]);
    names.extend(["View Layer.Normal.X", "View Layer.Normal.Y", "View Layer.Normal.Z"]);
    names.extend(["View Layer.Vector.W", "View Layer.Vector.X", "View Layer.Vector.Y", "View Layer.Vector.Z"]);
    assert_eq!(colour(&names)[0], "View Layer.Combined.R");
    let channels = found(&names).unwrap().channels;
    assert_eq!(channels.depth, Some("View Layer.Depth.Z".into()));
    assert_eq!(channels.normal.unwrap()[2], "View Layer.Normal.Z".into());
    let motion = channels.motion.unwrap();
    assert_eq!((motion.channels[1].clone(), motion.direction), ("View Layer.Vector.Y".into(), MotionDirection::Backward));

    let depth = |names: &[&str]| {
        found(&[names, &["R"]].concat()).unwrap().channels.depth.map(|name| name.channel)
    };
    assert_eq!(depth(&["Z"]).as_deref(), Some("Z"));
    assert_eq!(depth(&["Z", "ZBack"]).as_deref(), Some("Z"));
    assert_eq!(depth(&["ZBack"]).as_deref(), Some("ZBack"));
    assert_eq!(depth(&["depth.Z"]).as_deref(), Some("depth.Z"));
    assert_eq!(depth(&["depth.R", "depth.G", "depth.B"]).as_deref(), Some("depth.R"));
    assert_eq!(depth(&["ZDepth"]).as_deref(), Some("ZDepth"));
    assert_eq!(depth(&["Pworld.X", "Pworld.Y", "Pworld.Z"]), None, "a coordinate");
    assert_eq!(depth(&["N.X", "N.Y", "N.Z", "volume.Z", "Z"]).as_deref(), Some("Z"));

    for layer in ["N", "normal", "Normals"] {
        for [x, y, z] in [["X", "Y", "Z"], ["x", "y", "z"], ["R", "G", "B"]] {
            let names = [x, y, z].map(|last| format!("{layer}.{last}"));
            let channels = found(&[&names[0], &names[1], &names[2], "R", "G", "B"]).unwrap().channels;
            assert_eq!(channels.normal, Some(names.clone().map(|name| ChannelName::new("", name))));
            assert_eq!(channels.colour.unwrap()[0], Some("R".into()), "not the normals");
        }
    }
    let both = found(&["R", "back.u", "back.v", "forward.u", "forward.v"]).unwrap().channels.motion.unwrap();
    assert_eq!(both.direction, MotionDirection::Backward, "velocity is about the frame before");

    for names in [&["Z"][..], &["N.X", "N.Y", "N.Z"], &["forward.u", "forward.v"]] {
        assert!(matches!(found(names), Err(ExrError::NoColour { .. })), "{names:?}");
    }
}

#[test]
fn one_part_can_hold_several_views() {
    let mut layer = part(
        "",
        None,
        [10, -20],
        [8, 6],
        Encoding::FAST_LOSSLESS,
        &["R", "G", "B", "Z", "right.R", "right.G", "right.B", "right.Z"].map(|name| (name, Kind::Half)),
    );
    layer.attributes.multi_view_names = Some(vec![Text::from("left"), Text::from("right")]);
    let bytes = file([layer]);
    for (view, colour, depth) in [(None, "R", "Z"), (Some("left"), "R", "Z"), (Some("right"), "right.R", "right.Z")] {
        let options = ExrOptions { view: view.map(str::to_owned), ..ExrOptions::default() };
        let loaded = decode_exr(&bytes, &options).unwrap();
        assert_eq!(loaded.channels.colour.unwrap()[0], Some(colour.into()));
        assert_eq!(loaded.channels.depth, Some(depth.into()));
        assert_eq!(loaded.view.as_deref(), view.or(Some("left")));
    }
}

#[test]
fn depth_can_mean_several_things() {
    let samples = [0.5_f32, -4.0, 0.0, 1e10, f32::INFINITY, f32::NAN];
    let list = [
        AnyChannel::new("Z", FlatSamples::F32(samples.to_vec())),
        AnyChannel::new("R", FlatSamples::F32(vec![1.0; 6])),
    ];
    let attributes = LayerAttributes { screen_window_width: 3.0, ..LayerAttributes::default() };
    let layer = Layer::new((3, 2), attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(SmallVec::from_iter(list)));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    let bytes = bytes.into_inner();
    let read = |options: &ExrOptions| {
        let loaded = decode_exr(&bytes, options).unwrap();
        let depth: Vec<_> = texels(&loaded.frame.depth).iter().map(|texel| texel[0]).collect();
        (depth, loaded)
    };
    let near = ExrOptions { near: 0.25, ..ExrOptions::default() };
    let (depth, loaded) = read(&near);
    assert_eq!(depth[..5], [0.5, 0.0625, 0.0, 0.0, 0.0]);
    assert!(depth[5].is_nan(), "effects must sanitise what they are given");
    assert_eq!(loaded.nearest, Some(0.5));
    // A picture 3 wide and 2 high at distance 1.
    assert_eq!(loaded.frame.camera.projection.scale(), DVec2::new(2.0 / 3.0, 1.0));

    let (depth, _) = read(&ExrOptions { depth: DepthMeaning::Device, ..near.clone() });
    assert_eq!(depth[..5], samples[..5]);

    // Pixel centres at distance 1 are at −1, 0, 1 and ±½.
    let (depth, _) = read(&ExrOptions { depth: DepthMeaning::Radial, ..near.clone() });
    let expected = [0.25 * 2.25_f64.sqrt() / 0.5, 0.25 * 1.25_f64.sqrt() / 4.0];
    assert_eq!(depth[..2], expected.map(|depth| depth as f32));

    let (depth, _) = read(&ExrOptions { far: 1e11, ..near.clone() });
    assert_eq!(depth[3], (0.25 / f64::from(1e10_f32)) as f32);

    let fov = ExrOptions { vertical_fov: Some(std::f64::consts::FRAC_PI_2), ..near };
    let scale = read(&fov).1.frame.camera.projection.scale();
    assert!((scale - DVec2::new(2.0 / 3.0, 1.0)).length() < 1e-15);
}

#[test]
fn senseless_options_are_refused() {
    let bytes = stereo(Encoding::FAST_LOSSLESS);
    let fails = |options: ExrOptions| decode_exr(&bytes, &options).unwrap_err();
    let default = ExrOptions::default;
    assert!(matches!(fails(ExrOptions { near: 0.0, ..default() }), ExrError::Camera(_)));
    assert!(matches!(fails(ExrOptions { vertical_fov: Some(4.0), ..default() }), ExrError::Camera(_)));
    assert!(matches!(fails(ExrOptions { far: f64::NAN, ..default() }), ExrError::Option { option: "far", .. }));
    let format = ExrOptions { colour_format: Format::Rgba8Unorm, ..default() };
    assert!(matches!(fails(format), ExrError::Option { option: "colour_format", .. }));
    let scale = ExrOptions { motion_scale: DVec2::NAN, ..default() };
    assert!(matches!(fails(scale), ExrError::Option { option: "motion_scale", .. }));
    assert!(matches!(fails(ExrOptions { max_bytes: 100, ..default() }), ExrError::TooLarge { .. }));
}

#[test]
fn frames_survive_saving_and_loading() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("frame.exr");
    let frame = scene("wet-floor").unwrap().frame(FrameSize::new(67, 41).unwrap()).unwrap();
    save_exr(&frame, &path).unwrap();
    let LoadedFrame { frame: loaded, channels, nearest, .. } = load_exr(&path, &ExrOptions::default()).unwrap();
    for (name, image) in frame.images() {
        let again = loaded.image(name).unwrap();
        if name == "depth" {
            // Two divisions, each stored in single precision.
            for (a, b) in texels(image).iter().zip(texels(again)) {
                assert!((a[0] - b[0]).abs() <= a[0] * f32::EPSILON * 1.5, "{} {}", a[0], b[0]);
            }
        } else {
            assert_eq!(texels(image), texels(again), "{name}");
        }
    }
    let difference = loaded.camera.projection.scale() - frame.camera.projection.scale();
    assert!(difference.length() < 1e-6, "the header holds single precision");
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
    let frame = scene("hard-inputs").unwrap().frame(FrameSize::new(48, 32).unwrap()).unwrap();
    save_exr(&frame, &path).unwrap();
    let loaded = load_exr(&path, &ExrOptions::default()).unwrap().frame;
    for (a, b) in texels(&frame.colour).into_iter().flatten().zip(texels(&loaded.colour).into_iter().flatten()) {
        assert!(a == b || (a.is_nan() && b.is_nan()), "{a} {b}");
    }
}

#[test]
fn truncated_files_are_errors() {
    for encoding in encodings() {
        let bytes = stereo(encoding);
        for length in (0..bytes.len()).step_by(97).chain([bytes.len() - 1]) {
            let result = decode_exr(&bytes[..length], &ExrOptions::default());
            assert!(
                matches!(result, Err(ExrError::Malformed(_) | ExrError::Unsupported(_))),
                "{encoding:?} cut to {length} of {} bytes: {result:?}",
                bytes.len()
            );
        }
    }
    assert!(matches!(decode_exr(b"no such file at all", &ExrOptions::default()), Err(ExrError::Malformed(_))));
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
            let options = ExrOptions { max_bytes: 1 << 24, ..ExrOptions::default() };
            match decode_exr(&damaged, &options) {
                Ok(_) => pictures += 1,
                Err(_) => errors += 1,
            }
        }
    }
    assert!(pictures > 100 && errors > 100, "{pictures} pictures, {errors} errors");
}

/// The file with the value of an attribute of the first part replaced.
fn with_attribute(bytes: &[u8], name: &str, value: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let place = bytes.windows(name.len() + 1).position(|window| window == [name.as_bytes(), &[0]].concat()).unwrap();
    // Name, type, both ended by 0, four bytes of size, then the value.
    let kind = place + name.len() + 1;
    let size = kind + bytes[kind..].iter().position(|&byte| byte == 0).unwrap() + 1;
    bytes[size + 4..][..value.len()].copy_from_slice(value);
    bytes
}

fn window(low: [i32; 2], high: [i32; 2]) -> Vec<u8> {
    [low, high].concat().iter().flat_map(|x| x.to_le_bytes()).collect()
}

#[test]
fn lying_headers_are_caught_before_allocation() {
    let rgb = [("R", Kind::Half), ("G", Kind::Half), ("B", Kind::Half)];
    let bytes = file([part("", None, [10, -20], [8, 6], Encoding::UNCOMPRESSED, &rgb)]);
    let fails = |bytes: &[u8]| decode_exr(bytes, &ExrOptions::default()).unwrap_err();
    // 2³⁰ − 2 pixels wide: 6 GiB a row.
    let wide = with_attribute(&bytes, "dataWindow", &window([0, 0], [(1 << 30) - 3, 5]));
    assert!(matches!(fails(&wide), ExrError::TooLarge { .. }), "{:?}", fails(&wide));
    let both = with_attribute(&bytes, "dataWindow", &window([0, 0], [(1 << 30) - 3, (1 << 30) - 3]));
    assert!(matches!(fails(&both), ExrError::TooLarge { .. }), "{:?}", fails(&both));
    // Within the limit, but with more chunks than fit into the file.
    let high = with_attribute(&bytes, "dataWindow", &window([0, 0], [0, 100_000]));
    assert!(matches!(fails(&high), ExrError::Malformed(_)), "{:?}", fails(&high));
    let display = with_attribute(&bytes, "displayWindow", &window([0, 0], [(1 << 30) - 3, 0]));
    assert!(matches!(fails(&display), ExrError::Frame(_)), "{:?}", fails(&display));
    for (low, high) in [([i32::MIN, 0], [i32::MAX, 0]), ([i32::MAX, 0], [i32::MIN, 0]), ([0, i32::MIN], [1, -5])] {
        for name in ["dataWindow", "displayWindow"] {
            let bytes = with_attribute(&bytes, name, &window(low, high));
            assert!(decode_exr(&bytes, &ExrOptions::default()).is_err(), "{name} {low:?} {high:?}");
        }
    }
    // Tiles as large as an i32 can say.
    let tiles = Encoding { blocks: Blocks::Tiles(Vec2(4, 4)), ..Encoding::UNCOMPRESSED };
    let tiled = file([part("", None, [10, -20], [8, 6], tiles, &rgb)]);
    for size in [[i32::MAX, i32::MAX], [0, 0], [-1, 4], [i32::MAX, 1], [65536, 65536]] {
        let bytes = with_attribute(&tiled, "tiles", &size.map(i32::to_le_bytes).concat());
        assert!(decode_exr(&bytes, &ExrOptions::default()).is_err(), "tiles of {size:?}");
    }
    // The same block twice instead of two: each line is a chunk of 8 + 48 bytes.
    let mut twice = bytes.clone();
    let chunk = 8 + 8 * 3 * 2;
    let end = twice.len();
    let (first, last) = (end - 6 * chunk, end - chunk);
    twice.copy_within(first..first + chunk, last);
    assert!(matches!(fails(&twice), ExrError::Malformed(message) if message.contains("two blocks")));
}

#[test]
fn compressions_that_lose_data_are_read() {
    let rgb = [("R", Kind::Half), ("G", Kind::Half), ("B", Kind::Half)];
    for compression in [Compression::PXR24, Compression::B44, Compression::B44A, Compression::DWAA(None), Compression::DWAB(None)] {
        let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
        let bytes = file([part("", None, [10, -20], [8, 6], encoding, &rgb)]);
        let loaded = decode_exr(&bytes, &ExrOptions::default()).unwrap();
        for (pixel, x, y) in pixels() {
            let red = texels(&loaded.frame.colour)[pixel][0];
            let expected = value("R", x, y);
            // B44 keeps about six bits, DWA errs by some percent of the block's range.
            assert!((red - expected).abs() < 0.1 * expected.abs() + 8.0, "{compression:?}: {red}, not {expected}");
        }
    }
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
    let samples = || FlatSamples::F16((0..size * size).map(|i| f16::from_f32((i % size) as f32 / 64.0)).collect());
    let list = ["R", "G", "B"].map(|name| AnyChannel::new(name, samples()));
    let layer = Layer::new(
        (size, size),
        LayerAttributes::default(),
        encoding,
        AnyChannels::sort(SmallVec::from_iter(list)),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes).unwrap();
    let bytes = bytes.into_inner();
    assert!(decode_exr(&bytes, &ExrOptions::default()).is_ok());
    // The first chunk begins where the first offset, after the header, says:
    // y, size, then counts of eight bytes, of which the first is the version 2.
    let version = 2_u64.to_le_bytes();
    let chunk = bytes.windows(16).position(|w| w[..8] == version && w[8..] == [0; 8]).unwrap();
    for count in 1..10 {
        let mut lying = bytes.clone();
        lying[chunk + 8 * count..][..8].copy_from_slice(&(1_u64 << 50).to_le_bytes());
        match decode_exr(&lying, &ExrOptions::default()) {
            Err(ExrError::Malformed(message)) => assert!(message.contains("claims"), "{message}"),
            other => panic!("count {count}: {other:?}"),
        }
    }
}

#[test]
fn a_frame_with_incomplete_images_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let mut frame: Frame = scene("mirror-planes").unwrap().frame(FrameSize::new(4, 4).unwrap()).unwrap();
    frame.normal.bytes.truncate(8);
    let result = save_exr(&frame, &folder.path().join("frame.exr"));
    assert!(matches!(result, Err(ExrError::Encode(_))));
}
