//! The surface of the finest level (method §2): exact positions and tangents on the triangle under W(p), which is found
//! by walking. Lengths are chords.

use super::super::lanes::{LANES, Lanes, Mask, each};
use super::record::TriangleRecord;
use super::{BlockPlace, GradientTerms, GridRow, Samples, Slopes, Surface};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::{BORDER_TOLERANCE, INSIDE_TOLERANCE, TINY, WALK_STEPS};

/// The surface of the finest level: L = |f(W_n) - f(W_p)|.
#[derive(Clone, Copy)]
pub struct Chords<'a> {
    pub grid: &'a Grid,
    pub triangles: &'a [TriangleRecord],
}

impl Surface for Chords<'_> {
    const CHORDS: bool = true;

    #[inline(always)]
    fn sample_row<V: Lanes>(
        &self,
        nodes: &GridRow,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask {
        let mut triangle = V::index_to_array(samples.triangle);
        let column: [f32; LANES] = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| nodes.column(k) as f32);
        let (column, row) = (V::from_array(column), V::splat(nodes.j as f32));
        // Lanes without a triangle read the record of triangle 0, and their values are not used.
        let record = |t: u32| self.triangles.get(t as usize).unwrap_or(&self.triangles[0]);
        let first = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[0]));
        let d = [(column - first[0]) + u[0], (row - first[1]) + u[1]];
        let (l1, l2) = (first[2] * d[0] + first[3] * d[1], first[4] * d[0] + first[5] * d[1]);
        let l0 = V::one() - l1 - l2;
        let slack = V::splat(-INSIDE_TOLERANCE);
        let inside = slack.le(l0).and(slack.le(l1)).and(slack.le(l2));
        let outside = lanes.and_not(inside).bits();
        let (mut first, mut found) = (first, lanes);
        if outside != 0 {
            // Most nodes stay on their triangle; the others are located one by one.
            let (x, y) = (u[0].to_array(), u[1].to_array());
            let mut lost = 0u8;
            for k in 0..LANES {
                if outside >> k & 1 != 0 {
                    match self.locate(nodes.block, nodes.column(k), nodes.j, [x[k], y[k]], triangle[k]) {
                        Some(t) => triangle[k] = t,
                        None => lost |= 1 << k,
                    }
                }
            }
            found = lanes.and_not(V::Mask::from_bits(lost));
            first = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[0]));
            samples.triangle = V::index_from_array(triangle);
        }
        let second = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| &record(triangle[k]).halves[1]));
        let d = [(column - first[0]) + u[0], (row - first[1]) + u[1]];
        (samples.value, samples.tangents) = affine_samples(&first, &second, &d);
        found
    }

    #[inline(always)]
    fn at_nodes(&self) -> Option<&[[Plane; 3]]> {
        None
    }

    #[inline(always)]
    fn tangents_row<V: Lanes>(&self, triangle: &[u32; LANES]) -> Slopes<V> {
        let second = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| self.half(triangle[k], 1)));
        each!([0, 1, 2, 3, 4, 5], |k| second[k + 1])
    }

    #[inline(always)]
    fn length<V: Lanes>(p: &[V; 3], tangents: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> V {
        let c = chord(p, tangents, n, same, d);
        (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient<V: Lanes>(
        p: &[V; 3],
        tangents: &Slopes<V>,
        slopes: &Slopes<V>,
        n: &[V; 3],
        same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], GradientTerms<V>) {
        let c = chord(p, tangents, n, same, d);
        let length = (c[0] * c[0] + c[1] * c[1] + c[2] * c[2] + TINY).sqrt();
        let terms = GradientTerms { along: c, d: *d, inverse_length: V::one() / length };
        let far = Self::far_gradient(&terms, slopes);
        (length, [-far[0], -far[1]], terms)
    }

    #[inline(always)]
    fn far_gradient<V: Lanes>(terms: &GradientTerms<V>, neighbour_slope: &Slopes<V>) -> [V; 2] {
        let c = &terms.along;
        each!([0, 3], |k| {
            (neighbour_slope[k] * c[0] + neighbour_slope[k + 1] * c[1] + neighbour_slope[k + 2] * c[2])
                * terms.inverse_length
        })
    }
}

/// Position and tangents at the offset d from a triangle's origin; `first` and `second` are the halves of its record.
#[inline(always)]
fn affine_samples<V: Lanes>(first: &[V; LANES], second: &[V; LANES], d: &[V; 2]) -> ([V; 3], Slopes<V>) {
    let origin = [first[6], first[7], second[0]];
    let tangents = each!([0, 1, 2, 3, 4, 5], |k| second[k + 1]);
    (each!([0, 1, 2], |k| origin[k] + (tangents[k] * d[0] + tangents[k + 3] * d[1])), tangents)
}

/// The chord: tangents times offset if both ends lie on one triangle, otherwise the difference of the positions.
#[inline(always)]
fn chord<V: Lanes>(p: &[V; 3], tangents: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> [V; 3] {
    each!([0, 1, 2], |k| same.select(tangents[k] * d[0] + tangents[k + 3] * d[1], n[k] - p[k]))
}

impl Chords<'_> {
    /// Locates the triangle under node (i, j) + u in the chart of block `b`, beginning at triangle `start`. `None` if
    /// there is no sample.
    fn locate(&self, b: usize, i: i64, j: i64, u: [f32; 2], start: u32) -> Option<u32> {
        self.walk(i, j, u, start).or_else(|| {
            // The walk ended at a border or took too many steps: walk again from the node nearest to W(p).
            let nearest = self.nearest(b, i, j, u).filter(|&nearest| nearest != start)?;
            self.walk(i, j, u, nearest)
        })
    }

    /// The rest triangles of the nodes nearest to a row's nodes displaced by u, or those of the nodes themselves where
    /// there is none in the chart. The nodes have the slots from `s` on.
    #[inline(always)]
    pub fn nearest_row<V: Lanes>(&self, nodes: &GridRow, s: usize, u: &[V; 2]) -> [u32; LANES] {
        let block = nodes.block;
        let (at_rest, chart) = (&self.grid.triangle[block], self.grid.levels[0].blocks.list[block].chart);
        let (slots, inside) = BlockPlace::new(nodes, each!([0, 1], |c| (u[c] + 0.5).floor())).slots(SIDE);
        let [x, y] = each!([0, 1], |c| u[c].to_array());
        let mut triangles = [NONE; LANES];
        for (k, triangle) in triangles.iter_mut().enumerate() {
            let near = if inside >> k & 1 != 0 {
                self.of_chart(at_rest[usize::from(slots[k])], chart)
            } else {
                self.nearest(block, nodes.column(k), nodes.j, [x[k], y[k]])
            };
            *triangle = near.unwrap_or(at_rest[s + k]);
        }
        triangles
    }

    /// A triangle if it lies in this chart.
    #[inline(always)]
    fn of_chart(&self, triangle: u32, chart: u32) -> Option<u32> {
        let is_usable = triangle != NONE && self.grid.chart_of[triangle as usize] == chart;
        is_usable.then_some(triangle)
    }

    /// The rest triangle of the node nearest to node (i, j) + u, if it lies in the chart of block `b`.
    fn nearest(&self, b: usize, i: i64, j: i64, u: [f32; 2]) -> Option<u32> {
        let blocks = &self.grid.levels[0].blocks;
        let [x, y] = [(i, u[0]), (j, u[1])].map(|(n, u)| n + (u + 0.5).floor() as i64);
        let triangle = match blocks.holding(b, x, y) {
            NONE => NONE,
            near => self.grid.triangle[near as usize][slot(x as usize % SIDE, y as usize % SIDE)],
        };
        self.of_chart(triangle, blocks.list[b].chart)
    }

    /// Walks from triangle `t` to the one under node (i, j) + u. `None` if the walk ends at a border or after
    /// `WALK_STEPS`.
    fn walk(&self, i: i64, j: i64, u: [f32; 2], mut t: u32) -> Option<u32> {
        for _ in 0..WALK_STEPS {
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
            if low >= -INSIDE_TOLERANCE {
                return Some(t);
            }
            let neighbours = &self.grid.triangles[t as usize].neighbours;
            let mut next = neighbours[corner];
            if next == NONE {
                // This edge is a border: cross another edge with a negative coordinate. If no other edge has one,
                // rounding may have put the point just outside the border.
                let all = [l0, l1, l2];
                let other =
                    (0..3).find(|&k| k != corner && all[k] < -INSIDE_TOLERANCE && neighbours[k] != NONE);
                match other {
                    Some(k) => next = neighbours[k],
                    None => return (low >= -BORDER_TOLERANCE).then_some(t),
                }
            }
            t = next;
        }
        None
    }

    /// Half `h` of a triangle's record; zeros for `NONE`.
    #[inline(always)]
    fn half(&self, triangle: u32, h: usize) -> &[f32; LANES] {
        const ZEROS: [f32; LANES] = [0.0; LANES];
        match self.triangles.get(triangle as usize) {
            Some(record) => &record.halves[h],
            None => &ZEROS,
        }
    }

    /// Samples at a row's nodes displaced by u, on the affine continuations of the given triangles; 0 in lanes without
    /// a triangle.
    #[inline(always)]
    pub fn sample_row_on<V: Lanes>(&self, nodes: &GridRow, u: &[V; 2], triangle: V::Index) -> Samples<V> {
        let at = V::index_to_array(triangle);
        let first = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| self.half(at[k], 0)));
        let second = V::transpose(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| self.half(at[k], 1)));
        let column: [f32; LANES] = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| nodes.column(k) as f32);
        let (column, row) = (V::from_array(column), V::splat(nodes.j as f32));
        let d = [(column - first[0]) + u[0], (row - first[1]) + u[1]];
        let (value, tangents) = affine_samples(&first, &second, &d);
        Samples { value, tangents, triangle }
    }
}
