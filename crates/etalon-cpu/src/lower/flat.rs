//! Linear code over virtual registers.

use naga::Span;

use crate::ir::{Class, Op, Resources};

/// A virtual register.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Reg(pub(crate) u32);

/// What is known of a register.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RegInfo {
    pub(crate) class: Class,
    /// One number per lane, not one for all.
    pub(crate) varying: bool,
    /// The bits it holds from the start, for literals.
    pub(crate) constant: Option<u32>,
}

/// An instruction on registers.
#[derive(Clone, Debug)]
pub(crate) struct FlatInst {
    pub(crate) op: Op,
    pub(crate) results: Vec<Option<Reg>>,
    pub(crate) operands: Vec<Reg>,
    /// Lanes that take part, for instructions that ask; all without it.
    pub(crate) mask: Option<Reg>,
    pub(crate) span: Span,
}

/// A block's index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct BlockId(pub(crate) u32);

/// What comes after a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Terminator {
    Jump(BlockId),
    /// On a uniform condition.
    Branch {
        condition: Reg,
        yes: BlockId,
        no: BlockId,
    },
    /// On whether any lane of a mask is set.
    Any {
        mask: Reg,
        yes: BlockId,
        no: BlockId,
    },
    /// Into a loop: its trips are counted from zero.
    Enter {
        counter: u32,
        head: BlockId,
    },
    /// Around a loop, or to its end if it has run too often. The mask is of the
    /// lanes that are still in it.
    Again {
        counter: u32,
        head: BlockId,
        end: BlockId,
        mask: Option<Reg>,
    },
    End,
}

impl Terminator {
    pub(crate) fn successors(self) -> impl Iterator<Item = BlockId> {
        let (first, second) = match self {
            Self::Jump(block) | Self::Enter { head: block, .. } => (Some(block), None),
            Self::Branch { yes, no, .. } | Self::Any { yes, no, .. } => (Some(yes), Some(no)),
            Self::Again { head, end, .. } => (Some(head), Some(end)),
            Self::End => (None, None),
        };
        first.into_iter().chain(second)
    }

    pub(crate) fn operand(self) -> Option<Reg> {
        match self {
            Self::Branch { condition: reg, .. } | Self::Any { mask: reg, .. } => Some(reg),
            Self::Again { mask, .. } => mask,
            _ => None,
        }
    }

    pub(crate) fn operand_mut(&mut self) -> Option<&mut Reg> {
        match self {
            Self::Branch { condition: reg, .. } | Self::Any { mask: reg, .. } => Some(reg),
            Self::Again { mask, .. } => mask.as_mut(),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) insts: Vec<FlatInst>,
    pub(crate) end: Terminator,
    /// Which lanes are active in it: the number of a mask, or none for all.
    /// Masks have numbers of their own, since none need be kept in a register;
    /// those inside of others have the greater ones.
    pub(crate) lanes: Option<u32>,
}

/// A kernel as linear code. Blocks are in the order of the source, so a jump
/// backwards is around a loop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Flat {
    pub(crate) regs: Vec<RegInfo>,
    pub(crate) prologue: Vec<FlatInst>,
    pub(crate) blocks: Vec<Block>,
    /// Where each counted loop is.
    pub(crate) loops: Vec<Span>,
    pub(crate) resources: Resources,
    /// See [`crate::ir::Tree::independent`].
    pub(crate) independent: bool,
}
