//! What a worker notes of a site.

use crate::sanitise::{Count, Worst};

/// Errors are counted by half powers of two of units in the last place, from 2⁻¹⁶ on.
const BINS: usize = 160;
const FIRST_BIN: i32 = -32;

/// A [`Count`] before invocations have names.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Times {
    pub(crate) times: u64,
    /// The invocation that did it first, and its numbers.
    first: Option<Place>,
}

/// What an invocation computed, and what its twin did.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Place {
    pub(crate) invocation: u64,
    pub(crate) value: f32,
    pub(crate) exact: f64,
}

impl Times {
    pub(super) fn add(&mut self, times: u64, place: Place) {
        self.times += times;
        if self
            .first
            .is_none_or(|first| place.invocation < first.invocation)
        {
            self.first = Some(place);
        }
    }

    fn append(&mut self, other: &Self) {
        if let Some(first) = other.first {
            self.add(other.times, first);
        }
    }

    pub(crate) fn count(&self, name: impl Fn(u64) -> [u32; 3]) -> Count {
        Count {
            times: self.times,
            first: self.first.unwrap_or_default().named(name),
        }
    }
}

impl Place {
    pub(crate) fn named(self, name: impl Fn(u64) -> [u32; 3]) -> Worst {
        Worst {
            invocation: name(self.invocation),
            value: self.value,
            exact: self.exact,
        }
    }
}

/// The largest of something, and where it was; of equals the first invocation.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Largest {
    pub(crate) of: f64,
    pub(crate) place: Place,
}

impl Largest {
    #[inline]
    pub(super) fn see(&mut self, of: f64, place: Place) {
        if of > self.of || of == self.of && of > 0.0 && place.invocation < self.place.invocation {
            *self = Self { of, place };
        }
    }
}

/// What is noted of a site. Nothing in it depends on the order of what is seen.
#[derive(Clone, Debug)]
pub(crate) struct Tally {
    pub(crate) executions: u64,
    pub(crate) after_divergence: u64,
    pub(crate) relative: Largest,
    pub(crate) ulps: f64,
    pub(crate) introduced: f64,
    pub(crate) lost: Times,
    pub(crate) cancelled: u32,
    pub(crate) births: Times,
    pub(crate) propagated: u64,
    pub(crate) deaths: Times,
    pub(crate) unstable: Times,
    pub(crate) margin: f64,
    pub(crate) of_range: f64,
    pub(crate) subnormal: u64,
    /// Of stores, see [`crate::sanitise::Site::floor`].
    pub(crate) floor: f64,
    /// Executions with an error, by its size.
    bins: [u64; BINS],
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            executions: 0,
            after_divergence: 0,
            relative: Largest::default(),
            ulps: 0.0,
            introduced: 0.0,
            lost: Times::default(),
            cancelled: 0,
            births: Times::default(),
            propagated: 0,
            deaths: Times::default(),
            unstable: Times::default(),
            margin: 0.0,
            of_range: 0.0,
            subnormal: 0,
            floor: 0.0,
            bins: [0; BINS],
        }
    }
}

impl Tally {
    /// Notes an error.
    #[inline]
    pub(super) fn error(&mut self, times: u64, ulps: f64) {
        self.ulps = self.ulps.max(ulps);
        self.bins[bin(ulps)] += times;
    }

    /// What 99 % of executions that count are at most; those without error have 0.
    pub(crate) fn p99(&self) -> f64 {
        let counted = self.executions - self.after_divergence;
        let mut above = 0;
        for (bin, count) in self.bins.iter().enumerate().rev() {
            above += count;
            // More than a hundredth is in this bin or above it.
            if above > counted / 100 {
                return upper(bin).min(self.ulps);
            }
        }
        0.0
    }

    pub(crate) fn append(&mut self, other: &Self) {
        self.executions += other.executions;
        self.after_divergence += other.after_divergence;
        self.relative.see(other.relative.of, other.relative.place);
        self.ulps = self.ulps.max(other.ulps);
        self.introduced = self.introduced.max(other.introduced);
        self.lost.append(&other.lost);
        self.cancelled = self.cancelled.max(other.cancelled);
        self.births.append(&other.births);
        self.propagated += other.propagated;
        self.deaths.append(&other.deaths);
        self.unstable.append(&other.unstable);
        self.margin = self.margin.max(other.margin);
        self.of_range = self.of_range.max(other.of_range);
        self.subnormal += other.subnormal;
        self.floor = self.floor.max(other.floor);
        for (bin, count) in self.bins.iter_mut().zip(other.bins) {
            *bin += count;
        }
    }
}

/// Adds what another worker noted of the same sites.
pub(crate) fn append_tallies(all: &mut Vec<Tally>, more: Vec<Tally>) {
    if all.is_empty() {
        *all = more;
    } else {
        for (to, from) in all.iter_mut().zip(&more) {
            to.append(from);
        }
    }
}

/// Twice the logarithm of a positive number, rounded down.
#[inline]
fn half_octaves(value: f64) -> i32 {
    let bits = value.to_bits();
    let exponent = ((bits >> 52) & 0x7ff) as i32 - 1023;
    // The mantissa of √2.
    let upper = bits & 0x000f_ffff_ffff_ffff >= 0x0006_a09e_667f_3bcd;
    2 * exponent + i32::from(upper)
}

#[inline]
fn bin(ulps: f64) -> usize {
    (half_octaves(ulps) - FIRST_BIN).clamp(0, BINS as i32 - 1) as usize
}

/// What numbers of a bin are below.
fn upper(bin: usize) -> f64 {
    f64::powf(2.0, f64::from(bin as i32 + FIRST_BIN + 1) / 2.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_what_they_say() {
        for exponent in -15..45 {
            for part in [1.0, 1.2, 1.414, 1.4143, 1.9] {
                let ulps = f64::powi(2.0, exponent) * part;
                let bin = bin(ulps);
                assert!(ulps < upper(bin) && upper(bin) <= ulps * 1.4143, "{ulps}");
            }
        }
    }

    #[test]
    fn one_in_a_hundred_may_be_larger() {
        let mut tally = Tally {
            executions: 1000,
            ..Tally::default()
        };
        tally.error(10, 1000.0);
        assert_eq!(tally.p99(), 0.0);
        tally.error(1, 3.0);
        let p99 = tally.p99();
        assert!((3.0..4.25).contains(&p99), "{p99}");
        tally.error(1, 1e30);
        assert!(tally.p99() >= 1000.0);
    }

    #[test]
    fn order_does_not_matter() {
        let place = |invocation| Place {
            invocation,
            value: 1.0,
            exact: 2.0,
        };
        let mut parts = [Tally::default(), Tally::default(), Tally::default()];
        for (index, part) in parts.iter_mut().enumerate() {
            part.executions = 10;
            part.error(3, 4.0);
            part.relative.see(0.5, place(7 - index as u64));
            part.lost.add(2, place(9 - index as u64));
        }
        for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
            let mut whole = Tally::default();
            order.iter().for_each(|&part| whole.append(&parts[part]));
            assert_eq!(whole.relative.place.invocation, 5);
            let lost = whole.lost.count(|invocation| [invocation as u32, 0, 0]);
            assert_eq!((lost.times, lost.first.invocation[0]), (6, 7));
        }
    }
}
