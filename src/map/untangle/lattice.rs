//! Some texels of a map, and the Jacobians between them.

use super::written::{TARGET, WrittenMap};

/// Upper limit of the slack that keeps a Jacobian above its bound despite rounding: an identity map has Jacobian 1.
const MOST_SLACK: f64 = 0.3;

/// A lattice of texels `stride` apart, with the last texels of the map.
#[derive(Clone, Copy)]
pub struct Lattice {
    pub size: [usize; 2],
    pub stride: usize,
}

impl Lattice {
    /// Number of nodes along an axis.
    pub fn count(self, axis: usize) -> usize {
        (self.size[axis] - 1).div_ceil(self.stride) + 1
    }

    /// The place of a node along an axis, in texels.
    pub fn at(self, axis: usize, k: usize) -> usize {
        (k * self.stride).min(self.size[axis] - 1)
    }

    pub fn texel(self, node: [usize; 2]) -> [usize; 2] {
        [0, 1].map(|axis| self.at(axis, node[axis]))
    }

    /// The two nodes of the next coarser lattice around a place, and the fraction of the way from the first to the
    /// second.
    pub fn around(self, axis: usize, at: usize) -> ([usize; 2], f64) {
        let (last, step) = (self.size[axis] - 1, 2 * self.stride);
        if at == last {
            return ([last; 2], 0.0);
        }
        let low = at - at % step;
        let high = (low + step).min(last);
        ([low, high], (at - low) as f64 / (high - low) as f64)
    }

    /// The Jacobians that depend on a node's place, as functions of it, and their number. If `tight`, their targets
    /// include the slack for rounding.
    pub fn bounds(self, map: &WrittenMap, node: [usize; 2], tight: bool, bounds: &mut [Bound; 12]) -> usize {
        let texel = self.texel(node);
        let mut count = 0;
        for (right, up) in [(false, false), (true, false), (false, true), (true, true)] {
            let beside = |axis: usize, forth: bool| match forth {
                true => (node[axis] + 1 < self.count(axis)).then(|| self.at(axis, node[axis] + 1)),
                false => (node[axis] > 0).then(|| self.at(axis, node[axis] - 1)),
            };
            let (Some(x), Some(y)) = (beside(0, right), beside(1, up)) else { continue };
            let sides = [x.abs_diff(texel[0]) as f64, y.abs_diff(texel[1]) as f64];
            let sign = if right == up { 1.0 } else { -1.0 } / (sides[0] * sides[1]);
            let [p, a, b, d] = [texel, [x, texel[1]], [texel[0], y], [x, y]].map(|texel| map.place(texel));
            let slack = if tight { slack(map.rounding(texel), [p, a, b, d], sides) } else { 0.0 };
            // The cross products of the sides at the node, and at its neighbours along u and v.
            let (e, f) = (way(a, d), way(b, d));
            for (through, g) in [(a, [a[1] - b[1], b[0] - a[0]]), (a, [-e[1], e[0]]), (b, [f[1], -f[0]])] {
                bounds[count] = Bound { through, g: g.map(|x| x * sign), target: TARGET + slack };
                count += 1;
            }
        }
        count
    }
}

/// The most that rounding of a quad's texel positions by `rounding` may take from its Jacobians, per texel; `sides` are
/// the lengths of its sides at rest, in texels. `b` and `c` are the neighbours of `a`.
pub fn slack(rounding: f64, [a, b, c, d]: [[f64; 2]; 4], sides: [f64; 2]) -> f64 {
    let long = |p: [f64; 2], q: [f64; 2]| (p[0] - q[0]).abs() + (p[1] - q[1]).abs();
    let along = long(a, b).max(long(c, d)) / sides[0] + long(a, c).max(long(b, d)) / sides[1];
    (2.0 * rounding * along).min(MOST_SLACK)
}

pub fn way(from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
    [to[0] - from[0], to[1] - from[1]]
}

/// A Jacobian as a function of a node's place: 0 at `through`, with the gradient `g`.
#[derive(Clone, Copy, Default)]
pub struct Bound {
    through: [f64; 2],
    g: [f64; 2],
    /// The value that the Jacobian should not go below.
    target: f64,
}

impl Bound {
    pub fn at(&self, p: [f64; 2]) -> f64 {
        self.g[0] * (p[0] - self.through[0]) + self.g[1] * (p[1] - self.through[1])
    }
}

/// Moves along `way` until a Jacobian has fallen to its target, or not at all if it was already below it. Returns the
/// gradient of the limiting Jacobian.
pub fn advance(bounds: &[Bound], from: [f64; 2], way: [f64; 2]) -> ([f64; 2], Option<[f64; 2]>) {
    let (mut part, mut met) = (1.0, None);
    for bound in bounds {
        let slope = bound.g[0] * way[0] + bound.g[1] * way[1];
        let room = (bound.at(from) - bound.target).max(0.0);
        if slope < 0.0 && room < -slope * part {
            (part, met) = (room / -slope, Some(bound.g));
        }
    }
    ([0, 1].map(|k| from[k] + part * way[k]), met)
}
