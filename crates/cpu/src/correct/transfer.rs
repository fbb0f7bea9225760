//! The transfers between a level and the next coarser one: the interpolation P of corrections, with weights that depend
//! on rigidity, and the restriction Pᵀ of residuals (method §7.4 and §7.5).

use super::super::decode::interpolation;
use super::super::lanes::{LANES, Lanes, Vectorised, each};
use super::super::prefetch::nothing;
use super::super::prolong::{CoarseNodes, REACH};
use super::super::run::Run;
use vrtm_core::grid::Level;
use vrtm_core::grid::codes::decode_weight;
use vrtm_core::grid::planes::{Plane, SIDE, node_at, slot};
use vrtm_core::grid::window::{Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

/// The weights of P around a fine block: of each node between two coarse ones that of the lower one, in odd rows those
/// along x at odd columns, and those along y at even columns.
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

    /// Weights along y of row `w` of the window, an even one, at the coarse columns -1 to 8.
    #[inline(always)]
    fn along_y(&self, w: usize) -> [f32; REACH] {
        let mut weights = [self.west[w / 2]; REACH];
        weights[1..].copy_from_slice(&self.window[place(1, w)..][..REACH - 1]);
        weights
    }

    /// Weights along x of row `w` of the window, at the odd columns -1 to 15.
    #[inline(always)]
    fn along_x(&self, w: usize) -> &[f32] {
        &self.window[place(0, w)..][..REACH - 1]
    }

    /// Adds P times the values at coarse nodes to `z`. Fixed nodes get values, too.
    #[inline(always)]
    pub fn interpolate(&self, nodes: &CoarseNodes, z: &mut Window) {
        for w in 0..SIDE + 2 {
            // The coarse nodes' row, or between two of them.
            let mut row = nodes[w.div_ceil(2)];
            if w % 2 == 0 {
                let (low, weights) = (&nodes[w / 2], self.along_y(w));
                for k in 0..REACH {
                    row[k] = low[k] * weights[k] + nodes[w / 2 + 1][k] * (1.0 - weights[k]);
                }
            }
            let weights = self.along_x(w);
            let (odd, even) = (place(0, w), place(1, w));
            for k in 0..REACH - 1 {
                z[odd + k] += row[k] * weights[k] + row[k + 1] * (1.0 - weights[k]);
            }
            for k in 0..REACH - 1 {
                z[even + k] += row[k + 1];
            }
        }
    }

    /// Sets the first of `out` to Pᵀ t at the coarse nodes over the block, as in `CoarseNodes`.
    #[inline(always)]
    pub fn restrict(&self, t: &Window, out: &mut Plane) {
        out[..REACH * REACH].fill(0.0);
        for w in 0..SIDE + 2 {
            let (weights, mut row) = (self.along_x(w), [0.0; REACH]);
            let (odd, even) = (&t[place(0, w)..][..REACH - 1], &t[place(1, w)..][..REACH - 1]);
            for k in 0..REACH - 1 {
                row[k] = odd[k] * weights[k];
            }
            for k in 0..REACH - 1 {
                row[k + 1] += even[k] + odd[k] * (1.0 - weights[k]);
            }
            let low = w.div_ceil(2) * REACH;
            if w % 2 == 0 {
                let weights = self.along_y(w);
                for k in 0..REACH {
                    out[low + k] += row[k] * weights[k];
                    out[low + REACH + k] += row[k] * (1.0 - weights[k]);
                }
            } else {
                for k in 0..REACH {
                    out[low + k] += row[k];
                }
            }
        }
    }
}

/// Sets the coarser level's right-hand side `r` to Pᵀ t at movable nodes, and to 0 at fixed ones, from the fine
/// blocks' contributions (`Weights::restrict`).
pub fn sum_contributions(run: &Run, finer: usize, contributions: &[[Plane; 2]], r: &mut [[Plane; 2]]) {
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
    let mut neighbours = level.blocks.neighbours[b];
    for b in &mut neighbours {
        if *b != NONE && !level.blocks.list[*b as usize].active {
            *b = NONE;
        }
    }
    neighbours
}
