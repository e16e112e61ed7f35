//! From planes to a frame.

use etalon_core::image::ImageData;
use etalon_core::resource::TextureDesc;
use glam::{DMat4, DVec2};

use super::decode::{self, File, Place};
use super::names::{ChannelName, Chosen, MotionDirection};
use super::{DepthMeaning, ExrError, ExrOptions, LoadedFrame};
use crate::camera::Projection;
use crate::frame::{Frame, FrameCamera, FrameError};

pub(super) fn frame(
    bytes: &[u8],
    file: &File,
    chosen: Chosen,
    view: Option<String>,
    options: &ExrOptions,
) -> Result<LoadedFrame, ExrError> {
    let projection = projection(file, options)?;
    let camera = FrameCamera {
        projection,
        view: DMat4::IDENTITY,
        previous_view: DMat4::IDENTITY,
    };
    let mut wanted: Vec<Place> = Vec::new();
    let mut slot = |place: Place| {
        wanted
            .iter()
            .position(|&known| known == place)
            .unwrap_or_else(|| {
                wanted.push(place);
                wanted.len() - 1
            })
    };
    let colour = chosen.colour.map(|place| place.map(&mut slot));
    let depth = chosen.depth.map(&mut slot);
    let normal = chosen.normal.map(|places| places.map(&mut slot));
    let specular = chosen.specular.map(|places| places.map(&mut slot));
    let motion = chosen.motion.map(|places| places.map(&mut slot));
    let planes = decode::read_planes(bytes, file, &wanted, options.max_bytes)?;

    let mut frame = Frame::empty(camera, file.size)?;
    if options.colour_format != frame.colour.desc.format {
        let desc = TextureDesc::d2(file.size.width(), file.size.height(), options.colour_format);
        frame.colour = ImageData::zeroed(desc).map_err(|source| FrameError::Image {
            image: "colour",
            source,
        })?;
    }
    store(&mut frame.colour, |pixel| {
        let [r, g, b] = [0, 1, 2].map(|i| colour[i].map_or(0.0, |slot| planes[slot][pixel]));
        let covered = r != 0.0 || g != 0.0 || b != 0.0;
        [
            r,
            g,
            b,
            colour[3].map_or(f32::from(u8::from(covered)), |slot| planes[slot][pixel]),
        ]
    });
    let mut nearest = f64::INFINITY;
    if let Some(slot) = depth {
        let plane = &planes[slot];
        store(&mut frame.depth, |pixel| {
            let value = f64::from(plane[pixel]);
            let depth = device_depth(value, pixel, file, &projection, options);
            if depth > 0.0 {
                nearest = nearest.min(projection.near() / depth);
            }
            [depth as f32, 0.0, 0.0, 0.0]
        });
    }
    if let Some(slots) = normal {
        store(&mut frame.normal, |pixel| {
            let [x, y, z] = slots.map(|slot| planes[slot][pixel]);
            [
                x,
                y,
                z,
                f32::from(u8::from(x != 0.0 || y != 0.0 || z != 0.0)),
            ]
        });
    }
    if let Some(slots) = specular {
        store(&mut frame.specular, |pixel| {
            slots.map(|slot| planes[slot][pixel])
        });
    }
    if let (Some(slots), Some(motion)) = (motion, &chosen.names.motion) {
        let size = DVec2::new(file.size.width().into(), file.size.height().into());
        let sign = match motion.direction {
            MotionDirection::Backward => -1.0,
            MotionDirection::Forward => 1.0,
        };
        // The file's y points up, that of uv down.
        let scale = options.motion_scale * DVec2::new(sign, -sign) / size;
        store(&mut frame.velocity, |pixel| {
            let [u, v] = slots.map(|slot| f64::from(planes[slot][pixel]));
            [(u * scale.x) as f32, (v * scale.y) as f32, 0.0, 0.0]
        });
    }
    let available = (file.parts.iter())
        .flat_map(|part| {
            part.channels
                .iter()
                .map(|channel| ChannelName::new(&*part.name, &**channel))
        })
        .collect();
    Ok(LoadedFrame {
        frame,
        channels: chosen.names,
        view,
        nearest: nearest.is_finite().then_some(nearest),
        available,
    })
}

/// The projection the options ask for, or the file's own: a picture of the
/// width `screenWindowWidth` at distance 1.
fn projection(file: &File, options: &ExrOptions) -> Result<Projection, ExrError> {
    if let Some(fov) = options.vertical_fov {
        return Ok(Projection::perspective(fov, options.near, file.size)?);
    }
    let positive = |x: f64| if x.is_finite() && x > 0.0 { x } else { 1.0 };
    let x = 2.0 / positive(file.screen_window_width);
    let aspect =
        positive(file.pixel_aspect) * f64::from(file.size.width()) / f64::from(file.size.height());
    Ok(Projection::new(DVec2::new(x, x * aspect), options.near)?)
}

/// The device depth of a value from the file. NaN stays NaN: it is for the
/// effects to sanitise.
fn device_depth(
    value: f64,
    pixel: usize,
    file: &File,
    projection: &Projection,
    options: &ExrOptions,
) -> f64 {
    if options.depth == DepthMeaning::Device {
        return value;
    }
    let distance = value.abs();
    if distance == 0.0 || distance >= options.far {
        return 0.0;
    }
    let planar = match options.depth {
        DepthMeaning::Radial => {
            let width = file.size.width() as usize;
            let centre = DVec2::new((pixel % width) as f64 + 0.5, (pixel / width) as f64 + 0.5);
            let uv = centre / DVec2::new(width as f64, file.size.height().into());
            distance / projection.direction(uv).length()
        }
        _ => distance,
    };
    projection.near() / planar
}

/// Encodes an image texel by texel.
fn store(image: &mut ImageData, mut texel: impl FnMut(usize) -> [f32; 4]) {
    let format = image.desc.format;
    for (pixel, bytes) in image
        .bytes
        .chunks_exact_mut(format.texel_bytes() as usize)
        .enumerate()
    {
        format.encode(etalon_core::texel::Texel::Float(texel(pixel)), bytes);
    }
}
