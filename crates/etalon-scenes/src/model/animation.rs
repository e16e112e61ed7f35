//! Movement of nodes over time: glTF 2.0, section 3.11 and appendix C.

use glam::{DQuat, DVec3};

use super::error::{Check, ModelError, Place, finite};
use super::node::{ROTATION, is_rotation, normalized, quaternion};

/// How values between key frames come about.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// The value of the key frame before.
    Step,
    /// Linear; rotations along the shorter great arc at constant speed.
    #[default]
    Linear,
    /// Hermite splines. Each key frame has three values: tangent towards it,
    /// value, tangent away from it; tangents are per second.
    CubicSpline,
}

/// What a track moves, with its values.
#[derive(Clone, Debug, PartialEq)]
pub enum Values {
    /// Translations.
    Translation(Vec<[f32; 3]>),
    /// Quaternions x, y, z, w.
    Rotation(Vec<[f32; 4]>),
    /// Scales.
    Scale(Vec<[f32; 3]>),
}

impl Values {
    fn len(&self) -> usize {
        match self {
            Self::Translation(values) | Self::Scale(values) => values.len(),
            Self::Rotation(values) => values.len(),
        }
    }

    const fn property(&self) -> &'static str {
        match self {
            Self::Translation(_) => "translation",
            Self::Rotation(_) => "rotation",
            Self::Scale(_) => "scale",
        }
    }
}

/// One property of one node over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Track {
    /// Index of the model's node, whose transform is not a matrix.
    pub node: usize,
    /// Times of the key frames in seconds, strictly growing, none negative.
    pub times: Vec<f32>,
    /// How values between key frames come about.
    pub interpolation: Interpolation,
    /// One value per key frame, or three for cubic splines.
    pub values: Values,
}

/// A movement: several tracks that run together. Before its first key frame
/// and after its last one a track stands still.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animation {
    /// May be empty.
    pub name: String,
    /// At most one for each property of each node.
    pub tracks: Vec<Track>,
}

impl Animation {
    /// Time of the last key frame in seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        let last = |track: &Track| track.times.last().map_or(0.0, |&time| f64::from(time));
        self.tracks.iter().map(last).fold(0.0, f64::max)
    }

    pub(super) fn check(&self, index: usize, nodes: usize) -> Result<(), ModelError> {
        let place = Place::new("animation", index, &self.name);
        let check = Check(&place);
        let mut seen = std::collections::BTreeSet::new();
        for (i, track) in self.tracks.iter().enumerate() {
            check.index(format!("target of track {i}"), "node", track.node, nodes)?;
            let property = track.values.property();
            if !seen.insert((track.node, property)) {
                return Err(ModelError::Conflict {
                    place,
                    problem: format!(
                        "track {i} moves the {property} of node {}, which another track moves already",
                        track.node
                    ),
                });
            }
            track.check(i, &check)?;
        }
        Ok(())
    }
}

impl Track {
    fn check(&self, index: usize, check: &Check<'_>) -> Result<(), ModelError> {
        let keys = self.times.len();
        check.count("key frames in a track", keys, "at least 1", keys > 0)?;
        let mut last = -1.0;
        for (key, &time) in self.times.iter().enumerate() {
            check.value(
                format!("time of key frame {key} of track {index}"),
                time,
                "finite, not negative and after the key frame before",
                time.is_finite() && time >= 0.0 && time > last,
            )?;
            last = time;
        }
        let per_key = match self.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Step | Interpolation::Linear => 1,
        };
        check.count(
            "values in a track",
            self.values.len(),
            format!("{per_key} for each of {keys} key frames in track {index}"),
            self.values.len() / per_key == keys && self.values.len().is_multiple_of(per_key),
        )?;
        match &self.values {
            Values::Translation(values) => check.each("translation", values, "finite", finite),
            Values::Scale(values) => check.each("scale", values, "finite", finite),
            Values::Rotation(values) => {
                check.each("rotation or tangent", values, "finite", finite)?;
                let keys: Vec<_> = if per_key == 3 {
                    values.iter().skip(1).step_by(3).copied().collect()
                } else {
                    values.clone()
                };
                check.each("rotation", &keys, ROTATION, is_rotation)
            }
        }
    }

    /// The property's value, replacing that of `pose`.
    pub(super) fn apply(&self, time: f64, pose: &mut Pose) {
        let key = Key::find(&self.times, time);
        match &self.values {
            Values::Translation(values) => {
                pose.translation = self.vector(values, &key).unwrap_or(pose.translation);
            }
            Values::Scale(values) => {
                pose.scale = self.vector(values, &key).unwrap_or(pose.scale);
            }
            Values::Rotation(values) => {
                pose.rotation = self.rotation(values, &key).unwrap_or(pose.rotation);
            }
        }
    }

    fn vector(&self, values: &[[f32; 3]], key: &Key) -> Option<DVec3> {
        let value = |i: usize| Some(DVec3::from_array(values.get(i)?.map(f64::from)));
        match self.interpolation {
            Interpolation::Step => value(key.index),
            Interpolation::Linear => {
                let start = value(key.index)?;
                Some(value(key.next).map_or(start, |end| start.lerp(end, key.part)))
            }
            Interpolation::CubicSpline => {
                let (i, j) = (3 * key.index, 3 * key.next);
                let [a, b, c, d] = key.hermite();
                Some(value(i + 1)? * a + value(i + 2)? * b + value(j + 1)? * c + value(j)? * d)
            }
        }
    }

    fn rotation(&self, values: &[[f32; 4]], key: &Key) -> Option<DQuat> {
        let value = |i: usize| values.get(i).copied().map(quaternion);
        match self.interpolation {
            Interpolation::Step => value(key.index),
            Interpolation::Linear => {
                let start = value(key.index)?;
                Some(value(key.next).map_or(start, |end| start.slerp(end, key.part)))
            }
            Interpolation::CubicSpline => {
                let raw = |i: usize| Some(DQuat::from_array(values.get(i)?.map(f64::from)));
                let (i, j) = (3 * key.index, 3 * key.next);
                let [a, b, c, d] = key.hermite();
                let sum = raw(i + 1)? * a + raw(i + 2)? * b + raw(j + 1)? * c + raw(j)? * d;
                Some(normalized(sum))
            }
        }
    }
}

/// A node's transform in parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pose {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

/// Between which key frames a time is.
struct Key {
    index: usize,
    next: usize,
    /// In `[0, 1]` from `index` to `next`.
    part: f64,
    /// Seconds between them.
    length: f64,
}

impl Key {
    fn find(times: &[f32], time: f64) -> Self {
        let after = times.partition_point(|&t| f64::from(t) <= time);
        let index = after.saturating_sub(1);
        let next = after.min(times.len().saturating_sub(1));
        let at = |i: usize| times.get(i).map_or(0.0, |&t| f64::from(t));
        let length = at(next) - at(index);
        let part = if length > 0.0 {
            ((time - at(index)) / length).clamp(0.0, 1.0)
        } else {
            0.0
        };
        Self {
            index,
            next,
            part,
            length,
        }
    }

    /// Weights of value, tangent away, next value and tangent towards it
    /// (appendix C.5).
    fn hermite(&self) -> [f64; 4] {
        let (t, l) = (self.part, self.length);
        let (t2, t3) = (t * t, t * t * t);
        [
            2.0 * t3 - 3.0 * t2 + 1.0,
            l * (t3 - 2.0 * t2 + t),
            -2.0 * t3 + 3.0 * t2,
            l * (t3 - t2),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(track: &Track, time: f64) -> Pose {
        let mut pose = Pose {
            translation: DVec3::splat(9.0),
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
        };
        track.apply(time, &mut pose);
        pose
    }

    fn translation(interpolation: Interpolation, values: &[f32]) -> Track {
        Track {
            node: 0,
            times: vec![1.0, 3.0],
            interpolation,
            values: Values::Translation(values.iter().map(|&x| [x, 0.0, 2.0 * x]).collect()),
        }
    }

    #[test]
    fn steps_and_lines_hit_key_frames_and_stand_still_outside() {
        for interpolation in [Interpolation::Step, Interpolation::Linear] {
            let track = translation(interpolation, &[5.0, 7.0]);
            for (time, step, linear) in [
                (0.0, 5.0, 5.0),
                (1.0, 5.0, 5.0),
                (1.5, 5.0, 5.5),
                (2.999, 5.0, 6.999),
                (3.0, 7.0, 7.0),
                (99.0, 7.0, 7.0),
            ] {
                let expected = if interpolation == Interpolation::Step {
                    step
                } else {
                    linear
                };
                let got = at(&track, time).translation;
                let expected = DVec3::new(expected, 0.0, 2.0 * expected);
                assert!((got - expected).length() < 1e-14, "{time}: {got}");
            }
        }
    }

    #[test]
    fn splines_reproduce_cubics() {
        // x(t) = t³ − 2 t² + 3, with its derivative as tangents.
        let f = |t: f64| t * t * t - 2.0 * t * t + 3.0;
        let d = |t: f64| (3.0 * t * t - 4.0 * t) as f32;
        let values = [0.0, f(1.0) as f32, d(1.0), d(3.0), f(3.0) as f32, 0.0];
        let track = translation(Interpolation::CubicSpline, &values);
        for time in [1.0, 1.25, 2.0, 2.9, 3.0] {
            assert!((at(&track, time).translation.x - f(time)).abs() < 1e-12);
        }
    }

    #[test]
    fn rotations_take_the_shorter_way_at_constant_speed() {
        let angle = |x: f64| DQuat::from_rotation_z(x);
        let key = |q: DQuat| q.to_array().map(|x| x as f32);
        // The second key negated: the same rotation, the longer way in ℝ⁴.
        let track = Track {
            node: 0,
            times: vec![0.0, 1.0],
            interpolation: Interpolation::Linear,
            values: Values::Rotation(vec![key(angle(0.0)), key(-angle(1.0))]),
        };
        for time in [0.0, 0.25, 0.5, 1.0] {
            let got = at(&track, time).rotation;
            // The keys are rounded to f32.
            assert!(got.dot(angle(time)).abs() > 1.0 - 1e-13, "{time}: {got}");
        }
    }
}
