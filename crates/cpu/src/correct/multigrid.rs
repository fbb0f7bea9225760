//! The preconditioner of conjugate gradients: a V(3,3) cycle (method §7.4). The smoother is additive over blocks of
//! nodes, which are therefore independent of one another; inside a block it is Gauss-Seidel of 2x2 matrices in four
//! node colours. It runs backwards after the coarse correction, so that the cycle is symmetric, as conjugate gradients
//! require.

use super::super::lanes::{LANES, Lanes, Vectorised, dispatch, each};
use super::super::patch::NEIGHBOURS;
use super::super::prefetch::prefetch_next;
use super::super::row::Row;
use super::super::run::Run;
use super::rows::{BlockRows, Pairs, Rows};
use super::transfer::{active_neighbours, add_coarse, restrict};
use super::workspace::SolvingLevel;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::{COARSEST_SWEEPS, SMOOTHER_SWEEPS};
use vrtm_core::team::SharedSlice;

/// Runs a V-cycle: direction = M⁻¹ residual on `level`, which is the first one of `levels`. Returns the dot product of
/// residual and direction per chart. The residual of `level` is not changed.
pub fn precondition(run: &Run, level: usize, levels: &mut [SolvingLevel]) -> Vec<f64> {
    let coarsest = level + levels.len() - 1;
    let sweeps = Sweeps { count: SMOOTHER_SWEEPS, backwards: false };
    for k in level..coarsest {
        let system = &mut levels[k - level];
        let SolvingLevel { rows, residual: r, direction, .. } = system;
        smooth(run, k, rows, r, None::<&[[Plane; 2]]>, direction, sweeps, false);
        multiply(run, k, rows, direction, Some(r), system.product);
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        restrict(run, k, finer[k - level].product, coarser[0].residual);
    }
    let mut dots = smooth_coarsest(run, coarsest, &mut levels[coarsest - level], coarsest == level);
    for k in (level..coarsest).rev() {
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        let SolvingLevel { rows, residual: r, direction, product } = &mut finer[k - level];
        add_coarse(run, k, direction, coarser[0].direction, product);
        let sweeps = Sweeps { backwards: true, ..sweeps };
        dots = smooth(run, k, rows, r, Some(product), direction, sweeps, k == level);
    }
    dots
}

/// Approximately solves the coarsest level: a pass forwards, from 0, and one backwards, with more sweeps than
/// elsewhere. Returns what `smooth` does.
fn smooth_coarsest(run: &Run, level: usize, system: &mut SolvingLevel, dot: bool) -> Vec<f64> {
    let SolvingLevel { rows, residual: r, direction, product } = system;
    let sweeps = Sweeps { count: COARSEST_SWEEPS, backwards: false };
    smooth(run, level, rows, r, None::<&[[Plane; 2]]>, product, sweeps, false);
    smooth(run, level, rows, r, Some(&**product), direction, Sweeps { backwards: true, ..sweeps }, dot)
}

/// The sweeps of a pass, in this order of the node colours or the other.
#[derive(Clone, Copy)]
struct Sweeps {
    count: u32,
    backwards: bool,
}

/// A pass of the smoother of A z = r over all blocks, from `before` (`None`: from 0) to the first two planes of
/// `after`: all sweeps of a block are done while it is in the cache, with its halo frozen at `before`. Returns r·z per
/// chart, or 0 without `dot`.
#[expect(
    clippy::too_many_arguments,
    reason = "the vectors of a level, which lie in memory of several shapes"
)]
fn smooth<const N: usize, const M: usize>(
    run: &Run,
    level: usize,
    rows: &Rows,
    r: &[[Plane; 2]],
    before: Option<&[[Plane; N]]>,
    after: &mut [[Plane; M]],
    sweeps: Sweeps,
    dot: bool,
) -> Vec<f64> {
    let grid = &run.grid.levels[level];
    let after = SharedSlice::new(after);
    let next = |b: usize| {
        rows.prefetch_next(b);
        prefetch_next(&r[b]);
        if let Some(before) = before {
            prefetch_next(&before[b]);
        }
    };
    run.sum_blocks(level, next, |worker, b| {
        let mut windows = match before {
            None => [[0.0; WINDOW_NODES]; 2],
            // A block without movable nodes has no z; its memory may hold other quantities.
            Some(before) => window::planes(&active_neighbours(grid, b), |b, c| &before[b][c]),
        };
        let (rows, r, windows) = (rows.block(b), &r[b], &mut windows);
        // SAFETY: each item has its own block.
        let z = unsafe { after.get_mut(b) };
        let smooth = |pairs: &mut _| dispatch(SmoothBlock { rows, pairs, r, windows, sweeps, dot, z });
        f64::from(run.pairs.with(worker, smooth))
    })
}

/// Does sweeps inside one block with its halo frozen, and stores the result in `z`. Returns the
/// block's part of r·z, or 0 without `dot`.
struct SmoothBlock<'a> {
    rows: BlockRows<'a>,
    pairs: &'a mut Pairs,
    r: &'a [Plane; 2],
    windows: &'a mut [Window; 2],
    sweeps: Sweeps,
    /// True to compute r·z.
    dot: bool,
    z: &'a mut [Plane],
}

impl Vectorised for SmoothBlock<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        self.rows.pairs::<V>(self.pairs);
        for _ in 0..self.sweeps.count {
            smooth_block::<V>(self.rows.diagonal, self.pairs, self.r, self.sweeps.backwards, self.windows);
        }
        for row in Row::all() {
            for c in 0..2 {
                row.store(&mut self.z[c], row.near::<V>(&self.windows[c], 0, 0));
            }
        }
        if self.dot { dot::<V>(self.r, self.z) } else { 0.0 }
    }
}

/// One sweep inside a block. Fixed nodes stay 0, because their right-hand sides and pairs are 0.
#[inline(always)]
fn smooth_block<V: Lanes>(
    diagonal: &[Plane; 3],
    pairs: &Pairs,
    r: &[Plane; 2],
    backwards: bool,
    z: &mut [Window; 2],
) {
    for k in 0..4 {
        for row in Row::of_colour(if backwards { 3 - k } else { k }) {
            let [ax, ay] = off_diagonal::<V>(pairs, row, z);
            let (rx, ry) = (row.load::<V>(&r[0]) - ax, row.load::<V>(&r[1]) - ay);
            let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&diagonal[c]));
            let inverse = V::one() / (xx * yy - xy * xy);
            row.store_in_window(&mut z[0], (yy * rx - xy * ry) * inverse);
            row.store_in_window(&mut z[1], (xx * ry - xy * rx) * inverse);
        }
    }
}

/// The sum over neighbours of A_pn z_n.
#[inline(always)]
fn off_diagonal<V: Lanes>(pairs: &Pairs, row: Row, z: &[Window; 2]) -> [V; 2] {
    let mut sum = [V::zero(); 2];
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
        let pair = each!([0, 1, 2, 3], |c| row.near::<V>(&pairs[4 * e + c], oi, oj));
        let (b, c) = if neighbour_owns { (pair[2], pair[1]) } else { (pair[1], pair[2]) };
        let (x, y) = (row.near::<V>(&z[0], di, dj), row.near::<V>(&z[1], di, dj));
        sum[0] += pair[0] * x + b * y;
        sum[1] += c * x + pair[3] * y;
    });
    sum
}

/// A z for one row.
#[inline(always)]
pub fn product<V: Lanes>(diagonal: &[Plane; 3], pairs: &Pairs, row: Row, z: &[Window; 2]) -> [V; 2] {
    let [ax, ay] = off_diagonal::<V>(pairs, row, z);
    let (x, y) = (row.near::<V>(&z[0], 0, 0), row.near::<V>(&z[1], 0, 0));
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&diagonal[c]));
    [ax + xx * x + xy * y, ay + xy * x + yy * y]
}

/// Sets the first two planes of `out` to A v, and returns the dot product of v and A v per chart; or to r - A v, given
/// `r`.
pub fn multiply(
    run: &Run,
    level: usize,
    rows: &Rows,
    v: &[[Plane; 2]],
    r: Option<&[[Plane; 2]]>,
    out: &mut [[Plane; 3]],
) -> Vec<f64> {
    let neighbours = &run.grid.levels[level].blocks.neighbours;
    let out = SharedSlice::new(out);
    let next = |b: usize| {
        rows.prefetch_next(b);
        prefetch_next(&v[b]);
        if let Some(r) = r {
            prefetch_next(&r[b]);
        }
    };
    run.sum_blocks(level, next, |worker, b| {
        let windows = &window::planes(&neighbours[b], |b, c| &v[b][c]);
        let (rows, v, r) = (rows.block(b), &v[b], r.map(|r| &r[b]));
        // SAFETY: each item has its own block.
        let out = unsafe { out.get_mut(b) };
        let multiply = |pairs: &mut _| dispatch(BlockProduct { rows, pairs, windows, v, r, out });
        f64::from(run.pairs.with(worker, multiply))
    })
}

/// Computes A v for one block, and returns the block's part of the dot product of v and A v; or r - A v, given `r`.
struct BlockProduct<'a> {
    rows: BlockRows<'a>,
    pairs: &'a mut Pairs,
    windows: &'a [Window; 2],
    v: &'a [Plane; 2],
    r: Option<&'a [Plane; 2]>,
    out: &'a mut [Plane; 3],
}

impl Vectorised for BlockProduct<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        self.rows.pairs::<V>(self.pairs);
        for row in Row::all() {
            let product = product::<V>(self.rows.diagonal, self.pairs, row, self.windows);
            for c in 0..2 {
                let stored = match self.r {
                    Some(r) => row.load::<V>(&r[c]) - product[c],
                    None => product[c],
                };
                row.store(&mut self.out[c], stored);
            }
        }
        if self.r.is_some() { 0.0 } else { dot::<V>(self.v, &*self.out) }
    }
}

/// The dot product of two vectors in one block, in a fixed order.
#[inline(always)]
fn dot<V: Lanes>(a: &[Plane; 2], b: &[Plane]) -> f32 {
    let mut sum = V::zero();
    for c in 0..2 {
        for s in (0..NODES).step_by(LANES) {
            sum += V::load(&a[c], s) * V::load(&b[c], s);
        }
    }
    sum.sum()
}
