//! Where boxes of a graph are drawn: in layers, each below all that it depends on.
//!
//! After K. Sugiyama, S. Tagawa and M. Toda, "Methods for Visual Understanding of
//! Hierarchical System Structures", 1981: longest paths give the layers, edges over
//! several layers get a point in each, and some sweeps that sort each layer by the mean
//! of its neighbours keep edges from crossing.

/// Sweeps down and up over the layers.
const SWEEPS: usize = 8;

/// A box to be placed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Size {
    pub(super) width: f64,
    pub(super) height: f64,
}

/// Boxes and edges with their places.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Layout {
    pub(super) width: f64,
    pub(super) height: f64,
    /// By box: its centre.
    pub(super) centres: Vec<[f64; 2]>,
    /// By edge: the points it passes, from its box to its box.
    pub(super) paths: Vec<Vec<[f64; 2]>>,
}

/// Gap between neighbours, and between layers.
const GAP: [f64; 2] = [24.0, 46.0];

/// Width that an edge takes where it passes a layer.
const PASSING: f64 = 14.0;

/// One place in a layer: a box, or where an edge passes.
struct Slot {
    width: f64,
    layer: usize,
    above: Vec<usize>,
    below: Vec<usize>,
    x: f64,
}

/// Places boxes; edges lead from a box to one of a later number.
pub(super) fn layout(boxes: &[Size], edges: &[(usize, usize)]) -> Layout {
    let edges: Vec<(usize, usize)> = edges
        .iter()
        .copied()
        .filter(|(from, to)| from < to && *to < boxes.len())
        .collect();
    let mut slots: Vec<Slot> = boxes
        .iter()
        .map(|size| Slot {
            width: size.width,
            layer: 0,
            above: Vec::new(),
            below: Vec::new(),
            x: 0.0,
        })
        .collect();
    // Edges lead to later numbers, so one pass in that order finds longest paths.
    for to in 0..boxes.len() {
        let above = edges.iter().filter(|edge| edge.1 == to);
        let layer = above.map(|edge| slots[edge.0].layer + 1).max();
        slots[to].layer = layer.unwrap_or(0);
    }
    // What nothing leads to stands right above what it is for.
    for from in (0..boxes.len()).rev() {
        let lead_to = |edge: &&(usize, usize)| edge.1 == from;
        if edges.iter().any(|edge| lead_to(&edge)) {
            continue;
        }
        let below = edges.iter().filter(|edge| edge.0 == from);
        if let Some(layer) = below.map(|edge| slots[edge.1].layer).min() {
            slots[from].layer = layer.saturating_sub(1);
        }
    }
    let mut chains = Vec::with_capacity(edges.len());
    for &(from, to) in &edges {
        let mut chain = vec![from];
        for layer in slots[from].layer + 1..slots[to].layer {
            slots.push(Slot {
                width: PASSING,
                layer,
                above: Vec::new(),
                below: Vec::new(),
                x: 0.0,
            });
            chain.push(slots.len() - 1);
        }
        chain.push(to);
        for pair in chain.windows(2) {
            slots[pair[0]].below.push(pair[1]);
            slots[pair[1]].above.push(pair[0]);
        }
        chains.push(chain);
    }
    let count = slots.iter().map(|slot| slot.layer + 1).max().unwrap_or(0);
    let mut layers: Vec<Vec<usize>> = vec![Vec::new(); count];
    for (index, slot) in slots.iter().enumerate() {
        layers[slot.layer].push(index);
    }
    for layer in &layers {
        spread(&mut slots, layer);
    }
    for sweep in 0..SWEEPS {
        let down = sweep % 2 == 0;
        for step in 0..count {
            let at = if down { step } else { count - 1 - step };
            let mut wanted: Vec<(f64, usize)> = layers[at]
                .iter()
                .map(|&index| (wish(&slots, index, down), index))
                .collect();
            // Stable, so that equals stay as they are.
            wanted.sort_by(|a, b| a.0.total_cmp(&b.0));
            layers[at] = wanted.iter().map(|(_, index)| *index).collect();
            place(&mut slots, &wanted);
        }
    }
    finish(boxes, &slots, &layers, &chains)
}

/// The mean of the neighbours above, or below; where it is, if it has none.
fn wish(slots: &[Slot], index: usize, down: bool) -> f64 {
    let slot = &slots[index];
    let neighbours = if down { &slot.above } else { &slot.below };
    if neighbours.is_empty() {
        return slot.x;
    }
    let sum: f64 = neighbours.iter().map(|&other| slots[other].x).sum();
    sum / neighbours.len() as f64
}

/// One beside the other, around 0.
fn spread(slots: &mut [Slot], layer: &[usize]) {
    let wanted: Vec<(f64, usize)> = layer.iter().map(|&index| (0.0, index)).collect();
    place(slots, &wanted);
}

/// Puts a layer, in this order, as near to where each wants to be as the others let it:
/// pushed from the left and from the right, and the mean of both.
fn place(slots: &mut [Slot], wanted: &[(f64, usize)]) {
    let apart =
        |slots: &[Slot], a: usize, b: usize| 0.5 * (slots[a].width + slots[b].width) + GAP[0];
    let mut left: Vec<f64> = wanted.iter().map(|(x, _)| *x).collect();
    let mut right = left.clone();
    for i in 1..wanted.len() {
        let least = left[i - 1] + apart(slots, wanted[i - 1].1, wanted[i].1);
        left[i] = left[i].max(least);
    }
    for i in (1..wanted.len()).rev() {
        let most = right[i] - apart(slots, wanted[i - 1].1, wanted[i].1);
        right[i - 1] = right[i - 1].min(most);
    }
    for (i, (_, index)) in wanted.iter().enumerate() {
        slots[*index].x = 0.5 * (left[i] + right[i]);
    }
}

fn finish(boxes: &[Size], slots: &[Slot], layers: &[Vec<usize>], chains: &[Vec<usize>]) -> Layout {
    let edge = |sign: f64| {
        let ends = slots.iter().map(|slot| sign * slot.x + 0.5 * slot.width);
        ends.fold(0.0_f64, f64::max)
    };
    let (left, right) = (edge(-1.0), edge(1.0));
    let mut y = Vec::with_capacity(layers.len());
    let mut height = 0.0;
    for layer in layers {
        let tallest = layer
            .iter()
            .filter_map(|&index| boxes.get(index))
            .map(|size| size.height)
            .fold(0.0, f64::max);
        y.push(height + 0.5 * tallest);
        height += tallest + GAP[1];
    }
    let centre = |index: usize| [slots[index].x + left, y[slots[index].layer]];
    let paths = chains.iter().map(|chain| {
        let last = chain.len() - 1;
        let points = chain.iter().enumerate().map(|(at, &index)| {
            let [x, y] = centre(index);
            let half = boxes.get(index).map_or(0.0, |size| 0.5 * size.height);
            match at {
                0 => [x, y + half],
                at if at == last => [x, y - half],
                _ => [x, y],
            }
        });
        points.collect()
    });
    Layout {
        width: left + right,
        height: (height - GAP[1]).max(0.0),
        centres: (0..boxes.len()).map(centre).collect(),
        paths: paths.collect(),
    }
}
