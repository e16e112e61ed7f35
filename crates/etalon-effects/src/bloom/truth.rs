//! The truth of bloom: a convolution of the picture with one kernel.
//!
//! # Definition
//! The effect halves the picture level by level and doubles it again, so what it
//! makes of a light depends on how the light lies on the grids of the levels. Its
//! mean over all those alignments does not: it is the convolution with one
//! kernel, which the filters of the levels make up as follows, in texels of the
//! picture, with `d = 2^(k−1)` the size of the texels that level `k` halves:
//!
//! * *Down*: `D(d) = box(d) ∗ ½ (T(2d) + P(d))`, where `box(d)` is the mean of the
//!   four points at `±d/2`, `T(2d)` are the nine points of `¼ ½ ¼` by `¼ ½ ¼` at
//!   distance `2d`, and `P(d)` the mean of the four points at `±d`. These are the
//!   13 taps of Jimenez (see [`bloom`](crate::bloom)).
//! * *Up*: `U(d)` is `1 3 5 7 7 5 3 1` of 32, by the same, at `±d/2, ±3d/2, …`:
//!   the interpolation weighs four texels `3 7 5 1` of 16, or mirrored, as the
//!   texel is odd or even, and this is the mean of both.
//! * Level `k` of the picture is `L_k = D(2^(k−1)) ∗ … ∗ D(1) ∗ bright`, and the
//!   bloom is `R_1`, where `R_k = (1 − scatter) L_k + scatter · U(2^k) ∗ R_(k+1)`
//!   and the last `R_n = L_n`.
//!
//! Of the last level on there is nothing wider, so a chain with fewer levels is
//! an approximation: the truth has as many as the effect would take at the top of
//! the ladder of `levels`. `storage` does not enter.
//!
//! The picture goes on outside as its edge, which is what makes it a convolution.
//! The effect repeats the edge of each level instead, whose texels reach ever
//! further into the picture; near edges that is another thing, and a bright one
//! there weighs less. [`Edges`] has both.
//!
//! With `suppress_fireflies` the first `D` is a mean weighted by
//! `1 / (1 + luminance)` of the light that blooms, divided by the sum of the
//! weights there. That is no convolution; at the places where the effect
//! computes it, it is the same, and what follows is linear again.
//!
//! Everything is computed as a cascade of these sparse filters without leaving
//! out a place.

use etalon_core::image::ImageError;
use glam::{DVec4, Vec4Swizzles as _};

use super::Bloom;
use crate::EffectError;
use crate::check::Settings;
use crate::knob::{KnobValue, Tunable as _};
use crate::truth::{MOST_LIGHT, Plane, exact_sum, light, luminance, not_negative, reserved};

/// A picture's side, or the part of one that is kept.
#[derive(Clone, Copy)]
struct Span {
    first: i64,
    count: i64,
}

impl Span {
    /// Where in the span a place is, limited to the span.
    fn index(self, place: i64) -> usize {
        (place - self.first).clamp(0, self.count - 1) as usize
    }

    fn places(self) -> impl Iterator<Item = i64> {
        self.first..self.first + self.count
    }
}

/// Values on a part of an unlimited grid, beyond which the edge is repeated.
struct Field {
    columns: Span,
    rows: Span,
    values: Vec<DVec4>,
}

/// Place of a tap beside that of the result, and its weight.
type Tap = (i64, f64);

impl Field {
    fn row(&self, place: i64) -> &[DVec4] {
        let width = self.columns.count as usize;
        let start = self.rows.index(place) * width;
        &self.values[start..start + width]
    }

    fn sized(columns: Span, rows: Span) -> Result<Self, ImageError> {
        let count = columns.count as usize * rows.count as usize;
        let mut values = reserved(count)?;
        values.resize(count, DVec4::ZERO);
        Ok(Self {
            columns,
            rows,
            values,
        })
    }

    /// Filtered along x: the result at `x` is the sum of `weight` times the value
    /// at `stride · x + offset`.
    fn along_x(&self, stride: i64, taps: &[Tap], columns: Span) -> Result<Self, ImageError> {
        let mut result = Self::sized(columns, self.rows)?;
        let width = columns.count as usize;
        for (to, row) in result
            .values
            .chunks_exact_mut(width)
            .zip(self.rows.places())
        {
            let from = self.row(row);
            for (value, x) in to.iter_mut().zip(columns.places()) {
                *value = taps
                    .iter()
                    .map(|&(offset, weight)| from[self.columns.index(stride * x + offset)] * weight)
                    .sum();
            }
        }
        Ok(result)
    }

    /// The same along y.
    fn along_y(&self, stride: i64, taps: &[Tap], rows: Span) -> Result<Self, ImageError> {
        let mut result = Self::sized(self.columns, rows)?;
        let width = self.columns.count as usize;
        for (to, y) in result.values.chunks_exact_mut(width).zip(rows.places()) {
            for &(offset, weight) in taps {
                for (value, from) in to.iter_mut().zip(self.row(stride * y + offset)) {
                    *value += from * weight;
                }
            }
        }
        Ok(result)
    }

    /// The same along both axes.
    fn filtered(
        &self,
        stride: i64,
        taps: &[Tap],
        [columns, rows]: [Span; 2],
    ) -> Result<Self, ImageError> {
        self.along_x(stride, taps, columns)?
            .along_y(stride, taps, rows)
    }

    /// `own · self + others · other`, which cover the same places or more.
    fn mixed(mut self, own: f64, other: &Self, others: f64) -> Self {
        let width = self.columns.count as usize;
        let columns = self.columns;
        for (to, y) in self.values.chunks_exact_mut(width).zip(self.rows.places()) {
            let from = other.row(y);
            for (value, x) in to.iter_mut().zip(columns.places()) {
                *value = *value * own + from[other.columns.index(x)] * others;
            }
        }
        self
    }

    /// `D`, given where its outer and inner points lie.
    fn halved(
        &self,
        stride: i64,
        at: impl Fn(i64) -> i64,
        spans: [Span; 2],
    ) -> Result<Self, ImageError> {
        // Along one axis: box ∗ T puts ¼ at ±½, ⅛ at ±3/2 and ±5/2 of a texel, and
        // box ∗ P puts ¼ at ±½ and ±3/2.
        let wide = [(1, 0.25), (3, 0.125), (5, 0.125)];
        let narrow = [(1, 0.25), (3, 0.25)];
        let taps = |half: &[Tap]| -> Vec<Tap> {
            half.iter()
                .flat_map(|&(place, weight)| [(at(-place), weight), (at(place), weight)])
                .collect()
        };
        let narrow = self.filtered(stride, &taps(&narrow), spans)?;
        Ok(self
            .filtered(stride, &taps(&wide), spans)?
            .mixed(0.5, &narrow, 0.5))
    }

    /// `U`, given where its points lie.
    fn doubled(&self, at: impl Fn(i64) -> i64, spans: [Span; 2]) -> Result<Self, ImageError> {
        let half = [(1, 7.0), (3, 5.0), (5, 3.0), (7, 1.0)];
        let taps: Vec<Tap> = half
            .iter()
            .flat_map(|&(place, weight)| [(at(-place), weight / 32.0), (at(place), weight / 32.0)])
            .collect();
        self.filtered(1, &taps, spans)
    }
}

/// How many times a picture is halved at most `most` times, if the chain ends
/// where one texel is left.
fn halvings([width, height]: [u32; 2], most: u32) -> u32 {
    let longest = width.max(height).div_ceil(2);
    // Sides are rounded up, so one of n texels takes log2 n halvings, rounded up.
    let more = longest.next_power_of_two().trailing_zeros();
    (1 + more).min(most)
}

/// The number of levels of the truth for a picture of a size: the top of the
/// ladder of `levels`, or fewer where the picture is then one texel.
#[must_use]
pub fn levels(size: [u32; 2]) -> u32 {
    let ladder = Bloom::knob("levels").map_or(&[][..], |knob| knob.ladder);
    let top = ladder.iter().filter_map(|value| match value {
        KnobValue::Count(count) => Some(*count),
        KnobValue::Real(_) | KnobValue::Choice(_) => None,
    });
    halvings(size, top.max().unwrap_or(1))
}

/// Light that blooms at a texel, times its weight; and its weight.
fn bright(texel: [f64; 4], exposure: f64, settings: &Bloom) -> DVec4 {
    let exposed = (light(texel) * exposure).min(glam::DVec3::splat(MOST_LIGHT));
    let brightness = exposed.max_element();
    if brightness == 0.0 {
        return DVec4::W;
    }
    let threshold = f64::from(settings.threshold);
    let knee = threshold * f64::from(settings.knee);
    let over = brightness - threshold;
    // From 0 at −knee, where it is flat, to 2 knee / 2 at +knee, with slope 1.
    let kept = if over.abs() < knee {
        (over + knee).powi(2) / (4.0 * knee)
    } else {
        over.max(0.0)
    };
    let blooming = exposed * (kept / brightness);
    let weight = if settings.suppress_fireflies {
        1.0 / (1.0 + luminance(blooming))
    } else {
        1.0
    };
    (blooming * weight).extend(weight)
}

/// What lies beyond the edges of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Edges {
    /// The picture's own edge, without end: the bloom is a convolution.
    #[default]
    Picture,
    /// Of each level the edge of that level, as the effect has it: what differs
    /// from the effect is then the alignment of its levels, and not the edges.
    Levels,
}

/// How far beyond the picture, in its texels, the values of a level differ from
/// those at its edge, and how far they are needed.
struct Reach {
    varies: f64,
    needed: f64,
}

impl Reach {
    /// The places kept of a side of so many texels of half size: two more than
    /// needed, for those that lie half a place off.
    fn span(&self, side: u32) -> Span {
        let margin = (self.varies.min(self.needed) / 2.0).ceil() as i64 + 2;
        Span {
            first: -margin,
            count: i64::from(side) + 2 * margin,
        }
    }
}

/// Of `L_k` and `R_k` for k from 1 to `count`.
fn reaches(count: u32) -> Vec<[Reach; 2]> {
    let size = |level: u32| f64::from(level).exp2();
    let mut reaches: Vec<[Reach; 2]> = Vec::new();
    // Down from the picture.
    let (mut varies, mut needed) = (2.0, 0.0);
    for level in 1..=count {
        reaches.push([Reach { varies, needed }, Reach { varies, needed }]);
        varies += 2.5 * size(level);
        needed += 3.5 * size(level);
    }
    // And up from the last.
    for index in (1..reaches.len()).rev() {
        let [down, up] = &reaches[index];
        let (needed, varies) = (down.needed, up.varies);
        let level = index as u32;
        let [finer_down, finer_up] = &mut reaches[index - 1];
        finer_down.needed = finer_down.needed.max(needed + 2.5 * size(level));
        finer_up.varies = finer_up.varies.max(varies + 3.5 * size(level));
    }
    reaches
}

/// The bloom of a picture, exposed by a factor: half its size, rounded up, with
/// alpha 1. Texel `i` lies between texels `2i` and `2i + 1` of the picture.
///
/// `settings.intensity` is for whoever adds it to the picture.
///
/// # Errors
/// If a setting is out of range, `exposure` is negative or no number, or memory
/// runs out.
pub fn bloom(colour: &Plane, exposure: f64, settings: &Bloom) -> Result<Plane, EffectError> {
    bloom_of(
        colour,
        exposure,
        settings,
        levels(colour.size()),
        Edges::Picture,
    )
}

/// As [`bloom`] with a number of levels from 1 to 12, or fewer where the picture
/// is then one texel, which is what a chain of so many approximates; and with a
/// choice of edges.
///
/// # Errors
/// As [`bloom`], or if the number is out of range.
pub fn bloom_of(
    colour: &Plane,
    exposure: f64,
    settings: &Bloom,
    levels: u32,
    edges: Edges,
) -> Result<Plane, EffectError> {
    settings.validate()?;
    Settings("bloom").count("levels", levels, 1, 12)?;
    not_negative("bloom", "exposure", exposure)?;
    let side = colour.size().map(|side| side.div_ceil(2));
    let reaches = reaches(halvings(colour.size(), levels));
    let spans = |index: usize, reach: &Reach| {
        side.map(|side| match edges {
            Edges::Picture => reach.span(side),
            // From the second level on there are places on both edges.
            Edges::Levels => Span {
                first: 0,
                count: i64::from(side) + i64::from(index > 0),
            },
        })
    };

    let [columns, rows] = colour.size().map(|side| Span {
        first: 0,
        count: side.into(),
    });
    let mut values = reserved(colour.texels().len())?;
    let texels = colour.texels().iter();
    values.extend(texels.map(|&texel| bright(texel, exposure, settings)));
    let picture = Field {
        columns,
        rows,
        values,
    };

    // Grids: the first level and the bloom have a place between texels 2i and
    // 2i + 1 of the picture; from the second level on places lie a texel further
    // left, since odd multiples of half their texel's size lie between.
    let odd = |place: i64| place.div_euclid(2);
    let mut first = picture.halved(2, |place| (place + 1) / 2, spans(0, &reaches[0][0]))?;
    drop(picture);
    for value in &mut first.values {
        *value /= value.w;
    }
    let mut down = vec![first];
    for (level, [reach, _]) in reaches.iter().enumerate().skip(1) {
        let above = &down[level - 1];
        // In steps of two texels, half a texel of 2^level is 2^(level−2).
        let next = match level {
            1 => above.halved(1, |place| odd(place - 1), spans(level, reach))?,
            _ => above.halved(1, |place| place << (level - 2), spans(level, reach))?,
        };
        down.push(next);
    }

    let scatter = f64::from(settings.scatter);
    let mut newest = down.pop();
    for (index, own) in down.into_iter().enumerate().rev() {
        let Some(wider) = newest.take() else { break };
        let kept = spans(index, &reaches[index][1]);
        let spread = match index {
            0 => wider.doubled(|place| (place + 1) / 2, kept)?,
            _ => wider.doubled(|place| place << (index - 1), kept)?,
        };
        newest = Some(spread.mixed(scatter, &own, 1.0 - scatter));
    }
    let Some(newest) = newest else {
        // There is one level at least.
        return Ok(Plane::from_fn(side[0], side[1], |_, _| [0.0; 4])?);
    };
    Ok(Plane::from_fn(side[0], side[1], |x, y| {
        let value = newest.row(y.into())[newest.columns.index(x.into())];
        value.xyz().extend(1.0).to_array()
    })?)
}

/// The light of a picture: the sum of each of the first three channels over its
/// texels, rounded once. A texel of a bloom stands for four of the picture, so
/// four times the energy of the bloom is that of the light that bloomed, but for
/// what goes over the edge.
#[must_use]
pub fn energy(picture: &Plane) -> [f64; 3] {
    [0, 1, 2].map(|c| exact_sum(picture.texels().iter().map(|texel| texel[c])))
}
