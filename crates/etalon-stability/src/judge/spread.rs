//! Is fast arithmetic within what perturbed executions allow?
//!
//! WGSL leaves the direction of rounding, the fusing of products into sums, the flushing
//! of subnormal numbers and some units in the last place of functions to devices. The
//! interpreter runs a case several times, each time as another such device
//! ([`etalon_cpu::CpuOptions::perturbs`]), two of which always round the same way: how far its texels move is how far a device's may be,
//! texel by texel, without a tolerance that anybody chose.
//!
//! It samples and does not bound. An error that is spread evenly over an interval is
//! below a quarter of its end in all of eight samples once in 4⁸ = 65,536 times, so four
//! times the largest move counts as the end. Stores may truncate instead of rounding to
//! nearest: those of 16-bit floats are perturbed as well; of others a unit of the format is
//! added, of 11-bit floats one for each pass so far. And where a decision hangs on a
//! rounding, a device may take it in a texel in which no sample did: as many texels may
//! be outside as samples have decided otherwise in.

use etalon_core::format::Encoding;
use etalon_core::image::ImageData;
use serde::{Deserialize, Serialize};

use super::scale::half_step;
use crate::observe::{Place, Store};

/// Executions that are perturbed.
pub const PERTURBATIONS: u64 = 8;

/// The end of an interval of errors over the largest of the samples.
const FACTOR: f64 = 4.0;

/// A move by more than this, relative to 1 or the number itself if that is more, is a
/// decision and no rounding: no function's is so inaccurate (WGSL §15.7.4.1; the worst
/// are sines, by 2⁻¹¹).
const DECISION: f64 = 1.0 / 64.0;

/// How wide the spread is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Width {
    /// The largest move of a texel, relative to 1 or the number if that is more.
    #[serde(with = "crate::number")]
    pub largest: f64,
    /// Texels of all passes.
    pub texels: u64,
    /// Those in which a sample decided otherwise.
    pub decided: u64,
}

/// Texels of a device that are outside.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Outside {
    /// How many, of one pass.
    pub texels: u64,
    /// How many may be.
    pub tolerated: u64,
    /// The first.
    pub first: Place,
    /// What the device has there.
    #[serde(with = "crate::number")]
    pub subject: f64,
    /// What the interpreter has.
    #[serde(with = "crate::number")]
    pub centre: f64,
    /// How far from it is allowed.
    #[serde(with = "crate::number")]
    pub allowed: f64,
}

/// How far texels of a frame's passes move.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Spread {
    stores: Vec<Moves>,
}

/// What a device may store.
#[derive(Clone, Debug, PartialEq)]
pub struct Allowed<'a> {
    /// Around this.
    pub store: &'a Store,
    /// How far from it, for each channel of each texel.
    pub channels: Vec<[f64; 4]>,
    /// Texels that may be anything, since a sample decided otherwise in as many.
    pub decided: u64,
}

#[derive(Clone, Debug, PartialEq)]
struct Moves {
    store: Store,
    centre: Vec<[f32; 4]>,
    /// The largest move of each channel.
    moved: Vec<[f64; 4]>,
}

/// The texels of a store of numbers.
fn texels(store: &Store) -> Option<(&ImageData, Vec<[f32; 4]>)> {
    let image = store.image.as_ref()?;
    Some((image, image.to_rgba_f32().ok()?))
}

fn relative(difference: f64, centre: f32) -> f64 {
    difference / f64::from(centre).abs().max(1.0)
}

impl Spread {
    /// Around what was stored without perturbation.
    #[must_use]
    pub fn around(stores: &[Store]) -> Self {
        let moves = stores.iter().filter_map(|store| {
            let (_, centre) = texels(store)?;
            Some(Moves {
                store: store.clone(),
                moved: vec![[0.0; 4]; centre.len()],
                centre,
            })
        });
        Self {
            stores: moves.collect(),
        }
    }

    /// Adds a perturbed execution of the same frame.
    pub fn widen(&mut self, stores: &[Store]) {
        for moves in &mut self.stores {
            let same = stores.iter().find(|store| store.same_as(&moves.store));
            let Some((_, texels)) = same.and_then(texels) else {
                continue;
            };
            for ((moved, centre), texel) in moves.moved.iter_mut().zip(&moves.centre).zip(&texels) {
                for channel in 0..4 {
                    let difference = f64::from(texel[channel]) - f64::from(centre[channel]);
                    moved[channel] = moved[channel].max(difference.abs());
                }
            }
        }
    }

    /// How wide the spreads of all frames are.
    #[must_use]
    pub fn summary(frames: &[Self]) -> Width {
        let mut width = Width::default();
        for moves in frames.iter().flat_map(|frame| &frame.stores) {
            width.texels += moves.moved.len() as u64;
            width.decided += moves.decided();
            width.largest = moves
                .each()
                .map(|(moved, centre)| relative(moved, centre))
                .fold(width.largest, f64::max);
        }
        width
    }

    /// How far texels may be from the centre, for each store of numbers.
    pub fn allowed(&self) -> impl Iterator<Item = Allowed<'_>> {
        self.stores
            .iter()
            .enumerate()
            .map(|(number, moves)| Allowed {
                store: &moves.store,
                channels: (0..moves.moved.len())
                    .map(|index| [0, 1, 2, 3].map(|channel| moves.allowed(number, index, channel)))
                    .collect(),
                decided: moves.decided(),
            })
    }

    /// Compares a device's frame, and adds the worst pass that is outside to `found`.
    pub fn compare(&self, frame: usize, stores: &[Store], found: &mut Option<Outside>) {
        for (number, moves) in self.stores.iter().enumerate() {
            let same = stores.iter().find(|store| store.same_as(&moves.store));
            let Some((_, texels)) = same.and_then(texels) else {
                continue;
            };
            let mut outside = Outside {
                tolerated: moves.decided(),
                ..Outside::default()
            };
            for (index, (texel, centre)) in texels.iter().zip(&moves.centre).enumerate() {
                let beyond = (0..4).find_map(|channel| {
                    let (value, centre) = (f64::from(texel[channel]), f64::from(centre[channel]));
                    let allowed = moves.allowed(number, index, channel);
                    // Written so that a NaN is outside.
                    let within = (value - centre).abs() <= allowed;
                    (!within).then_some((channel, value, centre, allowed))
                });
                if let Some((channel, value, centre, allowed)) = beyond {
                    if outside.texels == 0 {
                        outside.first = moves.store.place(frame, index, channel);
                        outside.subject = value;
                        outside.centre = centre;
                        outside.allowed = allowed;
                    }
                    outside.texels += 1;
                }
            }
            if outside.texels > outside.tolerated
                && found
                    .as_ref()
                    .is_none_or(|found| found.texels < outside.texels)
            {
                *found = Some(outside);
            }
        }
    }
}

impl Moves {
    /// How far a channel may be from its centre; the store is the `number`-th, from 0.
    fn allowed(&self, number: usize, index: usize, channel: usize) -> f64 {
        let Some(format) = self.store.image.as_ref().map(|image| image.desc.format) else {
            return 0.0;
        };
        let centre = f64::from(self.centre[index][channel]);
        let unit = 2.0 * half_step(format, channel, centre.abs());
        let stores = match format.encoding() {
            Encoding::Ufloat => (number + 1) as f64,
            _ => 1.0,
        };
        FACTOR * self.moved[index][channel] + stores * unit
    }

    fn each(&self) -> impl Iterator<Item = (f64, f32)> {
        let pairs = self.moved.iter().zip(&self.centre);
        pairs.flat_map(|(moved, centre)| moved.iter().copied().zip(centre.iter().copied()))
    }

    /// Texels in which a sample decided otherwise.
    fn decided(&self) -> u64 {
        let pairs = self.moved.iter().zip(&self.centre);
        let decided = |(moved, centre): &(&[f64; 4], &[f32; 4])| {
            (0..4).any(|channel| relative(moved[channel], centre[channel]) > DECISION)
        };
        pairs.filter(decided).count() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use etalon_core::Format;
    use etalon_core::resource::TextureDesc;

    fn store(values: &[f32]) -> Vec<Store> {
        let texels: Vec<[f32; 4]> = values.iter().map(|&v| [v, v, v, 1.0]).collect();
        let desc = TextureDesc::d2(values.len() as u32, 1, Format::Rgba32Float);
        vec![Store {
            pass: "pass".to_owned(),
            binding: "result".to_owned(),
            image: Some(ImageData::from_rgba_f32(desc, &texels).unwrap()),
            wide: None,
            buffer: None,
        }]
    }

    fn outside(spread: &Spread, values: &[f32]) -> Option<Outside> {
        let mut found = None;
        spread.compare(3, &store(values), &mut found);
        found
    }

    #[test]
    fn texels_may_move_as_far_as_samples_did_and_no_farther() {
        let mut spread = Spread::around(&store(&[1.0, 2.0, 4.0]));
        spread.widen(&store(&[1.001, 2.0, 4.0]));
        spread.widen(&store(&[0.9995, 2.0, 4.0]));
        assert_eq!(outside(&spread, &[1.0039, 2.0, 4.0]), None);
        let found = outside(&spread, &[1.0041, 2.0, 4.0]).unwrap();
        assert_eq!((found.texels, found.first.x, found.first.frame), (1, 0, 3));
        // Nothing moved the others: a unit in the last place for the store.
        assert_eq!(outside(&spread, &[1.0, 2.0_f32.next_up(), 4.0]), None);
        assert_eq!(outside(&spread, &[1.0, 2.000_01, 4.0]).unwrap().first.x, 1);
        assert_eq!(outside(&spread, &[1.0, 2.0, f32::NAN]).unwrap().first.x, 2);
    }

    #[test]
    fn as_many_decisions_as_were_seen_are_tolerated() {
        let mut spread = Spread::around(&store(&[1.0, 2.0, 4.0]));
        spread.widen(&store(&[0.25, 2.0, 4.0]));
        assert_eq!(outside(&spread, &[1.0, 0.5, 4.0]), None);
        let found = outside(&spread, &[1.0, 0.5, 1.0]).unwrap();
        assert_eq!((found.texels, found.tolerated), (2, 1));
        let width = Spread::summary(&[spread]);
        assert_eq!((width.decided, width.texels), (1, 3));
        assert_eq!(width.largest, 0.75);
    }
}
