//! What a worker knows.

use etalon_core::resource::SamplerDesc;

use super::check::Checker;
use super::probe::{Prober, StoreFormat};
use super::stage::Who;
use crate::code::{Code, CodeInst, Slot};
use crate::memory::{Buffer, TextureView};
use crate::num::Number;
use crate::registers::{BLOCK, Class, LANES, Lane, Lanes, Registers};

/// Something bound.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Resource<'a> {
    Buffer(&'a Buffer),
    Texture(&'a TextureView<'a>),
    Sampler(SamplerDesc),
}

/// Identifiers of the invocations of a workgroup, a chunk of lanes at a time.
#[derive(Clone, Debug)]
pub(crate) struct LocalIds {
    /// By axis, then the index.
    pub(crate) ids: [Vec<Lanes<u32>>; 4],
    /// All ones where there is an invocation.
    pub(crate) active: Vec<Lanes<u32>>,
    /// Invocations next to each other in x.
    pub(crate) width: u32,
}

impl LocalIds {
    pub(crate) fn new(size: [u32; 3]) -> Self {
        let count = size[0] * size[1] * size[2];
        let chunks = (count as usize).div_ceil(LANES);
        let lanes = |value: &dyn Fn(u32) -> u32| -> Vec<Lanes<u32>> {
            (0..chunks)
                .map(|chunk| {
                    Lanes(std::array::from_fn(|lane| {
                        value((chunk * LANES + lane) as u32)
                    }))
                })
                .collect()
        };
        // Lanes past the end repeat the last invocation: whatever they compute,
        // they compute on sensible values.
        let at = |index: u32| index.min(count - 1);
        Self {
            ids: [
                lanes(&|i| at(i) % size[0]),
                lanes(&|i| at(i) / size[0] % size[1]),
                lanes(&|i| at(i) / (size[0] * size[1])),
                lanes(&at),
            ],
            active: lanes(&|i| crate::num::mask(i < count)),
            width: size[0],
        }
    }
}

/// Why a worker stopped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// By the loop's number; the lowest workgroup of the batch, counted from its
    /// first, and invocation that is in it.
    EndlessLoop {
        counter: u32,
        workgroup: u32,
        invocation: u32,
    },
    /// By the instruction's index; the lowest invocation that is missing.
    DivergentBarrier { inst: u32, invocation: u32 },
}

/// What the invocations of a batch are given and give: for each slot as many
/// entries as a batch has chunks at most, as bits.
#[derive(Debug, Default)]
pub(crate) struct StageLanes {
    pub(crate) inputs: Vec<Lanes<u32>>,
    pub(crate) outputs: Vec<Lanes<u32>>,
    /// Entries of each slot.
    pub(crate) chunks: usize,
    /// By chunk; none without probes.
    pub(crate) who: Vec<Who>,
    /// Of the targets that colours are for; none without probes.
    pub(crate) colours: Vec<StoreFormat>,
}

/// A worker's state.
pub(crate) struct State<'a, N: Number> {
    pub(crate) registers: Registers<N>,
    /// Chunks of lanes in a register.
    pub(crate) chunks: usize,
    pub(crate) private_floats: Vec<N::Lanes>,
    pub(crate) private_ints: Vec<Lanes<u32>>,
    pub(crate) workgroup_floats: Vec<N>,
    pub(crate) workgroup_ints: Vec<u32>,
    pub(crate) code: &'a Code,
    pub(crate) resources: &'a [Resource<'a>],
    pub(crate) local_ids: &'a LocalIds,
    /// First chunk of the workgroup that the batch has.
    pub(crate) first_chunk: usize,
    /// The workgroup, or the first of several.
    pub(crate) workgroup: [u32; 3],
    pub(crate) workgroups: [u32; 3],
    /// What [`super::link`]'s test of a mask found.
    pub(crate) any: bool,
    /// Invocations of a subgroup.
    pub(crate) subgroup_size: u32,
    pub(crate) failure: Option<Failure>,
    /// Trips of each loop since it was entered.
    pub(crate) trips: Vec<u32>,
    /// Of vertex and fragment kernels.
    pub(crate) stage: StageLanes,
    /// Of programs with checks.
    pub(crate) checker: Option<Box<Checker<'a>>>,
    /// Of programs with probes.
    pub(crate) prober: Option<Box<Prober<'a>>>,
    /// See [`super::Executor::with_perturbation`].
    pub(crate) perturbation: Option<u64>,
}

impl<'a, N: Number> State<'a, N> {
    #[inline(always)]
    pub(crate) fn inst(&self, index: u32) -> &'a CodeInst {
        let code = self.code;
        &code.insts[index as usize]
    }

    /// Which chunk of its workgroup a chunk of the batch is. A batch has parts of
    /// one workgroup, or several whole ones.
    #[inline(always)]
    pub(crate) fn local_chunk(&self, chunk: usize) -> usize {
        (self.first_chunk + chunk) % self.local_ids.active.len()
    }

    /// Which of the batch's workgroups, next to each other in x, a chunk is of.
    #[inline(always)]
    pub(crate) fn group_in_batch(&self, chunk: usize) -> u32 {
        ((self.first_chunk + chunk) / self.local_ids.active.len()) as u32
    }

    /// How many invocations of the batch are next to each other in x, if it is of
    /// whole workgroups.
    #[inline(always)]
    pub(crate) fn width(&self) -> u32 {
        let groups = self.chunks / self.local_ids.active.len().max(1);
        self.local_ids.width.wrapping_mul(groups as u32)
    }

    /// Where a chunk of a register of lanes is.
    #[inline(always)]
    pub(crate) fn at(&self, number: u16, chunk: usize) -> usize {
        chunk * self.registers.stride + usize::from(number)
    }

    /// The integers of `K` lanes, or `K` times a uniform one.
    #[inline(always)]
    pub(crate) fn ints<const K: usize>(&self, slot: Slot, chunk: usize) -> [u32; K] {
        if slot.varying {
            first(&self.registers.ints[self.at(slot.number, chunk)].0)
        } else {
            [self.registers.uniform_ints[usize::from(slot.number)]; K]
        }
    }

    /// [`State::ints`] where they are; of a uniform number `K` times in `splat`.
    #[inline(always)]
    pub(crate) fn ints_in<'s, const K: usize>(
        &'s self,
        slot: Slot,
        chunk: usize,
        splat: &'s mut [u32; K],
    ) -> &'s [u32; K] {
        if slot.varying {
            let lanes = &self.registers.ints[self.at(slot.number, chunk)].0;
            lanes.first_chunk().unwrap_or(splat)
        } else {
            *splat = [self.registers.uniform_ints[usize::from(slot.number)]; K];
            splat
        }
    }

    /// The numbers of `K` lanes, or `K` times a uniform one.
    #[inline(always)]
    pub(crate) fn floats<const K: usize>(&self, slot: Slot, chunk: usize) -> [N; K] {
        if slot.varying {
            let lanes = &self.registers.floats[self.at(slot.number, chunk)];
            let mut out = [N::default(); K];
            for k in 0..K {
                out[k] = N::get(lanes, k);
            }
            out
        } else {
            [self.registers.uniform_floats[usize::from(slot.number)]; K]
        }
    }

    /// Either class as bits.
    #[inline(always)]
    pub(crate) fn bits<const K: usize>(&self, slot: Slot, chunk: usize) -> [u32; K] {
        match slot.class {
            Class::Int => self.ints(slot, chunk),
            Class::Float => {
                let singles = self.singles::<K>(slot, chunk);
                let mut bits = [0; K];
                for k in 0..K {
                    bits[k] = singles[k].to_bits();
                }
                bits
            }
        }
    }

    /// The `f32` of the numbers of `K` lanes.
    #[inline(always)]
    pub(crate) fn singles<const K: usize>(&self, slot: Slot, chunk: usize) -> [f32; K] {
        let mut out = [0.0; K];
        if slot.varying {
            let lanes = &self.registers.floats[self.at(slot.number, chunk)];
            for k in 0..K {
                out[k] = N::get(lanes, k).to_f32();
            }
        } else {
            out = [self.registers.uniform_floats[usize::from(slot.number)].to_f32(); K];
        }
        out
    }

    /// A block of [`State::ints`].
    #[inline(always)]
    pub(crate) fn int_block(&self, slot: Slot, chunk: usize, block: usize) -> [u32; BLOCK] {
        if slot.varying {
            let lanes = &self.registers.ints[self.at(slot.number, chunk)];
            u32::block(lanes, block * BLOCK)
        } else {
            self.registers.uniform_ints[usize::from(slot.number)].splat()
        }
    }

    /// A block of [`State::singles`].
    #[inline(always)]
    pub(crate) fn single_block(&self, slot: Slot, chunk: usize, block: usize) -> [f32; BLOCK] {
        let mut out = [0.0; BLOCK];
        if slot.varying {
            let lanes = &self.registers.floats[self.at(slot.number, chunk)];
            let numbers = N::block(lanes, block * BLOCK);
            for k in 0..BLOCK {
                out[k] = N::of_block(&numbers, k).to_f32();
            }
        } else {
            out = [self.registers.uniform_floats[usize::from(slot.number)].to_f32(); BLOCK];
        }
        out
    }

    /// Sets a block of a register of lanes.
    #[inline(always)]
    pub(crate) fn set_single_block(
        &mut self,
        slot: Slot,
        chunk: usize,
        block: usize,
        values: [f32; BLOCK],
    ) {
        let at = self.at(slot.number, chunk);
        let mut numbers = N::default().splat();
        for k in 0..BLOCK {
            N::set_in_block(&mut numbers, k, N::from_f32(values[k]));
        }
        N::set_block(&mut self.registers.floats[at], block * BLOCK, numbers);
    }

    /// The `f64` of the numbers of `K` lanes.
    #[inline(always)]
    pub(crate) fn doubles<const K: usize>(&self, slot: Slot, chunk: usize) -> [f64; K] {
        let mut out = [0.0; K];
        if slot.varying {
            let lanes = &self.registers.floats[self.at(slot.number, chunk)];
            for k in 0..K {
                out[k] = N::get(lanes, k).to_f64();
            }
        } else {
            out = [self.registers.uniform_floats[usize::from(slot.number)].to_f64(); K];
        }
        out
    }

    #[inline(always)]
    pub(crate) fn set_ints<const K: usize>(&mut self, slot: Slot, chunk: usize, lanes: &[u32; K]) {
        if slot.varying {
            let at = self.at(slot.number, chunk);
            self.registers.ints[at].0[..K].copy_from_slice(lanes);
        } else {
            self.registers.uniform_ints[usize::from(slot.number)] = lanes[0];
        }
    }

    #[inline(always)]
    pub(crate) fn set_floats<const K: usize>(&mut self, slot: Slot, chunk: usize, lanes: &[N; K]) {
        if slot.varying {
            let at = self.at(slot.number, chunk);
            let to = &mut self.registers.floats[at];
            for k in 0..K {
                N::set(to, k, lanes[k]);
            }
        } else {
            self.registers.uniform_floats[usize::from(slot.number)] = lanes[0];
        }
    }

    #[inline(always)]
    pub(crate) fn set_bits<const K: usize>(&mut self, slot: Slot, chunk: usize, lanes: &[u32; K]) {
        match slot.class {
            Class::Int => self.set_ints(slot, chunk, lanes),
            Class::Float if slot.varying => {
                let at = self.at(slot.number, chunk);
                let to = &mut self.registers.floats[at];
                for k in 0..K {
                    N::set(to, k, N::from_f32(f32::from_bits(lanes[k])));
                }
            }
            Class::Float => {
                let value = N::from_f32(f32::from_bits(lanes[0]));
                self.registers.uniform_floats[usize::from(slot.number)] = value;
            }
        }
    }

    /// The numbers of `K` lanes whose texels or words are `singles`, as bits,
    /// and which are `doubles` in the wide plane.
    #[inline(always)]
    pub(crate) fn set_both<const K: usize>(
        &mut self,
        slot: Slot,
        chunk: usize,
        singles: &[u32; K],
        doubles: &[f64; K],
    ) {
        if slot.varying {
            let at = self.at(slot.number, chunk);
            let to = &mut self.registers.floats[at];
            for k in 0..K {
                N::set(to, k, N::from_both(f32::from_bits(singles[k]), doubles[k]));
            }
        } else {
            let value = N::from_both(f32::from_bits(singles[0]), doubles[0]);
            self.registers.uniform_floats[usize::from(slot.number)] = value;
        }
    }

    /// A block of [`State::set_both`] in a register of lanes, both as bits.
    #[inline(always)]
    pub(crate) fn set_both_block(
        &mut self,
        slot: Slot,
        chunk: usize,
        block: usize,
        singles: [u32; BLOCK],
        doubles: [u64; BLOCK],
    ) {
        let at = self.at(slot.number, chunk);
        let mut numbers = N::default().splat();
        for k in 0..BLOCK {
            let (single, double) = (f32::from_bits(singles[k]), f64::from_bits(doubles[k]));
            N::set_in_block(&mut numbers, k, N::from_both(single, double));
        }
        N::set_block(&mut self.registers.floats[at], block * BLOCK, numbers);
    }

    /// The lanes that take part in an instruction.
    #[inline(always)]
    pub(crate) fn mask(&self, inst: &CodeInst, chunk: usize) -> [u32; LANES] {
        match inst.mask {
            Some(mask) => self.ints(mask, chunk),
            None => [u32::MAX; LANES],
        }
    }

    /// Lanes of the batch that hold an invocation.
    pub(crate) fn invocations(&self) -> u64 {
        (0..self.chunks)
            .map(|chunk| {
                let active = &self.local_ids.active[self.local_chunk(chunk)].0;
                active.iter().filter(|&&lane| lane != 0).count() as u64
            })
            .sum()
    }
}

/// The first `K` lanes, which is all or one.
#[inline(always)]
fn first<T: Copy + Default, const K: usize>(lanes: &[T; LANES]) -> [T; K] {
    let mut first = [T::default(); K];
    first.copy_from_slice(&lanes[..K]);
    first
}
