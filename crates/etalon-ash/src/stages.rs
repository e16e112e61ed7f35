//! What goes from vertex to fragment kernels, and how much of it.

use ash::vk;
use etalon_core::backend::BackendError;
use etalon_core::kernel::{BindingKind, Kernel, KernelError};
use naga::{Binding, Interpolation, Module, Sampling, ShaderStage, Type, TypeInner};

use crate::error::unsupported;

/// Why a kernel's stages cannot make a pipeline.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Refused {
    /// They do not suit each other.
    Mismatch(String),
    /// They are more than the device has.
    Lacking(String),
}

impl Refused {
    /// The error for a step that draws with the kernel.
    pub(crate) fn in_step(self, step: &str, kernel: &Kernel) -> BackendError {
        match self {
            Self::Lacking(what) => {
                unsupported(step, format!("{what} for kernel `{}`", kernel.name))
            }
            Self::Mismatch(message) => BackendError::Kernel {
                step: step.to_owned(),
                error: Box::new(KernelError::Spirv {
                    kernel: kernel.name.clone(),
                    message,
                }),
            },
        }
    }
}

/// A value that goes from stage to stage.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Passed<'a> {
    location: u32,
    inner: &'a TypeInner,
    interpolation: Option<Interpolation>,
    sampling: Option<Sampling>,
}

fn passed<'a>(
    module: &'a Module,
    ty: naga::Handle<Type>,
    binding: Option<&'a Binding>,
    found: &mut Vec<Passed<'a>>,
) {
    let inner = &module.types[ty].inner;
    match (binding, inner) {
        (
            Some(&Binding::Location {
                location,
                interpolation,
                sampling,
                ..
            }),
            _,
        ) => found.push(Passed {
            location,
            inner,
            interpolation,
            sampling,
        }),
        (None, TypeInner::Struct { members, .. }) => {
            for member in members {
                passed(module, member.ty, member.binding.as_ref(), found);
            }
        }
        _ => {}
    }
}

/// Holds the stages of a kernel against each other and against the limits.
pub(crate) fn check(
    limits: &vk::PhysicalDeviceLimits,
    kernel: &Kernel,
    colours: usize,
) -> Result<(), Refused> {
    let module = &kernel.module;
    let function = |stage: ShaderStage| {
        let mut entries = module.entry_points.iter();
        let found = entries.find(|entry| entry.stage == stage);
        found.map(|entry| &entry.function)
    };
    let (mut given, mut taken) = (Vec::new(), Vec::new());
    if let Some(result) = function(ShaderStage::Vertex).and_then(|it| it.result.as_ref()) {
        passed(module, result.ty, result.binding.as_ref(), &mut given);
    }
    for argument in function(ShaderStage::Fragment)
        .iter()
        .flat_map(|it| &it.arguments)
    {
        passed(module, argument.ty, argument.binding.as_ref(), &mut taken);
    }
    for input in &taken {
        let same = |output: &Passed<'_>| output.location == input.location;
        match given.iter().find(|output| same(output)) {
            Some(output) if output == input => {}
            found => {
                return Err(Refused::Mismatch(format!(
                    "its fragments take {:?} at location {}, where its vertices put out {:?}",
                    input.inner,
                    input.location,
                    found.map(|output| output.inner)
                )));
            }
        }
    }
    // A location has four components; positions take one more.
    let components = |values: &[Passed<'_>]| {
        let last = values.iter().map(|value| u64::from(value.location)).max();
        last.map_or(0, |last| 4 * (last + 1)) + 4
    };
    let stored = kernel.bindings.iter().filter(|binding| {
        matches!(
            binding.kind,
            BindingKind::StorageBuffer { .. } | BindingKind::StorageTexture { .. }
        )
    });
    let sampled_or_stored = kernel
        .bindings
        .iter()
        .filter(|binding| !matches!(binding.kind, BindingKind::Sampler { .. }));
    let as_u64 = |count: usize| u64::try_from(count).unwrap_or(u64::MAX);
    for (what, wanted, most) in [
        (
            "components of vertices",
            components(&given),
            limits.max_vertex_output_components,
        ),
        (
            "components of fragments",
            components(&taken),
            limits.max_fragment_input_components,
        ),
        (
            "colour targets",
            as_u64(colours),
            limits.max_fragment_output_attachments,
        ),
        (
            "storage buffers, storage textures and colour targets",
            as_u64(stored.count() + colours),
            limits.max_fragment_combined_output_resources,
        ),
        (
            "resources and colour targets",
            as_u64(sampled_or_stored.count() + colours),
            limits.max_per_stage_resources,
        ),
    ] {
        if wanted > u64::from(most) {
            return Err(Refused::Lacking(format!(
                "{wanted} {what} (at most {most})"
            )));
        }
    }
    Ok(())
}
