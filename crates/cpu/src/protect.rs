//! protect: how much of its weight rigid material loses where the pose alone strains it (method §4, Protection). On the
//! coarser levels this follows from their metrics; on level 0 it is interpolated from level 1.

use super::prolong::coarse_nodes;
use super::run::Run;
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{EDGES, NODES, Plane, SIDE, node_at, slot};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window, place};
use vrtm_core::method::law::{LOST_STEPS, PROTECTED_STRAIN};
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Computes what is lost on level 0 to `coarsest`, if anything is.
    pub(super) fn protect(&mut self, coarsest: usize) {
        if self.least_weight == 1.0 {
            return;
        }
        let most_lost = (1.0 - self.least_weight) * LOST_STEPS;
        for (k, level) in self.grid.levels.iter().enumerate().take(coarsest + 1).skip(1) {
            let buffers = &mut self.memory.levels[k];
            let (lost, metric) = (SharedSlice::new(&mut buffers.lost), &buffers.metric);
            let blocks = &self.work[k].stored;
            self.team.run(blocks.len(), |n| {
                let b = blocks[n] as usize;
                // SAFETY: each item has its own block.
                let lost = unsafe { lost.get_mut(b) };
                of_block(level, metric, b, |s, square| {
                    let of_square = square / (square + PROTECTED_STRAIN * PROTECTED_STRAIN);
                    lost[s] = (most_lost * of_square + 0.5) as u16;
                });
            });
        }
        let (finest, coarser) = self.memory.levels.split_at_mut(1);
        let ([fine, coarse, ..], Some(coarser)) = (&self.grid.levels[..], coarser.first()) else { return };
        let lost = SharedSlice::new(&mut finest[0].lost);
        let blocks = &self.work[0].stored;
        self.team.run(blocks.len(), |n| {
            let b = blocks[n] as usize;
            // SAFETY: each item has its own block.
            let lost = unsafe { lost.get_mut(b) };
            interpolate(fine, coarse, &coarser.lost, b, lost);
        });
    }
}

/// Calls `found(slot, square)` with the mean square of the strain that the pose gives the edges of each node of block
/// `b`: those that the node owns, between nodes with a metric. It is 0 for a node without such edges.
fn of_block(level: &Level, metric: &[[Plane; 3]], b: usize, mut found: impl FnMut(usize, f32)) {
    let mut windows: [Window; 3] = [[0.0; WINDOW_NODES]; 3];
    for (c, window) in windows.iter_mut().enumerate() {
        window::load(&level.blocks.neighbours[b], 0.0, |b| &metric[b][c], window);
    }
    let chart = level.blocks.list[b].chart as usize;
    for s in 0..NODES {
        let (i, j) = node_at(s);
        let near = place(i + 1, j + 1);
        let (mut sum, mut count) = (0.0, 0.0);
        for (e, &(di, dj)) in EDGES.iter().enumerate() {
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            let rest = level.lengths[chart][e].length(level.rest_length[b][e][s]);
            if rest > 0.0 && windows[0][near] > 0.0 && windows[0][far] > 0.0 {
                let g = windows.each_ref().map(|g| (g[near] + g[far]) * 0.5);
                let (x, y) = (di as f32, dj as f32);
                let along = [g[0] * x + g[1] * y, g[1] * x + g[2] * y];
                let length = (along[0] * x + along[1] * y).max(0.0).sqrt();
                let strain = (length - rest) / rest.max(level.floor[chart]);
                sum += strain * strain;
                count += 1.0;
            }
        }
        found(s, sum / f32::max(count, 1.0));
    }
}

/// Interpolates what is lost to block `b` of level 0: the mean of four codes, rounded.
fn interpolate(fine: &Level, coarse: &Level, lost: &[Plane<u16>], b: usize, out: &mut Plane<u16>) {
    let nodes = coarse_nodes(fine, coarse, |b| &lost[b], b).unwrap_or_default();
    for j in 0..SIDE {
        for i in 0..SIDE {
            let [low, high] = [&nodes[j / 2], &nodes[j / 2 + j % 2]];
            let sum = low[i / 2] + low[i / 2 + i % 2] + high[i / 2] + high[i / 2 + i % 2];
            out[slot(i, j)] = ((sum + 2.0) * 0.25) as u16;
        }
    }
}
