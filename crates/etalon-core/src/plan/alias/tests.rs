//! Placements against brute force.

use proptest::collection::vec;
use proptest::sample::select;
use proptest::strategy::{Strategy as _, ValueTree as _};
use proptest::test_runner::TestRunner;

use super::*;
use crate::plan::Usage;

/// Lives at random, in the order of their first steps.
fn items(random: &mut TestRunner, count: usize, steps: u32) -> Vec<Item> {
    let lives = vec((0..steps, 0..6_u32, 0..9_u64), count);
    let lives = lives.new_tree(random).unwrap().current();
    let life = |(resource, (first, more, bytes))| Item {
        resource,
        first,
        last: first + more,
        bytes,
    };
    let mut items: Vec<Item> = lives.into_iter().enumerate().map(life).collect();
    items.sort_by_key(|item| item.first);
    items
}

/// Two items that share a byte and a step, or one outside of the heap.
fn fault(items: &[Item], layout: &Layout) -> Option<(usize, usize)> {
    let span = |k: usize| layout.offsets[k]..layout.offsets[k] + items[k].bytes;
    for a in 0..items.len() {
        if span(a).end > layout.size {
            return Some((a, a));
        }
        for b in 0..a {
            let apart = span(a).end <= span(b).start || span(b).end <= span(a).start;
            if items[a].meets(&items[b]) && !apart {
                return Some((a, b));
            }
        }
    }
    None
}

/// The largest set alive at once, step by step.
fn alive(items: &[Item]) -> u64 {
    let last = items.iter().map(|item| item.last).max().unwrap_or(0);
    let at = |step: u32| -> u64 {
        let alive = items
            .iter()
            .filter(|item| item.first <= step && step <= item.last);
        alive.map(|item| item.bytes).sum()
    };
    (0..=last).map(at).max().unwrap_or(0)
}

/// The smallest heap there is: every offset of every item is tried.
fn optimum(items: &[Item]) -> u64 {
    fn search(items: &[Item], offsets: &mut Vec<u64>, best: &mut u64, tops: u64) {
        if tops >= *best {
            return;
        }
        let k = offsets.len();
        if k == items.len() {
            *best = tops;
            return;
        }
        for offset in 0..best.saturating_sub(items[k].bytes) {
            let end = offset + items[k].bytes;
            let free = (0..k).all(|other| {
                !items[k].meets(&items[other])
                    || end <= offsets[other]
                    || offsets[other] + items[other].bytes <= offset
            });
            if free {
                offsets.push(offset);
                search(items, offsets, best, tops.max(end));
                offsets.pop();
            }
        }
    }
    let mut best = items.iter().map(|item| item.bytes).sum::<u64>() + 1;
    search(items, &mut Vec::new(), &mut best, 0);
    best
}

#[test]
fn nothing_alive_at_once_shares_bytes() {
    let mut random = TestRunner::deterministic();
    for count in [0, 1, 2, 7, 40, 200] {
        for _ in 0..30 {
            let items = items(&mut random, count, 60);
            let least = least(&items);
            assert_eq!(least, alive(&items));
            for layout in [
                sweep::layout(&items),
                pack::layout(&items, least),
                smallest(&items),
            ] {
                assert_eq!(fault(&items, &layout), None, "{items:?}");
                assert!(layout.size >= least);
            }
            let sum: u64 = items.iter().map(|item| item.bytes).sum();
            assert!(smallest(&items).size <= sum);
        }
    }
}

#[test]
fn a_shared_byte_would_be_seen() {
    let mut random = TestRunner::deterministic();
    let items = items(&mut random, 40, 20);
    let layout = smallest(&items);
    assert_eq!(fault(&items, &layout), None);
    let large = (0..items.len()).find(|&k| layout.offsets[k] > 0 && items[k].bytes > 0);
    let mut moved = layout.clone();
    moved.offsets[large.unwrap()] -= 1;
    assert!(fault(&items, &moved).is_some());
    let mut small = layout;
    small.size -= 1;
    assert!(fault(&items, &small).is_some());
}

/// A search of all placements says how small a heap can be. Packing is no such search,
/// but has to come close: of random lives, at most one in twenty may be larger.
#[test]
fn heaps_are_mostly_as_small_as_can_be() {
    let mut random = TestRunner::deterministic();
    let (mut larger, cases) = (0, 200);
    for _ in 0..cases {
        let items = items(&mut random, 7, 8);
        let optimum = optimum(&items);
        let found = smallest(&items).size;
        assert!(found >= optimum);
        larger += usize::from(found > optimum);
    }
    assert!(larger <= cases / 20, "{larger} of {cases}");
}

/// A sweep gives the first of these the ground, and the second has to go above it: it
/// knows nothing of the third.
#[test]
fn lives_are_packed_where_a_sweep_leaves_holes() {
    let item = |resource, first, last, bytes| Item {
        resource,
        first,
        last,
        bytes,
    };
    let items = [item(0, 0, 1, 2), item(1, 1, 3, 2), item(2, 2, 3, 3)];
    assert_eq!(alive(&items), 5);
    assert_eq!(sweep::layout(&items).size, 7);
    assert_eq!(smallest(&items).size, 5);
}

#[test]
fn earlier_tenants_are_those_of_every_byte() {
    let mut random = TestRunner::deterministic();
    let all = [
        Usage::Sampled,
        Usage::StorageRead,
        Usage::StorageWrite,
        Usage::CopySource,
    ];
    for _ in 0..50 {
        let items = items(&mut random, 30, 40);
        let layout = smallest(&items);
        let usages = vec(select(all.to_vec()), items.len());
        let usages = usages.new_tree(&mut random).unwrap().current();
        let usages: Vec<UsageSet> = usages.into_iter().map(UsageSet::from).collect();
        let found = tenants::before(&items, &layout.offsets, &usages);
        for (k, item) in items.iter().enumerate() {
            let mut fresh = 0;
            let mut uses = UsageSet::EMPTY;
            for byte in layout.offsets[k]..layout.offsets[k] + item.bytes {
                let has = |other: &usize| {
                    let start = layout.offsets[*other];
                    (start..start + items[*other].bytes).contains(&byte)
                };
                let earlier: Vec<usize> = (0..k).filter(has).collect();
                fresh += u64::from(earlier.is_empty());
                uses = earlier
                    .iter()
                    .fold(uses, |uses, &other| uses.union(usages[other]));
            }
            if fresh > 0 && fresh < item.bytes {
                assert_eq!(found[k], UsageSet::ALL);
            } else {
                // Tenants of tenants may be named too, which waits for more.
                assert_eq!(found[k].union(uses), found[k]);
                assert_eq!(found[k].is_empty(), uses.is_empty());
            }
        }
    }
}
