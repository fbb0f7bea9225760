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
use super::transfer::{Weights, active_neighbours, add_coarse, sum_contributions};
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
    for k in level..coarsest {
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        descend(run, k, &mut finer[k - level]);
        sum_contributions(run, k, finer[k - level].product, coarser[0].residual);
    }
    let mut dots = smooth_coarsest(run, coarsest, &mut levels[coarsest - level], coarsest == level);
    for k in (level..coarsest).rev() {
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        let SolvingLevel { rows, residual: r, direction, product } = &mut finer[k - level];
        add_coarse(run, k, direction, coarser[0].direction, product);
        let sweeps = Sweeps { count: SMOOTHER_SWEEPS, backwards: true };
        dots = smooth(run, k, rows, r, Some(product), direction, sweeps, k == level);
    }
    dots
}

/// The way down of a V-cycle on one level: sets the direction to the sweeps' result from 0, and the product to what the
/// blocks' residuals contribute to the coarser level. The direction is a sum over blocks, so each block takes the
/// residual of its own part, at its nodes and those of its halo, while it has its rows.
fn descend(run: &Run, level: usize, system: &mut SolvingLevel) {
    let grid = &run.grid.levels[level];
    let SolvingLevel { rows, residual: r, direction, product } = system;
    let (rows, r) = (&**rows, &**r);
    let (direction, product) = (SharedSlice::new(direction), SharedSlice::new(product));
    let next = |b: usize| {
        rows.prefetch_next(b);
        prefetch_next(&r[b]);
    };
    run.each_block(level, next, |worker, b, _| {
        // SAFETY: each item has its own block.
        let (z, contributions) = unsafe { (direction.get_mut(b), product.get_mut(b)) };
        let weights = &Weights::new(grid, b);
        run.pairs.with(worker, |pairs| {
            dispatch(Descend { rows: rows.block(b), pairs, r: &r[b], weights, z, contributions });
        });
    });
}

/// `descend` in one block.
struct Descend<'a> {
    rows: BlockRows<'a>,
    pairs: &'a mut Pairs,
    r: &'a [Plane; 2],
    weights: &'a Weights,
    z: &'a mut [Plane; 2],
    contributions: &'a mut [Plane; 3],
}

impl Vectorised for Descend<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Descend { rows, pairs, r, weights, z, contributions } = self;
        let (mut windows, mut sums) = ([[0.0; WINDOW_NODES]; 2], [[0.0; WINDOW_NODES]; 2]);
        rows.pairs::<V>(pairs);
        let sweeps = Sweeps { count: SMOOTHER_SWEEPS, backwards: false };
        smooth_block::<V>(&rows, pairs, r, sweeps, true, &mut windows);
        rows.add_product::<V>(&windows, &mut sums);
        for sum in sums.as_flattened_mut() {
            *sum = -*sum;
        }
        for row in Row::all() {
            let [x, y] = each!([0, 1], |c| row.near::<V>(&windows[c], 0, 0));
            let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&rows.diagonal[c]));
            for (c, product) in [xx * x + xy * y, xy * x + yy * y].into_iter().enumerate() {
                let rest = row.near::<V>(&sums[c], 0, 0) + (row.load::<V>(&r[c]) - product);
                row.store_in_window(&mut sums[c], rest);
            }
            row.store(&mut z[0], x);
            row.store(&mut z[1], y);
        }
        for c in 0..2 {
            weights.restrict::<V>(&sums[c], &mut contributions[c]);
        }
    }
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
        let (rows, r, windows, from_zero) = (rows.block(b), &r[b], &mut windows, before.is_none());
        // SAFETY: each item has its own block.
        let z = unsafe { after.get_mut(b) };
        let smooth =
            |pairs: &mut _| dispatch(SmoothBlock { rows, pairs, r, windows, sweeps, from_zero, dot, z });
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
    from_zero: bool,
    /// True to compute r·z.
    dot: bool,
    z: &'a mut [Plane],
}

impl Vectorised for SmoothBlock<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        self.rows.pairs::<V>(self.pairs);
        smooth_block::<V>(&self.rows, self.pairs, self.r, self.sweeps, self.from_zero, self.windows);
        for row in Row::all() {
            for c in 0..2 {
                row.store(&mut self.z[c], row.near::<V>(&self.windows[c], 0, 0));
            }
        }
        if self.dot { dot::<V>(self.r, self.z) } else { 0.0 }
    }
}

/// Sweeps inside a block. Fixed nodes stay 0, because their right-hand sides and pairs are 0. `from_zero`: z is 0, so that
/// the first sweep, forwards, leaves out neighbours that it has not reached yet.
#[inline(always)]
fn smooth_block<V: Lanes>(
    rows: &BlockRows,
    pairs: &Pairs,
    r: &[Plane; 2],
    sweeps: Sweeps,
    from_zero: bool,
    z: &mut [Window; 2],
) {
    if from_zero {
        each!([0, 1, 2, 3], |colour| {
            for row in Row::of_colour(colour) {
                let known = |di: i64, dj: i64| colour ^ (di & 1) as usize ^ (dj & 1) as usize * 2 < colour;
                let product = off_diagonal::<V>(pairs, row, z, known);
                smooth_row::<V>(rows.diagonal, r, row, product, z);
            }
        });
    }
    for _ in u32::from(from_zero)..sweeps.count {
        for k in 0..4 {
            for row in Row::of_colour(if sweeps.backwards { 3 - k } else { k }) {
                let product = off_diagonal::<V>(pairs, row, z, |_, _| true);
                smooth_row::<V>(rows.diagonal, r, row, product, z);
            }
        }
    }
}

/// Solves the equations of a row's nodes, given the products of their pairs.
#[inline(always)]
fn smooth_row<V: Lanes>(
    diagonal: &[Plane; 3],
    r: &[Plane; 2],
    row: Row,
    product: [V; 2],
    z: &mut [Window; 2],
) {
    let (rx, ry) = (row.load::<V>(&r[0]) - product[0], row.load::<V>(&r[1]) - product[1]);
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&diagonal[c]));
    let inverse = V::one() / (xx * yy - xy * xy);
    row.store_in_window(&mut z[0], (yy * rx - xy * ry) * inverse);
    row.store_in_window(&mut z[1], (xx * ry - xy * rx) * inverse);
}

/// The sum of A_pn z_n over the neighbours for whose offsets `known` is true.
#[inline(always)]
fn off_diagonal<V: Lanes>(
    pairs: &Pairs,
    row: Row,
    z: &[Window; 2],
    known: impl Fn(i64, i64) -> bool,
) -> [V; 2] {
    let mut sum = [V::zero(); 2];
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        if known(di, dj) {
            let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
            let pair = each!([0, 1, 2, 3], |c| row.near::<V>(&pairs[4 * e + c], oi, oj));
            let (b, c) = if neighbour_owns { (pair[2], pair[1]) } else { (pair[1], pair[2]) };
            let (x, y) = (row.near::<V>(&z[0], di, dj), row.near::<V>(&z[1], di, dj));
            sum[0] += pair[0] * x + b * y;
            sum[1] += c * x + pair[3] * y;
        }
    });
    sum
}

/// Sets the first two planes of `out` to A v, and returns the dot product of v and A v per chart.
pub fn multiply(run: &Run, level: usize, rows: &Rows, v: &[[Plane; 2]], out: &mut [[Plane; 3]]) -> Vec<f64> {
    let neighbours = &run.grid.levels[level].blocks.neighbours;
    let out = SharedSlice::new(out);
    let next = |b: usize| {
        rows.prefetch_next(b);
        prefetch_next(&v[b]);
    };
    run.sum_blocks(level, next, |_, b| {
        let v = &window::planes(&neighbours[b], |b, c| &v[b][c]);
        // SAFETY: each item has its own block.
        let out = unsafe { out.get_mut(b) };
        f64::from(dispatch(BlockProduct { rows: rows.block(b), v, out }))
    })
}

/// Computes A v for one block, and returns the block's part of the dot product of v and A v.
struct BlockProduct<'a> {
    rows: BlockRows<'a>,
    v: &'a [Window; 2],
    out: &'a mut [Plane; 3],
}

impl Vectorised for BlockProduct<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        let BlockProduct { rows, v, out } = self;
        let mut sums = [[0.0; WINDOW_NODES]; 2];
        rows.add_product::<V>(v, &mut sums);
        let mut dot = V::zero();
        for row in Row::all() {
            let product = with_diagonal::<V>(&rows, row, v, &sums);
            for c in 0..2 {
                row.store(&mut out[c], product[c]);
                dot += product[c] * row.near::<V>(&v[c], 0, 0);
            }
        }
        dot.sum()
    }
}

/// A z for one row, where `sums` are the products of its pairs.
#[inline(always)]
pub fn with_diagonal<V: Lanes>(rows: &BlockRows, row: Row, z: &[Window; 2], sums: &[Window; 2]) -> [V; 2] {
    let (x, y) = (row.near::<V>(&z[0], 0, 0), row.near::<V>(&z[1], 0, 0));
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&rows.diagonal[c]));
    [row.near::<V>(&sums[0], 0, 0) + (xx * x + xy * y), row.near::<V>(&sums[1], 0, 0) + (xy * x + yy * y)]
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
