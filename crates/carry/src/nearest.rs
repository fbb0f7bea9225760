//! The nearest of many triangles to a point, by a tree of boxes. Of several triangles at the same distance it is the
//! first.

use std::ops::{Add, Mul};

use glam::DVec3;

use vrtm_core::allocation::{Vec, vec};

/// Most triangles of a leaf.
const LEAF: usize = 4;

#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The first triangle of a leaf in `order`, or the second child; the first child follows its parent.
    at: u32,
    /// The number of triangles of a leaf; 0 for others.
    count: u32,
}

/// Triangles, sorted for searches.
#[derive(Debug)]
pub struct Nearest {
    triangles: Vec<[DVec3; 3]>,
    order: Vec<u32>,
    nodes: Vec<Node>,
}

/// A point of a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    pub triangle: u32,
    pub weights: [f64; 3],
    pub distance: f64,
}

impl Nearest {
    pub fn new(triangles: Vec<[DVec3; 3]>) -> Nearest {
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = Vec::with_capacity(2 * triangles.len() / LEAF + 1);
        let bounds = |of: &[u32]| {
            let corners = of.iter().flat_map(|&t| triangles[t as usize]);
            corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
        };
        // Ranges of `order`, with the parent whose second child they are.
        let mut stack: Vec<(usize, usize, Option<usize>)> = vec![(0, triangles.len(), None)];
        while let Some((first, end, parent)) = stack.pop() {
            if first == end {
                continue;
            }
            let own = nodes.len();
            if let Some(parent) = parent {
                let parent: &mut Node = &mut nodes[parent];
                parent.at = own as u32;
            }
            let (low, high) = bounds(&order[first..end]);
            if end - first <= LEAF {
                nodes.push(Node { low, high, at: first as u32, count: (end - first) as u32 });
                continue;
            }
            nodes.push(Node { low, high, at: 0, count: 0 });
            let extent = high - low;
            let axis = (1..3).fold(0, |best, k| if extent[k] > extent[best] { k } else { best });
            let centre = |&t: &u32| triangles[t as usize].iter().map(|p| p[axis]).sum::<f64>();
            let middle = (end - first) / 2;
            order[first..end]
                .select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
            stack.push((first + middle, end, Some(own)));
            stack.push((first, first + middle, None));
        }
        Nearest { triangles, order, nodes }
    }

    /// The point nearest to another; `None` without triangles.
    pub fn find(&self, to: DVec3) -> Option<Found> {
        let mut best: Option<(f64, Found)> = None;
        // As deep as a balanced tree of 2^32 triangles.
        let mut stack = [0u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let own = stack[depth];
            let node = &self.nodes[own as usize];
            if best.as_ref().is_some_and(|(least, _)| distance2(node, to) > *least) {
                continue;
            }
            if node.count == 0 {
                let mut children = [own + 1, node.at];
                if distance2(&self.nodes[own as usize + 1], to)
                    <= distance2(&self.nodes[node.at as usize], to)
                {
                    children.swap(0, 1);
                }
                for child in children {
                    stack[depth] = child;
                    depth += 1;
                }
                continue;
            }
            for &triangle in &self.order[node.at as usize..(node.at + node.count) as usize] {
                self.compare(triangle, to, &mut best);
            }
        }
        best.map(|(_, found)| found)
    }

    /// The nearest point of some triangles, if it is not farther than `within`.
    pub fn find_among(&self, some: impl Iterator<Item = usize>, to: DVec3, within: f64) -> Option<Found> {
        let mut best = None;
        for t in some {
            let [a, b, c] = self.triangles[t];
            let beside = to - to.max(a.min(b).min(c)).min(a.max(b).max(c));
            if beside.abs().max_element() <= within {
                self.compare(t as u32, to, &mut best);
            }
        }
        best.map(|(_, found)| found).filter(|found| found.distance <= within)
    }

    /// Replaces the best point, and its squared distance, by that of a triangle if this is nearer.
    #[inline(always)]
    fn compare(&self, triangle: u32, to: DVec3, best: &mut Option<(f64, Found)>) {
        let corners = &self.triangles[triangle as usize];
        let weights = nearest_weights(corners, to);
        let d2 = (weighed(*corners, weights) - to).length_squared();
        let is_better = best
            .as_ref()
            .is_none_or(|(least, found)| d2 < *least || (d2 == *least && triangle < found.triangle));
        if is_better {
            *best = Some((d2, Found { triangle, weights, distance: d2.sqrt() }));
        }
    }
}

/// The point of a triangle, in a plane or in space, with these barycentric coordinates.
#[inline(always)]
pub fn weighed<V: Add<Output = V> + Mul<f64, Output = V>>([p, q, r]: [V; 3], [a, b, c]: [f64; 3]) -> V {
    p * a + q * b + r * c
}

/// The squared distance of a point from a box.
fn distance2(node: &Node, to: DVec3) -> f64 {
    (to - to.max(node.low).min(node.high)).length_squared()
}

/// The barycentric coordinates of the point of a triangle that is nearest to another: in its inside, on a side, or a
/// corner.
fn nearest_weights(&[a, b, c]: &[DVec3; 3], to: DVec3) -> [f64; 3] {
    // 0 for a side without a length.
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    let (ab, ac) = (b - a, c - a);
    let (pa, pb, pc) = (to - a, to - b, to - c);
    let (d1, d2, d3, d4, d5, d6) = (ab.dot(pa), ac.dot(pa), ab.dot(pb), ac.dot(pb), ab.dot(pc), ac.dot(pc));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let of_c = d1 * d4 - d3 * d2;
    if of_c <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let s = share(d1, d1 - d3);
        return [1.0 - s, s, 0.0];
    }
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let of_b = d5 * d2 - d1 * d6;
    if of_b <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let s = share(d2, d2 - d6);
        return [1.0 - s, 0.0, s];
    }
    let of_a = d3 * d6 - d5 * d4;
    if of_a <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let s = share(d4 - d3, (d4 - d3) + (d5 - d6));
        return [0.0, 1.0 - s, s];
    }
    let whole = of_a + of_b + of_c;
    let (s, t) = (share(of_b, whole), share(of_c, whole));
    [1.0 - s - t, s, t]
}
