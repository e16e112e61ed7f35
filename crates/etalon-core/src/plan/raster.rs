//! Raster passes: what a step of draws is, and how its declaration is held
//! against the kernels.

use std::ops::Range;

use serde::Serialize;

use crate::Format;
use crate::format::SampleKind;
use crate::graph::{
    Access, ClearValue, DeclaredDraw, Extent, Graph, Load, Pass, RasterWork, ResourceDesc, Slice,
    Subresources,
};
use crate::kernel::{Kernel, KernelId, KernelLibrary, RasterStages, StageValue};
use crate::plan::bind::{Binder, BoundPass, Use, layout_conflict};
use crate::plan::error::Mismatch;
use crate::plan::{Bound, KernelRef, Plan, PlanError, PlanOptions, Step, Usage};
use crate::raster::{
    IndexFormat, NumberKind, RasterState, Scissor, StepMode, VertexAttribute, VertexFormat,
    Viewport,
};

/// One mip and layer of a texture that is drawn to.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub struct PlannedTarget {
    /// The texture: index into [`Plan::resources`](super::Plan::resources).
    pub resource: u32,
    /// The mip and layer.
    pub range: Subresources,
    /// What it is filled with before, as near as its format holds it; without it, it
    /// keeps what it holds.
    pub clear: Option<ClearValue>,
}

/// Where one input of a vertex kernel is in an element of a buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedAttribute {
    /// The input's `@location`.
    pub location: u32,
    /// How its numbers are stored.
    pub format: VertexFormat,
    /// Bytes from the beginning of the element.
    pub offset: u32,
}

/// The elements of a vertex buffer, as a kernel takes them.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedLayout {
    /// Bytes from one element to the next.
    pub stride: u32,
    /// When the next one is taken.
    pub step: StepMode,
    /// The inputs that the kernel has, by location; those it has not are left out.
    pub attributes: Vec<PlannedAttribute>,
}

/// A buffer that vertex kernels are fed from.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedVertices {
    /// The buffer: index into [`Plan::resources`](super::Plan::resources).
    pub buffer: u32,
    /// First byte.
    pub offset: u64,
    /// What its elements are.
    pub layout: PlannedLayout,
}

/// A buffer of indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedIndices {
    /// The buffer: index into [`Plan::resources`](super::Plan::resources).
    pub buffer: u32,
    /// First byte.
    pub offset: u64,
    /// How they are stored.
    pub format: IndexFormat,
}

/// How much a draw draws.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum DrawExtent {
    /// So much.
    Direct {
        /// Vertices, or indices if there are any.
        elements: Range<u32>,
        /// Is added to every index.
        base_vertex: i32,
        /// Instances.
        instances: Range<u32>,
    },
    /// As records in a buffer say: see [`Draw::indirect`](crate::graph::Draw::indirect).
    Indirect {
        /// The buffer: index into [`Plan::resources`](super::Plan::resources).
        buffer: u32,
        /// First byte.
        offset: u64,
        /// How many records there are.
        draws: u32,
    },
}

/// One draw.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub struct PlannedDraw {
    /// The kernel.
    pub kernel: KernelRef,
    /// What its bindings are given, in the order of [`Kernel::bindings`].
    pub bindings: Vec<Bound>,
    /// Culling, depth and blending, with a state for every colour target.
    pub state: RasterState,
    /// What the vertex kernel is fed from.
    pub vertices: Vec<PlannedVertices>,
    /// In which order, if not in theirs.
    pub indices: Option<PlannedIndices>,
    /// How much is drawn.
    pub extent: DrawExtent,
}

/// Draws into colour and depth targets.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub struct RasterStep {
    /// Pixels of every target in x and y.
    pub size: [u32; 2],
    /// Colour targets by location.
    pub colours: Vec<PlannedTarget>,
    /// The depth target.
    pub depth: Option<PlannedTarget>,
    /// What clip space is mapped to.
    pub viewport: Viewport,
    /// What is drawn to.
    pub scissor: Scissor,
    /// The draws, in order.
    pub draws: Vec<PlannedDraw>,
}

/// Everything about a draw that makes a pipeline: draws of one form can share it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct DrawForm {
    /// The kernel.
    pub kernel: KernelId,
    /// Culling, depth and blending.
    pub state: RasterState,
    /// What the vertex kernel is fed from.
    pub vertices: Vec<PlannedLayout>,
    /// Formats of the colour targets, by location.
    pub colours: Vec<Format>,
    /// The format of the depth target.
    pub depth: Option<Format>,
}

impl DrawForm {
    /// The form of a draw of a plan's step; `None` if a target is no texture,
    /// which planning makes none of.
    #[must_use]
    pub fn new(plan: &Plan, step: &RasterStep, draw: &PlannedDraw) -> Option<Self> {
        let format =
            |target: &PlannedTarget| match plan.resources.get(target.resource as usize)?.desc {
                ResourceDesc::Texture(desc) => Some(desc.format),
                ResourceDesc::Buffer(_) => None,
            };
        let vertices = draw.vertices.iter();
        Some(Self {
            kernel: draw.kernel.0.id,
            state: draw.state.clone(),
            vertices: vertices.map(|vertices| vertices.layout.clone()).collect(),
            colours: step.colours.iter().map(format).collect::<Option<_>>()?,
            depth: match &step.depth {
                Some(target) => Some(format(target)?),
                None => None,
            },
        })
    }
}

impl RasterStep {
    /// Every resource that the step names, to be numbered anew.
    pub(crate) fn resources_mut(&mut self) -> impl Iterator<Item = &mut u32> {
        let targets = self.colours.iter_mut().chain(&mut self.depth);
        let draws = self.draws.iter_mut().flat_map(|draw| {
            let bound = draw.bindings.iter_mut().filter_map(|bound| match bound {
                Bound::Texture { resource, .. } | Bound::Buffer { resource } => Some(resource),
                Bound::Uniform(_) | Bound::Sampler(_) => None,
            });
            let vertices = draw
                .vertices
                .iter_mut()
                .map(|vertices| &mut vertices.buffer);
            let indices = draw.indices.iter_mut().map(|indices| &mut indices.buffer);
            let arguments = match &mut draw.extent {
                DrawExtent::Indirect { buffer, .. } => Some(buffer),
                DrawExtent::Direct { .. } => None,
            };
            bound.chain(vertices).chain(indices).chain(arguments)
        });
        targets.map(|target| &mut target.resource).chain(draws)
    }
}

/// Most buffers that every device feeds a vertex kernel from.
const MAX_VERTEX_BUFFERS: usize = 8;

/// Most inputs that every device feeds a vertex kernel with.
const MAX_VERTEX_ATTRIBUTES: usize = 16;

/// Holds a raster pass against its kernels.
pub(crate) fn bind_raster(
    graph: &Graph,
    pass: &Pass,
    work: &RasterWork,
    kernels: &KernelLibrary,
    options: &PlanOptions<'_>,
    uniforms: &mut Vec<u8>,
) -> Result<BoundPass, PlanError> {
    let target = |access: &Access, load: Load| PlannedTarget {
        resource: access.resource,
        range: access.range,
        clear: match (load, &graph.resources[access.resource as usize].desc) {
            (Load::Keep, _) => None,
            (Load::Clear(value), ResourceDesc::Texture(desc)) => Some(value.rounded(desc.format)),
            (Load::Clear(value), ResourceDesc::Buffer(_)) => Some(value),
        },
    };
    let (targets, depth) = pass.accesses.split_at(work.colours.len());
    let colours = targets.iter().zip(&work.colours);
    let colours: Vec<_> = colours.map(|(a, load)| target(a, *load)).collect();
    let depth = work
        .depth
        .and_then(|load| Some(target(depth.first()?, load)));
    let mut uses: Vec<Use> = Vec::with_capacity(pass.accesses.len());
    for (index, access) in pass.accesses[..colours.len() + usize::from(depth.is_some())]
        .iter()
        .enumerate()
    {
        let usage = if index < colours.len() {
            Usage::ColourTarget
        } else {
            Usage::DepthTarget
        };
        uses.push(used(access, usage, access.kind.reads()));
    }
    let size = match pass.accesses.first() {
        Some(access) => match graph.resources[access.resource as usize].desc {
            ResourceDesc::Texture(desc) => {
                let extent = desc.mip_extent(access.range.mip);
                [extent.width, extent.height]
            }
            ResourceDesc::Buffer(_) => [0; 2],
        },
        None => [0; 2],
    };
    let mut draws = Vec::with_capacity(work.draws.len());
    for draw in &work.draws {
        let kernel = kernels
            .get(&draw.call.kernel, options.arithmetic)
            .map_err(|error| PlanError::Kernel {
                pass: pass.name.clone(),
                error: Box::new(error),
            })?;
        let Range { start, end } = draw.accesses;
        let drawn = Drawn {
            binder: Binder {
                graph,
                pass,
                accesses: &pass.accesses[start as usize..end as usize],
                kernel: &kernel,
                options,
            },
            draw,
            targets,
        };
        draws.push(drawn.bind(&kernel, uniforms, &mut uses)?);
    }
    if let Some((name, first, second)) = layout_conflict(graph, &uses) {
        return Err(PlanError::Mismatch {
            pass: pass.name.clone(),
            kernel: work
                .draws
                .first()
                .map_or("", |draw| &draw.call.kernel.path)
                .to_owned(),
            mismatch: Mismatch::Differs {
                name: name.to_owned(),
                given: format!("{first:?}"),
                wanted: format!("{second:?} too"),
            },
        });
    }
    let step = RasterStep {
        size,
        colours,
        depth,
        viewport: work
            .viewport
            .unwrap_or_else(|| Viewport::of(size[0], size[1])),
        scissor: work.scissor.unwrap_or(Scissor {
            x: 0,
            y: 0,
            width: size[0],
            height: size[1],
        }),
        draws,
    };
    Ok(BoundPass {
        step: Step::Raster(step),
        uses,
    })
}

const fn used(access: &Access, usage: Usage, keeps: bool) -> Use {
    Use {
        resource: access.resource,
        range: access.range,
        usage,
        keeps,
    }
}

/// Holds one draw against its kernel.
struct Drawn<'a> {
    binder: Binder<'a>,
    draw: &'a DeclaredDraw,
    /// The accesses of the colour targets.
    targets: &'a [Access],
}

impl Drawn<'_> {
    fn bind(
        &self,
        kernel: &std::sync::Arc<Kernel>,
        uniforms: &mut Vec<u8>,
        uses: &mut Vec<Use>,
    ) -> Result<PlannedDraw, PlanError> {
        let Self { binder, draw, .. } = self;
        let Some(stages) = kernel.raster() else {
            return Err(binder.differs(
                &kernel.name,
                "a draw",
                "a dispatch: it is a compute kernel",
            ));
        };
        let (bindings, bound) = binder.bindings(&draw.call, uniforms)?;
        uses.extend(bound);
        let mut state = draw.state.clone();
        state.targets.resize(self.targets.len(), Default::default());
        self.outputs(stages, &mut state)?;
        let vertices = self.vertices(&stages.vertex.inputs, uses)?;
        let indices = match draw.indices {
            None => None,
            Some(indices) => {
                let (buffer, bytes) = self.buffer(indices.slice, Usage::Indices, uses)?;
                if let Extent::Direct { elements, .. } = &draw.extent {
                    let each = u64::from(indices.format.bytes());
                    let end = indices.slice.offset + u64::from(elements.end) * each;
                    if elements.start < elements.end && end > bytes {
                        return Err(self.too_short(indices.slice, end, bytes));
                    }
                }
                Some(PlannedIndices {
                    buffer,
                    offset: indices.slice.offset,
                    format: indices.format,
                })
            }
        };
        let extent = match &draw.extent {
            Extent::Direct {
                elements,
                base_vertex,
                instances,
            } => DrawExtent::Direct {
                elements: elements.clone(),
                base_vertex: *base_vertex,
                instances: instances.clone(),
            },
            Extent::Indirect { arguments, draws } => {
                let (buffer, bytes) = self.buffer(*arguments, Usage::Indirect, uses)?;
                let record = if indices.is_some() { 20 } else { 16 };
                let end = arguments.offset.saturating_add(u64::from(*draws) * record);
                if end > bytes {
                    return Err(self.too_short(*arguments, end, bytes));
                }
                DrawExtent::Indirect {
                    buffer,
                    offset: arguments.offset,
                    draws: *draws,
                }
            }
        };
        Ok(PlannedDraw {
            kernel: KernelRef(kernel.clone()),
            bindings,
            state,
            vertices,
            indices,
            extent,
        })
    }

    /// Every output goes to the target of its name, which is at its location;
    /// targets without one are not written.
    fn outputs(&self, stages: &RasterStages, state: &mut RasterState) -> Result<(), PlanError> {
        let outputs = stages.fragment.as_ref().map(|fragment| &fragment.outputs);
        let outputs: &[StageValue] = outputs.map_or(&[], Vec::as_slice);
        for output in outputs {
            let name = &output.name;
            let Some(access) = self.targets.get(output.location as usize) else {
                return Err(self.binder.missing("colour target", name));
            };
            if access.binding != *name {
                return Err(self.binder.differs(
                    name,
                    format!("`{}` as target {}", access.binding, output.location),
                    format!("`{name}` there"),
                ));
            }
            let resource = &self.binder.graph.resources[access.resource as usize];
            let ResourceDesc::Texture(desc) = resource.desc else {
                continue;
            };
            if kind(desc.format.sample_kind()) != output.kind {
                return Err(self.binder.differs(
                    name,
                    desc.format.name(),
                    format!("a format of {:?} numbers", output.kind).to_lowercase(),
                ));
            }
            let blends = state.target(output.location as usize).blend.is_some();
            if blends && !desc.format.blendable() {
                return Err(self.binder.differs(
                    name,
                    format!("{} with blending", desc.format),
                    "a format that can be blended",
                ));
            }
        }
        for (location, target) in state.targets.iter_mut().enumerate() {
            if !outputs
                .iter()
                .any(|output| output.location as usize == location)
            {
                target.blend = None;
                target.writes = crate::raster::ColourWrites::NONE;
            }
        }
        Ok(())
    }

    /// Finds every input of the vertex kernel in the layouts.
    fn vertices(
        &self,
        inputs: &[StageValue],
        uses: &mut Vec<Use>,
    ) -> Result<Vec<PlannedVertices>, PlanError> {
        let sources = &self.draw.vertices;
        let name = &self.binder.kernel.name;
        for (what, given, most) in [
            ("vertex buffers", sources.len(), MAX_VERTEX_BUFFERS),
            ("vertex inputs", inputs.len(), MAX_VERTEX_ATTRIBUTES),
        ] {
            if given > most {
                let (given, most) = (format!("{given} {what}"), format!("at most {most}"));
                return Err(self.binder.differs(name, given, most));
            }
        }
        let attribute = |input: &StageValue| {
            sources.iter().enumerate().find_map(|(number, source)| {
                let named = |attribute: &&VertexAttribute| attribute.name == input.name;
                Some((number, source.layout.attributes.iter().find(named)?))
            })
        };
        let mut found: Vec<Vec<PlannedAttribute>> = vec![Vec::new(); sources.len()];
        for input in inputs {
            let Some((number, attribute)) = attribute(input) else {
                return Err(self.binder.missing("vertex input", &input.name));
            };
            if attribute.format.kind() != input.kind {
                return Err(self.binder.differs(
                    &input.name,
                    format!("{:?}", attribute.format),
                    format!("{:?} numbers", input.kind).to_lowercase(),
                ));
            }
            found[number].push(PlannedAttribute {
                location: input.location,
                format: attribute.format,
                offset: attribute.offset,
            });
        }
        let mut planned = Vec::with_capacity(sources.len());
        for (source, attributes) in sources.iter().zip(found) {
            let (buffer, bytes) = self.buffer(source.slice, Usage::Vertices, uses)?;
            let layout = &source.layout;
            if let Some(end) = self.last_element(layout.step) {
                let ends = attributes.iter().map(|a| a.offset + a.format.bytes());
                let tail = u64::from(ends.max().unwrap_or(0));
                let end = source.slice.offset + u64::from(end) * u64::from(layout.stride) + tail;
                if end > bytes {
                    return Err(self.too_short(source.slice, end, bytes));
                }
            }
            planned.push(PlannedVertices {
                buffer,
                offset: source.slice.offset,
                layout: PlannedLayout {
                    stride: layout.stride,
                    step: layout.step,
                    attributes,
                },
            });
        }
        Ok(planned)
    }

    /// The last element that is read, as far as the declaration tells: which
    /// vertices indices name only the device sees.
    fn last_element(&self, step: StepMode) -> Option<u32> {
        let Extent::Direct {
            elements,
            instances,
            ..
        } = &self.draw.extent
        else {
            return None;
        };
        if elements.is_empty() || instances.is_empty() {
            return None;
        }
        match step {
            StepMode::Instance => Some(instances.end - 1),
            StepMode::Vertex if self.draw.indices.is_none() => Some(elements.end - 1),
            StepMode::Vertex => None,
        }
    }

    /// The buffer of a slice and its bytes; it is used in this way.
    fn buffer(
        &self,
        slice: Slice,
        usage: Usage,
        uses: &mut Vec<Use>,
    ) -> Result<(u32, u64), PlanError> {
        let access = &self.binder.pass.accesses[slice.access as usize];
        let resource = &self.binder.graph.resources[access.resource as usize];
        match resource.desc {
            ResourceDesc::Buffer(desc) => {
                uses.push(used(access, usage, true));
                Ok((access.resource, desc.bytes))
            }
            ResourceDesc::Texture(_) => {
                Err(self
                    .binder
                    .differs(&access.binding, "a texture", "a buffer"))
            }
        }
    }

    fn too_short(&self, slice: Slice, end: u64, bytes: u64) -> PlanError {
        let access = &self.binder.pass.accesses[slice.access as usize];
        self.binder.differs(
            &access.binding,
            format!("{bytes} bytes"),
            format!("at least {end}"),
        )
    }
}

const fn kind(kind: SampleKind) -> NumberKind {
    match kind {
        SampleKind::Float | SampleKind::Depth => NumberKind::Float,
        SampleKind::Sint => NumberKind::Sint,
        SampleKind::Uint => NumberKind::Uint,
    }
}
