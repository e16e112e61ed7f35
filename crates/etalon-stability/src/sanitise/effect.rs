//! What decisions that are not stable do to a picture.

use serde::{Deserialize, Serialize};

/// How a step's picture differs where its kernel decided otherwise than its twin.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Texels whose invocation decided otherwise.
    pub texels: u64,
    /// Those of which the numbers of `f64` are another by over [`VISIBLE`].
    ///
    /// [`VISIBLE`]: etalon_cpu::sanitise::VISIBLE
    pub changed: u64,
    /// The largest difference, relative to the larger of the two numbers or to 2⁻¹⁴ if
    /// that is more.
    #[serde(with = "crate::number")]
    pub largest: f64,
}

/// Compares what `f32` and `f64` wrote, `width` texels a row, where invocations of a grid
/// have decided otherwise.
#[must_use]
pub fn effect(
    (grid, diverged): ([u32; 2], &[bool]),
    width: u32,
    single: &[[f32; 4]],
    double: &[[f64; 4]],
) -> Effect {
    let mut effect = Effect::default();
    if width == 0 || width > grid[0] {
        return effect;
    }
    for (index, (single, double)) in single.iter().zip(double).enumerate() {
        let (x, y) = (
            index as u64 % u64::from(width),
            index as u64 / u64::from(width),
        );
        let at = y * u64::from(grid[0]) + x;
        if !diverged.get(at as usize).copied().unwrap_or_default() {
            continue;
        }
        effect.texels += 1;
        let difference = single
            .iter()
            .zip(double)
            .map(|(&single, &double)| {
                let single = f64::from(single);
                let scale = single.abs().max(double.abs()).max(1.0 / 16384.0);
                (single - double).abs() / scale
            })
            .fold(0.0, f64::max);
        effect.largest = effect.largest.max(difference);
        effect.changed += u64::from(difference > etalon_cpu::sanitise::VISIBLE);
    }
    effect
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_texels_that_decided_otherwise_count() {
        let single = [[1.0, 0.0, 0.0, 1.0]; 6];
        let mut double = [[1.0, 0.0, 0.0, 1.0]; 6];
        double[0][0] = 0.5;
        double[4][1] = 0.25;
        // A grid wider than the picture: three texels a row, eight invocations.
        let mut diverged = [false; 16];
        diverged[8 + 1] = true;
        diverged[8 + 2] = true;
        let found = effect(([8, 2], &diverged), 3, &single, &double);
        assert_eq!(found.texels, 2);
        assert_eq!((found.changed, found.largest), (1, 1.0));
        assert_eq!(
            effect(([2, 2], &diverged), 3, &single, &double),
            Effect::default()
        );
    }
}
