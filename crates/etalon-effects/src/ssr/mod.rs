//! Screen-space reflection: the screen is searched for what each pixel mirrors.
//!
//! The march stores *where* the reflection is, before any colour exists
//! ([`march`]); colours are looked up there afterwards ([`resolve`]), blurred
//! for rough surfaces ([`blur`]) and laid onto the scene by its specular map
//! ([`mix`]). [`ssr`] does all four.
//!
//! Only what the screen shows can be reflected: what lies outside of it, behind
//! something, or faces away is not there to be found. The fades of [`Ssr`] let
//! reflections end gently there.
//!
//! # Source
//! D. Lettier, "3D Game Shaders For Beginners: Screen Space Reflection". It
//! differs from that text where that fails: rays are cut at the near plane
//! before they are projected, 1/distance is interpolated instead of its
//! reciprocal, an axis the ray does not cross is never divided by, and
//! refinement keeps a bracket of one miss and one hit.

pub(crate) mod demand;
pub mod truth;

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::TextureDesc;
use glam::IVec2;

use crate::check::{Settings, same_size, size};
use crate::knob::{Tunable, choices, knobs};
use crate::scene::CameraParams;
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
}

choices!(Search {
    Linear => "linear",
    Refined => "refined",
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
    /// than two texels. 0 turns the effect off.
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
    /// Most texels looked at along one ray, in `[1, 23171]`: an upper bound on
    /// the cost. Rays that would need more reflect nothing.
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
    /// How the reflection is put onto the scene.
    pub blend: Blend,
}

knobs!(Ssr, "ssr" {
    real max_distance [1e-3, 1e6] "view units", Look [5.0, 20.0, 100.0], "longest ray";
    real resolution [0.0, 1.0] "", Accuracy [0.0625, 0.125, 0.25, 0.5, 1.0], "share of the texels along a ray that are looked at";
    choice search [Search] "", Accuracy ["linear", "refined"], "how the screen is searched";
    count steps [0, 24] "", Accuracy [1, 2, 3, 5, 8, 12], "halvings of the step that found the hit";
    real thickness [1e-6, 1e6] "view units", Look [0.05, 0.25, 1.0], "how far behind a surface counts as inside of it";
    count march_limit [1, 23_171] "", Accuracy [32, 128, 512, 4096], "most texels looked at along one ray";
    real camera_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade of rays that turn back to the eye";
    real depth_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade by the depth of a hit behind its surface";
    real distance_fade [0.0, 1.0] "", Look [0.0, 0.5, 1.0], "fade by the length of the ray";
    real border [0.0, 0.5] "", Look [0.0, 0.1, 0.25], "width of the band along the edges in which reflections fade out";
    count blur_radius [0, 64] "texels", Look [0, 2, 6, 16], "reach of the blur on rough surfaces";
    choice storage [HitStorage] "", Accuracy ["rgba16float", "rgba32float"], "what places of reflections are stored in";
    choice blend [Blend] "", Look ["add", "replace"], "how the reflection is put onto the scene";
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
            blend: Blend::Add,
        }
    }
}

impl Ssr {
    /// Checks every field against its range.
    ///
    /// # Errors
    /// The first field outside of it.
    pub fn validate(&self) -> Result<(), SettingError> {
        self.check_knobs()
    }
}

/// A texture the size of `like`, of another format.
fn texture(graph: &mut Graph, name: &str, like: Texture, format: Format) -> Texture {
    let extent = graph.desc(like).extent;
    graph.texture(name, TextureDesc::d2(extent.width, extent.height, format))
}

/// Adds reflections to `inputs.colour`; with a resolution of 0 returns it as it is.
///
/// The result is `rgba16float` of the same size.
///
/// # Errors
/// If a setting is out of range or the inputs differ in size.
pub fn ssr(
    graph: &mut Graph,
    inputs: &SceneInputs,
    settings: &Ssr,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    if settings.resolution == 0.0 {
        return Ok(inputs.colour);
    }
    let reflection = march(graph, inputs.depth, inputs.normal, &inputs.camera, settings)?;
    let sharp = resolve(graph, reflection, inputs.colour)?;
    let blurred = if settings.blur_radius > 0 {
        Some(blur(graph, sharp, settings.blur_radius)?)
    } else {
        None
    };
    mix(
        graph,
        inputs.colour,
        inputs.specular,
        sharp,
        blurred,
        settings.blend,
    )
}

/// Finds what each pixel mirrors.
///
/// The result has the size of `depth` and the format of `settings.storage`: u and
/// v of the place, its visibility in `[0, 1]`, and the length of the ray in view
/// units; all 0 where nothing is mirrored.
///
/// # Errors
/// If a setting is out of range, the resolution is 0, or the inputs differ in size.
pub fn march(
    graph: &mut Graph,
    depth: Texture,
    normal: Texture,
    camera: &CameraParams,
    settings: &Ssr,
) -> Result<Texture, EffectError> {
    settings.validate()?;
    camera.validate()?;
    // Steps as far apart as the largest picture is wide are no steps.
    Settings("ssr").range("resolution", settings.resolution, 1.0 / 16_384.0, 1.0)?;
    same_size(
        "ssr",
        ("depth", size(graph, depth)),
        ("normal", size(graph, normal)),
    )?;
    let result = texture(graph, "ssr.reflection", depth, settings.storage.format());
    let pass = graph
        .compute("ssr/march")
        .read("depth", depth)
        .read("normal", normal)
        .write("result", result)
        .feature("half", settings.storage == HitStorage::Half);
    let refinements = match settings.search {
        Search::Linear => 0,
        Search::Refined => settings.steps,
    };
    Ok(camera
        .set(pass)
        .set("max_distance", settings.max_distance)
        .set("thickness", settings.thickness)
        .set("stride", 1.0 / settings.resolution)
        .set("max_steps", settings.march_limit)
        .set("refinements", refinements)
        .set("camera_fade", settings.camera_fade)
        .set("depth_fade", settings.depth_fade)
        .set("distance_fade", settings.distance_fade)
        .set("border", settings.border)
        .per_texel("result")?)
}

/// Looks up `colour` where [`march`] says the reflection is.
///
/// The result is `rgba16float` of the size of `reflection`: the colour times
/// the visibility, and the visibility. `colour` may be of any size.
///
/// # Errors
/// If the graph refuses a handle.
pub fn resolve(
    graph: &mut Graph,
    reflection: Texture,
    colour: Texture,
) -> Result<Texture, EffectError> {
    let result = texture(graph, "ssr.sharp", reflection, Format::Rgba16Float);
    Ok(graph
        .compute("ssr/resolve")
        .read("reflection", reflection)
        .read("source", colour)
        .write("result", result)
        .per_texel("result")?)
}

/// Box blur over `2 radius + 1` texels in each axis, in two passes.
///
/// The result is `rgba16float` of the size of `source`.
///
/// # Errors
/// If the radius is over 64.
pub fn blur(graph: &mut Graph, source: Texture, radius: u32) -> Result<Texture, EffectError> {
    Settings("ssr").count("blur_radius", radius, 0, 64)?;
    let mut newest = source;
    for (name, axis) in [("x", IVec2::X), ("y", IVec2::Y)] {
        let result = texture(
            graph,
            &format!("ssr.blurred {name}"),
            source,
            Format::Rgba16Float,
        );
        newest = graph
            .compute("ssr/blur")
            .named(format!("ssr/blur {name}"))
            .read("source", newest)
            .write("result", result)
            .set("axis", axis)
            .set("radius", radius as i32)
            .per_texel("result")?;
    }
    Ok(newest)
}

/// Puts reflections onto the scene: of each colour what the specular map says,
/// sharp where it is shiny and blurred where it is not.
///
/// Without `blurred` every surface shows the sharp reflection. The result is
/// `rgba16float` of the size of `colour`.
///
/// # Errors
/// If the inputs differ in size.
pub fn mix(
    graph: &mut Graph,
    colour: Texture,
    specular: Texture,
    sharp: Texture,
    blurred: Option<Texture>,
    blend: Blend,
) -> Result<Texture, EffectError> {
    let picture = ("colour", size(graph, colour));
    for (name, input) in [
        ("specular", Some(specular)),
        ("sharp", Some(sharp)),
        ("blurred", blurred),
    ] {
        if let Some(input) = input {
            same_size("ssr", picture, (name, size(graph, input)))?;
        }
    }
    let result = texture(graph, "ssr.result", colour, Format::Rgba16Float);
    let mut pass = graph
        .compute("ssr/mix")
        .read("source", colour)
        .read("specular", specular)
        .read("sharp", sharp)
        .write("result", result)
        .feature("blurred", blurred.is_some())
        .constant("ADD", f64::from(u8::from(blend == Blend::Add)));
    if let Some(blurred) = blurred {
        pass = pass.read("blurred", blurred);
    }
    Ok(pass.per_texel("result")?)
}
