//! What surfaces send of the lights of a G-buffer.
//!
//! Places, normals and directions of lights have errors of some units of `f32`, and light
//! may depend on them without bound: at the edge of a cone, next to a lamp, on a floor
//! that is lit along itself. What a kernel stores is right if it is the truth of a point
//! that is moved by as much: the truth's own changes, where place and normal are moved by
//! 2⁻²⁰, are allowed beside [`BOUND`] and a unit of 16-bit floats for each layer.

use etalon_effects::lighting::PunctualLight;
use etalon_effects::lighting::truth::{Point, Texels};
use etalon_effects::truth::{MOST_LIGHT, Plane, light, radiance};
use etalon_scenes::cases::drawn::Surfaces;
use glam::{DVec2, DVec3};

use super::super::rounding::BOUND;
use super::super::truth::{Wrong, of};
use crate::observe::Store;

/// By how much places and normals may be off, relative: 16 units of the last place.
const OFF: f64 = 1.0 / 1_048_576.0;

/// A unit of the last place of 16-bit floats, relative.
const UNIT: f64 = 1.0 / 1024.0;

/// The least step of 16-bit floats.
const LEAST: f64 = 1.0 / 16_777_216.0;

/// The texels whose light is another. Where light comes from everywhere there is no
/// truth but integrals, which kernels have fits of.
pub(super) fn wrong<'a>(surfaces: &Surfaces, stores: &'a [Store]) -> Option<Vec<Wrong<'a>>> {
    let around = &surfaces.surroundings;
    if around.above.max_element() > 0.0 || around.below.max_element() > 0.0 {
        return None;
    }
    if surfaces.environment.is_some() || surfaces.rooms.is_some() {
        return None;
    }
    let (store, stored) = of(stores, "lighting/light map")?;
    let frame = &surfaces.step.frame;
    let images = [&frame.colour, &frame.normal, &frame.specular, &frame.depth];
    let [colour, normal, specular, depth] = images.map(|image| Plane::of(image).ok());
    let (colour, normal, specular, depth) = (colour?, normal?, specular?, depth?);
    let emission = Plane::of(&surfaces.emission).ok()?;
    let size = DVec2::new(
        stored.width().into(),
        (stored.texels().len() as u32 / stored.width()).into(),
    );
    let mut wrong = Vec::new();
    for (index, texel) in stored.texels().iter().enumerate() {
        let colour = *colour.texels().get(index)?;
        // Without a surface there is the background; of an alpha that is none nobody
        // knows.
        if colour[3] == 0.0 || colour[3].is_nan() {
            continue;
        }
        let width = stored.width() as usize;
        let place = DVec2::new((index % width) as f64, (index / width) as f64) + 0.5;
        let ndc = (place / size * 2.0 - 1.0) * DVec2::new(1.0, -1.0);
        let texels = Texels {
            colour,
            normal: *normal.texels().get(index)?,
            specular: *specular.texels().get(index)?,
            depth: depth.texels().get(index)?[0],
        };
        let point = Point::seen(&surfaces.step.camera, ndc, &texels);
        let own = light(*emission.texels().get(index)?);
        let exact = own + sum(&point, surfaces);
        let unsure = spread(&point, surfaces);
        let layers = surfaces.lights.len() as f64 + 1.0;
        let channel = (0..3).find(|&channel| {
            let exact = radiance(exact[channel]);
            let allowed =
                exact * (BOUND + (layers + 1.0) * UNIT) + 2.0 * unsure[channel] + layers * LEAST;
            // A sum beyond the target's range may be infinite there. Written so that a
            // NaN is wrong.
            let right = (texel[channel].min(MOST_LIGHT) - exact).abs() <= allowed;
            !right
        });
        if let Some(channel) = channel {
            wrong.push(Wrong {
                store,
                index,
                what: format!(
                    "{:e} in place of {:e}, ± {:e}",
                    texel[channel], exact[channel], unsure[channel]
                ),
            });
        }
    }
    Some(wrong)
}

fn sum(point: &Point, surfaces: &Surfaces) -> DVec3 {
    let lit = |light: &PunctualLight| point.lit(light, &surfaces.view);
    surfaces.lights.iter().map(lit).sum()
}

/// By how much light changes where place and normal are moved by [`OFF`].
fn spread(point: &Point, surfaces: &Surfaces) -> DVec3 {
    let exact = sum(point, surfaces);
    // A light's place counts as well: it is in view space in f32.
    let far = surfaces.lights.iter().map(|light| light.position.length());
    let far = far.fold(point.place.length(), f64::max).min(1e6) * OFF;
    let axes = [
        DVec3::X,
        DVec3::Y,
        DVec3::Z,
        -DVec3::X,
        -DVec3::Y,
        -DVec3::Z,
    ];
    let mut moved = DVec3::ZERO;
    for axis in axes {
        let near = Point {
            place: point.place + axis * far,
            ..*point
        };
        let bent = Point {
            normal: (point.normal + axis * OFF).normalize(),
            ..*point
        };
        for other in [near, bent] {
            moved = moved.max((sum(&other, surfaces) - exact).abs());
        }
    }
    moved
}
