//! harm: stiffens painted features that come out worse than without a warp (method §4, Harm).

use std::hint::black_box;

use super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::row::Row;
use super::run::Run;
use super::sampling::resample::Start;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::Level;
use vrtm_core::grid::features::{LEAST_EDGES, LEVELS};
use vrtm_core::grid::planes::{EDGES, Plane};
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
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
                let add = |piece, square| unsafe { *shared.get_mut(first + piece) += square };
                dispatch(BlockSquares { level, tags: &pieces.tags[b], values, u, is_finest: k == 0, b, add });
            }
        });
        sums
    }
}

/// Sums the squares of the strain of the edges that a block's nodes own inside of features, per piece of the block.
struct BlockSquares<'a, F> {
    level: &'a Level,
    tags: &'a Plane<u16>,
    values: &'a [[Plane; 3]],
    u: Option<&'a [[Plane; 2]]>,
    is_finest: bool,
    b: usize,
    /// Called with a piece and a part of its sum.
    add: F,
}

impl<F: FnMut(usize, f32)> Vectorised for BlockSquares<'_, F> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let BlockSquares { level, tags, values, u, is_finest, b, mut add } = self;
        let neighbours = &level.blocks.neighbours[b];
        let value: [Window; 3] = window::planes(neighbours, |b, c| &values[b][c]);
        let moved: [Window; 2] = match u {
            Some(u) if !is_finest => window::planes(neighbours, |b, c| &u[b][c]),
            _ => [[0.0; WINDOW_NODES]; 2],
        };
        let chart = level.blocks.list[b].chart as usize;
        let floor = V::splat(level.floor[chart]);
        for row in Row::all() {
            let s = row.slot();
            let tags = &tags[s..s + LANES];
            if tags.iter().all(|&tag| tag <= 0xff) {
                continue;
            }
            let (row, value, moved) = black_box((row, &value, &moved));
            let near = each!([0, 1, 2], |c| row.near::<V>(&value[c], 0, 0));
            let here = each!([0, 1], |c| row.near::<V>(&moved[c], 0, 0));
            let mut sum = V::zero();
            each!([0, 1, 2, 3], |e| {
                let (di, dj) = EDGES[e];
                let rest = V::load_lengths(&level.rest_length[b][e], s, level.lengths[chart][e]);
                let far = each!([0, 1, 2], |c| row.near::<V>(&value[c], di, dj));
                let mut inside =
                    tags.iter().rev().fold(0, |bits, tag| bits << 1 | (tag >> (8 + e) & 1) as u8);
                let square = if is_finest {
                    let [x, y, z] = each!([0, 1, 2], |c| far[c] - near[c]);
                    x * x + y * y + z * z
                } else {
                    inside &= V::zero().lt(near[0].min(far[0])).bits();
                    let g = each!([0, 1, 2], |c| (near[c] + far[c]) * 0.5);
                    let [x, y] = row.offset(moved, &here, di, dj);
                    ((g[0] * x + g[1] * y) * x + (g[1] * x + g[2] * y) * y).max(V::zero())
                };
                let strain = ((square + TINY).sqrt() - rest) / rest.max(floor);
                // Not a number counts as 1.
                let square = (strain * strain).min(V::one());
                sum += V::Mask::from_bits(inside).select(square, V::zero());
            });
            for (tag, square) in tags.iter().zip(sum.to_array()).filter(|(tag, _)| **tag > 0xff) {
                add(usize::from(tag & 0xff) - 1, square);
            }
        }
    }
}
