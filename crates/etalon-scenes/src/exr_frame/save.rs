//! Frames as OpenEXR files.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, WritableImage,
};

use super::ExrError;
use crate::frame::Frame;

/// Writes a frame as one part of float channels: `R`, `G`, `B`, `A`; `Z`, the
/// distance along the view axis, 0 for the sky; `N.X`, `N.Y`, `N.Z`;
/// `specularMap.R` … `A`; `back.u`, `back.v` in pixels, y up. [`load_exr`](super::load_exr)
/// reads it back.
///
/// # Errors
/// If the images are incomplete, memory runs out or the file cannot be written.
pub fn save_exr(frame: &Frame, path: &Path) -> Result<(), ExrError> {
    let bytes = encode_exr(frame)?;
    std::fs::write(path, bytes).map_err(|source| ExrError::Io {
        path: path.display().to_string(),
        source,
    })
}

fn encode_exr(frame: &Frame) -> Result<Vec<u8>, ExrError> {
    let size = frame.size();
    let (width, height) = (f64::from(size.width()), f64::from(size.height()));
    let near = frame.camera.projection.near();
    let mut list = Vec::new();
    let mut add = |name: &str, image, channel: usize, map: &dyn Fn(f64) -> f64| {
        let image = frame.image(image).map(|image| image.to_rgba_f32());
        let texels = match image {
            Some(Ok(texels)) if texels.len() == size.pixels() => texels,
            Some(Ok(texels)) => {
                return Err(ExrError::Encode(format!(
                    "{name} has {} of {} texels",
                    texels.len(),
                    size.pixels()
                )));
            }
            Some(Err(error)) => return Err(ExrError::Encode(error.to_string())),
            None => return Ok(()),
        };
        let samples = texels
            .iter()
            .map(|texel| map(f64::from(texel[channel])) as f32)
            .collect();
        list.push(AnyChannel::new(name, FlatSamples::F32(samples)));
        Ok(())
    };
    let same = |x: f64| x;
    for (channel, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
        add(name, "colour", channel, &same)?;
        add(&format!("specularMap.{name}"), "specular", channel, &same)?;
    }
    add("Z", "depth", 0, &|depth| {
        if depth == 0.0 { 0.0 } else { near / depth }
    })?;
    for (channel, name) in ["X", "Y", "Z"].into_iter().enumerate() {
        add(&format!("N.{name}"), "normal", channel, &same)?;
    }
    add("back.u", "velocity", 0, &|x| -x * width)?;
    add("back.v", "velocity", 1, &|x| x * height)?;

    let attributes = LayerAttributes {
        screen_window_width: (2.0 / frame.camera.projection.scale().x) as f32,
        ..LayerAttributes::default()
    };
    let layer = Layer::new(
        (size.width() as usize, size.height() as usize),
        attributes,
        Encoding::FAST_LOSSLESS,
        AnyChannels::sort(list.into()),
    );
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer)
        .write()
        .to_buffered(&mut bytes)
        .map_err(|error| ExrError::Encode(error.to_string()))?;
    Ok(bytes.into_inner())
}
