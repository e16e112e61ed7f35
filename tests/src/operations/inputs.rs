//! Tables of ordinary and special values.

use super::float::{FloatType, power_of_two};

/// Numbers from a seed, the same everywhere (SplitMix64, Steele and others 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A sequence of its own for each seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ z >> 31
    }

    /// 32 random bits.
    pub fn word(&mut self) -> u32 {
        (self.bits() >> 32) as u32
    }

    /// In [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * power_of_two(-53)
    }

    /// One of several.
    pub fn pick(&mut self, values: &[u32]) -> u32 {
        values[(self.bits() % values.len().max(1) as u64) as usize]
    }
}

/// The words of numbers of a type.
fn words(ty: FloatType, values: impl IntoIterator<Item = f64>) -> Vec<u32> {
    values.into_iter().map(|value| ty.encode(value)).collect()
}

/// Both neighbours of a word, and itself.
fn around(ty: FloatType, value: f64) -> [u32; 3] {
    let word = ty.encode(value);
    [word.wrapping_sub(1), word, word + 1]
}

/// Values at which something may go wrong, of both signs: zeros, subnormal and
/// smallest normal numbers, 1 and its neighbours, the largest numbers,
/// infinities and NaN, ties of rounding, limits of integers, and some that are
/// nothing special.
#[must_use]
pub fn special(ty: FloatType) -> Vec<u32> {
    let smallest = ty.smallest_normal();
    let mut positive = Vec::new();
    for value in [smallest, 0.5, 1.0, 2.0, ty.largest() / 4.0] {
        let near = around(ty, ty.decode(ty.encode(value)));
        positive.extend(near);
    }
    positive.extend(words(
        ty,
        [
            0.0,
            smallest / 4.0,
            smallest * 2.0,
            0.25,
            0.75,
            1.5,
            2.5,
            3.0,
            10.0,
            100.5,
            1023.5,
            ty.largest(),
            f64::INFINITY,
            f64::NAN,
        ],
    ));
    // The smallest and the largest subnormal number.
    positive.push(1);
    positive.push(ty.encode(smallest) - 2);
    positive.push(ty.encode(ty.largest()) - 1);
    if ty == FloatType::F32 {
        positive.extend(words(
            ty,
            [
                f64::from(0.1_f32),
                f64::from(std::f32::consts::FRAC_PI_2),
                f64::from(std::f32::consts::PI),
                8_388_607.5,
                8_388_609.0,
                16_777_216.0,
                65504.0,
                65520.0,
                2_147_483_520.0,
                2_147_483_648.0,
                4_294_967_040.0,
                4_294_967_296.0,
                f64::from(1e20_f32),
                f64::from(1e-20_f32),
            ],
        ));
    }
    both_signs(ty, positive)
}

fn both_signs(ty: FloatType, positive: Vec<u32>) -> Vec<u32> {
    let sign = ty.encode(-0.0);
    let mut all: Vec<u32> = positive
        .iter()
        .flat_map(|&word| [word, word | sign])
        .collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Every power of two of the type, normal or not, and its neighbours, of both
/// signs.
#[must_use]
pub fn powers(ty: FloatType) -> Vec<u32> {
    let mut value = ty.decode(1);
    let mut positive = Vec::new();
    while value <= ty.largest() {
        positive.extend(around(ty, value));
        value *= 2.0;
    }
    both_signs(ty, positive)
}

/// A number of any exponent and sign; now and then infinity or NaN.
pub fn any(ty: FloatType, random: &mut Random) -> u32 {
    match ty {
        FloatType::F32 => random.word(),
        FloatType::F16 => random.word() & 0xffff,
    }
}

/// A number whose magnitude lies within 2^±8, in `f16` within 2^±2, so that
/// products of several are numbers too.
pub fn ordinary(ty: FloatType, random: &mut Random) -> u32 {
    let range = match ty {
        FloatType::F32 => 8,
        FloatType::F16 => 2,
    };
    let exponent = (random.bits() % (2 * range)) as i32 - range as i32;
    let magnitude = power_of_two(exponent) * (1.0 + random.unit());
    let sign = if random.bits() & 1 == 0 { 1.0 } else { -1.0 };
    ty.encode(ty.below(super::exact::Exact::new(sign * magnitude)))
}

/// A number between two others, evenly.
pub fn between(ty: FloatType, low: f64, high: f64, random: &mut Random) -> u32 {
    let value = low + (high - low) * random.unit();
    ty.encode(ty.below(super::exact::Exact::new(value)))
}

/// Cases of one number: special ones, powers, random ones, and evenly spread
/// ones of a range where the function has its features.
#[must_use]
pub fn one(ty: FloatType, range: (f64, f64), seed: u64) -> Vec<Vec<u32>> {
    let mut random = Random::new(seed);
    let mut all = special(ty);
    all.extend(powers(ty));
    all.extend((0..2000).map(|_| any(ty, &mut random)));
    all.extend((0..2000).map(|_| between(ty, range.0, range.1, &mut random)));
    if ty == FloatType::F16 {
        // There are few enough to have a good part of them all.
        all.extend((0..=0xffff).step_by(5));
    }
    all.into_iter().map(|word| vec![word]).collect()
}

/// Cases of `count` numbers: special ones combined with each other, random ones
/// of any size, ordinary ones, and ones close to each other.
#[must_use]
pub fn several(ty: FloatType, count: usize, seed: u64) -> Vec<Vec<u32>> {
    let mut random = Random::new(seed);
    let special = special(ty);
    let mut all: Vec<Vec<u32>> = if count == 2 {
        special
            .iter()
            .flat_map(|&a| special.iter().map(move |&b| vec![a, b]))
            .collect()
    } else {
        (0..4000)
            .map(|_| (0..count).map(|_| random.pick(&special)).collect())
            .collect()
    };
    for _ in 0..1500 {
        all.push((0..count).map(|_| any(ty, &mut random)).collect());
        all.push((0..count).map(|_| ordinary(ty, &mut random)).collect());
    }
    let sign = ty.encode(-0.0);
    for _ in 0..500 {
        // Within some ULP of each other, of either sign.
        let first = ordinary(ty, &mut random);
        let near = |random: &mut Random| {
            let sign = if random.bits() & 1 == 0 { 0 } else { sign };
            (first ^ sign).wrapping_add(random.word() % 16)
        };
        all.push((0..count).map(|_| near(&mut random)).collect());
    }
    all
}

/// Cases of `count` ordinary numbers, of which every eighth has a special one.
#[must_use]
pub fn mostly_ordinary(ty: FloatType, count: usize, seed: u64) -> Vec<Vec<u32>> {
    let mut random = Random::new(seed);
    let special = special(ty);
    (0..1500)
        .map(|index| {
            let mut case: Vec<u32> = (0..count).map(|_| ordinary(ty, &mut random)).collect();
            if index % 8 == 0 {
                let place = (random.bits() % count.max(1) as u64) as usize;
                case[place] = random.pick(&special);
            }
            case
        })
        .collect()
}

/// Integers at which something may go wrong: every power of two and its
/// neighbours, and the negatives of them all.
#[must_use]
pub fn integers() -> Vec<u32> {
    let mut all: Vec<u32> = (0..32)
        .flat_map(|bit| {
            let power = 1_u32 << bit;
            [power.wrapping_sub(1), power, power + 1]
        })
        .flat_map(|word| [word, word.wrapping_neg()])
        .chain([0x1234_5678, 0xdead_beef, 0x5555_5555, 0xaaaa_aaaa])
        .collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Cases of `count` integers: special ones combined, random ones, small ones.
#[must_use]
pub fn integer_cases(count: usize, seed: u64) -> Vec<Vec<u32>> {
    let mut random = Random::new(seed);
    let special = integers();
    let mut all: Vec<Vec<u32>> = match count {
        1 => special.iter().map(|&word| vec![word]).collect(),
        _ => (0..4000)
            .map(|_| (0..count).map(|_| random.pick(&special)).collect())
            .collect(),
    };
    if count > 1 {
        // What division and shifts have as hard cases, not left to chance.
        let hard = [
            0,
            1,
            2,
            31,
            32,
            33,
            0x7fff_ffff,
            0x8000_0000,
            0x8000_0001,
            u32::MAX,
        ];
        for &first in &hard {
            for &second in &hard {
                let mut case = vec![first, second];
                case.extend((2..count).map(|_| random.pick(&hard)));
                all.push(case);
            }
        }
    }
    for _ in 0..1000 {
        all.push((0..count).map(|_| random.word()).collect());
        // Each of a random length.
        all.push(
            (0..count)
                .map(|_| random.word() >> (random.bits() % 32))
                .collect(),
        );
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_have_every_kind_of_value() {
        for ty in [FloatType::F32, FloatType::F16] {
            let values: Vec<f64> = special(ty)
                .into_iter()
                .map(|word| ty.decode(word))
                .collect();
            let has = |what: &dyn Fn(f64) -> bool| values.iter().any(|&value| what(value));
            assert!(has(&|x| x == 0.0 && x.is_sign_negative()));
            assert!(has(&|x| ty.is_subnormal(x)) && has(&f64::is_nan));
            assert!(has(&|x| x == ty.largest()) && has(&|x| x == f64::NEG_INFINITY));
            assert!(has(&|x| x > 1.0 && x < 1.0 + 2.0 * ty.ulp(1.25)));
        }
        let words = powers(FloatType::F32);
        // 2^-149 to 2^127, some of them each other's neighbours.
        assert!(words.len() > 2 * 3 * 254, "{}", words.len());
        let exponents: std::collections::BTreeSet<u32> = one(FloatType::F32, (-1.0, 1.0), 1)
            .iter()
            .map(|case| case[0] >> 23)
            .collect();
        assert_eq!(exponents.len(), 512, "every exponent of both signs");
    }

    #[test]
    fn a_seed_always_gives_the_same() {
        assert_eq!(several(FloatType::F32, 3, 5), several(FloatType::F32, 3, 5));
        assert_ne!(integer_cases(2, 1), integer_cases(2, 2));
    }
}
