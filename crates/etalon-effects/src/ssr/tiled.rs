//! Screen-space reflection on tiles that show something mirrored.
//!
//! What a tile's surfaces ask for decides what runs there: rough ones everything, smooth
//! ones no blur, and where nothing is mirrored light is only copied. The blur looks at
//! neighbours, so what comes before it also runs around the rough tiles.

use etalon_core::graph::{Graph, Texture};

use super::Ssr;
use super::fallback::Fallback;
use super::passes::{Layers, Marched, Rate, blur_on, resolve_on};
use crate::tiles::{Area, Axis, Marks, TileSize};
use crate::{EffectError, SceneInputs};

/// Smooth surfaces are mirrored by, and no rough ones: as `ssr/classify` marks them.
const SMOOTH: u32 = 1;
/// Rough surfaces are mirrored by.
const ROUGH: u32 = 2;
/// The blur along columns reads what the blur along rows writes here.
const BLURRED: u32 = 4;
/// The blur along rows reads reflections here.
const REFLECTED: u32 = 8;

/// As [`super::full`], whose picture it gives bit for bit.
pub(super) fn ssr(
    graph: &mut Graph,
    inputs: &SceneInputs,
    marched: &Marched,
    settings: &Ssr,
    fallback: Option<&Fallback<'_>>,
    smoother: Option<f32>,
    tiles: TileSize,
) -> Result<Texture, EffectError> {
    let radius = settings.blur_radius;
    let mut marks = classify(graph, inputs.specular, radius > 0, smoother, tiles)?;
    if radius > 0 {
        marks = marks
            .spread(graph, Axis::Y, radius, ROUGH, BLURRED)?
            .spread(graph, Axis::X, radius, BLURRED, REFLECTED)?;
    }

    let found = Area::Tiles(marks.with(graph, SMOOTH | REFLECTED)?);
    let reflection = marched.at(graph, settings, Rate::Full, found)?;
    let sharp = resolve_on(graph, reflection, inputs.colour, Rate::Full, found)?;

    let layers = Layers {
        colour: inputs.colour,
        specular: inputs.specular,
        sharp,
        blurred: None,
        smoother,
        fallback,
    };
    let mut result = layers.result(graph)?;
    if radius > 0 {
        let around = Area::Tiles(marks.with(graph, BLURRED)?);
        let rough = Area::Tiles(marks.with(graph, ROUGH)?);
        let blurred = blur_on(graph, sharp, radius, Rate::Full, [around, rough])?;
        let layers = Layers {
            blurred: Some(blurred),
            ..layers
        };
        result = layers.mix(graph, settings.blend, result, rough, "ssr/mix")?;
    }
    let smooth = Area::Tiles(marks.with(graph, SMOOTH)?);
    result = layers.mix(graph, settings.blend, result, smooth, "ssr/mix smooth")?;
    let others = Area::Tiles(marks.without(graph, SMOOTH | ROUGH)?);
    keep(graph, inputs.colour, result, others)
}

/// Copies light where nothing is mirrored.
pub(super) fn keep(
    graph: &mut Graph,
    colour: Texture,
    result: Texture,
    area: Area,
) -> Result<Texture, EffectError> {
    let pass = graph.compute("ssr/keep").read("source", colour);
    area.run(pass, result)
}

/// What each tile asks for, of surfaces of less than some roughness.
fn classify(
    graph: &mut Graph,
    specular: Texture,
    blurred: bool,
    smoother: Option<f32>,
    tiles: TileSize,
) -> Result<Marks, EffectError> {
    let marks = Marks::texture(graph, "ssr.marks", specular);
    let mut pass = graph
        .compute("ssr/classify")
        .read("specular", specular)
        .write("result", marks)
        .feature("blurred", blurred);
    if let Some(limit) = smoother {
        pass = pass.feature("smoother", true).set("quarter_from", limit);
    }
    let marks = pass.per_texel("result")?;
    Marks::of(graph, marks, tiles)
}
