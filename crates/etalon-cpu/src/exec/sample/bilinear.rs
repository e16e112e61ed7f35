//! The filter that kernels mostly ask for: four texels of one level of a flat texture,
//! the edge repeated outside. A block of lanes at a time, so that neither texels nor
//! weights go through memory; the same bits as [`Request::at_level`]'s, which has all
//! other cases.

use std::marker::PhantomData;

use etalon_core::resource::{AddressMode, Filter};

use super::Request;
use super::axis::{AxisTexels, MAX_FAST_SIZE};
use crate::code::Slot;
use crate::exec::formats::{BlockFormat, WithFormat, with_format};
use crate::exec::image::four;
use crate::exec::isa::Isa;
use crate::exec::lanes::BLOCK;
use crate::exec::state::State;
use crate::memory::Level;
use crate::num::Number;
use crate::registers::LANES;

/// Reads all lanes, if it is such a filter and the texture of a format decoded by
/// block.
#[inline(always)]
pub(super) fn sample<I: Isa, N: Number>(
    state: &mut State<'_, N>,
    request: &Request<'_>,
    operands: &[Slot],
    results: &[Option<Slot>],
) -> bool {
    let &[x, y, lod] = operands else {
        return false;
    };
    let plain = request.axes == 2 && !request.cube && !request.layered && request.compare.is_none();
    if !plain || lod.varying {
        return false;
    }
    let [lod] = state.singles::<1>(lod, 0);
    let Some(level) = request.bilinear_level(lod) else {
        return false;
    };
    let [offset_x, offset_y, _] = request.offset;
    let blocks = Bilinear::<N, I> {
        state,
        level,
        coordinates: [x, y],
        offset: [offset_x, offset_y],
        results: four(results),
        isa: PhantomData,
    };
    with_format(request.texture, blocks).is_none()
}

impl Request<'_> {
    /// The one level that lanes read at a level of detail, if they take four texels of
    /// it and repeat its edge.
    #[inline(always)]
    fn bilinear_level(&self, lod: f32) -> Option<Level> {
        let lod = self.clamp_lod(lod);
        let (fine, weight) = self.mips(lod);
        let level = self.level(fine);
        let [along_x, along_y, _] = self.sampler.address;
        let edge = AddressMode::ClampToEdge;
        (self.filter(lod) == Filter::Linear
            && weight == 0.0
            && (along_x, along_y) == (edge, edge)
            && level.width.max(level.height) <= MAX_FAST_SIZE)
            .then_some(level)
    }
}

struct Bilinear<'s, 'a, N: Number, I> {
    state: &'s mut State<'a, N>,
    level: Level,
    coordinates: [Slot; 2],
    /// In texels.
    offset: [i32; 2],
    results: [Option<Slot>; 4],
    isa: PhantomData<I>,
}

impl<N: Number, I: Isa> WithFormat for Bilinear<'_, '_, N, I> {
    #[inline(always)]
    fn run<F: BlockFormat>(self, words: &[F::Word]) {
        let Self { state, results, .. } = self;
        let Level { width, height, .. } = self.level;
        let alpha = results[3].is_some();
        let [along_x, along_y] = self.coordinates;
        for chunk in 0..state.chunks {
            for block in 0..LANES / BLOCK {
                let at = state.single_block(along_x, chunk, block);
                let x = AxisTexels::linear::<I>(&at, width, self.offset[0]);
                let at = state.single_block(along_y, chunk, block);
                let y = AxisTexels::linear::<I>(&at, height, self.offset[1]);
                let (upper, lower) = (rows(self.level, y.texels[0]), rows(self.level, y.texels[1]));
                let [left, right] = x.texels;
                let (across, down) = (rest(x.weight), rest(y.weight));
                let taps = Taps::<F> { words, alpha };
                let sum = [[0.0; BLOCK]; 4];
                let sum = taps.add::<I>(sum, upper, left, across, down);
                let sum = taps.add::<I>(sum, upper, right, x.weight, down);
                let sum = taps.add::<I>(sum, lower, left, across, y.weight);
                let sum = taps.add::<I>(sum, lower, right, x.weight, y.weight);
                for c in 0..4 {
                    if let Some(to) = results[c] {
                        state.set_single_block(to, chunk, block, sum[c]);
                    }
                }
            }
        }
    }
}

/// Where rows of a level begin.
#[inline(always)]
fn rows(level: Level, row: [u32; BLOCK]) -> [u32; BLOCK] {
    let mut first = [0; BLOCK];
    for k in 0..BLOCK {
        first[k] = level.start + row[k] * level.width;
    }
    first
}

/// 1 less a weight.
#[inline(always)]
fn rest(weight: [f32; BLOCK]) -> [f32; BLOCK] {
    let mut rest = [0.0; BLOCK];
    for k in 0..BLOCK {
        rest[k] = 1.0 - weight[k];
    }
    rest
}

/// `sum + weight * texel`, rounded twice.
#[inline(always)]
fn weighted(sum: [f32; BLOCK], weight: [f32; BLOCK], texel: [f32; BLOCK]) -> [f32; BLOCK] {
    let mut new = [0.0; BLOCK];
    for k in 0..BLOCK {
        new[k] = sum[k] + weight[k] * texel[k];
    }
    new
}

struct Taps<'w, F: BlockFormat> {
    words: &'w [F::Word],
    alpha: bool,
}

impl<F: BlockFormat> Taps<'_, F> {
    /// Adds the texels in these rows and columns. Block by block and not in a loop over
    /// channels, of which compilers make vectors.
    #[inline(always)]
    fn add<I: Isa>(
        &self,
        sum: [[f32; BLOCK]; 4],
        row: [u32; BLOCK],
        column: [u32; BLOCK],
        across: [f32; BLOCK],
        down: [f32; BLOCK],
    ) -> [[f32; BLOCK]; 4] {
        let (mut index, mut weight) = ([0; BLOCK], [0.0; BLOCK]);
        for k in 0..BLOCK {
            index[k] = row[k] + column[k];
        }
        for k in 0..BLOCK {
            weight[k] = across[k] * down[k];
        }
        // All are in the level.
        let Some(texels) = F::read::<I>(self.words, index, self.alpha) else {
            return sum;
        };
        let ([r, g, b, a], [red, green, blue, alpha]) = (sum, texels);
        [
            weighted(r, weight, red),
            weighted(g, weight, green),
            weighted(b, weight, blue),
            weighted(a, weight, alpha),
        ]
    }
}
