//! Raster passes: draws into colour and depth targets.

use std::borrow::Cow;
use std::ops::Range;

use crate::format::SampleKind;
use crate::graph::handle::{Buffer, TextureView};
use crate::graph::pass::{AccessKind, KernelCall, Written, buffer, declare, texture};
use crate::graph::{Access, ClearValue, Graph, GraphError, ResourceDesc, UniformValue, Work};
use crate::raster::{
    IndexFormat, MAX_COLOUR_TARGETS, RasterState, RasterStateError, Scissor, VertexLayout, Viewport,
};
use crate::resource::{Dimension, SamplerDesc};

/// What a target holds before the first draw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// What it held.
    Keep,
    /// This, in every texel.
    Clear(ClearValue),
}

/// A part of a buffer that draws read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Slice {
    /// Of the pass's accesses.
    pub(crate) access: u32,
    /// First byte.
    pub(crate) offset: u64,
}

/// Elements of vertex buffers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Vertices {
    pub(crate) slice: Slice,
    pub(crate) layout: VertexLayout,
}

/// Indices of vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Indices {
    pub(crate) slice: Slice,
    pub(crate) format: IndexFormat,
}

/// How much a draw draws.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Extent {
    /// Vertices, or indices if there are any, and instances.
    Direct {
        elements: Range<u32>,
        base_vertex: i32,
        instances: Range<u32>,
    },
    /// So many of them, one after the other in a buffer.
    Indirect { arguments: Slice, draws: u32 },
}

/// A declared draw; its accesses are in the pass, from `accesses` on.
#[derive(Clone, Debug)]
pub(crate) struct DeclaredDraw {
    pub(crate) call: KernelCall,
    pub(crate) state: RasterState,
    pub(crate) vertices: Vec<Vertices>,
    pub(crate) indices: Option<Indices>,
    pub(crate) extent: Extent,
    /// The resources it binds, of the pass's accesses.
    pub(crate) accesses: Range<u32>,
}

/// What a raster pass does.
#[derive(Clone, Debug)]
pub(crate) struct RasterWork {
    /// Per colour target: what it holds before. The accesses come first in the
    /// pass, in this order, then that of the depth target.
    pub(crate) colours: Vec<Load>,
    pub(crate) depth: Option<Load>,
    pub(crate) viewport: Option<Viewport>,
    pub(crate) scissor: Option<Scissor>,
    pub(crate) draws: Vec<DeclaredDraw>,
}

/// One draw of a raster pass.
///
/// Bindings, uniform members and constants are given by the names they have in
/// the kernel, vertex inputs by the names in the layouts.
#[derive(Clone, Debug)]
#[must_use = "a draw is drawn by the pass that it is given to"]
pub struct Draw {
    call: KernelCall,
    state: RasterState,
    accesses: Vec<Access>,
    vertices: Vec<(Buffer, u64, VertexLayout)>,
    indices: Option<(Buffer, u64, IndexFormat)>,
    elements: Range<u32>,
    base_vertex: i32,
    instances: Range<u32>,
    indirect: Option<(Buffer, u64, u32)>,
}

impl Draw {
    /// Draws nothing yet, with the kernel at `path`: say how much by
    /// [`elements`](Self::elements) or [`indirect`](Self::indirect).
    pub fn new(path: impl Into<Cow<'static, str>>) -> Self {
        Self {
            call: KernelCall::new(path),
            state: RasterState::default(),
            accesses: Vec::new(),
            vertices: Vec::new(),
            indices: None,
            elements: 0..0,
            base_vertex: 0,
            instances: 0..1,
            indirect: None,
        }
    }

    /// Culling, depth and blending.
    pub fn state(mut self, state: RasterState) -> Self {
        self.state = state;
        self
    }

    /// Feeds the vertex kernel from a buffer, from byte `offset` on: a multiple
    /// of 4.
    pub fn vertices(mut self, source: Buffer, offset: u64, layout: VertexLayout) -> Self {
        self.vertices.push((source, offset, layout));
        self
    }

    /// Takes vertices in the order of indices, from byte `offset` of a buffer
    /// on: a multiple of an index's bytes.
    pub fn indices(mut self, source: Buffer, offset: u64, format: IndexFormat) -> Self {
        self.indices = Some((source, offset, format));
        self
    }

    /// Draws these vertices, or with indices these of them.
    pub fn elements(mut self, elements: Range<u32>) -> Self {
        self.elements = elements;
        self
    }

    /// Is added to every index; without indices it has no meaning.
    pub fn base_vertex(mut self, base: i32) -> Self {
        self.base_vertex = base;
        self
    }

    /// Draws these instances; by default one, 0.
    pub fn instances(mut self, instances: Range<u32>) -> Self {
        self.instances = instances;
        self
    }

    /// Draws as `draws` records from byte `offset` of `arguments` on say, which is
    /// a multiple of 4: without indices vertices, instances, first vertex and
    /// first instance, as four `u32`; with indices, five: indices, instances,
    /// first index, base vertex (`i32`) and first instance.
    pub fn indirect(mut self, arguments: Buffer, offset: u64, draws: u32) -> Self {
        self.indirect = Some((arguments, offset, draws));
        self
    }

    /// Reads a texture through the kernel's variable `binding`.
    pub fn read(
        mut self,
        binding: impl Into<Cow<'static, str>>,
        source: impl Into<TextureView>,
    ) -> Self {
        self.accesses
            .push(texture(binding, source.into(), AccessKind::Read));
        self
    }

    /// Reads a buffer through the kernel's variable `binding`.
    pub fn read_buffer(mut self, binding: impl Into<Cow<'static, str>>, source: Buffer) -> Self {
        self.accesses
            .push(buffer(binding, source, AccessKind::Read));
        self
    }

    /// Binds a sampler; see [`ComputePass::sampler`](super::ComputePass::sampler).
    pub fn sampler(mut self, binding: impl Into<Cow<'static, str>>, sampler: SamplerDesc) -> Self {
        self.call.samplers.push((binding.into(), sampler));
        self
    }

    /// Sets a member of the kernel's uniform block.
    pub fn set(
        mut self,
        member: impl Into<Cow<'static, str>>,
        value: impl Into<UniformValue>,
    ) -> Self {
        self.call.uniforms.push((member.into(), value.into()));
        self
    }

    /// Sets one of the kernel's `override` constants.
    pub fn constant(mut self, name: impl Into<Cow<'static, str>>, value: f64) -> Self {
        self.call.kernel.constants.push((name.into(), value));
        self
    }

    /// Sets a feature that the kernel's `@if` conditions ask for.
    pub fn feature(mut self, name: impl Into<Cow<'static, str>>, enabled: bool) -> Self {
        self.call.kernel.features.push((name.into(), enabled));
        self
    }
}

/// Declares one raster pass; see [`Graph::raster`].
///
/// Colour targets are given by the names of the fragment kernels' outputs, in the
/// order of their locations. Draws are drawn in the order given.
#[derive(Debug)]
#[must_use = "a pass is declared by `finish`"]
pub struct RasterPass<'g> {
    graph: &'g mut Graph,
    name: String,
    colours: Vec<(Access, Load)>,
    depth: Option<(Access, Load)>,
    viewport: Option<Viewport>,
    scissor: Option<Scissor>,
    draws: Vec<Draw>,
}

impl<'g> RasterPass<'g> {
    pub(crate) fn new(graph: &'g mut Graph, name: String) -> Self {
        Self {
            graph,
            name,
            colours: Vec::new(),
            depth: None,
            viewport: None,
            scissor: None,
            draws: Vec::new(),
        }
    }

    /// Draws colours into one mip and layer of a texture: what fragment kernels
    /// put out as `output`.
    pub fn colour(
        mut self,
        output: impl Into<Cow<'static, str>>,
        target: impl Into<TextureView>,
        load: Load,
    ) -> Self {
        self.colours.push((attachment(output, target, load), load));
        self
    }

    /// Compares and keeps depth in one mip and layer of a texture, whose new
    /// version is found as `depth`. Depth that is kept and that no draw writes has
    /// no new version.
    pub fn depth(mut self, target: impl Into<TextureView>, load: Load) -> Self {
        self.depth = Some((attachment(DEPTH, target, load), load));
        self
    }

    /// Maps clip space to a part of the targets; to all of them without it.
    pub fn viewport(mut self, viewport: Viewport) -> Self {
        self.viewport = Some(viewport);
        self
    }

    /// Draws to a part of the targets only. Clearing is of all.
    pub fn scissor(mut self, scissor: Scissor) -> Self {
        self.scissor = Some(scissor);
        self
    }

    /// Adds a draw.
    pub fn draw(mut self, draw: Draw) -> Self {
        self.draws.push(draw);
        self
    }

    /// Adds draws.
    pub fn draws(mut self, draws: impl IntoIterator<Item = Draw>) -> Self {
        self.draws.extend(draws);
        self
    }

    /// Declares the pass. The result has the new versions of the targets by the
    /// names of the outputs, and of the depth target as `depth`.
    ///
    /// # Errors
    /// If the declaration contradicts the graph or itself: targets of different
    /// sizes, of formats that cannot be drawn to, more than
    /// [`MAX_COLOUR_TARGETS`] or none; states that do not suit them; layouts and
    /// ranges that cannot be read; see [`GraphError`].
    pub fn finish(self) -> Result<Written, GraphError> {
        let Self {
            graph,
            name,
            colours,
            depth,
            viewport,
            scissor,
            draws,
        } = self;
        let size = targets(graph, &name, &colours, depth.as_ref())?;
        let refused = |error: RasterStateError| GraphError::Raster {
            pass: name.clone(),
            error: error.to_string(),
        };
        if let Some(viewport) = &viewport {
            viewport.validate(size[0], size[1]).map_err(refused)?;
        }
        if let Some(scissor) = &scissor {
            scissor.validate(size[0], size[1]).map_err(refused)?;
        }
        let mut work = RasterWork {
            colours: colours.iter().map(|(_, load)| *load).collect(),
            depth: depth.as_ref().map(|(_, load)| *load),
            viewport,
            scissor,
            draws: Vec::with_capacity(draws.len()),
        };
        let mut accesses: Vec<Access> = colours.into_iter().map(|(access, _)| access).collect();
        let writes = |draw: &Draw| draw.state.depth.is_some_and(|depth| depth.write);
        accesses.extend(depth.map(|(mut access, load)| {
            if load == Load::Keep && !draws.iter().any(writes) {
                access.kind = AccessKind::TargetTested;
            }
            access
        }));
        for (index, draw) in draws.into_iter().enumerate() {
            let declared = declared(draw, index as u32, &name, &work, &mut accesses)?;
            work.draws.push(declared);
        }
        declare(graph, name, Work::Raster(work), accesses)
    }
}

/// The name under which a pass's depth target is found.
const DEPTH: &str = "depth";

fn attachment(
    name: impl Into<Cow<'static, str>>,
    target: impl Into<TextureView>,
    load: Load,
) -> Access {
    let kind = match load {
        Load::Keep => AccessKind::TargetKept,
        Load::Clear(_) => AccessKind::Target,
    };
    texture(name, target.into(), kind)
}

/// Checks the targets; their size in pixels.
fn targets(
    graph: &Graph,
    pass: &str,
    colours: &[(Access, Load)],
    depth: Option<&(Access, Load)>,
) -> Result<[u32; 2], GraphError> {
    let refuse = |error: String| GraphError::Raster {
        pass: pass.to_owned(),
        error,
    };
    if colours.len() > MAX_COLOUR_TARGETS {
        return Err(refuse(format!(
            "it has {} colour targets; devices have {MAX_COLOUR_TARGETS}",
            colours.len()
        )));
    }
    let mut size = None;
    let colours = colours.iter().map(|target| (target, false));
    for ((access, load), is_depth) in colours.chain(depth.map(|target| (target, true))) {
        let range = super::pass::check(graph, pass, access)?;
        let name = &access.binding;
        let resource = &graph.resources[access.resource as usize];
        let ResourceDesc::Texture(desc) = resource.desc else {
            return Err(refuse(format!(
                "`{name}` is a buffer; targets are textures"
            )));
        };
        let format = desc.format;
        if desc.dimension == Dimension::D3 {
            return Err(refuse(format!("`{name}` is a 3D texture; targets are 2D")));
        }
        if (range.mips, range.layers) != (1, 1) {
            return Err(refuse(format!(
                "`{name}` is {} mips and {} layers; a target is one of each",
                range.mips, range.layers
            )));
        }
        if is_depth != (format.sample_kind() == SampleKind::Depth) || !format.renderable() {
            let wanted = if is_depth {
                "a depth"
            } else {
                "a renderable colour"
            };
            return Err(refuse(format!(
                "`{name}` is {format}; it must be {wanted} format"
            )));
        }
        if let Load::Clear(value) = load
            && !value.fits(format.sample_kind())
        {
            return Err(GraphError::ClearMismatch {
                pass: pass.to_owned(),
                format: format.to_string(),
                value: value.kind(),
            });
        }
        if let Load::Clear(ClearValue::Float([depth, ..])) = load
            && is_depth
            && !(0.0..=1.0).contains(depth)
        {
            return Err(refuse(format!(
                "`{name}` is cleared to {depth}; depth is from 0 to 1"
            )));
        }
        let extent = desc.mip_extent(range.mip);
        let this = [extent.width, extent.height];
        match size {
            None => size = Some(this),
            Some(first) if first != this => {
                return Err(refuse(format!(
                    "`{name}` is {}×{}, another target {}×{}; all must be equal",
                    this[0], this[1], first[0], first[1]
                )));
            }
            Some(_) => {}
        }
    }
    size.ok_or_else(|| refuse("it has no target to draw to".to_owned()))
}

/// Checks a draw and adds its accesses to those of the pass.
fn declared(
    draw: Draw,
    index: u32,
    pass: &str,
    work: &RasterWork,
    accesses: &mut Vec<Access>,
) -> Result<DeclaredDraw, GraphError> {
    let refuse = |error: String| GraphError::Raster {
        pass: pass.to_owned(),
        error: format!("draw {index}: {error}"),
    };
    let Draw {
        call,
        state,
        accesses: bound,
        vertices,
        indices,
        elements,
        base_vertex,
        instances,
        indirect,
    } = draw;
    let call = call.settled(pass)?;
    state
        .validate(work.colours.len())
        .map_err(|error| refuse(error.to_string()))?;
    if state.depth.is_some() && work.depth.is_none() {
        return Err(refuse(
            "its state compares depth, and the pass has none".to_owned(),
        ));
    }
    for (what, range) in [("elements", &elements), ("instances", &instances)] {
        if range.start > range.end {
            return Err(refuse(format!(
                "its {what} {range:?} end before they begin"
            )));
        }
    }
    let first = accesses.len() as u32;
    accesses.extend(bound.into_iter().map(|access| Access {
        draw: Some(index),
        ..access
    }));
    let end = accesses.len() as u32;
    let mut slice = |name: Cow<'static, str>, source, kind, offset: u64, multiple: u64| {
        if !offset.is_multiple_of(multiple) {
            return Err(refuse(format!(
                "{name} begin at byte {offset}; that must be a multiple of {multiple}"
            )));
        }
        accesses.push(Access {
            draw: Some(index),
            ..buffer(name, source, kind)
        });
        Ok(Slice {
            access: accesses.len() as u32 - 1,
            offset,
        })
    };
    let mut sources = Vec::with_capacity(vertices.len());
    for (number, (source, offset, layout)) in vertices.into_iter().enumerate() {
        layout
            .validate()
            .map_err(|error| refuse(error.to_string()))?;
        let name = format!("vertices {number}").into();
        let slice = slice(name, source, AccessKind::Vertices, offset, 4)?;
        sources.push(Vertices { slice, layout });
    }
    let indices = match indices {
        None => None,
        Some((source, offset, format)) => {
            let multiple = u64::from(format.bytes());
            let slice = slice(
                "indices".into(),
                source,
                AccessKind::Indices,
                offset,
                multiple,
            )?;
            Some(Indices { slice, format })
        }
    };
    let extent = match indirect {
        None => Extent::Direct {
            elements,
            base_vertex,
            instances,
        },
        Some((source, offset, draws)) => {
            let name = "indirect arguments".into();
            let arguments = slice(name, source, AccessKind::Indirect, offset, 4)?;
            Extent::Indirect { arguments, draws }
        }
    };
    Ok(DeclaredDraw {
        call,
        state,
        vertices: sources,
        indices,
        extent,
        accesses: first..end,
    })
}
