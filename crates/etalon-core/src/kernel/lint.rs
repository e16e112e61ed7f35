//! Strict kernels compute only what every executor computes alike.
//!
//! Bit equality between executors rests on each operation having one correct
//! result. [`strict`] checks a compiled module for operations that have not:
//! those which Vulkan's precision table ("Precision and Operation of SPIR-V
//! Instructions") and WGSL §15.7.4 leave an error to, those which a driver may
//! compute in an order of its own, and those it may contract.
//!
//! | Operations | Allowed | Because |
//! |---|---|---|
//! | `+ - * /`, negation, comparisons | yes | correctly rounded; `/` has 2.5 ULP by the table, but is measured equal |
//! | `sqrt` | yes | measured equal |
//! | `%` on floats | no | `x - y * trunc(x / y)`, or an exact remainder |
//! | vector × scalar, matrix × scalar, matrix ± matrix | yes | componentwise |
//! | matrix × vector, vector × matrix, matrix × matrix, `dot`, `cross`, `determinant`, `outerProduct` | no | order of summation, contraction |
//! | `abs min max clamp saturate sign step floor ceil trunc round`, `select` | yes | exact for finite values and bounds in order; only the sign of a zero from `sign`, or from `min` and `max` of zeros of both signs, is not fixed |
//! | `fract` | no | may or may not stay below 1 |
//! | `fma` | no | may or may not be fused |
//! | `mix smoothstep distance length normalize faceForward reflect refract radians degrees` | no | sums and products a driver orders itself |
//! | `exp exp2 log log2 pow inverseSqrt`, trigonometric and hyperbolic functions | no | errors up to many ULP |
//! | `modf frexp ldexp` | no | subnormals, and results out of range |
//! | `quantizeToF16`, packing and unpacking of normalised and half floats | no | rounding is not fixed |
//! | `transpose`, bit casts, conversions between numbers | yes | exact, or correctly rounded |
//! | the same on `f16`, and conversions to it | yes | which neighbour is left open, as for `f32`; measured to be the nearest |
//! | everything on integers and booleans, `dot` too | yes | exact |
//! | `textureLoad`, `textureStore`, queries | yes | the store is to be rounded before |
//! | `textureSample*`, `textureGather*` | no | weights have eight bits or more; so has the choice of texels |
//! | derivatives | no | differences of unspecified neighbours |
//!
//! What is computed at compile time is not restricted: it is part of the
//! module that all executors share.

use std::fmt;

use naga::proc::TypeResolution;
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{BinaryOperator, Expression, Handle, MathFunction, Module, ScalarKind, TypeInner};

use super::error::write_excerpt;
use super::files::SourceLocation;
use super::source_map::SourceMap;

/// An operation whose result executors may disagree on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Finding {
    /// Where.
    pub location: SourceLocation,
    /// The operation, as WGSL spells it.
    pub operation: String,
    /// What to write instead.
    pub instead: &'static str,
    /// The source line.
    pub line: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            location,
            operation,
            instead,
            line,
        } = self;
        write!(f, "{location}: {operation} is not exact; {instead}")?;
        write_excerpt(f, location, line)
    }
}

const SPELL_OUT: &str = "spell it out as sums and products in a fixed order";
const LIBRARY: &str = "use the function from `package::lib`";
const LOAD: &str = "use `textureLoad` and weigh the texels explicitly";
const BITS: &str = "use integer operations on the bits";

/// Finds every operation of a module that is not exact, in order of place.
#[must_use]
pub fn strict(module: &Module, info: &ModuleInfo, map: &SourceMap) -> Vec<Finding> {
    let functions = module
        .functions
        .iter()
        .map(|(handle, function)| (function, &info[handle]));
    let entry_points = module
        .entry_points
        .iter()
        .enumerate()
        .map(|(index, entry)| (&entry.function, info.get_entry_point(index)));
    let mut findings = Vec::new();
    for (function, info) in functions.chain(entry_points) {
        let types = Types { module, info };
        for (handle, expression) in function.expressions.iter() {
            if let Some((operation, instead)) = inexact(expression, &types) {
                let span = function.expressions.get_span(handle);
                let place = map.diagnostic(span, operation);
                findings.push(Finding {
                    location: place.location,
                    operation: place.message,
                    instead,
                    line: place.line,
                });
            }
        }
    }
    findings.sort_by(|a, b| (&a.location, &a.operation).cmp(&(&b.location, &b.operation)));
    findings
}

struct Types<'a> {
    module: &'a Module,
    info: &'a FunctionInfo,
}

impl Types<'_> {
    fn of(&self, expression: Handle<Expression>) -> &TypeInner {
        match &self.info[expression].ty {
            TypeResolution::Handle(handle) => &self.module.types[*handle].inner,
            TypeResolution::Value(inner) => inner,
        }
    }

    fn float(&self, expression: Handle<Expression>) -> bool {
        self.of(expression)
            .scalar_kind()
            .is_some_and(|kind| matches!(kind, ScalarKind::Float | ScalarKind::AbstractFloat))
    }

    fn matrix(&self, expression: Handle<Expression>) -> bool {
        matches!(self.of(expression), TypeInner::Matrix { .. })
    }

    fn scalar(&self, expression: Handle<Expression>) -> bool {
        matches!(self.of(expression), TypeInner::Scalar(_))
    }
}

/// What an expression does that is not exact, and what to do instead.
fn inexact(expression: &Expression, types: &Types<'_>) -> Option<(String, &'static str)> {
    match *expression {
        Expression::Binary { op, left, right } => match op {
            BinaryOperator::Modulo if types.float(left) => {
                Some(("`%` on floats".to_owned(), SPELL_OUT))
            }
            BinaryOperator::Multiply
                if (types.matrix(left) || types.matrix(right))
                    && !(types.scalar(left) || types.scalar(right)) =>
            {
                Some(("a matrix product".to_owned(), SPELL_OUT))
            }
            _ => None,
        },
        Expression::Math { fun, arg, .. } => {
            let instead = inexact_function(fun, types.float(arg))?;
            Some((format!("`{}`", spelling(fun)), instead))
        }
        Expression::ImageSample { gather, .. } => {
            let name = if gather.is_some() {
                "`textureGather*`"
            } else {
                "`textureSample*`"
            };
            Some((name.to_owned(), LOAD))
        }
        Expression::Derivative { .. } => Some((
            "a derivative".to_owned(),
            "take differences of what is loaded",
        )),
        _ => None,
    }
}

/// What to do instead of a built-in function, if it is not exact.
fn inexact_function(function: MathFunction, float: bool) -> Option<&'static str> {
    use MathFunction as Mf;
    match function {
        // Exact on finite floats, exact on integers.
        Mf::Abs
        | Mf::Min
        | Mf::Max
        | Mf::Clamp
        | Mf::Saturate
        | Mf::Ceil
        | Mf::Floor
        | Mf::Round
        | Mf::Trunc
        | Mf::Sign
        | Mf::Step
        | Mf::Sqrt
        | Mf::Transpose => None,
        // Only of integers.
        Mf::Dot4I8Packed
        | Mf::Dot4U8Packed
        | Mf::CountTrailingZeros
        | Mf::CountLeadingZeros
        | Mf::CountOneBits
        | Mf::ReverseBits
        | Mf::ExtractBits
        | Mf::InsertBits
        | Mf::FirstTrailingBit
        | Mf::FirstLeadingBit
        | Mf::Pack4xI8
        | Mf::Pack4xU8
        | Mf::Pack4xI8Clamp
        | Mf::Pack4xU8Clamp
        | Mf::Unpack4xI8
        | Mf::Unpack4xU8 => None,
        Mf::Dot => float.then_some(SPELL_OUT),
        Mf::Fract => Some("write `x - floor(x)`"),
        Mf::Fma => Some("write `a * b + c`, which is rounded twice everywhere"),
        Mf::Outer
        | Mf::Cross
        | Mf::Distance
        | Mf::Length
        | Mf::Normalize
        | Mf::FaceForward
        | Mf::Reflect
        | Mf::Refract
        | Mf::Mix
        | Mf::SmoothStep
        | Mf::Inverse
        | Mf::Determinant
        | Mf::Radians
        | Mf::Degrees => Some(SPELL_OUT),
        Mf::InverseSqrt => Some("write `1.0 / sqrt(x)`"),
        Mf::Cos
        | Mf::Cosh
        | Mf::Sin
        | Mf::Sinh
        | Mf::Tan
        | Mf::Tanh
        | Mf::Acos
        | Mf::Asin
        | Mf::Atan
        | Mf::Atan2
        | Mf::Asinh
        | Mf::Acosh
        | Mf::Atanh
        | Mf::Exp
        | Mf::Exp2
        | Mf::Log
        | Mf::Log2
        | Mf::Pow => Some(LIBRARY),
        Mf::Modf
        | Mf::Frexp
        | Mf::Ldexp
        | Mf::QuantizeToF16
        | Mf::Pack4x8snorm
        | Mf::Pack4x8unorm
        | Mf::Pack2x16snorm
        | Mf::Pack2x16unorm
        | Mf::Pack2x16float
        | Mf::Unpack4x8snorm
        | Mf::Unpack4x8unorm
        | Mf::Unpack2x16snorm
        | Mf::Unpack2x16unorm
        | Mf::Unpack2x16float => Some(BITS),
    }
}

/// The WGSL name of a built-in function: naga's, lower camel case, but for two.
fn spelling(function: MathFunction) -> String {
    match function {
        MathFunction::Outer => "outerProduct".to_owned(),
        MathFunction::SmoothStep => "smoothstep".to_owned(),
        _ => {
            let mut name = format!("{function:?}");
            if let Some(first) = name.get_mut(..1) {
                first.make_ascii_lowercase();
            }
            name
        }
    }
}
