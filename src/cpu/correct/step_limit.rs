//! The step's local share: the part of it that leaves every corner Jacobian some of what it has over ε, falling off smoothly
//! around corners that would lose more. It depends on the step continuously, so that a warp does not jump where a corner
//! comes to need it. Nodes of one corner may take different parts: what folds all the same is halved.

use super::super::lanes::{Kernel, Lanes, Truth, each, wide};
use super::super::patch::{NEIGHBOURS, QUADRANTS};
use super::super::relax::MIN_JACOBIAN;
use super::super::row::Row;
use super::*;
use crate::tile::blocks::SIDE;
use crate::tile::halo::{self, Window, place};

/// Rounds of halving.
const HALVINGS: usize = 8;
/// Rounds in all: after the halvings, nodes around cells that still fold stay where they are. A chart that is not
/// free of folds then is refused by its energy.
const ROUNDS: usize = 16;
/// Passes of the falloff before the first round, and in each.
const PASSES: [usize; 2] = [4, 2];

/// Sets the shares, in the first plane of `r`, so that u + share x has no corner under ε.
pub fn shares(run: &mut Run, level: usize, system: &mut System, x: &[[Plane; 2]]) {
    let grid = &run.grid.levels[level];
    let u = &run.memory.levels[level].u;
    let share = Shared::new(&mut system.r);
    // Only active blocks are written: in the others, z has to stay 0 for the next cycle.
    let mark = Shared::new(&mut system.z);
    let mut blocks = run.work[level].active.clone();
    let mut cuts = vec![false; blocks.len()];
    let cuts_of = Shared::new(&mut cuts);
    run.team.run(blocks.len(), |k| {
        let b = blocks[k] as usize;
        let (mut from, mut step) = ([[0.0f32; WINDOW_NODES]; 2], [[0.0f32; WINDOW_NODES]; 2]);
        let around = super::multigrid::masked(grid, b);
        for c in 0..2 {
            halo::load(&grid.blocks.around[b], 0.0, |b| &u[b][c], &mut from[c]);
            // Blocks without movable nodes have no step.
            halo::load(&around, 0.0, |b| &x[b][c], &mut step[c]);
        }
        // SAFETY: each item has its own block and flag.
        unsafe {
            *cuts_of.get_mut(k) = wide(Parts { from: &from, step: &step, share: &mut share.get_mut(b)[0] })
        };
    });
    // Charts whose whole step leaves enough are done: what happens to the others must not touch them.
    let keep_open = |blocks: &mut Vec<u32>, flags: &[bool]| {
        let chart_of = |b: u32| grid.blocks.list[b as usize].chart as usize;
        let mut open = vec![false; run.charts.len()];
        for (&b, _) in blocks.iter().zip(flags).filter(|(_, flag)| **flag) {
            open[chart_of(b)] = true;
        }
        blocks.retain(|&b| open[chart_of(b)]);
    };
    keep_open(&mut blocks, &cuts);
    smooth_falloff(run, level, &blocks, share, mark, PASSES[0]);
    for round in 0..ROUNDS {
        let mut folds = vec![false; blocks.len()];
        let folds_of = Shared::new(&mut folds);
        // Marks: per node, 0 if a cell that it belongs to would fall under ε.
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let mut windows = [[0.0f32; WINDOW_NODES]; 2];
            let mut step: Window = [0.0; WINDOW_NODES];
            let mut shares: Window = [1.0; WINDOW_NODES];
            let around = super::multigrid::masked(grid, b);
            // SAFETY: shares are only read, and each item has its own marks.
            let mark = unsafe {
                halo::load(&around, 1.0, |b| &share.get(b)[0], &mut shares);
                &mut mark.get_mut(b)[0]
            };
            for c in 0..2 {
                halo::load(&grid.blocks.around[b], 0.0, |b| &u[b][c], &mut windows[c]);
                // Blocks without movable nodes have no step.
                halo::load(&around, 0.0, |b| &x[b][c], &mut step);
                for at in 0..WINDOW_NODES {
                    windows[c][at] += shares[at] * step[at];
                }
            }
            let any = wide(Marks { windows: &windows, mark });
            // SAFETY: each item has its own flag.
            unsafe { *folds_of.get_mut(k) = any };
        });
        keep_open(&mut blocks, &folds);
        if blocks.is_empty() {
            return;
        }
        let factor = if round < HALVINGS { 0.5 } else { 0.0 };
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let mut marks: Window = [1.0; WINDOW_NODES];
            // SAFETY: marks are only read, and each item has its own shares.
            let (share, mark) = unsafe {
                halo::load(&super::multigrid::masked(grid, b), 1.0, |b| &mark.get(b)[0], &mut marks);
                (&mut share.get_mut(b)[0], &mark.get(b)[0])
            };
            for j in 0..SIDE {
                for i in 0..SIDE {
                    let s = crate::tile::blocks::slot(i, j);
                    let near = (0..3).any(|dj| (0..3).any(|di| marks[place(i + di, j + dj)] == 0.0));
                    if mark[s] == 0.0 || near {
                        share[s] *= factor;
                    }
                }
            }
        });
        smooth_falloff(run, level, &blocks, share, mark, PASSES[1]);
    }
}

/// A share exceeds its neighbours' by at most this: a step that changes abruptly folds by itself.
const FALLOFF: f32 = 0.125;

/// Passes of share <= min(neighbours) + FALLOFF, through the second mark plane.
fn smooth_falloff(
    run: &Run,
    level: usize,
    blocks: &[u32],
    share: Shared<[Plane; 2]>,
    mark: Shared<[Plane; 2]>,
    passes: usize,
) {
    let grid = &run.grid.levels[level];
    for _ in 0..passes {
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let mut shares: Window = [1.0; WINDOW_NODES];
            // SAFETY: shares are only read, and each item has its own second mark plane.
            let out = unsafe {
                halo::load(&super::multigrid::masked(grid, b), 1.0, |b| &share.get(b)[0], &mut shares);
                &mut mark.get_mut(b)[1]
            };
            wide(Falloff { shares: &shares, out });
        });
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            unsafe { share.get_mut(b)[0] = mark.get(b)[1] };
        });
    }
}

/// The part of the step that a block's nodes may take, were the nodes around them to take the same; true if it is not the
/// whole anywhere.
struct Parts<'a> {
    from: &'a [Window; 2],
    step: &'a [Window; 2],
    share: &'a mut Plane,
}

/// A step leaves at least this share of what a corner Jacobian has over the bound.
const KEPT: f32 = 0.1;

impl Kernel for Parts<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let mut any = false;
        for row in Row::all() {
            let share = part::<V>(self.from, self.step, row);
            any |= share.lt(V::one()).any();
            row.set(self.share, share);
        }
        any
    }
}

/// The smallest part over the twelve corners that a row's nodes touch.
#[inline(always)]
fn part<V: Lanes>(from: &[Window; 2], step: &[Window; 2], row: Row) -> V {
    let [p, dp] = [from, step].map(|w| each!([0, 1], |c| row.near::<V>(&w[c], 0, 0)));
    let mut part = V::one();
    for &(sx, sy) in &QUADRANTS {
        let sign = (sx * sy) as f32;
        let [a, b, c] =
            [row.offset(from, &p, sx, 0), row.offset(from, &p, 0, sy), row.offset(from, &p, sx, sy)];
        let [da, db, dc] =
            [change(step, &dp, row, sx, 0), change(step, &dp, row, 0, sy), change(step, &dp, row, sx, sy)];
        for (a, b, da, db) in [(&a, &b, &da, &db), (&a, &c, &da, &dc), (&c, &b, &dc, &db)] {
            // J over what is to be left of it, at the part s of the step: start + s first + s² second, which starts at 0
            // or more. If it ends under 0, it has one root in between.
            let over = (cross(a, b, sign) - V::splat(MIN_JACOBIAN)).max(V::zero());
            let start = over * (1.0 - KEPT);
            let (first, second) = (cross(da, b, sign) + cross(a, db, sign), cross(da, db, sign));
            let bad = (start + first + second).lt(V::zero());
            if bad.any() {
                let root = (first * first - start * second * 4.0).max(V::zero()).sqrt() - first;
                let found = (start + start) / root.max(V::splat(f32::MIN_POSITIVE));
                part = bad.select(found.min(part), part);
            }
        }
    }
    part
}

/// How the offset from a row's nodes to their neighbours at (di, dj) changes over a step.
#[inline(always)]
fn change<V: Lanes>(step: &[Window; 2], own: &[V; 2], row: Row, di: i64, dj: i64) -> [V; 2] {
    each!([0, 1], |c| row.near::<V>(&step[c], di, dj) - own[c])
}

#[inline(always)]
fn cross<V: Lanes>(a: &[V; 2], b: &[V; 2], sign: f32) -> V {
    (a[0] * b[1] - a[1] * b[0]) * sign
}

/// One pass of the falloff over a block.
struct Falloff<'a> {
    shares: &'a Window,
    out: &'a mut Plane,
}

impl Kernel for Falloff<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for row in Row::all() {
            let mut low = V::one();
            for (di, dj, ..) in NEIGHBOURS {
                low = low.min(row.near(self.shares, di, dj));
            }
            row.set(self.out, row.near::<V>(self.shares, 0, 0).min(low + FALLOFF));
        }
    }
}

/// Marks a block's nodes: 1, or 0 where a corner Jacobian that the node touches is under ε; true if there is one.
struct Marks<'a> {
    windows: &'a [Window; 2],
    mark: &'a mut Plane,
}

impl Kernel for Marks<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let mut any = false;
        for row in Row::all() {
            // What is not a number is no Jacobian either.
            let good = V::splat(MIN_JACOBIAN).le(worst_corner::<V>(self.windows, row));
            any |= good.bits() != u8::MAX;
            row.set(self.mark, good.select(V::one(), V::zero()));
        }
        any
    }
}

/// The smallest of the twelve corner Jacobians that a row's nodes touch.
#[inline(always)]
fn worst_corner<V: Lanes>(w: &[Window; 2], row: Row) -> V {
    let mut worst = V::splat(f32::MAX);
    let p = each!([0, 1], |c| row.near::<V>(&w[c], 0, 0));
    for &(sx, sy) in &QUADRANTS {
        let (a, b, c) = (row.offset(w, &p, sx, 0), row.offset(w, &p, 0, sy), row.offset(w, &p, sx, sy));
        for (a, b) in [(&a, &b), (&a, &c), (&c, &b)] {
            worst = ((a[0] * b[1] - a[1] * b[0]) * (sx * sy) as f32).min(worst);
        }
    }
    worst
}
