//! The arithmetic instructions: each with its name, its signature and its
//! meaning in one place.
//!
//! The table makes the [`Arith`] enumeration (what the translator emits), and
//! for every instruction a type of the same name in [`meaning`] (what the
//! executor's handlers are generic over).

use crate::num::Number;
pub(crate) use crate::registers::{Class, ClassOf, Float, Int};

/// A lane of class `C` in number type `N`.
pub(crate) type Lane<N, C> = <C as ClassOf<N>>::Lane;

/// Meaning of an instruction with one operand.
pub(crate) trait Unary<N: Number> {
    type A: ClassOf<N>;
    type D: ClassOf<N>;
    fn eval(a: Lane<N, Self::A>) -> Lane<N, Self::D>;
}

/// Meaning of an instruction with two operands.
pub(crate) trait Binary<N: Number> {
    type A: ClassOf<N>;
    type B: ClassOf<N>;
    type D: ClassOf<N>;
    fn eval(a: Lane<N, Self::A>, b: Lane<N, Self::B>) -> Lane<N, Self::D>;
}

/// Meaning of an instruction with three operands.
pub(crate) trait Ternary<N: Number> {
    type A: ClassOf<N>;
    type B: ClassOf<N>;
    type C: ClassOf<N>;
    type D: ClassOf<N>;
    fn eval(a: Lane<N, Self::A>, b: Lane<N, Self::B>, c: Lane<N, Self::C>) -> Lane<N, Self::D>;
}

/// Meaning of an instruction with four operands.
pub(crate) trait Quaternary<N: Number> {
    type A: ClassOf<N>;
    type B: ClassOf<N>;
    type C: ClassOf<N>;
    type E: ClassOf<N>;
    type D: ClassOf<N>;
    fn eval(
        a: Lane<N, Self::A>,
        b: Lane<N, Self::B>,
        c: Lane<N, Self::C>,
        e: Lane<N, Self::E>,
    ) -> Lane<N, Self::D>;
}

/// Passed every instruction's meaning by [`Arith::visit`].
pub(crate) trait Visitor<N: Number> {
    type Output;
    fn unary<O: Unary<N> + 'static>(self) -> Self::Output;
    fn binary<O: Binary<N> + 'static>(self) -> Self::Output;
    fn ternary<O: Ternary<N> + 'static>(self) -> Self::Output;
    fn quaternary<O: Quaternary<N> + 'static>(self) -> Self::Output;
}

macro_rules! instructions {
    ($($name:ident $mnemonic:literal ($($arg:ident: $class:ident),*) -> $result:ident = $body:expr;)*) => {
        /// An arithmetic instruction: total, without side effects, lane by lane.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub(crate) enum Arith { $($name,)* }

        impl Arith {
            pub(crate) fn mnemonic(self) -> &'static str {
                match self { $(Self::$name => $mnemonic,)* }
            }

            /// The class of the result.
            pub(crate) fn result(self) -> Class {
                match self { $(Self::$name => Class::$result,)* }
            }

            pub(crate) fn visit<N: Number, V: Visitor<N>>(self, visitor: V) -> V::Output {
                match self { $(Self::$name => instructions!(@visit visitor $name $($class)*),)* }
            }
        }

        /// What each instruction computes.
        pub(crate) mod meaning {
            use super::*;
            $(
                pub(crate) struct $name;
                instructions!(@meaning $name ($($arg: $class),*) -> $result = $body);
            )*
        }
    };
    (@visit $visitor:ident $name:ident $a:ident) => { $visitor.unary::<meaning::$name>() };
    (@visit $visitor:ident $name:ident $a:ident $b:ident) => { $visitor.binary::<meaning::$name>() };
    (@visit $visitor:ident $name:ident $a:ident $b:ident $c:ident) => { $visitor.ternary::<meaning::$name>() };
    (@visit $visitor:ident $name:ident $a:ident $b:ident $c:ident $e:ident) => { $visitor.quaternary::<meaning::$name>() };
    (@meaning $name:ident ($a:ident: $ca:ident) -> $result:ident = $body:expr) => {
        impl<N: Number> Unary<N> for $name {
            type A = $ca;
            type D = $result;
            #[inline(always)]
            fn eval($a: Lane<N, $ca>) -> Lane<N, $result> { $body }
        }
    };
    (@meaning $name:ident ($a:ident: $ca:ident, $b:ident: $cb:ident) -> $result:ident = $body:expr) => {
        impl<N: Number> Binary<N> for $name {
            type A = $ca;
            type B = $cb;
            type D = $result;
            #[inline(always)]
            fn eval($a: Lane<N, $ca>, $b: Lane<N, $cb>) -> Lane<N, $result> { $body }
        }
    };
    (@meaning $name:ident ($a:ident: $ca:ident, $b:ident: $cb:ident, $c:ident: $cc:ident) -> $result:ident = $body:expr) => {
        impl<N: Number> Ternary<N> for $name {
            type A = $ca;
            type B = $cb;
            type C = $cc;
            type D = $result;
            #[inline(always)]
            fn eval($a: Lane<N, $ca>, $b: Lane<N, $cb>, $c: Lane<N, $cc>) -> Lane<N, $result> { $body }
        }
    };
    (@meaning $name:ident ($a:ident: $ca:ident, $b:ident: $cb:ident, $c:ident: $cc:ident, $e:ident: $ce:ident) -> $result:ident = $body:expr) => {
        impl<N: Number> Quaternary<N> for $name {
            type A = $ca;
            type B = $cb;
            type C = $cc;
            type E = $ce;
            type D = $result;
            #[inline(always)]
            fn eval($a: Lane<N, $ca>, $b: Lane<N, $cb>, $c: Lane<N, $cc>, $e: Lane<N, $ce>) -> Lane<N, $result> { $body }
        }
    };
}

use crate::num::mask;

/// Signed view of an integer lane.
#[inline(always)]
const fn s(value: u32) -> i32 {
    value as i32
}

instructions! {
    // Floating point.
    AddF "add.f" (a: Float, b: Float) -> Float = a.add(b);
    SubF "sub.f" (a: Float, b: Float) -> Float = a.sub(b);
    MulF "mul.f" (a: Float, b: Float) -> Float = a.mul(b);
    DivF "div.f" (a: Float, b: Float) -> Float = a.div(b);
    RemF "rem.f" (a: Float, b: Float) -> Float = a.rem(b);
    MinF "min.f" (a: Float, b: Float) -> Float = a.min(b);
    MaxF "max.f" (a: Float, b: Float) -> Float = a.max(b);
    // The same where the second operand is known to be a number.
    AtMostF "atmost.f" (a: Float, b: Float) -> Float = a.at_most(b);
    AtLeastF "atleast.f" (a: Float, b: Float) -> Float = a.at_least(b);
    PowF "pow.f" (a: Float, b: Float) -> Float = a.pow(b);
    Atan2F "atan2.f" (a: Float, b: Float) -> Float = a.atan2(b);
    LdexpF "ldexp.f" (a: Float, b: Int) -> Float = a.ldexp(s(b));
    // Rounded twice: never a fused multiply-add.
    MulAddF "muladd.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).add(c);
    MulSubF "mulsub.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).sub(c);
    SubMulF "submul.f" (a: Float, b: Float, c: Float) -> Float = c.sub(a.mul(b));
    NegF "neg.f" (a: Float) -> Float = a.neg();
    AbsF "abs.f" (a: Float) -> Float = a.abs();
    SignF "sign.f" (a: Float) -> Float = a.sign();
    FloorF "floor.f" (a: Float) -> Float = a.floor();
    CeilF "ceil.f" (a: Float) -> Float = a.ceil();
    TruncF "trunc.f" (a: Float) -> Float = a.trunc();
    RoundF "round.f" (a: Float) -> Float = a.round();
    SqrtF "sqrt.f" (a: Float) -> Float = a.sqrt();
    ExpF "exp.f" (a: Float) -> Float = a.exp();
    Exp2F "exp2.f" (a: Float) -> Float = a.exp2();
    LogF "log.f" (a: Float) -> Float = a.log();
    Log2F "log2.f" (a: Float) -> Float = a.log2();
    SinF "sin.f" (a: Float) -> Float = a.sin();
    CosF "cos.f" (a: Float) -> Float = a.cos();
    TanF "tan.f" (a: Float) -> Float = a.tan();
    AsinF "asin.f" (a: Float) -> Float = a.asin();
    AcosF "acos.f" (a: Float) -> Float = a.acos();
    AtanF "atan.f" (a: Float) -> Float = a.atan();
    SinhF "sinh.f" (a: Float) -> Float = a.sinh();
    CoshF "cosh.f" (a: Float) -> Float = a.cosh();
    TanhF "tanh.f" (a: Float) -> Float = a.tanh();
    AsinhF "asinh.f" (a: Float) -> Float = a.asinh();
    AcoshF "acosh.f" (a: Float) -> Float = a.acosh();
    AtanhF "atanh.f" (a: Float) -> Float = a.atanh();
    // The same where there is no instruction for it.
    FloorStepsF "floor.steps.f" (a: Float) -> Float = a.floor_in_steps();
    CeilStepsF "ceil.steps.f" (a: Float) -> Float = a.ceil_in_steps();
    TruncStepsF "trunc.steps.f" (a: Float) -> Float = a.trunc_in_steps();
    RoundStepsF "round.steps.f" (a: Float) -> Float = a.round_in_steps();
    SelectF "select.f" (c: Int, a: Float, b: Float) -> Float = N::select(c, a, b);

    // Comparisons; greater is less with the operands exchanged.
    EqF "eq.f" (a: Float, b: Float) -> Int = mask(a.eq(b));
    NeF "ne.f" (a: Float, b: Float) -> Int = !mask(a.eq(b));
    LtF "lt.f" (a: Float, b: Float) -> Int = mask(a.lt(b));
    LeF "le.f" (a: Float, b: Float) -> Int = mask(a.le(b));
    EqI "eq.i" (a: Int, b: Int) -> Int = mask(a == b);
    NeI "ne.i" (a: Int, b: Int) -> Int = mask(a != b);
    LtS "lt.s" (a: Int, b: Int) -> Int = mask(s(a) < s(b));
    LeS "le.s" (a: Int, b: Int) -> Int = mask(s(a) <= s(b));
    LtU "lt.u" (a: Int, b: Int) -> Int = mask(a < b);
    LeU "le.u" (a: Int, b: Int) -> Int = mask(a <= b);

    // Integers; all wrap.
    AddI "add.i" (a: Int, b: Int) -> Int = a.wrapping_add(b);
    SubI "sub.i" (a: Int, b: Int) -> Int = a.wrapping_sub(b);
    MulI "mul.i" (a: Int, b: Int) -> Int = a.wrapping_mul(b);
    // x / 0 = x, and the most negative number / -1 is itself.
    DivS "div.s" (a: Int, b: Int) -> Int = s(a).wrapping_div(if b == 0 { 1 } else { s(b) }) as u32;
    DivU "div.u" (a: Int, b: Int) -> Int = a / b.max(1);
    // x % 0 = 0.
    RemS "rem.s" (a: Int, b: Int) -> Int = s(a).wrapping_rem(if b == 0 { 1 } else { s(b) }) as u32;
    RemU "rem.u" (a: Int, b: Int) -> Int = a % b.max(1);
    And "and" (a: Int, b: Int) -> Int = a & b;
    Or "or" (a: Int, b: Int) -> Int = a | b;
    Xor "xor" (a: Int, b: Int) -> Int = a ^ b;
    AndNot "andnot" (a: Int, b: Int) -> Int = a & !b;
    // The shift amount is taken modulo 32.
    Shl "shl" (a: Int, b: Int) -> Int = a << (b & 31);
    ShrS "shr.s" (a: Int, b: Int) -> Int = (s(a) >> (b & 31)) as u32;
    ShrU "shr.u" (a: Int, b: Int) -> Int = a >> (b & 31);
    MinS "min.s" (a: Int, b: Int) -> Int = s(a).min(s(b)) as u32;
    MaxS "max.s" (a: Int, b: Int) -> Int = s(a).max(s(b)) as u32;
    MinU "min.u" (a: Int, b: Int) -> Int = a.min(b);
    MaxU "max.u" (a: Int, b: Int) -> Int = a.max(b);
    Not "not" (a: Int) -> Int = !a;
    AbsS "abs.s" (a: Int) -> Int = s(a).wrapping_abs() as u32;
    SignS "sign.s" (a: Int) -> Int = s(a).signum() as u32;
    Clz "clz" (a: Int) -> Int = a.leading_zeros();
    Ctz "ctz" (a: Int) -> Int = a.trailing_zeros();
    PopCount "popcount" (a: Int) -> Int = a.count_ones();
    Reverse "reverse" (a: Int) -> Int = a.reverse_bits();
    SelectI "select.i" (c: Int, a: Int, b: Int) -> Int = (a & c) | (b & !c);

    // Superinstructions: what `lower::fuse` makes of others that follow each
    // other. Each rounds wherever those do.
    ClampF "clamp.f" (a: Float, b: Float, c: Float) -> Float = a.at_least(b).at_most(c);
    Max3F "max3.f" (a: Float, b: Float, c: Float) -> Float = a.max(b).max(c);
    Add3F "add3.f" (a: Float, b: Float, c: Float) -> Float = a.add(b).add(c);
    MulAtMostF "mulatmost.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).at_most(c);
    AddAtLeastF "addatleast.f" (a: Float, b: Float, c: Float) -> Float = a.add(b).at_least(c);
    AddClampF "addclamp.f" (a: Float, b: Float, c: Float, e: Float) -> Float = a.add(b).at_least(c).at_most(e);
    LimitAddAtLeastF "limitaddatleast.f" (a: Float, b: Float, c: Float, e: Float) -> Float = e.at_most(a.add(b).at_least(c));
    Mul3AtLeastF "mul3atleast.f" (a: Float, b: Float, c: Float, e: Float) -> Float = a.mul(b).mul(c).at_least(e);
    DivByMulAddF "divbymuladd.f" (a: Float, b: Float, c: Float, e: Float) -> Float = e.div(a.mul(b).add(c));
    AtLeast2F "atleast2.f" (a: Float, b: Float, c: Float) -> Float = a.at_least(b).at_least(c);
    AddFloorF "addfloor.f" (a: Float, b: Float) -> Float = a.add(b).floor();
    AddFloorStepsF "addfloor.steps.f" (a: Float, b: Float) -> Float = a.add(b).floor_in_steps();
    MulAddFloorF "muladdfloor.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).add(c).floor();
    MulAddFloorStepsF "muladdfloor.steps.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).add(c).floor_in_steps();
    Mul3F "mul3.f" (a: Float, b: Float, c: Float) -> Float = a.mul(b).mul(c);
    AbsSubF "abssub.f" (a: Float, b: Float) -> Float = a.sub(b).abs();
    LtAbsSubF "ltabssub.f" (a: Float, b: Float, c: Float) -> Int = mask(a.sub(b).abs().lt(c));
    AddMulF "addmul.f" (a: Float, b: Float, c: Float) -> Float = a.add(b).mul(c);
    SubMulByF "submulby.f" (a: Float, b: Float, c: Float) -> Float = a.sub(b).mul(c);
    MulMulAddF "mulmuladd.f" (a: Float, b: Float, c: Float, e: Float) -> Float = c.mul(e).add(a.mul(b));
    MulAddAddF "muladdadd.f" (a: Float, b: Float, c: Float, e: Float) -> Float = a.mul(b).add(c).add(e);
    SelectMulF "selectmul.f" (a: Float, b: Float, c: Int, e: Float) -> Float = N::select(c, a.mul(b), e);
    SelectLeU "selectle.u" (a: Int, b: Int, c: Float, e: Float) -> Float = N::select(mask(a <= b), c, e);
    ClampS "clamp.s" (a: Int, b: Int, c: Int) -> Int = s(a).max(s(b)).min(s(c)) as u32;
    ShrAnd "shrand" (a: Int, b: Int, c: Int) -> Int = (a >> (b & 31)) & c;
    NotLeUOr "notleor.u" (a: Int, b: Int, c: Int) -> Int = !(mask(a <= b) | c);
    LeUOr "leor.u" (a: Int, b: Int, c: Int) -> Int = mask(a <= b) | c;
    AddShl "addshl" (a: Int, b: Int, c: Int) -> Int = a.wrapping_add(b) << (c & 31);
    AddShlToBits "f.addshl" (a: Int, b: Int, c: Int) -> Float = N::from_f32(f32::from_bits(a.wrapping_add(b) << (c & 31)));
    AndAdd "andadd" (a: Int, b: Int, c: Int) -> Int = (a & b).wrapping_add(c);
    AndAddToBits "f.andadd" (a: Int, b: Int, c: Int) -> Float = N::from_f32(f32::from_bits((a & b).wrapping_add(c)));
    AndToBits "f.and" (a: Int, b: Int) -> Float = N::from_f32(f32::from_bits(a & b));
    SubBits "sub.f.bits" (a: Float, b: Int) -> Int = a.to_f32().to_bits().wrapping_sub(b);
    BitsAndOr "bitsandor" (a: Float, b: Int, c: Int) -> Int = (a.to_f32().to_bits() & b) | c;
    MergeBits "mergebits" (a: Float, b: Float, c: Int) -> Int = (b.to_f32().to_bits() & c) | a.to_f32().to_bits();
    MergeToBits "f.mergebits" (a: Float, b: Float, c: Int) -> Float = N::from_f32(f32::from_bits((b.to_f32().to_bits() & c) | a.to_f32().to_bits()));
    AndOr "andor" (a: Int, b: Int, c: Int) -> Int = (a & b) | c;
    Add3I "add3.i" (a: Int, b: Int, c: Int) -> Int = a.wrapping_add(b).wrapping_add(c);
    // `a`, but 0 if it is above `b`, and at most `c`.
    CapU "cap.u" (a: Int, b: Int, c: Int) -> Int = (a & !mask(a > b)).min(c);
    ZeroAboveU "zeroabove.u" (a: Int, b: Int) -> Int = a & !mask(a > b);
    CapUToBits "f.cap.u" (a: Int, b: Int, c: Int) -> Float = N::from_f32(f32::from_bits((a & !mask(a > b)).min(c)));
    CapBits "f.cap.f" (a: Float, b: Int, c: Int) -> Float = N::from_f32(f32::from_bits({
        let bits = a.to_f32().to_bits();
        (bits & !mask(bits > b)).min(c)
    }));
    EqAnd "eqand" (a: Int, b: Int, c: Int) -> Int = mask(a & b == c);
    NeAnd "neand" (a: Int, b: Int, c: Int) -> Int = mask(a & b != c);
    EqAndBits "eqand.f" (a: Float, b: Int, c: Int) -> Int = mask(a.to_f32().to_bits() & b == c);
    NeAndBits "neand.f" (a: Float, b: Int, c: Int) -> Int = mask(a.to_f32().to_bits() & b != c);
    AndBits "and.f" (a: Float, b: Int) -> Int = a.to_f32().to_bits() & b;
    LtAnd "ltand.f" (a: Float, b: Float, c: Int) -> Int = mask(a.lt(b)) & c;
    LeAnd "leand.f" (a: Float, b: Float, c: Int) -> Int = mask(a.le(b)) & c;

    // Between the classes.
    FToS "s.from.f" (a: Float) -> Int = a.to_i32() as u32;
    FToU "u.from.f" (a: Float) -> Int = a.to_u32();
    SToF "f.from.s" (a: Int) -> Float = N::from_i32(s(a));
    UToF "f.from.u" (a: Int) -> Float = N::from_u32(a);
    FToBits "bits.from.f" (a: Float) -> Int = a.to_f32().to_bits();
    BitsToF "f.from.bits" (a: Int) -> Float = N::from_f32(f32::from_bits(a));
    FToHalf "half.from.f" (a: Float) -> Int = crate::num::f32_to_f16(a.to_f32());
    HalfToF "f.from.half" (a: Int) -> Float = N::from_f32(crate::num::f16_to_f32(a & 0xffff));
    // To the nearest binary16.
    RoundHalf "round.half" (a: Float) -> Float = N::from_f32(crate::num::f16_to_f32(crate::num::f32_to_f16(a.to_f32())));
}

impl Arith {
    /// Cost in vector operations per 16 lanes, roughly: what if-conversion weighs.
    pub(crate) fn cost(self) -> u32 {
        match self {
            Self::DivF | Self::DivByMulAddF | Self::SqrtF => 3,
            Self::RemF | Self::DivS | Self::DivU | Self::RemS | Self::RemU => 6,
            Self::ExpF | Self::Exp2F | Self::LogF | Self::Log2F | Self::SinF | Self::CosF => 10,
            Self::PowF => 20,
            Self::TanF | Self::AsinF | Self::AcosF | Self::AtanF | Self::Atan2F => 30,
            Self::SinhF
            | Self::CoshF
            | Self::TanhF
            | Self::AsinhF
            | Self::AcoshF
            | Self::AtanhF => 40,
            _ => 1,
        }
    }

    /// The instruction to use on the baseline tier: x86 has no rounding to
    /// integers before SSE4.1, and calling a function for each lane is slow.
    pub(crate) fn on_baseline(self) -> Self {
        match self {
            Self::FloorF => Self::FloorStepsF,
            Self::CeilF => Self::CeilStepsF,
            Self::TruncF => Self::TruncStepsF,
            Self::RoundF => Self::RoundStepsF,
            Self::AddFloorF => Self::AddFloorStepsF,
            Self::MulAddFloorF => Self::MulAddFloorStepsF,
            other => other,
        }
    }

    /// Whether the result of binary16 operands may be other than a binary16
    /// number, so that it has to be rounded to be one.
    pub(crate) fn leaves_half(self) -> bool {
        self.result() == Class::Float
            && !matches!(
                self,
                Self::NegF
                    | Self::AbsF
                    | Self::SignF
                    | Self::FloorF
                    | Self::CeilF
                    | Self::TruncF
                    | Self::RoundF
                    | Self::MinF
                    | Self::MaxF
                    | Self::AtMostF
                    | Self::AtLeastF
                    | Self::SelectF
                    | Self::BitsToF
                    | Self::HalfToF
                    | Self::RoundHalf
            )
    }

    /// Whether the first two operands may be exchanged.
    pub(crate) fn commutes(self) -> bool {
        matches!(
            self,
            Self::AddF
                | Self::MulF
                | Self::MulAddF
                | Self::MulSubF
                | Self::SubMulF
                | Self::EqF
                | Self::NeF
                | Self::EqI
                | Self::NeI
                | Self::AddI
                | Self::MulI
                | Self::And
                | Self::Or
                | Self::Xor
                | Self::MinS
                | Self::MaxS
                | Self::MinU
                | Self::MaxU
        )
    }
}
