//! The transfers between a level and the next coarser one: the interpolation P of corrections, with weights that depend
//! on rigidity, and the restriction Pᵀ of residuals (method §7.4 and §7.5).

use super::super::decode::interpolation;
use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::super::prefetch::{nothing, prefetch_next};
use super::super::prolong;
use super::super::run::Run;
use vrtm_core::grid::Level;
use vrtm_core::grid::codes::decode_weight;
use vrtm_core::grid::planes::{Plane, SIDE, node_at, slot};
use vrtm_core::grid::window::{Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

/// Coarse nodes on a side to which a fine block and its halo contribute: the 8 over the block, and one on each side.
const REACH: usize = SIDE / 2 + 2;

/// The weights of P around a fine block.
pub struct Weights {
    /// Weights in the block's window.
    window: Window,
    /// Weights in the odd rows of the window's nodes, -1 to 15, of the column -2, one column west of it.
    west: [f32; SIDE / 2 + 1],
}

impl Weights {
    pub fn new(level: &Level, b: usize) -> Weights {
        let neighbours = &level.blocks.neighbours[b];
        let weight = |k: usize, j: usize| match neighbours[k] {
            NONE => 0.0,
            b => decode_weight(level.interpolation[b as usize][slot(SIDE - 2, j)]),
        };
        let west = std::array::from_fn(|n| if n == 0 { weight(0, SIDE - 1) } else { weight(3, 2 * n - 1) });
        Weights { window: interpolation(level, neighbours), west }
    }

    /// Sets `out` to Pᵀ t at the coarse nodes (-1..=8, -1..=8) over the block, row-major, where `t` is given in the
    /// window.
    #[inline(always)]
    pub fn restrict<V: Lanes>(&self, t: &Window, out: &mut Plane) {
        let weights = &self.window;
        // Along x, for row `w` of the window: the coarse columns 0 to 7, and the columns -1 and 8.
        let along_x = |w: usize| {
            let [l, c, r] = each!([0, 1, 2], |n| V::load(t, place(n, w)));
            let (west, east) = (V::one() - V::load(weights, place(0, w)), V::load(weights, place(2, w)));
            let (last, end) = (place(SIDE, w), place(SIDE + 1, w));
            let ends = [t[place(0, w)] * weights[place(0, w)], t[end] + t[last] * (1.0 - weights[last])];
            (c + (l * west + r * east), ends)
        };
        // Weights along y of the window's row `w`, an even one, for the coarse row below it.
        let along_y =
            |w: usize| (V::load(weights, place(1, w)), [self.west[w / 2], weights[place(SIDE + 1, w)]]);
        let (mut low, mut below) = ((V::zero(), [0.0; 2]), (V::one(), [1.0; 2]));
        for j in 0..REACH {
            let mut sum = low.0 * (V::one() - below.0);
            let mut ends = each!([0, 1], |k| low.1[k] * (1.0 - below.1[k]));
            if j > 0 {
                let middle = along_x(2 * j - 1);
                sum += middle.0;
                each!([0, 1], |k| ends[k] += middle.1[k]);
            }
            if j < REACH - 1 {
                (low, below) = (along_x(2 * j), along_y(2 * j));
                sum += low.0 * below.0;
                each!([0, 1], |k| ends[k] += low.1[k] * below.1[k]);
            }
            let row = &mut out[REACH * j..REACH * (j + 1)];
            sum.store(row, 1);
            [row[0], row[REACH - 1]] = ends;
        }
    }
}

/// Sets the coarser level's right-hand side `r` to Pᵀ t at movable nodes, and to 0 at fixed ones, from what the fine
/// blocks contribute to it (`Weights::restrict`).
pub fn sum_contributions(run: &Run, finer: usize, contributions: &[[Plane; 3]], r: &mut [[Plane; 2]]) {
    let (fine, coarse) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    // For the fine blocks -1, 0, 1 and 2 of an axis: the first of the coarse block's nodes that they reach, the number
    // of these, and the first of their own.
    const RANGES: [(usize, usize, usize); 4] =
        [(0, 1, REACH - 1), (0, REACH - 1, 1), (SIDE / 2 - 1, REACH - 1, 0), (SIDE - 1, 1, 0)];
    let r = SharedSlice::new(r);
    run.each_block(finer + 1, nothing, |_, b, _| {
        let mut sums = [[[0.0; SIDE]; SIDE]; 2];
        for (y, &(to_y, rows, from_y)) in RANGES.iter().enumerate() {
            for (x, &(to_x, columns, from_x)) in RANGES.iter().enumerate() {
                let parent = coarse.blocks.neighbours[b][y.div_ceil(2) * 3 + x.div_ceil(2)];
                if parent == NONE {
                    continue;
                }
                let child = coarse.children[parent as usize][(y + 1) % 2 * 2 + (x + 1) % 2];
                // A block without movable nodes has no residual: its memory may hold older values.
                if child == NONE || !fine.blocks.list[child as usize].active {
                    continue;
                }
                for (sums, from) in sums.iter_mut().zip(&contributions[child as usize]) {
                    for j in 0..rows {
                        let from = &from[REACH * (from_y + j) + from_x..][..columns];
                        let to = &mut sums[to_y + j][to_x..to_x + columns];
                        to.iter_mut().zip(from).for_each(|(to, from)| *to += from);
                    }
                }
            }
        }
        // SAFETY: each item has its own block.
        let r = unsafe { r.get_mut(b) };
        for (r, sums) in r.iter_mut().zip(&sums) {
            for (s, (r, &movable)) in r.iter_mut().zip(&coarse.movable[b]).enumerate() {
                let (i, j) = node_at(s);
                *r = if movable != 0 { sums[j][i] } else { 0.0 };
            }
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
