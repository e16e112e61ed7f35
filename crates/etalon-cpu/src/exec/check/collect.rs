//! What workers found, before it has names.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::atomic::AtomicU32;

use super::Shadow;
use crate::finding::FindingKind;
use crate::ir::Indexed;
use crate::memory::written;

/// Which part of a program found something.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Site {
    /// By the instruction's index.
    Inst(u32),
    /// By the loop's number.
    Loop(u32),
}

/// An earlier use of memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Use {
    pub(crate) invocation: u32,
    /// The instruction's index.
    pub(crate) inst: u32,
}

/// A piece of memory.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Part {
    Private,
    Workgroup,
    /// Binding and word.
    Word(u16, u32),
    /// Binding, coordinates and how many there are.
    Texel(u16, [i64; 3], usize),
    /// Binding of a sampled texture.
    Sample(u16),
}

/// What was wrong, with the values of one invocation.
#[derive(Clone, Debug)]
pub(crate) enum Detail {
    Index {
        of: Indexed,
        index: i64,
        length: u32,
    },
    Texel {
        at: [i64; 3],
        size: [u32; 3],
        axes: usize,
    },
    Level {
        level: i32,
        levels: u32,
    },
    Layer {
        layer: i32,
        layers: u32,
    },
    Unwritten(Part),
    Race {
        part: Part,
        writes: bool,
        other: Use,
        other_writes: bool,
    },
    Barrier {
        here: u32,
        all: u32,
    },
    Loop {
        limit: u32,
    },
    DivisionByZero {
        dividend: i64,
    },
    DivisionOverflow,
    Shift {
        amount: u32,
    },
    Conversion {
        value: f32,
        signed: bool,
    },
    NonFinite {
        result: f32,
        operands: Vec<f32>,
    },
}

impl Detail {
    pub(crate) fn kind(&self) -> FindingKind {
        match self {
            Self::Index { .. } => FindingKind::Index,
            Self::Texel { .. } => FindingKind::Texel,
            Self::Level { .. } => FindingKind::Level,
            Self::Layer { .. } => FindingKind::Layer,
            Self::Unwritten(_) => FindingKind::Uninitialised,
            Self::Race { .. } => FindingKind::Race,
            Self::Barrier { .. } => FindingKind::DivergentBarrier,
            Self::Loop { .. } => FindingKind::EndlessLoop,
            Self::DivisionByZero { .. } => FindingKind::DivisionByZero,
            Self::DivisionOverflow => FindingKind::DivisionOverflow,
            Self::Shift { .. } => FindingKind::Shift,
            Self::Conversion { .. } => FindingKind::Conversion,
            Self::NonFinite { .. } => FindingKind::NonFinite,
        }
    }
}

/// What a site found of one kind.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) count: u64,
    /// The first, by workgroup, then invocation, then time.
    pub(crate) workgroup: u64,
    pub(crate) invocation: u32,
    pub(crate) detail: Detail,
}

/// A word or texel that a workgroup read before anything was seen to write it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Candidate {
    inst: u32,
    workgroup: u64,
    binding: u16,
    index: u32,
}

/// Everything found so far.
#[derive(Debug, Default)]
pub(crate) struct Collector {
    found: BTreeMap<(Site, FindingKind), Found>,
    /// How often, by which invocation first, and what.
    candidates: BTreeMap<Candidate, (u64, u32, Part)>,
}

impl Collector {
    pub(crate) fn add(
        &mut self,
        site: Site,
        workgroup: u64,
        invocation: u32,
        detail: impl FnOnce() -> Detail,
    ) {
        let detail = detail();
        self.add_many(site, workgroup, invocation, 1, detail);
    }

    fn add_many(
        &mut self,
        site: Site,
        workgroup: u64,
        invocation: u32,
        count: u64,
        detail: Detail,
    ) {
        self.merge(
            (site, detail.kind()),
            Found {
                count,
                workgroup,
                invocation,
                detail,
            },
        );
    }

    fn merge(&mut self, key: (Site, FindingKind), new: Found) {
        match self.found.entry(key) {
            Entry::Vacant(entry) => {
                entry.insert(new);
            }
            Entry::Occupied(mut entry) => {
                let old = entry.get_mut();
                let count = old.count.saturating_add(new.count);
                if (new.workgroup, new.invocation) < (old.workgroup, old.invocation) {
                    *old = new;
                }
                old.count = count;
            }
        }
    }

    /// Notes a read of a word of a writable resource that nothing wrote so far.
    pub(crate) fn add_candidate(
        &mut self,
        inst: u32,
        workgroup: u64,
        invocation: u32,
        (binding, index): (u16, u32),
        part: Part,
    ) {
        let key = Candidate {
            inst,
            workgroup,
            binding,
            index,
        };
        let (count, first, first_part) =
            self.candidates.entry(key).or_insert((0, invocation, part));
        *count += 1;
        if invocation < *first {
            (*first, *first_part) = (invocation, part);
        }
    }

    /// Adds what another worker found.
    pub(crate) fn append(&mut self, other: Self) {
        for (key, found) in other.found {
            self.merge(key, found);
        }
        // A workgroup is run by one worker, so these are of different workgroups.
        self.candidates.extend(other.candidates);
    }

    /// Decides on the candidates once all workgroups have run, and gives what was found.
    pub(crate) fn finish(mut self, shadows: &[Shadow<'_>]) -> BTreeMap<(Site, FindingKind), Found> {
        let word = |binding: u16, index: u32| -> Option<&AtomicU32> {
            shadows
                .get(usize::from(binding))?
                .words?
                .get(index as usize)
        };
        for (candidate, (count, invocation, part)) in std::mem::take(&mut self.candidates) {
            let unwritten = word(candidate.binding, candidate.index)
                .is_some_and(|word| written::was_unwritten(word, candidate.workgroup));
            if unwritten {
                self.add_many(
                    Site::Inst(candidate.inst),
                    candidate.workgroup,
                    invocation,
                    count,
                    Detail::Unwritten(part),
                );
            }
        }
        self.found
    }
}
