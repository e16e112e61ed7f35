//! Screen-space reflection of which one pixel in four is marched.
//!
//! Everything up to the mix has half the size, the blur half its reach; the mix brings
//! each texel what was found for its own surface (`shaders/lib/upsample.wesl`). One look
//! at a texel's roughness says which rate it gets, so the picture does not depend on
//! tiles.

use etalon_core::graph::{Graph, Texture};

use super::fallback::Fallback;
use super::passes::{Marched, Rate, blur_on, resolve_on, result_over};
use super::{Blend, Ssr, tiled};
use crate::tiles::{Area, Axis, Marks, TileSize};
use crate::{EffectError, SceneInputs};

/// Texels of half the size that the mix reads.
const READ: u32 = 1;
/// The blur along columns reads what the blur along rows writes here.
const BLURRED: u32 = 2;
/// The blur along rows reads reflections here.
const REFLECTED: u32 = 4;

/// Where passes run.
struct Areas {
    /// At half the size: the march, and what looks up its colours.
    found: Area,
    /// Both passes of the blur, if there is one.
    blurred: Option<[Area; 2]>,
    /// Of the picture: the mix.
    mixed: Area,
    /// And what mirrors nothing, if nobody else writes that.
    others: Option<Area>,
}

/// Adds to `beneath` the reflections of surfaces of at least a roughness; without
/// `beneath` those of all, to a picture of its own.
pub(super) fn ssr(
    graph: &mut Graph,
    inputs: &SceneInputs,
    marched: &Marched,
    settings: &Ssr,
    fallback: Option<&Fallback<'_>>,
    beneath: Option<Texture>,
) -> Result<Texture, EffectError> {
    let radius = settings.blur_radius.div_ceil(2);
    let areas = match settings.tiles.size() {
        Some(tiles) => {
            let marks = classify(graph, inputs.specular, settings.quarter_from, tiles)?;
            on_tiles(graph, marks, radius, beneath.is_none())?
        }
        None => Areas {
            found: Area::Picture,
            blurred: (radius > 0).then_some([Area::Picture; 2]),
            mixed: Area::Picture,
            others: None,
        },
    };
    let reflection = marched.at(graph, settings, Rate::Quarter, areas.found)?;
    let sharp = resolve_on(graph, reflection, inputs.colour, Rate::Quarter, areas.found)?;
    let blurred = match areas.blurred {
        Some(areas) => Some(blur_on(graph, sharp, radius, Rate::Quarter, areas)?),
        None => None,
    };

    let target = beneath.unwrap_or_else(|| result_over(graph, inputs.colour));
    let mut pass = inputs
        .camera
        .set(graph.compute("ssr/mix_quarter"))
        .read("source", inputs.colour)
        .read("specular", inputs.specular)
        .read("depth", inputs.depth)
        .read("normal", inputs.normal)
        .read("sharp", sharp)
        .feature("blurred", blurred.is_some())
        .constant("ADD", f64::from(u8::from(settings.blend == Blend::Add)));
    if let Some(blurred) = blurred {
        pass = pass.read("blurred", blurred);
    }
    if let Some(fallback) = fallback {
        pass = fallback.set(pass);
    }
    if beneath.is_some() {
        pass = pass
            .feature("rougher", true)
            .set("quarter_from", settings.quarter_from);
    }
    let result = match areas.mixed {
        Area::Picture if beneath.is_some() => {
            pass.write_part("result", target).per_texel("result")?
        }
        area => area.run(pass, target)?,
    };
    match areas.others {
        Some(others) => tiled::keep(graph, inputs.colour, result, others),
        None => Ok(result),
    }
}

/// Which tiles at half the size the mix reads.
fn classify(
    graph: &mut Graph,
    specular: Texture,
    quarter_from: f32,
    tiles: TileSize,
) -> Result<Marks, EffectError> {
    let marks = Marks::half_texture(graph, "ssr.marks quarter", specular);
    let marks = graph
        .compute("ssr/classify")
        .named("ssr/classify quarter")
        .read("specular", specular)
        .write("result", marks)
        .feature("quarter", true)
        .set("quarter_from", quarter_from)
        .per_texel("result")?;
    Marks::of(graph, marks, tiles)
}

/// The tiles that show something mirrored at this rate, and the others if `all` of the
/// picture is to be written.
fn on_tiles(graph: &mut Graph, marks: Marks, radius: u32, all: bool) -> Result<Areas, EffectError> {
    let read = marks.with(graph, READ)?;
    let (mut found, mut blurred) = (read, None);
    if radius > 0 {
        let marks = marks
            .spread(graph, Axis::Y, radius, READ, BLURRED)?
            .spread(graph, Axis::X, radius, BLURRED, REFLECTED)?;
        found = marks.with(graph, READ | REFLECTED)?;
        blurred = Some([marks.with(graph, BLURRED)?, read].map(Area::Tiles));
    }
    let picture = marks.doubled();
    Ok(Areas {
        found: Area::Tiles(found),
        blurred,
        mixed: Area::Tiles(picture.with(graph, READ)?),
        others: if all {
            Some(Area::Tiles(picture.without(graph, READ)?))
        } else {
            None
        },
    })
}
