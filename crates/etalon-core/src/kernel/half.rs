//! What naga makes something else of than WGSL says, where `f16` is concerned.
//!
//! naga's bit casts keep the number of components and the width of each. So
//! `bitcast<vec2<f16>>(u)` of a `u32` is an `f32` to it, with no word said, and
//! `bitcast<u32>(v)` of a `vec2<f16>` is a vector of integers of 16 bits, as the
//! exponent of `frexp` is. Such kernels are refused rather than misread.

use naga::front::Typifier;
use naga::proc::ResolveContext;
use naga::{Expression, Function, MathFunction, Module, Scalar, ScalarKind};

use super::compile::Origin;
use super::error::KernelError;

const BITS: &str = "bit casts between `f16` and 32 bits cannot be compiled; \
    `pack2x16float` and `unpack2x16float` give and take the same bits";
const EXPONENT: &str =
    "`frexp` of `f16` cannot be compiled; `frexp` of `f32(…)` gives the same two numbers";

/// Refuses what would be compiled to something else.
///
/// # Errors
/// [`KernelError::Wgsl`] at the first such expression.
pub(super) fn check(module: &Module, origin: &Origin<'_>) -> Result<(), KernelError> {
    let functions = module.functions.iter().map(|(_, function)| function);
    let entries = module.entry_points.iter().map(|entry| &entry.function);
    for function in functions.chain(entries) {
        check_function(module, function, origin)?;
    }
    Ok(())
}

fn check_function(
    module: &Module,
    function: &Function,
    origin: &Origin<'_>,
) -> Result<(), KernelError> {
    let context =
        ResolveContext::with_locals(module, &function.local_variables, &function.arguments);
    let mut types = Typifier::new();
    for (handle, expression) in function.expressions.iter() {
        if types.grow(handle, &function.expressions, &context).is_err() {
            // Validation says what is wrong, and says it better.
            return Ok(());
        }
        let is_half = |of| types.get(of, &module.types).scalar() == Some(Scalar::F16);
        let span = function.expressions.get_span(handle);
        let message = match *expression {
            Expression::Math {
                fun: MathFunction::Frexp,
                arg,
                ..
            } if is_half(arg) => EXPONENT,
            Expression::As {
                expr,
                kind,
                convert: None,
            } if is_half(expr) != (names_half(span, origin) && kind == ScalarKind::Float) => BITS,
            _ => continue,
        };
        return Err(KernelError::Wgsl(origin.diagnostic(span, message)));
    }
    Ok(())
}

/// Whether the `bitcast` at a place is to `f16` by its text, in which alone the
/// width is said.
fn names_half(span: naga::Span, origin: &Origin<'_>) -> bool {
    let text = origin.map.generated();
    let target = span
        .to_range()
        .and_then(|range| text.get(range.start..))
        .and_then(template);
    target.is_some_and(|target| is_half_type(target, text))
}

/// What stands between the first `<` of a text and the `>` that belongs to it.
fn template(text: &str) -> Option<&str> {
    let (_, rest) = text.split_once('<')?;
    let mut depth = 1_u32;
    let end = rest.find(|c| {
        match c {
            '<' => depth += 1,
            '>' => depth -= 1,
            _ => {}
        }
        depth == 0
    })?;
    rest.get(..end)
}

/// Whether a scalar or vector type is of `f16`, behind any number of aliases.
fn is_half_type(ty: &str, text: &str) -> bool {
    let mut ty = ty.trim();
    // Aliases cannot be cyclic, but there may be as many as there are lines.
    for _ in 0..=text.lines().count() {
        ty = ty.rsplit('<').next().unwrap_or(ty);
        ty = ty.trim_end_matches(['>', ' ', ',']).trim_start();
        if matches!(ty, "f16" | "vec2h" | "vec3h" | "vec4h") {
            return true;
        }
        let alias = text.lines().find_map(|line| {
            let (name, of) = line.trim().strip_prefix("alias ")?.split_once('=')?;
            (name.trim() == ty).then(|| of.trim_end_matches(';').trim())
        });
        match alias {
            Some(of) => ty = of,
            None => return false,
        }
    }
    false
}
