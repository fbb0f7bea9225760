//! The surface of a coarser level (method §3): metrics, interpolated bilinearly between nodes, and their derivatives.
//! Lengths are arc lengths.

use super::super::lanes::{LANES, Lanes, Mask, each};
use super::{BlockPlace, GradientTerms, GridRow, Samples, Slopes, Surface};
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::TINY;

/// The surface of a coarser level: L = sqrt(dᵀ ½(G_p + G_n) d).
#[derive(Clone, Copy)]
pub struct Metrics<'a> {
    pub level: &'a Level,
    /// Metrics (E, F, G) at the nodes, per block, in cell units of this level.
    pub metric: &'a [[Plane; 3]],
}

impl Metrics<'_> {
    /// The metrics at (i, j), (i + 1, j), (i, j + 1) and (i + 1, j + 1) in the chart of block `b`; `None` if one of
    /// these nodes is not stored.
    fn corners(&self, b: usize, i: i64, j: i64) -> Option<[[f32; 3]; 4]> {
        let holder = |i, j| self.level.blocks.holding(b, i, j);
        let [at_east, at_north] = [i, j].map(|n| n as usize % SIDE == SIDE - 1);
        let low = holder(i, j);
        let east = if at_east { holder(i + 1, j) } else { low };
        let north = if at_north { holder(i, j + 1) } else { low };
        let high = match (at_east, at_north) {
            (true, true) => holder(i + 1, j + 1),
            (true, false) => east,
            _ => north,
        };
        let is_stored = ![low, east, north, high].contains(&NONE);
        is_stored.then(|| {
            let nodes = [(low, i, j), (east, i + 1, j), (north, i, j + 1), (high, i + 1, j + 1)];
            each!([0, 1, 2, 3], |k| self.node(nodes[k].0, nodes[k].1, nodes[k].2))
        })
    }

    /// The metric at the node (i, j), which lies in `block`.
    #[inline(always)]
    fn node(&self, block: u32, i: i64, j: i64) -> [f32; 3] {
        let s = slot(i as usize % SIDE, j as usize % SIDE);
        let planes = &self.metric[block as usize];
        [planes[0][s], planes[1][s], planes[2][s]]
    }

    /// The metric at (s, t) in a cell, from the metrics at its corners.
    #[inline(always)]
    fn bilinear<V: Lanes>(corners: &[[V; 3]; 4], s: V, t: V) -> [V; 3] {
        let [g00, g10, g01, g11] = corners;
        let low = each!([0, 1, 2], |k| g00[k] + s * (g10[k] - g00[k]));
        let high = each!([0, 1, 2], |k| g01[k] + s * (g11[k] - g01[k]));
        each!([0, 1, 2], |k| low[k] + t * (high[k] - low[k]))
    }

    /// For a row's nodes displaced by u: the metrics at the corners of the cells that contain them, their coordinates
    /// in these cells, and the lanes that have a cell.
    #[inline(always)]
    fn cells<V: Lanes>(&self, nodes: &GridRow, u: &[V; 2], lanes: V::Mask) -> ([[V; 3]; 4], [V; 2], V::Mask) {
        let cell_origin = each!([0, 1], |c| u[c].floor());
        let coordinates = each!([0, 1], |c| u[c] - cell_origin[c]);
        let (x, y) = (cell_origin[0].to_array(), cell_origin[1].to_array());
        let planes = &self.metric[nodes.block];
        // Most cells lie within the block of the nodes.
        let (slots, inside) = BlockPlace::new(nodes, cell_origin).slots(SIDE - 1);
        let mut corners = [[[0.0f32; LANES]; 3]; 4];
        let (bits, mut lost) = (lanes.bits(), 0u8);
        for k in 0..LANES {
            if bits >> k & 1 == 0 {
                continue;
            }
            if inside >> k & 1 != 0 {
                let slot = slots[k];
                // Neighbours of a node have slots of other colours.
                let east = if slot & 64 == 0 { slot + 64 } else { slot - 63 };
                let north = if slot & 128 == 0 { 128 } else { 136u8 };
                for c in 0..3 {
                    let plane = &planes[c];
                    let at = [slot, east, slot.wrapping_add(north), east.wrapping_add(north)];
                    each!([0, 1, 2, 3], |n| corners[n][c][k] = plane[usize::from(at[n])]);
                }
                continue;
            }
            match self.corners(nodes.block, nodes.column(k) + x[k] as i64, nodes.j + y[k] as i64) {
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
        (corners, coordinates, lanes.and_not(V::Mask::from_bits(lost)))
    }
}

impl Surface for Metrics<'_> {
    const CHORDS: bool = false;

    #[inline(always)]
    fn sample_row<V: Lanes>(
        &self,
        nodes: &GridRow,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask {
        let (corners, [s, t], found) = self.cells(nodes, u, lanes);
        samples.value = Self::bilinear(&corners, s, t);
        found
    }

    #[inline(always)]
    fn at_nodes(&self) -> Option<&[[Plane; 3]]> {
        Some(self.metric)
    }

    #[inline(always)]
    fn tangents_row<V: Lanes>(&self, _triangle: &[u32; LANES]) -> Slopes<V> {
        [V::zero(); 6]
    }

    #[inline(always)]
    fn length<V: Lanes>(p: &[V; 3], _tangents: &Slopes<V>, n: &[V; 3], _same: V::Mask, d: &[V; 2]) -> V {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1]];
        ((along[0] * d[0] + along[1] * d[1]).max(V::zero()) + TINY).sqrt()
    }

    #[inline(always)]
    fn gradient<V: Lanes>(
        p: &[V; 3],
        _tangents: &Slopes<V>,
        slopes: &Slopes<V>,
        n: &[V; 3],
        _same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], GradientTerms<V>) {
        let g = each!([0, 1, 2], |k| (p[k] + n[k]) * 0.5);
        let along = [g[0] * d[0] + g[1] * d[1], g[1] * d[0] + g[2] * d[1], V::zero()];
        let length = ((along[0] * d[0] + along[1] * d[1]).max(V::zero()) + TINY).sqrt();
        let terms = GradientTerms { along, d: *d, inverse_length: V::one() / length };
        let half_change = half_change(&terms, slopes);
        let near = [
            (half_change[0] - along[0]) * terms.inverse_length,
            (half_change[1] - along[1]) * terms.inverse_length,
        ];
        (length, near, terms)
    }

    #[inline(always)]
    fn far_gradient<V: Lanes>(terms: &GradientTerms<V>, neighbour_slope: &Slopes<V>) -> [V; 2] {
        let half_change = half_change(terms, neighbour_slope);
        each!([0, 1], |k| (half_change[k] + terms.along[k]) * terms.inverse_length)
    }
}

/// The term of the gradient at one end that comes from the change of the metric: ¼ dᵀ (∂G/∂x) d and ¼ dᵀ (∂G/∂y) d.
#[inline(always)]
fn half_change<V: Lanes>(terms: &GradientTerms<V>, slope: &Slopes<V>) -> [V; 2] {
    let [x, y] = terms.d;
    let (xx, xy, yy) = (x * x, x * y * 2.0, y * y);
    each!([0, 3], |k| (slope[k] * xx + slope[k + 1] * xy + slope[k + 2] * yy) * 0.25)
}
