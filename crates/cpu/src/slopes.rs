//! Slopes of the surface at the warped nodes (method §2, Slopes), from which gradients of lengths are formed. A slope
//! comes from the differences of the samples of a node's neighbours, so it depends continuously on the state; the
//! derivatives of the surface itself jump at the edges of triangles, and those of metrics at the nodes.

use std::hint::black_box;

use vrtm_core::grid::planes::{SIDE, slot};
use vrtm_core::grid::window::{Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::TANGENT_WEIGHT;

use super::lanes::{LANES, Lanes, Mask, each};
use super::patch::{NodeState, Patch, Source};
use super::row::Row;
use super::sampling::{Slopes, Surface};

/// The neighbours along the axes: two on the x axis, two on the y axis.
const ENDS: [(i64, i64); 4] = [(-1, 0), (1, 0), (0, -1), (0, 1)];

/// One neighbour of each of eight nodes.
#[derive(Clone, Copy)]
struct End<V: Lanes> {
    /// Offset from W of the node to W of the neighbour, in cells.
    offset: [V; 2],
    value: [V; 3],
    triangle: V::Index,
}

impl Patch {
    /// The slopes at a row's nodes.
    #[inline(always)]
    pub fn slopes<V: Lanes, S: Surface>(&self, row: Row, p: &NodeState<V>) -> Slopes<V> {
        let ends = each!([0, 1, 2, 3], |k| {
            let (di, dj) = ENDS[k];
            End {
                offset: row.offset(&self.u, &p.u, di, dj),
                value: each!([0, 1, 2], |c| row.near(&self.value[c], di, dj)),
                triangle: row.near_index::<V>(&self.triangle, di, dj),
            }
        });
        from_ends::<V, S>(&p.samples.tangents, p.samples.triangle, &ends)
    }

    /// Sets `slopes` at the movable nodes of the window with stiff edges to nodes of the block. The halo is included,
    /// because the far end of an edge moves with its own slope.
    ///
    /// # Safety
    /// Nothing writes the state meanwhile.
    #[inline(always)]
    pub unsafe fn window_slopes<V: Lanes, S: Surface>(&self, source: &Source<S>, slopes: &mut [Window; 6]) {
        for row in Row::all() {
            let (this, slopes, row) = black_box((self, &mut *slopes, row));
            if this.movable_lanes::<V>(row).any() && this.stiff[row.index()] {
                let x = this.slopes::<V, S>(row, &this.node_state(row));
                each!([0, 1, 2, 3, 4, 5], |c| row.store_in_window(&mut slopes[c], x[c]));
            }
        }
        // The movable nodes of the halo, eight at a time.
        let mut places = [(0usize, 0usize); LANES];
        let mut count = 0;
        for k in 0..SIDE + 1 {
            for (i, j) in [(k, 0), (SIDE + 1, k), (k + 1, SIDE + 1), (0, k + 1)] {
                if self.movable[place(i, j)] != 0.0 && self.is_stiff_in_halo(i, j) {
                    places[count] = (i, j);
                    count += 1;
                }
                if count == LANES {
                    // SAFETY: promised by the caller.
                    unsafe { self.halo_slopes::<V, S>(source, &places, slopes) };
                    count = 0;
                }
            }
        }
        if count > 0 {
            let first = places[0];
            places[count..].fill(first);
            // SAFETY: promised by the caller.
            unsafe { self.halo_slopes::<V, S>(source, &places, slopes) };
        }
    }

    /// True if the node of the halo at place (i, j), or a node of the block beside it, is rigid.
    #[inline(always)]
    fn is_stiff_in_halo(&self, i: usize, j: usize) -> bool {
        let inside = |n: usize, d: usize| (n + d).clamp(2, SIDE + 1) - 1;
        let beside = each!([0, 1, 2], |n| match j % (SIDE + 1) {
            0 => self.rigidity[place(inside(i, n), inside(j, 1))],
            _ => self.rigidity[place(inside(i, 1), inside(j, n))],
        });
        self.rigidity[place(i, j)].max(beside[0]).max(beside[1]).max(beside[2]) > 0.0
    }

    /// Sets the slopes at eight nodes of the halo, given by their places in the window.
    ///
    /// # Safety
    /// Nothing writes the state meanwhile.
    #[inline(always)]
    unsafe fn halo_slopes<V: Lanes, S: Surface>(
        &self,
        source: &Source<S>,
        places: &[(usize, usize); LANES],
        slopes: &mut [Window; 6],
    ) {
        let mut own = [[0.0f32; LANES]; 2];
        let mut own_triangle = [NONE; LANES];
        let mut offset = [[[0.0f32; LANES]; 2]; 4];
        let mut value = [[[0.0f32; LANES]; 3]; 4];
        let mut triangle = [[NONE; LANES]; 4];
        for (lane, &(i, j)) in places.iter().enumerate() {
            let at = place(i, j);
            for c in 0..2 {
                own[c][lane] = self.u[c][at];
            }
            if S::CHORDS {
                own_triangle[lane] = self.triangle[at];
            }
            for (k, (di, dj)) in ENDS.into_iter().enumerate() {
                // SAFETY: promised by the caller.
                let (u, x, t) = unsafe { self.node(source, i as i64 + di, j as i64 + dj) };
                offset[k][0][lane] = (u[0] - own[0][lane]) + di as f32;
                offset[k][1][lane] = (u[1] - own[1][lane]) + dj as f32;
                for c in 0..3 {
                    value[k][c][lane] = x[c];
                }
                triangle[k][lane] = t;
            }
        }
        let ends = each!([0, 1, 2, 3], |k| End {
            offset: each!([0, 1], |c| V::from_array(offset[k][c])),
            value: each!([0, 1, 2], |c| V::from_array(value[k][c])),
            triangle: V::index_from_array(triangle[k]),
        });
        let tangents = source.surface.tangents_row::<V>(&own_triangle);
        let found = from_ends::<V, S>(&tangents, V::index_from_array(own_triangle), &ends);
        for c in 0..6 {
            let x = found[c].to_array();
            for (lane, &(i, j)) in places.iter().enumerate() {
                slopes[c][place(i, j)] = x[lane];
            }
        }
    }

    /// Displacement, value and triangle at place (i, j) of the window, where i and j run from -1 to 18: one node beyond
    /// the halo.
    ///
    /// # Safety
    /// Nothing writes the state meanwhile.
    #[inline(always)]
    unsafe fn node<S: Surface>(&self, source: &Source<S>, i: i64, j: i64) -> ([f32; 2], [f32; 3], u32) {
        const LAST: i64 = SIDE as i64 + 1;
        let &Source { level, state, .. } = source;
        if (0..=LAST).contains(&i) && (0..=LAST).contains(&j) {
            let at = place(i as usize, j as usize);
            return (
                each!([0, 1], |c| self.u[c][at]),
                each!([0, 1, 2], |c| self.value[c][at]),
                self.triangle[at],
            );
        }
        let (x, y) = ((i + SIDE as i64 - 1) as usize, (j + SIDE as i64 - 1) as usize);
        match level.blocks.neighbours[source.b][y / SIDE * 3 + x / SIDE] {
            NONE => ([0.0; 2], [0.0; 3], NONE),
            b => {
                let (b, s) = (b as usize, slot(x % SIDE, y % SIDE));
                // SAFETY: promised by the caller.
                let (u, value) = unsafe { (state.u.get(b), state.value.get(b)) };
                // SAFETY: promised by the caller.
                let triangle = if S::CHORDS { unsafe { state.triangle.get(b)[s] } } else { NONE };
                (each!([0, 1], |c| u[c][s]), each!([0, 1, 2], |c| value[c][s]), triangle)
            }
        }
    }
}

/// The slopes from the samples at the four neighbours: the matrix S with S ΔW = ΔF, where ΔW and ΔF are the differences
/// between the two neighbours on each axis. On the finest level a small part of the tangents is mixed in; if all of
/// these nodes lie on one triangle, the slopes are its tangents, which suffer no cancellation.
#[inline(always)]
fn from_ends<V: Lanes, S: Surface>(
    tangents: &Slopes<V>,
    triangle: V::Index,
    ends: &[End<V>; 4],
) -> Slopes<V> {
    let [west, east, south, north] = ends;
    let wx = each!([0, 1], |c| east.offset[c] - west.offset[c]);
    let wy = each!([0, 1], |c| north.offset[c] - south.offset[c]);
    // The determinant is the sum of the four corner Jacobians at the node, which are positive.
    let inverse = V::one() / (wx[0] * wy[1] - wx[1] * wy[0]);
    let slopes = each!([0, 1, 2, 3, 4, 5], |k| {
        let c = k % 3;
        let (fx, fy) = (east.value[c] - west.value[c], north.value[c] - south.value[c]);
        (if k < 3 { fx * wy[1] - fy * wx[1] } else { fy * wx[0] - fx * wy[0] }) * inverse
    });
    if !S::CHORDS {
        return slopes;
    }
    let mut same = V::index_eq(west.triangle, triangle);
    for end in [east, south, north] {
        same = same.and(V::index_eq(end.triangle, triangle));
    }
    each!([0, 1, 2, 3, 4, 5], |k| {
        same.select(tangents[k], slopes[k] + (tangents[k] - slopes[k]) * TANGENT_WEIGHT)
    })
}
