//! The depth of a tile: tests and writes.

use std::sync::atomic::Ordering;

use etalon_core::resource::Compare;

use super::setup::{Region, TILE};
use crate::memory::{Level, Texels, TextureView};

/// Pixels of a tile.
pub(super) const PIXELS: usize = (TILE * TILE) as usize;

/// The depths of a tile's pixels by quads: first the upper left, then the upper right
/// one of each quad, then the two below. Depth16Unorm as multiples of 1/65535.
pub(super) struct TileDepth {
    pub(super) values: Box<[f32; PIXELS]>,
}

/// Where a pixel of a tile is in it.
#[inline(always)]
pub(super) fn place(x: u32, y: u32) -> usize {
    ((y / 2 * (TILE / 2) + x / 2) * 4 + y % 2 * 2 + x % 2) as usize
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
        each_pixel(view, x, y, region, |place, index| {
            self.values[place] = match view.texels {
                Texels::B4(words) => words
                    .get(index)
                    .map_or(0.0, |word| f32::from_bits(word.load(Ordering::Relaxed))),
                Texels::B2(words) => words
                    .get(index)
                    .map_or(0.0, |word| word.load(Ordering::Relaxed).into()),
                _ => 0.0,
            };
        });
    }

    /// Writes them back.
    pub(super) fn store(&self, view: &TextureView<'_>, x: u32, y: u32, region: &Region) {
        each_pixel(view, x, y, region, |place, index| {
            let value = self.values[place];
            match view.texels {
                Texels::B4(words) => {
                    if let Some(word) = words.get(index) {
                        word.store(value.to_bits(), Ordering::Relaxed);
                    }
                }
                Texels::B2(words) => {
                    if let Some(word) = words.get(index) {
                        word.store(value as u16, Ordering::Relaxed);
                    }
                }
                _ => {}
            }
        });
    }
}

fn each_pixel(
    view: &TextureView<'_>,
    x: u32,
    y: u32,
    region: &Region,
    mut visit: impl FnMut(usize, usize),
) {
    let Some(&Level { width, start, .. }) = view.levels.first() else {
        return;
    };
    for row in y.max(region.y[0])..(y + TILE).min(region.y[1]) {
        for column in x.max(region.x[0])..(x + TILE).min(region.x[1]) {
            let index = start as usize + row as usize * width as usize + column as usize;
            visit(place(column - x, row - y), index);
        }
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
