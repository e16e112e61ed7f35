//! The Pareto front: what costs least for its error.

use crate::model::{Metric, Outcome};

/// What something costs and how wrong it is, both the less the better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Its cost, such as time.
    pub cost: f64,
    /// Its error.
    pub error: f64,
}

impl Candidate {
    /// An outcome by its median time and one error, negated if larger is better;
    /// `None` unless both are there and are numbers.
    #[must_use]
    pub fn of(outcome: &Outcome, metric: &Metric) -> Option<Self> {
        let cost = outcome.time.as_ref()?.median;
        let error = *outcome.errors.get(&metric.id)?;
        let error = if metric.larger_is_better {
            -error
        } else {
            error
        };
        let candidate = Self { cost, error };
        candidate.is_number().then_some(candidate)
    }

    /// Whether the other is at least as good in both and better in one. NaN neither
    /// dominates nor is dominated.
    #[must_use]
    pub fn dominates(&self, other: &Self) -> bool {
        self.cost <= other.cost
            && self.error <= other.error
            && (self.cost < other.cost || self.error < other.error)
    }

    const fn is_number(&self) -> bool {
        !self.cost.is_nan() && !self.error.is_nan()
    }
}

/// The places of the candidates that no other dominates, from the cheapest to the
/// dearest; of equal ones all, in their order. Those with NaN are not among them.
#[must_use]
pub fn front(candidates: &[Candidate]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..candidates.len())
        .filter(|&place| candidates[place].is_number())
        .collect();
    // Adding 0 makes of −0 what it equals.
    let key = |place: usize| {
        let candidate = candidates[place];
        (candidate.cost + 0.0, candidate.error + 0.0)
    };
    order.sort_by(|&a, &b| {
        let ((cost_a, error_a), (cost_b, error_b)) = (key(a), key(b));
        cost_a.total_cmp(&cost_b).then(error_a.total_cmp(&error_b))
    });
    // Whoever costs more has to be better than all before, or equal the last taken.
    let mut last: Option<usize> = None;
    order.retain(|&place| {
        let taken = last.is_none_or(|last| {
            candidates[place].error < candidates[last].error || key(place) == key(last)
        });
        if taken {
            last = Some(place);
        }
        taken
    });
    order
}

/// Of the candidates that dominate one, the one with the least error, of those the
/// cheapest, of those the first: what to take instead. `None` if it is on the front,
/// has NaN or is not there.
#[must_use]
pub fn dominated(candidates: &[Candidate], place: usize) -> Option<usize> {
    let one = candidates.get(place)?;
    let by = |other: &usize| candidates[*other].dominates(one);
    (0..candidates.len()).filter(by).min_by(|&a, &b| {
        let (a, b) = (candidates[a], candidates[b]);
        (a.error + 0.0)
            .total_cmp(&(b.error + 0.0))
            .then((a.cost + 0.0).total_cmp(&(b.cost + 0.0)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Spread;

    fn of(points: &[(f64, f64)]) -> Vec<Candidate> {
        points
            .iter()
            .map(|&(cost, error)| Candidate { cost, error })
            .collect()
    }

    #[test]
    fn a_known_front() {
        let points = of(&[
            (3.0, 1.0),
            (1.0, 3.0),
            (2.0, 2.0),
            (2.0, 2.5),
            (3.0, 2.0),
            (9.0, 1.0),
        ]);
        assert_eq!(front(&points), [1, 2, 0]);
        assert_eq!(dominated(&points, 3), Some(2));
        // Point 2 dominates as well, but point 0 is better.
        assert_eq!(dominated(&points, 4), Some(0));
        assert_eq!(dominated(&points, 5), Some(0));
        for on_it in [0, 1, 2, 99] {
            assert_eq!(dominated(&points, on_it), None);
        }
    }

    #[test]
    fn equal_points_are_on_the_front_together() {
        let points = of(&[(1.0, 0.0), (1.0, -0.0), (1.0, 0.0), (2.0, 0.0)]);
        assert_eq!(front(&points), [0, 1, 2]);
        assert_eq!(dominated(&points, 3), Some(0));
        assert_eq!(dominated(&points, 1), None);
    }

    #[test]
    fn nan_is_nowhere_and_infinity_is_the_worst() {
        let points = of(&[
            (f64::NAN, 0.0),
            (1.0, f64::NAN),
            (-f64::NAN, -f64::NAN),
            (1.0, f64::INFINITY),
            (2.0, 5.0),
        ]);
        assert_eq!(front(&points), [3, 4]);
        for place in 0..points.len() {
            assert_eq!(dominated(&points, place), None);
        }
        assert!(front(&[]).is_empty());
    }

    #[test]
    fn the_front_is_what_an_exhaustive_search_finds() {
        // A generator of full period (Knuth's MMIX), on a grid coarse enough for ties.
        let mut state = 20_240_607_u64;
        let mut next = |limit: u64| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % limit
        };
        for round in 0..300 {
            let grid = 2 + round % 30;
            let points: Vec<Candidate> = (0..next(40))
                .map(|_| Candidate {
                    cost: next(grid) as f64,
                    error: if next(20) == 0 {
                        f64::NAN
                    } else {
                        next(grid) as f64 - 3.0
                    },
                })
                .collect();
            let found = front(&points);
            for (place, point) in points.iter().enumerate() {
                let beaten = points.iter().any(|other| other.dominates(point));
                let expected = !beaten && !point.error.is_nan();
                assert_eq!(found.contains(&place), expected, "{points:?} {place}");
                assert_eq!(dominated(&points, place).is_some(), beaten);
                if let Some(by) = dominated(&points, place) {
                    assert!(points[by].dominates(point));
                }
            }
            assert!(found.is_sorted_by(|&a, &b| points[a].cost <= points[b].cost));
        }
    }

    #[test]
    fn outcomes_become_candidates() {
        let metric = Metric {
            id: "algorithm.recall".to_owned(),
            larger_is_better: true,
            ..Metric::default()
        };
        let mut outcome = Outcome::default();
        outcome.errors.insert(metric.id.clone(), 0.75);
        assert_eq!(Candidate::of(&outcome, &metric), None);
        outcome.time = Some(Spread {
            median: 2e6,
            ..Spread::default()
        });
        let candidate = Candidate {
            cost: 2e6,
            error: -0.75,
        };
        assert_eq!(Candidate::of(&outcome, &metric), Some(candidate));
        outcome.errors.insert(metric.id.clone(), f64::NAN);
        assert_eq!(Candidate::of(&outcome, &metric), None);
    }
}
