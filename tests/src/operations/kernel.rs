//! One kernel per operation.
//!
//! The kernel reads words from `data`, the cases one after another, and writes
//! words to `result`: of each scalar of the results one run of all cases, for
//! componentwise operations first computed by scalars and then by vectors of
//! four. Cases are padded to a multiple of four by repeating the last.
//!
//! An `f16` lies in the lower half of its word. It is loaded and stored as what
//! it is, since anything else would be one more operation: from `halves`, which
//! is bound to the same bytes as `data`, and to a `result` of `f16`s.

use std::fmt::Write;

use super::operation::{Form, Operation, Scalar, Shape};

/// Names of the parameters.
const NAMES: [&str; 6] = ["a", "b", "c", "d", "e", "f"];

/// How many cases a kernel has, with padding.
#[must_use]
pub fn padded(operation: &Operation) -> usize {
    operation.cases.len().next_multiple_of(4)
}

/// How many words a kernel writes.
#[must_use]
pub fn result_words(operation: &Operation) -> usize {
    operation.forms().len() * operation.output_scalars().count() * padded(operation)
}

/// Where in the results a scalar of a case stands.
#[must_use]
pub fn position(operation: &Operation, form: usize, scalar: usize, case: usize) -> usize {
    (form * operation.output_scalars().count() + scalar) * padded(operation) + case
}

/// What a kernel reads.
#[must_use]
pub fn data(operation: &Operation) -> Vec<u8> {
    let last = operation.cases.last();
    operation
        .cases
        .iter()
        .chain(last.into_iter().cycle().take(3))
        .take(padded(operation))
        .flatten()
        .flat_map(|word| word.to_le_bytes())
        .collect()
}

/// Workgroups of 64 invocations.
#[must_use]
pub fn workgroups(operation: &Operation) -> u32 {
    let invocations = match operation.form {
        Form::Componentwise => padded(operation) / 4,
        Form::Whole => padded(operation),
    };
    (invocations as u32).div_ceil(64)
}

/// The scalar that the word `at` holds.
fn load(scalar: Scalar, at: &str) -> String {
    match scalar {
        Scalar::F32 | Scalar::I32 => format!("bitcast<{}>(data[{at}])", scalar.name()),
        Scalar::F16 => format!("halves[2u * ({at})]"),
        Scalar::U32 => format!("data[{at}]"),
        Scalar::Bool => format!("(data[{at}] != 0u)"),
    }
}

/// The statement that stores a scalar as the word `at`.
fn store(scalar: Scalar, at: &str, value: &str) -> String {
    match scalar {
        Scalar::F32 | Scalar::I32 => format!("result[{at}] = bitcast<u32>({value});"),
        Scalar::F16 => format!("result[2u * ({at})] = {value};"),
        Scalar::U32 => format!("result[{at}] = {value};"),
        Scalar::Bool => format!("result[{at}] = select(0u, 1u, {value});"),
    }
}

/// Whether the kernel has the binding `data`, and whether it has `halves`.
#[must_use]
pub fn reads(operation: &Operation) -> [bool; 2] {
    let is_half = |scalar| scalar == Scalar::F16;
    [
        operation.input_scalars().any(|scalar| !is_half(scalar)),
        operation.input_scalars().any(is_half),
    ]
}

/// Whether results are `f16`s. An operation's results are all so, or none is.
#[must_use]
pub fn gives_halves(operation: &Operation) -> bool {
    operation
        .output_scalars()
        .any(|scalar| scalar == Scalar::F16)
}

/// The kernel's WGSL.
#[must_use]
pub fn wgsl(operation: &Operation) -> String {
    let ([words, halves], gives_halves) = (reads(operation), gives_halves(operation));
    let mut text = String::new();
    if halves || gives_halves {
        text += "enable f16;\n";
    }
    if words {
        text += "@group(0) @binding(0) var<storage, read> data: array<u32>;\n";
    }
    if halves {
        text += "@group(0) @binding(2) var<storage, read> halves: array<f16>;\n";
    }
    let result = if gives_halves { "f16" } else { "u32" };
    let _ = writeln!(
        text,
        "@group(0) @binding(1) var<storage, read_write> result: array<{result}>;"
    );
    match operation.form {
        Form::Componentwise => componentwise(&mut text, operation),
        Form::Whole => whole(&mut text, operation),
    }
    text
}

const ENTRY: &str = "@compute @workgroup_size(64)\n\
    fn main(@builtin(global_invocation_id) id: vec3<u32>) {\n";

/// `$i32` and its like as scalars or as vectors.
fn expand(code: &str, shape: Shape) -> String {
    [
        Scalar::F32,
        Scalar::F16,
        Scalar::I32,
        Scalar::U32,
        Scalar::Bool,
    ]
    .iter()
    .fold(code.to_owned(), |code, &scalar| {
        code.replace(&format!("${}", scalar.name()), &shape.of(scalar))
    })
}

fn componentwise(text: &mut String, operation: &Operation) {
    let width = operation.parameters.len();
    let outputs = &operation.outputs;
    for (shape, prefix) in [(Shape::Scalar, "one"), (Shape::Vector(4), "four")] {
        let parameters: Vec<String> = operation
            .parameters
            .iter()
            .zip(NAMES)
            .map(|(&(_, scalar), name)| format!("{name}: {}", shape.of(scalar)))
            .collect();
        for (index, output) in outputs.iter().enumerate() {
            let _ = writeln!(
                text,
                "fn {prefix}_{index}({}) -> {} {{ return {}; }}",
                parameters.join(", "),
                shape.of(output.scalar),
                expand(&output.code, shape)
            );
        }
    }
    text.push_str(ENTRY);
    let _ = writeln!(text, "if id.x >= {}u {{ return; }}", padded(operation) / 4);
    for (index, ((_, scalar), name)) in operation.parameters.iter().zip(NAMES).enumerate() {
        for lane in 0..4 {
            let at = format!("(4u * id.x + {lane}u) * {width}u + {index}u");
            let _ = writeln!(text, "let {name}{lane} = {};", load(*scalar, &at));
        }
        let _ = writeln!(
            text,
            "let {name} = {}({name}0, {name}1, {name}2, {name}3);",
            Shape::Vector(4).of(*scalar)
        );
    }
    let arguments = |suffix: &str| -> String {
        let names: Vec<String> = NAMES[..width]
            .iter()
            .map(|name| format!("{name}{suffix}"))
            .collect();
        names.join(", ")
    };
    for (index, output) in outputs.iter().enumerate() {
        let _ = writeln!(text, "let v{index} = four_{index}({});", arguments(""));
        for lane in 0..4 {
            let scalar = format!("one_{index}({})", arguments(&lane.to_string()));
            for (form, value) in [scalar, format!("v{index}[{lane}]")].iter().enumerate() {
                let at = position(operation, form, index, lane);
                let at = format!("{at}u + 4u * id.x");
                let _ = writeln!(text, "{}", store(output.scalar, &at, value));
            }
        }
    }
    text.push_str("}\n");
}

fn whole(text: &mut String, operation: &Operation) {
    let width = operation.input_scalars().count();
    text.push_str(ENTRY);
    let _ = writeln!(text, "if id.x >= {}u {{ return; }}", padded(operation));
    let mut next = 0;
    for (&(shape, scalar), name) in operation.parameters.iter().zip(NAMES) {
        let parts: Vec<String> = (0..shape.count())
            .map(|part| load(scalar, &format!("id.x * {width}u + {}u", next + part)))
            .collect();
        next += shape.count();
        let value = match shape {
            Shape::Scalar => parts.concat(),
            Shape::Vector(_) | Shape::Matrix(..) => {
                format!("{}({})", shape.of(scalar), parts.join(", "))
            }
        };
        let _ = writeln!(text, "let {name} = {value};");
    }
    let mut next = 0;
    for (index, output) in operation.outputs.iter().enumerate() {
        let _ = writeln!(text, "let r{index} = {};", output.code);
        for part in 0..output.shape.count() {
            let value = match output.shape {
                Shape::Scalar => format!("r{index}"),
                Shape::Vector(_) => format!("r{index}[{part}]"),
                Shape::Matrix(_, rows) => format!("r{index}[{}][{}]", part / rows, part % rows),
            };
            let at = format!("{}u + id.x", position(operation, 0, next + part, 0));
            let _ = writeln!(text, "{}", store(output.scalar, &at, &value));
        }
        next += output.shape.count();
    }
    text.push_str("}\n");
}
