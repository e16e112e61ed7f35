//! Placement of whole lives at once: items are taken one after the other, each to the
//! lowest place where nothing that lives at the same time is. How large the heap becomes
//! depends on the order alone.
//!
//! Orders by size, by bytes times steps, and by steps are tried. From the best of them
//! on, what ended up above the largest set alive at once is what the order has treated
//! badly, and goes to its front (D. Joslin and D. Clements, "Squeaky Wheel
//! Optimization", JAIR 10, 1999).

use std::cmp::Reverse;

use super::{Item, Layout};

/// Comparisons of two items that may be spent on a heap, some milliseconds.
const WORK: usize = 1 << 20;

/// The smallest layout of the orders tried, none of which may be if the items are too
/// many; `least` is what no layout can be smaller than.
pub(super) fn layout(items: &[Item], least: u64) -> Layout {
    let mut best = Layout {
        offsets: Vec::new(),
        size: u64::MAX,
    };
    let mut best_order = Vec::new();
    let mut rounds = WORK / (items.len() * items.len()).max(1);
    let steps = |k: usize| u64::from(items[k].last - items[k].first) + 1;
    let orders: [&dyn Fn(usize) -> (u128, u64); 3] = [
        &|k| (u128::from(items[k].bytes), steps(k)),
        &|k| {
            let area = u128::from(items[k].bytes) * u128::from(steps(k));
            (area, items[k].bytes)
        },
        &|k| (u128::from(steps(k)), items[k].bytes),
    ];
    for key in orders {
        if rounds == 0 || best.size <= least {
            return best;
        }
        rounds -= 1;
        let mut order: Vec<usize> = (0..items.len()).collect();
        order.sort_by_key(|&k| Reverse(key(k)));
        let layout = in_order(items, &order);
        if layout.size < best.size {
            (best, best_order) = (layout, order);
        }
    }
    let (mut order, mut layout) = (best_order, best.clone());
    // An order that comes to nothing better for so long goes round in circles.
    let mut patience = 24;
    while rounds > 0 && patience > 0 && best.size > least {
        (rounds, patience) = (rounds - 1, patience - 1);
        let end = |k: usize| layout.offsets[k] + items[k].bytes;
        let (mut front, rest): (Vec<usize>, Vec<usize>) =
            order.iter().partition(|&&k| end(k) > least);
        front.extend(rest);
        order = front;
        layout = in_order(items, &order);
        if layout.size < best.size {
            best = layout.clone();
            patience = 24;
        }
    }
    best
}

/// Each item in the lowest place that is free for all of its life.
fn in_order(items: &[Item], order: &[usize]) -> Layout {
    let mut layout = Layout {
        offsets: vec![0; items.len()],
        size: 0,
    };
    // Placed so far, by their offsets.
    let mut placed: Vec<usize> = Vec::with_capacity(items.len());
    for &k in order {
        let item = &items[k];
        let mut offset = 0;
        for &other in &placed {
            if !item.meets(&items[other]) {
                continue;
            }
            if layout.offsets[other] >= offset + item.bytes {
                break;
            }
            offset = offset.max(layout.offsets[other] + items[other].bytes);
        }
        layout.offsets[k] = offset;
        layout.size = layout.size.max(offset + item.bytes);
        let at = placed.partition_point(|&other| layout.offsets[other] <= offset);
        placed.insert(at, k);
    }
    layout
}
