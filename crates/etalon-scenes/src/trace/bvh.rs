//! A bounding volume hierarchy over axis-aligned boxes.

use glam::DVec3;

use super::ray::Ray;

/// Primitives in a leaf that are not worth splitting.
const LEAF: usize = 2;
/// Candidate planes per axis for the surface area heuristic.
const BINS: usize = 16;
/// Below this depth nodes are halved by count, whatever that costs, so that the
/// depth stays under `MEDIAN_DEPTH + 32` and traversal needs no allocation.
const MEDIAN_DEPTH: usize = 32;
const STACK: usize = MEDIAN_DEPTH + 33;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: DVec3::INFINITY,
        high: DVec3::NEG_INFINITY,
    };

    fn union(self, other: Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
        }
    }

    /// Half the surface area: all that the heuristic compares.
    fn area(self) -> f64 {
        let e = self.high - self.low;
        if e.min_element() < 0.0 {
            0.0
        } else {
            e.x * e.y + e.y * e.z + e.z * e.x
        }
    }

    /// Whether some of it is on the inner side of a plane `(normal, distance)`.
    fn reaches(&self, &(normal, distance): &(DVec3, f64)) -> bool {
        // The corner furthest inside.
        let corner = DVec3::select(normal.cmpgt(DVec3::ZERO), self.high, self.low);
        normal.dot(corner) >= distance
    }

    /// Where the ray enters, if that is before `limit` and it does at all.
    fn enter(&self, ray: &Ray, inverse: DVec3, limit: f64) -> Option<f64> {
        let a = (self.low - ray.origin()) * inverse;
        let b = (self.high - ray.origin()) * inverse;
        let (mut enter, mut leave) = (ray.start(), limit);
        for axis in 0..3 {
            let (low, high) = if inverse[axis] > 0.0 {
                (a[axis], b[axis])
            } else {
                (b[axis], a[axis])
            };
            // 0 · ∞ is NaN where the ray runs within a face of the slab; no
            // comparison with it holds, so the interval stays as it is.
            if low > enter {
                enter = low;
            }
            if high < leave {
                leave = high;
            }
        }
        // Three rounded operations lie behind each bound (Ize, “Robust BVH Ray
        // Traversal”, JCGT 2(2), 2013): widening by twice that never loses a hit.
        (enter <= leave * (1.0 + 8.0 * f64::EPSILON)).then_some(enter)
    }
}

#[derive(Clone, Debug)]
struct Node {
    bounds: Bounds,
    /// Leaf: the first entry in `order`. Inner node: its second child; the
    /// first follows the node itself.
    start: u32,
    /// Entries of a leaf; 0 for an inner node.
    count: u32,
}

/// The hierarchy. Primitives are known by their index only.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<u32>,
}

struct Item {
    index: u32,
    bounds: Bounds,
    center: DVec3,
}

impl Bvh {
    /// Builds the hierarchy over `(index, low corner, high corner)` by the
    /// binned surface area heuristic (Wald, “On fast Construction of SAH-based
    /// Bounding Volume Hierarchies”, 2007).
    pub(crate) fn new(items: impl Iterator<Item = (u32, DVec3, DVec3)>) -> Self {
        let mut items: Vec<_> = items
            .map(|(index, low, high)| Item {
                index,
                bounds: Bounds { low, high },
                center: 0.5 * (low + high),
            })
            .collect();
        let mut bvh = Self::default();
        if !items.is_empty() {
            bvh.build(&mut items, 0);
        }
        bvh
    }

    fn build(&mut self, items: &mut [Item], depth: usize) {
        let bounds = items
            .iter()
            .fold(Bounds::EMPTY, |sum, item| sum.union(item.bounds));
        let node = self.nodes.len();
        self.nodes.push(Node {
            bounds,
            start: self.order.len() as u32,
            count: items.len() as u32,
        });
        let split = if items.len() <= LEAF {
            None
        } else {
            Some(split(items, depth))
        };
        match split {
            Some(middle) => {
                let (first, second) = items.split_at_mut(middle);
                self.build(first, depth + 1);
                self.nodes[node].start = self.nodes.len() as u32;
                self.nodes[node].count = 0;
                self.build(second, depth + 1);
            }
            None => self.order.extend(items.iter().map(|item| item.index)),
        }
    }

    /// Calls `visit(index, limit)` for primitives the ray may hit before
    /// `limit`, near ones first, until none are left. `visit` answers with the
    /// new limit; below the ray's start it ends the search.
    pub(crate) fn traverse(
        &self,
        ray: &Ray,
        mut limit: f64,
        mut visit: impl FnMut(u32, f64) -> f64,
    ) {
        let inverse = ray.direction().recip();
        let Some(enter) = self
            .nodes
            .first()
            .and_then(|root| root.bounds.enter(ray, inverse, limit))
        else {
            return;
        };
        let mut stack = [(0_u32, 0.0_f64); STACK];
        stack[0] = (0, enter);
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let (index, enter) = stack[height];
            // Not `>=`: a hit at an equal parameter may have the smaller index.
            if enter > limit * (1.0 + 8.0 * f64::EPSILON) {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for &primitive in &self.order[node.start as usize..][..node.count as usize] {
                    limit = visit(primitive, limit);
                }
                continue;
            }
            let child = |index: u32| {
                self.nodes[index as usize]
                    .bounds
                    .enter(ray, inverse, limit)
                    .map(|enter| (index, enter))
            };
            let (first, second) = (child(index + 1), child(node.start));
            let (near, far) = match (first, second) {
                (Some(a), Some(b)) if b.1 < a.1 => (second, first),
                _ => (first, second),
            };
            for entry in [far, near].into_iter().flatten() {
                stack[height] = entry;
                height += 1;
            }
        }
    }

    /// Calls `visit(index)` for primitives whose boxes reach into the region of
    /// points `p` with `normal · p ≥ distance` for each `(normal, distance)`,
    /// until it answers `false`. Boxes near the region's corners may be visited
    /// without reaching into it.
    pub(crate) fn overlapping(&self, region: &[(DVec3, f64)], mut visit: impl FnMut(u32) -> bool) {
        if self.nodes.is_empty() {
            return;
        }
        let mut stack = [0_u32; STACK];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index as usize];
            if !region.iter().all(|plane| node.bounds.reaches(plane)) {
                continue;
            }
            if node.count > 0 {
                for &primitive in &self.order[node.start as usize..][..node.count as usize] {
                    if !visit(primitive) {
                        return;
                    }
                }
                continue;
            }
            for child in [node.start, index + 1] {
                stack[height] = child;
                height += 1;
            }
        }
    }
}

/// Reorders the items so that the cheapest split found is at the index returned,
/// which is neither 0 nor the length.
fn split(items: &mut [Item], depth: usize) -> usize {
    let spread = items.iter().fold(Bounds::EMPTY, |sum, item| {
        sum.union(Bounds {
            low: item.center,
            high: item.center,
        })
    });
    let extent = spread.high - spread.low;
    let half = items.len() / 2;
    if depth < MEDIAN_DEPTH {
        let mut best = (f64::INFINITY, 0, 0);
        for axis in 0..3 {
            if extent[axis] <= 0.0 {
                continue;
            }
            let mut bins = [(Bounds::EMPTY, 0_usize); BINS];
            for item in items.iter() {
                let bin = &mut bins[bin(item, spread.low, extent, axis)];
                *bin = (bin.0.union(item.bounds), bin.1 + 1);
            }
            // Cost of everything above each plane, from the right.
            let mut above = [0.0; BINS];
            let mut sum = (Bounds::EMPTY, 0);
            for plane in (1..BINS).rev() {
                sum = (sum.0.union(bins[plane].0), sum.1 + bins[plane].1);
                above[plane] = sum.0.area() * sum.1 as f64;
            }
            let mut sum = (Bounds::EMPTY, 0);
            for plane in 1..BINS {
                sum = (sum.0.union(bins[plane - 1].0), sum.1 + bins[plane - 1].1);
                let cost = sum.0.area() * sum.1 as f64 + above[plane];
                if sum.1 > 0 && sum.1 < items.len() && cost < best.0 {
                    best = (cost, axis, plane);
                }
            }
        }
        let (cost, axis, plane) = best;
        if cost.is_finite() {
            // A stable partition keeps the result independent of the sort used.
            items.sort_by_key(|item| bin(item, spread.low, extent, axis) >= plane);
            return items.partition_point(|item| bin(item, spread.low, extent, axis) < plane);
        }
    }
    let axis = extent.max_position();
    items.sort_by(|a, b| a.center[axis].total_cmp(&b.center[axis]));
    half
}

fn bin(item: &Item, low: DVec3, extent: DVec3, axis: usize) -> usize {
    // The cast saturates, so the highest centre and rounding both stay in range.
    (((item.center[axis] - low[axis]) / extent[axis] * BINS as f64) as usize).min(BINS - 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_boxes_stay_within_the_stack() {
        // Nothing to split by: halving by count must still end, and every
        // primitive must be visited exactly once.
        let bvh = Bvh::new((0..1000).map(|index| (index, DVec3::ZERO, DVec3::ONE)));
        let ray = Ray::new(DVec3::new(0.5, 0.5, -1.0), DVec3::Z);
        let mut seen = vec![0; 1000];
        bvh.traverse(&ray, f64::INFINITY, |index, limit| {
            seen[index as usize] += 1;
            limit
        });
        assert!(seen.iter().all(|&count| count == 1));
    }

    #[test]
    fn boxes_off_the_ray_are_not_visited() {
        let bvh = Bvh::new((0..1024_u32).map(|index| {
            let low = DVec3::new(f64::from(index) * 2.0, 0.0, 0.0);
            (index, low, low + DVec3::ONE)
        }));
        let ray = Ray::new(DVec3::new(600.5, 0.5, -1.0), DVec3::Z);
        let mut seen = Vec::new();
        bvh.traverse(&ray, f64::INFINITY, |index, limit| {
            seen.push(index);
            limit
        });
        // Its own leaf, and no more than the few others a leaf may hold.
        assert!(seen.contains(&300) && seen.len() <= LEAF, "{seen:?}");
    }

    #[test]
    fn every_box_that_reaches_into_a_region_is_visited() {
        let boxes: Vec<_> = (0..512_u32)
            .map(|index| {
                let cell = DVec3::new(
                    f64::from(index % 8),
                    f64::from(index / 8 % 8),
                    f64::from(index / 64),
                );
                (index, cell * 2.0, cell * 2.0 + DVec3::ONE)
            })
            .collect();
        let bvh = Bvh::new(boxes.iter().copied());
        for region in [
            &[][..],
            &[(DVec3::X, 4.5)],
            &[(DVec3::X, 5.0), (DVec3::NEG_Y, -6.5), (DVec3::Z, 3.0)],
            &[(DVec3::new(1.0, 1.0, 1.0), 40.0), (DVec3::NEG_X, -13.0)],
            &[(DVec3::X, 100.0)],
        ] {
            let inside = |corner: DVec3| region.iter().all(|&(n, d)| n.dot(corner) >= d);
            let mut expected = Vec::new();
            for &(index, low, high) in &boxes {
                let corners = (0..8).map(|i| {
                    DVec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low)
                });
                if corners.into_iter().any(inside) {
                    expected.push(index);
                }
            }
            let mut seen = Vec::new();
            bvh.overlapping(region, |index| {
                seen.push(index);
                true
            });
            seen.sort_unstable();
            // A leaf holds a few more boxes than those that reach into it.
            assert!(expected.iter().all(|i| seen.binary_search(i).is_ok()));
            assert!(seen.len() <= LEAF * expected.len(), "{region:?}: {seen:?}");
        }
        let mut count = 0;
        bvh.overlapping(&[], |_| {
            count += 1;
            count < 3
        });
        assert_eq!(count, 3);
    }

    #[test]
    fn an_empty_hierarchy_has_nothing_to_visit() {
        let bvh = Bvh::new(std::iter::empty());
        bvh.overlapping(&[], |_| unreachable!());
        bvh.traverse(
            &Ray::new(DVec3::ZERO, DVec3::Z),
            f64::INFINITY,
            |_, _| unreachable!(),
        );
    }
}
