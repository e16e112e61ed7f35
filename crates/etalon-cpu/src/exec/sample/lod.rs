//! Levels of detail: Vulkan 1.3, §16.7.

use etalon_core::resource::Filter;

use super::{Place, Request, cube};
use crate::memory::Level;
use crate::num::Number;

/// The level of detail that lanes ask for.
pub(super) enum Lod<const K: usize> {
    /// One for all.
    Same(f32),
    Each([f32; K]),
}

impl Request<'_> {
    /// Into the sampler's range; NaN becomes its least.
    #[inline(always)]
    pub(super) fn clamp_lod(&self, lod: f32) -> f32 {
        let (low, high) = (self.sampler.lod.min_level(), self.sampler.lod.max_level());
        let lod = if lod > low { lod } else { low };
        if lod < high { lod } else { high }
    }

    /// The filter within a level: a level of detail up to 0 magnifies.
    #[inline(always)]
    pub(super) fn filter(&self, lod: f32) -> Filter {
        if lod > 0.0 {
            self.sampler.min_filter
        } else {
            self.sampler.mag_filter
        }
    }

    /// The finer level and the weight of the next coarser one.
    #[inline(always)]
    pub(super) fn mips(&self, lod: f32) -> (i32, f32) {
        let last = self.texture.levels.len() as i32 - 1;
        let top = last as f32;
        let lod = if lod < top { lod } else { top };
        match self.sampler.mip_filter {
            // Half way goes to the finer level.
            Filter::Nearest => (((lod + 0.5).ceil() as i32 - 1).clamp(0, last), 0.0),
            Filter::Linear => {
                let fine = Number::to_i32(lod);
                (fine, lod - fine as f32)
            }
        }
    }

    /// A level, or the last one beyond it.
    #[inline(always)]
    pub(super) fn level(&self, level: i32) -> Level {
        let last = self.texture.levels.len() as i32 - 1;
        self.texture
            .levels
            .get(level.min(last) as usize)
            .copied()
            .unwrap_or(Level {
                width: 1,
                height: 1,
                depth: 1,
                start: 0,
            })
    }

    /// The level of detail of derivatives: the logarithm of the longer one's
    /// length in texels of the first level, without anisotropy.
    #[inline(always)]
    pub(super) fn gradient<const K: usize>(
        &self,
        place: &Place<K>,
        along_x: &[[f32; K]; 3],
        along_y: &[[f32; K]; 3],
    ) -> [f32; K] {
        let Level {
            width,
            height,
            depth,
            ..
        } = self.level(0);
        let size = [width as f32, height as f32, depth as f32];
        let mut squares = [[0.0; K]; 2];
        for (square, derivative) in squares.iter_mut().zip([along_x, along_y]) {
            let [x, y, z] = derivative;
            let [u, v, w] = &place.at;
            for k in 0..K {
                let mut derivative = [x[k], y[k], z[k]];
                if self.cube {
                    let [s, t] = cube::derivative([u[k], v[k], w[k]], derivative);
                    derivative = [s, t, 0.0];
                }
                for axis in 0..self.axes {
                    let texels = derivative[axis] * size[axis];
                    square[k] += texels * texels;
                }
            }
        }
        let [x, y] = squares;
        let mut lods = [0.0; K];
        for k in 0..K {
            lods[k] = 0.5 * Number::log2(if x[k] > y[k] { x[k] } else { y[k] });
        }
        lods
    }
}
