//! Instructions other than arithmetic.

use std::fmt;

use super::chain::Chain;
use super::subgroup::SubgroupFunction;
use super::{Arith, Check, Class, Perturbed};

/// What a kernel is told about its place in the dispatch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Input {
    /// `local_invocation_id`, by axis.
    LocalId(u8),
    /// `local_invocation_index`.
    LocalIndex,
    /// `workgroup_id`, by axis.
    WorkgroupId(u8),
    /// `workgroup_id.x` where a batch may hold several workgroups, next to each
    /// other in x.
    BatchedWorkgroupX,
    /// `global_invocation_id`, by axis.
    GlobalId {
        axis: u8,
        /// Invocations of a workgroup along the axis.
        size: u32,
    },
    /// `num_workgroups`, by axis.
    NumWorkgroups(u8),
    /// `subgroup_size`.
    SubgroupSize,
    /// All ones in lanes that hold an invocation.
    ActiveLanes,
    /// What a vertex or fragment kernel is given, by its slot.
    Stage(u16),
}

/// Memory addressed by slots of one class, not by bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Memory {
    /// One copy per invocation.
    Private,
    /// One copy per workgroup.
    Workgroup,
}

/// A read-modify-write operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum AtomicFunction {
    Add,
    Sub,
    And,
    Or,
    Xor,
    MinS,
    MaxS,
    MinU,
    MaxU,
    Exchange,
    /// Operands are the expected and the new value.
    CompareExchange,
}

/// How the texels of an image are addressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct ImageAccess {
    /// Index into the program's bindings.
    pub(crate) image: u16,
    /// Number of coordinates: 2, 3 for 3D and cube directions, 1 for filtered
    /// reads of one dimension.
    pub(crate) coordinates: u8,
    /// Whether a layer (or cube) index follows the coordinates.
    pub(crate) layered: bool,
    /// Whether coordinates are a direction into a cube.
    pub(crate) cube: bool,
}

/// How a filtered read differs from the plain one at a given level of detail.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct Sampling {
    /// Added to texel coordinates.
    pub(crate) offset: [i8; 3],
    /// Whether a reference is compared with the texels.
    pub(crate) compare: bool,
    /// Whether derivatives are given in place of the level.
    pub(crate) gradient: bool,
    /// Whether something to add to the level follows the derivatives.
    pub(crate) bias: bool,
    /// Whether coordinates are kept half a texel from the edges of level 0.
    pub(crate) clamp: bool,
}

/// Facts about an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum ImageQuery {
    /// Texels along an axis, of the level given.
    Size(u8),
    Levels,
    Layers,
}

/// What an instruction does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Op {
    Arith(Arith),
    Chain(Chain),
    Input(Input),
    /// Copies the operand: what variables become.
    Move(Class),
    /// An element of a constant table.
    Table {
        table: u32,
        class: Class,
    },
    /// A word of a uniform or storage buffer; the word's index is `offset` plus
    /// the operand, if there is one. `constant` where nobody can write it.
    BufferLoad {
        buffer: u16,
        offset: u32,
        class: Class,
        constant: bool,
    },
    /// Operands: the value, then the index if there is one.
    BufferStore {
        buffer: u16,
        offset: u32,
        class: Class,
    },
    /// One half of a word. Operands: its 16 bits, 0 or 16 for the lower or upper
    /// half, then the index if there is one.
    BufferStoreHalf {
        buffer: u16,
        offset: u32,
    },
    /// The number of elements of a runtime-sized array.
    BufferLength {
        buffer: u16,
        offset: u32,
        stride: u32,
    },
    /// Operands: value(s), then the index if there is one. Results: the old value.
    BufferAtomic {
        buffer: u16,
        offset: u32,
        function: AtomicFunction,
    },
    /// A slot of memory; the slot is `slot` plus the operand, if there is one.
    MemoryLoad {
        memory: Memory,
        slot: u32,
        class: Class,
    },
    /// Operands: the value, then the index if there is one.
    MemoryStore {
        memory: Memory,
        slot: u32,
        class: Class,
    },
    /// Like [`Op::BufferAtomic`] on workgroup memory.
    WorkgroupAtomic {
        slot: u32,
        function: AtomicFunction,
    },
    /// Operands: coordinates, layer, level (absent for storage images). Results: four channels.
    ImageLoad {
        access: ImageAccess,
        class: Class,
        level: bool,
    },
    /// Operands: coordinates, layer, four channels.
    ImageStore {
        access: ImageAccess,
        class: Class,
    },
    /// Operands: coordinates, layer, reference, and the level or the derivatives
    /// along x and y. Results: four channels.
    ImageSample {
        access: ImageAccess,
        sampler: u16,
        sampling: Sampling,
    },
    /// Operands: coordinates, layer, reference. Results: one channel of the four
    /// texels that a linear filter would read of level 0.
    ImageGather {
        access: ImageAccess,
        sampler: u16,
        channel: u8,
        offset: [i8; 2],
        compare: bool,
        class: Class,
    },
    /// Operands: coordinates, layer, value.
    ImageAtomic {
        access: ImageAccess,
        function: AtomicFunction,
    },
    /// Operand: the level, for sizes of mipmapped images.
    ImageQuery {
        image: u16,
        query: ImageQuery,
    },
    /// The difference of a number between neighbours in a quad of fragments.
    Derivative {
        /// Down and not to the right.
        down: bool,
        /// Of the upper left neighbours for the whole quad.
        coarse: bool,
    },
    /// What a vertex or fragment kernel gives, by its slot.
    StageOutput {
        slot: u16,
    },
    /// Among the active invocations of each subgroup.
    Subgroup {
        function: SubgroupFunction,
        class: Class,
    },
    /// Fails unless every invocation is active.
    Barrier,
    /// Looks for what a GPU hides.
    Check(Check),
    /// Follows what rounding does: the number of a probe.
    Probe(u32),
    /// Moves a result within what WGSL allows.
    Perturb(Perturbed),
}

impl Op {
    /// Whether the instruction can be repeated, moved within its scope, and
    /// dropped when its results are not wanted.
    pub(crate) fn is_pure(self) -> bool {
        match self {
            Self::BufferLoad { constant, .. } => constant,
            Self::ImageLoad { level, .. } => level,
            Self::Arith(_)
            | Self::Chain(_)
            | Self::Perturb(_)
            | Self::Input(_)
            | Self::Table { .. }
            | Self::BufferLength { .. }
            | Self::ImageSample { .. }
            | Self::ImageGather { .. }
            | Self::ImageQuery { .. }
            | Self::Derivative { .. } => true,
            _ => false,
        }
    }

    /// Whether the instruction can be dropped when its results are not wanted.
    pub(crate) fn is_removable(self) -> bool {
        self.is_pure()
            || matches!(
                self,
                Self::Move(_)
                    | Self::BufferLoad { .. }
                    | Self::MemoryLoad { .. }
                    | Self::ImageLoad { .. }
                    | Self::Subgroup { .. }
            )
    }

    /// Whether the same operands give the same result in the whole dispatch.
    pub(crate) fn is_dispatch_constant(self) -> bool {
        match self {
            Self::Input(input) => {
                matches!(input, Input::NumWorkgroups(_) | Input::SubgroupSize)
            }
            _ => self.is_pure(),
        }
    }

    /// Whether results differ between lanes even when the operands do not.
    pub(crate) fn is_varying(self) -> bool {
        match self {
            Self::Input(input) => matches!(
                input,
                Input::LocalId(_)
                    | Input::LocalIndex
                    | Input::ActiveLanes
                    | Input::BatchedWorkgroupX
                    | Input::GlobalId { .. }
                    | Input::Stage(_)
            ),
            Self::MemoryLoad { memory, .. } => memory == Memory::Private,
            Self::BufferAtomic { .. } | Self::WorkgroupAtomic { .. } | Self::Subgroup { .. } => {
                true
            }
            _ => false,
        }
    }

    /// Whether the instruction looks at which invocations are active.
    pub(crate) fn is_masked(self) -> bool {
        matches!(
            self,
            Self::BufferStore { .. }
                | Self::BufferStoreHalf { .. }
                | Self::BufferAtomic { .. }
                | Self::MemoryStore { .. }
                | Self::WorkgroupAtomic { .. }
                | Self::ImageStore { .. }
                | Self::ImageAtomic { .. }
                | Self::Subgroup { .. }
                | Self::Barrier
                | Self::Check(_)
                | Self::Probe(_)
        )
    }

    /// What it costs to run it for nothing; `None` if that must not be done.
    pub(crate) fn speculation_cost(self) -> Option<u32> {
        match self {
            Self::Arith(arith) => Some(arith.cost()),
            Self::Input(_)
            | Self::Table { .. }
            | Self::BufferLength { .. }
            | Self::Derivative { .. }
            | Self::ImageQuery { .. } => Some(1),
            Self::BufferLoad { .. } => Some(3),
            Self::MemoryLoad { .. } => Some(3),
            _ => None,
        }
    }
}

impl fmt::Display for Op {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fn class(class: Class) -> &'static str {
            match class {
                Class::Float => "f",
                Class::Int => "i",
            }
        }
        fn axis(axis: u8) -> char {
            char::from(b'x' + axis.min(2))
        }
        match *self {
            Self::Arith(arith) => f.write_str(arith.mnemonic()),
            Self::Chain(chain) => f.write_str(chain.mnemonic()),
            Self::Input(input) => match input {
                Input::LocalId(a) => write!(f, "local_id.{}", axis(a)),
                Input::LocalIndex => f.write_str("local_index"),
                Input::WorkgroupId(a) => write!(f, "workgroup_id.{}", axis(a)),
                Input::GlobalId { axis: a, .. } => write!(f, "global_id.{}", axis(a)),
                Input::BatchedWorkgroupX => f.write_str("workgroup_id.x per lane"),
                Input::NumWorkgroups(a) => write!(f, "num_workgroups.{}", axis(a)),
                Input::SubgroupSize => f.write_str("subgroup_size"),
                Input::ActiveLanes => f.write_str("active_lanes"),
                Input::Stage(slot) => write!(f, "stage.{slot}"),
            },
            Self::Move(c) => write!(f, "move.{}", class(c)),
            Self::Table { table, class: c } => write!(f, "table.{} t{table}", class(c)),
            Self::BufferLoad {
                buffer,
                offset,
                class: c,
                ..
            } => write!(f, "load.{} b{buffer}+{offset}", class(c)),
            Self::BufferStore {
                buffer,
                offset,
                class: c,
            } => write!(f, "store.{} b{buffer}+{offset}", class(c)),
            Self::BufferStoreHalf { buffer, offset } => {
                write!(f, "store.half b{buffer}+{offset}")
            }
            Self::BufferLength { buffer, .. } => write!(f, "length b{buffer}"),
            Self::BufferAtomic {
                buffer,
                offset,
                function,
            } => write!(f, "atomic.{function:?} b{buffer}+{offset}"),
            Self::MemoryLoad {
                memory,
                slot,
                class: c,
            } => write!(f, "load.{} {memory:?}+{slot}", class(c)),
            Self::MemoryStore {
                memory,
                slot,
                class: c,
            } => write!(f, "store.{} {memory:?}+{slot}", class(c)),
            Self::WorkgroupAtomic { slot, function } => {
                write!(f, "atomic.{function:?} Workgroup+{slot}")
            }
            Self::ImageLoad { access, .. } => write!(f, "image.load b{}", access.image),
            Self::ImageStore { access, .. } => write!(f, "image.store b{}", access.image),
            Self::ImageSample {
                access,
                sampler,
                sampling,
            } => {
                write!(f, "image.sample b{} b{sampler}", access.image)?;
                for (is, word) in [
                    (sampling.compare, " compare"),
                    (sampling.gradient, " gradient"),
                    (sampling.bias, " bias"),
                    (sampling.clamp, " clamp"),
                ] {
                    f.write_str(if is { word } else { "" })?;
                }
                match sampling.offset {
                    [0, 0, 0] => Ok(()),
                    offset => write!(f, " offset {offset:?}"),
                }
            }
            Self::ImageGather {
                access,
                sampler,
                channel,
                ..
            } => write!(f, "image.gather.{channel} b{} b{sampler}", access.image),
            Self::ImageAtomic { access, function } => {
                write!(f, "image.atomic.{function:?} b{}", access.image)
            }
            Self::ImageQuery { image, query } => write!(f, "image.query b{image} {query:?}"),
            Self::Derivative { down, coarse } => {
                let axis = if down { 'y' } else { 'x' };
                write!(f, "d{axis}{}", if coarse { ".coarse" } else { "" })
            }
            Self::StageOutput { slot } => write!(f, "give.{slot}"),
            Self::Subgroup { function, class: c } => {
                write!(f, "subgroup.{} {function:?}", class(c))
            }
            Self::Barrier => f.write_str("barrier"),
            Self::Check(check) => check.fmt(f),
            Self::Probe(site) => write!(f, "probe {site}"),
            Self::Perturb(perturbed) => write!(f, "perturb {}", perturbed.op.mnemonic()),
        }
    }
}
