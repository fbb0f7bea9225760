//! Samples the surface anew under all nodes of some blocks, after their displacements were set from outside.

use crate::mesh::NONE;
use crate::tile::blocks::{NODES, SIDE, node_at, slot};

use super::Run;
use super::patch::State;
use super::surface::{Chords, Metrics, Surface};

impl Run<'_> {
    /// Samples the surface anew under all nodes of the blocks, from their displacements.
    pub(super) fn refresh(&mut self, level: usize, blocks: &[u32]) {
        let grid = self.grid;
        let (finest, coarser) = self.memory.levels.split_at_mut(1);
        let buffers = if level == 0 { &mut finest[0] } else { &mut coarser[level - 1] };
        let metric = std::mem::take(&mut buffers.metric);
        let state = buffers.state();
        let chords = Chords { grid, triangles: &self.memory.triangles };
        let metrics = Metrics { level: &grid.levels[level], metric: &metric };
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            unsafe {
                if level == 0 {
                    refresh_chords(chords, state, b);
                } else {
                    refresh_metrics(metrics, state, b);
                }
            }
        });
        self.memory.levels[level].metric = metric;
    }
}

/// Samples all nodes of a finest block anew.
///
/// # Safety
/// No other item touches this block now.
unsafe fn refresh_chords(surface: Chords, state: State, b: usize) {
    let level = &surface.grid.levels[0];
    let block = &level.blocks.list[b];
    // SAFETY: the caller's promise.
    let (u, value, triangle) = unsafe { (state.u.get(b), state.value.get_mut(b), state.triangle.get_mut(b)) };
    for s in 0..NODES {
        let (i, j) = node_at(s);
        let (i, j) =
            (i64::from(block.x) * SIDE as i64 + i as i64, i64::from(block.y) * SIDE as i64 + j as i64);
        let d = [u[0][s], u[1][s]];
        let rest = surface.grid.triangle[b][s];
        let sample = if level.movable[b][s] == 0 {
            (rest != NONE).then(|| surface.on(rest, i, j, [0.0; 2]))
        } else {
            // The node nearest to W(p) is a better start than p.
            let (x, y) = (i + d[0].round() as i64, j + d[1].round() as i64);
            let near = match level.blocks.holding(b, x, y) {
                NONE => NONE,
                near => surface.grid.triangle[near as usize][slot(x as usize % SIDE, y as usize % SIDE)],
            };
            let usable = near != NONE && surface.grid.chart_of[near as usize] == block.chart;
            let start = if usable { near } else { rest };
            Some(surface.sample(b, i, j, d, start).unwrap_or_else(|| surface.on(start, i, j, d)))
        };
        let sample = sample.unwrap_or_default();
        for (plane, x) in value.iter_mut().zip(sample.value) {
            plane[s] = x;
        }
        triangle[s] = if rest == NONE { NONE } else { sample.triangle };
    }
}

/// Samples all nodes of a coarser block anew.
///
/// # Safety
/// No other item touches this block now.
unsafe fn refresh_metrics(surface: Metrics, state: State, b: usize) {
    let block = &surface.level.blocks.list[b];
    // SAFETY: the caller's promise.
    let (u, value) = unsafe { (state.u.get(b), state.value.get_mut(b)) };
    for s in 0..NODES {
        let d = [u[0][s], u[1][s]];
        let mut metric = surface.metric[b].each_ref().map(|plane| plane[s]);
        if surface.level.movable[b][s] != 0 {
            let (i, j) = node_at(s);
            let (i, j) =
                (i64::from(block.x) * SIDE as i64 + i as i64, i64::from(block.y) * SIDE as i64 + j as i64);
            if let Some(sample) = surface.sample(b, i, j, d, NONE) {
                metric = sample.value;
            }
        }
        for (plane, x) in value.iter_mut().zip(metric) {
            plane[s] = x;
        }
    }
}
