//! The preconditioner: a V(2,2) cycle of four-colour block Gauss-Seidel. It runs backwards after the coarse correction,
//! so that the whole cycle is symmetric, as conjugate gradients need.

use super::super::lanes::{Kernel, V, each, wide};
use super::super::patch::NEIGHBOURS;
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
    fn run(self) {
        for _ in 0..self.sweeps {
            smooth_block(self.rows, self.r, self.backwards, self.windows);
        }
        for colour in 0..4 {
            for row in Row::of_colour(colour) {
                for c in 0..2 {
                    V::load(&self.windows[c], row.at(0, 0)).store(&mut self.z[c], row.slot());
                }
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
fn smooth_block(rows: &Rows, r: &[Plane; 2], backwards: bool, z: &mut [Window; 2]) {
    for k in 0..4 {
        for row in Row::of_colour(if backwards { 3 - k } else { k }) {
            let s = row.slot();
            let [ax, ay] = off_diagonal(rows, row, z);
            let (rx, ry) = (V::load(&r[0], s) - ax, V::load(&r[1], s) - ay);
            let [xx, xy, yy] = each!([0, 1, 2], |c| V::load(&rows.diagonal[c], s));
            let inverse = V::ONE / (xx * yy - xy * xy);
            ((yy * rx - xy * ry) * inverse).store(&mut z[0], row.at(0, 0));
            ((xx * ry - xy * rx) * inverse).store(&mut z[1], row.at(0, 0));
        }
    }
}

/// The sum over neighbours of A_pn z_n.
#[inline(always)]
fn off_diagonal(rows: &Rows, row: Row, z: &[Window; 2]) -> [V; 2] {
    let mut sum = [V::ZERO; 2];
    for &(di, dj, e, theirs) in &NEIGHBOURS {
        let n = row.at(di, dj);
        let at = if theirs { n } else { row.at(0, 0) };
        let [a, b, c, d] = each!([0, 1, 2, 3], |k| V::load(&rows.pair[4 * e + k], at));
        let (b, c) = if theirs { (c, b) } else { (b, c) };
        let (x, y) = (V::load(&z[0], n), V::load(&z[1], n));
        sum[0] += a * x + b * y;
        sum[1] += c * x + d * y;
    }
    sum
}

/// A z for one row.
#[inline(always)]
fn product(rows: &Rows, row: Row, z: &[Window; 2]) -> [V; 2] {
    let [ax, ay] = off_diagonal(rows, row, z);
    let (at, s) = (row.at(0, 0), row.slot());
    let (x, y) = (V::load(&z[0], at), V::load(&z[1], at));
    let [xx, xy, yy] = each!([0, 1, 2], |c| V::load(&rows.diagonal[c], s));
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
    fn run(self) {
        for colour in 0..4 {
            for row in Row::of_colour(colour) {
                let [x, y] = product(self.rows, row, self.windows);
                x.store(&mut self.out[0], row.slot());
                y.store(&mut self.out[1], row.slot());
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
