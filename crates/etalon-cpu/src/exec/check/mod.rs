//! Handlers of checks, and what a worker knows for their sake.
//!
//! None of this is on the way of programs without checks: they have no such
//! instructions and no [`Checker`].

mod collect;
mod memory;
mod resource;
mod values;

use std::sync::atomic::AtomicU32;

pub(crate) use collect::{Collector, Detail, Found, Part, Site};

use self::collect::Use;
use self::memory::{Uses, Words};
use super::link::Instr;
use super::state::{Failure, Resource, State};
use super::tier::Step;
use crate::code::{Code, CodeInst, Slot};
use crate::finding::Checks;
use crate::ir::{Check, Op};
use crate::memory::TextureView;
use crate::num::Number;
use crate::registers::LANES;

/// What is known of a bound resource's contents.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shadow<'a> {
    /// One word for each word or texel; `None` if all counts as written.
    pub(crate) words: Option<&'a [AtomicU32]>,
    /// A texture whose texels are above 0 where nothing wrote.
    pub(crate) view: Option<TextureView<'a>>,
    pub(crate) writable: bool,
}

/// What a worker keeps for the checks of a program that has some.
pub(crate) struct Checker<'a> {
    checks: Checks,
    shadows: &'a [Shadow<'a>],
    pub(crate) collector: Collector,
    /// The workgroup's number, x first.
    workgroup: u64,
    /// Lanes in which a slot of private memory holds a value, for each chunk of
    /// each slot of floats and of integers.
    private: [Vec<u64>; 2],
    /// Workgroup memory, floats and integers.
    words: [Words; 2],
    buffers: Uses,
    texels: Uses,
}

impl<'a> Checker<'a> {
    /// For batches of so many chunks; `None` if the program has no checks. The
    /// sizes of private memory are those of the code, which were checked.
    pub(crate) fn new(code: &Code, chunks: usize, shadows: &'a [Shadow<'a>]) -> Option<Box<Self>> {
        let checks = code.resources.checks;
        if !checks.any() {
            return None;
        }
        let resources = &code.resources;
        let private = |slots: u32| {
            let watched = if checks.uninitialised { slots } else { 0 };
            vec![0; (watched as usize).saturating_mul(chunks)]
        };
        let words = |slots: u32| {
            let watched = checks.uninitialised || checks.races;
            Words::new(if watched { slots as usize } else { 0 })
        };
        Some(Box::new(Self {
            checks,
            shadows,
            collector: Collector::default(),
            workgroup: 0,
            private: [
                private(resources.private.float),
                private(resources.private.int),
            ],
            words: [
                words(resources.workgroup.float),
                words(resources.workgroup.int),
            ],
            buffers: Uses::default(),
            texels: Uses::default(),
        }))
    }

    /// A new workgroup has memory of its own.
    pub(crate) fn begin(&mut self, workgroup: u64) {
        self.workgroup = workgroup;
        self.words.iter_mut().for_each(Words::reset);
        self.buffers.clear();
        self.texels.clear();
    }
}

/// One lane that takes part in an instruction.
#[derive(Clone, Copy, Debug)]
struct Lane {
    chunk: usize,
    lane: usize,
    /// `local_invocation_index`.
    invocation: u32,
}

/// The lanes that take part, by ascending number.
fn lanes<N: Number>(state: &State<'_, N>, inst: &CodeInst) -> Vec<Lane> {
    (0..state.chunks)
        .flat_map(|chunk| {
            let mask = state.mask(inst, chunk);
            let ids = &state.local_ids.ids[3][state.local_chunk(chunk)].0;
            (0..LANES)
                .filter(move |&lane| mask[lane] != 0)
                .map(move |lane| Lane {
                    chunk,
                    lane,
                    invocation: ids[lane],
                })
        })
        .collect()
}

fn int<N: Number>(state: &State<'_, N>, slot: Slot, at: Lane) -> u32 {
    let number = if slot.varying {
        state.at(slot.number, at.chunk)
    } else {
        return state.registers.uniform_ints[usize::from(slot.number)];
    };
    state.registers.ints[number].0[at.lane]
}

fn float<N: Number>(state: &State<'_, N>, slot: Slot, at: Lane) -> N {
    let number = if slot.varying {
        state.at(slot.number, at.chunk)
    } else {
        return state.registers.uniform_floats[usize::from(slot.number)];
    };
    N::get(&state.registers.floats[number], at.lane)
}

fn texture<'a, N: Number>(state: &State<'a, N>, image: u16) -> Option<&'a TextureView<'a>> {
    match state.resources.get(usize::from(image)) {
        Some(&Resource::Texture(texture)) => Some(texture),
        _ => None,
    }
}

/// Any check.
pub(super) struct CheckStep;

impl<N: Number> Step<N> for CheckStep {
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let Op::Check(check) = inst.op else {
            return;
        };
        // Out of the state while it is changed.
        let Some(mut checker) = state.checker.take() else {
            return;
        };
        let this = Site::Inst(instr.index);
        match check {
            Check::Index { .. }
            | Check::Division { .. }
            | Check::Shift
            | Check::Conversion { .. }
            | Check::NonFinite { .. } => values::check(state, &mut checker, inst, check, this),
            Check::Texel { .. } | Check::Layer { .. } | Check::Level { .. } => {
                resource::bounds(state, &mut checker, inst, check, this);
            }
            Check::Barrier => barrier(state, &mut checker, inst, this),
            Check::Order {
                workgroup,
                storage,
                texture,
            } => checker.order(workgroup, storage, texture),
            Check::Forget { first, count } => checker.forget(state, inst, first, count),
            Check::Memory {
                memory,
                first,
                count,
                access,
            } => memory::check(
                state,
                &mut checker,
                inst,
                instr.index,
                (memory, first, count),
                access,
            ),
            Check::Buffer { .. } | Check::TexelMemory { .. } | Check::SampleMemory { .. } => {
                resource::memory(state, &mut checker, inst, check, instr.index);
            }
        }
        state.checker = Some(checker);
    }
}

/// The invocations of the batch that are in the mask or that are not: each with
/// its workgroup, counted from the batch's first, in the order of lanes.
pub(super) fn invocations<N: Number>(
    state: &State<'_, N>,
    mask: Option<Slot>,
    inside: bool,
) -> Vec<(u32, u32)> {
    let wanted = if inside { 0 } else { u32::MAX };
    let mut found = Vec::new();
    for chunk in 0..state.chunks {
        let mask: [u32; LANES] = mask.map_or([u32::MAX; LANES], |mask| state.ints(mask, chunk));
        let local = state.local_chunk(chunk);
        let active = &state.local_ids.active[local].0;
        let ids = &state.local_ids.ids[3][local].0;
        let workgroup = state.group_in_batch(chunk);
        found.extend(
            (0..LANES)
                .filter(|&lane| active[lane] & (mask[lane] ^ wanted) != 0)
                .map(|lane| (workgroup, ids[lane])),
        );
    }
    found
}

/// Reports a barrier that some invocations do not reach.
fn barrier<N: Number>(
    state: &State<'_, N>,
    checker: &mut Checker<'_>,
    inst: &CodeInst,
    site: Site,
) {
    let missing = invocations(state, inst.mask, false);
    let here = invocations(state, inst.mask, true).len() as u32;
    let all = here + missing.len() as u32;
    for (_, invocation) in missing {
        checker.report(site, invocation, || Detail::Barrier { here, all });
    }
}

/// A loop has run too often: reports that and goes on, or fails.
pub(super) fn endless<N: Number>(
    state: &mut State<'_, N>,
    counter: u32,
    mask: Option<Slot>,
    limit: u32,
) -> Result<(), Failure> {
    let inside = invocations(state, mask, true);
    match &mut state.checker {
        Some(checker) if checker.checks.loops => {
            for (_, invocation) in inside {
                checker.report(Site::Loop(counter), invocation, || Detail::Loop { limit });
            }
            Ok(())
        }
        _ => {
            let (workgroup, invocation) = inside.into_iter().min().unwrap_or_default();
            Err(Failure::EndlessLoop {
                counter,
                workgroup,
                invocation,
            })
        }
    }
}

impl Checker<'_> {
    fn report(&mut self, site: Site, invocation: u32, detail: impl FnOnce() -> Detail) {
        self.collector.add(site, self.workgroup, invocation, detail);
    }
}
