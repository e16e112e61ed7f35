//! Built-in functions on numbers, taken apart into instructions. Sums of
//! products are never fused, and run from the first component on.

use naga::{Expression, Handle, MathFunction, ScalarKind, TypeInner, VectorSize};

use super::{Fail, Frame, Translator};
use crate::ir::{Arith, Class, Value};

impl<'a> Translator<'a> {
    pub(super) fn math(
        &mut self,
        frame: &mut Frame<'a>,
        function: MathFunction,
        arguments: &[Option<Handle<Expression>>; 4],
    ) -> Result<Vec<Value>, Fail> {
        use MathFunction as M;
        let Some(first) = arguments[0] else {
            return Err(Fail::invalid("a built-in function without arguments"));
        };
        let kind = self.kind(frame, first)?;
        let mut args = Vec::with_capacity(4);
        for &argument in arguments.iter().flatten() {
            args.push(self.scalars(frame, argument)?);
        }
        let needed = match function {
            M::Clamp
            | M::Mix
            | M::Fma
            | M::SmoothStep
            | M::FaceForward
            | M::Refract
            | M::ExtractBits => 3,
            M::InsertBits => 4,
            M::Min
            | M::Max
            | M::Pow
            | M::Atan2
            | M::Ldexp
            | M::Step
            | M::Dot
            | M::Dot4I8Packed
            | M::Dot4U8Packed
            | M::Cross
            | M::Distance
            | M::Reflect => 2,
            _ => 1,
        };
        if args.len() != needed {
            return Err(Fail::invalid(
                "a built-in function with a wrong number of arguments",
            ));
        }
        match function {
            M::Transpose => {
                let TypeInner::Matrix { columns, rows, .. } = *self.ty(frame, first) else {
                    return Err(Fail::invalid(
                        "a transpose of something other than a matrix",
                    ));
                };
                let (columns, rows) = (columns as usize, rows as usize);
                return Ok((0..rows)
                    .flat_map(|row| (0..columns).map(move |column| column * rows + row))
                    .map(|i| args[0][i])
                    .collect());
            }
            M::Determinant => {
                let TypeInner::Matrix { columns, .. } = *self.ty(frame, first) else {
                    return Err(Fail::invalid(
                        "a determinant of something other than a matrix",
                    ));
                };
                return Ok(vec![self.determinant(&args[0], columns)]);
            }
            M::Inverse | M::Outer => {
                return Err(Fail::unsupported(format!("the function {function:?}")));
            }
            _ => {}
        }
        if let Some(values) = self.geometric(function, kind, &args) {
            return Ok(values);
        }
        if let Some(values) = self.packing(function, &args)? {
            return Ok(values);
        }
        // All others work on each component; scalars go with every one.
        let width = args.iter().map(Vec::len).max().unwrap_or(1);
        let mut results = Vec::with_capacity(width);
        let mut second_results = Vec::new();
        for i in 0..width {
            let x: Vec<Value> = args
                .iter()
                .map(|values| values[if values.len() == 1 { 0 } else { i }])
                .collect();
            match function {
                M::Modf => {
                    let whole = self.builder.arith(Arith::TruncF, &x);
                    results.push(self.builder.arith(Arith::SubF, &[x[0], whole]));
                    second_results.push(whole);
                }
                M::Frexp => {
                    let (fraction, exponent) = self.frexp(x[0]);
                    results.push(fraction);
                    second_results.push(exponent);
                }
                _ => results.push(self.component(function, kind, &x)?),
            }
        }
        results.extend(second_results);
        Ok(results)
    }

    /// Functions that work component by component.
    fn component(
        &mut self,
        function: MathFunction,
        kind: ScalarKind,
        x: &[Value],
    ) -> Result<Value, Fail> {
        use MathFunction as M;
        use ScalarKind as K;
        let b = &mut self.builder;
        let simple = match (function, kind) {
            (M::Abs, K::Float) => Arith::AbsF,
            (M::Abs, K::Sint) => Arith::AbsS,
            (M::Abs, _) => return Ok(x[0]),
            (M::Min, K::Float) => Arith::MinF,
            (M::Min, K::Sint) => Arith::MinS,
            (M::Min, _) => Arith::MinU,
            (M::Max, K::Float) => Arith::MaxF,
            (M::Max, K::Sint) => Arith::MaxS,
            (M::Max, _) => Arith::MaxU,
            (M::Sign, K::Float) => Arith::SignF,
            (M::Sign, _) => Arith::SignS,
            (M::Cos, _) => Arith::CosF,
            (M::Cosh, _) => Arith::CoshF,
            (M::Sin, _) => Arith::SinF,
            (M::Sinh, _) => Arith::SinhF,
            (M::Tan, _) => Arith::TanF,
            (M::Tanh, _) => Arith::TanhF,
            (M::Acos, _) => Arith::AcosF,
            (M::Asin, _) => Arith::AsinF,
            (M::Atan, _) => Arith::AtanF,
            (M::Atan2, _) => Arith::Atan2F,
            (M::Asinh, _) => Arith::AsinhF,
            (M::Acosh, _) => Arith::AcoshF,
            (M::Atanh, _) => Arith::AtanhF,
            (M::Ceil, _) => Arith::CeilF,
            (M::Floor, _) => Arith::FloorF,
            (M::Round, _) => Arith::RoundF,
            (M::Trunc, _) => Arith::TruncF,
            (M::Ldexp, _) => Arith::LdexpF,
            (M::Exp, _) => Arith::ExpF,
            (M::Exp2, _) => Arith::Exp2F,
            (M::Log, _) => Arith::LogF,
            (M::Log2, _) => Arith::Log2F,
            (M::Pow, _) => Arith::PowF,
            (M::Sqrt, _) => Arith::SqrtF,
            (M::Fma, _) => Arith::MulAddF,
            (M::CountTrailingZeros, _) => Arith::Ctz,
            (M::CountLeadingZeros, _) => Arith::Clz,
            (M::CountOneBits, _) => Arith::PopCount,
            (M::ReverseBits, _) => Arith::Reverse,
            _ => {
                return Ok(match function {
                    M::Clamp => {
                        let (low, high) = match kind {
                            K::Float => (Arith::MaxF, Arith::MinF),
                            K::Sint => (Arith::MaxS, Arith::MinS),
                            _ => (Arith::MaxU, Arith::MinU),
                        };
                        let above = b.arith(low, &[x[0], x[1]]);
                        b.arith(high, &[above, x[2]])
                    }
                    M::Saturate => {
                        let (zero, one) = (b.float(0.0), b.float(1.0));
                        let above = b.arith(Arith::MaxF, &[x[0], zero]);
                        b.arith(Arith::MinF, &[above, one])
                    }
                    M::Radians => {
                        let factor = b.float(std::f32::consts::PI / 180.0);
                        b.arith(Arith::MulF, &[x[0], factor])
                    }
                    M::Degrees => {
                        let factor = b.float((180.0 / std::f64::consts::PI) as f32);
                        b.arith(Arith::MulF, &[x[0], factor])
                    }
                    M::Fract => {
                        let floor = b.arith(Arith::FloorF, x);
                        b.arith(Arith::SubF, &[x[0], floor])
                    }
                    M::Mix => {
                        let one = b.float(1.0);
                        let rest = b.arith(Arith::SubF, &[one, x[2]]);
                        let first = b.arith(Arith::MulF, &[x[0], rest]);
                        let second = b.arith(Arith::MulF, &[x[1], x[2]]);
                        b.arith(Arith::AddF, &[first, second])
                    }
                    M::Step => {
                        let (zero, one) = (b.float(0.0), b.float(1.0));
                        let reached = b.arith(Arith::LeF, &[x[0], x[1]]);
                        b.select(reached, one, zero)
                    }
                    M::SmoothStep => {
                        let (zero, one, two, three) =
                            (b.float(0.0), b.float(1.0), b.float(2.0), b.float(3.0));
                        let along = b.arith(Arith::SubF, &[x[2], x[0]]);
                        let width = b.arith(Arith::SubF, &[x[1], x[0]]);
                        let t = b.arith(Arith::DivF, &[along, width]);
                        let t = b.arith(Arith::MaxF, &[t, zero]);
                        let t = b.arith(Arith::MinF, &[t, one]);
                        let square = b.arith(Arith::MulF, &[t, t]);
                        let double = b.arith(Arith::MulF, &[two, t]);
                        let rest = b.arith(Arith::SubF, &[three, double]);
                        b.arith(Arith::MulF, &[square, rest])
                    }
                    M::InverseSqrt => {
                        let root = b.arith(Arith::SqrtF, x);
                        let one = b.float(1.0);
                        b.arith(Arith::DivF, &[one, root])
                    }
                    M::QuantizeToF16 => {
                        let half = b.arith(Arith::FToHalf, x);
                        b.arith(Arith::HalfToF, &[half])
                    }
                    M::FirstTrailingBit => {
                        let (zero, none) = (b.int(0), b.int(u32::MAX));
                        let count = b.arith(Arith::Ctz, x);
                        let is_zero = b.arith(Arith::EqI, &[x[0], zero]);
                        b.select(is_zero, none, count)
                    }
                    M::FirstLeadingBit => {
                        let mut value = x[0];
                        if kind == K::Sint {
                            // The first bit that differs from the sign.
                            let thirty_one = b.int(31);
                            let sign = b.arith(Arith::ShrS, &[value, thirty_one]);
                            value = b.arith(Arith::Xor, &[value, sign]);
                        }
                        // No bit at all gives 31 - 32 = -1, as it should.
                        let zeros = b.arith(Arith::Clz, &[value]);
                        let thirty_one = b.int(31);
                        b.arith(Arith::SubI, &[thirty_one, zeros])
                    }
                    M::ExtractBits => self.extract_bits(kind, x),
                    M::InsertBits => self.insert_bits(x),
                    other => return Err(Fail::unsupported(format!("the function {other:?}"))),
                });
            }
        };
        Ok(b.arith(simple, x))
    }

    /// WGSL's `extractBits`: offset and count are brought into the 32 bits.
    fn extract_bits(&mut self, kind: ScalarKind, x: &[Value]) -> Value {
        let b = &mut self.builder;
        let (zero, width) = (b.int(0), b.int(32));
        let offset = b.arith(Arith::MinU, &[x[1], width]);
        let room = b.arith(Arith::SubI, &[width, offset]);
        let count = b.arith(Arith::MinU, &[x[2], room]);
        // Up to the top, then down; shifts by 32 only occur when count is 0.
        let used = b.arith(Arith::AddI, &[offset, count]);
        let up = b.arith(Arith::SubI, &[width, used]);
        let down = b.arith(Arith::SubI, &[width, count]);
        let high = b.arith(Arith::Shl, &[x[0], up]);
        let low = b.arith(
            if kind == ScalarKind::Sint {
                Arith::ShrS
            } else {
                Arith::ShrU
            },
            &[high, down],
        );
        let empty = b.arith(Arith::EqI, &[count, zero]);
        b.select(empty, zero, low)
    }

    /// WGSL's `insertBits`.
    fn insert_bits(&mut self, x: &[Value]) -> Value {
        let b = &mut self.builder;
        let (zero, width, ones) = (b.int(0), b.int(32), b.int(u32::MAX));
        let offset = b.arith(Arith::MinU, &[x[2], width]);
        let room = b.arith(Arith::SubI, &[width, offset]);
        let count = b.arith(Arith::MinU, &[x[3], room]);
        let down = b.arith(Arith::SubI, &[width, count]);
        let field = b.arith(Arith::ShrU, &[ones, down]);
        let field = b.arith(Arith::Shl, &[field, offset]);
        let moved = b.arith(Arith::Shl, &[x[1], offset]);
        let new = b.arith(Arith::And, &[moved, field]);
        let kept = b.arith(Arith::AndNot, &[x[0], field]);
        let joined = b.arith(Arith::Or, &[kept, new]);
        let empty = b.arith(Arith::EqI, &[count, zero]);
        b.select(empty, x[0], joined)
    }

    /// Fraction in [0.5, 1) and exponent; zero, infinity and NaN give
    /// themselves and 0.
    fn frexp(&mut self, x: Value) -> (Value, Value) {
        let b = &mut self.builder;
        let smallest = b.float(f32::MIN_POSITIVE);
        let scale = b.float(16_777_216.0);
        let magnitude = b.arith(Arith::AbsF, &[x]);
        let is_subnormal = b.arith(Arith::LtF, &[magnitude, smallest]);
        let scaled = b.arith(Arith::MulF, &[x, scale]);
        let normal = b.select(is_subnormal, scaled, x);
        let bits = b.arith(Arith::FToBits, &[normal]);
        let (shift, field, bias, shifted_bias) = (b.int(23), b.int(255), b.int(126), b.int(150));
        let exponent = b.arith(Arith::ShrU, &[bits, shift]);
        let exponent = b.arith(Arith::And, &[exponent, field]);
        let bias = b.select(is_subnormal, shifted_bias, bias);
        let exponent = b.arith(Arith::SubI, &[exponent, bias]);
        let (kept, half) = (b.int(0x807f_ffff), b.int(0x3f00_0000));
        let fraction = b.arith(Arith::And, &[bits, kept]);
        let fraction = b.arith(Arith::Or, &[fraction, half]);
        let fraction = b.arith(Arith::BitsToF, &[fraction]);
        let (zero, infinity) = (b.float(0.0), b.float(f32::INFINITY));
        let is_positive = b.arith(Arith::LtF, &[zero, magnitude]);
        let is_finite = b.arith(Arith::LtF, &[magnitude, infinity]);
        let regular = b.arith(Arith::And, &[is_positive, is_finite]);
        let none = b.int(0);
        (
            b.select(regular, fraction, x),
            b.select(regular, exponent, none),
        )
    }

    /// Functions on whole vectors.
    fn geometric(
        &mut self,
        function: MathFunction,
        kind: ScalarKind,
        args: &[Vec<Value>],
    ) -> Option<Vec<Value>> {
        use MathFunction as M;
        let class = super::layout::class_of(kind);
        Some(match function {
            M::Dot => vec![self.dot(class, &args[0], &args[1])],
            M::Length => vec![self.length(&args[0])],
            M::Distance => {
                let difference = self.each(Arith::SubF, &args[0], &args[1]);
                vec![self.length(&difference)]
            }
            M::Normalize => {
                let length = self.length(&args[0]);
                self.each(Arith::DivF, &args[0], &[length])
            }
            M::Cross => {
                let (a, b) = (&args[0], &args[1]);
                (0..3)
                    .map(|i| {
                        let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                        let first = self.builder.arith(Arith::MulF, &[a[j], b[k]]);
                        let second = self.builder.arith(Arith::MulF, &[a[k], b[j]]);
                        self.builder.arith(Arith::SubF, &[first, second])
                    })
                    .collect()
            }
            M::FaceForward => {
                let facing = self.dot(Class::Float, &args[1], &args[2]);
                let zero = self.builder.float(0.0);
                let away = self.builder.arith(Arith::LtF, &[facing, zero]);
                args[0]
                    .iter()
                    .map(|&value| {
                        let negative = self.builder.arith(Arith::NegF, &[value]);
                        self.builder.select(away, value, negative)
                    })
                    .collect()
            }
            M::Reflect => {
                let along = self.dot(Class::Float, &args[1], &args[0]);
                let two = self.builder.float(2.0);
                let twice = self.builder.arith(Arith::MulF, &[two, along]);
                let moved = self.each(Arith::MulF, &args[1], &[twice]);
                self.each(Arith::SubF, &args[0], &moved)
            }
            M::Refract => {
                let (incident, normal, eta) = (&args[0], &args[1], args[2][0]);
                let along = self.dot(Class::Float, normal, incident);
                let (zero, one) = (self.builder.float(0.0), self.builder.float(1.0));
                let square = self.builder.arith(Arith::MulF, &[along, along]);
                let sine = self.builder.arith(Arith::SubF, &[one, square]);
                let ratio = self.builder.arith(Arith::MulF, &[eta, eta]);
                let sine = self.builder.arith(Arith::MulF, &[ratio, sine]);
                let k = self.builder.arith(Arith::SubF, &[one, sine]);
                let total = self.builder.arith(Arith::LtF, &[k, zero]);
                let root = self.builder.arith(Arith::SqrtF, &[k]);
                let forward = self.builder.arith(Arith::MulF, &[eta, along]);
                let factor = self.builder.arith(Arith::AddF, &[forward, root]);
                let bent = self.each(Arith::MulF, incident, &[eta]);
                let along = self.each(Arith::MulF, normal, &[factor]);
                let refracted = self.each(Arith::SubF, &bent, &along);
                refracted
                    .into_iter()
                    .map(|value| self.builder.select(total, zero, value))
                    .collect()
            }
            _ => return None,
        })
    }

    fn each(&mut self, op: Arith, a: &[Value], b: &[Value]) -> Vec<Value> {
        a.iter()
            .enumerate()
            .map(|(i, &a)| {
                self.builder
                    .arith(op, &[a, b[if b.len() == 1 { 0 } else { i }]])
            })
            .collect()
    }

    fn length(&mut self, vector: &[Value]) -> Value {
        if let [value] = *vector {
            return self.builder.arith(Arith::AbsF, &[value]);
        }
        let square = self.dot(Class::Float, vector, vector);
        self.builder.arith(Arith::SqrtF, &[square])
    }

    /// By the first column's cofactors.
    fn determinant(&mut self, m: &[Value], size: VectorSize) -> Value {
        let n = size as usize;
        let rows: Vec<usize> = (0..n).collect();
        self.minor(m, n, 0, &rows)
    }

    fn minor(&mut self, m: &[Value], n: usize, column: usize, rows: &[usize]) -> Value {
        if let [row] = *rows {
            return m[column * n + row];
        }
        let mut sum = None;
        for (i, &row) in rows.iter().enumerate() {
            let others: Vec<usize> = rows.iter().copied().filter(|&r| r != row).collect();
            let minor = self.minor(m, n, column + 1, &others);
            let product = self
                .builder
                .arith(Arith::MulF, &[m[column * n + row], minor]);
            sum = Some(match sum {
                None => product,
                Some(sum) => self.builder.arith(
                    if i % 2 == 1 { Arith::SubF } else { Arith::AddF },
                    &[sum, product],
                ),
            });
        }
        sum.unwrap_or_else(|| self.builder.float(0.0))
    }

    /// Functions between numbers and the bytes or halves of a word.
    fn packing(
        &mut self,
        function: MathFunction,
        args: &[Vec<Value>],
    ) -> Result<Option<Vec<Value>>, Fail> {
        use MathFunction as M;
        let x = &args[0];
        Ok(Some(match function {
            M::Pack4x8snorm => vec![self.pack_normalised(x, 8, true)],
            M::Pack4x8unorm => vec![self.pack_normalised(x, 8, false)],
            M::Pack2x16snorm => vec![self.pack_normalised(x, 16, true)],
            M::Pack2x16unorm => vec![self.pack_normalised(x, 16, false)],
            M::Pack2x16float => {
                let halves: Vec<Value> = x
                    .iter()
                    .map(|&v| self.builder.arith(Arith::FToHalf, &[v]))
                    .collect();
                vec![self.join(&halves, 16)]
            }
            M::Pack4xI8 | M::Pack4xU8 => vec![self.join(x, 8)],
            M::Pack4xI8Clamp | M::Pack4xU8Clamp => {
                let signed = function == M::Pack4xI8Clamp;
                let (low, high) = if signed {
                    (self.builder.int((-128_i32) as u32), self.builder.int(127))
                } else {
                    (self.builder.int(0), self.builder.int(255))
                };
                let (max, min) = if signed {
                    (Arith::MaxS, Arith::MinS)
                } else {
                    (Arith::MaxU, Arith::MinU)
                };
                let clamped = self.each(max, x, &[low]);
                let clamped = self.each(min, &clamped, &[high]);
                vec![self.join(&clamped, 8)]
            }
            M::Unpack4x8snorm => self.unpack_normalised(x[0], 8, true),
            M::Unpack4x8unorm => self.unpack_normalised(x[0], 8, false),
            M::Unpack2x16snorm => self.unpack_normalised(x[0], 16, true),
            M::Unpack2x16unorm => self.unpack_normalised(x[0], 16, false),
            M::Unpack2x16float => {
                let halves = self.split(x[0], 16, false);
                halves
                    .into_iter()
                    .map(|half| self.builder.arith(Arith::HalfToF, &[half]))
                    .collect()
            }
            M::Unpack4xI8 => self.split(x[0], 8, true),
            M::Unpack4xU8 => self.split(x[0], 8, false),
            M::Dot4I8Packed | M::Dot4U8Packed => {
                let signed = function == M::Dot4I8Packed;
                let (a, b) = (
                    self.split(x[0], 8, signed),
                    self.split(args[1][0], 8, signed),
                );
                vec![self.dot(Class::Int, &a, &b)]
            }
            _ => return Ok(None),
        }))
    }

    /// `floor(0.5 + scale * clamp(x))` of each component, as WGSL defines.
    fn pack_normalised(&mut self, x: &[Value], bits: u32, signed: bool) -> Value {
        let scale = if signed {
            (1_u32 << (bits - 1)) - 1
        } else {
            (1 << bits) - 1
        };
        let b = &mut self.builder;
        let (low, one, scale, half) = (
            b.float(if signed { -1.0 } else { 0.0 }),
            b.float(1.0),
            b.float(scale as f32),
            b.float(0.5),
        );
        let parts: Vec<Value> = x
            .iter()
            .map(|&v| {
                let v = b.arith(Arith::MaxF, &[v, low]);
                let v = b.arith(Arith::MinF, &[v, one]);
                let v = b.arith(Arith::MulF, &[v, scale]);
                let v = b.arith(Arith::AddF, &[half, v]);
                let v = b.arith(Arith::FloorF, &[v]);
                b.arith(Arith::FToS, &[v])
            })
            .collect();
        self.join(&parts, bits)
    }

    fn unpack_normalised(&mut self, x: Value, bits: u32, signed: bool) -> Vec<Value> {
        let scale = if signed {
            (1_u32 << (bits - 1)) - 1
        } else {
            (1 << bits) - 1
        };
        let parts = self.split(x, bits, signed);
        let b = &mut self.builder;
        let (scale, least) = (b.float(scale as f32), b.float(-1.0));
        parts
            .into_iter()
            .map(|part| {
                let v = b.arith(if signed { Arith::SToF } else { Arith::UToF }, &[part]);
                let v = b.arith(Arith::DivF, &[v, scale]);
                if signed {
                    b.arith(Arith::MaxF, &[v, least])
                } else {
                    v
                }
            })
            .collect()
    }

    /// The low `bits` bits of each part, the first lowest.
    fn join(&mut self, parts: &[Value], bits: u32) -> Value {
        let b = &mut self.builder;
        let field = b.int((1 << bits) - 1);
        let mut word = b.int(0);
        for (i, &part) in parts.iter().enumerate() {
            let shift = b.int(i as u32 * bits);
            let part = b.arith(Arith::And, &[part, field]);
            let part = b.arith(Arith::Shl, &[part, shift]);
            word = b.arith(Arith::Or, &[word, part]);
        }
        word
    }

    /// All fields of `bits` bits, the lowest first.
    fn split(&mut self, word: Value, bits: u32, signed: bool) -> Vec<Value> {
        let b = &mut self.builder;
        (0..32 / bits)
            .map(|i| {
                let (up, down) = (b.int(32 - bits * (i + 1)), b.int(32 - bits));
                let high = b.arith(Arith::Shl, &[word, up]);
                b.arith(
                    if signed { Arith::ShrS } else { Arith::ShrU },
                    &[high, down],
                )
            })
            .collect()
    }
}
