//! Operators and built-in functions on scalars, one at a time, as WGSL defines
//! them, and where it leaves the result open.

use super::grammar::{Binary, Function, Scalar, Unary};

/// What a program computed that WGSL leaves open. Its results may differ
/// between devices, and nobody is wrong.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Open {
    /// A subnormal number was computed with, which may be flushed to zero
    /// (§15.7.2).
    pub subnormal: bool,
    /// A NaN was asked for an order, an integer or its bits, or a zero for its
    /// sign (§15.7.2).
    pub unspecified: bool,
    /// An infinity or a NaN went into a product with a matrix. Devices may
    /// assume that there are none (§15.7.2), and here they do.
    pub infinite: bool,
    /// A zero was a difference of zeros. Devices may ignore the sign of a zero
    /// (§15.7.2), and take `0.0 - x` for `-x`.
    pub zero_made: bool,
    /// The bits of a zero were looked at.
    pub zero_seen: bool,
    /// An integer was converted to a float that is not equal to it: either of
    /// its neighbours (§15.7.6).
    pub rounded: bool,
}

impl Open {
    /// Whether devices may give other results, and often do. What seldom shows
    /// is for [`may_differ`](super::may_differ).
    #[must_use]
    pub const fn any(self) -> bool {
        self.subnormal || self.unspecified
    }

    fn look(&mut self, values: &[f32]) {
        self.subnormal |= values.iter().any(|value| value.is_subnormal());
    }

    fn no_nan(&mut self, values: &[f32]) {
        self.look(values);
        self.unspecified |= values.iter().any(|value| value.is_nan());
    }
}

/// Bits of a boolean.
#[must_use]
pub(super) const fn truth(value: bool) -> u32 {
    value as u32
}

/// An operator with one operand.
pub(super) fn unary(op: Unary, scalar: Scalar, a: u32) -> u32 {
    match (op, scalar) {
        (Unary::Negate, Scalar::F32) => (-f32::from_bits(a)).to_bits(),
        (Unary::Negate, _) => a.wrapping_neg(),
        (Unary::Not, _) => truth(a == 0),
        (Unary::Complement, _) => !a,
    }
}

/// An operator with two operands of a scalar type, but for `&&` and `||`,
/// which may leave out the second.
pub(super) fn binary(op: Binary, scalar: Scalar, a: u32, b: u32, open: &mut Open) -> u32 {
    match scalar {
        Scalar::F32 => float_binary(op, f32::from_bits(a), f32::from_bits(b), open),
        Scalar::I32 => signed_binary(op, a as i32, b),
        Scalar::U32 | Scalar::Bool => unsigned_binary(op, a, b),
    }
}

fn float_binary(op: Binary, a: f32, b: f32, open: &mut Open) -> u32 {
    let result = match op {
        Binary::Add => a + b,
        Binary::Subtract => a - b,
        Binary::Multiply => a * b,
        Binary::Divide => a / b,
        _ => {
            open.no_nan(&[a, b]);
            return truth(match op {
                Binary::Equal => a == b,
                Binary::NotEqual => a != b,
                Binary::Less => a < b,
                Binary::LessEqual => a <= b,
                Binary::Greater => a > b,
                _ => a >= b,
            });
        }
    };
    // A result that is normal only by rounding may have been flushed before.
    let tiny = result.abs() == f32::MIN_POSITIVE;
    open.zero_made |= op == Binary::Subtract && a == 0.0 && b == 0.0;
    // Infinite, with the sign of a zero.
    open.unspecified |= op == Binary::Divide && b == 0.0;
    open.look(&[a, b, result]);
    open.subnormal |= tiny && matches!(op, Binary::Multiply | Binary::Divide);
    result.to_bits()
}

fn signed_binary(op: Binary, a: i32, b: u32) -> u32 {
    let s = b as i32;
    match op {
        // By zero, and the one quotient out of range: the dividend.
        Binary::Divide => a.checked_div(s).unwrap_or(a) as u32,
        Binary::Remainder => a.checked_rem(s).unwrap_or(0) as u32,
        Binary::ShiftRight => a.wrapping_shr(b) as u32,
        Binary::Less => truth(a < s),
        Binary::LessEqual => truth(a <= s),
        Binary::Greater => truth(a > s),
        Binary::GreaterEqual => truth(a >= s),
        _ => unsigned_binary(op, a as u32, b),
    }
}

fn unsigned_binary(op: Binary, a: u32, b: u32) -> u32 {
    match op {
        Binary::Add => a.wrapping_add(b),
        Binary::Subtract => a.wrapping_sub(b),
        Binary::Multiply => a.wrapping_mul(b),
        Binary::Divide => a.checked_div(b).unwrap_or(a),
        Binary::Remainder => a.checked_rem(b).unwrap_or(0),
        Binary::And | Binary::LogicalAnd => a & b,
        Binary::Or | Binary::LogicalOr => a | b,
        Binary::Xor => a ^ b,
        // Modulo 32.
        Binary::ShiftLeft => a.wrapping_shl(b),
        Binary::ShiftRight => a.wrapping_shr(b),
        Binary::Equal => truth(a == b),
        Binary::NotEqual => truth(a != b),
        Binary::Less => truth(a < b),
        Binary::LessEqual => truth(a <= b),
        Binary::Greater => truth(a > b),
        Binary::GreaterEqual => truth(a >= b),
    }
}

/// The lesser of two floats: the other where one is NaN.
fn lesser(a: f32, b: f32, open: &mut Open) -> f32 {
    open.no_nan(&[a, b]);
    if a < b || b.is_nan() { a } else { b }
}

/// The greater of two floats: the other where one is NaN.
fn greater(a: f32, b: f32, open: &mut Open) -> f32 {
    open.no_nan(&[a, b]);
    if a > b || b.is_nan() { a } else { b }
}

/// A function that works component by component.
pub(super) fn component(function: Function, scalar: Scalar, x: &[u32], open: &mut Open) -> u32 {
    let at = |i: usize| x.get(i).copied().unwrap_or(0);
    let (a, b, c) = (at(0), at(1), at(2));
    if scalar == Scalar::F32 {
        let [f, g, h] = [a, b, c].map(f32::from_bits);
        let result = match function {
            Function::Abs => f.abs(),
            Function::Min => lesser(f, g, open),
            Function::Max => greater(f, g, open),
            Function::Clamp => {
                let above = greater(f, g, open);
                lesser(above, h, open)
            }
            Function::Saturate => {
                let above = greater(f, 0.0, open);
                lesser(above, 1.0, open)
            }
            Function::Sign => {
                open.no_nan(&[f]);
                if f > 0.0 {
                    1.0
                } else if f < 0.0 {
                    -1.0
                } else {
                    0.0
                }
            }
            Function::Step => {
                open.no_nan(&[f, g]);
                if f <= g { 1.0 } else { 0.0 }
            }
            Function::Sqrt => {
                open.look(&[f]);
                f.sqrt()
            }
            _ => {
                open.look(&[f]);
                match function {
                    Function::Floor => f.floor(),
                    Function::Ceil => f.ceil(),
                    Function::Trunc => f.trunc(),
                    _ => f.round_ties_even(),
                }
            }
        };
        return result.to_bits();
    }
    let signed = scalar == Scalar::I32;
    match function {
        Function::Abs if signed => (a as i32).wrapping_abs() as u32,
        Function::Abs => a,
        Function::Min if signed => (a as i32).min(b as i32) as u32,
        Function::Min => a.min(b),
        Function::Max if signed => (a as i32).max(b as i32) as u32,
        Function::Max => a.max(b),
        Function::Clamp if signed => (a as i32).max(b as i32).min(c as i32) as u32,
        Function::Clamp => a.max(b).min(c),
        Function::Sign => (a as i32).signum() as u32,
        Function::CountOneBits => a.count_ones(),
        Function::CountLeadingZeros => a.leading_zeros(),
        Function::CountTrailingZeros => a.trailing_zeros(),
        Function::FirstTrailingBit => {
            if a == 0 {
                u32::MAX
            } else {
                a.trailing_zeros()
            }
        }
        Function::FirstLeadingBit => {
            // The highest bit that differs from the sign.
            let bits = if signed && (a as i32) < 0 { !a } else { a };
            31_u32.wrapping_sub(bits.leading_zeros())
        }
        Function::ReverseBits => a.reverse_bits(),
        Function::ExtractBits => {
            let offset = b.min(32);
            let count = c.min(32 - offset);
            if count == 0 {
                return 0;
            }
            let high = a << (32 - offset - count);
            if signed {
                (high as i32 >> (32 - count)) as u32
            } else {
                high >> (32 - count)
            }
        }
        Function::InsertBits => {
            let offset = c.min(32);
            let count = at(3).min(32 - offset);
            if count == 0 {
                return a;
            }
            let field = (u32::MAX >> (32 - count)) << offset;
            (a & !field) | ((b << offset) & field)
        }
        _ => 0,
    }
}

/// The four bytes of a word as numbers, with or without sign.
pub(super) fn unpack(word: u32, signed: bool) -> [u32; 4] {
    word.to_le_bytes().map(|byte| {
        if signed {
            i32::from(byte as i8) as u32
        } else {
            u32::from(byte)
        }
    })
}

/// The lowest bytes of four numbers, which are clamped before if asked.
pub(super) fn pack(values: &[u32], signed: bool, clamp: bool) -> u32 {
    let mut bytes = [0; 4];
    for (byte, &value) in bytes.iter_mut().zip(values) {
        *byte = match (clamp, signed) {
            (false, _) => value as u8,
            (true, false) => value.min(255) as u8,
            (true, true) => (value as i32).clamp(-128, 127) as u8,
        };
    }
    u32::from_le_bytes(bytes)
}

/// A value conversion; floats are brought into an integer's range first.
pub(super) fn convert(from: Scalar, to: Scalar, a: u32, open: &mut Open) -> u32 {
    let float = f32::from_bits(a);
    match (from, to) {
        (Scalar::F32, Scalar::Bool) => {
            open.no_nan(&[float]);
            truth(float != 0.0)
        }
        (_, Scalar::Bool) => truth(a != 0),
        (Scalar::F32, Scalar::F32) => a,
        (Scalar::F32, Scalar::I32) => {
            open.no_nan(&[float]);
            float.clamp(-2_147_483_648.0, 2_147_483_520.0) as i32 as u32
        }
        (Scalar::F32, Scalar::U32) => {
            open.no_nan(&[float]);
            float.clamp(0.0, 4_294_967_040.0) as u32
        }
        (Scalar::I32, Scalar::F32) => {
            let near = a as i32 as f32;
            open.rounded |= f64::from(near) != f64::from(a as i32);
            near.to_bits()
        }
        (_, Scalar::F32) => {
            let near = a as f32;
            open.rounded |= f64::from(near) != f64::from(a);
            near.to_bits()
        }
        (_, Scalar::I32 | Scalar::U32) => a,
    }
}

/// A reinterpretation of bits.
pub(super) fn bitcast(from: Scalar, to: Scalar, a: u32, open: &mut Open) -> u32 {
    let float = f32::from_bits(a);
    if (from == Scalar::F32) != (to == Scalar::F32) {
        // A NaN's payload is free, and signalling ones may turn quiet.
        open.no_nan(&[float]);
        open.unspecified |= float == 0.0 && float.is_sign_negative();
        open.zero_seen |= float == 0.0 && from == Scalar::F32;
    }
    a
}
