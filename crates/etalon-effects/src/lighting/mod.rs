//! Deferred lighting: the light of each light, added up in a light map.
//!
//! Each light is a pass over the picture that reads the G-buffer, so that its cost
//! does not depend on how much was drawn: texels times lights. The first layer
//! holds what needs no light: emission, light from everywhere, the background.
//!
//! The light map is `rgba16float`; every layer is rounded to it before it is added,
//! and the sum once more by the target.

pub(crate) mod demand;
mod light;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{ClearValue, Draw, Graph, Load, Texture};
use etalon_core::resource::TextureDesc;

pub use light::{LightKind, PunctualLight};

pub use crate::environment::Surroundings;

use crate::EffectError;
use crate::check::size;
use crate::geometry::{GBuffer, View};

/// Adds up the light that a G-buffer's surfaces send to the camera.
///
/// Light from everywhere costs a pass over the picture that reads the radiance map
/// and the table of [`mirroring`](crate::environment::mirroring), which is made
/// anew unless the surroundings have one.
///
/// # Errors
/// If a number is out of its range, or the graph refuses a pass.
pub fn lighting(
    graph: &mut Graph,
    view: &View,
    surfaces: &GBuffer,
    lights: &[PunctualLight],
    surroundings: &Surroundings,
) -> Result<Texture, EffectError> {
    view.validate()?;
    surroundings.validate()?;
    for light in lights {
        light.validate()?;
    }
    let [width, height] = size(graph, surfaces.colour);
    let target = graph.texture("light", TextureDesc::d2(width, height, Format::Rgba16Float));
    let mut first = Draw::new("lighting/ambient")
        .elements(0..3)
        .read("colour", surfaces.colour)
        .read("emission", surfaces.emission)
        .set("background", surroundings.background);
    if surroundings.shine() {
        let camera = &view.camera;
        let around = surroundings.ready(graph)?;
        first = around
            .light(first, view.view)
            .read("depth", surfaces.depth)
            .read("normal", surfaces.normal)
            .read("specular", surfaces.specular)
            .set("projection_scale", camera.scale)
            .set("projection_centre", camera.centre)
            .set("depth_bias_slope", camera.depth_bias_slope())
            .set("distance_range", camera.distance_range());
    }
    let layers = lights.iter().map(|light| light.draw(view, surfaces));
    let written = graph
        .raster("lighting/light map")
        .colour("light", target, Load::Clear(ClearValue::Float([0.0; 4])))
        .draw(first)
        .draws(layers)
        .finish()?;
    Ok(written.texture("light")?)
}
