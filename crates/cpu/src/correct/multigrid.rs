//! The preconditioner of conjugate gradients: a V(3,3) cycle (method §7.4). The smoother is additive over blocks of
//! nodes, which are therefore independent of one another; inside a block it is Gauss-Seidel of 2x2 matrices in four
//! node colours. It runs backwards after the coarse correction, so that the cycle is symmetric, as conjugate gradients
//! require.

use super::super::lanes::{Lanes, Vectorised, dispatch, each};
use super::super::prefetch::prefetch;
use super::super::prolong::{CoarseNodes, coarse_nodes};
use super::super::row::{NEIGHBOURS, Row};
use super::super::run::Run;
use super::rows::{BlockRows, Rows, WordWindows, decode};
use super::transfer::{Weights, active_neighbours, sum_contributions};
use super::workspace::SolvingLevel;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::{COARSEST_SWEEPS, SMOOTHER_SWEEPS};
use vrtm_core::team::SharedSlice;

/// Runs a V-cycle: direction = M⁻¹ residual on `level`, which is the first one of `levels`. Returns the dot product of
/// residual and direction per chart. The residual of `level` is not changed.
pub fn precondition(run: &Run, level: usize, levels: &mut [SolvingLevel]) -> Vec<f64> {
    let coarsest = level + levels.len() - 1;
    for k in level..coarsest {
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        let system = &mut finer[k - level];
        descend(run, k, system, SMOOTHER_SWEEPS, true);
        sum_contributions(run, k, system.direction, coarser[0].residual);
    }
    // The coarsest level has more sweeps than the others.
    let last = &mut levels[coarsest - level];
    descend(run, coarsest, last, COARSEST_SWEEPS, false);
    let mut dots = ascend(run, coarsest, last, COARSEST_SWEEPS, None, coarsest == level);
    for k in (level..coarsest).rev() {
        let (finer, coarser) = levels.split_at_mut(k - level + 1);
        let coarse = Some(&*coarser[0].direction);
        dots = ascend(run, k, &mut finer[k - level], SMOOTHER_SWEEPS, coarse, k == level);
    }
    dots
}

/// The way down on one level: sweeps from 0, to the first two planes of the product. If it `contributes`, the direction
/// becomes the blocks' contributions to the residual of the coarser level: the result is a sum over blocks, so each
/// block takes the residual of its own part, at its nodes and those of its halo, while it has its rows.
fn descend(run: &Run, level: usize, system: &mut SolvingLevel, sweeps: u32, contributes: bool) {
    let grid = &run.grid.levels[level];
    let SolvingLevel { rows, residual: r, direction, product } = system;
    let (rows, r) = (&**rows, &**r);
    let (contributions, z) = (SharedSlice::new(direction), SharedSlice::new(product));
    let next = |b: usize| {
        rows.prefetch(b);
        prefetch(&r[b]);
    };
    run.each_block(level, next, |worker, b, _| {
        // SAFETY: each item has its own block.
        let (z, contributions) = unsafe { (z.get_mut(b), contributions.get_mut(b)) };
        let weights = contributes.then(|| Weights::new(grid, b));
        let to_coarser = weights.as_ref().map(|weights| (weights, contributions));
        let (rows, r, windows) = (rows.block(b), &r[b], &mut [[0.0; WINDOW_NODES]; 2]);
        run.words.with(worker, |words| {
            let (down, from_coarser, dot) = (true, None, false);
            dispatch(SmoothBlock { rows, words, r, windows, sweeps, down, from_coarser, to_coarser, dot, z })
        });
    });
}

/// The way up: adds P times the coarser level's direction, if there is one, to the result of the way down, and sweeps
/// backwards, to the direction. Returns r·z per chart, or 0 without `dot`.
fn ascend(
    run: &Run,
    level: usize,
    system: &mut SolvingLevel,
    sweeps: u32,
    coarse: Option<&[[Plane; 2]]>,
    dot: bool,
) -> Vec<f64> {
    let grid = &run.grid.levels[level];
    let SolvingLevel { rows, residual: r, direction, product } = system;
    let (rows, r, before) = (&**rows, &**r, &**product);
    let z = SharedSlice::new(direction);
    let next = |b: usize| {
        rows.prefetch(b);
        prefetch(&r[b]);
        prefetch(&before[b]);
    };
    run.sum_blocks(level, next, |worker, b| {
        let rows = rows.block(b);
        // A block without movable nodes has no z; its memory may hold other quantities.
        let windows = &mut window::planes(&active_neighbours(grid, b), |b, c| &before[b][c]);
        let coarse = coarse.and_then(|coarse| {
            let nodes = coarse_nodes(run.grid, level, b, |b, c| &coarse[b][c])?;
            Some((Weights::new(grid, b), nodes))
        });
        let from_coarser = coarse.as_ref().map(|(weights, nodes)| (weights, nodes));
        // SAFETY: each item has its own block.
        let (r, z) = (&r[b], unsafe { z.get_mut(b) });
        f64::from(run.words.with(worker, |words| {
            let (down, to_coarser) = (false, None);
            dispatch(SmoothBlock { rows, words, r, windows, sweeps, down, from_coarser, to_coarser, dot, z })
        }))
    })
}

/// Does sweeps inside one block with its halo frozen, and stores the result in `z`. Returns the block's part of r·z, or
/// 0 without `dot`.
struct SmoothBlock<'a> {
    rows: BlockRows<'a>,
    words: &'a mut WordWindows,
    r: &'a [Plane; 2],
    windows: &'a mut [Window; 2],
    sweeps: u32,
    /// True on the way down: the sweeps begin at 0, and go forwards.
    down: bool,
    /// The coarser level's direction, which is added first.
    from_coarser: Option<(&'a Weights, &'a [CoarseNodes; 2])>,
    /// The array of the block's contributions to the coarser level.
    to_coarser: Option<(&'a Weights, &'a mut [Plane; 2])>,
    /// True to compute r·z.
    dot: bool,
    z: &'a mut [Plane],
}

impl Vectorised for SmoothBlock<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        let SmoothBlock { rows, words, r, windows, sweeps, down, from_coarser, to_coarser, dot, z } = self;
        if let Some((weights, nodes)) = from_coarser {
            for c in 0..2 {
                weights.interpolate(&nodes[c], &mut windows[c]);
            }
        }
        if rows.uniform.is_none() {
            rows.gather::<V>(words);
        }
        smooth_block::<V>(&rows, words, r, sweeps, down, windows);
        let mut sum = V::zero();
        for row in Row::all() {
            for c in 0..2 {
                let x = row.near::<V>(&windows[c], 0, 0);
                row.store(&mut z[c], x);
                if dot {
                    sum += row.load::<V>(&r[c]) * x;
                }
            }
        }
        if let Some((weights, contributions)) = to_coarser {
            let mut rest = [[0.0; WINDOW_NODES]; 2];
            rows.add_product::<V>(windows, &mut rest);
            rest.as_flattened_mut().iter_mut().for_each(|x| *x = -*x);
            for row in Row::all() {
                let product = diagonal_product::<V>(rows.diagonal, row, windows);
                for c in 0..2 {
                    let own = row.near::<V>(&rest[c], 0, 0) + (row.load::<V>(&r[c]) - product[c]);
                    row.store_in_window(&mut rest[c], own);
                }
            }
            for c in 0..2 {
                weights.restrict(&rest[c], &mut contributions[c]);
            }
        }
        sum.sum()
    }
}

/// Sweeps inside a block. Fixed nodes are 0 after the first sweep, because their right-hand sides and pairs are 0. On
/// the way down z is 0, so that the first sweep leaves out neighbours that it has not reached yet.
#[inline(always)]
fn smooth_block<V: Lanes>(
    rows: &BlockRows,
    words: &WordWindows,
    r: &[Plane; 2],
    sweeps: u32,
    down: bool,
    z: &mut [Window; 2],
) {
    if down {
        each!([0, 1, 2, 3], |colour| {
            for row in Row::of_colour(colour) {
                // The neighbour's colour is lower.
                let known = |di: i64, dj: i64| (colour ^ ((di & 1) + 2 * (dj & 1)) as usize) < colour;
                let product = off_diagonal::<V>(rows, words, row, z, known);
                smooth_row::<V>(rows, r, row, product, z);
            }
        });
    }
    for _ in u32::from(down)..sweeps {
        for k in 0..4 {
            for row in Row::of_colour(if down { k } else { 3 - k }) {
                let product = off_diagonal::<V>(rows, words, row, z, |_, _| true);
                smooth_row::<V>(rows, r, row, product, z);
            }
        }
    }
}

/// Solves the equations of a row's nodes, given the products of their pairs.
#[inline(always)]
fn smooth_row<V: Lanes>(rows: &BlockRows, r: &[Plane; 2], row: Row, product: [V; 2], z: &mut [Window; 2]) {
    let (rx, ry) = (row.load::<V>(&r[0]) - product[0], row.load::<V>(&r[1]) - product[1]);
    if let Some(uniform) = rows.uniform {
        let inverse = V::splat(1.0 / uniform.diagonal);
        row.store_in_window(&mut z[0], rx * inverse);
        row.store_in_window(&mut z[1], ry * inverse);
        return;
    }
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&rows.diagonal[c]));
    let inverse = V::one() / (xx * yy - xy * xy);
    row.store_in_window(&mut z[0], (yy * rx - xy * ry) * inverse);
    row.store_in_window(&mut z[1], (xx * ry - xy * rx) * inverse);
}

/// The sum of A_pn z_n over the neighbours for whose offsets `known` is true.
#[inline(always)]
fn off_diagonal<V: Lanes>(
    rows: &BlockRows,
    words: &WordWindows,
    row: Row,
    z: &[Window; 2],
    known: impl Fn(i64, i64) -> bool,
) -> [V; 2] {
    if let Some(uniform) = rows.uniform {
        return uniform_product(uniform.pairs, row, z, known);
    }
    let mut sum = [V::zero(); 2];
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
        if known(di, dj) {
            let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
            let pair = decode::<V>(each!([0, 1], |w| row.near_index::<V>(&words[e][w], oi, oj)));
            let (b, c) = if neighbour_owns { (pair[2], pair[1]) } else { (pair[1], pair[2]) };
            let (x, y) = (row.near::<V>(&z[0], di, dj), row.near::<V>(&z[1], di, dj));
            sum[0] += pair[0] * x + b * y;
            sum[1] += c * x + pair[3] * y;
        }
    });
    sum
}

/// `off_diagonal` where all pairs along the axes are the unit matrix times the first factor, and those along the
/// diagonals times the second one.
#[inline(always)]
fn uniform_product<V: Lanes>(
    factors: [f32; 2],
    row: Row,
    z: &[Window; 2],
    known: impl Fn(i64, i64) -> bool,
) -> [V; 2] {
    each!([0, 1], |c| {
        let mut sums = [V::zero(); 2];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let (di, dj, ..) = NEIGHBOURS[k];
            if known(di, dj) {
                sums[usize::from(di * dj != 0)] += row.near::<V>(&z[c], di, dj);
            }
        });
        sums[0] * factors[0] + sums[1] * factors[1]
    })
}

/// Sets the first two planes of `out` to A v, and returns the dot product of v and A v per chart.
pub fn multiply(run: &Run, level: usize, rows: &Rows, v: &[[Plane; 2]], out: &mut [[Plane; 3]]) -> Vec<f64> {
    let neighbours = &run.grid.levels[level].blocks.neighbours;
    let out = SharedSlice::new(out);
    let next = |b: usize| {
        rows.prefetch(b);
        prefetch(&v[b]);
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
        if rows.uniform.is_none() {
            rows.add_product::<V>(v, &mut sums);
        }
        let mut dot = V::zero();
        for row in Row::all() {
            let product = match rows.uniform {
                Some(uniform) => {
                    let pairs = uniform_product::<V>(uniform.pairs, row, v, |_, _| true);
                    each!([0, 1], |c| row.near::<V>(&v[c], 0, 0) * uniform.diagonal + pairs[c])
                }
                None => with_diagonal::<V>(&rows, row, v, &sums),
            };
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
    let product = diagonal_product::<V>(rows.diagonal, row, z);
    each!([0, 1], |c| row.near::<V>(&sums[c], 0, 0) + product[c])
}

/// The products of a row's diagonal blocks with z.
#[inline(always)]
fn diagonal_product<V: Lanes>(diagonal: &[Plane; 3], row: Row, z: &[Window; 2]) -> [V; 2] {
    let (x, y) = (row.near::<V>(&z[0], 0, 0), row.near::<V>(&z[1], 0, 0));
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.load::<V>(&diagonal[c]));
    [xx * x + xy * y, xy * x + yy * y]
}
