//! Handlers of texel loads and stores, and of texture queries.

use std::marker::PhantomData;

use super::formats::{BlockFormat, WithFormat, with_format};
use super::isa::{Baseline, Isa};
use super::lanes::BLOCK;
use super::link::Instr;
use super::memory::rounds;
use super::state::{Resource, State};
use super::texels::{OUTSIDE, address, fetch, put};
use super::tier::{Handler, Step, Tier, TieredStep};
use super::wide;
use crate::code::{CodeInst, Slot};
use crate::ir::{ImageAccess, ImageQuery, Op};
use crate::memory::{Level, TextureView};
use crate::num::{Number, mask};
use crate::registers::LANES;

pub(super) fn load<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::tiered::<Load<LANES>>(tier)
    } else {
        Handler::tiered::<Load<1>>(Tier::Baseline)
    }
}

pub(super) fn query<N: Number>(tier: Tier, varying: bool) -> Handler<N> {
    if varying {
        Handler::new::<Query<LANES>>(tier)
    } else {
        Handler::plain::<Query<1>>()
    }
}

pub(super) fn texture<'a, N: Number>(
    state: &State<'a, N>,
    image: u16,
) -> Option<&'a TextureView<'a>> {
    match state.resources.get(usize::from(image)) {
        Some(&Resource::Texture(texture)) => Some(texture),
        _ => None,
    }
}

/// The indices of texels; coordinates are unsigned, so that negative ones are outside.
#[inline(always)]
fn locate<const K: usize>(
    level: Level,
    x: &[u32; K],
    y: &[u32; K],
    z: Option<&[u32; K]>,
    out: &mut [u32; K],
) {
    let Level {
        width,
        height,
        depth,
        start,
    } = level;
    match z {
        Some(z) => {
            for k in 0..K {
                let inside = mask((x[k] < width) & (y[k] < height) & (z[k] < depth));
                let index = z[k]
                    .wrapping_mul(height)
                    .wrapping_add(y[k])
                    .wrapping_mul(width)
                    .wrapping_add(x[k])
                    .wrapping_add(start);
                out[k] = index | !inside;
            }
        }
        None => {
            for k in 0..K {
                let inside = mask((x[k] < width) & (y[k] < height));
                let index = y[k]
                    .wrapping_mul(width)
                    .wrapping_add(x[k])
                    .wrapping_add(start);
                out[k] = index | !inside;
            }
        }
    }
}

/// The indices of the texels that an instruction's operands name.
#[inline(always)]
pub(super) fn addresses<N: Number, const K: usize>(
    state: &State<'_, N>,
    texture: &TextureView<'_>,
    access: ImageAccess,
    operands: &[Slot],
    level: Option<Slot>,
    chunk: usize,
) -> [u32; K] {
    let mut splats = [[0; K]; 3];
    let [x, y, z] = &mut splats;
    let x = state.ints_in(operands[0], chunk, x);
    let y = state.ints_in(operands[1], chunk, y);
    let z =
        (access.coordinates == 3 || access.layered).then(|| state.ints_in(operands[2], chunk, z));
    let mut out = [OUTSIDE; K];
    match level {
        Some(level) if level.varying => {
            let levels: [u32; K] = state.ints(level, chunk);
            for k in 0..K {
                if let Some(&level) = texture.levels.get(levels[k] as usize) {
                    let mut one = [OUTSIDE; 1];
                    locate(
                        level,
                        &[x[k]],
                        &[y[k]],
                        z.map(|z| [z[k]]).as_ref(),
                        &mut one,
                    );
                    out[k] = one[0];
                }
            }
        }
        level => {
            let level: [u32; 1] = level.map_or([0], |level| state.ints(level, chunk));
            if let Some(&level) = texture.levels.get(level[0] as usize) {
                locate(level, x, y, z, &mut out);
            }
        }
    }
    out
}

#[inline(always)]
pub(super) fn wanted(inst: &CodeInst) -> [bool; 4] {
    std::array::from_fn(|channel| inst.results.get(channel).is_some_and(Option::is_some))
}

/// The results of an instruction that has up to four. One by one: a copy of how many
/// there are is a call.
#[inline(always)]
pub(super) fn four(results: &[Option<Slot>]) -> [Option<Slot>; 4] {
    let one = |channel: usize| results.get(channel).copied().flatten();
    [one(0), one(1), one(2), one(3)]
}

/// The texels that an instruction's operands name in one level, by block.
#[derive(Clone, Copy)]
struct Addresses {
    level: Level,
    x: Slot,
    y: Slot,
    z: Option<Slot>,
}

impl Addresses {
    /// If all lanes are at one level, which is there.
    #[inline(always)]
    fn new<N: Number>(
        state: &State<'_, N>,
        texture: &TextureView<'_>,
        access: ImageAccess,
        operands: &[Slot],
        level: Option<Slot>,
    ) -> Option<Self> {
        let level = match level {
            Some(level) if level.varying => return None,
            Some(level) => state.ints::<1>(level, 0)[0],
            None => 0,
        };
        let third = access.coordinates == 3 || access.layered;
        Some(Self {
            level: *texture.levels.get(level as usize)?,
            x: *operands.first()?,
            y: *operands.get(1)?,
            z: if third { Some(*operands.get(2)?) } else { None },
        })
    }

    #[inline(always)]
    fn block<N: Number>(&self, state: &State<'_, N>, chunk: usize, block: usize) -> [u32; BLOCK] {
        let mut index = [OUTSIDE; BLOCK];
        let x = state.int_block(self.x, chunk, block);
        let y = state.int_block(self.y, chunk, block);
        if let Some(z) = self.z {
            let z = state.int_block(z, chunk, block);
            locate(self.level, &x, &y, Some(&z), &mut index);
        } else {
            locate(self.level, &x, &y, None, &mut index);
        }
        index
    }

    /// Asks for what the batch after this one will load, if it is beside it and as wide
    /// as this one. Most kernels read a texel or its surroundings once: without this
    /// they wait for memory, whose own foresight ends where rows are as short as those
    /// of workgroups. Before the loads and not between them, whose indices stay in
    /// vector registers.
    #[inline(always)]
    fn ask_ahead<N: Number, I: Isa, W>(&self, state: &State<'_, N>, words: &[W]) {
        let (true, true, None) = (self.x.varying, self.y.varying, self.z) else {
            return;
        };
        let width = state.width();
        for chunk in 0..state.chunks {
            let x = &state.registers.ints[state.at(self.x.number, chunk)].0;
            let y = &state.registers.ints[state.at(self.y.number, chunk)].0;
            let rows = x.as_chunks::<ROW>().0.iter().zip(y.as_chunks::<ROW>().0);
            for (x, y) in rows {
                // Twice as far where it is every other texel.
                let step = 1 + x[ROW - 1].wrapping_sub(x[0]) / ROW as u32 % 2;
                let row = y[0].wrapping_mul(self.level.width);
                let next = row
                    .wrapping_add(x[0])
                    .wrapping_add(width.wrapping_mul(step));
                let next = next.wrapping_add(self.level.start) as usize;
                I::prefetch(words.as_ptr().wrapping_add(next).cast());
            }
        }
    }
}

/// Lanes that mostly are next to each other in a row of a texture.
const ROW: usize = 8;

struct Load<const K: usize>;

impl<N: Number, const K: usize> TieredStep<N> for Load<K> {
    #[inline(always)]
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageLoad { access, level, .. } = inst.op else {
            return;
        };
        let Some(texture) = texture(state, access.image) else {
            return;
        };
        let level = if level {
            inst.operands.last().copied()
        } else {
            None
        };
        let wide = if N::WIDE { texture.wide } else { None };
        if K == LANES
            && wide.is_none()
            && let Some(addresses) = Addresses::new(state, texture, access, &inst.operands, level)
        {
            let load = LoadBlocks::<N, I>::new(state, texture, addresses, inst, instr.first);
            if with_format(texture, load).is_none() {
                return;
            }
        }
        let wanted = wanted(inst);
        for chunk in 0..rounds::<N, K>(state) {
            let index = addresses::<N, K>(state, texture, access, &inst.operands, level, chunk);
            if let (Some(wide), true) = (wide, instr.first) {
                wide::ask_ahead::<I, K>(wide, &index, state.width());
            }
            if let (Some(wide), false) = (wide, N::HAS_SINGLE) {
                wide::load::<I, N, K>(state, inst, wide, &index, &[[0; K]; 4], chunk);
                continue;
            }
            let mut channels = [[0; K]; 4];
            fetch::<I, K>(texture, &index, wanted, &mut channels);
            if let Some(wide) = wide {
                wide::load::<I, N, K>(state, inst, wide, &index, &channels, chunk);
                continue;
            }
            for (result, channel) in inst.results.iter().zip(&channels) {
                if let Some(to) = *result {
                    state.set_bits(to, chunk, channel);
                }
            }
        }
    }
}

/// A load of lanes from a texture whose format is decoded by block.
struct LoadBlocks<'s, 'a, N: Number, I> {
    state: &'s mut State<'a, N>,
    texture: &'a TextureView<'a>,
    addresses: Addresses,
    results: [Option<Slot>; 4],
    /// Whether to [`Addresses::ask_ahead`].
    ahead: bool,
    isa: PhantomData<I>,
}

impl<'s, 'a, N: Number, I: Isa> LoadBlocks<'s, 'a, N, I> {
    #[inline(always)]
    fn new(
        state: &'s mut State<'a, N>,
        texture: &'a TextureView<'a>,
        addresses: Addresses,
        inst: &CodeInst,
        ahead: bool,
    ) -> Self {
        Self {
            state,
            texture,
            addresses,
            results: four(&inst.results),
            ahead,
            isa: PhantomData,
        }
    }
}

impl<N: Number, I: Isa> WithFormat for LoadBlocks<'_, '_, N, I> {
    #[inline(always)]
    fn run<F: BlockFormat>(self, words: &[F::Word]) {
        let Self {
            state,
            texture,
            addresses,
            results,
            ahead,
            ..
        } = self;
        if ahead {
            addresses.ask_ahead::<N, I, F::Word>(state, words);
        }
        for chunk in 0..state.chunks {
            for block in 0..LANES / BLOCK {
                let index = addresses.block(state, chunk, block);
                let Some(channels) = F::read::<I>(words, index, results[3].is_some()) else {
                    load_outside(state, texture, &index, &results, chunk, block);
                    continue;
                };
                for c in 0..4 {
                    if let Some(to) = results[c] {
                        state.set_single_block(to, chunk, block, channels[c]);
                    }
                }
            }
        }
    }
}

/// Loads a block of texels of which some are outside: seldom, so not in the loop, and
/// as every processor can.
#[inline(never)]
fn load_outside<N: Number>(
    state: &mut State<'_, N>,
    texture: &TextureView<'_>,
    index: &[u32; BLOCK],
    results: &[Option<Slot>; 4],
    chunk: usize,
    block: usize,
) {
    let mut channels = [[0; BLOCK]; 4];
    fetch::<Baseline, BLOCK>(texture, index, [true; 4], &mut channels);
    for (result, channel) in results.iter().zip(channels) {
        if let Some(to) = *result {
            state.set_single_block(to, chunk, block, channel.map(f32::from_bits));
        }
    }
}

pub(super) struct Store;

impl<N: Number> TieredStep<N> for Store {
    #[inline(always)]
    fn run<I: Isa>(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::ImageStore { access, .. } = inst.op else {
            return;
        };
        let Some(texture) = texture(state, access.image) else {
            return;
        };
        let (coordinates, value) = inst.operands.split_at(inst.operands.len() - 4);
        for chunk in 0..state.chunks {
            let mut index = addresses::<N, LANES>(state, texture, access, coordinates, None, chunk);
            if inst.mask.is_some() {
                let active = state.mask(inst, chunk);
                for k in 0..LANES {
                    index[k] |= !active[k];
                }
            }
            if instr.first {
                for row in index.as_chunks::<ROW>().0 {
                    if row[0] != OUTSIDE {
                        let next = row[0].wrapping_add(state.width()) as usize;
                        I::prefetch(address(texture.texels, next));
                    }
                }
            }
            // Not by a closure, which would not be compiled for the tier.
            let mut channels = [[0; LANES]; 4];
            for (channel, value) in channels.iter_mut().zip(value) {
                *channel = state.bits(*value, chunk);
            }
            put::<I, LANES>(texture, &index, &channels);
            if let (true, Some(wide)) = (N::WIDE, texture.wide) {
                if instr.first {
                    wide::ask_ahead::<I, LANES>(wide, &index, state.width());
                }
                wide::store::<I, N>(state, wide, texture.desc().format, &index, value, chunk);
            }
        }
    }
}

struct Query<const K: usize>;

impl<N: Number, const K: usize> Step<N> for Query<K> {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let (Op::ImageQuery { image, query }, Some(Some(to))) =
            (inst.op, inst.results.first().copied())
        else {
            return;
        };
        let Some(texture) = texture(state, image) else {
            return;
        };
        for chunk in 0..rounds::<N, K>(state) {
            let mut answer = [0; K];
            if let Some(&slot) = inst.operands.first() {
                answer = state.ints(slot, chunk);
            }
            for level in &mut answer {
                *level = match query {
                    ImageQuery::Size(axis) => match texture.levels.get(*level as usize) {
                        Some(level) => {
                            [level.width, level.height, level.depth][usize::from(axis.min(2))]
                        }
                        None => 0,
                    },
                    ImageQuery::Levels => texture.desc().mips,
                    ImageQuery::Layers => match texture.desc().dimension {
                        etalon_core::resource::Dimension::Cube => texture.desc().layers() / 6,
                        _ => texture.desc().layers(),
                    },
                };
            }
            state.set_ints(to, chunk, &answer);
        }
    }
}
