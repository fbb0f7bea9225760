//! The memory of a correction, and what it holds when. The same arrays serve several quantities one after the other; each
//! phase of a correction sees them under the names that they have in it, and the next phase can only be had from the one
//! before.
//!
//! ```text
//! phase        pair of planes A       pair of planes B       three planes of samples
//! Assembling   residual               -                      samples (read)
//! Solving      residual               direction              product
//! Limiting     step fraction          mark                   samples (stale)
//! Stepping     step fraction          displacement before    samples (written)
//! ```

use crate::tile::Grid;
use crate::tile::blocks::{NODES, Plane};

use super::super::allocate::Allocate;
use super::super::memory::Buffers;
use super::rows::Rows;

/// The memory of the corrections of all levels.
#[derive(Debug, Default)]
pub struct Workspace {
    levels: Vec<LevelMemory>,
    /// The step on the coarser level that is corrected. That of the finest level is stored where the result will be.
    coarse_step: Vec<[Plane; 2]>,
    /// Per chart, the fraction of the level's next step that it is to take; 0 if the last correction gained too little to
    /// try again.
    pub next_fraction: Vec<f32>,
}

/// One level's part of it.
#[derive(Debug, Default)]
struct LevelMemory {
    rows: Rows,
    a: Vec<[Plane; 2]>,
    /// 0 in blocks without movable nodes: no phase writes those.
    b: Vec<[Plane; 2]>,
}

impl Workspace {
    pub fn new(allocator: &mut impl Allocate, grid: &Grid) -> Workspace {
        let mut levels = Vec::with_capacity(grid.levels.len());
        for level in &grid.levels {
            let blocks = level.blocks.list.len();
            levels.push(LevelMemory {
                rows: Rows::new(allocator, blocks),
                a: allocator.array([[0.0; NODES]; 2], blocks),
                b: allocator.array([[0.0; NODES]; 2], blocks),
            });
        }
        let largest = grid.levels[1..].iter().map(|level| level.blocks.list.len()).max();
        Workspace {
            levels,
            coarse_step: allocator.array([[0.0; NODES]; 2], largest.unwrap_or(0)),
            next_fraction: allocator.array(1.0, grid.movable.len()),
        }
    }

    /// Begins a correction of `level`. The finest level's step goes to `result`.
    pub fn assembling<'a>(&'a mut self, level: usize, result: &'a mut [[Plane; 2]]) -> Assembling<'a> {
        let step = if level == 0 { result } else { &mut self.coarse_step };
        Assembling { levels: &mut self.levels[level..], step }
    }
}

#[cfg(any(test, all(feature = "gpu", feature = "oracle")))]
impl Workspace {
    /// A level's system, as the last correction left it.
    pub fn rows(&self, level: usize) -> &Rows {
        &self.levels[level].rows
    }
}

/// What a correction left, for comparisons of both backends.
#[cfg(all(feature = "gpu", feature = "oracle"))]
impl Workspace {
    /// A level's residual, as assembling left it.
    pub fn residual(&self, level: usize) -> &[[Plane; 2]] {
        &self.levels[level].a
    }

    /// The step on a coarser level, before it was limited.
    pub fn coarse_step(&self) -> &[[Plane; 2]] {
        &self.coarse_step
    }

    /// The step fraction of a block's nodes, as the last correction of the level left it.
    pub fn step_fraction(&self, level: usize, b: usize) -> &Plane {
        &self.levels[level].a[b][0]
    }
}

/// The system of the level that is corrected is being formed.
pub struct Assembling<'a> {
    levels: &'a mut [LevelMemory],
    step: &'a mut [[Plane; 2]],
}

impl<'a> Assembling<'a> {
    /// The system's rows, and the residual of a step of 0: the right-hand side.
    pub fn system(&mut self) -> (&mut Rows, &mut [[Plane; 2]]) {
        let LevelMemory { rows, a, .. } = &mut self.levels[0];
        (rows, a)
    }

    /// Goes on with the memory of the samples of this level and the coarser ones, which the step makes stale.
    pub fn solving<'s>(self, samples: &'s mut [Buffers]) -> Solving<'a, 's> {
        let levels = self.levels.iter_mut().zip(samples).map(|(memory, buffers)| SolvingLevel {
            rows: &mut memory.rows,
            residual: &mut memory.a,
            direction: &mut memory.b,
            product: &mut buffers.value,
        });
        Solving { levels: levels.collect(), step: self.step }
    }
}

/// The system is being solved.
pub struct Solving<'a, 's> {
    /// The level that is corrected, and the coarser ones.
    pub levels: Vec<SolvingLevel<'a, 's>>,
    pub step: &'a mut [[Plane; 2]],
}

/// What the solution needs on one level.
pub struct SolvingLevel<'a, 's> {
    pub rows: &'a mut Rows,
    /// Of the system; on coarser levels, the restricted one of the next finer level.
    pub residual: &'a mut [[Plane; 2]],
    /// What the V-cycle makes of the residual. On the level that is corrected, conjugate gradients turn it into the
    /// direction of their step.
    pub direction: &'a mut [[Plane; 2]],
    /// The matrix times a vector, or what that leaves of a residual: two planes, and the third where blocks of (xx, xy, yy)
    /// are multiplied.
    pub product: &'s mut [[Plane; 3]],
}

impl<'a> Solving<'a, '_> {
    /// Gives the memory of the samples back.
    pub fn limiting(self) -> Limiting<'a> {
        let mut levels = self.levels.into_iter();
        let Some(SolvingLevel { residual, direction, .. }) = levels.next() else {
            unreachable!("the level that is corrected is always there")
        };
        Limiting { fraction: residual, mark: direction, step: self.step }
    }
}

/// The step is being limited. Fraction and mark are the first plane of each pair.
pub struct Limiting<'a> {
    /// Per node, the fraction of the step that it takes.
    pub fraction: &'a mut [[Plane; 2]],
    /// Per node, 0 if a cell that it belongs to would fall under the bound.
    pub mark: &'a mut [[Plane; 2]],
    pub step: &'a [[Plane; 2]],
}

impl<'a> Limiting<'a> {
    pub fn stepping(self) -> Stepping<'a> {
        Stepping { fraction: self.fraction, before: self.mark, step: self.step }
    }
}

/// Fractions of the step are being tried.
pub struct Stepping<'a> {
    /// As in [`Limiting`].
    pub fraction: &'a [[Plane; 2]],
    /// Displacements before the step.
    pub before: &'a mut [[Plane; 2]],
    pub step: &'a [[Plane; 2]],
}
