//! A program's instructions as calls.

use super::arith::{self, Select};
use super::lanes::BLOCK;
use super::profile::Watch;
use super::state::{Failure, State};
use super::tier::{Handler, Step, Tier};
use super::{
    chain, check, half, image, memory, perturb, probe, sample, stage, subgroup, texel_atomic,
};
use crate::code::{Code, CodeInst, End};
use crate::ir::{Input, Op};
use crate::num::Number;

/// The registers of a simple instruction, and where the whole one is found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instr {
    pub(super) d: u16,
    pub(super) a: u16,
    pub(super) b: u16,
    /// Third operand, or the mask of a copy.
    pub(super) c: u16,
    /// Fourth operand.
    pub(super) e: u16,
    /// A bit for each of the four that is a register of lanes.
    varying: u8,
    /// Whether no other in the kernel reads or writes the same texture before it, and
    /// no loop repeats it.
    pub(super) first: bool,
    /// Index in [`Code::insts`].
    pub(super) index: u32,
}

/// An operand of a simple instruction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Operand {
    pub(super) number: u16,
    /// Whether it is a register of lanes.
    pub(super) varying: bool,
}

impl Instr {
    /// The operand at a place from 0 to 3; the mask of a copy is at 2.
    #[inline(always)]
    pub(super) fn operand(&self, place: usize) -> Operand {
        Operand {
            number: [self.a, self.b, self.c, self.e][place],
            varying: self.varying >> place & 1 != 0,
        }
    }
}

impl Instr {
    /// This one for a chain, whose operands begin at this place of
    /// [`Code::operands`]: all of them next to each other and to those of others,
    /// since reading them where each instruction keeps its own leaves less of the
    /// nearest cache to lanes.
    fn of_chain(self, at: u32) -> Self {
        Self {
            a: at as u16,
            b: (at >> 16) as u16,
            ..self
        }
    }

    /// Where a chain's operands begin.
    #[inline(always)]
    pub(super) fn chain_operands(&self) -> usize {
        usize::from(self.a) | usize::from(self.b) << 16
    }
}

/// A program linked to the handlers of an instruction set.
#[derive(Debug)]
pub(crate) struct Linked<N: Number> {
    calls: Vec<(Handler<N>, Instr)>,
    /// Whether any lane of a mask is set.
    any: Handler<N>,
}

impl<N: Number> Linked<N> {
    pub(crate) fn new(code: &Code, tier: Tier) -> Self {
        let first = first_of_texture(code);
        let mut chained = 0;
        let calls = code
            .insts
            .iter()
            .enumerate()
            .map(|(index, inst)| {
                let slot = |i: usize| match inst.mask {
                    Some(mask) if i == 2 => Some(mask),
                    _ => inst.operands.get(i).copied(),
                };
                let operand = |i: usize| slot(i).map_or(0, |slot| slot.number);
                let varying = |i: usize| u8::from(slot(i).is_some_and(|slot| slot.varying)) << i;
                let instr = Instr {
                    d: inst
                        .results
                        .first()
                        .copied()
                        .flatten()
                        .map_or(0, |slot| slot.number),
                    a: operand(0),
                    b: operand(1),
                    c: operand(2),
                    e: operand(3),
                    varying: varying(0) | varying(1) | varying(2) | varying(3),
                    first: first[index],
                    index: index as u32,
                };
                let instr = match inst.op {
                    Op::Chain(_) => {
                        let at = chained;
                        chained += inst.operands.len() as u32;
                        instr.of_chain(at)
                    }
                    _ => instr,
                };
                (handler(inst, tier), instr)
            })
            .collect();
        Self {
            calls,
            any: Handler::new::<Any>(tier),
        }
    }

    /// Runs the instructions that fill the uniform registers once per worker.
    pub(super) fn run_prologue(&self, state: &mut State<'_, N>) {
        for (handler, instr) in &self.calls[..state.code.prologue as usize] {
            handler.call(state, instr);
        }
    }

    /// Runs one batch.
    pub(super) fn run<W: Watch<N>>(
        &self,
        state: &mut State<'_, N>,
        max_trips: u32,
        watch: &mut W,
    ) -> Result<(), Failure> {
        let code = state.code;
        let mut next = 0_u32;
        watch.batch(state);
        loop {
            let block = code.blocks[next as usize];
            watch.block(state, next);
            for (handler, instr) in &self.calls[block.start as usize..block.stop as usize] {
                watch.run(*handler, state, instr);
            }
            next = match block.end {
                End::Jump(next) => next,
                End::Branch { condition, yes, no } => {
                    if state.registers.uniform_ints[usize::from(condition.number)] != 0 {
                        yes
                    } else {
                        no
                    }
                }
                End::Any { mask, yes, no } => {
                    let some = if mask.varying {
                        let test = Instr {
                            a: mask.number,
                            ..Instr::default()
                        };
                        self.any.call(state, &test);
                        state.any
                    } else {
                        state.registers.uniform_ints[usize::from(mask.number)] != 0
                    };
                    if some { yes } else { no }
                }
                End::Enter { counter, head } => {
                    state.trips[counter as usize] = 0;
                    head
                }
                End::Again {
                    counter,
                    head,
                    end,
                    mask,
                } => {
                    let trips = &mut state.trips[counter as usize];
                    *trips += 1;
                    if *trips >= max_trips {
                        check::endless(state, counter, mask, max_trips)?;
                        end
                    } else {
                        head
                    }
                }
                End::Stop => break,
            };
            watch.turn(state, block.end, next);
        }
        match state.failure.take() {
            Some(failure) => Err(failure),
            None => Ok(()),
        }
    }
}

/// Of each instruction whether it is the first load or store of a texture, outside of
/// loops.
fn first_of_texture(code: &Code) -> Vec<bool> {
    let mut first = vec![false; code.insts.len()];
    let mut seen = Vec::new();
    for (index, inst) in code.insts.iter().enumerate() {
        if let Op::ImageLoad { access, .. } | Op::ImageStore { access, .. } = inst.op
            && !seen.contains(&access.image)
        {
            seen.push(access.image);
            first[index] = true;
        }
    }
    for (last, block) in code.blocks.iter().enumerate() {
        if let End::Again { head, .. } = block.end {
            for block in code.blocks.get(head as usize..=last).unwrap_or_default() {
                first[block.start as usize..block.stop as usize].fill(false);
            }
        }
    }
    first
}

fn handler<N: Number>(inst: &CodeInst, tier: Tier) -> Handler<N> {
    let varying_result = inst.results.iter().flatten().any(|slot| slot.varying);
    match inst.op {
        Op::Arith(op) => {
            let varying: Vec<bool> = inst.operands.iter().map(|slot| slot.varying).collect();
            let op = if tier == Tier::Baseline {
                op.on_baseline()
            } else {
                op
            };
            op.visit(Select {
                tier,
                varying: &varying,
            })
        }
        Op::Chain(op) => op.visit(chain::Select { tier }),
        Op::Move(class) => arith::copy(
            tier,
            class,
            inst.operands[0].varying,
            varying_result,
            inst.mask.is_some(),
        ),
        Op::Input(Input::Stage(_)) => Handler::new::<stage::StageInputStep>(tier),
        Op::Input(_) if varying_result => Handler::new::<memory::InputStep>(tier),
        Op::Input(_) => Handler::plain::<memory::InputStep>(),
        Op::Table { .. } => memory::table(tier, varying_result),
        Op::BufferLoad { .. } => memory::buffer_load(tier, varying_result),
        Op::BufferStore { .. } => Handler::new::<memory::BufferStore>(tier),
        Op::BufferStoreHalf { .. } => Handler::plain::<half::BufferStoreHalf>(),
        Op::BufferLength { .. } => Handler::plain::<memory::BufferLength>(),
        Op::BufferAtomic { .. } => Handler::plain::<memory::BufferAtomic>(),
        Op::MemoryLoad { .. } => memory::memory_load(tier, varying_result),
        Op::MemoryStore { .. } => Handler::new::<memory::MemoryStore>(tier),
        Op::WorkgroupAtomic { .. } => Handler::plain::<memory::WorkgroupAtomic>(),
        Op::ImageLoad { .. } => image::load(tier, varying_result),
        Op::ImageStore { .. } => Handler::tiered::<image::Store>(tier),
        Op::ImageSample { .. } => sample::sample(tier, varying_result),
        Op::ImageGather { .. } => sample::gather(tier, varying_result),
        Op::ImageAtomic { .. } => Handler::plain::<texel_atomic::ImageAtomic>(),
        Op::ImageQuery { .. } => image::query(tier, varying_result),
        Op::Derivative { .. } => stage::derivative(tier, varying_result),
        Op::StageOutput { .. } => Handler::new::<stage::Output>(tier),
        Op::Subgroup { .. } => Handler::plain::<subgroup::Subgroup>(),
        Op::Barrier => Handler::plain::<Barrier>(),
        Op::Check(_) => Handler::plain::<check::CheckStep>(),
        Op::Probe(_) => Handler::plain::<probe::ProbeStep>(),
        Op::Perturb(_) => Handler::plain::<perturb::Perturb>(),
    }
}

/// Whether any lane of a mask is set.
struct Any;

impl<N: Number> Step<N> for Any {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let mut all = [0; BLOCK];
        for chunk in 0..state.chunks {
            let (blocks, _) = state.registers.ints[state.at(instr.a, chunk)]
                .0
                .as_chunks::<BLOCK>();
            for block in blocks {
                for k in 0..BLOCK {
                    all[k] |= block[k];
                }
            }
        }
        state.any = all.iter().fold(0, |all, lane| all | lane) != 0;
    }
}

/// Notes a failure unless every invocation of the workgroup is active.
struct Barrier;

impl<N: Number> Step<N> for Barrier {
    #[inline(always)]
    fn run(state: &mut State<'_, N>, instr: &Instr) {
        let inst = state.inst(instr.index);
        let missing = check::invocations(state, inst.mask, false);
        if let Some((_, invocation)) = missing.into_iter().min() {
            state.failure.get_or_insert(Failure::DivergentBarrier {
                inst: instr.index,
                invocation,
            });
        }
    }
}
