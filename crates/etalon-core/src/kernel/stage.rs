//! The stages of a kernel: its entry points and what goes into and out of them.

use naga::{
    AddressSpace, Binding as Place, EntryPoint, Module, ScalarKind, ShaderStage, Statement,
    StorageAccess, Type, TypeInner,
};

use super::compile::Origin;
use super::error::KernelError;
use crate::raster::{MAX_COLOUR_TARGETS, NumberKind};

/// The name of a compute kernel's entry point.
pub(super) const COMPUTE: &str = "main";
/// The name of a raster kernel's vertex entry point.
pub(super) const VERTEX: &str = "vertex";
/// The name of a raster kernel's fragment entry point.
pub(super) const FRAGMENT: &str = "fragment";

/// What a kernel is made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Stages {
    /// One compute entry point.
    Compute(ComputeStage),
    /// A vertex entry point, and mostly a fragment one.
    Raster(RasterStages),
}

/// The entry point of a compute kernel, `@compute fn main`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ComputeStage {
    /// Its name in the module.
    pub entry_point: String,
    /// Invocations of a workgroup in x, y and z.
    pub workgroup_size: [u32; 3],
}

/// The entry points of a raster kernel, `@vertex fn vertex` and
/// `@fragment fn fragment`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RasterStages {
    /// Makes corners of triangles.
    pub vertex: VertexStage,
    /// Makes colours of fragments; without it only depth is drawn.
    pub fragment: Option<FragmentStage>,
}

/// What makes the corners of triangles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct VertexStage {
    /// Its name in the module.
    pub entry_point: String,
    /// What it is fed from vertex buffers, by location.
    pub inputs: Vec<StageValue>,
}

/// What makes the colours of fragments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FragmentStage {
    /// Its name in the module.
    pub entry_point: String,
    /// What it puts out to colour targets, by location.
    pub outputs: Vec<StageValue>,
    /// Whether it puts out a depth of its own.
    pub writes_depth: bool,
    /// Whether it drops fragments.
    pub discards: bool,
}

/// A number or vector that goes into or out of a stage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StageValue {
    /// Its name: of the argument or of the structure's member.
    pub name: String,
    /// Its `@location`.
    pub location: u32,
    /// What its numbers are.
    pub kind: NumberKind,
    /// How many there are, 1 to 4.
    pub components: u32,
}

/// Whether the module has the entry points of a kernel, in whatever order.
pub(super) fn are_complete(module: &Module) -> bool {
    let mut entries: Vec<(ShaderStage, &str)> = module
        .entry_points
        .iter()
        .map(|entry| (entry.stage, entry.name.as_str()))
        .collect();
    entries.sort_by_key(|(stage, _)| *stage as u8);
    matches!(
        entries[..],
        [(ShaderStage::Compute, COMPUTE)]
            | [(ShaderStage::Vertex, VERTEX)]
            | [
                (ShaderStage::Vertex, VERTEX),
                (ShaderStage::Fragment, FRAGMENT)
            ]
    )
}

/// The stages of a module that has the entry points of a kernel.
///
/// # Errors
/// If something goes into or out of a raster stage that buffers or targets
/// cannot feed or take, or a raster kernel writes to what it binds.
pub(super) fn stages(module: &Module, origin: &Origin<'_>) -> Result<Option<Stages>, KernelError> {
    let entry = |stage| {
        module
            .entry_points
            .iter()
            .find(|entry| entry.stage == stage)
    };
    if let Some(entry) = entry(ShaderStage::Compute) {
        return Ok(Some(Stages::Compute(ComputeStage {
            entry_point: entry.name.clone(),
            workgroup_size: entry.workgroup_size,
        })));
    }
    let Some(vertex) = entry(ShaderStage::Vertex) else {
        return Ok(None);
    };
    only_reads(module, origin)?;
    let vertex = VertexStage {
        entry_point: vertex.name.clone(),
        inputs: inputs(module, vertex, origin)?,
    };
    let fragment = match entry(ShaderStage::Fragment) {
        None => None,
        Some(entry) => {
            let (outputs, writes_depth) = outputs(module, entry, origin)?;
            let mut functions = module.functions.iter().map(|(_, function)| &function.body);
            Some(FragmentStage {
                entry_point: entry.name.clone(),
                outputs,
                writes_depth,
                discards: discards(&entry.function.body) || functions.any(discards),
            })
        }
    };
    Ok(Some(Stages::Raster(RasterStages { vertex, fragment })))
}

/// Targets are what raster kernels write to: whatever else fragments wrote would
/// depend on the order in which a device happens to draw.
fn only_reads(module: &Module, origin: &Origin<'_>) -> Result<(), KernelError> {
    for (handle, variable) in module.global_variables.iter() {
        let access = match (variable.space, &module.types[variable.ty].inner) {
            (AddressSpace::Storage { access }, _) => access,
            (
                _,
                TypeInner::Image {
                    class: naga::ImageClass::Storage { access, .. },
                    ..
                },
            ) => *access,
            _ => StorageAccess::LOAD,
        };
        if access.intersects(StorageAccess::STORE | StorageAccess::ATOMIC) {
            let name = variable.name.as_deref().unwrap_or_default();
            let message = format!(
                "`{}` can be written; raster kernels write to their targets alone",
                origin.names.original(name)
            );
            let span = module.global_variables.get_span(handle);
            return Err(KernelError::Interface(origin.diagnostic(span, &message)));
        }
    }
    Ok(())
}

/// What has a place of its own: an argument or result, or the members of one.
fn places<'m>(
    module: &'m Module,
    ty: naga::Handle<Type>,
    place: Option<&'m Place>,
    name: Option<&'m str>,
) -> Vec<(&'m Place, &'m TypeInner, Option<&'m str>)> {
    match (place, &module.types[ty].inner) {
        (Some(place), inner) => vec![(place, inner, name)],
        (None, TypeInner::Struct { members, .. }) => members
            .iter()
            .filter_map(|member| {
                let inner = &module.types[member.ty].inner;
                Some((member.binding.as_ref()?, inner, member.name.as_deref()))
            })
            .collect(),
        (None, _) => Vec::new(),
    }
}

/// A value at a location, if it is of a kind that buffers and targets have.
fn value(
    location: u32,
    inner: &TypeInner,
    name: Option<&str>,
    origin: &Origin<'_>,
) -> Result<StageValue, KernelError> {
    let name = origin.names.original(name.unwrap_or_default()).to_owned();
    let (components, scalar) = match *inner {
        TypeInner::Scalar(scalar) => (1, scalar),
        TypeInner::Vector { size, scalar } => (size as u32, scalar),
        _ => return Err(refused(&name, "is neither a number nor a vector", origin)),
    };
    let kind = match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 4) => NumberKind::Float,
        (ScalarKind::Uint, 4) => NumberKind::Uint,
        (ScalarKind::Sint, 4) => NumberKind::Sint,
        _ => return Err(refused(&name, "is not of 32-bit numbers", origin)),
    };
    Ok(StageValue {
        name,
        location,
        kind,
        components,
    })
}

fn refused(name: &str, what: &str, origin: &Origin<'_>) -> KernelError {
    let message = format!("`{name}` {what}; stages take and give `f32`, `u32`, `i32` and vectors");
    KernelError::Interface(origin.diagnostic(naga::Span::UNDEFINED, &message))
}

fn inputs(
    module: &Module,
    entry: &EntryPoint,
    origin: &Origin<'_>,
) -> Result<Vec<StageValue>, KernelError> {
    let mut inputs = Vec::new();
    for argument in &entry.function.arguments {
        let (place, name) = (argument.binding.as_ref(), argument.name.as_deref());
        for (place, inner, name) in places(module, argument.ty, place, name) {
            if let Place::Location { location, .. } = *place {
                inputs.push(value(location, inner, name, origin)?);
            }
        }
    }
    inputs.sort_by_key(|input| input.location);
    Ok(inputs)
}

/// The outputs to colour targets, and whether there is one of depth.
fn outputs(
    module: &Module,
    entry: &EntryPoint,
    origin: &Origin<'_>,
) -> Result<(Vec<StageValue>, bool), KernelError> {
    let (mut outputs, mut depth) = (Vec::new(), false);
    if let Some(result) = &entry.function.result {
        for (place, inner, name) in places(module, result.ty, result.binding.as_ref(), None) {
            match *place {
                Place::BuiltIn(built_in) => depth |= built_in == naga::BuiltIn::FragDepth,
                Place::Location { location, .. } => {
                    // A result without a structure has no name.
                    let value = value(location, inner, Some(name.unwrap_or(COLOUR)), origin)?;
                    if location as usize >= MAX_COLOUR_TARGETS {
                        let what = format!("is at location {location}, over the last target's");
                        return Err(refused(&value.name, &what, origin));
                    }
                    outputs.push(value);
                }
            }
        }
    }
    outputs.sort_by_key(|output| output.location);
    Ok((outputs, depth))
}

/// What a fragment's only output is called if it is no structure's member.
const COLOUR: &str = "colour";

fn discards(block: &naga::Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Kill => true,
        Statement::Block(block) => discards(block),
        Statement::If { accept, reject, .. } => discards(accept) || discards(reject),
        Statement::Switch { cases, .. } => cases.iter().any(|case| discards(&case.body)),
        Statement::Loop {
            body, continuing, ..
        } => discards(body) || discards(continuing),
        _ => false,
    })
}
