//! What can be wrong with a graph as it is being built.

use thiserror::Error;

/// A mistake in declaring a pass or a resource.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum GraphError {
    /// The handle came from another graph.
    #[error("pass `{pass}`, `{binding}`: the handle belongs to another graph")]
    ForeignHandle {
        /// The pass.
        pass: String,
        /// The binding the handle was given for.
        binding: String,
    },
    /// A mip or layer that the texture does not have.
    #[error(
        "pass `{pass}`, `{binding}`: `{resource}` has {mips} mips and {layers} layers; the view asks for mips {first_mip}.. and layers {first_layer}.."
    )]
    NoSuchSubresource {
        /// The pass.
        pass: String,
        /// The binding.
        binding: String,
        /// The texture.
        resource: String,
        /// Mips it has.
        mips: u32,
        /// Layers it has.
        layers: u32,
        /// First mip asked for.
        first_mip: u32,
        /// First layer asked for.
        first_layer: u32,
    },
    /// A read of contents that no pass has written.
    #[error(
        "pass `{pass}`, `{binding}`: mip {mip}, layer {layer} of `{resource}` is read, but nothing has written it"
    )]
    ReadBeforeWrite {
        /// The pass.
        pass: String,
        /// The binding.
        binding: String,
        /// The resource.
        resource: String,
        /// First unwritten mip.
        mip: u32,
        /// First unwritten layer.
        layer: u32,
    },
    /// A write to a version that has been overwritten already.
    #[error(
        "pass `{pass}`, `{binding}`: this version of `{resource}` was already written over by pass `{by}`; write to the handle that pass returned"
    )]
    StaleWrite {
        /// The pass.
        pass: String,
        /// The binding.
        binding: String,
        /// The resource.
        resource: String,
        /// Who wrote first.
        by: String,
    },
    /// One pass reads and writes, or writes twice, the same mip and layer.
    #[error(
        "pass `{pass}`: `{first}` and `{second}` both use `{resource}`, and at least one writes it; read and write through one `update` binding instead"
    )]
    Hazard {
        /// The pass.
        pass: String,
        /// One binding.
        first: String,
        /// The other.
        second: String,
        /// The resource they share.
        resource: String,
    },
    /// The same binding, uniform or constant given twice.
    #[error("pass `{pass}`: `{name}` is given twice")]
    GivenTwice {
        /// The pass.
        pass: String,
        /// The name.
        name: String,
    },
    /// A dispatch or a result names a binding that the pass does not write.
    #[error("pass `{pass}` writes no {what} `{binding}`; it writes {writes}")]
    NoSuchWrite {
        /// The pass.
        pass: String,
        /// `texture` or `buffer`.
        what: &'static str,
        /// The name asked for.
        binding: String,
        /// What there is.
        writes: String,
    },
    /// Imports, outputs and histories are found by name, so each name is used once.
    #[error("{what} `{name}` exists already; {what} names are unique in a graph")]
    DuplicateName {
        /// `import`, `output` or `history`.
        what: &'static str,
        /// The name.
        name: String,
    },
    /// A copy between unlike things.
    #[error("pass `{pass}` copies {source_shape} to {target_shape}; the two must be equal")]
    CopyMismatch {
        /// The pass.
        pass: String,
        /// Format and size of the source.
        source_shape: String,
        /// Format and size of the target.
        target_shape: String,
    },
    /// Targets or draws that cannot be.
    #[error("raster pass `{pass}`: {error}")]
    Raster {
        /// The pass.
        pass: String,
        /// What is wrong and what would be right.
        error: String,
    },
    /// A clear with a value of the wrong kind.
    #[error("pass `{pass}` clears a {format} texture with {value}")]
    ClearMismatch {
        /// The pass.
        pass: String,
        /// The texture's format.
        format: String,
        /// The value's kind.
        value: &'static str,
    },
}
