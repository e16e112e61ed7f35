//! Kernels: WESL text becomes a validated, reflected naga module.
//!
//! A kernel is one file with one compute entry point, `main`, or with the vertex
//! entry point `vertex` and mostly the fragment entry point `fragment`; the
//! latter draws, see [`Graph::raster`](crate::graph::Graph::raster). It may import
//! from other files, choose between variants with `@if`, and declare
//! `override` constants; a [`KernelRequest`] names the file and says what the
//! features and constants are. [`KernelLibrary::get`] does the rest:
//!
//! ```text
//! files ─ WESL: imports, @if, unused declarations dropped ─> one WGSL text ─ naga: parse, validate
//!       ─ overrides become constants, validate ─ reflect bindings ─ lint strict kernels ─> Kernel
//! ```
//!
//! Every executor is given the same [`Kernel::module`], so a kernel means the
//! same everywhere. `spirv()` (feature `spirv`) translates it for
//! Vulkan.
//!
//! # What a kernel may use
//!
//! WGSL as every WebGPU device has it, cube array textures, and `f16` in
//! kernels that say `enable f16;`. What of that some devices lack is in
//! [`Kernel::needs`], and a backend whose device lacks it says so. Other
//! extensions (subgroups, 16-bit normalised storage textures, `f64`, …) are
//! refused, since a kernel has to run on all devices; so is everything that
//! depends on how invocations are laid out in hardware.
//!
//! `f16` is for values, variables, workgroup memory and storage buffers, not for
//! uniforms. naga cannot cast bits between it and 32 bits, nor give the exponent
//! of its `frexp`; both are refused with what to write instead.
//!
//! Every resource is in group 0 with an explicit `@binding`; names are what
//! passes refer to. There is at most one `var<uniform>`, a structure of
//! numbers, vectors, matrices and arrays of those. Note that WGSL reserves
//! some handy words, `target` among them. Identifiers are ASCII.
//!
//! `import package::lib::colour::luminance;` imports from
//! `lib/colour.wesl`; a feature that a request does not mention is off.
//!
//! # Strict and fast
//!
//! [`Arithmetic`] sets the WESL feature `strict`. A kernel compiled strict
//! contains only operations whose result is exactly defined; [`lint`] has the
//! list and checks it.

mod assemble;
mod binding;
mod check;
mod compile;
mod error;
mod files;
mod half;
mod library;
pub mod lint;
mod need;
mod reflect;
mod scan;
mod similar;
mod source_map;
mod specialise;
#[cfg(feature = "spirv")]
mod spirv;
mod stage;
mod syntax;
#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::fmt;

use serde::{Deserialize, Serialize};

pub use binding::{
    Access, Binding, BindingKind, UniformLayout, UniformMember, UniformScalar, UniformType,
    ViewDimension,
};
pub use error::{Diagnostic, KernelError};
pub use files::{GENERATED, SourceLocation};
pub use library::{KernelLibrary, KernelStats};
pub use need::Need;
pub use source_map::SourceMap;
#[cfg(feature = "spirv")]
pub use spirv::{NO_CONTRACTION_OPCODES, SpirvOptions, spirv};
pub use stage::{ComputeStage, FragmentStage, RasterStages, StageValue, Stages, VertexStage};

/// Which operations kernels compute with.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize,
)]
pub enum Arithmetic {
    /// Operations with one correct result: every executor gives the same bits.
    #[default]
    Strict,
    /// The device's own functions and filters, within the accuracy WGSL asks.
    Fast,
}

impl fmt::Display for Arithmetic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Strict => "strict",
            Self::Fast => "fast",
        })
    }
}

/// Which kernel, and which variant of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct KernelRequest {
    /// Path below the root of all kernels, without extension: `bloom/threshold`.
    pub path: Cow<'static, str>,
    /// WESL features, the names in `@if` conditions, sorted by name. Those not
    /// named are off; `strict` is set by the [`Arithmetic`] and cannot be
    /// named here.
    pub features: Vec<(Cow<'static, str>, bool)>,
    /// Values of WGSL `override`s, sorted by name. A `bool` is 0 or 1.
    pub constants: Vec<(Cow<'static, str>, f64)>,
}

impl KernelRequest {
    /// The kernel at `path` with all features off and no constant set.
    #[must_use]
    pub fn new(path: impl Into<Cow<'static, str>>) -> Self {
        Self {
            path: path.into(),
            ..Self::default()
        }
    }

    /// The same with a feature on or off.
    #[must_use]
    pub fn feature(mut self, name: impl Into<Cow<'static, str>>, on: bool) -> Self {
        set(&mut self.features, name.into(), on);
        self
    }

    /// The same with an `override` set.
    #[must_use]
    pub fn constant(mut self, name: impl Into<Cow<'static, str>>, value: f64) -> Self {
        set(&mut self.constants, name.into(), value);
        self
    }
}

/// Sets `name` in a list sorted by name.
fn set<T>(list: &mut Vec<(Cow<'static, str>, T)>, name: Cow<'static, str>, value: T) {
    match list.binary_search_by(|(other, _)| other.cmp(&name)) {
        Ok(index) => list[index].1 = value,
        Err(index) => list.insert(index, (name, value)),
    }
}

/// Identity of a compiled kernel: equal for equal generated WGSL, constants
/// and arithmetic, the same on every run and machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct KernelId(pub u64);

impl fmt::Display for KernelId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

/// A compiled kernel.
#[derive(Debug)]
#[non_exhaustive]
pub struct Kernel {
    /// Identity.
    pub id: KernelId,
    /// The path it was requested by.
    pub name: String,
    /// What it computes with.
    pub arithmetic: Arithmetic,
    /// The generated WGSL. Overrides are still overrides in it; their values
    /// are in [`Self::constants`].
    pub wgsl: String,
    /// The values the request gave to overrides that are used, by name.
    pub constants: Vec<(String, f64)>,
    /// The validated module, without overrides and without anything unused.
    /// Spans are of [`Self::wgsl`]; [`Self::source_map`] leads on from there.
    pub module: naga::Module,
    /// What validation found out about the module.
    pub info: naga::valid::ModuleInfo,
    /// Its entry points.
    pub stages: Stages,
    /// The resources it uses, in order of binding number.
    pub bindings: Vec<Binding>,
    /// What it needs that not every device has.
    pub needs: Vec<Need>,
    /// Names of resources that its files declare but that this variant does
    /// not use, sorted. They need not be bound; that they are given is no
    /// mistake.
    pub unused: Vec<String>,
    /// From places in [`Self::wgsl`] to places in the files.
    pub source_map: SourceMap,
}

impl Kernel {
    /// The binding of the given name.
    #[must_use]
    pub fn binding(&self, name: &str) -> Option<&Binding> {
        self.bindings.iter().find(|binding| binding.name == name)
    }

    /// The layout of the uniform block, if there is one.
    #[must_use]
    pub fn uniforms(&self) -> Option<&UniformLayout> {
        self.bindings
            .iter()
            .find_map(|binding| match &binding.kind {
                BindingKind::Uniform(layout) => Some(layout),
                _ => None,
            })
    }

    /// Its compute entry point, if it is a compute kernel.
    #[must_use]
    pub fn compute(&self) -> Option<&ComputeStage> {
        match &self.stages {
            Stages::Compute(stage) => Some(stage),
            Stages::Raster(_) => None,
        }
    }

    /// Its vertex and fragment entry points, if it is a raster kernel.
    #[must_use]
    pub fn raster(&self) -> Option<&RasterStages> {
        match &self.stages {
            Stages::Raster(stages) => Some(stages),
            Stages::Compute(_) => None,
        }
    }
}
