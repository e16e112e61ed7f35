//! Logarithmic axes.

use crate::text::superscript;

/// Shortest axis, in decades: there are always a one, a two or a five on it.
const SHORTEST: f64 = 0.6;

/// Values along an axis, the logarithm of the value being linear in the place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Decadic logarithm of the value at the start.
    from: f64,
    /// Decadic logarithm of the value at the end.
    to: f64,
    /// Place of the start.
    start: f64,
    /// Place of the end.
    end: f64,
}

/// A value marked on an axis.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Tick {
    /// Its power of ten and its multiple of it, from 1 to 9.
    pub(super) power: i32,
    pub(super) multiple: u32,
    /// Its place.
    pub(super) place: f64,
    /// Whether there is room for its name.
    pub(super) named: bool,
}

impl Scale {
    /// An axis that holds all of the values, with some room at either end. Values
    /// without a logarithm are ignored; without any others the axis is from 1 to 10.
    pub(super) fn new(values: impl Iterator<Item = f64>, [start, end]: [f64; 2]) -> Self {
        let range = values
            .filter(|value| *value > 0.0 && value.is_finite())
            .map(f64::log10)
            .fold(None, |range: Option<(f64, f64)>, value| {
                let (least, most) = range.unwrap_or((value, value));
                Some((least.min(value), most.max(value)))
            });
        let (least, most) = range.unwrap_or((0.0, 1.0));
        let room = (0.06 * (most - least)).max((SHORTEST - (most - least)) / 2.0);
        Self {
            from: least - room,
            to: most + room,
            start,
            end,
        }
    }

    /// The place of a value; that of an end if it lies beyond it.
    pub(super) fn place(&self, value: f64) -> f64 {
        let share = (value.log10() - self.from) / (self.to - self.from);
        // NaN, as of the logarithm of a negative number, is at the start.
        let share = if share > 0.0 { share.min(1.0) } else { 0.0 };
        self.start + share * (self.end - self.start)
    }

    /// What to mark: every decade, ones twos and fives if few decades are there, each
    /// multiple if they are not too dense; about `most` of them named at most.
    pub(super) fn ticks(&self, most: u32) -> Vec<Tick> {
        let decades = self.to - self.from;
        let every = ((decades / f64::from(most.max(1))).ceil() as i32).max(1);
        let named: &[u32] = if decades * 3.0 <= f64::from(most) {
            &[1, 2, 5]
        } else {
            &[1]
        };
        let multiples = if decades <= 8.0 { 9 } else { 1 };
        let mut ticks = Vec::new();
        for power in (self.from.floor() as i32)..=(self.to.ceil() as i32) {
            for multiple in 1..=multiples {
                let logarithm = f64::from(power) + f64::from(multiple).log10();
                if !(self.from..=self.to).contains(&logarithm) {
                    continue;
                }
                let share = (logarithm - self.from) / (self.to - self.from);
                ticks.push(Tick {
                    power,
                    multiple,
                    place: self.start + share * (self.end - self.start),
                    named: named.contains(&multiple) && power.rem_euclid(every) == 0,
                });
            }
        }
        ticks
    }
}

impl Tick {
    /// Of a pure number.
    pub(super) fn number(&self) -> String {
        match self.power {
            0..=4 => format!("{}{}", self.multiple, "0".repeat(self.power as usize)),
            -4..0 => format!(
                "0.{}{}",
                "0".repeat((-self.power - 1) as usize),
                self.multiple
            ),
            power if self.multiple == 1 => format!("10{}", superscript(power)),
            power => format!("{}×10{}", self.multiple, superscript(power)),
        }
    }

    /// Of a time in nanoseconds.
    pub(super) fn time(&self) -> String {
        let (unit, size) = match self.power {
            ..3 => ("ns", 0),
            3..6 => ("µs", 3),
            6..9 => ("ms", 6),
            _ => ("s", 9),
        };
        let power = self.power - size;
        format!("{} {unit}", Self { power, ..*self }.number())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(values: &[f64], most: u32) -> Vec<String> {
        Scale::new(values.iter().copied(), [0.0, 100.0])
            .ticks(most)
            .iter()
            .filter(|tick| tick.named)
            .map(Tick::number)
            .collect()
    }

    #[test]
    fn decades_are_named_and_so_are_twos_and_fives_where_there_is_room() {
        assert_eq!(names(&[1.0, 1000.0], 8), ["1", "10", "100", "1000"]);
        assert_eq!(names(&[1.0, 10.0], 8), ["1", "2", "5", "10"]);
        assert_eq!(
            names(&[1e-7, 1e-3], 8),
            ["10⁻⁷", "10⁻⁶", "10⁻⁵", "0.0001", "0.001"]
        );
        assert_eq!(names(&[2e-7, 3e-7], 8), ["2×10⁻⁷"]);
        let wide = names(&[1e-300, 1e300], 8);
        assert!((4..=9).contains(&wide.len()), "{wide:?}");
    }

    #[test]
    fn there_is_always_a_name() {
        for step in 0..400 {
            let value = 10_f64.powf(f64::from(step) * 0.01);
            for values in [&[value][..], &[value, value * 1.3], &[value, value * 50.0]] {
                assert!(!names(values, 8).is_empty(), "{values:?}");
            }
        }
        assert_eq!(names(&[], 8), ["1", "2", "5", "10"]);
        assert_eq!(
            names(&[f64::NAN, -1.0, 0.0, f64::INFINITY], 8),
            names(&[], 8)
        );
    }

    #[test]
    fn places_grow_with_values_and_stay_on_the_axis() {
        let scale = Scale::new([1e-3, 1e3].into_iter(), [50.0, 650.0]);
        assert!((scale.place(1.0) - 350.0).abs() < 1e-9);
        let places: Vec<f64> = [f64::NAN, -1.0, 0.0, 1e-3, 0.1, 1.0, 1e3, 1e9]
            .map(|value| scale.place(value))
            .to_vec();
        assert!(places.is_sorted());
        assert!(places.iter().all(|place| (50.0..=650.0).contains(place)));
    }

    #[test]
    fn times_change_their_unit() {
        let tick = |power, multiple| {
            Tick {
                power,
                multiple,
                place: 0.0,
                named: true,
            }
            .time()
        };
        assert_eq!(tick(0, 1), "1 ns");
        assert_eq!(tick(-2, 5), "0.05 ns");
        assert_eq!(tick(4, 2), "20 µs");
        assert_eq!(tick(8, 1), "100 ms");
        assert_eq!(tick(12, 1), "1000 s");
        assert_eq!(tick(20, 1), "10¹¹ s");
    }
}
