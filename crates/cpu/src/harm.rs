//! harm: stiffens painted features that come out worse than without a warp (method §4, Harm).

use super::run::Run;
use super::sampling::resample::Start;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::Level;
use vrtm_core::grid::features::{LEAST_EDGES, LEVELS, Pieces};
use vrtm_core::grid::planes::{EDGES, Plane, node_at};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window, place};
use vrtm_core::method::law::{self, MULTIPLIER_STEPS, TINY};
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Sums the squares of the strain that the pose gives the features of level 0, whose samples are those of the
    /// identity.
    pub(super) fn sum_identity(&mut self) {
        if self.harm > 0.0 {
            let values = &self.memory.levels[0].value;
            self.identity_squares = self.squares(0, values, None);
        }
    }

    /// Raises the multipliers of the features that are worse on a level than without a warp, and weighs the level with
    /// them. `kept` is the part of the multipliers that remains.
    pub(super) fn weigh(&mut self, level: usize, kept: f32) {
        if self.harm == 0.0 || level >= LEVELS {
            return;
        }
        let buffers = &self.memory.levels[level];
        let now = self.squares(level, &buffers.value, Some(&buffers.u));
        let before = match level {
            0 => std::mem::take(&mut self.identity_squares),
            _ => self.squares(level, &buffers.metric, None),
        };
        let pieces = &self.grid.features.levels[level];
        let sum = |squares: &[f32], feature: usize| {
            pieces.of(feature).iter().map(|&piece| f64::from(squares[piece as usize])).sum::<f64>()
        };
        for (n, q) in self.multipliers.iter_mut().enumerate() {
            let edges = f64::from(pieces.edges[n]);
            let growth = match pieces.edges[n] >= LEAST_EDGES {
                true => law::growth((sum(&before, n) / edges) as f32, (sum(&now, n) / edges) as f32),
                false => 0.0,
            };
            *q = law::multiplier(*q * kept, law::harm_on(self.harm, level) * growth);
        }
        if self.multipliers.iter().all(|q| *q == 0.0) {
            return;
        }
        let codes = SharedSlice::new(&mut self.memory.levels[level].multiplier);
        let (blocks, multipliers) = (&self.work[level].stored, &self.multipliers);
        self.team.run(blocks.len(), |n| {
            let b = blocks[n] as usize;
            // SAFETY: each item has its own block.
            let codes = unsafe { codes.get_mut(b) };
            let first = pieces.first[b] as usize;
            let code = |tag: u16| match usize::from(tag & 0xff) {
                0 => 0,
                piece => (multipliers[pieces.feature[first + piece - 1] as usize] * MULTIPLIER_STEPS) as u16,
            };
            codes.iter_mut().zip(&pieces.tags[b]).for_each(|(to, &tag)| *to = code(tag));
        });
        self.memory.levels[level].is_weighed = true;
    }

    /// Computes the energy of the identity anew if level 0 is weighed; the level's samples become the identity's.
    pub(super) fn weigh_identity(&mut self) {
        if self.memory.levels[0].is_weighed {
            let state = self.memory.levels[0].state();
            self.resample(0, state, &self.work[0].stored, Start::Identity);
            self.store_identity_energy(0);
        }
    }

    /// Per piece of a level, the sum of the squares of its edges' strain in the state with these samples and
    /// displacements, or no displacements.
    fn squares(&self, k: usize, values: &[[Plane; 3]], u: Option<&[[Plane; 2]]>) -> Vec<f32> {
        let (level, pieces) = (&self.grid.levels[k], &self.grid.features.levels[k]);
        let mut sums: Vec<f32> = zeroed(pieces.feature.len());
        let shared = SharedSlice::new(&mut sums);
        let blocks = &self.work[k].stored;
        self.team.run(blocks.len(), |n| {
            let b = blocks[n] as usize;
            let first = pieces.first[b] as usize;
            if first < pieces.first[b + 1] as usize {
                // SAFETY: each block has its own pieces.
                of_block(level, pieces, k == 0, values, u, b, |piece, square| unsafe {
                    *shared.get_mut(first + piece) += square;
                });
            }
        });
        sums
    }
}

/// Calls `add(piece, square)` for the edges that the nodes of block `b` own inside of features.
fn of_block(
    level: &Level,
    pieces: &Pieces,
    is_finest: bool,
    values: &[[Plane; 3]],
    u: Option<&[[Plane; 2]]>,
    b: usize,
    mut add: impl FnMut(usize, f32),
) {
    let neighbours = &level.blocks.neighbours[b];
    let value: [Window; 3] = window::planes(neighbours, |b, c| &values[b][c]);
    let moved: [Window; 2] = match u {
        Some(u) => window::planes(neighbours, |b, c| &u[b][c]),
        None => [[0.0; WINDOW_NODES]; 2],
    };
    let chart = level.blocks.list[b].chart as usize;
    for (s, &tag) in pieces.tags[b].iter().enumerate().filter(|(_, tag)| **tag > 0xff) {
        let (i, j) = node_at(s);
        let near = place(i + 1, j + 1);
        for (e, &(di, dj)) in EDGES.iter().enumerate().filter(|(e, _)| tag >> (8 + e) & 1 != 0) {
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            let rest = level.lengths[chart][e].length(level.rest_length[b][e][s]);
            let square = if is_finest {
                let [x, y, z] = value.each_ref().map(|value| value[far] - value[near]);
                x * x + y * y + z * z
            } else if value[0][near] > 0.0 && value[0][far] > 0.0 {
                let g = value.each_ref().map(|g| (g[near] + g[far]) * 0.5);
                let x = (moved[0][far] - moved[0][near]) + di as f32;
                let y = (moved[1][far] - moved[1][near]) + dj as f32;
                ((g[0] * x + g[1] * y) * x + (g[1] * x + g[2] * y) * y).max(0.0)
            } else {
                continue;
            };
            let strain = ((square + TINY).sqrt() - rest) / rest.max(level.floor[chart]);
            // Not a number counts as 1.
            add(usize::from(tag & 0xff) - 1, (strain * strain).min(1.0));
        }
    }
}
