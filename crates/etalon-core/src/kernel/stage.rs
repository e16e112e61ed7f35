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
    /// What it passes on to fragments, by location.
    pub outputs: Vec<StageValue>,
}

/// What makes the colours of fragments.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FragmentStage {
    /// Its name in the module.
    pub entry_point: String,
    /// What it takes from vertices, by location.
    pub inputs: Vec<StageValue>,
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
    let passed = given(module, vertex, origin)?;
    let fragment = match entry(ShaderStage::Fragment) {
        None => None,
        Some(entry) => {
            let inputs = taken(module, entry, origin)?;
            suit(&passed, &inputs, origin)?;
            let outputs = values(given(module, entry, origin)?);
            if let Some(last) = outputs.last()
                && last.location as usize >= MAX_COLOUR_TARGETS
            {
                let what = format!("is at location {}, over the last target's", last.location);
                return Err(refused(&last.name, &what, origin));
            }
            let mut functions = module.functions.iter().map(|(_, function)| &function.body);
            Some(FragmentStage {
                entry_point: entry.name.clone(),
                inputs: values(inputs),
                outputs,
                writes_depth: writes_depth(module, entry),
                discards: discards(&entry.function.body) || functions.any(discards),
            })
        }
    };
    let vertex = VertexStage {
        entry_point: vertex.name.clone(),
        inputs: values(taken(module, vertex, origin)?),
        outputs: values(passed),
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

/// A value with a location, and where it is.
struct Located<'m> {
    place: &'m Place,
    inner: &'m TypeInner,
    value: StageValue,
}

/// Those of arguments or results that have locations, in their order.
fn located<'m>(
    places: impl IntoIterator<Item = (&'m Place, &'m TypeInner, Option<&'m str>)>,
    origin: &Origin<'_>,
) -> Result<Vec<Located<'m>>, KernelError> {
    let mut found = Vec::new();
    for (place, inner, name) in places {
        if let Place::Location { location, .. } = *place {
            found.push(Located {
                place,
                inner,
                value: value(location, inner, name, origin)?,
            });
        }
    }
    found.sort_by_key(|one| one.value.location);
    Ok(found)
}

/// What goes into an entry point.
fn taken<'m>(
    module: &'m Module,
    entry: &'m EntryPoint,
    origin: &Origin<'_>,
) -> Result<Vec<Located<'m>>, KernelError> {
    let arguments = entry.function.arguments.iter().flat_map(|argument| {
        let (place, name) = (argument.binding.as_ref(), argument.name.as_deref());
        places(module, argument.ty, place, name)
    });
    located(arguments, origin)
}

/// What comes out of an entry point.
fn given<'m>(
    module: &'m Module,
    entry: &'m EntryPoint,
    origin: &Origin<'_>,
) -> Result<Vec<Located<'m>>, KernelError> {
    let results = entry.function.result.iter().flat_map(|result| {
        // A result without a structure has no name.
        places(module, result.ty, result.binding.as_ref(), Some(COLOUR))
    });
    located(results, origin)
}

fn values(located: Vec<Located<'_>>) -> Vec<StageValue> {
    located.into_iter().map(|one| one.value).collect()
}

/// What fragments take, vertices have to give, interpolated alike: validation looks
/// at each stage by itself.
fn suit(
    outputs: &[Located<'_>],
    inputs: &[Located<'_>],
    origin: &Origin<'_>,
) -> Result<(), KernelError> {
    for input in inputs {
        let StageValue { name, location, .. } = &input.value;
        let mut same = outputs
            .iter()
            .filter(|output| output.value.location == *location);
        let what = match same.next() {
            Some(output) if (output.place, output.inner) == (input.place, input.inner) => continue,
            Some(_) => "something else",
            None => "nothing",
        };
        let message = format!(
            "`{name}` is taken by fragments from location {location}, where vertices give {what}"
        );
        let diagnostic = origin.diagnostic(naga::Span::UNDEFINED, &message);
        return Err(KernelError::Interface(diagnostic));
    }
    Ok(())
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

/// What a fragment's only output is called if it is no structure's member.
const COLOUR: &str = "colour";

fn writes_depth(module: &Module, entry: &EntryPoint) -> bool {
    let mut results = entry
        .function
        .result
        .iter()
        .flat_map(|result| places(module, result.ty, result.binding.as_ref(), None));
    results.any(|(place, _, _)| *place == Place::BuiltIn(naga::BuiltIn::FragDepth))
}

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
