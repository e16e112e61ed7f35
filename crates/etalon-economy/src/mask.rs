//! Which texels of a picture mirror.

use std::fmt;

use etalon_scenes::FrameSize;
use serde::{Deserialize, Serialize};

/// How the mirroring texels lie.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// In a rectangle of the picture's shape around its middle.
    #[default]
    Compact,
    /// In squares of 16 × 16 texels strewn over the picture, aligned with no tile.
    Scattered,
}

impl Layout {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Compact, Self::Scattered];
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Compact => "compact",
            Self::Scattered => "scattered",
        })
    }
}

/// Side of the strewn squares, and where the first begins.
const SQUARE: u32 = 16;
const OFFSET: (u32, u32) = (11, 5);

/// Whether each texel mirrors, row by row. A larger share holds all that a smaller one
/// holds; 0 is none and 1 is all.
#[must_use]
pub fn mask(layout: Layout, share: f64, size: FrameSize) -> Vec<bool> {
    let (width, height) = (size.width(), size.height());
    let share = if share.is_nan() {
        0.0
    } else {
        share.clamp(0.0, 1.0)
    };
    let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    match layout {
        Layout::Compact => {
            let part = share.sqrt();
            let inside = move |at: u32, side: u32| {
                // Of the texel's middle from that of the picture, as a share of its side.
                let away = (2.0 * f64::from(at) + 1.0) / f64::from(side) - 1.0;
                away.abs() < part
            };
            texels
                .map(|(x, y)| inside(x, width) && inside(y, height))
                .collect()
        }
        Layout::Scattered => {
            let columns = (width + OFFSET.0).div_ceil(SQUARE);
            let rows = (height + OFFSET.1).div_ceil(SQUARE);
            let squares = columns * rows;
            let mut order: Vec<u32> = (0..squares).collect();
            order.sort_unstable_by_key(|&square| (hash(square), square));
            let taken = (share * f64::from(squares)).round() as usize;
            let mut mirrors = vec![false; squares as usize];
            for &square in &order[..taken.min(order.len())] {
                mirrors[square as usize] = true;
            }
            texels
                .map(|(x, y)| {
                    let column = (x + OFFSET.0) / SQUARE;
                    let row = (y + OFFSET.1) / SQUARE;
                    mirrors[(row * columns + column) as usize]
                })
                .collect()
        }
    }
}

/// A number that looks random: C. Wellons, "Prospecting for Hash Functions", 2018, the
/// hash `lowbias32`.
fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// The share of texels that mirror.
#[must_use]
pub fn share(mask: &[bool]) -> f64 {
    let mirrors = mask.iter().filter(|mirrors| **mirrors).count();
    mirrors as f64 / mask.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_met_and_grow() {
        for (width, height) in [(640, 360), (97, 55)] {
            let size = FrameSize::new(width, height).unwrap();
            for layout in Layout::ALL {
                let mut before = vec![false; size.pixels()];
                for wanted in [0.0, 0.01, 0.1, 0.35, 0.5, 0.9, 1.0] {
                    let mask = mask(layout, wanted, size);
                    let got = share(&mask);
                    // A row and a column of texels, or half a square.
                    let square = f64::from(SQUARE * SQUARE) / size.pixels() as f64;
                    let side = 1.0 / f64::from(width) + 1.0 / f64::from(height);
                    let room = 0.1 * wanted + square.max(side);
                    assert!((got - wanted).abs() <= room, "{layout} {wanted}: {got}");
                    let grew = before
                        .iter()
                        .zip(&mask)
                        .all(|(before, now)| !before || *now);
                    assert!(grew, "{layout} {wanted}");
                    before = mask;
                }
                assert_eq!(share(&before), 1.0, "{layout}");
            }
        }
    }

    #[test]
    fn nothing_and_all_are_exact_and_no_number_is_nothing() {
        for (width, height) in [(1, 1), (1, 40), (40, 1), (17, 9)] {
            let size = FrameSize::new(width, height).unwrap();
            for layout in Layout::ALL {
                for (wanted, expected) in [
                    (0.0, 0.0),
                    (-1.0, 0.0),
                    (f64::NAN, 0.0),
                    (1.0, 1.0),
                    (f64::INFINITY, 1.0),
                ] {
                    assert_eq!(share(&mask(layout, wanted, size)), expected, "{layout}");
                }
            }
        }
        assert_eq!(share(&[]), 0.0);
    }
}
