//! The surface under W(p): exact positions and tangents on the finest level, metrics and their slopes on coarser ones.

use crate::mesh::NONE;
use crate::tile::blocks::{Plane, SIDE, slot};
use crate::tile::pose::PoseTriangle;
use crate::tile::{Grid, Level};

use super::lanes::{Mask, V, each};

/// What an edge needs to know of one of its ends.
/// Finest level: `value` = position, `slope` = df/dx and df/dy. Coarser: `value` = (E, F, G), `slope` = its d/dx, d/dy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    pub value: [f32; 3],
    pub slope: [f32; 6],
    /// The triangle under W(p); finest level only.
    pub triangle: u32,
}

/// Row `k` of the samples of eight nodes.
pub type Slopes = [V; 6];

/// How a level measures lengths.
pub trait Surface: Copy + Sync {
    /// True on the finest level.
    const CHORDS: bool;

    /// Samples the surface at node (i, j) + u of block `b`'s chart, starting at triangle `start`; `None` where W
    /// leaves the chart.
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<Sample>;

    /// The slope alone, where the state is known to be good.
    fn slope(&self, b: usize, i: i64, j: i64, u: [f32; 2], triangle: u32) -> [f32; 6];

    /// Lengths L of the edges from p to n, given the offsets d and whether both ends are on one triangle.
    fn length(p: &[V; 3], slope: &Slopes, n: &[V; 3], same: Mask, d: &[V; 2]) -> V;

    /// The same, with dL/du_p and, where `slope_n` is given, dL/du_n.
    fn gradient(p: &[V; 3], slope: &Slopes, n: &[V; 3], same: Mask, d: &[V; 2]) -> (V, [V; 2], Chord);

    /// dL/du_n from what `gradient` kept.
    fn far_gradient(chord: &Chord, slope_n: &Slopes) -> [V; 2];
}

/// What the gradients at both ends of an edge share.
#[derive(Clone, Copy)]
pub struct Chord {
    /// Finest: the chord. Coarser: the metric times d.
    along: [V; 3],
    d: [V; 2],
    inverse_length: V,
}

/// Keeps 1 / L finite; lengths of a chart of unit size are far longer.
const TINY: f32 = 1e-24;

/// Finest level: L = |f(W_n) - f(W_p)|.
#[derive(Clone, Copy)]
pub struct Chords<'a> {
    pub grid: &'a Grid,
    pub triangles: &'a [PoseTriangle],
}

/// Coarser levels: L = sqrt(dᵀ ½(G_p + G_n) d).
#[derive(Clone, Copy)]
pub struct Metrics<'a> {
    pub level: &'a Level,
    /// Per block: (E, F, G), per cell squared of this level.
    pub metric: &'a [[Plane; 3]],
}

impl Surface for Chords<'_> {
    const CHORDS: bool = true;

    #[inline]
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<Sample> {
        let t = self.locate(i, j, u, start).or_else(|| {
            // The walk was stopped by a border or ran too far: begin at the node nearest to W(p).
            let (x, y) = (i + u[0].round() as i64, j + u[1].round() as i64);
            let block = self.grid.levels[0].blocks.holding(b, x, y);
            let near = match block {
                NONE => return None,
                block => self.grid.triangle[block as usize][slot(x as usize % SIDE, y as usize % SIDE)],
            };
            let chart = self.grid.levels[0].blocks.list[b].chart;
            let usable = near != NONE && near != start && self.grid.chart_of[near as usize] == chart;
            usable.then(|| self.locate(i, j, u, near)).flatten()
        })?;
        Some(self.on(t, i, j, u))
    }

    #[inline(always)]
    fn slope(&self, _b: usize, _i: i64, _j: i64, _u: [f32; 2], triangle: u32) -> [f32; 6] {
        match self.triangles.get(triangle as usize) {
            Some(PoseTriangle { tangent: [x, y], .. }) => [x[0], x[1], x[2], y[0], y[1], y[2]],
            None => [0.0; 6],
        }
    }

    #[inline(always)]
    fn length(p: &[V; 3], slope: &Slopes, n: &[V; 3], same: Mask, d: &[V; 2]) -> V {
        let c = chord(p, slope, n, same, d);
        (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient(p: &[V; 3], slope: &Slopes, n: &[V; 3], same: Mask, d: &[V; 2]) -> (V, [V; 2], Chord) {
        let c = chord(p, slope, n, same, d);
        let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt();
        let kept = Chord { along: c, d: *d, inverse_length: V::ONE / length };
        let far = Self::far_gradient(&kept, slope);
        (length, [-far[0], -far[1]], kept)
    }

    #[inline(always)]
    fn far_gradient(chord: &Chord, slope_n: &Slopes) -> [V; 2] {
        let c = &chord.along;
        each!([0, 3], |k| {
            (slope_n[k] * c[0] + slope_n[k + 1] * c[1] + slope_n[k + 2] * c[2]) * chord.inverse_length
        })
    }
}

/// The chord itself: from the triangle's tangents where both ends lie on one, the difference of positions elsewhere.
#[inline(always)]
fn chord(p: &[V; 3], slope: &Slopes, n: &[V; 3], same: Mask, d: &[V; 2]) -> [V; 3] {
    each!([0, 1, 2], |k| same.select(slope[k] * d[0] + slope[k + 3] * d[1], n[k] - p[k]))
}

impl Chords<'_> {
    /// The triangle under node (i, j) + u, by walking from `t`; `None` at a border or after too many steps.
    #[inline]
    fn locate(&self, i: i64, j: i64, u: [f32; 2], mut t: u32) -> Option<u32> {
        // A node moves a few cells at most before its start is renewed; fine meshes have several triangles a cell.
        const STEPS: usize = 256;
        for _ in 0..STEPS {
            let [l0, l1, l2] = self.barycentrics(t, i, j, u);
            let (mut low, mut corner) = (l0, 0);
            if l1 < low {
                (low, corner) = (l1, 1);
            }
            if l2 < low {
                (low, corner) = (l2, 2);
            }
            if low >= -1e-6 {
                return Some(t);
            }
            let neighbours = &self.grid.triangles[t as usize].neighbours;
            let mut next = neighbours[corner];
            if next == NONE {
                // On the border: the other negative corner, if there is one; rounding may put a point just outside.
                let all = [l0, l1, l2];
                let other = (0..3).find(|&k| k != corner && all[k] < -1e-6 && neighbours[k] != NONE);
                match other {
                    Some(k) => next = neighbours[k],
                    None => return (low >= -1e-3).then_some(t),
                }
            }
            t = next;
        }
        None
    }

    #[inline(always)]
    fn barycentrics(&self, t: u32, i: i64, j: i64, u: [f32; 2]) -> [f32; 3] {
        let triangle = &self.grid.triangles[t as usize];
        let d = [(i as f32 - triangle.origin[0]) + u[0], (j as f32 - triangle.origin[1]) + u[1]];
        let [l1, l2] = triangle.barycentric.map(|row| row[0] * d[0] + row[1] * d[1]);
        [1.0 - l1 - l2, l1, l2]
    }

    /// The sample at node (i, j) + u on triangle `t`, extrapolated if it lies outside.
    #[inline(always)]
    pub fn on(&self, t: u32, i: i64, j: i64, u: [f32; 2]) -> Sample {
        let origin = self.grid.triangles[t as usize].origin;
        let d = [(i as f32 - origin[0]) + u[0], (j as f32 - origin[1]) + u[1]];
        let pose = &self.triangles[t as usize];
        let [x, y] = &pose.tangent;
        Sample {
            value: each!([0, 1, 2], |k| pose.origin[k] + (x[k] * d[0] + y[k] * d[1])),
            slope: [x[0], x[1], x[2], y[0], y[1], y[2]],
            triangle: t,
        }
    }
}

impl Surface for Metrics<'_> {
    const CHORDS: bool = false;

    /// Bilinear between nodes.
    #[inline]
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], _start: u32) -> Option<Sample> {
        let whole = [u[0].floor(), u[1].floor()];
        let [s, t] = [u[0] - whole[0], u[1] - whole[1]];
        let (i, j) = (i + whole[0] as i64, j + whole[1] as i64);
        let at = |i: i64, j: i64| -> Option<[f32; 3]> {
            let block = self.level.blocks.holding(b, i, j);
            if block == NONE {
                return None;
            }
            let s = slot(i as usize % SIDE, j as usize % SIDE);
            Some(self.metric[block as usize].each_ref().map(|plane| plane[s]))
        };
        let (g00, g10, g01, g11) = (at(i, j)?, at(i + 1, j)?, at(i, j + 1)?, at(i + 1, j + 1)?);
        let mut sample = Sample { triangle: NONE, ..Sample::default() };
        for k in 0..3 {
            let (low, high) = (g00[k] + s * (g10[k] - g00[k]), g01[k] + s * (g11[k] - g01[k]));
            sample.value[k] = low + t * (high - low);
            sample.slope[k] = (1.0 - t) * (g10[k] - g00[k]) + t * (g11[k] - g01[k]);
            sample.slope[k + 3] = high - low;
        }
        Some(sample)
    }

    #[inline(always)]
    fn slope(&self, b: usize, i: i64, j: i64, u: [f32; 2], triangle: u32) -> [f32; 6] {
        self.sample(b, i, j, u, triangle).map_or([0.0; 6], |s| s.slope)
    }

    #[inline(always)]
    fn length(p: &[V; 3], _slope: &Slopes, n: &[V; 3], _same: Mask, d: &[V; 2]) -> V {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1]];
        ((along[0] * d[0] + along[1] * d[1]).max(V::ZERO) + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient(p: &[V; 3], slope: &Slopes, n: &[V; 3], _same: Mask, d: &[V; 2]) -> (V, [V; 2], Chord) {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1], V::ZERO];
        let length = ((along[0] * d[0] + along[1] * d[1]).max(V::ZERO) + TINY).sqrt();
        let kept = Chord { along, d: *d, inverse_length: V::ONE / length };
        let own = half_change(&kept, slope);
        let near = [(own[0] - along[0]) * kept.inverse_length, (own[1] - along[1]) * kept.inverse_length];
        (length, near, kept)
    }

    #[inline(always)]
    fn far_gradient(chord: &Chord, slope_n: &Slopes) -> [V; 2] {
        let own = half_change(chord, slope_n);
        each!([0, 1], |k| (own[k] + chord.along[k]) * chord.inverse_length)
    }
}

/// An end's half of the metric's change along W: ¼ dᵀ (dG/dx) d and ¼ dᵀ (dG/dy) d.
#[inline(always)]
fn half_change(chord: &Chord, slope: &Slopes) -> [V; 2] {
    let [x, y] = chord.d;
    let (xx, xy, yy) = (x * x, x * y * 2.0, y * y);
    each!([0, 3], |k| (slope[k] * xx + slope[k + 1] * xy + slope[k + 2] * yy) * 0.25)
}
