//! Planning: from a [`Graph`] to a [`Plan`] that a backend runs as it stands.
//!
//! Planning is one function made of named phases, each a module of its own:
//!
//! 1. `cull`: what no output asks for goes, transitively.
//! 2. `order`: passes are put in an order that respects every version, and
//!    that does not depend on the order in which unrelated effects were added.
//! 3. `bind`: the kernels of what is left are compiled (or found compiled),
//!    their reflection is held against the declaration, uniform blocks are
//!    packed and workgroups counted.
//! 4. `lifetime`: when each resource is first and last used.
//! 5. `alias`: transient resources that live at different times share memory.
//! 6. `barrier`: what must be waited for and made visible before each pass.
//!
//! What was [decided](Graph::decide) of effects before is told with the rest: the
//! plan has a reason for every effect, every pass that runs and every one that does
//! not.
//!
//! The result is plain data: printable, comparable, serialisable to JSON, the
//! same for the same input. A backend may not reorder, add or drop work.
//!
//! # At rest
//! Between runs, imports, outputs and histories are *at rest*: textures in
//! [`Usage::Sampled`], buffers in [`Usage::StorageRead`]. A plan finds them so
//! and leaves them so.

mod alias;
mod barrier;
mod bind;
mod count;
mod cull;
mod error;
mod explain;
mod lifetime;
mod memory;
mod order;
mod raster;
#[cfg(test)]
mod tests;

use std::hash::{DefaultHasher, Hash, Hasher};
use std::sync::Arc;

use serde::{Serialize, Serializer};

pub use error::PlanError;
pub use memory::{MemoryAtStep, TransientMemory};
pub use raster::{
    DrawExtent, DrawForm, PlannedAttribute, PlannedDraw, PlannedIndices, PlannedLayout,
    PlannedTarget, PlannedVertices, RasterStep,
};

use crate::graph::{ClearValue, Decision, Graph, ResourceDesc, Subresources};
use crate::kernel::{Arithmetic, Kernel, KernelLibrary};
use crate::resource::{BufferDesc, Limits, SamplerDesc, TextureDesc};

/// What is copied back to the host as the plan runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
pub enum Capture {
    /// Nothing: what an engine's frame wants.
    #[default]
    None,
    /// Every output, at the end.
    Outputs,
    /// Everything each pass writes, right after it: for comparing executors.
    EveryPass,
}

/// How much memory a device needs for a resource.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryNeed {
    /// Bytes.
    pub bytes: u64,
    /// Alignment in bytes, a power of two.
    pub alignment: u64,
}

/// A device's answer to how much memory its resources take, so that aliasing
/// can be planned before anything exists.
pub trait MemoryModel {
    /// The need of a texture used in these ways.
    fn texture(&self, desc: &TextureDesc, usages: UsageSet) -> MemoryNeed;
    /// The need of a buffer used in these ways.
    fn buffer(&self, desc: &BufferDesc, usages: UsageSet) -> MemoryNeed;
}

/// Texels packed tightly, aligned to 256 bytes: the model of executors without
/// a layout of their own.
#[derive(Clone, Copy, Debug, Default)]
pub struct TightMemory;

impl MemoryModel for TightMemory {
    fn texture(&self, desc: &TextureDesc, _: UsageSet) -> MemoryNeed {
        MemoryNeed {
            bytes: desc.bytes().unwrap_or(u64::MAX),
            alignment: 256,
        }
    }

    fn buffer(&self, desc: &BufferDesc, _: UsageSet) -> MemoryNeed {
        MemoryNeed {
            bytes: desc.bytes,
            alignment: 256,
        }
    }
}

/// What planning must know beside the graph.
#[derive(Clone, Copy)]
pub struct PlanOptions<'a> {
    /// Strict arithmetic gives the same bits everywhere; fast arithmetic uses
    /// the device's own functions and filters.
    pub arithmetic: Arithmetic,
    /// The device's limits; descriptions over them are refused.
    pub limits: Limits,
    /// What to copy back.
    pub capture: Capture,
    /// How the device lays out memory.
    pub memory: &'a dyn MemoryModel,
}

impl Default for PlanOptions<'_> {
    fn default() -> Self {
        Self {
            arithmetic: Arithmetic::Fast,
            limits: Limits::default(),
            capture: Capture::None,
            memory: &TightMemory,
        }
    }
}

impl std::fmt::Debug for PlanOptions<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PlanOptions")
            .field("arithmetic", &self.arithmetic)
            .field("limits", &self.limits)
            .field("capture", &self.capture)
            .finish_non_exhaustive()
    }
}

/// One way of using a resource, and with it a Vulkan layout, stage and access.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[repr(u8)]
pub enum Usage {
    /// Texture loads and samples (`SHADER_READ_ONLY_OPTIMAL`).
    Sampled,
    /// Reads through a storage binding (`GENERAL`).
    StorageRead,
    /// Writes through a storage binding that reads nothing (`GENERAL`).
    StorageWrite,
    /// Reads and writes through a storage binding (`GENERAL`).
    StorageUpdate,
    /// Source of a copy (`TRANSFER_SRC_OPTIMAL`).
    CopySource,
    /// Target of a copy or a clear (`TRANSFER_DST_OPTIMAL`).
    CopyTarget,
    /// Workgroup counts of an indirect dispatch, or the extents of indirect draws.
    Indirect,
    /// Colour target of draws (`COLOR_ATTACHMENT_OPTIMAL`).
    ColourTarget,
    /// Depth target of draws (`DEPTH_STENCIL_ATTACHMENT_OPTIMAL`).
    DepthTarget,
    /// What vertex kernels are fed from.
    Vertices,
    /// Indices of vertices.
    Indices,
}

impl Usage {
    const ALL: [Self; 11] = [
        Self::Sampled,
        Self::StorageRead,
        Self::StorageWrite,
        Self::StorageUpdate,
        Self::CopySource,
        Self::CopyTarget,
        Self::Indirect,
        Self::ColourTarget,
        Self::DepthTarget,
        Self::Vertices,
        Self::Indices,
    ];

    /// Whether contents may change.
    #[must_use]
    pub const fn writes(self) -> bool {
        matches!(
            self,
            Self::StorageWrite
                | Self::StorageUpdate
                | Self::CopyTarget
                | Self::ColourTarget
                | Self::DepthTarget
        )
    }

    /// Whether two usages of a texture can follow each other without a change
    /// of its layout.
    #[must_use]
    pub const fn same_layout(self, other: Self) -> bool {
        const fn layout(usage: Usage) -> u8 {
            match usage {
                Usage::Sampled => 0,
                Usage::StorageRead | Usage::StorageWrite | Usage::StorageUpdate => 1,
                Usage::CopySource => 2,
                Usage::CopyTarget => 3,
                Usage::ColourTarget => 4,
                Usage::DepthTarget => 5,
                // Of buffers, which have no layout.
                Usage::Indirect | Usage::Vertices | Usage::Indices => 6,
            }
        }
        layout(self) == layout(other)
    }
}

/// A set of [`Usage`]s.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct UsageSet(u16);

impl UsageSet {
    /// The empty set.
    pub const EMPTY: Self = Self(0);

    /// Every usage there is.
    pub const ALL: Self = Self((1 << Usage::ALL.len()) - 1);

    /// The set with `usage` in it.
    #[must_use]
    pub const fn with(self, usage: Usage) -> Self {
        Self(self.0 | 1 << usage as u8)
    }

    /// The usages of either.
    #[must_use]
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether `usage` is in it.
    #[must_use]
    pub const fn contains(self, usage: Usage) -> bool {
        self.0 & 1 << usage as u8 != 0
    }

    /// Whether nothing is in it.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The usages in it, in a fixed order.
    pub fn iter(self) -> impl Iterator<Item = Usage> {
        Usage::ALL
            .into_iter()
            .filter(move |usage| self.contains(*usage))
    }
}

impl From<Usage> for UsageSet {
    fn from(usage: Usage) -> Self {
        Self::EMPTY.with(usage)
    }
}

impl std::fmt::Debug for UsageSet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_set().entries(self.iter()).finish()
    }
}

impl Serialize for UsageSet {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.iter())
    }
}

/// Something to wait for and make visible before a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Barrier {
    /// Index into [`Plan::resources`].
    pub resource: u32,
    /// The mips and layers concerned.
    pub range: Subresources,
    /// The uses to wait for. Empty means the first use of memory nobody has
    /// used in this run: wait for the previous run on the same queue.
    pub from: UsageSet,
    /// The layout the contents are in; `None` if they need not be kept.
    pub layout: Option<Usage>,
    /// The use to come.
    pub to: Usage,
}

/// What a resource is to the plan.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum ResourceKind {
    /// Given by the caller under this name.
    Import(String),
    /// Kept for the caller after the run, under these names.
    Output(Vec<String>),
    /// A history as the last frame left it: index into [`Plan::histories`].
    HistoryPrevious(u32),
    /// A history as this frame writes it: index into [`Plan::histories`].
    HistoryCurrent(u32),
    /// Needed within the frame only.
    Transient(Placement),
}

/// Where a transient resource lives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct Placement {
    /// Byte offset into the plan's texture or buffer heap.
    pub offset: u64,
    /// Bytes there.
    pub bytes: u64,
    /// For executors that reuse whole resources rather than memory: transients
    /// of one slot have equal descriptions and never live at the same time.
    pub slot: u32,
}

/// A resource of a plan.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedResource {
    /// Name, unique in the plan.
    pub name: String,
    /// Shape.
    pub desc: ResourceDesc,
    /// What it is.
    pub kind: ResourceKind,
    /// Every use this plan makes of it.
    pub usages: UsageSet,
    /// Index of the first step that uses it.
    pub first: u32,
    /// Index of the last step that uses it.
    pub last: u32,
}

/// A history of a plan.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub struct PlannedHistory {
    /// Its name across frames.
    pub name: String,
    /// Its shape; another shape under the same name starts anew.
    pub desc: TextureDesc,
    /// The resource read, if anything reads it.
    pub previous: u32,
    /// The resource written.
    pub current: u32,
    /// What `previous` holds in the first frame.
    pub initial: ClearValue,
}

/// A kernel as a plan refers to it: compared, hashed and printed by identity.
#[derive(Clone)]
pub struct KernelRef(pub Arc<Kernel>);

impl std::fmt::Debug for KernelRef {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0.name)
    }
}

impl PartialEq for KernelRef {
    fn eq(&self, other: &Self) -> bool {
        self.0.id == other.0.id
    }
}

impl Eq for KernelRef {}

impl Hash for KernelRef {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.0.id.hash(state);
    }
}

impl Serialize for KernelRef {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0.name)
    }
}

/// Bytes of [`Plan::uniforms`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct UniformSlice {
    /// First byte, a multiple of the device's uniform alignment.
    pub offset: u32,
    /// Number of bytes.
    pub size: u32,
}

/// What one binding of a kernel is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Bound {
    /// Some mips and layers of a texture: index into [`Plan::resources`].
    Texture {
        /// The texture.
        resource: u32,
        /// The part of it.
        range: Subresources,
    },
    /// A whole buffer: index into [`Plan::resources`].
    Buffer {
        /// The buffer.
        resource: u32,
    },
    /// A uniform block.
    Uniform(UniformSlice),
    /// A sampler.
    Sampler(SamplerDesc),
}

/// How many workgroups run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
pub enum Groups {
    /// So many in x, y and z. May be zero.
    Direct([u32; 3]),
    /// Three `u32` at a byte offset of a buffer: index into [`Plan::resources`].
    Indirect {
        /// The buffer.
        buffer: u32,
        /// The byte.
        offset: u64,
    },
}

/// What a step does.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub enum Step {
    /// Runs a kernel.
    Dispatch {
        /// The kernel.
        kernel: KernelRef,
        /// What its bindings are given, in the order of [`Kernel::bindings`].
        bindings: Vec<Bound>,
        /// How much of it.
        groups: Groups,
    },
    /// Draws.
    Raster(RasterStep),
    /// Fills part of a texture.
    ClearTexture {
        /// The texture.
        resource: u32,
        /// The part.
        range: Subresources,
        /// With what.
        value: ClearValue,
    },
    /// Fills a buffer with zeros.
    ClearBuffer {
        /// The buffer.
        resource: u32,
    },
    /// Copies part of a texture.
    CopyTexture {
        /// From.
        source: (u32, Subresources),
        /// To, of equal shape.
        target: (u32, Subresources),
    },
    /// Copies a whole buffer.
    CopyBuffer {
        /// From.
        source: u32,
        /// To, of equal size.
        target: u32,
    },
    /// Copies a resource back to the host.
    Capture {
        /// The resource.
        resource: u32,
        /// The part of it.
        range: Subresources,
        /// The pass that wrote it.
        pass: String,
        /// The pass's binding, or the output's name.
        binding: String,
    },
}

/// One step of a plan, in order.
#[derive(Clone, Debug, PartialEq, Hash, Serialize)]
pub struct PlannedStep {
    /// The pass's name, unique in the plan.
    pub name: String,
    /// The effect it belongs to: what its name has before the first slash; empty for
    /// clears, copies and captures.
    pub effect: String,
    /// Why it runs.
    pub reason: String,
    /// The output or history for whose sake it runs, the first by name of several;
    /// empty for captures.
    pub goal: String,
    /// What must happen before it.
    pub barriers: Vec<Barrier>,
    /// What it does.
    pub step: Step,
}

/// A pass that does not run.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct CulledPass {
    /// The pass's name.
    pub name: String,
    /// Why not.
    pub reason: String,
}

/// What became of an effect.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize)]
pub struct PlannedEffect {
    /// What its passes' names begin with, or the name of a part of an effect.
    pub name: String,
    /// What was decided of it.
    pub decision: Decision,
    /// How many of its passes run.
    pub passes: u32,
    /// How many were declared and do not run.
    pub culled: u32,
}

/// What to run, in what order, in which memory. See the [module documentation](self).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Plan {
    /// Which arithmetic its kernels use.
    pub arithmetic: Arithmetic,
    /// What runs, in order.
    pub steps: Vec<PlannedStep>,
    /// What must happen after the last step to leave things at rest.
    pub final_barriers: Vec<Barrier>,
    /// What the steps use, in the order of first use.
    pub resources: Vec<PlannedResource>,
    /// What lives across frames.
    pub histories: Vec<PlannedHistory>,
    /// Bytes of the heap that transient textures share.
    pub texture_heap: u64,
    /// Bytes of the heap that transient buffers share.
    pub buffer_heap: u64,
    /// Alignment of both heaps.
    pub heap_alignment: u64,
    /// Bytes that transients would take if nothing were shared.
    pub unaliased_bytes: u64,
    /// What does not run, and why, by name.
    pub culled: Vec<CulledPass>,
    /// What became of every effect, by name. Not part of the
    /// [structure](Self::structure).
    pub effects: Vec<PlannedEffect>,
    /// Contents of all uniform blocks. Not part of the [structure](Self::structure).
    pub uniforms: Vec<u8>,
}

impl Plan {
    /// Plans a graph.
    ///
    /// Time and memory grow linearly with the number of passes, given that the
    /// kernels have been compiled before.
    ///
    /// # Errors
    /// A [`PlanError`] that names the pass, the resource, or the place in the
    /// kernel that is wrong.
    pub fn new(
        graph: &Graph,
        kernels: &KernelLibrary,
        options: &PlanOptions<'_>,
    ) -> Result<Self, PlanError> {
        let live = cull::cull(graph)?;
        let order = order::order(graph, &live)?;
        let bound = bind::bind(graph, &live, &order, kernels, options)?;
        let steps = lifetime::steps(graph, &live, bound, &order, options.capture);
        let placed = alias::place(steps, options.memory)?;
        Ok(barrier::finish(placed, options.arithmetic))
    }

    /// A number that is equal for plans that differ in nothing but the values
    /// of uniforms: whoever has prepared for one can run the other.
    #[must_use]
    pub fn structure(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.arithmetic.hash(&mut hasher);
        self.steps.hash(&mut hasher);
        self.final_barriers.hash(&mut hasher);
        self.resources.hash(&mut hasher);
        self.histories.hash(&mut hasher);
        (
            self.texture_heap,
            self.buffer_heap,
            self.heap_alignment,
            self.uniforms.len(),
        )
            .hash(&mut hasher);
        hasher.finish()
    }

    /// The index of the resource that holds an output.
    #[must_use]
    pub fn output(&self, name: &str) -> Option<u32> {
        let holds = |resource: &PlannedResource| match &resource.kind {
            ResourceKind::Output(names) => names.iter().any(|candidate| candidate == name),
            _ => false,
        };
        self.resources
            .iter()
            .position(holds)
            .map(|index| index as u32)
    }

    /// The plan as JSON, for other programs.
    ///
    /// # Errors
    /// None that a plan can cause; a full disk or the like of the serialiser.
    pub fn to_json(&self) -> serde_json::Result<String> {
        serde_json::to_string_pretty(self)
    }
}
