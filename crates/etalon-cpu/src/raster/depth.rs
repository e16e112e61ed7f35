//! The depth of a tile: tests and writes.

use std::sync::atomic::Ordering;

use etalon_core::resource::Compare;

use super::setup::{Region, TILE};
use crate::memory::{Texels, TextureView};

/// Pixels of a tile.
pub(super) const PIXELS: usize = (TILE * TILE) as usize;

/// The depths of a tile's pixels by quads: first the upper left, then the upper right
/// one of each quad, then the two below. Depth16Unorm as multiples of 1/65535.
pub(super) struct TileDepth {
    pub(super) values: Box<[f32; PIXELS]>,
}

impl TileDepth {
    pub(super) fn new() -> Self {
        Self {
            values: Box::new([0.0; PIXELS]),
        }
    }

    /// Reads the depths of the pixels of a region that are in the tile that begins
    /// at `x`, `y`.
    pub(super) fn load(&mut self, view: &TextureView<'_>, x: u32, y: u32, region: &Region) {
        for row in Rows::new(view, x, y, region) {
            match view.texels {
                Texels::B4(words) => {
                    let words = words.get(row.texels.clone()).unwrap_or(&[]);
                    for (i, word) in words.iter().enumerate() {
                        let bits = word.load(Ordering::Relaxed);
                        self.values[row.place(i)] = f32::from_bits(bits);
                    }
                }
                Texels::B2(words) => {
                    let words = words.get(row.texels.clone()).unwrap_or(&[]);
                    for (i, word) in words.iter().enumerate() {
                        self.values[row.place(i)] = word.load(Ordering::Relaxed).into();
                    }
                }
                _ => {}
            }
        }
    }

    /// Writes them back.
    pub(super) fn store(&self, view: &TextureView<'_>, x: u32, y: u32, region: &Region) {
        for row in Rows::new(view, x, y, region) {
            match view.texels {
                Texels::B4(words) => {
                    let words = words.get(row.texels.clone()).unwrap_or(&[]);
                    for (i, word) in words.iter().enumerate() {
                        let value = self.values[row.place(i)];
                        word.store(value.to_bits(), Ordering::Relaxed);
                    }
                }
                Texels::B2(words) => {
                    let words = words.get(row.texels.clone()).unwrap_or(&[]);
                    for (i, word) in words.iter().enumerate() {
                        word.store(self.values[row.place(i)] as u16, Ordering::Relaxed);
                    }
                }
                _ => {}
            }
        }
    }
}

/// Neighbouring pixels of a tile's row.
struct Row {
    /// Their texels.
    texels: std::ops::Range<usize>,
    /// The first one in the tile.
    column: usize,
    row: usize,
}

impl Row {
    /// Where the pixel `i` of them is in [`TileDepth`].
    #[inline(always)]
    fn place(&self, i: usize) -> usize {
        let column = self.column + i;
        let start = (self.row / 2 * (TILE as usize / 2) * 2 + self.row % 2) * 2;
        // Always below; so that nobody has to check.
        (start + column / 2 * 4 + column % 2) % PIXELS
    }
}

/// The rows of a region that are in a tile.
struct Rows {
    start: usize,
    width: usize,
    x: [u32; 2],
    y: std::ops::Range<u32>,
    tile: [u32; 2],
}

impl Rows {
    fn new(view: &TextureView<'_>, x: u32, y: u32, region: &Region) -> Self {
        let level = view.levels.first().copied().unwrap_or_default();
        Self {
            start: level.start as usize,
            width: level.width as usize,
            x: [x.max(region.x[0]), (x + TILE).min(region.x[1])],
            y: y.max(region.y[0])..(y + TILE).min(region.y[1]),
            tile: [x, y],
        }
    }
}

impl Iterator for Rows {
    type Item = Row;

    fn next(&mut self) -> Option<Row> {
        let row = self.y.next()?;
        let first = self.start + row as usize * self.width;
        let [x, end] = self.x;
        Some(Row {
            texels: first + x as usize..first + end as usize,
            column: (x - self.tile[0]) as usize,
            row: (row - self.tile[1]) as usize,
        })
    }
}

/// Depth as Depth16Unorm holds it, in 1/65535: to the nearest, ties to even.
#[inline(always)]
pub(super) fn quantised(z: f32) -> f32 {
    // From 2^52 on the unit of f64 is 1; the product is exact.
    const UNIT: f64 = 4_503_599_627_370_496.0;
    (f64::from(z) * 65535.0 + UNIT - UNIT) as f32
}

/// Sets `$mask[k]` to whether `$new[k] OP $old[k]` and it was set.
macro_rules! compare_lanes {
    ($compare:expr, $mask:ident, $new:ident, $old:expr, $lanes:expr) => {{
        macro_rules! each {
            ($op:tt) => {
                for k in 0..$lanes {
                    $mask[k] &= crate::num::mask($new[k] $op $old[k]);
                }
            };
        }
        match $compare {
            Compare::Never => $mask = [0; $lanes],
            Compare::Less => each!(<),
            Compare::Equal => each!(==),
            Compare::LessEqual => each!(<=),
            Compare::Greater => each!(>),
            Compare::NotEqual => each!(!=),
            Compare::GreaterEqual => each!(>=),
            Compare::Always => {}
        }
    }};
}

pub(super) use compare_lanes;

/// Whether what fails against a depth fails against every one that is drawn later.
pub(super) fn is_monotonic(compare: Compare) -> bool {
    matches!(
        compare,
        Compare::Never
            | Compare::Less
            | Compare::LessEqual
            | Compare::Greater
            | Compare::GreaterEqual
    )
}
