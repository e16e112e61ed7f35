//! What goes from the vertex stage of a kernel to its fragment stage.
//!
//! wgpu holds the stages against each other only where it translates them
//! itself. SPIR-V that is handed through would read what nobody wrote.

use std::collections::BTreeMap;

use etalon_core::backend::BackendError;
use etalon_core::kernel::Kernel;
use naga::{Binding, EntryPoint, Interpolation, Module, Sampling, ShaderStage, TypeInner};

use crate::fault::unsupported;
use crate::gpu::Gpu;

/// A value between the stages.
#[derive(Clone, Copy, PartialEq)]
struct Varying<'m> {
    inner: &'m TypeInner,
    interpolation: Option<Interpolation>,
    sampling: Option<Sampling>,
}

/// Adds what has a location of its own: an argument or result, or the members
/// of one.
fn collect<'m>(
    module: &'m Module,
    ty: naga::Handle<naga::Type>,
    binding: Option<&Binding>,
    found: &mut BTreeMap<u32, Varying<'m>>,
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
            inner,
        ) => {
            found.insert(
                location,
                Varying {
                    inner,
                    interpolation,
                    sampling,
                },
            );
        }
        (None, TypeInner::Struct { members, .. }) => {
            for member in members {
                if let Some(binding) = &member.binding {
                    collect(module, member.ty, Some(binding), found);
                }
            }
        }
        _ => {}
    }
}

/// Holds the stages against each other and the device.
pub(super) fn check(gpu: &Gpu, kernel: &Kernel, step: &str) -> Result<(), BackendError> {
    let module = &kernel.module;
    let entry = |stage| -> Option<&EntryPoint> {
        let mut entries = module.entry_points.iter();
        entries.find(|entry| entry.stage == stage)
    };
    let mut outputs = BTreeMap::new();
    if let Some(result) = entry(ShaderStage::Vertex).and_then(|it| it.function.result.as_ref()) {
        collect(module, result.ty, result.binding.as_ref(), &mut outputs);
    }
    let most = gpu.raw_limits().max_inter_stage_shader_variables;
    let past = outputs.keys().any(|location| *location >= most);
    if past || outputs.len() > most as usize {
        return Err(unsupported(
            step,
            format!("more values from vertices to fragments than the device's {most}"),
        ));
    }
    let mut inputs = BTreeMap::new();
    if let Some(fragment) = entry(ShaderStage::Fragment) {
        for argument in &fragment.function.arguments {
            collect(module, argument.ty, argument.binding.as_ref(), &mut inputs);
        }
    }
    for (location, input) in &inputs {
        let what = match outputs.get(location) {
            Some(output) if output == input => continue,
            Some(_) => "something else",
            None => "nothing",
        };
        return Err(BackendError::Kernel {
            step: step.to_owned(),
            error: format!(
                "kernel `{}`: its fragments take a value at location {location}, where its \
                 vertices give {what}",
                kernel.name
            )
            .into(),
        });
    }
    Ok(())
}
