//! Long superinstructions: chains of instructions with one result, out of a few
//! registers of lanes and any number that are the same in all lanes.
//!
//! The table gives each as the instructions it stands for, and makes of that both
//! what [`crate::lower`] looks for and what the executor computes: by the very
//! meanings of [`super::arith`], so that it rounds wherever those do. Between them
//! nothing goes through memory, where instruction by instruction every step does.

use super::arith::{Arith, Binary, Quaternary, Ternary, Unary, meaning as step};
use crate::num::Number;

/// Meaning of a chain: of `V` numbers in lanes, `F` numbers that are the same in all
/// of them, and `I` integers.
pub(crate) trait Chained<N: Number, const V: usize, const F: usize, const I: usize>:
    'static
{
    /// `STEPS` says that there is no instruction for rounding to an integer.
    fn eval<const STEPS: bool>(lanes: [N; V], numbers: [N; F], bits: [u32; I]) -> N;
}

/// Passed a chain's meaning by [`Chain::visit`].
pub(crate) trait ChainVisitor<N: Number> {
    type Output;
    fn chain<const V: usize, const F: usize, const I: usize, O: Chained<N, V, F, I>>(
        self,
    ) -> Self::Output;
}

/// An instruction of a chain; operands are results of others or the chain's own.
pub(crate) struct Part {
    pub(crate) result: &'static str,
    pub(crate) op: Arith,
    pub(crate) operands: &'static [&'static str],
}

/// What a chain stands for. Its operands are `lanes`, `numbers` and `bits` in that
/// order, its result that of the last part.
pub(crate) struct Pattern {
    pub(crate) chain: Chain,
    /// Numbers in registers of lanes.
    pub(crate) lanes: &'static [&'static str],
    /// Numbers that are the same in all lanes.
    pub(crate) numbers: &'static [&'static str],
    /// Integers that are.
    pub(crate) bits: &'static [&'static str],
    pub(crate) parts: &'static [Part],
}

macro_rules! count {
    ($($name:ident)*) => { <[&str]>::len(&[$(stringify!($name)),*]) };
}

macro_rules! eval {
    ($n:ident $steps:ident AddFloorF $a:ident $b:ident) => {
        if $steps {
            eval!($n $steps AddFloorStepsF $a $b)
        } else {
            <step::AddFloorF as Binary<$n>>::eval($a, $b)
        }
    };
    ($n:ident $steps:ident MulAddFloorF $a:ident $b:ident $c:ident) => {
        if $steps {
            eval!($n $steps MulAddFloorStepsF $a $b $c)
        } else {
            <step::MulAddFloorF as Ternary<$n>>::eval($a, $b, $c)
        }
    };
    ($n:ident $steps:ident $op:ident $a:ident) => {
        <step::$op as Unary<$n>>::eval($a)
    };
    ($n:ident $steps:ident $op:ident $a:ident $b:ident) => {
        <step::$op as Binary<$n>>::eval($a, $b)
    };
    ($n:ident $steps:ident $op:ident $a:ident $b:ident $c:ident) => {
        <step::$op as Ternary<$n>>::eval($a, $b, $c)
    };
    ($n:ident $steps:ident $op:ident $a:ident $b:ident $c:ident $e:ident) => {
        <step::$op as Quaternary<$n>>::eval($a, $b, $c, $e)
    };
}

macro_rules! chains {
    ($(
        $(#[$doc:meta])*
        $name:ident $mnemonic:literal
        ($($lane:ident)*; $($number:ident)*; $($bit:ident)*)
        { $($part:ident = $op:ident($($operand:ident),*);)* } -> $result:ident
    )*) => {
        /// A long superinstruction: total, without side effects, lane by lane.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub(crate) enum Chain { $($(#[$doc])* $name,)* }

        impl Chain {
            pub(crate) fn mnemonic(self) -> &'static str {
                match self { $(Self::$name => $mnemonic,)* }
            }

            pub(crate) fn visit<N: Number, V: ChainVisitor<N>>(self, visitor: V) -> V::Output {
                match self {
                    $(Self::$name => visitor.chain::<
                        { count!($($lane)*) },
                        { count!($($number)*) },
                        { count!($($bit)*) },
                        meaning::$name,
                    >(),)*
                }
            }
        }

        /// All chains; of those that end alike the longer ones first.
        pub(crate) const PATTERNS: &[Pattern] = &[$(Pattern {
            chain: Chain::$name,
            lanes: &[$(stringify!($lane)),*],
            numbers: &[$(stringify!($number)),*],
            bits: &[$(stringify!($bit)),*],
            parts: &[$(Part {
                result: stringify!($part),
                op: Arith::$op,
                operands: &[$(stringify!($operand)),*],
            }),*],
        }),*];

        /// What each chain computes.
        mod meaning {
            use super::*;
            $(
                pub(crate) struct $name;

                impl<N: Number> Chained<
                    N,
                    { count!($($lane)*) },
                    { count!($($number)*) },
                    { count!($($bit)*) },
                > for $name {
                    #[inline(always)]
                    fn eval<const STEPS: bool>(
                        [$($lane),*]: [N; count!($($lane)*)],
                        [$($number),*]: [N; count!($($number)*)],
                        [$($bit),*]: [u32; count!($($bit)*)],
                    ) -> N {
                        $(let $part = eval!(N STEPS $op $($operand)*);)*
                        $result
                    }
                }
            )*
        }
    };
}

chains! {
    /// A number rounded to one with fewer bits of exponent and mantissa, done on its
    /// bits: what is stored in binary16.
    RoundBits "roundbits.f" (x; unit; magnitude infinity most drop one half cut least sign) {
        size = AndBits(x, magnitude);
        kept = CapU(size, infinity, most);
        odd = ShrAnd(kept, drop, one);
        sum = Add3I(kept, half, odd);
        normal = AndToBits(sum, cut);
        value = BitsToF(kept);
        raised = AddF(value, unit);
        small = SubF(raised, unit);
        chosen = SelectLeU(least, kept, normal, small);
        rounded = MergeToBits(chosen, x, sign);
    } -> rounded

    /// A number that is a fraction of a whole number of steps but for rounding, as
    /// that fraction: what is loaded from a normalised format.
    SnapFraction "snapfraction.f" (x; low high scale half near_part far_part tolerance;) {
        limited = ClampF(x, low, high);
        scaled = MulF(limited, scale);
        code = AddFloorF(scaled, half);
        exact = MulMulAddF(code, near_part, code, far_part);
        near = LtAbsSubF(scaled, code, tolerance);
        snapped = SelectF(near, exact, limited);
    } -> snapped

    /// The nearest such fraction: what is stored in a normalised format.
    RoundFraction "roundfraction.f" (x; low high scale half near_part far_part;) {
        limited = ClampF(x, low, high);
        code = MulAddFloorF(limited, scale, half);
        exact = MulMulAddF(code, near_part, code, far_part);
    } -> exact

    /// A logarithm: exponent and mantissa apart, of the mantissa a series.
    LogSeries "logseries.f" (x; one two c3 c2 c1 half scale; base shift mantissa) {
        off = SubBits(x, base);
        exponent = ShrS(off, shift);
        reduced = AndAddToBits(off, mantissa, base);
        f = SubF(reduced, one);
        more = AddF(f, two);
        s = DivF(f, more);
        z = MulF(s, s);
        inner = MulAddF(z, c3, c2);
        series = MulAddF(z, inner, c1);
        square = Mul3F(f, half, f);
        whole = SToF(exponent);
        rest = MulAddF(z, series, square);
        less = SubF(f, square);
        natural = MulAddF(s, rest, less);
        logarithm = MulAddF(natural, scale, whole);
    } -> logarithm

    /// A power of two: of the fraction a series, times that of the whole part.
    PowerSeries "powerseries.f" (x; half c6 c5 c4 c3 c2 c1 c0; bias shift) {
        whole = AddFloorF(x, half);
        f = SubF(x, whole);
        p5 = MulAddF(f, c6, c5);
        p4 = MulAddF(f, p5, c4);
        p3 = MulAddF(f, p4, c3);
        p2 = MulAddF(f, p3, c2);
        p1 = MulAddF(f, p2, c1);
        p0 = MulAddF(f, p1, c0);
        exponent = FToS(whole);
        power = AddShlToBits(exponent, bias, shift);
        scaled = MulF(p0, power);
    } -> scaled

    /// A curve that is a line up to a limit: how light is encoded for displays.
    LineOrCurve "lineorcurve.f" (x p; one more limit slope;) {
        over = SubMulByF(p, one, more);
        curve = AddF(p, over);
        low = LeF(x, limit);
        value = SelectMulF(x, slope, low, curve);
    } -> value

    /// What is above a threshold, with a soft knee around it.
    Knee "knee.f" (x; threshold zero knee most slope;) {
        over = SubF(x, threshold);
        hard = AtLeastF(over, zero);
        rise = LimitAddAtLeastF(over, knee, zero, most);
        kept = Mul3AtLeastF(rise, rise, slope, hard);
    } -> kept

    /// A number over a multiple of a weighted sum of three, and an addend.
    DivBySum "divbysum.f" (r g b factor addend; weight_r weight_g weight_b dividend;) {
        two = MulMulAddF(r, weight_r, g, weight_g);
        sum = MulAddF(b, weight_b, two);
        quotient = DivByMulAddF(factor, sum, addend, dividend);
    } -> quotient

    /// A weighted sum of three.
    WeightedSum "weightedsum.f" (r g b; weight_r weight_g weight_b;) {
        two = MulMulAddF(r, weight_r, g, weight_g);
        sum = MulAddF(b, weight_b, two);
    } -> sum

    /// A limited number times a factor, limited again.
    ClampMulAtMost "clampmulatmost.f" (x; low high factor most;) {
        limited = ClampF(x, low, high);
        product = MulAtMostF(limited, factor, most);
    } -> product
}
