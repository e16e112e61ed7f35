//! Shadows of private and workgroup memory: what is written, and who used what
//! since the last barrier.

use std::collections::HashMap;

use super::{Checker, Detail, Part, Site, Use, int, lanes};
use crate::code::CodeInst;
use crate::exec::state::State;
use crate::ir::{Access, Memory, Slots};
use crate::num::Number;
use crate::registers::Class;

/// Who used a word since the last barrier, other than by atomic operations.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Users {
    writer: Option<Use>,
    reader: Option<Use>,
    /// One by another invocation than `reader`.
    other_reader: Option<Use>,
}

impl Users {
    /// Notes a use; gives an earlier one that is not ordered before it, and
    /// whether that was a write.
    pub(super) fn access(&mut self, access: Access, by: Use) -> Option<(Use, bool)> {
        let others = |other: &Use| other.invocation != by.invocation;
        let written = self.writer.filter(others).map(|other| (other, true));
        match access {
            Access::Read => {
                match self.reader {
                    None => self.reader = Some(by),
                    Some(first) if first.invocation != by.invocation => {
                        self.other_reader.get_or_insert(by);
                    }
                    Some(_) => {}
                }
                written
            }
            Access::Write => {
                let read = [self.reader, self.other_reader]
                    .into_iter()
                    .flatten()
                    .find(others)
                    .map(|other| (other, false));
                self.writer = Some(by);
                written.or(read)
            }
            Access::Atomic { .. } => None,
        }
    }
}

/// Shadow of workgroup memory of a class.
#[derive(Debug, Default)]
pub(super) struct Words {
    written: Vec<bool>,
    users: Vec<Users>,
}

impl Words {
    pub(super) fn new(count: usize) -> Self {
        Self {
            written: vec![false; count],
            users: vec![Users::default(); count],
        }
    }

    pub(super) fn reset(&mut self) {
        self.written.fill(false);
        self.order();
    }

    fn order(&mut self) {
        self.users.fill(Users::default());
    }
}

/// Who used words of buffers or texels of textures, by binding and index.
pub(super) type Uses = HashMap<(u16, u32), Users>;

const CLASSES: [Class; 2] = [Class::Float, Class::Int];

impl Checker<'_> {
    /// After a barrier.
    pub(super) fn order(&mut self, workgroup: bool, storage: bool, texture: bool) {
        if workgroup {
            self.words.iter_mut().for_each(Words::order);
        }
        if storage {
            self.buffers.clear();
        }
        if texture {
            self.texels.clear();
        }
    }

    /// Slots of private memory hold no value any more.
    pub(super) fn forget<N: Number>(
        &mut self,
        state: &State<'_, N>,
        inst: &CodeInst,
        first: Slots,
        count: Slots,
    ) {
        for at in lanes(state, inst) {
            for class in CLASSES {
                for slot in first.of(class)..first.of(class) + count.of(class) {
                    let index = slot as usize * state.chunks + at.chunk;
                    if let Some(lanes) = self.private[class as usize].get_mut(index) {
                        *lanes &= !(1 << at.lane);
                    }
                }
            }
        }
    }
}

/// A use of so many slots after the first ones.
pub(super) fn check<N: Number>(
    state: &State<'_, N>,
    checker: &mut Checker<'_>,
    inst: &CodeInst,
    index: u32,
    (memory, first, count): (Memory, Slots, Slots),
    access: Access,
) {
    for at in lanes(state, inst) {
        let by = Use {
            invocation: at.invocation,
            inst: index,
        };
        let (mut unwritten, mut race) = (false, None);
        for (c, class) in CLASSES.into_iter().enumerate() {
            let computed = inst.operands.get(c).map_or(0, |&slot| int(state, slot, at));
            for slot in 0..count.of(class) {
                let slot = first.of(class) as usize + computed as usize + slot as usize;
                match memory {
                    Memory::Private => {
                        let word = checker.private[c].get_mut(slot * state.chunks + at.chunk);
                        let Some(lanes) = word else { continue };
                        unwritten |= access.reads() && *lanes >> at.lane & 1 == 0;
                        if access.writes() {
                            *lanes |= 1 << at.lane;
                        }
                    }
                    Memory::Workgroup => {
                        let words = &mut checker.words[c];
                        let (Some(written), Some(users)) =
                            (words.written.get_mut(slot), words.users.get_mut(slot))
                        else {
                            continue;
                        };
                        unwritten |= access.reads() && !*written;
                        *written |= access.writes();
                        let conflict = users.access(access, by);
                        race = race.or(conflict);
                    }
                }
            }
        }
        let part = match memory {
            Memory::Private => Part::Private,
            Memory::Workgroup => Part::Workgroup,
        };
        if unwritten && checker.checks.uninitialised {
            checker.report(Site::Inst(index), at.invocation, || Detail::Unwritten(part));
        }
        if let Some((other, other_writes)) = race
            && checker.checks.races
        {
            checker.report(Site::Inst(index), at.invocation, || Detail::Race {
                part,
                writes: access.writes(),
                other,
                other_writes,
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn by(invocation: u32) -> Use {
        Use {
            invocation,
            inst: invocation + 100,
        }
    }

    /// Against all pairs of uses: a conflict is two invocations and a write.
    #[test]
    fn conflicts_are_those_of_some_earlier_use() {
        let uses: Vec<(Access, u32)> = [Access::Read, Access::Write]
            .into_iter()
            .flat_map(|access| (0..3).map(move |invocation| (access, invocation)))
            .collect();
        let count = uses.len();
        for sequence in 0..count.pow(4) {
            let sequence: Vec<(Access, u32)> = (0..4)
                .map(|i| uses[sequence / count.pow(i) % count])
                .collect();
            let mut users = Users::default();
            let mut raced = false;
            for (i, &(access, invocation)) in sequence.iter().enumerate() {
                let found = users.access(access, by(invocation));
                let conflicts: Vec<&(Access, u32)> = sequence[..i]
                    .iter()
                    .filter(|earlier| {
                        earlier.1 != invocation
                            && (access == Access::Write || earlier.0 == Access::Write)
                    })
                    .collect();
                // Once there is a race, which pairs are named after it is free.
                if !raced {
                    assert_eq!(found.is_some(), !conflicts.is_empty(), "{sequence:?}");
                }
                if let Some((other, wrote)) = found {
                    let access = if wrote { Access::Write } else { Access::Read };
                    assert!(
                        conflicts.contains(&&(access, other.invocation)),
                        "{sequence:?}"
                    );
                    raced = true;
                }
            }
        }
    }

    #[test]
    fn atomic_operations_do_not_race() {
        let mut users = Users::default();
        for invocation in 0..3 {
            assert!(
                users
                    .access(Access::Atomic { reads: true }, by(invocation))
                    .is_none()
            );
        }
    }
}
