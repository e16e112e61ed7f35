//! Results moved within what WGSL allows a device: see
//! [`Executor::with_perturbation`](super::Executor::with_perturbation).

use std::cmp::Ordering;

use super::link::Instr;
use super::probe::{Scalar, Twin, ulp};
use super::state::State;
use super::tier::Step;
use crate::ir::{Arith, Op, Perturbed};
use crate::num::{Number, f16_to_f32, f32_to_f16};
use crate::registers::LANES;

/// A result is moved by the same amount wherever the same operands meet at the same
/// place of a program, as on a device.
pub(super) struct Perturb;

impl<N: Number> Step<N> for Perturb {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::Perturb(perturbed), Some(&Some(to))) = (inst.op, inst.results.first()) else {
            return;
        };
        let from = inst.operands[0];
        let seed = state.perturbation;
        let twin = Twin::of(perturbed.op);
        for chunk in 0..state.chunks {
            let mut results: [N; LANES] = state.floats(from, chunk);
            if let Some(seed) = seed {
                let lanes = if to.varying { LANES } else { 1 };
                let mut given: [[N; LANES]; 4] = [[N::default(); LANES]; 4];
                let mut ints = [[0; LANES]; 4];
                let operands = inst.operands[1..].iter().take(4).enumerate();
                let count = operands.len();
                for (at, &slot) in operands {
                    match slot.class {
                        crate::registers::Class::Float => given[at] = state.floats(slot, chunk),
                        crate::registers::Class::Int => ints[at] = state.ints(slot, chunk),
                    }
                }
                for lane in 0..lanes {
                    let mut scalars = [Scalar::default(); 4];
                    for at in 0..count {
                        let single = given[at][lane].to_f32();
                        scalars[at] = Scalar::single(single, ints[at][lane]);
                    }
                    let result = results[lane].to_f32();
                    let moved = perturbed.moved(twin, result, &scalars[..count], seed);
                    results[lane] = N::from_f32(moved);
                }
            }
            state.set_floats(to, chunk, &results);
            if !to.varying {
                break;
            }
        }
    }
}

/// How far a result may be from that of exact arithmetic.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Allowed {
    /// Either neighbour of the exact result (WGSL §15.7.4: "correctly rounded", with
    /// §15.7.1: "WGSL does not specify a rounding mode").
    Neighbours,
    /// Units in the last place.
    Ulps(f64),
    /// So much.
    Absolute(f64),
    /// Either neighbour among the numbers of binary16 (Vulkan, "Conversion to Floating
    /// Point" of stores: the rounding is the device's).
    HalfNeighbours,
    /// Nothing.
    Exact,
}

const TWO_TO_MINUS_11: f64 = 1.0 / 2048.0;
const TWO_TO_MINUS_21: f64 = 1.0 / 2_097_152.0;

/// WGSL §15.7.4.1, "Accuracy of Built-in Functions"; what is inherited there from an
/// expression is here the sum of what its parts allow.
fn allowed(op: Arith, operands: &[Scalar]) -> Allowed {
    use Arith as A;
    let x = operands.first().map_or(0.0, |x| f64::from(x.single));
    let logarithm = if (0.5..=2.0).contains(&x) {
        Allowed::Absolute(TWO_TO_MINUS_21)
    } else {
        Allowed::Ulps(3.0)
    };
    match op {
        A::AddF | A::SubF | A::MulF | A::LdexpF => Allowed::Neighbours,
        A::MulAddF | A::MulSubF | A::SubMulF | A::SToF | A::UToF => Allowed::Neighbours,
        A::RoundHalf => Allowed::HalfNeighbours,
        A::DivF => Allowed::Ulps(2.5),
        // x - y * trunc(x / y), where that keeps its integer.
        A::RemF => Allowed::Neighbours,
        // 1 / inverseSqrt(x): 2 and 2.5.
        A::SqrtF => Allowed::Ulps(4.5),
        A::ExpF | A::Exp2F => Allowed::Ulps(3.0 + 2.0 * x.abs()),
        A::LogF | A::Log2F => logarithm,
        // exp2(y * log2(x)).
        A::PowF => {
            let y = operands.get(1).map_or(0.0, |y| f64::from(y.single));
            let exponent = (y * x.abs().log2()).abs();
            let units = if exponent.is_finite() { exponent } else { 0.0 };
            Allowed::Ulps(3.0 + 5.0 * units)
        }
        A::SinF | A::CosF => Allowed::Absolute(TWO_TO_MINUS_11),
        // sin(x) / cos(x).
        A::TanF => Allowed::Absolute(TWO_TO_MINUS_11 * (1.0 + x.tan().powi(2))),
        A::AtanF | A::Atan2F => Allowed::Ulps(4096.0),
        A::AsinF | A::AcosF => Allowed::Absolute(6.81e-5),
        // Of exponentials and logarithms.
        A::SinhF | A::CoshF | A::TanhF => Allowed::Ulps(6.0 + 4.0 * x.abs()),
        A::AsinhF | A::AcoshF | A::AtanhF => Allowed::Absolute(TWO_TO_MINUS_21),
        _ => Allowed::Exact,
    }
}

impl Perturbed {
    /// What a device might have made of it.
    fn moved(self, twin: Twin, result: f32, operands: &[Scalar], seed: u64) -> f32 {
        let mut random = Random::of(seed, self.site, operands);
        let habit = Habit::of(seed);
        // With a product among the operands of a sum, a device may leave that unrounded.
        if self.product.is_some() && habit.outwards(&mut random) {
            return self.contracted(operands).unwrap_or(result);
        }
        let own = &operands[..operands
            .len()
            .min(if self.product.is_some() { 2 } else { 4 })];
        let allowed = allowed(self.op, own);
        if allowed == Allowed::HalfNeighbours {
            return half_neighbour(result, habit.outwards(&mut random));
        }
        let (exact, _) = twin.of_singles(own);
        if allowed == Allowed::Exact || !result.is_finite() || !exact.is_finite() {
            return result;
        }
        let subnormal = |value: f32| value != 0.0 && value.abs() < f32::MIN_POSITIVE;
        let mut flushed = [Scalar::default(); 4];
        flushed[..own.len()].copy_from_slice(own);
        let mut exact = exact;
        if own.iter().any(|operand| subnormal(operand.single)) && !habit.outwards(&mut random) {
            for scalar in &mut flushed {
                if subnormal(scalar.single) {
                    *scalar = Scalar::single(0.0_f32.copysign(scalar.single), scalar.int);
                }
            }
            exact = twin.of_singles(&flushed[..own.len()]).0;
            if !exact.is_finite() {
                return result;
            }
        }
        let moved = match allowed {
            Allowed::Neighbours => neighbour(exact, habit.outwards(&mut random) == (exact > 0.0)),
            Allowed::Ulps(ulps) => (exact + ulps * ulp(exact) * random.signed()) as f32,
            Allowed::Absolute(error) => (exact + error * random.signed()) as f32,
            Allowed::HalfNeighbours | Allowed::Exact => result,
        };
        if !moved.is_finite() {
            return result;
        }
        if subnormal(moved) && !habit.outwards(&mut random) {
            return 0.0_f32.copysign(moved);
        }
        moved
    }

    /// A sum or difference with one of its operands, a product, unrounded. Operands are
    /// those two, then the factors.
    fn contracted(self, operands: &[Scalar]) -> Option<f32> {
        let number = |at: usize| operands.get(at).map(|operand| operand.single);
        let (a, b, x, y) = (number(0)?, number(1)?, number(2)?, number(3)?);
        let is_first = self.product? == 0;
        let fused = match (self.op, is_first) {
            (Arith::AddF, true) => x.mul_add(y, b),
            (Arith::AddF, false) => x.mul_add(y, a),
            (Arith::SubF, true) => x.mul_add(y, -b),
            (Arith::SubF, false) => (-x).mul_add(y, a),
            _ => return None,
        };
        fused.is_finite().then_some(fused)
    }
}

/// The neighbour of an exact result below or above it; the result itself where there
/// is one.
fn neighbour(exact: f64, up: bool) -> f32 {
    let nearest = exact as f32;
    let back = f64::from(nearest);
    match back.partial_cmp(&exact) {
        Some(Ordering::Less) if up => nearest.next_up(),
        Some(Ordering::Greater) if !up => nearest.next_down(),
        _ => nearest,
    }
}

/// A number of binary16 next to a number: the one nearer to 0 or the other.
fn half_neighbour(value: f32, outwards: bool) -> f32 {
    let bits = f32_to_f16(value);
    let nearest = f16_to_f32(bits);
    if nearest == value || !nearest.is_finite() {
        return value;
    }
    // Magnitudes are in the order of their bits.
    let other = match (nearest.abs() > value.abs(), outwards) {
        (true, false) => f16_to_f32(bits.saturating_sub(1)),
        (false, true) => f16_to_f32(bits + 1),
        _ => nearest,
    };
    if other.is_finite() { other } else { nearest }
}

/// How a device is in all it does. Errors that are made one way or the other at random
/// mostly cancel; those of a device that always does the same add up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Habit {
    /// Rounds towards 0, fuses nothing, flushes.
    Inwards,
    /// Rounds away from 0, fuses all, keeps.
    Outwards,
    /// This way or that.
    None,
}

impl Habit {
    /// The first two seeds are devices with habits.
    fn of(seed: u64) -> Self {
        match seed {
            0 => Self::Inwards,
            1 => Self::Outwards,
            _ => Self::None,
        }
    }

    fn outwards(self, random: &mut Random) -> bool {
        match self {
            Self::Inwards => false,
            Self::Outwards => true,
            Self::None => random.coin(),
        }
    }
}

/// A sequence that depends on nothing but where it began: SplitMix64 (G. Steele et al.,
/// "Fast Splittable Pseudorandom Number Generators", 2014).
struct Random(u64);

impl Random {
    fn of(seed: u64, site: u32, operands: &[Scalar]) -> Self {
        let mut random = Self(seed ^ u64::from(site) << 32);
        random.0 = random.next();
        for operand in operands {
            random.0 ^= u64::from(operand.single.to_bits() ^ operand.int);
            random.0 = random.next();
        }
        random
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn coin(&mut self) -> bool {
        self.next() >> 63 != 0
    }

    /// In [-1, 1].
    fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scalars(values: &[f32]) -> Vec<Scalar> {
        values.iter().map(|&v| Scalar::single(v, 0)).collect()
    }

    fn plain(op: Arith) -> Perturbed {
        Perturbed {
            op,
            site: 3,
            product: None,
        }
    }

    #[test]
    fn sums_become_either_neighbour_and_nothing_else() {
        let (a, b) = (1.0_f32, 1e-9_f32);
        let mut seen = std::collections::BTreeSet::new();
        for seed in 0..64 {
            let moved =
                plain(Arith::AddF).moved(Twin::of(Arith::AddF), a + b, &scalars(&[a, b]), seed);
            seen.insert(moved.to_bits());
        }
        let wanted = [1.0_f32, 1.0_f32.next_up()].map(f32::to_bits);
        assert_eq!(seen.into_iter().collect::<Vec<_>>(), wanted);
        for seed in 0..64 {
            let moved =
                plain(Arith::AddF).moved(Twin::of(Arith::AddF), 3.0, &scalars(&[1.0, 2.0]), seed);
            assert_eq!(moved, 3.0, "what is exact stays");
        }
    }

    #[test]
    fn functions_stay_within_the_table() {
        for (op, x, bound) in [
            (Arith::SinF, 1.0_f32, TWO_TO_MINUS_11 + 1e-7),
            (Arith::ExpF, 1.0, 5.0 * ulp(std::f64::consts::E) + 3e-7),
            (Arith::Log2F, 1.5, TWO_TO_MINUS_21 + 1e-7),
        ] {
            let twin = Twin::of(op);
            let exact = twin.of_singles(&scalars(&[x])).0;
            let mut widest = 0.0_f64;
            for seed in 0..256 {
                let moved = plain(op).moved(twin, exact as f32, &scalars(&[x]), seed);
                widest = widest.max((f64::from(moved) - exact).abs());
            }
            assert!(widest <= bound, "{op:?}: {widest}");
            assert!(widest > bound / 4.0, "{op:?} does not move: {widest}");
        }
    }

    #[test]
    fn products_are_left_unrounded_at_times() {
        let (x, y) = (1.0_f32 + f32::EPSILON, 1.0_f32 - f32::EPSILON);
        let product = x * y;
        let perturbed = Perturbed {
            product: Some(0),
            ..plain(Arith::SubF)
        };
        let operands = scalars(&[product, 1.0, x, y]);
        let seen: std::collections::BTreeSet<u32> = (0..64)
            .map(|seed| perturbed.moved(Twin::of(Arith::SubF), product - 1.0, &operands, seed))
            .map(f32::to_bits)
            .collect();
        assert!(seen.contains(&x.mul_add(y, -1.0).to_bits()));
        assert!(seen.contains(&(product - 1.0).to_bits()));
    }

    #[test]
    fn stores_of_halves_become_either_neighbour() {
        for value in [0.1_f32, -0.1, 1000.3, 1e-7, 65_490.0] {
            let (inner, outer) = (half_neighbour(value, false), half_neighbour(value, true));
            for half in [inner, outer] {
                assert_eq!(half, f16_to_f32(f32_to_f16(half)), "{value}");
            }
            assert!(
                inner.abs() < value.abs() && value.abs() < outer.abs(),
                "{value}"
            );
            let step = (outer - inner).abs();
            assert!(step <= (value.abs() / 512.0).max(6.1e-8), "{value}: {step}");
        }
        assert_eq!(half_neighbour(0.5, false), 0.5);
        assert_eq!(half_neighbour(1e9, false), 1e9);
    }

    #[test]
    fn devices_with_habits_keep_them() {
        let (a, b) = (-1.0_f32, -1e-9_f32);
        let twin = Twin::of(Arith::AddF);
        let moved = |seed| plain(Arith::AddF).moved(twin, a + b, &scalars(&[a, b]), seed);
        assert_eq!(moved(0), -1.0, "towards 0");
        assert_eq!(moved(1), (-1.0_f32).next_down(), "away from it");
    }

    #[test]
    fn subnormal_results_are_flushed_at_times() {
        let (a, b) = (f32::MIN_POSITIVE, 0.5_f32);
        let twin = Twin::of(Arith::MulF);
        let seen: Vec<f32> = (0..64)
            .map(|seed| plain(Arith::MulF).moved(twin, a * b, &scalars(&[a, b]), seed))
            .collect();
        assert!(seen.contains(&0.0) && seen.contains(&(a * b)));
    }
}
