//! What lies between vertex buffers, the two kernels and the targets.

use etalon_core::Format;
use etalon_core::format::SampleKind;
use etalon_core::raster::{NumberKind, StepMode, VertexFormat, VertexLayout};
use naga::{BuiltIn, Function, Module, ScalarKind, TypeInner};

use super::error::RasterError;

/// Where the numbers of an input are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attribute {
    /// Place of the buffer in the list.
    pub(super) buffer: usize,
    pub(super) format: VertexFormat,
    /// Bytes from the beginning of an element.
    pub(super) offset: u32,
    /// Bytes from one element to the next.
    pub(super) stride: u32,
    pub(super) step: StepMode,
}

/// Something a kernel is given or gives.
#[derive(Clone, Debug)]
struct Port<'a> {
    name: &'a str,
    location: Option<u32>,
    builtin: Option<BuiltIn>,
    numbers: Option<(ScalarKind, u32)>,
}

fn numbers(ty: &TypeInner) -> Option<(ScalarKind, u32)> {
    match *ty {
        TypeInner::Scalar(scalar) => Some((scalar.kind, 1)),
        TypeInner::Vector { size, scalar } => Some((scalar.kind, size as u32)),
        _ => None,
    }
}

fn ports<'a>(
    module: &'a Module,
    name: Option<&'a String>,
    ty: naga::Handle<naga::Type>,
    binding: Option<&naga::Binding>,
    out: &mut Vec<Port<'a>>,
) {
    let inner = &module.types[ty].inner;
    match (binding, inner) {
        (None, TypeInner::Struct { members, .. }) => {
            for member in members {
                let binding = member.binding.as_ref();
                if binding.is_some() {
                    ports(module, member.name.as_ref(), member.ty, binding, out);
                }
            }
        }
        (binding, inner) => out.push(Port {
            name: name.map_or("", String::as_str),
            location: match binding {
                Some(naga::Binding::Location { location, .. }) => Some(*location),
                _ => None,
            },
            builtin: match binding {
                Some(naga::Binding::BuiltIn(builtin)) => Some(*builtin),
                _ => None,
            },
            numbers: numbers(inner),
        }),
    }
}

fn inputs<'a>(module: &'a Module, function: &'a Function) -> Vec<Port<'a>> {
    let mut out = Vec::new();
    for argument in &function.arguments {
        let (name, binding) = (argument.name.as_ref(), argument.binding.as_ref());
        ports(module, name, argument.ty, binding, &mut out);
    }
    out
}

fn outputs<'a>(module: &'a Module, function: &'a Function) -> Vec<Port<'a>> {
    let mut out = Vec::new();
    if let Some(result) = &function.result {
        ports(module, None, result.ty, result.binding.as_ref(), &mut out);
    }
    out
}

fn describe(numbers: Option<(ScalarKind, u32)>) -> String {
    let Some((kind, count)) = numbers else {
        return "neither a number nor a vector".to_owned();
    };
    let scalar = match kind {
        ScalarKind::Float => "f32",
        ScalarKind::Sint => "i32",
        ScalarKind::Uint => "u32",
        ScalarKind::Bool => "bool",
        ScalarKind::AbstractInt | ScalarKind::AbstractFloat => "abstract",
    };
    match count {
        1 => scalar.to_owned(),
        count => format!("vec{count}<{scalar}>"),
    }
}

/// What feeds the locations of a vertex kernel.
#[derive(Clone, Debug, Default)]
pub(super) struct Feeds {
    pub(super) attributes: Vec<Attribute>,
    /// The attribute at each location.
    pub(super) locations: Vec<(u32, u16)>,
}

/// Finds an attribute for every input of a vertex kernel, by name.
pub(super) fn feeds(
    name: &str,
    module: &Module,
    vertex: &Function,
    layouts: &[VertexLayout],
) -> Result<Feeds, RasterError> {
    for (buffer, layout) in layouts.iter().enumerate() {
        layout.validate().map_err(|error| RasterError::Layout {
            name: name.to_owned(),
            buffer,
            error,
        })?;
    }
    let wrong = |what: String, expected: String, found: String| RasterError::Interface {
        name: name.to_owned(),
        what,
        expected,
        found,
    };
    let mut feeds = Feeds::default();
    for port in inputs(module, vertex) {
        let Some(location) = port.location else {
            continue;
        };
        let what = format!("the vertex kernel's input `{}`", port.name);
        let mut found = layouts.iter().enumerate().flat_map(|(buffer, layout)| {
            let attributes = layout.attributes.iter();
            attributes
                .filter(|attribute| attribute.name == port.name)
                .map(move |attribute| (buffer, layout, attribute))
        });
        let (buffer, layout, attribute) = match (found.next(), found.next()) {
            (Some(found), None) => found,
            (None, _) => {
                let names = layouts.iter().flat_map(|layout| &layout.attributes);
                let names: Vec<String> = names.map(|at| format!("`{}`", at.name)).collect();
                return Err(wrong(
                    what,
                    "the name of an attribute".to_owned(),
                    format!("none of {}", names.join(", ")),
                ));
            }
            (Some(_), Some(_)) => {
                return Err(wrong(
                    what,
                    "the name of one attribute".to_owned(),
                    "that of several".to_owned(),
                ));
            }
        };
        let kind = match attribute.format.kind() {
            NumberKind::Float => ScalarKind::Float,
            NumberKind::Uint => ScalarKind::Uint,
            NumberKind::Sint => ScalarKind::Sint,
        };
        if port.numbers.is_none_or(|(found, _)| found != kind) {
            return Err(wrong(
                what,
                format!(
                    "of {}, as {:?} is",
                    describe(Some((kind, 1))),
                    attribute.format
                ),
                describe(port.numbers),
            ));
        }
        // Locations are few: naga and devices bound them.
        let index = feeds.attributes.len() as u16;
        feeds.attributes.push(Attribute {
            buffer,
            format: attribute.format,
            offset: attribute.offset,
            stride: layout.stride,
            step: layout.step,
        });
        feeds.locations.push((location, index));
    }
    Ok(feeds)
}

/// Checks that fragments are given what vertices give.
pub(super) fn check_varyings(
    name: &str,
    module: &Module,
    vertex: &Function,
    fragment: &Function,
) -> Result<(), RasterError> {
    let given = outputs(module, vertex);
    for port in inputs(module, fragment) {
        let Some(location) = port.location else {
            continue;
        };
        let from = given.iter().find(|given| given.location == Some(location));
        let fits = match (from.and_then(|from| from.numbers), port.numbers) {
            (Some((given, count)), Some((kind, need))) => given == kind && count >= need,
            _ => false,
        };
        if !fits {
            return Err(RasterError::Interface {
                name: name.to_owned(),
                what: format!("the vertex kernel's output at location {location}"),
                expected: format!("{}, as fragments take it", describe(port.numbers)),
                found: from.map_or("missing".to_owned(), |from| describe(from.numbers)),
            });
        }
    }
    Ok(())
}

/// Checks that a vertex kernel gives a position.
pub(super) fn check_position(
    name: &str,
    module: &Module,
    vertex: &Function,
) -> Result<(), RasterError> {
    let position = |port: &Port<'_>| matches!(port.builtin, Some(BuiltIn::Position { .. }));
    if outputs(module, vertex).iter().any(position) {
        return Ok(());
    }
    Err(RasterError::Interface {
        name: name.to_owned(),
        what: "the vertex kernel's `@builtin(position)`".to_owned(),
        expected: "vec4<f32>".to_owned(),
        found: "missing".to_owned(),
    })
}

/// Whether a fragment kernel gives depth.
pub(super) fn gives_depth(module: &Module, fragment: &Function) -> bool {
    let depth = |port: &Port<'_>| port.builtin == Some(BuiltIn::FragDepth);
    outputs(module, fragment).iter().any(depth)
}

/// Checks that the fragment kernel gives a target what it needs: numbers of its
/// kind, at least as many as it has channels, and alpha where that is asked for.
pub(super) fn check_target(
    name: &str,
    module: &Module,
    fragment: Option<&Function>,
    target: usize,
    format: Format,
    needs_alpha: bool,
) -> Result<(), RasterError> {
    let kind = match format.sample_kind() {
        SampleKind::Float | SampleKind::Depth => ScalarKind::Float,
        SampleKind::Sint => ScalarKind::Sint,
        SampleKind::Uint => ScalarKind::Uint,
    };
    let need = if needs_alpha { 4 } else { format.channels() };
    let given = fragment.map_or_else(Vec::new, |fragment| outputs(module, fragment));
    let given = given
        .iter()
        .find(|port| port.location.is_some_and(|at| at as usize == target));
    let numbers = given.and_then(|port| port.numbers);
    if numbers.is_some_and(|(found, count)| found == kind && count >= need) {
        return Ok(());
    }
    Err(RasterError::Interface {
        name: name.to_owned(),
        what: format!("the fragment kernel's output at location {target}"),
        expected: format!(
            "{} or more, for a target of format {format}",
            describe(Some((kind, need)))
        ),
        found: match given {
            Some(port) => describe(port.numbers),
            None => "missing".to_owned(),
        },
    })
}
