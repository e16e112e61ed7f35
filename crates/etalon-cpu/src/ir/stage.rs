//! What vertex and fragment kernels are given and give.

/// How numbers of vertices become those of fragments.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Interpolation {
    /// Linearly in clip space.
    Perspective,
    /// Linearly in the picture.
    Linear,
    /// Those of the first vertex.
    Flat,
}

/// A scalar that an invocation is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum StageInput {
    /// A component of an attribute, by its place in the program's list.
    Attribute { attribute: u16, component: u8 },
    /// `vertex_index`.
    VertexIndex,
    /// `instance_index`.
    InstanceIndex,
    /// A component of `position` as fragments have it: x and y of the pixel's
    /// centre, depth, 1 / w.
    Position(u8),
    /// `front_facing`, as a mask.
    FrontFacing,
    /// Lanes that hold a fragment, not only a helper of one.
    Covered,
    /// A component of a vertex kernel's output.
    Varying {
        location: u32,
        component: u8,
        interpolation: Interpolation,
    },
}

/// A scalar that an invocation gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum StageOutput {
    /// A component of the position in clip space.
    Position(u8),
    /// A component of a vertex kernel's output.
    Varying { location: u32, component: u8 },
    /// A channel of a target's colour.
    Colour { target: u32, channel: u8 },
    /// `frag_depth`.
    Depth,
    /// Lanes that were covered and not discarded.
    Alive,
}

/// The scalars that invocations are given and give, by their slots.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct StageSlots {
    pub(crate) inputs: Vec<StageInput>,
    pub(crate) outputs: Vec<StageOutput>,
}

impl StageSlots {
    pub(crate) fn output(&self, wanted: StageOutput) -> Option<usize> {
        self.outputs.iter().position(|output| *output == wanted)
    }
}
