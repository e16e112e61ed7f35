//! Files that other programs made. They are not part of the project: the
//! environment variable `ETALON_INPUTS` names the folder whose subfolder `exr`
//! has them, and without it these tests do nothing but say so.

use crate::common;

use common::input;
use etalon_core::format::Format;
use etalon_core::image::ImageData;
use etalon_scenes::FrameSize;
use etalon_scenes::exr_frame::{
    ChannelName, ExrError, ExrOptions, LoadedFrame, MotionDirection, decode_exr, load_exr,
};
use glam::DVec2;

fn load(name: &str, options: &ExrOptions) -> Option<LoadedFrame> {
    input(&format!("exr/{name}"))
        .map(|path| load_exr(&path, options).unwrap_or_else(|error| panic!("{name}: {error}")))
}

fn texels(image: &ImageData) -> Vec<[f32; 4]> {
    image.to_rgba_f32().unwrap()
}

#[test]
fn the_beachball_has_depth_and_motion_in_both_views() {
    for view in ["left", "right"] {
        let options = ExrOptions {
            view: Some(view.into()),
            ..ExrOptions::default()
        };
        let Some(loaded) = load("beachball.0001.exr", &options) else {
            return;
        };
        assert_eq!(loaded.frame.size(), FrameSize::new(2048, 1556).unwrap());
        assert_eq!(
            loaded.available.len(),
            4 + 1 + 2 + 1 + 4 + 1 + 2 + 2 + 2 + 1
        );
        let name = |part: &str, channel: &str| ChannelName::new(format!("{part}_{view}"), channel);
        let colour = loaded.channels.colour.unwrap().map(Option::unwrap);
        assert_eq!(
            colour,
            ["R", "G", "B", "A"].map(|channel| name("rgba", channel))
        );
        assert_eq!(loaded.channels.depth, Some(name("depth", "Z")));
        let motion = loaded.channels.motion.unwrap();
        assert_eq!(motion.direction, MotionDirection::Forward);
        assert_eq!(
            motion.channels,
            [name("forward", "forward.u"), name("forward", "forward.v")]
        );
        assert_eq!(loaded.channels.normal, None);
        assert!(loaded.nearest.unwrap() > 0.0);
        // Data windows as the headers say: nothing outside, something at each edge.
        let (left, right) = if view == "left" {
            (688, 1564)
        } else {
            (654, 1530)
        };
        let colour = texels(&loaded.frame.colour);
        let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
        for (pixel, texel) in colour
            .iter()
            .enumerate()
            .filter(|(_, texel)| texel[3] != 0.0)
        {
            let place = [pixel % 2048, pixel / 2048];
            for axis in 0..2 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
            assert!(texel.iter().all(|x| x.is_finite()));
        }
        assert_eq!((low, high), ([left, 245], [right, 1120]));
    }
}

#[test]
fn the_beachballs_motion_leads_to_where_it_is_next() {
    let options = ExrOptions {
        view: Some("left".into()),
        ..ExrOptions::default()
    };
    let (Some(now), Some(next)) = (
        load("beachball.0001.exr", &options),
        load("beachball.0002.exr", &options),
    ) else {
        return;
    };
    // The ball's middle, from its alpha.
    let middle = |loaded: &LoadedFrame| {
        let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
        for (pixel, texel) in texels(&loaded.frame.colour).iter().enumerate() {
            let weight = f64::from(texel[3]);
            sum += weight;
            x += weight * (pixel % 2048) as f64;
            y += weight * (pixel / 2048) as f64;
        }
        [x / sum / 2048.0, y / sum / 1556.0]
    };
    let (from, to) = (middle(&now), middle(&next));
    let (mut count, mut mean) = (0.0, [0.0; 2]);
    for (velocity, colour) in texels(&now.frame.velocity)
        .iter()
        .zip(texels(&now.frame.colour))
    {
        if colour[3] == 1.0 {
            count += 1.0;
            mean[0] += f64::from(velocity[0]);
            mean[1] += f64::from(velocity[1]);
        }
    }
    let (moved, mean) = (
        [to[0] - from[0], to[1] - from[1]],
        mean.map(|sum| sum / count),
    );
    println!("the ball moved by {moved:?}, its motion vectors say {mean:?} on average");
    // Both in pixels. The vectors are of the shutter's time, less than a frame;
    // the ball is falling, so it turns and speeds up meanwhile: the direction is
    // the same within a quarter of a right angle.
    let pixels = |[x, y]: [f64; 2]| DVec2::new(x * 2048.0, y * 1556.0);
    let (moved, mean) = (pixels(moved), pixels(mean));
    assert!(mean.angle_to(moved).abs() < 0.39, "{mean}, not {moved}");
    assert!(
        (0.2..1.0).contains(&(mean.length() / moved.length())),
        "{mean}, not {moved}"
    );
}

#[test]
fn pictures_are_read() {
    for (name, width, height) in [
        ("still-life.exr", 1240, 846),
        ("candle-glass.exr", 1000, 810),
        ("bright-rings.exr", 800, 800),
        ("stage-env-cube.exr", 256, 1536),
    ] {
        let Some(loaded) = load(name, &ExrOptions::default()) else {
            return;
        };
        assert_eq!(loaded.frame.size(), FrameSize::new(width, height).unwrap());
        let colour = texels(&loaded.frame.colour);
        assert!(
            colour
                .iter()
                .all(|texel| texel.iter().all(|x| x.is_finite())),
            "{name}"
        );
        assert!(colour.iter().any(|texel| texel[0] > 0.1), "{name} is black");
        assert!(loaded.channels.depth.is_none() && loaded.nearest.is_none());
        assert!(
            texels(&loaded.frame.depth)
                .iter()
                .all(|texel| texel[0] == 0.0)
        );
    }
    let Some(loaded) = load("bright-rings-nan-inf.exr", &ExrOptions::default()) else {
        return;
    };
    let colour = texels(&loaded.frame.colour);
    assert!(
        colour.iter().any(|texel| texel[0].is_nan())
            && colour.iter().any(|texel| texel[0].is_infinite())
    );
}

#[test]
fn all_half_values_are_read_exactly() {
    let Some(loaded) = load("all-half-values.exr", &ExrOptions::default()) else {
        return;
    };
    let bits: Vec<u16> = (loaded.frame.colour.bytes.chunks_exact(8))
        .map(|texel| u16::from_le_bytes([texel[0], texel[1]]))
        .collect();
    let mut seen = vec![false; 1 << 16];
    for &bits in &bits {
        seen[usize::from(bits)] = true;
    }
    // NaNs are kept as NaNs, not bit by bit.
    let missing = (0..=u16::MAX)
        .filter(|&bits| bits & 0x7c00 != 0x7c00 || bits & 0x03ff == 0)
        .filter(|&bits| !seen[usize::from(bits)])
        .count();
    assert_eq!(missing, 0);
    assert!(
        bits.iter()
            .any(|bits| bits & 0x7c00 == 0x7c00 && bits & 0x03ff != 0)
    );
}

#[test]
fn wide_floats_need_a_wide_format() {
    let options = ExrOptions {
        colour_format: Format::Rgba32Float,
        ..ExrOptions::default()
    };
    let Some(loaded) = load("wide-float-range.exr", &options) else {
        return;
    };
    let colour = loaded.channels.colour.unwrap();
    assert_eq!(colour, [None, Some("G".into()), None, None]);
    let green: Vec<_> = texels(&loaded.frame.colour)
        .iter()
        .map(|texel| texel[1])
        .collect();
    assert!(green.iter().all(|x| x.is_finite()));
    assert!(green.iter().any(|x| *x > 1e37) && green.iter().any(|x| *x < -1e37));
}

#[test]
fn truncated_inputs_are_errors() {
    for name in [
        "bright-rings.exr",
        "all-half-values.exr",
        "wide-float-range.exr",
    ] {
        let Some(path) = input(&format!("exr/{name}")) else {
            return;
        };
        let bytes = std::fs::read(path).unwrap();
        for length in (0..bytes.len()).step_by(9973) {
            let result = decode_exr(&bytes[..length], &ExrOptions::default());
            assert!(
                matches!(result, Err(ExrError::Malformed(_))),
                "{name} cut to {length}: {result:?}"
            );
        }
    }
}
