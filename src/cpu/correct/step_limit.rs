//! The step limit (method §7.6): the fraction of the step that each node takes. It leaves every corner Jacobian part of
//! what it has over ε, and falls off smoothly around corners that would lose more. It depends on the step continuously, so
//! that a warp does not jump where a corner comes to need it. The nodes of one corner may take different fractions; what
//! folds all the same is halved.

use super::super::lanes::{Kernel, Lanes, Truth, each, wide};
use super::super::patch::{NEIGHBOURS, QUADRANTS};
use super::super::row::Row;
use super::multigrid::masked;
use super::workspace::Limiting;
use super::*;
use crate::method::law::{
    FALLOFF_PASSES, FIRST_FALLOFF_PASSES, FRACTION_FALLOFF, HALVING_ROUNDS, KEPT_MARGIN, LIMIT_ROUNDS,
    MIN_JACOBIAN,
};
use crate::tile::Level;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::window::{self, Window, place};

/// Sets the fractions so that u + fraction x step has no corner Jacobian under ε.
pub fn limit(run: &Run, level: usize, limiting: &mut Limiting) {
    let grid = &run.grid.levels[level];
    let u = &run.memory.levels[level].u;
    let step = limiting.step;
    // Only active blocks are written: in the others, the mark's memory has to stay 0 for the next V-cycle.
    let (fraction, mark) = (SharedSlice::new(limiting.fraction), SharedSlice::new(limiting.mark));
    let mut blocks = run.work[level].active.clone();
    let mut limited = vec![false; blocks.len()];
    let flags = SharedSlice::new(&mut limited);
    run.team.run(blocks.len(), |k| {
        let b = blocks[k] as usize;
        let (mut from, mut by) = ([[0.0f32; WINDOW_NODES]; 2], [[0.0f32; WINDOW_NODES]; 2]);
        load_step(grid, u, step, b, &mut from, &mut by);
        // SAFETY: each item has its own block and flag.
        unsafe {
            let fraction = &mut fraction.get_mut(b)[0];
            *flags.get_mut(k) = wide(FirstFraction { from: &from, by: &by, fraction });
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
    keep_open(&mut blocks, &limited);
    fall_off(run, grid, &blocks, fraction, mark, FIRST_FALLOFF_PASSES);
    for round in 0..LIMIT_ROUNDS {
        let mut folds = vec![false; blocks.len()];
        let flags = SharedSlice::new(&mut folds);
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let (mut at, mut by) = ([[0.0f32; WINDOW_NODES]; 2], [[0.0f32; WINDOW_NODES]; 2]);
            let mut fractions: Window = [1.0; WINDOW_NODES];
            load_step(grid, u, step, b, &mut at, &mut by);
            // SAFETY: fractions are only read, and each item has its own marks.
            let mark = unsafe {
                window::load(&masked(grid, b), 1.0, |b| &fraction.get(b)[0], &mut fractions);
                &mut mark.get_mut(b)[0]
            };
            for c in 0..2 {
                for n in 0..WINDOW_NODES {
                    at[c][n] += fractions[n] * by[c][n];
                }
            }
            let any = wide(Marks { at: &at, mark });
            // SAFETY: each item has its own flag.
            unsafe { *flags.get_mut(k) = any };
        });
        keep_open(&mut blocks, &folds);
        if blocks.is_empty() {
            return;
        }
        let factor = if round < HALVING_ROUNDS { 0.5 } else { 0.0 };
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let mut marks: Window = [1.0; WINDOW_NODES];
            // SAFETY: marks are only read, and each item has its own fractions.
            let (fraction, mark) = unsafe {
                window::load(&masked(grid, b), 1.0, |b| &mark.get(b)[0], &mut marks);
                (&mut fraction.get_mut(b)[0], &mark.get(b)[0])
            };
            for j in 0..SIDE {
                for i in 0..SIDE {
                    let s = slot(i, j);
                    let near = (0..3).any(|dj| (0..3).any(|di| marks[place(i + di, j + dj)] == 0.0));
                    if mark[s] == 0.0 || near {
                        fraction[s] *= factor;
                    }
                }
            }
        });
        fall_off(run, grid, &blocks, fraction, mark, FALLOFF_PASSES);
    }
}

/// Loads displacements and step around block `b`. Blocks without movable nodes have no step.
fn load_step(
    level: &Level,
    u: &[[Plane; 2]],
    step: &[[Plane; 2]],
    b: usize,
    from: &mut [Window; 2],
    by: &mut [Window; 2],
) {
    let neighbours = masked(level, b);
    for c in 0..2 {
        window::load(&level.blocks.neighbours[b], 0.0, |b| &u[b][c], &mut from[c]);
        window::load(&neighbours, 0.0, |b| &step[b][c], &mut by[c]);
    }
}

/// Passes of fraction <= min(fractions around) + `FRACTION_FALLOFF`, through the second plane of the marks.
fn fall_off(
    run: &Run,
    level: &Level,
    blocks: &[u32],
    fraction: SharedSlice<[Plane; 2]>,
    mark: SharedSlice<[Plane; 2]>,
    passes: u32,
) {
    for _ in 0..passes {
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let mut fractions: Window = [1.0; WINDOW_NODES];
            // SAFETY: fractions are only read, and each item has its own second plane.
            let out = unsafe {
                window::load(&masked(level, b), 1.0, |b| &fraction.get(b)[0], &mut fractions);
                &mut mark.get_mut(b)[1]
            };
            wide(FallOff { fractions: &fractions, out });
        });
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            unsafe { fraction.get_mut(b)[0] = mark.get(b)[1] };
        });
    }
}

/// The fraction of the step that a block's nodes may take if the nodes around them take the same; true if it is less than 1
/// anywhere.
struct FirstFraction<'a> {
    from: &'a [Window; 2],
    by: &'a [Window; 2],
    fraction: &'a mut Plane,
}

impl Kernel for FirstFraction<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let mut any = false;
        for row in Row::all() {
            let fraction = first_fraction::<V>(self.from, self.by, row);
            any |= fraction.lt(V::one()).any();
            row.set(self.fraction, fraction);
        }
        any
    }
}

/// The smallest fraction over the twelve corners that a row's nodes touch.
#[inline(always)]
fn first_fraction<V: Lanes>(from: &[Window; 2], by: &[Window; 2], row: Row) -> V {
    let [p, dp] = [from, by].map(|w| each!([0, 1], |c| row.near::<V>(&w[c], 0, 0)));
    let mut fraction = V::one();
    for &(sx, sy) in &QUADRANTS {
        let sign = (sx * sy) as f32;
        let [a, b, c] =
            [row.offset(from, &p, sx, 0), row.offset(from, &p, 0, sy), row.offset(from, &p, sx, sy)];
        let [da, db, dc] =
            [change(by, &dp, row, sx, 0), change(by, &dp, row, 0, sy), change(by, &dp, row, sx, sy)];
        for (a, b, da, db) in [(&a, &b, &da, &db), (&a, &c, &da, &dc), (&c, &b, &dc, &db)] {
            // At the fraction s of the step, J less what is to be left of it is start + s first + s² second, which is at
            // least 0 for s = 0. If it is under 0 for s = 1, it has one root in between.
            let over = (cross(a, b, sign) - V::splat(MIN_JACOBIAN)).max(V::zero());
            let start = over * (1.0 - KEPT_MARGIN);
            let (first, second) = (cross(da, b, sign) + cross(a, db, sign), cross(da, db, sign));
            let bad = (start + first + second).lt(V::zero());
            if bad.any() {
                let root = (first * first - start * second * 4.0).max(V::zero()).sqrt() - first;
                let found = (start + start) / root.max(V::splat(f32::MIN_POSITIVE));
                fraction = bad.select(found.min(fraction), fraction);
            }
        }
    }
    fraction
}

/// The change over a step of the offset from a row's nodes to their neighbours at (di, dj).
#[inline(always)]
fn change<V: Lanes>(by: &[Window; 2], own: &[V; 2], row: Row, di: i64, dj: i64) -> [V; 2] {
    each!([0, 1], |c| row.near::<V>(&by[c], di, dj) - own[c])
}

#[inline(always)]
fn cross<V: Lanes>(a: &[V; 2], b: &[V; 2], sign: f32) -> V {
    (a[0] * b[1] - a[1] * b[0]) * sign
}

/// One pass of the falloff over a block.
struct FallOff<'a> {
    fractions: &'a Window,
    out: &'a mut Plane,
}

impl Kernel for FallOff<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for row in Row::all() {
            let mut low = V::one();
            for (di, dj, ..) in NEIGHBOURS {
                low = low.min(row.near(self.fractions, di, dj));
            }
            let own = row.near::<V>(self.fractions, 0, 0);
            row.set(self.out, own.min(low + FRACTION_FALLOFF));
        }
    }
}

/// Marks a block's nodes: 1, or 0 where a corner Jacobian that the node touches is under ε; true if there is one.
struct Marks<'a> {
    at: &'a [Window; 2],
    mark: &'a mut Plane,
}

impl Kernel for Marks<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let mut any = false;
        for row in Row::all() {
            // A comparison with NaN is false: then, too, the node is marked.
            let good = V::splat(MIN_JACOBIAN).le(worst_corner::<V>(self.at, row));
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
