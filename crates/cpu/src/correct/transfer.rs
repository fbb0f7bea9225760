//! The transfers between a level and the next coarser one: the interpolation P of corrections, with weights that depend
//! on rigidity, and the restriction Pᵀ of residuals (method §7.4 and §7.5).

use super::super::decode::interpolation;
use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::super::prefetch::prefetch_next;
use super::super::prolong;
use super::super::run::Run;
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::grid::window::{self, Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

/// Sets the coarser level's right-hand side `r` to Pᵀ t at movable nodes, and to 0 at fixed ones.
pub fn restrict(run: &Run, finer: usize, t: &[[Plane; 3]], r: &mut [[Plane; 2]]) {
    let (fine, coarse) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let r = SharedSlice::new(r);
    let next = |b: usize| {
        for &child in coarse.children[b].iter().filter(|&&child| child != NONE) {
            prefetch_next(&t[child as usize]);
        }
    };
    run.each_block(finer + 1, next, |_, b, _| {
        // SAFETY: each item has its own block.
        let r = unsafe { r.get_mut(b) };
        *r = [[0.0; NODES]; 2];
        for (quarter, &child) in coarse.children[b].iter().enumerate() {
            // A block without movable nodes has no residual: its memory may hold older values.
            if child == NONE || !fine.blocks.list[child as usize].active {
                continue;
            }
            let neighbours = active_neighbours(fine, child as usize);
            let windows = &window::planes(&neighbours, |b, c| &t[b][c]);
            let (weights, movable) = (&interpolation(fine, &neighbours), &coarse.movable[b]);
            dispatch(RestrictQuarter { windows, weights, movable, quarter, r });
        }
    });
}

/// Applies Pᵀ to each of N planes of one fine block, and stores the sums at the 8x8 coarse nodes over it, a quarter of
/// the coarse block.
pub struct RestrictQuarter<'a, const N: usize> {
    pub windows: &'a [Window; N],
    pub weights: &'a Window,
    pub movable: &'a Plane<u8>,
    pub quarter: usize,
    pub r: &'a mut [Plane; N],
}

impl<const N: usize> Vectorised for RestrictQuarter<'_, N> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let RestrictQuarter { windows, weights, movable, quarter, r } = self;
        let (x, y) = (quarter % 2 * LANES, quarter / 2 * LANES);
        for j in 0..LANES {
            // Rows of fine nodes 2j - 1, 2j and 2j + 1; their columns 2i - 1 and 2i + 1.
            let rows = [2 * j, 2 * j + 1, 2 * j + 2];
            let west = each!([0, 1, 2], |k| V::one() - V::load(weights, place(0, rows[k])));
            let east = each!([0, 1, 2], |k| V::load(weights, place(2, rows[k])));
            let (south, north) =
                (V::one() - V::load(weights, place(1, rows[0])), V::load(weights, place(1, rows[2])));
            for (window, r) in windows.iter().zip(&mut *r) {
                let [low, middle, high] = each!([0, 1, 2], |k| {
                    let [l, c, r] = each!([0, 1, 2], |n| V::load(window, place(n, rows[k])));
                    c + (l * west[k] + r * east[k])
                });
                let sum = middle + (low * south + high * north);
                for (lane, sum) in sum.to_array().into_iter().enumerate() {
                    let s = slot(x + lane, y + j);
                    if movable[s] != 0 {
                        r[s] = sum;
                    }
                }
            }
        }
    }
}

/// The 3x3 neighbour blocks of block `b`, with NONE for those that are not active.
pub fn active_neighbours(level: &Level, b: usize) -> [u32; 9] {
    level.blocks.neighbours[b]
        .map(|b| if b != NONE && level.blocks.list[b as usize].active { b } else { NONE })
}

/// Sets the first two planes of `sum` to z plus P times the coarse direction.
pub fn add_coarse(run: &Run, finer: usize, z: &[[Plane; 2]], coarse: &[[Plane; 2]], sum: &mut [[Plane; 3]]) {
    let level = &run.grid.levels[finer];
    let sum = SharedSlice::new(sum);
    run.each_block(
        finer,
        |b| prefetch_next(&z[b]),
        |_, b, _| {
            let weights = interpolation(level, &level.blocks.neighbours[b]);
            // SAFETY: each item has its own block.
            let sum = unsafe { sum.get_mut(b) };
            for c in 0..2 {
                sum[c] = z[b][c];
                add_interpolated(run, finer, b, &weights, |b| &coarse[b][c], &mut sum[c]);
            }
        },
    );
}

/// Adds P times the planes of the coarser level, of which `coarse(b)` is that of coarse block `b`, to the plane `z` of
/// the finer block `b`.
pub fn add_interpolated<'a, T: Copy + Default + Into<f32> + 'a>(
    run: &Run,
    finer: usize,
    b: usize,
    weights: &Window,
    coarse: impl Fn(usize) -> &'a Plane<T>,
    z: &mut Plane,
) {
    let (fine_level, coarse_level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    if let Some(nodes) = prolong::coarse_nodes(fine_level, coarse_level, coarse, b) {
        dispatch(AddInterpolated { nodes: &nodes, weights, movable: &fine_level.movable[b], z });
    }
}

/// Adds the values that P interpolates from the coarse nodes over a block to the block's plane, at movable nodes.
struct AddInterpolated<'a> {
    nodes: &'a prolong::CoarseNodes,
    weights: &'a Window,
    movable: &'a Plane<u8>,
    z: &'a mut Plane,
}

impl Vectorised for AddInterpolated<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let AddInterpolated { nodes, weights, movable, z } = self;
        for j in 0..SIDE {
            // Interpolation along y, at coarse columns i (west) and i + 1 (east), then along x.
            let [west, east] = each!([0, 1], |k| {
                let low = V::load(&nodes[j / 2], k);
                if j % 2 == 0 {
                    low
                } else {
                    let weight = V::load(weights, place(1 + 2 * k, j + 1));
                    low * weight + V::load(&nodes[j / 2 + 1], k) * (V::one() - weight)
                }
            });
            let weight = V::load(weights, place(2, j + 1));
            for (ci, add) in [west, west * weight + east * (V::one() - weight)].into_iter().enumerate() {
                let s = slot(ci, j);
                let movable = V::zero().lt(V::load_u8(movable, s));
                (V::load(z, s) + movable.select(add, V::zero())).store(z, s);
            }
        }
    }
}
