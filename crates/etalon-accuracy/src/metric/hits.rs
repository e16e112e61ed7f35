//! Where rays hit the screen.

use super::quantile::{at, sorted};
use super::{MetricError, NonFinite, same_size};

/// How many pixels a hit may move from one pixel to the next, beyond what the
/// movement beside them explains, and still be on the same surface.
pub const SILHOUETTE_JUMP: f64 = 1.0;

/// Hits found against true hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hits {
    /// Over all pixels.
    pub all: Group,
    /// Over pixels where the truth is smooth.
    pub interior: Group,
    /// Over the pixels of [`silhouette`].
    pub silhouette: Group,
    /// Hits without a finite position. As found they count as wrong hits; pixels
    /// where the truth is none are in no group.
    pub non_finite: NonFinite,
}

/// Hits over some of the pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Group {
    /// Pixels in it.
    pub pixels: usize,
    /// Pixels that hit in truth.
    pub true_hits: usize,
    /// Pixels that hit as found, wherever.
    pub found_hits: usize,
    /// Pixels that hit in both, wherever.
    pub both: usize,
    /// Pixels that hit in both, at most a pixel apart.
    pub within_a_pixel: usize,
    /// How far apart hits are, over pixels that hit in both.
    pub distance: Option<Distances>,
}

/// Distances in pixels of the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distances {
    /// Half are nearer.
    pub median: f64,
    /// One in twenty is further.
    pub p95: f64,
    /// The furthest.
    pub largest: f64,
}

impl Group {
    /// The share of found hits that are hits; `None` if none was found.
    #[must_use]
    pub fn precision(&self) -> Option<f64> {
        share(self.both, self.found_hits)
    }

    /// The share of hits that were found; `None` if there are none.
    #[must_use]
    pub fn recall(&self) -> Option<f64> {
        share(self.both, self.true_hits)
    }

    /// The share of hits that were found where they are, to a pixel; `None` if there
    /// are none.
    #[must_use]
    pub fn located(&self) -> Option<f64> {
        share(self.within_a_pixel, self.true_hits)
    }
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

/// Compares hits, row by row from the top; positions are from 0 to 1 over the
/// screen, of the same size as the field of rays. Distances are Euclidean, in pixels.
///
/// # Errors
/// If the fields are empty or not of that size.
pub fn hits(
    found: &[Option<[f64; 2]>],
    truth: &[Option<[f64; 2]>],
    size: [u32; 2],
) -> Result<Hits, MetricError> {
    same_size(found.len(), truth.len(), size)?;
    let silhouette = silhouette(truth, size)?;
    let mut groups = [Gather::default(), Gather::default()];
    let mut non_finite = NonFinite::default();
    for ((found, truth), &edge) in found.iter().zip(truth).zip(&silhouette) {
        non_finite.found += usize::from(is_broken(found));
        if is_broken(truth) {
            non_finite.truth += 1;
            continue;
        }
        groups[usize::from(edge)].add(*found, *truth, size);
    }
    let all = groups[0].joined(&groups[1]);
    Ok(Hits {
        all: all.group()?,
        interior: groups[0].group()?,
        silhouette: groups[1].group()?,
        non_finite,
    })
}

/// Whether a hit has no position.
fn is_broken(hit: &Option<[f64; 2]>) -> bool {
    hit.is_some_and(|uv| !uv.iter().all(|value| value.is_finite()))
}

/// A group while pixels are added.
#[derive(Clone, Debug, Default)]
struct Gather {
    counts: Group,
    distances: Vec<f64>,
}

impl Gather {
    fn add(&mut self, found: Option<[f64; 2]>, truth: Option<[f64; 2]>, [width, height]: [u32; 2]) {
        let counts = &mut self.counts;
        counts.pixels += 1;
        counts.true_hits += usize::from(truth.is_some());
        counts.found_hits += usize::from(found.is_some());
        if let (Some(found), Some(truth)) = (found, truth) {
            let apart = ((found[0] - truth[0]) * f64::from(width))
                .hypot((found[1] - truth[1]) * f64::from(height));
            // A hit nowhere is a hit that is wrong.
            if is_broken(&Some(found)) {
                return;
            }
            counts.both += 1;
            counts.within_a_pixel += usize::from(apart <= 1.0);
            self.distances.push(apart);
        }
    }

    fn joined(&self, other: &Self) -> Self {
        let (a, b) = (&self.counts, &other.counts);
        Self {
            counts: Group {
                pixels: a.pixels + b.pixels,
                true_hits: a.true_hits + b.true_hits,
                found_hits: a.found_hits + b.found_hits,
                both: a.both + b.both,
                within_a_pixel: a.within_a_pixel + b.within_a_pixel,
                distance: None,
            },
            distances: [self.distances.as_slice(), &other.distances].concat(),
        }
    }

    fn group(&self) -> Result<Group, MetricError> {
        let distance = if self.distances.is_empty() {
            None
        } else {
            let sorted = sorted(&self.distances)?;
            Some(Distances {
                median: at(&sorted, 0.5)?,
                p95: at(&sorted, 0.95)?,
                largest: at(&sorted, 1.0)?,
            })
        };
        Ok(Group {
            distance,
            ..self.counts
        })
    }
}

/// The pixels at which the truth changes abruptly, where to be wrong by a pixel is
/// to be wrong by any distance. A pixel is one if, of it and one of its four
/// neighbours,
///
/// * one hits and the other does not, or
/// * the hits lie more than [`SILHOUETTE_JUMP`] pixels apart, and their step differs
///   by more than that many pixels from the step before it as well as from the step
///   after it in the same row or column. On a smooth surface steps change slowly,
///   however long they are; at a crease a step resembles one of its neighbours.
///
/// Steps to a pixel that does not hit, or beyond the border, explain nothing, and
/// where no step explains anything, a jump is a silhouette. Hits without a finite
/// position are neighbours of nothing. Steps that grow by more than a pixel from one
/// to the next, as at grazing angles, count as silhouettes although the surface is
/// smooth; three steps of one length across three surfaces do not.
///
/// # Errors
/// If the field is empty or not of that size.
pub fn silhouette(truth: &[Option<[f64; 2]>], size: [u32; 2]) -> Result<Vec<bool>, MetricError> {
    let (width, height) = same_size(truth.len(), truth.len(), size)?;
    let mut edge = vec![false; truth.len()];
    // Rows, then columns: the first pixel of each, the stride and the number in it.
    let rows = (0..height).map(|y| (y * width, 1, width));
    let columns = (0..width).map(|x| (x, width, height));
    for (first, stride, count) in rows.chain(columns) {
        let hit = |place: usize| truth[first + place * stride];
        for place in 1..count {
            let before = place.checked_sub(2).and_then(hit);
            let after = (place + 1 < count).then(|| hit(place + 1)).flatten();
            if is_edge(before, [hit(place - 1), hit(place)], after, size) {
                edge[first + (place - 1) * stride] = true;
                edge[first + place * stride] = true;
            }
        }
    }
    Ok(edge)
}

/// Whether the truth breaks between two neighbours, with those beyond them.
fn is_edge(
    before: Option<[f64; 2]>,
    pair: [Option<[f64; 2]>; 2],
    after: Option<[f64; 2]>,
    size: [u32; 2],
) -> bool {
    if pair.iter().any(is_broken) {
        return false;
    }
    let (a, b) = match pair {
        [Some(a), Some(b)] => (a, b),
        [None, None] => return false,
        _ => return true,
    };
    let step = |from: [f64; 2], to: [f64; 2]| {
        [0, 1].map(|axis| (to[axis] - from[axis]) * f64::from(size[axis]))
    };
    let length = |step: [f64; 2]| step[0].hypot(step[1]);
    let jump = step(a, b);
    if length(jump) <= SILHOUETTE_JUMP {
        return false;
    }
    let explains =
        |beside: [f64; 2]| length([jump[0] - beside[0], jump[1] - beside[1]]) <= SILHOUETTE_JUMP;
    let before = before.filter(|hit| !is_broken(&Some(*hit)));
    let after = after.filter(|hit| !is_broken(&Some(*hit)));
    !(before.is_some_and(|hit| explains(step(hit, a)))
        || after.is_some_and(|hit| explains(step(b, hit))))
}

#[cfg(test)]
mod tests;
