//! From the tree to bytecode: what is dead, what is uniform, masks, blocks,
//! registers.

mod allocate;
mod chains;
mod coalesce;
mod flat;
mod flatten;
mod fuse;
mod limits;
mod liveness;
mod numbers;
mod uniform;

pub(crate) use allocate::{Allocation, allocate};
pub(crate) use flat::{BlockId, Flat, FlatInst, Reg, Terminator};

use crate::ir::Tree;

/// Makes linear code of a tree. `partial` says that some lanes hold no invocation.
pub(crate) fn lower(mut tree: Tree, partial: bool) -> Flat {
    liveness::prune(&mut tree);
    let uniformity = uniform::analyse(&tree);
    let mut flat = flatten::flatten(&tree, &uniformity, partial);
    numbers::compare_numbers(&mut flat);
    fuse::superinstructions(&mut flat);
    limits::limit_numbers(&mut flat);
    chains::join(&mut flat);
    coalesce::coalesce(&mut flat);
    flat
}
