//! The surface under W(p): exact positions and tangents on the finest level, metrics and their slopes on coarser ones.

use crate::mesh::NONE;
use crate::tile::blocks::{Plane, SIDE, slot};
use crate::tile::{Grid, Level};

use super::lanes::{LANES, Lanes, Truth, each};
use super::record::Record;

/// What an edge needs to know of one of its ends.
/// Finest level: `value` = position, `slope` = df/dx and df/dy. Coarser: `value` = (E, F, G), `slope` = its d/dx, d/dy.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sample {
    pub value: [f32; 3],
    pub slope: [f32; 6],
    /// The triangle under W(p); finest level only.
    pub triangle: u32,
}

/// The slopes at a row's eight nodes.
pub type Slopes<V> = [V; 6];

/// Samples at a row's eight nodes, and the triangles they lie on.
#[derive(Clone, Copy)]
pub struct Samples<V: Lanes> {
    pub value: [V; 3],
    pub slope: Slopes<V>,
    pub triangle: V::Index,
}

/// A row's eight nodes: (i + 2k, j) of the level, seen from one block.
#[derive(Clone, Copy)]
pub struct Site {
    pub block: usize,
    pub i: i64,
    pub j: i64,
}

impl Site {
    /// A lane's node.
    #[inline(always)]
    fn lane(&self, k: usize) -> i64 {
        self.i + 2 * k as i64
    }
}

/// How a level measures lengths.
pub trait Surface: Copy + Sync {
    /// True on the finest level.
    const CHORDS: bool;

    /// Samples the surface at node (i, j) + u of block `b`'s chart, starting at triangle `start`; `None` where W
    /// leaves the chart.
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<Sample>;

    /// The same for those of a row's nodes that the mask names, starting at the triangles in `samples`; the mask that
    /// comes back says where there is a sample. Other lanes of `samples` may be anything after it.
    fn sample_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask;

    /// The slope alone, where the state is known to be good.
    fn slope(&self, b: usize, i: i64, j: i64, u: [f32; 2], triangle: u32) -> [f32; 6];

    /// The same for those of a row's nodes that the mask names.
    fn slope_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        triangle: &[u32; LANES],
        lanes: V::Mask,
    ) -> Slopes<V>;

    /// Lengths L of the edges from p to n, given the offsets d and whether both ends are on one triangle.
    fn length<V: Lanes>(p: &[V; 3], slope: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> V;

    /// The same, with dL/du_p and, where `slope_n` is given, dL/du_n.
    fn gradient<V: Lanes>(
        p: &[V; 3],
        slope: &Slopes<V>,
        n: &[V; 3],
        same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], Chord<V>);

    /// dL/du_n from what `gradient` kept.
    fn far_gradient<V: Lanes>(chord: &Chord<V>, slope_n: &Slopes<V>) -> [V; 2];
}

/// What the gradients at both ends of an edge share.
#[derive(Clone, Copy)]
pub struct Chord<V> {
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
    pub triangles: &'a [Record],
}

/// Coarser levels: L = sqrt(dᵀ ½(G_p + G_n) d).
#[derive(Clone, Copy)]
pub struct Metrics<'a> {
    pub level: &'a Level,
    /// Per block: (E, F, G), per cell squared of this level.
    pub metric: &'a [[Plane; 3]],
}

/// Outside a triangle by less than this share of it counts as inside.
const SLACK: f32 = 1e-6;

impl Surface for Chords<'_> {
    const CHORDS: bool = true;

    #[inline]
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<Sample> {
        Some(self.on(self.find(b, i, j, u, start)?, i, j, u))
    }

    #[inline(always)]
    fn sample_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask {
        let mut triangle = V::index_array(samples.triangle);
        let column: [f32; LANES] = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| site.lane(k) as f32);
        let (column, row) = (V::from_array(column), V::splat(site.j as f32));
        // Lanes without a triangle load the first one's record and are not used.
        let record = |t: u32| self.triangles.get(t as usize).unwrap_or(&self.triangles[0]);
        let first = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[0]));
        let d = [(column - first[0]) + u[0], (row - first[1]) + u[1]];
        let (l1, l2) = (first[2] * d[0] + first[3] * d[1], first[4] * d[0] + first[5] * d[1]);
        let l0 = V::one() - l1 - l2;
        let slack = V::splat(-SLACK);
        let inside = slack.le(l0).and(slack.le(l1)).and(slack.le(l2));
        let outside = lanes.and_not(inside).bits();
        let (mut first, mut found) = (first, lanes);
        if outside != 0 {
            // Most nodes stay on their triangle; the others walk, one by one.
            let (x, y) = (u[0].to_array(), u[1].to_array());
            let mut lost = 0u8;
            for k in 0..LANES {
                if outside >> k & 1 != 0 {
                    match self.find(site.block, site.lane(k), site.j, [x[k], y[k]], triangle[k]) {
                        Some(t) => triangle[k] = t,
                        None => lost |= 1 << k,
                    }
                }
            }
            found = lanes.and_not(V::Mask::from_bits(lost));
            first = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[0]));
            samples.triangle = V::index_from(triangle);
        }
        let second = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[1]));
        let d = [(column - first[0]) + u[0], (row - first[1]) + u[1]];
        let origin = [first[6], first[7], second[0]];
        samples.slope = each!([0, 1, 2, 3, 4, 5], |k| second[k + 1]);
        let slope = &samples.slope;
        samples.value = each!([0, 1, 2], |k| origin[k] + (slope[k] * d[0] + slope[k + 3] * d[1]));
        found
    }

    #[inline(always)]
    fn slope(&self, _b: usize, _i: i64, _j: i64, _u: [f32; 2], triangle: u32) -> [f32; 6] {
        self.triangles.get(triangle as usize).map_or([0.0; 6], Record::slope)
    }

    #[inline(always)]
    fn slope_row<V: Lanes>(
        &self,
        _site: &Site,
        _u: &[V; 2],
        triangle: &[u32; LANES],
        _lanes: V::Mask,
    ) -> Slopes<V> {
        const NOWHERE: [f32; LANES] = [0.0; LANES];
        let half = |t: u32| self.triangles.get(t as usize).map_or(&NOWHERE, |record| &record.halves[1]);
        let second = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| half(triangle[k])));
        each!([0, 1, 2, 3, 4, 5], |k| second[k + 1])
    }

    #[inline(always)]
    fn length<V: Lanes>(p: &[V; 3], slope: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> V {
        let c = chord(p, slope, n, same, d);
        (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient<V: Lanes>(
        p: &[V; 3],
        slope: &Slopes<V>,
        n: &[V; 3],
        same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], Chord<V>) {
        let c = chord(p, slope, n, same, d);
        let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt();
        let kept = Chord { along: c, d: *d, inverse_length: V::one() / length };
        let far = Self::far_gradient(&kept, slope);
        (length, [-far[0], -far[1]], kept)
    }

    #[inline(always)]
    fn far_gradient<V: Lanes>(chord: &Chord<V>, slope_n: &Slopes<V>) -> [V; 2] {
        let c = &chord.along;
        each!([0, 3], |k| {
            (slope_n[k] * c[0] + slope_n[k + 1] * c[1] + slope_n[k + 2] * c[2]) * chord.inverse_length
        })
    }
}

/// The chord itself: from the triangle's tangents where both ends lie on one, the difference of positions elsewhere.
#[inline(always)]
fn chord<V: Lanes>(p: &[V; 3], slope: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> [V; 3] {
    each!([0, 1, 2], |k| same.select(slope[k] * d[0] + slope[k + 3] * d[1], n[k] - p[k]))
}

impl Chords<'_> {
    /// The triangle under node (i, j) + u of block `b`'s chart, starting at triangle `start`.
    fn find(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<u32> {
        self.locate(i, j, u, start).or_else(|| {
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
        })
    }

    /// The triangle under node (i, j) + u, by walking from `t`; `None` at a border or after too many steps.
    fn locate(&self, i: i64, j: i64, u: [f32; 2], mut t: u32) -> Option<u32> {
        // A node moves a few cells at most before its start is renewed; fine meshes have several triangles a cell.
        const STEPS: usize = 256;
        for _ in 0..STEPS {
            let record = &self.triangles[t as usize];
            let origin = record.uv_origin();
            let [l0, l1, l2] =
                record.barycentrics([(i as f32 - origin[0]) + u[0], (j as f32 - origin[1]) + u[1]]);
            let (mut low, mut corner) = (l0, 0);
            if l1 < low {
                (low, corner) = (l1, 1);
            }
            if l2 < low {
                (low, corner) = (l2, 2);
            }
            if low >= -SLACK {
                return Some(t);
            }
            let neighbours = &self.grid.triangles[t as usize].neighbours;
            let mut next = neighbours[corner];
            if next == NONE {
                // On the border: the other negative corner, if there is one; rounding may put a point just outside.
                let all = [l0, l1, l2];
                let other = (0..3).find(|&k| k != corner && all[k] < -SLACK && neighbours[k] != NONE);
                match other {
                    Some(k) => next = neighbours[k],
                    None => return (low >= -1e-3).then_some(t),
                }
            }
            t = next;
        }
        None
    }

    /// The sample at node (i, j) + u on triangle `t`, extrapolated if it lies outside.
    #[inline(always)]
    pub fn on(&self, t: u32, i: i64, j: i64, u: [f32; 2]) -> Sample {
        let record = &self.triangles[t as usize];
        let origin = record.uv_origin();
        let d = [(i as f32 - origin[0]) + u[0], (j as f32 - origin[1]) + u[1]];
        let (pose, slope) = (record.pose().origin, record.slope());
        Sample {
            value: each!([0, 1, 2], |k| pose[k] + (slope[k] * d[0] + slope[k + 3] * d[1])),
            slope,
            triangle: t,
        }
    }
}

impl Metrics<'_> {
    /// The metrics at (i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1), seen from block `b`.
    #[inline(always)]
    fn corners(&self, b: usize, i: i64, j: i64) -> Option<[[f32; 3]; 4]> {
        let at = |block: usize, i: i64, j: i64| {
            let s = slot(i as usize % SIDE, j as usize % SIDE);
            let planes = &self.metric[block];
            [planes[0][s], planes[1][s], planes[2][s]]
        };
        let holder = self.level.blocks.holding(b, i, j);
        if holder == NONE {
            return None;
        }
        let low = at(holder as usize, i, j);
        // Most cells lie within one block.
        if i as usize % SIDE != SIDE - 1 && j as usize % SIDE != SIDE - 1 {
            let at = |i, j| at(holder as usize, i, j);
            return Some([low, at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)]);
        }
        let at = |i: i64, j: i64| match self.level.blocks.holding(b, i, j) {
            NONE => None,
            block => Some(at(block as usize, i, j)),
        };
        Some([low, at(i + 1, j)?, at(i, j + 1)?, at(i + 1, j + 1)?])
    }

    /// Value and slope from a cell's corners and the place in it.
    #[inline(always)]
    fn bilinear<V: Lanes>(corners: &[[V; 3]; 4], s: V, t: V) -> ([V; 3], Slopes<V>) {
        let [g00, g10, g01, g11] = corners;
        let low = each!([0, 1, 2], |k| g00[k] + s * (g10[k] - g00[k]));
        let high = each!([0, 1, 2], |k| g01[k] + s * (g11[k] - g01[k]));
        let value = each!([0, 1, 2], |k| low[k] + t * (high[k] - low[k]));
        let slope = each!([0, 1, 2, 3, 4, 5], |k| {
            if k < 3 {
                (V::one() - t) * (g10[k] - g00[k]) + t * (g11[k] - g01[k])
            } else {
                high[k - 3] - low[k - 3]
            }
        });
        (value, slope)
    }

    /// The cells' corners under a row's nodes, the places in them, and where there are any.
    #[inline(always)]
    fn cells<V: Lanes>(&self, site: &Site, u: &[V; 2], lanes: V::Mask) -> ([[V; 3]; 4], [V; 2], V::Mask) {
        let whole = each!([0, 1], |c| u[c].floor());
        let inside = each!([0, 1], |c| u[c] - whole[c]);
        let (x, y) = (whole[0].to_array(), whole[1].to_array());
        let mut corners = [[[0.0f32; LANES]; 3]; 4];
        let (bits, mut lost) = (lanes.bits(), 0u8);
        for k in 0..LANES {
            if bits >> k & 1 == 0 {
                continue;
            }
            match self.corners(site.block, site.lane(k) + x[k] as i64, site.j + y[k] as i64) {
                Some(cell) => {
                    for (to, from) in corners.iter_mut().zip(cell) {
                        for c in 0..3 {
                            to[c][k] = from[c];
                        }
                    }
                }
                None => lost |= 1 << k,
            }
        }
        let corners = each!([0, 1, 2, 3], |n| each!([0, 1, 2], |c| V::from_array(corners[n][c])));
        (corners, inside, lanes.and_not(V::Mask::from_bits(lost)))
    }
}

impl Surface for Metrics<'_> {
    const CHORDS: bool = false;

    /// Bilinear between nodes.
    #[inline]
    fn sample(&self, b: usize, i: i64, j: i64, u: [f32; 2], _start: u32) -> Option<Sample> {
        let whole = [u[0].floor(), u[1].floor()];
        let [s, t] = [u[0] - whole[0], u[1] - whole[1]];
        let [g00, g10, g01, g11] = self.corners(b, i + whole[0] as i64, j + whole[1] as i64)?;
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
    fn sample_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask {
        let (corners, [s, t], found) = self.cells(site, u, lanes);
        (samples.value, samples.slope) = Self::bilinear(&corners, s, t);
        found
    }

    #[inline(always)]
    fn slope(&self, b: usize, i: i64, j: i64, u: [f32; 2], triangle: u32) -> [f32; 6] {
        self.sample(b, i, j, u, triangle).map_or([0.0; 6], |s| s.slope)
    }

    #[inline(always)]
    fn slope_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        _triangle: &[u32; LANES],
        lanes: V::Mask,
    ) -> Slopes<V> {
        // Lanes without a cell have corners of 0, and so a slope of 0.
        let (corners, [s, t], _) = self.cells(site, u, lanes);
        Self::bilinear(&corners, s, t).1
    }

    #[inline(always)]
    fn length<V: Lanes>(p: &[V; 3], _slope: &Slopes<V>, n: &[V; 3], _same: V::Mask, d: &[V; 2]) -> V {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1]];
        ((along[0] * d[0] + along[1] * d[1]).max(V::zero()) + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient<V: Lanes>(
        p: &[V; 3],
        slope: &Slopes<V>,
        n: &[V; 3],
        _same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], Chord<V>) {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1], V::zero()];
        let length = ((along[0] * d[0] + along[1] * d[1]).max(V::zero()) + TINY).sqrt();
        let kept = Chord { along, d: *d, inverse_length: V::one() / length };
        let own = half_change(&kept, slope);
        let near = [(own[0] - along[0]) * kept.inverse_length, (own[1] - along[1]) * kept.inverse_length];
        (length, near, kept)
    }

    #[inline(always)]
    fn far_gradient<V: Lanes>(chord: &Chord<V>, slope_n: &Slopes<V>) -> [V; 2] {
        let own = half_change(chord, slope_n);
        each!([0, 1], |k| (own[k] + chord.along[k]) * chord.inverse_length)
    }
}

/// An end's half of the metric's change along W: ¼ dᵀ (dG/dx) d and ¼ dᵀ (dG/dy) d.
#[inline(always)]
fn half_change<V: Lanes>(chord: &Chord<V>, slope: &Slopes<V>) -> [V; 2] {
    let [x, y] = chord.d;
    let (xx, xy, yy) = (x * x, x * y * 2.0, y * y);
    each!([0, 3], |k| (slope[k] * xx + slope[k + 1] * xy + slope[k + 2] * yy) * 0.25)
}
