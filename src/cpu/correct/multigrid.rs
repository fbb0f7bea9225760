//! The preconditioner: a V(2,2) cycle of four-colour block Gauss-Seidel. It runs backwards after the coarse correction,
//! so that the whole cycle is symmetric, as conjugate gradients need.

use super::super::lanes::{Kernel, Lanes, each, wide};
use super::super::patch::{NEIGHBOURS, Row};
use super::super::prolong;
use super::*;
use crate::mesh::NONE;
use crate::tile::Level;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::halo::{self, Window, place};

/// Sweeps on either side.
const SWEEPS: usize = 2;
/// Rounds of them in each direction on the coarsest level, where a block or a few hold all of it.
const COARSEST_ROUNDS: usize = 4;

/// z = M⁻¹ r on `level`. Leaves `r` alone.
pub fn cycle(run: &Run, systems: &mut [System], level: usize) {
    let coarsest = systems.len() - 1;
    for k in level..=coarsest {
        let system = &mut systems[k];
        let z = Shared::new(&mut system.z);
        run.each_block(k, |b, _| {
            // SAFETY: each item has its own block.
            unsafe { *z.get_mut(b) = [[0.0; NODES]; 2] };
        });
        if k == coarsest {
            for _ in 0..COARSEST_ROUNDS {
                smooth(run, k, system, false, SWEEPS);
            }
            for _ in 0..COARSEST_ROUNDS {
                smooth(run, k, system, true, SWEEPS);
            }
        } else {
            smooth(run, k, system, false, SWEEPS);
            residual(run, k, system);
            let (finer, coarser) = systems.split_at_mut(k + 1);
            restrict(run, k, &finer[k].t, &mut coarser[0].r);
        }
    }
    for k in (level..coarsest).rev() {
        let (finer, coarser) = systems.split_at_mut(k + 1);
        add_coarse(run, k, &mut finer[k].z, &coarser[0].z);
        smooth(run, k, &mut systems[k], true, SWEEPS);
    }
}

/// Sweeps of z towards A z = r: all of them on a block while it is in the cache, its ring frozen.
fn smooth(run: &Run, level: usize, system: &mut System, backwards: bool, sweeps: usize) {
    let grid = &run.grid.levels[level];
    let z = Shared::new(&mut system.z);
    run.each_colour(level, backwards, |b| {
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        // SAFETY: blocks of one colour do not touch.
        unsafe { load(grid, b, |b, c| &z.get(b)[c], &mut windows) };
        let (rows, r) = (&system.rows[b], &system.r[b]);
        // SAFETY: as above.
        let z = unsafe { z.get_mut(b) };
        wide(SmoothBlock { rows, r, windows: &mut windows, backwards, sweeps, z });
    });
}

/// Sweeps inside one block, its ring frozen.
struct SmoothBlock<'a> {
    rows: &'a Rows,
    r: &'a [Plane; 2],
    windows: &'a mut [Window; 2],
    backwards: bool,
    sweeps: usize,
    z: &'a mut [Plane; 2],
}

impl Kernel for SmoothBlock<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for _ in 0..self.sweeps {
            smooth_block::<V>(self.rows, self.r, self.backwards, self.windows);
        }
        for row in Row::all() {
            for c in 0..2 {
                row.set(&mut self.z[c], row.near::<V>(&self.windows[c], 0, 0));
            }
        }
    }
}

#[inline(always)]
fn load<'a>(level: &Level, b: usize, plane: impl Fn(usize, usize) -> &'a Plane, windows: &mut [Window; 2]) {
    for (c, window) in windows.iter_mut().enumerate() {
        halo::load(&level.blocks.around[b], 0.0, |b| plane(b, c), window);
    }
}

/// One sweep inside a block. Fixed nodes have r = 0 and no pairs: they stay at 0.
#[inline(always)]
fn smooth_block<V: Lanes>(rows: &Rows, r: &[Plane; 2], backwards: bool, z: &mut [Window; 2]) {
    for k in 0..4 {
        for row in Row::of_colour(if backwards { 3 - k } else { k }) {
            let [ax, ay] = off_diagonal::<V>(rows, row, z);
            let (rx, ry) = (row.of::<V>(&r[0]) - ax, row.of::<V>(&r[1]) - ay);
            let [xx, xy, yy] = each!([0, 1, 2], |c| row.of::<V>(&rows.diagonal[c]));
            let inverse = V::one() / (xx * yy - xy * xy);
            row.set_own(&mut z[0], (yy * rx - xy * ry) * inverse);
            row.set_own(&mut z[1], (xx * ry - xy * rx) * inverse);
        }
    }
}

/// The sum over neighbours of A_pn z_n.
#[inline(always)]
fn off_diagonal<V: Lanes>(rows: &Rows, row: Row, z: &[Window; 2]) -> [V; 2] {
    let mut sum = [V::zero(); 2];
    each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        let (di, dj, e, theirs) = NEIGHBOURS[k];
        let (oi, oj) = if theirs { (di, dj) } else { (0, 0) };
        let pair = each!([0, 1, 2, 3], |c| row.near::<V>(&rows.pair[4 * e + c], oi, oj));
        let (b, c) = if theirs { (pair[2], pair[1]) } else { (pair[1], pair[2]) };
        let (x, y) = (row.near::<V>(&z[0], di, dj), row.near::<V>(&z[1], di, dj));
        sum[0] += pair[0] * x + b * y;
        sum[1] += c * x + pair[3] * y;
    });
    sum
}

/// A z for one row.
#[inline(always)]
fn product<V: Lanes>(rows: &Rows, row: Row, z: &[Window; 2]) -> [V; 2] {
    let [ax, ay] = off_diagonal::<V>(rows, row, z);
    let (x, y) = (row.near::<V>(&z[0], 0, 0), row.near::<V>(&z[1], 0, 0));
    let [xx, xy, yy] = each!([0, 1, 2], |c| row.of::<V>(&rows.diagonal[c]));
    [ax + xx * x + xy * y, ay + xy * x + yy * y]
}

/// out = A v.
pub fn multiply(run: &Run, level: usize, rows: &[Rows], v: &[[Plane; 2]], out: &mut [[Plane; 2]]) {
    let grid = &run.grid.levels[level];
    let out = Shared::new(out);
    run.each_block(level, |b, _| {
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        load(grid, b, |b, c| &v[b][c], &mut windows);
        // SAFETY: each item has its own block.
        let out = unsafe { out.get_mut(b) };
        wide(BlockProduct { rows: &rows[b], windows: &windows, out });
    });
}

/// t = r - A z.
fn residual(run: &Run, level: usize, system: &mut System) {
    let grid = &run.grid.levels[level];
    let t = Shared::new(&mut system.t);
    let (rows, z, r) = (&system.rows, &system.z, &system.r);
    run.each_block(level, |b, _| {
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        load(grid, b, |b, c| &z[b][c], &mut windows);
        // SAFETY: each item has its own block.
        let t = unsafe { t.get_mut(b) };
        wide(BlockProduct { rows: &rows[b], windows: &windows, out: t });
        for c in 0..2 {
            for s in 0..NODES {
                t[c][s] = r[b][c][s] - t[c][s];
            }
        }
    });
}

/// out = A v for one block.
struct BlockProduct<'a> {
    rows: &'a Rows,
    windows: &'a [Window; 2],
    out: &'a mut [Plane; 2],
}

impl Kernel for BlockProduct<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for row in Row::all() {
            let product = product::<V>(self.rows, row, self.windows);
            for c in 0..2 {
                row.set(&mut self.out[c], product[c]);
            }
        }
    }
}

/// The coarser level's right-hand side: Pᵀ t, at its movable nodes.
fn restrict(run: &Run, finer: usize, t: &[[Plane; 2]], r: &mut [[Plane; 2]]) {
    let (fine, coarse) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let r = Shared::new(r);
    run.each_block(finer + 1, |b, _| {
        // SAFETY: each item has its own block.
        let r = unsafe { r.get_mut(b) };
        *r = [[0.0; NODES]; 2];
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        for (quarter, &child) in coarse.children[b].iter().enumerate() {
            // A block without movable nodes has no residual; its memory may be stale.
            if child == NONE || !fine.blocks.list[child as usize].active {
                continue;
            }
            let around = masked(fine, child as usize);
            for c in 0..2 {
                halo::load(&around, 0.0, |b| &t[b][c], &mut windows[c]);
            }
            for j in 0..SIDE / 2 {
                for i in 0..SIDE / 2 {
                    let s = slot(i + quarter % 2 * 8, j + quarter / 2 * 8);
                    if coarse.movable[b][s] == 0 {
                        continue;
                    }
                    for c in 0..2 {
                        let w = |di: usize, dj: usize| windows[c][place(2 * i + di, 2 * j + dj)];
                        r[c][s] = w(1, 1)
                            + 0.5 * (w(0, 1) + w(2, 1) + w(1, 0) + w(1, 2))
                            + 0.25 * (w(0, 0) + w(2, 0) + w(0, 2) + w(2, 2));
                    }
                }
            }
        }
    });
}

/// A block's surroundings without the blocks that are stored for their neighbours' sake only.
pub fn masked(level: &Level, b: usize) -> [u32; 9] {
    level.blocks.around[b].map(|b| if b != NONE && level.blocks.list[b as usize].active { b } else { NONE })
}

/// z += P z_coarse.
fn add_coarse(run: &Run, finer: usize, z: &mut [[Plane; 2]], coarse: &[[Plane; 2]]) {
    let (fine_level, coarse_level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let z = Shared::new(z);
    run.each_block(finer, |b, _| {
        let mut add = [[0.0; NODES]; 2];
        prolong::block(fine_level, coarse_level, |b, c| &coarse[b][c], b, 1.0, &mut add);
        // SAFETY: each item has its own block.
        let z = unsafe { z.get_mut(b) };
        for c in 0..2 {
            for s in 0..NODES {
                z[c][s] += add[c][s];
            }
        }
    });
}
