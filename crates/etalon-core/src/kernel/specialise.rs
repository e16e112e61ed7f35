//! Overrides become constants.

use std::collections::BTreeSet;

use naga::back::PipelineConstants;
use naga::back::pipeline_constants::{PipelineConstantError, process_overrides};
use naga::valid::ModuleInfo;
use naga::{Arena, Module, Override, Scalar, ScalarKind, Span, TypeInner};

use super::compile::{Origin, invalid};
use super::error::KernelError;
use super::{assemble, scan};

/// Replaces every override by its value: the request's, or the initial one.
///
/// Returns the module and the values of the request that were used, by name.
///
/// # Errors
/// If the request sets something that is no override, or to a value its type
/// does not have; if an override has no value; or if an expression of
/// overrides has no valid value.
pub(super) fn specialise(
    module: &Module,
    info: &ModuleInfo,
    origin: &Origin<'_>,
) -> Result<(Module, Vec<(String, f64)>), KernelError> {
    check_declared(module, origin)?;
    let mut values = PipelineConstants::default();
    let mut used = Vec::new();
    for (handle, constant) in module.overrides.iter() {
        let name = original(constant, origin);
        let span = module.overrides.get_span(handle);
        match origin.variant.constants().find(|(set, _)| *set == name) {
            Some((_, value)) => {
                check_value(module, constant, value).map_err(|(ty, reason)| {
                    KernelError::ConstantValue {
                        location: origin.map.locate(span),
                        name: name.to_owned(),
                        ty,
                        value,
                        reason,
                    }
                })?;
                values.insert(key(constant), value);
                used.push((name.to_owned(), value));
            }
            None if constant.init.is_none() => {
                return Err(KernelError::MissingConstant {
                    location: origin.map.locate(span),
                    name: name.to_owned(),
                });
            }
            None => {}
        }
    }
    used.sort_by(|(a, _), (b, _)| a.cmp(b));

    // Of one entry point only what it uses is kept; of several, all.
    let entry_point = match module.entry_points.as_slice() {
        [one] => Some((one.stage, one.name.as_str())),
        _ => None,
    };
    let (resolved, _) =
        process_overrides(module, info, entry_point, &values).map_err(|error| match error {
            PipelineConstantError::ValidationError(error) => invalid(&error, origin),
            other => {
                let span = module.overrides.iter().next();
                let span = span.map_or(Span::UNDEFINED, |(h, _)| module.overrides.get_span(h));
                KernelError::Wgsl(origin.diagnostic(span, &other.to_string()))
            }
        })?;
    let mut resolved = resolved.into_owned();
    // They have all become constants; what is left of them is a list of names.
    resolved.overrides = Arena::new();
    Ok((resolved, used))
}

/// The name in the kernel's file.
fn original<'a>(constant: &'a Override, origin: &'a Origin<'_>) -> &'a str {
    origin
        .names
        .original(constant.name.as_deref().unwrap_or_default())
}

/// What naga calls an override by: its number if it has one.
fn key(constant: &Override) -> String {
    match constant.id {
        Some(id) => id.to_string(),
        None => constant.name.clone().unwrap_or_default(),
    }
}

/// Checks that the request names only overrides. Those which this variant
/// does not use have been dropped from the module, but they do exist.
fn check_declared(module: &Module, origin: &Origin<'_>) -> Result<(), KernelError> {
    let names = module.overrides.iter().map(|(_, it)| original(it, origin));
    let mut known: BTreeSet<String> = names.map(str::to_owned).collect();
    let missing = |known: &BTreeSet<String>| {
        let mut set = origin.variant.constants().map(|(name, _)| name);
        set.find(|name| !known.contains(*name)).map(str::to_owned)
    };
    if missing(&known).is_none() {
        return Ok(());
    }
    for text in assemble::reachable(origin.sources, &origin.variant.path) {
        let declared = scan::declared(&text).overrides;
        known.extend(declared.into_iter().map(str::to_owned));
    }
    match missing(&known) {
        None => Ok(()),
        Some(name) => Err(KernelError::UnknownConstant {
            kernel: origin.variant.path.clone(),
            name,
            known: known.into_iter().collect(),
        }),
    }
}

/// Checks that a value has an exact counterpart in the override's type;
/// for `f32`, that rounding it stays finite.
fn check_value(
    module: &Module,
    constant: &Override,
    value: f64,
) -> Result<(), (&'static str, &'static str)> {
    let TypeInner::Scalar(Scalar { kind, .. }) = module.types[constant.ty].inner else {
        return Ok(());
    };
    let integer = |ty, min: f64, max: f64| {
        if value.fract() != 0.0 {
            Err((ty, "it is not a whole number"))
        } else if value < min || value > max {
            Err((ty, "it is out of range"))
        } else {
            Ok(())
        }
    };
    match kind {
        ScalarKind::Sint => integer("i32", i32::MIN.into(), i32::MAX.into()),
        ScalarKind::Uint => integer("u32", u32::MIN.into(), u32::MAX.into()),
        ScalarKind::Bool if value != 0.0 && value != 1.0 => Err(("bool", "it is neither 0 nor 1")),
        // The rounding is the conversion meant here.
        ScalarKind::Float if !(value as f32).is_finite() => {
            Err(("f32", "it is not finite in single precision"))
        }
        _ => Ok(()),
    }
}
