//! The passes of screen-space reflection, each on the whole picture or on tiles of it.

use etalon_core::Format;
use etalon_core::graph::{Graph, Texture};
use etalon_core::resource::TextureDesc;

use super::fallback::Fallback;
use super::{Blend, HitStorage, Search, Ssr};
use crate::check::{Settings, same_size, size};
use crate::hiz::{Build, Pyramid, pyramid};
use crate::scene::CameraParams;
use crate::tiles::{Area, Axis};
use crate::{EffectError, SceneInputs};

/// Which pixels are marched.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rate {
    /// Every one.
    Full,
    /// One in four: what comes of it has half the size, and its texel i is of pixel 2i.
    Quarter,
}

impl Rate {
    /// The name of a pass at this rate.
    fn named(self, name: &str) -> String {
        match self {
            Self::Full => name.to_owned(),
            Self::Quarter => format!("{name} quarter"),
        }
    }
}

/// A texture the size of `like`, of another format.
fn texture(graph: &mut Graph, name: &str, like: Texture, format: Format) -> Texture {
    let extent = graph.desc(like).extent;
    graph.texture(name, TextureDesc::d2(extent.width, extent.height, format))
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
    let marched = Marched::of(graph, depth, normal, *camera, settings)?;
    marched.at(graph, settings, Rate::Full, Area::Picture)
}

/// How the screen is searched, and over what.
#[derive(Clone, Copy)]
enum Over {
    /// Steps, with so many halvings of the last.
    Steps(u32),
    Texels,
    Squares(Pyramid),
}

/// What is marched, at whatever rates and in whatever places.
pub(super) struct Marched {
    depth: Texture,
    normal: Texture,
    camera: CameraParams,
    over: Over,
}

impl Marched {
    pub(super) fn new(
        graph: &mut Graph,
        inputs: &SceneInputs,
        settings: &Ssr,
    ) -> Result<Self, EffectError> {
        Self::of(graph, inputs.depth, inputs.normal, inputs.camera, settings)
    }

    fn of(
        graph: &mut Graph,
        depth: Texture,
        normal: Texture,
        camera: CameraParams,
        settings: &Ssr,
    ) -> Result<Self, EffectError> {
        settings.validate()?;
        camera.validate()?;
        // Steps as far apart as the largest picture is wide are no steps.
        Settings("ssr").range("resolution", settings.resolution, 1.0 / 16_384.0, 1.0)?;
        same_size(
            "ssr",
            ("depth", size(graph, depth)),
            ("normal", size(graph, normal)),
        )?;
        let over = match settings.search {
            Search::Linear => Over::Steps(0),
            Search::Refined => Over::Steps(settings.steps),
            Search::Dda => Over::Texels,
            Search::HiZ => Over::Squares(pyramid(graph, depth, &camera, Build::default())?),
        };
        Ok(Self {
            depth,
            normal,
            camera,
            over,
        })
    }

    /// [`march`] where it is asked for.
    pub(super) fn at(
        &self,
        graph: &mut Graph,
        settings: &Ssr,
        rate: Rate,
        area: Area,
    ) -> Result<Texture, EffectError> {
        let [width, height] = match rate {
            Rate::Full => size(graph, self.depth),
            Rate::Quarter => size(graph, self.depth).map(|side| side.div_ceil(2)),
        };
        let desc = TextureDesc::d2(width, height, settings.storage.format());
        let result = graph.texture("ssr.reflection", desc);
        let pass = graph
            .compute("ssr/march")
            .named(rate.named("ssr/march"))
            .feature("quarter", rate == Rate::Quarter)
            .read("depth", self.depth)
            .read("normal", self.normal)
            .feature("half", settings.storage == HitStorage::Half);
        let pass = self
            .camera
            .set(pass)
            .set("max_distance", settings.max_distance)
            .set("thickness", settings.thickness)
            .set("max_steps", settings.march_limit)
            .set("camera_fade", settings.camera_fade)
            .set("depth_fade", settings.depth_fade)
            .set("distance_fade", settings.distance_fade)
            .set("border", settings.border);
        let stride = 1.0 / settings.resolution;
        let pass = match self.over {
            Over::Steps(refinements) => pass.set("stride", stride).set("refinements", refinements),
            Over::Texels => pass.feature("dda", true).set("stride", stride),
            Over::Squares(pyramid) => pass
                .feature("hiz", true)
                .read("pyramid", pyramid.texture)
                .set("levels", pyramid.layout.levels()),
        };
        area.run(pass, result)
    }
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
    resolve_on(graph, reflection, colour, Rate::Full, Area::Picture)
}

/// [`resolve`] where it is asked for.
pub(super) fn resolve_on(
    graph: &mut Graph,
    reflection: Texture,
    colour: Texture,
    rate: Rate,
    area: Area,
) -> Result<Texture, EffectError> {
    let result = texture(graph, "ssr.sharp", reflection, Format::Rgba16Float);
    let pass = graph
        .compute("ssr/resolve")
        .named(rate.named("ssr/resolve"))
        .read("reflection", reflection)
        .read("source", colour);
    area.run(pass, result)
}

/// Box blur over `2 radius + 1` texels in each axis, in two passes.
///
/// The result is `rgba16float` of the size of `source`.
///
/// # Errors
/// If the radius is over 64.
pub fn blur(graph: &mut Graph, source: Texture, radius: u32) -> Result<Texture, EffectError> {
    blur_on(graph, source, radius, Rate::Full, [Area::Picture; 2])
}

/// [`blur`] of what was marched at a rate, each pass where it is asked for.
pub(super) fn blur_on(
    graph: &mut Graph,
    source: Texture,
    radius: u32,
    rate: Rate,
    [around, area]: [Area; 2],
) -> Result<Texture, EffectError> {
    Settings("ssr").count("blur_radius", radius, 0, 64)?;
    let mut along = |source, axis: Axis, name: &str, area: Area| {
        let result = texture(
            graph,
            &format!("ssr.blurred {name}"),
            source,
            Format::Rgba16Float,
        );
        let pass = graph
            .compute("ssr/blur")
            .named(rate.named(&format!("ssr/blur {name}")))
            .read("source", source)
            .set("axis", axis.step())
            .set("radius", radius as i32);
        area.run(pass, result)
    };
    let across = along(source, Axis::X, "x", around)?;
    along(across, Axis::Y, "y", area)
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
    let layers = Layers {
        colour,
        specular,
        sharp,
        blurred,
        smoother: None,
        fallback: None,
    };
    let result = layers.result(graph)?;
    layers.mix(graph, blend, result, Area::Picture, "ssr/mix")
}

/// A texture for a result that is laid over a picture.
pub(super) fn result_over(graph: &mut Graph, colour: Texture) -> Texture {
    texture(graph, "ssr.result", colour, Format::Rgba16Float)
}

/// What [`mix`] puts together.
#[derive(Clone, Copy)]
pub(super) struct Layers<'a> {
    pub(super) colour: Texture,
    pub(super) specular: Texture,
    pub(super) sharp: Texture,
    pub(super) blurred: Option<Texture>,
    /// Surfaces of at least this roughness are left as they are.
    pub(super) smoother: Option<f32>,
    /// What is seen where the screen has no answer.
    pub(super) fallback: Option<&'a Fallback<'a>>,
}

impl Layers<'_> {
    /// A texture for the result, if the layers fit onto each other.
    pub(super) fn result(&self, graph: &mut Graph) -> Result<Texture, EffectError> {
        let picture = ("colour", size(graph, self.colour));
        for (name, input) in [
            ("specular", Some(self.specular)),
            ("sharp", Some(self.sharp)),
            ("blurred", self.blurred),
        ] {
            if let Some(input) = input {
                same_size("ssr", picture, (name, size(graph, input)))?;
            }
        }
        Ok(result_over(graph, self.colour))
    }

    /// [`mix`] where it is asked for, in a pass of some name.
    pub(super) fn mix(
        &self,
        graph: &mut Graph,
        blend: Blend,
        result: Texture,
        area: Area,
        name: &str,
    ) -> Result<Texture, EffectError> {
        let mut pass = graph
            .compute("ssr/mix")
            .named(name)
            .read("source", self.colour)
            .read("specular", self.specular)
            .read("sharp", self.sharp)
            .feature("blurred", self.blurred.is_some())
            .constant("ADD", f64::from(u8::from(blend == Blend::Add)));
        if let Some(blurred) = self.blurred {
            pass = pass.read("blurred", blurred);
        }
        if let Some(limit) = self.smoother {
            pass = pass.feature("smoother", true).set("quarter_from", limit);
        }
        if let Some(fallback) = self.fallback {
            pass = fallback.with_surfaces(pass);
        }
        area.run(pass, result)
    }
}
