//! What running a kernel took, instruction by instruction.
//!
//! The loop that runs bytecode is compiled twice: with [`Unwatched`], which is
//! nothing, and with [`Recorder`]. Which one runs is decided once per dispatch,
//! so that a profile that is not asked for costs nothing.
//!
//! The recorder reads the clock after every instruction, once: an instruction's
//! time is from one reading to the next, less what a reading takes, which is
//! measured beforehand. Counts and lanes are exact. Reading takes about as long
//! as a cheap instruction, so the times of those are good to some nanoseconds
//! only, and a profiled dispatch takes about twice as long as another.

use std::collections::BTreeMap;
use std::fmt;

use super::link::Instr;
use super::state::State;
use super::tier::{Handler, Ticks};
use crate::code::{Code, End, Slot};
use crate::error::Location;
use crate::num::Number;
use crate::registers::LANES;

/// Is told what a worker does.
pub(super) trait Watch<N: Number> {
    /// A batch begins.
    fn batch(&mut self, state: &State<'_, N>);
    /// A block begins.
    fn block(&mut self, state: &State<'_, N>, block: u32);
    /// Runs an instruction.
    fn run(&mut self, handler: Handler<N>, state: &mut State<'_, N>, instr: &Instr);
    /// A block has been chosen, after the instructions of another.
    fn turn(&mut self, state: &State<'_, N>, end: End, next: u32);
}

/// Does nothing but what has to be done.
pub(super) struct Unwatched;

impl<N: Number> Watch<N> for Unwatched {
    #[inline(always)]
    fn batch(&mut self, _: &State<'_, N>) {}
    #[inline(always)]
    fn block(&mut self, _: &State<'_, N>, _: u32) {}
    #[inline(always)]
    fn run(&mut self, handler: Handler<N>, state: &mut State<'_, N>, instr: &Instr) {
        handler.call(state, instr);
    }
    #[inline(always)]
    fn turn(&mut self, _: &State<'_, N>, _: End, _: u32) {}
}

/// What a block did.
#[derive(Clone, Copy, Debug, Default)]
struct BlockCount {
    executions: u64,
    active: u64,
    lanes: u64,
}

/// What was recorded of a kernel, of all its dispatches and workers.
#[derive(Clone, Debug, Default)]
pub(crate) struct Recording {
    blocks: Vec<BlockCount>,
    /// By instruction, overhead taken off.
    nanoseconds: Vec<f64>,
    overhead: f64,
    batches: u64,
}

impl Recording {
    /// Adds what a worker recorded.
    pub(super) fn add(&mut self, recorder: Recorder) {
        let tick = recorder.clock.nanoseconds_per_tick();
        let blocks = recorder.blocks.len();
        self.blocks.resize(blocks, BlockCount::default());
        for (sum, block) in self.blocks.iter_mut().zip(&recorder.blocks) {
            sum.executions += block.executions;
            sum.active += block.active;
            sum.lanes += block.lanes;
        }
        self.nanoseconds.resize(recorder.ticks.len(), 0.0);
        for (sum, ticks) in self.nanoseconds.iter_mut().zip(&recorder.ticks) {
            *sum += *ticks as f64 * tick;
        }
        self.overhead = recorder.overhead as f64 * tick;
        self.batches += recorder.batches;
    }

    /// The profile of a kernel.
    pub(crate) fn profile(
        &self,
        kernel: &str,
        code: &Code,
        locate: &dyn Fn(naga::Span) -> Location,
    ) -> Profile {
        let mut instructions = Vec::new();
        for (block, count) in code.blocks.iter().zip(&self.blocks) {
            for index in block.start..block.stop {
                let inst = &code.insts[index as usize];
                let measured = self.nanoseconds.get(index as usize).copied();
                let overhead = count.executions as f64 * self.overhead;
                instructions.push(ProfiledInstruction {
                    code: inst.to_string(),
                    operation: operation(&inst.op.to_string()),
                    location: locate(inst.span),
                    uniform: !inst
                        .results
                        .iter()
                        .flatten()
                        .chain(&inst.operands)
                        .any(|slot| slot.varying),
                    cost: Cost {
                        executions: count.executions,
                        active_lanes: count.active,
                        lanes: count.lanes,
                        nanoseconds: (measured.unwrap_or_default() - overhead).max(0.0),
                    },
                });
            }
        }
        Profile {
            kernel: kernel.to_owned(),
            batches: self.batches,
            overhead: self.overhead,
            instructions,
        }
    }
}

/// The mnemonic alone: what an instruction does, without on what.
fn operation(op: &str) -> String {
    op.split(' ').next().unwrap_or_default().to_owned()
}

/// Records what one worker does.
pub(super) struct Recorder {
    clock: Ticks,
    /// Of the last reading.
    last: u64,
    overhead: u64,
    ticks: Vec<u64>,
    blocks: Vec<BlockCount>,
    /// Lanes that hold an invocation.
    all: u64,
    /// Lanes active now.
    current: u64,
    /// By number of mask: in which round of [`Self::round`] it was seen, and
    /// its lanes then.
    masks: Vec<(u64, u64)>,
    round: u64,
    batches: u64,
}

impl Recorder {
    pub(super) fn new(code: &Code) -> Self {
        let clock = Ticks::start();
        let masks = code.blocks.iter().filter_map(|block| block.lanes).max();
        Self {
            overhead: overhead(),
            last: 0,
            ticks: vec![0; code.insts.len()],
            blocks: vec![BlockCount::default(); code.blocks.len()],
            all: 0,
            current: 0,
            masks: vec![(0, 0); masks.map_or(0, |most| most as usize + 1)],
            round: 0,
            batches: 0,
            clock,
        }
    }

    /// Notes the lanes of a mask.
    fn see(&mut self, mask: Option<u32>, lanes: u64) {
        if let Some(mask) = mask {
            self.masks[mask as usize] = (self.round, lanes);
        }
    }
}

/// Ticks that one reading of the clock takes: the median of many.
fn overhead() -> u64 {
    let mut last = Ticks::now();
    let mut gaps: Vec<u64> = (0..1001)
        .map(|_| {
            let now = Ticks::now();
            let gap = now.saturating_sub(last);
            last = now;
            gap
        })
        .collect();
    gaps.sort_unstable();
    gaps[gaps.len() / 2]
}

/// Lanes set in a mask.
fn count<N: Number>(state: &State<'_, N>, mask: Slot) -> u64 {
    (0..state.chunks)
        .map(|chunk| {
            let lanes = state.ints::<LANES>(mask, chunk);
            lanes.iter().filter(|&&lane| lane != 0).count() as u64
        })
        .sum()
}

impl<N: Number> Watch<N> for Recorder {
    fn batch(&mut self, state: &State<'_, N>) {
        self.round += 1;
        self.batches += 1;
        self.all = state.invocations();
        self.current = self.all;
        self.last = Ticks::now();
    }

    fn block(&mut self, state: &State<'_, N>, block: u32) {
        self.current = match state.code.blocks[block as usize].lanes {
            None => self.all,
            Some(mask) => match self.masks[mask as usize] {
                (round, lanes) if round == self.round => lanes,
                // Not decided on yet: as before it.
                _ => self.current,
            },
        };
        let count = &mut self.blocks[block as usize];
        count.executions += 1;
        count.active += self.current;
        count.lanes += (state.chunks * LANES) as u64;
        self.last = Ticks::now();
    }

    fn run(&mut self, handler: Handler<N>, state: &mut State<'_, N>, instr: &Instr) {
        handler.call(state, instr);
        let now = Ticks::now();
        self.ticks[instr.index as usize] += now.saturating_sub(self.last);
        self.last = now;
    }

    fn turn(&mut self, state: &State<'_, N>, end: End, next: u32) {
        let lanes = state.code.blocks[next as usize].lanes;
        match end {
            End::Any { mask, yes, .. } if yes == next => {
                let count = count(state, mask);
                self.see(lanes, count);
            }
            End::Enter { .. } | End::Again { .. } => {
                if matches!(end, End::Enter { .. }) {
                    self.see(lanes, self.current);
                }
                // What was decided inside in the iteration before is void.
                // Inner masks have greater numbers.
                let inner = lanes.map_or(0, |mask| mask as usize + 1);
                self.masks[inner..].fill((0, 0));
            }
            _ => {}
        }
    }
}

/// What something cost.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// How often it was executed, each time on all lanes of a batch.
    pub executions: u64,
    /// Lanes that hold an invocation and were active, over all executions.
    pub active_lanes: u64,
    /// Lanes, over all executions.
    pub lanes: u64,
    /// Time, over all executions and workers.
    pub nanoseconds: f64,
}

impl Cost {
    fn add(&mut self, other: &Self) {
        self.executions += other.executions;
        self.active_lanes += other.active_lanes;
        self.lanes += other.lanes;
        self.nanoseconds += other.nanoseconds;
    }

    /// The part of lanes that were active, in `[0, 1]`; 0 if nothing ran.
    #[must_use]
    pub fn active_share(&self) -> f64 {
        if self.lanes == 0 {
            return 0.0;
        }
        self.active_lanes as f64 / self.lanes as f64
    }

    /// Nanoseconds of one execution; 0 if nothing ran.
    #[must_use]
    pub fn nanoseconds_each(&self) -> f64 {
        if self.executions == 0 {
            return 0.0;
        }
        self.nanoseconds / self.executions as f64
    }
}

/// What an instruction of a kernel cost.
#[derive(Clone, Debug, PartialEq)]
pub struct ProfiledInstruction {
    /// As [`Program`](crate::Program) lists it.
    pub code: String,
    /// Its mnemonic.
    pub operation: String,
    /// The expression or statement it comes from.
    pub location: Location,
    /// Whether it works on single numbers, which all invocations share.
    pub uniform: bool,
    /// The sum over executions.
    pub cost: Cost,
}

/// What a kernel's instructions cost, in all dispatches since profiling began.
///
/// What runs once per worker and dispatch, before any workgroup, is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    /// The kernel's name.
    pub kernel: String,
    /// Batches run.
    pub batches: u64,
    /// Nanoseconds that a reading of the clock took, which each execution's
    /// time has been reduced by.
    pub overhead: f64,
    /// In the order of the code.
    pub instructions: Vec<ProfiledInstruction>,
}

impl Profile {
    /// The cost of everything.
    #[must_use]
    pub fn total(&self) -> Cost {
        let mut total = Cost::default();
        for instruction in &self.instructions {
            total.add(&instruction.cost);
        }
        total
    }

    /// By operation, the most expensive first. Operations on single numbers are
    /// apart, marked by a `u.` before them.
    #[must_use]
    pub fn by_operation(&self) -> Vec<(String, Cost)> {
        self.by(|instruction| {
            let prefix = if instruction.uniform { "u." } else { "" };
            format!("{prefix}{}", instruction.operation)
        })
    }

    /// By source line, `file:line`, the most expensive first.
    #[must_use]
    pub fn by_line(&self) -> Vec<(String, Cost)> {
        self.by(|instruction| {
            let Location { file, line, .. } = &instruction.location;
            format!("{file}:{line}")
        })
    }

    fn by(&self, key: impl Fn(&ProfiledInstruction) -> String) -> Vec<(String, Cost)> {
        let mut costs: BTreeMap<String, Cost> = BTreeMap::new();
        for instruction in &self.instructions {
            costs
                .entry(key(instruction))
                .or_default()
                .add(&instruction.cost);
        }
        let mut costs: Vec<_> = costs.into_iter().collect();
        costs.sort_by(|(_, a), (_, b)| b.nanoseconds.total_cmp(&a.nanoseconds));
        costs
    }
}

impl fmt::Display for Profile {
    /// The code with what each instruction cost.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "; {}: {} batches, {:.1} ns taken off each execution",
            self.kernel, self.batches, self.overhead
        )?;
        for instruction in &self.instructions {
            let cost = &instruction.cost;
            writeln!(
                f,
                "{:>12} × {:>9.1} ns {:>5.1} %  {}  ; {}",
                cost.executions,
                cost.nanoseconds_each(),
                100.0 * cost.active_share(),
                instruction.code,
                instruction.location
            )?;
        }
        Ok(())
    }
}
