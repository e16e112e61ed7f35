//! Where the generator's decisions come from.

/// A sequence of choices: from a seed, or from bytes that a fuzzer varies.
#[derive(Clone, Debug)]
pub struct Choices<'a> {
    source: Source<'a>,
}

#[derive(Clone, Debug)]
enum Source<'a> {
    Seed(u64),
    Bytes(&'a [u8]),
}

impl Choices<'_> {
    /// Random choices; the seed names the sequence.
    #[must_use]
    pub fn seeded(seed: u64) -> Self {
        Self {
            source: Source::Seed(seed),
        }
    }
}

impl<'a> Choices<'a> {
    /// Choices from bytes, two for each; when they run out, always the first
    /// of what there is to choose from.
    #[must_use]
    pub fn of_bytes(bytes: &'a [u8]) -> Self {
        Self {
            source: Source::Bytes(bytes),
        }
    }

    /// A number of 64 bits (SplitMix64), or of 16 where bytes decide.
    fn next(&mut self) -> u64 {
        match &mut self.source {
            Source::Seed(state) => {
                *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
                let mut z = *state;
                z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
                z ^ (z >> 31)
            }
            Source::Bytes(bytes) => match bytes {
                [low, high, rest @ ..] => {
                    let value = u64::from(u16::from_le_bytes([*low, *high]));
                    *bytes = rest;
                    value
                }
                _ => {
                    *bytes = &[];
                    0
                }
            },
        }
    }

    /// One of the numbers below `limit`; 0 if that is 0.
    pub fn below(&mut self, limit: usize) -> usize {
        (self.next() % (limit as u64).max(1)) as usize
    }

    /// True in so many of a hundred cases. Where bytes ran out, false.
    pub fn chance(&mut self, percent: usize) -> bool {
        self.below(100) >= 100 - percent.min(100)
    }

    /// A word of any value.
    pub fn word(&mut self) -> u32 {
        match self.source {
            Source::Seed(_) => (self.next() >> 32) as u32,
            Source::Bytes(_) => (self.next() << 16 | self.next()) as u32,
        }
    }

    /// One of a list that is not empty.
    pub fn of<T: Clone>(&mut self, list: &[T]) -> T {
        list[self.below(list.len())].clone()
    }
}
