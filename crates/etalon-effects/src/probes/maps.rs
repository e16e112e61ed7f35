//! Maps of light, one in each layer of a texture.

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::TextureDesc;

use crate::EffectError;
use crate::check::Settings;
use crate::environment::{Prefilter, check_side, image_size, prefiltered, scattered};

/// Most maps of one texture.
pub const MAX_MAPS: u32 = 256;

/// Factors of a map's irradiance.
const FACTORS: u32 = 9;

/// The maps of probes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProbeMaps {
    /// `rgba16float`: in each layer what an
    /// [`Environment`](crate::environment::Environment) has as its radiance.
    pub radiance: Texture,
    /// `rgba32float`, 9 × 1: in each layer the factors of irradiance over π of the same
    /// light, as `lib/surroundings` has them.
    pub irradiance: Texture,
}

impl ProbeMaps {
    /// Of so many maps, each `side` texels high: a power of two in `[32, 2048]`.
    ///
    /// A map takes 12 `side`² bytes.
    fn descs(side: u32, count: u32) -> Result<[TextureDesc; 2], EffectError> {
        check_side(side)?;
        Settings("probes").count("maps", count, 1, MAX_MAPS)?;
        let [width, height] = image_size(side);
        Ok([
            (width, height, Format::Rgba16Float),
            (FACTORS, 1, Format::Rgba32Float),
        ]
        .map(|(width, height, format)| {
            let mut desc = TextureDesc::d2(width, height, format);
            desc.extent.depth_or_layers = count;
            desc
        }))
    }

    /// Maps that [`probe_map`] is going to fill in the same graph: all of them, before
    /// they are read.
    ///
    /// # Errors
    /// If the side or the number is out of its range.
    pub fn new(graph: &mut Graph, side: u32, count: u32) -> Result<Self, EffectError> {
        let [radiance, irradiance] = Self::descs(side, count)?;
        Ok(Self {
            radiance: graph.texture("probe radiance", radiance),
            irradiance: graph.texture("probe irradiance", irradiance),
        })
    }

    /// Maps that were made before, imported as `{name} radiance` and
    /// `{name} irradiance`.
    ///
    /// # Errors
    /// If the side or the number is out of its range, or a name is taken.
    pub fn import(
        graph: &mut Graph,
        name: &str,
        side: u32,
        count: u32,
    ) -> Result<Self, EffectError> {
        let [radiance, irradiance] = Self::descs(side, count)?;
        Ok(Self {
            radiance: graph.import_texture(&format!("{name} radiance"), radiance)?,
            irradiance: graph.import_texture(&format!("{name} irradiance"), irradiance)?,
        })
    }
}

/// Fills one layer from the image of an
/// [`EnvironmentMap`](crate::environment::EnvironmentMap), imported or
/// [made of faces](crate::environment::of_faces), of the maps' size.
///
/// The cost is that of [`environment`](fn@crate::environment::environment), and nine sums
/// over up to 3844 texels.
///
/// # Errors
/// If a setting is out of its range, `base` is not of the maps' size, or there is no such
/// layer.
pub fn probe_map(
    graph: &mut Graph,
    maps: ProbeMaps,
    layer: u32,
    base: Texture,
    settings: &Prefilter,
) -> Result<ProbeMaps, EffectError> {
    let extent = graph.desc(maps.radiance).extent;
    let check = Settings("probes");
    check.count("layer", layer, 0, extent.depth_or_layers.saturating_sub(1))?;
    let given = graph.desc(base).extent;
    check.count("height", given.height, extent.height, extent.height)?;
    Ok(ProbeMaps {
        radiance: prefiltered(graph, base, maps.radiance.layer(layer), settings)?,
        irradiance: scattered(graph, base, maps.irradiance.layer(layer))?,
    })
}
