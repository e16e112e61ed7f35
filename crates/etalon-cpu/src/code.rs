//! Bytecode: instructions on numbered registers, in blocks.

use std::fmt;

use naga::Span;

use crate::ir::{Op, Resources};
use crate::lower::{Allocation, BlockId, Flat, FlatInst, Reg, Terminator};
use crate::registers::Class;
use crate::translate::Fail;

/// A register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Slot {
    pub(crate) class: Class,
    /// One number per lane, not one for all.
    pub(crate) varying: bool,
    pub(crate) number: u16,
}

impl fmt::Display for Slot {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = match (self.class, self.varying) {
            (Class::Float, true) => "f",
            (Class::Int, true) => "i",
            (Class::Float, false) => "uf",
            (Class::Int, false) => "ui",
        };
        write!(f, "{file}{}", self.number)
    }
}

/// One instruction.
#[derive(Clone, Debug)]
pub(crate) struct CodeInst {
    pub(crate) op: Op,
    pub(crate) results: Vec<Option<Slot>>,
    pub(crate) operands: Vec<Slot>,
    pub(crate) mask: Option<Slot>,
    pub(crate) span: Span,
}

/// What comes after a block, by block indices.
#[derive(Clone, Copy, Debug)]
pub(crate) enum End {
    Jump(u32),
    Branch {
        condition: Slot,
        yes: u32,
        no: u32,
    },
    Any {
        mask: Slot,
        yes: u32,
        no: u32,
    },
    Enter {
        counter: u32,
        head: u32,
    },
    Again {
        counter: u32,
        head: u32,
        end: u32,
        mask: Option<Slot>,
    },
    Stop,
}

/// Consecutive instructions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CodeBlock {
    pub(crate) start: u32,
    pub(crate) stop: u32,
    pub(crate) end: End,
    /// Which lanes are active in it: the number of a mask, or none for all.
    pub(crate) lanes: Option<u32>,
}

/// A whole program.
#[derive(Clone, Debug, Default)]
pub(crate) struct Code {
    /// Those of the prologue first.
    pub(crate) insts: Vec<CodeInst>,
    pub(crate) prologue: u32,
    pub(crate) blocks: Vec<CodeBlock>,
    /// Of each chain in turn the numbers of its operands' registers.
    pub(crate) operands: Vec<u16>,
    /// Uniform registers that hold literals.
    pub(crate) constants: Vec<(Slot, u32)>,
    pub(crate) loops: Vec<Span>,
    pub(crate) resources: Resources,
    /// See [`crate::ir::Tree::independent`].
    pub(crate) independent: bool,
    /// Registers in each file: floats and integers of lanes, then single ones.
    pub(crate) files: [u32; 4],
}

impl Code {
    pub(crate) fn new(flat: &Flat, allocation: &Allocation) -> Result<Self, Fail> {
        let files = [
            allocation.varying_float,
            allocation.varying_int,
            allocation.uniform_float,
            allocation.uniform_int,
        ];
        for size in files {
            if size > u32::from(u16::MAX) {
                return Err(Fail::TooLarge {
                    what: "number of registers",
                    size: size.into(),
                    limit: u16::MAX.into(),
                });
            }
        }
        let slot = |reg: Reg| {
            let info = flat.regs[reg.0 as usize];
            // Checked above; registers that are mentioned have numbers.
            let number = allocation.numbers[reg.0 as usize].unwrap_or(0) as u16;
            Slot {
                class: info.class,
                varying: info.varying,
                number,
            }
        };
        let inst = |inst: &FlatInst| CodeInst {
            op: inst.op,
            results: inst.results.iter().map(|result| result.map(slot)).collect(),
            operands: inst.operands.iter().copied().map(slot).collect(),
            mask: inst.mask.map(slot),
            span: inst.span,
        };
        let mut code = Self {
            loops: flat.loops.clone(),
            resources: flat.resources.clone(),
            independent: flat.independent,
            files,
            ..Self::default()
        };
        code.insts.extend(flat.prologue.iter().map(inst));
        code.prologue = code.insts.len() as u32;
        for block in &flat.blocks {
            let start = code.insts.len() as u32;
            code.insts.extend(block.insts.iter().map(inst));
            let at = |block: BlockId| block.0;
            let end = match block.end {
                Terminator::Jump(next) => End::Jump(at(next)),
                Terminator::Branch { condition, yes, no } => End::Branch {
                    condition: slot(condition),
                    yes: at(yes),
                    no: at(no),
                },
                Terminator::Any { mask, yes, no } => End::Any {
                    mask: slot(mask),
                    yes: at(yes),
                    no: at(no),
                },
                Terminator::Enter { counter, head } => End::Enter {
                    counter,
                    head: at(head),
                },
                Terminator::Again {
                    counter,
                    head,
                    end,
                    mask,
                } => End::Again {
                    counter,
                    head: at(head),
                    end: at(end),
                    mask: mask.map(slot),
                },
                Terminator::End => End::Stop,
            };
            code.blocks.push(CodeBlock {
                start,
                stop: code.insts.len() as u32,
                end,
                lanes: block.lanes,
            });
        }
        let chains = |inst: &&CodeInst| matches!(inst.op, Op::Chain(_));
        let operands = code
            .insts
            .iter()
            .filter(chains)
            .flat_map(|inst| &inst.operands);
        code.operands = operands.map(|slot| slot.number).collect();
        for (i, info) in flat.regs.iter().enumerate() {
            if let (Some(bits), Some(_)) = (info.constant, allocation.numbers[i]) {
                code.constants.push((slot(Reg(i as u32)), bits));
            }
        }
        Ok(code)
    }

    /// Whether invocations may go apart in a loop, or leave it one by one.
    pub(crate) fn has_divergent_loop(&self) -> bool {
        self.blocks.iter().enumerate().any(|(last, block)| {
            let End::Again { head, .. } = block.end else {
                return false;
            };
            let of_lanes = |block: &CodeBlock| match block.end {
                End::Any { mask, .. } => mask.varying,
                _ => false,
            };
            let body = self.blocks.get(head as usize..=last);
            body.is_some_and(|body| body.iter().any(of_lanes))
        })
    }

    /// Whether results may depend on the order in which workgroups run: an
    /// atomic operation's old value is used, or one that does not commute.
    pub(crate) fn depends_on_order(&self) -> bool {
        use crate::ir::AtomicFunction as A;
        self.insts.iter().any(|inst| match inst.op {
            Op::BufferAtomic { function, .. } => {
                matches!(function, A::Exchange | A::CompareExchange)
                    || inst.results.iter().any(Option::is_some)
            }
            _ => false,
        })
    }
}

impl fmt::Display for CodeInst {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, result) in self.results.iter().enumerate() {
            f.write_str(if i > 0 { ", " } else { "" })?;
            match result {
                Some(slot) => write!(f, "{slot}")?,
                None => f.write_str("_")?,
            }
        }
        f.write_str(if self.results.is_empty() { "" } else { " = " })?;
        write!(f, "{}", self.op)?;
        for (i, operand) in self.operands.iter().enumerate() {
            write!(f, "{}{operand}", if i > 0 { ", " } else { " " })?;
        }
        match self.mask {
            Some(mask) => write!(f, " where {mask}"),
            None => Ok(()),
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [vf, vi, uf, ui] = self.files;
        writeln!(f, "; registers: {vf} f, {vi} i, {uf} uf, {ui} ui")?;
        for (slot, bits) in &self.constants {
            match slot.class {
                Class::Float => writeln!(f, "; {slot} = {}", f32::from_bits(*bits))?,
                Class::Int => writeln!(f, "; {slot} = {bits:#x}")?,
            }
        }
        writeln!(f, "prologue:")?;
        for inst in &self.insts[..self.prologue as usize] {
            writeln!(f, "    {inst}")?;
        }
        for (i, block) in self.blocks.iter().enumerate() {
            writeln!(f, "{i}:")?;
            for inst in &self.insts[block.start as usize..block.stop as usize] {
                writeln!(f, "    {inst}")?;
            }
            match block.end {
                End::Jump(next) => writeln!(f, "    jump {next}")?,
                End::Branch { condition, yes, no } => {
                    writeln!(f, "    if {condition} jump {yes} else {no}")?
                }
                End::Any { mask, yes, no } => writeln!(f, "    any {mask} jump {yes} else {no}")?,
                End::Enter { counter, head } => writeln!(f, "    enter loop {counter} at {head}")?,
                End::Again { counter, head, .. } => {
                    writeln!(f, "    repeat loop {counter} at {head}")?
                }
                End::Stop => writeln!(f, "    end")?,
            }
        }
        Ok(())
    }
}
