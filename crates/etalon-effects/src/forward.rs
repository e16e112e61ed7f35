//! Forward shading: surfaces lit as they are drawn, and glass over them.
//!
//! [`forward`] draws what is opaque in one pass: every lamp of a list, light from
//! everywhere, and what surfaces give. Its cost is the fragments drawn times lamps;
//! after a [`prepass`](crate::geometry::prepass) each pixel is one fragment.
//! Nothing is rounded on the way from a surface's maps to its light, so that it
//! agrees with [`lighting`](fn@crate::lighting::lighting) to what the G-buffer's
//! formats lose.
//!
//! [`glass`] then draws over it what is blended. What glass scatters counts by its
//! opacity, what it mirrors in full, and what is behind it shows by what is neither
//! covered nor mirrored. It does not bend light, nor colour what passes it.
//!
//! After id Software's frame as S. Piotrowski describes it for *Doom Eternal* (2020):
//! one forward pass with many lights that writes a thin G-buffer of normals and
//! specular colour beside the light.

pub(crate) mod demand;

use etalon_core::Format;
use etalon_core::graph::{Buffer, ClearValue, Draw, Graph, Load, Texture, TextureView, Written};
use etalon_core::raster::{Blend, CullMode, DepthState, TargetState};
use etalon_core::resource::BufferDesc;

use crate::check::Settings;
use crate::environment::{Around, Mirrored, Surroundings};
use crate::geometry::{Geometry, Item, Prepass, View};
use crate::lighting::PunctualLight;
use crate::{EffectError, SettingError};

/// Most lamps of a list.
pub const MAX_LAMPS: u32 = 1024;

/// Bytes of a lamp in a list.
const LAMP_BYTES: u64 = 64;

/// Lights in a buffer: [`lamp_bytes`] of the view that looks at them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Lamps {
    /// Holds 64 bytes for each.
    pub buffer: Buffer,
    /// How many are lit, up to [`MAX_LAMPS`]; each costs every fragment an evaluation
    /// of the reflection model.
    pub count: u32,
}

impl Lamps {
    /// Imports a buffer of so many lamps, or `None` for 0.
    ///
    /// # Errors
    /// If there are more than [`MAX_LAMPS`], or the name is taken.
    pub fn import(graph: &mut Graph, name: &str, count: u32) -> Result<Option<Self>, EffectError> {
        Settings("forward").count("lamps", count, 0, MAX_LAMPS)?;
        if count == 0 {
            return Ok(None);
        }
        let bytes = LAMP_BYTES * u64::from(count);
        let buffer = graph.import_buffer(name, BufferDesc { bytes })?;
        Ok(Some(Self { buffer, count }))
    }
}

/// Lights as the buffer of [`Lamps`] holds them, for one view.
///
/// # Errors
/// If a number is out of its range, or there are more than [`MAX_LAMPS`].
pub fn lamp_bytes(view: &View, lights: &[PunctualLight]) -> Result<Vec<u8>, SettingError> {
    view.validate()?;
    let count = u32::try_from(lights.len()).unwrap_or(u32::MAX);
    Settings("forward").count("lamps", count, 0, MAX_LAMPS)?;
    let mut bytes = Vec::with_capacity(lights.len() * LAMP_BYTES as usize);
    for light in lights {
        light.validate()?;
        let lamp = light.packed(view);
        let directional = if lamp.directional { 1.0 } else { 0.0 };
        for row in [
            lamp.place.extend(lamp.reach),
            lamp.direction.extend(directional),
            lamp.power.extend(lamp.cone_scale),
            glam::Vec4::new(lamp.cone_edge, 0.0, 0.0, 0.0),
        ] {
            bytes.extend(row.to_array().into_iter().flat_map(f32::to_le_bytes));
        }
    }
    Ok(bytes)
}

/// What lights surfaces.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lighting {
    /// Lights without extent, if there are any.
    pub lamps: Option<Lamps>,
    /// Light from everywhere, and what is behind everything.
    pub surroundings: Surroundings,
}

impl Lighting {
    fn validate(&self) -> Result<(), SettingError> {
        if let Some(lamps) = &self.lamps {
            Settings("forward").count("lamps", lamps.count, 0, MAX_LAMPS)?;
        }
        self.surroundings.validate()
    }

    /// Makes what is missing, once for all draws.
    fn ready(&self, graph: &mut Graph, mirrored: Mirrored) -> Result<Lit, EffectError> {
        let surroundings = Surroundings {
            mirrored,
            ..self.surroundings
        };
        let around = match surroundings.shine() {
            true => Some(surroundings.ready(graph)?),
            false => None,
        };
        Ok(Lit {
            lamps: self.lamps,
            around,
        })
    }
}

/// What draws bind to be lit.
struct Lit {
    lamps: Option<Lamps>,
    around: Option<Around>,
}

impl Lit {
    /// A draw of an item by `forward/shade`.
    fn draw(&self, geometry: &Geometry<'_>, item: &Item, depth: DepthState) -> Draw {
        let mut draw = geometry
            .surfaced(item, "forward/shade", depth)
            .feature("lit", true);
        if let Some(lamps) = self.lamps {
            draw = draw
                .feature("lamps", true)
                .read_buffer("lamps", lamps.buffer)
                .set("count", lamps.count);
        }
        match &self.around {
            Some(around) => around.light(draw, geometry.view.view),
            None => draw,
        }
    }
}

/// What forward shading draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// `rgba16float`: linear light towards the camera; alpha 1.
    pub light: Texture,
    /// `depth32float`: device depth as the camera has it.
    pub depth: Texture,
    /// What effects on the screen read of the surfaces, if it was asked for.
    pub thin: Option<ThinGBuffer>,
}

/// What reflections on the screen need beside light and depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThinGBuffer {
    /// `rgba16float`: unit normals in view space, toward the camera; zero where
    /// there is no surface.
    pub normal: Texture,
    /// `rgba8unorm`: rgb mirrored at normal incidence; a: 1 − roughness.
    pub specular: Texture,
}

/// Draws opaque surfaces as they are lit.
///
/// With the depth of a [`prepass`](crate::geometry::prepass) each pixel is shaded
/// once; without, as often as something nearer is drawn after something farther.
/// The thin G-buffer, written if `thin`, costs 12 bytes a fragment beside the 8 of
/// the light.
///
/// # Errors
/// If an item, the view or a light is invalid, or the graph refuses a pass.
pub fn forward(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    prepass: Option<&Prepass>,
    lighting: &Lighting,
    thin: bool,
) -> Result<Shaded, EffectError> {
    let light = geometry.target(graph, "forward light", Format::Rgba16Float);
    let written = opaque(graph, geometry, prepass, lighting, thin, light.into())?;
    Ok(Shaded {
        light: written.texture("light")?,
        depth: match prepass {
            Some(prepass) => prepass.depth,
            None => written.texture("depth")?,
        },
        thin: match thin {
            true => Some(ThinGBuffer {
                normal: written.texture("normal")?,
                specular: written.texture("specular")?,
            }),
            false => None,
        },
    })
}

/// As [`forward`], into a layer of a texture as large as the picture: the texture with
/// what is drawn.
pub(crate) fn forward_into(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    lighting: &Lighting,
    light: TextureView,
) -> Result<Texture, EffectError> {
    let written = opaque(graph, geometry, None, lighting, false, light)?;
    Ok(written.texture("light")?)
}

/// The pass of opaque surfaces.
fn opaque(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    prepass: Option<&Prepass>,
    lighting: &Lighting,
    thin: bool,
    light: TextureView,
) -> Result<Written, EffectError> {
    geometry.validate()?;
    lighting.validate()?;
    let lit = lighting.ready(graph, lighting.surroundings.mirrored)?;
    let (state, depth, load) = geometry.against(graph, prepass);
    let draws = geometry.draws(|item| lit.draw(geometry, item, state).feature("thin", thin));
    let background = lighting.surroundings.background.extend(1.0).to_array();
    let nothing = Load::Clear(ClearValue::Float([0.0; 4]));
    let beside = [
        ("normal", Format::Rgba16Float),
        ("specular", Format::Rgba8Unorm),
    ]
    .map(|(name, format)| thin.then(|| (name, geometry.target(graph, name, format))));
    let mut pass = graph.raster("forward/opaque").depth(depth, load).colour(
        "light",
        light,
        Load::Clear(ClearValue::Float(background)),
    );
    for (name, target) in beside.into_iter().flatten() {
        pass = pass.colour(name, target, nothing);
    }
    Ok(pass.draws(draws).finish()?)
}

/// Draws blended surfaces over `light`, hidden by what is nearer in `depth`.
///
/// Items are drawn in the order given, which has to be that from far to near; their
/// class means nothing here. Where light over light sums up to more than 65504 the
/// target holds infinity, which effects take for 65504. Of an item with two sides its back faces are drawn
/// first. Within one item triangles are drawn as they are indexed, so that only
/// convex ones come out right from everywhere.
///
/// # Errors
/// If an item, the view or a light is invalid, or the graph refuses the pass.
pub fn glass(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    light: Texture,
    depth: Texture,
    lighting: &Lighting,
) -> Result<Texture, EffectError> {
    geometry.validate()?;
    lighting.validate()?;
    let lit = lighting.ready(graph, Mirrored::Lit)?;
    let state = DepthState {
        write: false,
        ..geometry.view.nearer()
    };
    let mut draws = Vec::new();
    for item in geometry.items {
        let sides: &[CullMode] = match item.surface.two_sided {
            true => &[CullMode::Front, CullMode::Back],
            false => &[CullMode::Back],
        };
        for &cull in sides {
            let mut raster = geometry.state(item, state);
            raster.cull = cull;
            raster.targets = vec![TargetState {
                blend: Some(Blend::OVER),
                ..TargetState::default()
            }];
            let draw = lit.draw(geometry, item, state).feature("blended", true);
            draws.push(draw.state(raster));
        }
    }
    let written = graph
        .raster("forward/glass")
        .colour("light", light, Load::Keep)
        .depth(depth, Load::Keep)
        .draws(draws)
        .finish()?;
    Ok(written.texture("light")?)
}
