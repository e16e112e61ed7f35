//! Who was in the same bytes before.

use std::collections::BTreeMap;

use super::Item;
use crate::plan::UsageSet;

/// For each of the items, which are in the order of their first steps: how those that
/// had some of its bytes earlier used them. Nobody in this run, and an earlier run in
/// any way: that is none of the uses if it holds for all of its bytes, all if for some.
pub(super) fn before(items: &[Item], offsets: &[u64], usages: &[UsageSet]) -> Vec<UsageSet> {
    let mut used = Used::default();
    items
        .iter()
        .zip(offsets)
        .zip(usages)
        .map(|((item, &offset), &own)| used.take(offset, offset + item.bytes, own))
        .collect()
}

/// How bytes were used so far: runs of bytes by where they begin, with their end.
#[derive(Debug, Default)]
struct Used {
    runs: BTreeMap<u64, (u64, UsageSet)>,
}

impl Used {
    /// Gives bytes to a tenant, and says how they were used before.
    fn take(&mut self, start: u64, end: u64, own: UsageSet) -> UsageSet {
        if start == end {
            return UsageSet::EMPTY;
        }
        self.cut(start);
        self.cut(end);
        let inside: Vec<u64> = self.runs.range(start..end).map(|(&from, _)| from).collect();
        let mut covered = 0;
        let mut before = UsageSet::EMPTY;
        for from in inside {
            if let Some((to, uses)) = self.runs.remove(&from) {
                covered += to - from;
                before = before.union(uses);
            }
        }
        if covered > 0 && covered < end - start {
            before = UsageSet::ALL;
        }
        // A barrier on one tenant says nothing of the tenants before, so their uses
        // stay with the bytes.
        self.runs.insert(start, (end, own.union(before)));
        before
    }

    /// Makes a run begin at a byte that is inside of one.
    fn cut(&mut self, at: u64) {
        if let Some((_, run)) = self.runs.range_mut(..at).next_back()
            && run.0 > at
        {
            let (end, uses) = *run;
            run.0 = at;
            self.runs.insert(at, (end, uses));
        }
    }
}
