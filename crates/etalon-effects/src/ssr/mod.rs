//! Screen-space reflection: the screen is searched for what each pixel mirrors.
//!
//! The march stores *where* the reflection is, before any colour exists
//! ([`march`]); colours are looked up there afterwards ([`resolve`]), blurred
//! for rough surfaces ([`blur`]) and laid onto the scene by its specular map
//! ([`mix`]). [`ssr`] does all four, by default only on [tiles](crate::tiles) that show
//! something mirrored, and if asked to at a quarter of the rate where surfaces are rough.
//!
//! Only what the screen shows can be reflected: what lies outside of it, behind
//! something, or faces away is not there to be found. The fades of [`Ssr`] let
//! reflections end gently there. If the inputs say what is
//! [beyond](SceneInputs::beyond) the screen, that is seen where the screen has no answer:
//! of probes first, then of the world, `screen · v + beyond · (1 − v)` by the visibility
//! v. Where both are equally bright the one ends in the other unseen. The cost is that of
//! [probes](mod@crate::probes) and 8 texels of the world's map, at each pixel that mirrors.
//!
//! # Source
//! D. Lettier, "3D Game Shaders For Beginners: Screen Space Reflection", for the march
//! and the mix; M. McGuire and M. Mara, "Efficient GPU Screen-Space Ray Tracing", JCGT
//! 3(4), 2014, for [`Search::Dda`]; Y. Uludag, "Hi-Z Screen-Space Cone-Traced
//! Reflections", GPU Pro 5, 2014, for [`Search::HiZ`]. It differs from the first where that
//! fails: rays are cut at the near plane before they are projected, 1/distance is
//! interpolated instead of its reciprocal, an axis the ray does not cross is never divided
//! by, and refinement keeps a bracket of one miss and one hit.

pub(crate) mod demand;
mod fallback;
mod passes;
mod quarter;
mod tiled;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};

use passes::{Marched, Rate};
pub use passes::{blur, march, mix, resolve};

use self::fallback::Fallback;
use crate::knob::{Tunable, choices, knobs};
use crate::tiles::crossover::Cost;
use crate::tiles::{Area, Tiling};
use crate::{EffectError, SceneInputs, SettingError};

/// How the screen is searched along a ray.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Search {
    /// One texel after the other, or what `resolution` leaves of them: the hit is
    /// wherever the step ends that found it.
    Linear,
    /// The same, and then bisection between the last miss and the hit.
    #[default]
    Refined,
    /// As linear, but that the ray's whole way through each texel looked at is held
    /// against its surface, and the hit is where it begins to be within the thickness.
    /// Misses what the ray touches beside those texels.
    Dda,
    /// Every texel that the ray touches, but for whole squares of them that a
    /// [pyramid](crate::hiz) says it cannot meet anything in. Finds the first crossing
    /// there is, at a cost that hardly grows with the length of the ray; `resolution` does
    /// not enter. The pyramid costs a look at each texel, and 8/3 bytes for each, wherever
    /// anything mirrors.
    HiZ,
}

choices!(Search {
    Linear => "linear",
    Refined => "refined",
    Dda => "dda",
    HiZ => "hi-z",
});

/// What the place and length of a reflection are stored in between the passes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HitStorage {
    /// `rgba32float`: places to a small part of a texel.
    #[default]
    Full,
    /// `rgba16float`: half the bytes; places are rounded to 2^-12 of the picture
    /// on its far half, which is a third of a texel at a width of 1280.
    Half,
}

choices!(HitStorage {
    Full => "rgba32float",
    Half => "rgba16float",
});

impl HitStorage {
    const fn format(self) -> Format {
        match self {
            Self::Full => Format::Rgba32Float,
            Self::Half => Format::Rgba16Float,
        }
    }
}

/// How a reflection is put onto the scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Blend {
    /// Added, as light that the scene's colour does not hold yet.
    #[default]
    Add,
    /// In place of what it covers: `colour · (1 − specular · visibility) + reflection`.
    Replace,
}

choices!(Blend {
    Add => "add",
    Replace => "replace",
});

/// Settings of [`ssr`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ssr {
    /// Longest ray in view units, in `[1e-3, 1e6]`. Further things are not
    /// reflected. Costs as many steps as the ray then crosses texels.
    pub max_distance: f32,
    /// Share of the texels along the ray that are looked at, in `[0, 1]`. 1 is
    /// every one; ½ every second, at half the cost, missing what is thinner
    /// than two texels. 0 turns the effect off. Of [`Search::HiZ`] it says no more than
    /// that.
    pub resolution: f32,
    /// How the screen is searched.
    pub search: Search,
    /// Halvings of the step in which the hit was found, in `[0, 24]`, where the
    /// search is refined. Each costs one look-up and halves the position error;
    /// with the resolution at 1 none shows beyond 4, since a texel has one depth.
    pub steps: u32,
    /// How far behind a surface still counts as inside of it, in view units,
    /// in `[1e-6, 1e6]`. Too large smears the outlines of things along the
    /// ray, too small tears holes into what is seen at a slope. Costs nothing.
    pub thickness: f32,
    /// Most texels looked at along one ray, of the picture or of a pyramid, in
    /// `[1, 23171]`: an upper bound on the cost. Rays that would need more reflect nothing.
    pub march_limit: u32,
    /// Fade of rays that turn back toward the eye, which meet the backs of
    /// things: 0 for none, 1 until nothing is left straight back. In `[0, 1]`.
    pub camera_fade: f32,
    /// Fade by how far behind the surface the hit lies, up to `thickness`: 0
    /// for none, 1 until nothing is left there. In `[0, 1]`.
    pub depth_fade: f32,
    /// Fade by the length of the ray, up to `max_distance`: 0 for none, 1 until
    /// nothing is left there. In `[0, 1]`.
    pub distance_fade: f32,
    /// Width of the band along the picture's edges in which reflections of
    /// what is there fade out, as a share of the picture, in `[0, 0.5]`; 0 cuts
    /// them at the edge.
    pub border: f32,
    /// Texels to either side that the reflection on a fully rough surface is
    /// blurred over, in `[0, 64]`. The cost grows with it; 0 skips the blur and
    /// shows every surface smooth.
    pub blur_radius: u32,
    /// What places and lengths of reflections are stored in.
    pub storage: HitStorage,
    /// Roughness from which on only one texel in four is marched, in `[0, 2]`: 0 is all
    /// surfaces, over 1 none. The others are given what was found for their own surface
    /// next to them. Rough surfaces, whose reflections are blurred, hide that; on smooth
    /// ones thin things and outlines in reflections show it. A quarter of the cost of the
    /// search, and less of the blur's, where all of a tile is that rough; a tile that is so
    /// in part is searched at both rates, and without `tiles` the whole picture is unless
    /// this is 0.
    pub quarter_from: f32,
    /// How the reflection is put onto the scene.
    pub blend: Blend,
    /// Into which tiles the picture is divided, of which those are left out that show
    /// nothing mirrored. Changes no bit of the picture. It costs a look at the specular
    /// map of each texel, and saves all but a copy on tiles where the map is 0; see
    /// [`Ssr::for_coverage`].
    pub tiles: Tiling,
}

knobs!(Ssr, "ssr" {
    real max_distance [1e-3, 1e6] "view units", Look [5.0, 20.0, 100.0], "longest ray";
    real resolution [0.0, 1.0] "", Accuracy [0.0625, 0.125, 0.25, 0.5, 1.0], "share of the texels along a ray that are looked at";
    choice search [Search] "", Accuracy ["linear", "dda", "refined", "hi-z"], "how the screen is searched";
    count steps [0, 24] "", Accuracy [1, 2, 3, 5, 8, 12], "halvings of the step that found the hit";
    real thickness [1e-6, 1e6] "view units", Look [0.05, 0.25, 1.0], "how far behind a surface counts as inside of it";
    count march_limit [1, 23_171] "", Accuracy [32, 128, 512, 4096], "most texels looked at along one ray";
    real camera_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade of rays that turn back to the eye";
    real depth_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade by the depth of a hit behind its surface";
    real distance_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade by the length of the ray";
    real border [0.0, 0.5] "", Look [0.0, 0.1, 0.25], "width of the band along the edges in which reflections fade out";
    count blur_radius [0, 64] "texels", Look [0, 2, 6, 16], "reach of the blur on rough surfaces";
    choice storage [HitStorage] "", Accuracy ["rgba16float", "rgba32float"], "what places of reflections are stored in";
    real quarter_from [0.0, 2.0] "", Accuracy [0.0, 2.0], "roughness from which one texel in four is marched";
    choice blend [Blend] "", Look ["add", "replace"], "how the reflection is put onto the scene";
    choice tiles [Tiling] "texels", Cost ["off", "8", "16", "32", "64"], "side of the tiles of which those that show nothing mirrored are left out";
});

impl Default for Ssr {
    fn default() -> Self {
        Self {
            max_distance: 20.0,
            resolution: 1.0,
            search: Search::Refined,
            steps: 5,
            thickness: 0.25,
            march_limit: 4096,
            camera_fade: 1.0,
            depth_fade: 0.5,
            distance_fade: 1.0,
            border: 0.1,
            blur_radius: 6,
            storage: HitStorage::Full,
            quarter_from: Self::NO_QUARTER,
            blend: Blend::Add,
            tiles: Tiling::Texels8,
        }
    }
}

impl Ssr {
    /// [`Ssr::quarter_from`] that leaves every texel to be marched.
    pub const NO_QUARTER: f32 = 2.0;

    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()
    }

    /// These settings for a frame in which tiles that cover a share of the screen, in
    /// `[0, 1]`, are marched: without tiles from the share on where those take longer on a
    /// device than the whole picture. The picture is the same.
    /// [`MEASURED`](crate::tiles::crossover::MEASURED) stands for a device that was not
    /// measured.
    #[must_use]
    pub fn for_coverage(self, coverage: f64, cost: &Cost) -> Self {
        let tiles = if coverage >= cost.crossover() {
            Tiling::Off
        } else {
            self.tiles
        };
        Self { tiles, ..self }
    }
}

/// Adds reflections to `inputs.colour`; with a resolution of 0 returns it as it is, also
/// where something is beyond the screen.
///
/// The result is `rgba16float` of the same size.
///
/// # Errors
/// If a setting, or a number of what is beyond the screen, is out of range, or the inputs
/// differ in size.
pub fn ssr(
    graph: &mut Graph,
    inputs: &SceneInputs,
    settings: &Ssr,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    if settings.resolution == 0.0 {
        return Ok(inputs.colour);
    }
    let marched = Marched::new(graph, inputs, settings)?;
    let fallback = Fallback::of(inputs)?;
    let fallback = fallback.as_ref();
    let limit = settings.quarter_from;
    if limit == 0.0 {
        return quarter::ssr(graph, inputs, &marched, settings, fallback, None);
    }
    let smoother = Some(limit).filter(|limit| *limit <= 1.0);
    let result = match settings.tiles.size() {
        Some(size) => tiled::ssr(graph, inputs, &marched, settings, fallback, smoother, size)?,
        None => full(graph, inputs, &marched, settings, fallback, smoother)?,
    };
    match smoother {
        Some(_) => quarter::ssr(graph, inputs, &marched, settings, fallback, Some(result)),
        None => Ok(result),
    }
}

/// Every pass on the whole picture, for surfaces of less than some roughness.
fn full(
    graph: &mut Graph,
    inputs: &SceneInputs,
    marched: &Marched,
    settings: &Ssr,
    fallback: Option<&Fallback<'_>>,
    smoother: Option<f32>,
) -> Result<Texture, EffectError> {
    let reflection = marched.at(graph, settings, Rate::Full, Area::Picture)?;
    let sharp = resolve(graph, reflection, inputs.colour)?;
    let blurred = if settings.blur_radius > 0 {
        Some(blur(graph, sharp, settings.blur_radius)?)
    } else {
        None
    };
    let layers = passes::Layers {
        colour: inputs.colour,
        specular: inputs.specular,
        sharp,
        blurred,
        smoother,
        fallback,
    };
    let result = layers.result(graph)?;
    layers.mix(graph, settings.blend, result, Area::Picture, "ssr/mix")
}
