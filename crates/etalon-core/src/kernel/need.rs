//! What a kernel needs that not every device has.

use std::fmt;

use naga::proc::TypeResolution;
use naga::valid::ModuleInfo;
use naga::{AddressSpace, Function, Handle, Module, Scalar, Type, TypeInner};

use super::Binding;

/// Something beyond WebGPU's core that a kernel cannot do without.
///
/// [`Kernel::needs`](super::Kernel::needs) lists them. A backend whose device
/// has not one of them refuses the kernel with
/// [`BackendError::Lacking`](crate::backend::BackendError::Lacking); the
/// interpreter has all of them.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Need {
    /// Arithmetic on `f16`, which WGSL has behind `enable f16;`.
    F16,
    /// Access to the `f16`s of a storage buffer.
    F16Buffer {
        /// The buffer's name in the kernel.
        binding: String,
    },
}

impl fmt::Display for Need {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::F16 => f.write_str("`f16`"),
            Self::F16Buffer { binding } => write!(f, "`f16` in the buffer `{binding}`"),
        }
    }
}

/// What a compiled module needs, given its bindings: what it uses counts, not
/// what it enables.
pub(super) fn needs(module: &Module, info: &ModuleInfo, bindings: &[Binding]) -> Vec<Need> {
    if !uses_half(module, info) {
        return Vec::new();
    }
    let mut needs = vec![Need::F16];
    for binding in bindings {
        let holds_half = module.global_variables.iter().any(|(_, variable)| {
            let place = (binding.group, binding.binding);
            variable.binding.map(|found| (found.group, found.binding)) == Some(place)
                && matches!(variable.space, AddressSpace::Storage { .. })
                && holds_half(module, variable.ty)
        });
        if holds_half {
            needs.push(Need::F16Buffer {
                binding: binding.name.clone(),
            });
        }
    }
    needs
}

fn is_half(inner: &TypeInner) -> bool {
    inner.scalar() == Some(Scalar::F16)
}

fn uses_half(module: &Module, info: &ModuleInfo) -> bool {
    let in_function = |function: &Function, info: &naga::valid::FunctionInfo| {
        function
            .expressions
            .iter()
            .any(|(handle, _)| match &info[handle].ty {
                // Of a type that is declared, which is looked at below.
                TypeResolution::Handle(_) => false,
                TypeResolution::Value(inner) => is_half(inner),
            })
    };
    module.types.iter().any(|(_, ty)| is_half(&ty.inner))
        || module
            .functions
            .iter()
            .any(|(handle, function)| in_function(function, &info[handle]))
        || module
            .entry_points
            .iter()
            .enumerate()
            .any(|(index, entry)| in_function(&entry.function, info.get_entry_point(index)))
}

/// Whether an `f16` is anywhere in a type.
fn holds_half(module: &Module, ty: Handle<Type>) -> bool {
    match &module.types[ty].inner {
        TypeInner::Array { base, .. } => holds_half(module, *base),
        TypeInner::Struct { members, .. } => {
            members.iter().any(|member| holds_half(module, member.ty))
        }
        inner => is_half(inner),
    }
}
