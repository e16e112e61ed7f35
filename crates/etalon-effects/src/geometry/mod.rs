//! Geometry: what is where on the screen, drawn from an engine's meshes.
//!
//! [`prepass`] draws depth and velocity in the order weapon, static, dynamic:
//! what covers most comes first, and what moves writes its own velocity while
//! that of all else follows from the camera's movement and depth. [`gbuffer`]
//! then draws each surface that is seen once, whatever lies behind it.
//!
//! Positions are computed in camera space with matrices multiplied in f64 on the
//! host, so that a mesh kilometres from the origin stays where it is. All kernels
//! compute them by the same operations, so that depth can be compared for
//! equality.
//!
//! After id Software's frame as A. Courrèges and S. Piotrowski describe it for
//! *Doom* (2016) and *Doom Eternal* (2020): a depth prepass in that order, with
//! velocity for what moves.

pub(crate) mod demand;
mod item;
mod view;

use etalon_core::Format;
use etalon_core::graph::{ClearValue, Draw, Graph, Load, Texture};
use etalon_core::raster::{CullMode, DepthState, FrontFace, RasterState};
use etalon_core::resource::{Compare, TextureDesc};
use glam::Vec2;

pub use item::{DrawClass, Item, Maps, Surface};
pub use view::View;

use crate::{DepthRange, EffectError};

/// Everything to be drawn in a frame.
#[derive(Clone, Copy, Debug)]
pub struct Geometry<'a> {
    /// The triangles, in any order: each pass puts them into its own.
    pub items: &'a [Item],
    /// Who looks at them.
    pub view: View,
    /// Pixels of the picture in x and y.
    pub size: [u32; 2],
}

/// What the prepass draws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prepass {
    /// `depth32float`: device depth as the camera has it.
    pub depth: Texture,
    /// `rg16float`: screen position now less that one frame earlier, in uv.
    pub velocity: Option<Texture>,
}

/// What there is to know of the surfaces that are seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GBuffer {
    /// `rgba16float`: linear light scattered per light received; alpha 1, 0 where
    /// there is no surface.
    pub colour: Texture,
    /// `rgba16float`: unit normals in view space, toward the camera; zero where
    /// there is no surface.
    pub normal: Texture,
    /// `rgba8unorm`: rgb mirrored at normal incidence; a: 1 − roughness.
    pub specular: Texture,
    /// `rgba16float`: radiance that surfaces give by themselves.
    pub emission: Texture,
    /// `depth32float`: device depth as the camera has it.
    pub depth: Texture,
}

/// No velocity of a pixel is as large: the camera alone moved.
const CAMERA_ALONE: f32 = 65504.0;

/// Draws depth, and velocity if it is asked for.
///
/// A frame's cost beside the draws is one pass over the picture for the velocity
/// of what only the camera moves.
///
/// # Errors
/// If an item or the view is invalid (see [`Item::validate`], [`View::validate`]),
/// or the graph refuses a pass.
pub fn prepass(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    with_velocity: bool,
) -> Result<Prepass, EffectError> {
    geometry.validate()?;
    let depth = geometry.target(graph, "depth", Format::Depth32Float);
    let clear = Load::Clear(ClearValue::Float([geometry.view.far_depth(); 4]));
    if !with_velocity {
        let draws = geometry.draws(|item| {
            item.surface
                .cut(geometry.placed(item, "geometry/depth", None))
        });
        let written = graph
            .raster("geometry/prepass")
            .depth(depth, clear)
            .draws(draws)
            .finish()?;
        return Ok(Prepass {
            depth: written.texture("depth")?,
            velocity: None,
        });
    }
    let [drawn, velocity] =
        ["drawn velocity", "velocity"].map(|name| geometry.target(graph, name, Format::Rg16Float));
    let texel = Vec2::new(geometry.size[0] as f32, geometry.size[1] as f32).recip();
    let draws = geometry.draws(|item| {
        // The difference in f64: of two matrices in f32 little would be left.
        let change = geometry.view.previous * item.previous - geometry.view.view * item.world;
        let draw = geometry.placed(item, "geometry/velocity", None);
        item.surface
            .cut(draw)
            .set("change", change.as_mat4())
            .set("texel", texel)
            .constant("MOVES", f64::from(item.class != DrawClass::Static))
    });
    let written = graph
        .raster("geometry/prepass")
        .colour(
            "velocity",
            drawn,
            Load::Clear(ClearValue::Float([CAMERA_ALONE; 4])),
        )
        .depth(depth, clear)
        .draws(draws)
        .finish()?;
    let (drawn, depth) = (written.texture("velocity")?, written.texture("depth")?);
    let camera = &geometry.view.camera;
    let fill = Draw::new("geometry/camera_velocity")
        .elements(0..3)
        .read("depth", depth)
        .read("drawn", drawn)
        .set("change", geometry.view.change().as_mat4())
        .set("projection_scale", camera.scale)
        .set("projection_centre", camera.centre)
        .set("depth_bias_slope", camera.depth_bias_slope())
        .set("distance_range", camera.distance_range());
    let velocity = graph
        .raster("geometry/camera velocity")
        .colour(
            "velocity",
            velocity,
            Load::Clear(ClearValue::Float([0.0; 4])),
        )
        .draw(fill)
        .finish()?
        .texture("velocity")?;
    Ok(Prepass {
        depth,
        velocity: Some(velocity),
    })
}

/// Draws what deferred effects read.
///
/// With the depth of a [`prepass`] each pixel is shaded once; without, as often
/// as something nearer is drawn after something farther.
///
/// # Errors
/// As [`prepass`].
pub fn gbuffer(
    graph: &mut Graph,
    geometry: &Geometry<'_>,
    prepass: Option<&Prepass>,
) -> Result<GBuffer, EffectError> {
    geometry.validate()?;
    let (state, depth, load) = geometry.against(graph, prepass);
    let draws = geometry.draws(|item| geometry.surfaced(item, "geometry/gbuffer", state));
    let colours = [
        ("colour", Format::Rgba16Float),
        ("normal", Format::Rgba16Float),
        ("specular", Format::Rgba8Unorm),
        ("emission", Format::Rgba16Float),
    ]
    .map(|(name, format)| (name, geometry.target(graph, name, format)));
    let mut pass = graph.raster("geometry/gbuffer").depth(depth, load);
    for (name, target) in colours {
        pass = pass.colour(name, target, Load::Clear(ClearValue::Float([0.0; 4])));
    }
    let written = pass.draws(draws).finish()?;
    let depth = match prepass {
        Some(prepass) => prepass.depth,
        None => written.texture("depth")?,
    };
    Ok(GBuffer {
        colour: written.texture("colour")?,
        normal: written.texture("normal")?,
        specular: written.texture("specular")?,
        emission: written.texture("emission")?,
        depth,
    })
}

impl Geometry<'_> {
    pub(crate) fn validate(&self) -> Result<(), EffectError> {
        self.view.validate()?;
        for item in self.items {
            item.validate()?;
        }
        Ok(())
    }

    pub(crate) fn target(&self, graph: &mut Graph, name: &str, format: Format) -> Texture {
        let [width, height] = self.size;
        graph.texture(name, TextureDesc::d2(width, height, format))
    }

    /// How draws are compared with depth, which one, and what it holds before: that
    /// of a prepass, or one of their own.
    pub(crate) fn against(
        &self,
        graph: &mut Graph,
        prepass: Option<&Prepass>,
    ) -> (DepthState, Texture, Load) {
        let nearer = self.view.nearer();
        match prepass {
            Some(prepass) => {
                let equal = DepthState {
                    compare: Compare::Equal,
                    write: false,
                    ..nearer
                };
                (equal, prepass.depth, Load::Keep)
            }
            None => {
                let depth = self.target(graph, "depth", Format::Depth32Float);
                let far = ClearValue::Float([self.view.far_depth(); 4]);
                (nearer, depth, Load::Clear(far))
            }
        }
    }

    /// A draw of every item: the weapon's first, then what stands still, then
    /// what moves.
    pub(crate) fn draws<'i>(&'i self, draw: impl Fn(&'i Item) -> Draw) -> Vec<Draw> {
        let seen = self.items.iter().filter(|item| !item.surface.is_cut_out());
        let mut items: Vec<&Item> = seen.collect();
        items.sort_by_key(|item| item.class);
        items.into_iter().map(draw).collect()
    }

    /// A draw of an item's triangles with all that `lib/surface` asks for.
    pub(crate) fn surfaced(&self, item: &Item, kernel: &'static str, depth: DepthState) -> Draw {
        let draw = self.placed(item, kernel, Some(depth));
        let normal = self.view.normal_matrix(item.world);
        item.surface.set(draw.set("normal_view", normal.as_mat4()))
    }

    /// A draw of an item's triangles where they are seen.
    fn placed(&self, item: &Item, kernel: &'static str, depth: Option<DepthState>) -> Draw {
        let world_view = self.view.view * item.world;
        let camera = &self.view.camera;
        let depth = depth.unwrap_or_else(|| self.view.nearer());
        let mut draw = Draw::new(kernel)
            .elements(item.elements.clone())
            .state(self.state(item, depth))
            .set("world_view", world_view.as_mat4())
            .set("projection_scale", camera.scale)
            .set("projection_centre", camera.centre)
            .set("depth_bias_slope", camera.depth_bias_slope());
        for (buffer, offset, layout) in &item.vertices {
            draw = draw.vertices(*buffer, *offset, layout.clone());
        }
        if let Some((buffer, offset, format)) = item.indices {
            draw = draw.indices(buffer, offset, format);
        }
        draw
    }
}

impl Geometry<'_> {
    /// Which faces of an item are drawn, and how they are compared with depth.
    pub(crate) fn state(&self, item: &Item, depth: DepthState) -> RasterState {
        let world_view = self.view.view * item.world;
        RasterState {
            front: if world_view.determinant() < 0.0 {
                FrontFace::Clockwise
            } else {
                FrontFace::CounterClockwise
            },
            cull: if item.surface.two_sided {
                CullMode::None
            } else {
                CullMode::Back
            },
            depth: Some(depth),
            ..RasterState::default()
        }
    }
}

impl View {
    /// Draws what is nearer.
    pub(crate) fn nearer(&self) -> DepthState {
        match self.camera.depth {
            DepthRange::ReversedInfinite | DepthRange::Reversed { .. } => DepthState::REVERSED,
            DepthRange::StandardInfinite | DepthRange::Standard { .. } => DepthState::STANDARD,
        }
    }

    /// The depth where nothing is.
    fn far_depth(&self) -> f32 {
        match self.camera.depth {
            DepthRange::ReversedInfinite | DepthRange::Reversed { .. } => 0.0,
            DepthRange::StandardInfinite | DepthRange::Standard { .. } => 1.0,
        }
    }
}
