//! The memory of a correction (method §7), and its contents in each phase. The same arrays hold several quantities in
//! turn. Each phase of a correction is a type that names the arrays by their present contents; a phase is constructed
//! from the one before it.
//!
//! ```text
//! phase        pair of planes A       pair of planes B       three planes of samples
//! Assembling   residual               -                      samples (read)
//! Solving      residual               direction              product
//! Limiting     step fraction          mark                   samples (stale)
//! Stepping     step fraction          displacement before    samples (written)
//! ```

use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::Plane;

use super::super::allocate::Allocator;
use super::super::buffers::Buffers;
use super::rows::Rows;

/// The memory of the corrections of all levels. Tests compare both backends by what a correction leaves in it.
#[derive(Debug, Default)]
pub struct Workspace {
    pub(super) levels: Vec<LevelMemory>,
    /// Step fraction per chart of the level's next correction; 0 if the last correction gained too little for another
    /// one.
    pub next_fraction: Vec<f32>,
}

/// The memory of the corrections of one level.
#[derive(Debug, Default)]
pub(super) struct LevelMemory {
    pub(super) rows: Rows,
    /// Pair of planes A. The finest level has as many as the largest of all levels, for the steps of coarser levels.
    pub(super) planes_a: Vec<[Plane; 2]>,
    /// Pair of planes B; 0 in blocks without movable nodes, which no phase writes.
    planes_b: Vec<[Plane; 2]>,
}

impl Workspace {
    pub fn new(allocator: &mut Allocator, grid: &Grid) -> Workspace {
        let corrected = &grid.levels[..=grid.coarsest()];
        let mut levels = Vec::with_capacity(corrected.len());
        let largest = corrected.iter().map(|level| level.blocks.list.len()).max();
        for (k, level) in corrected.iter().enumerate() {
            let blocks = level.blocks.list.len();
            levels.push(LevelMemory {
                rows: Rows::new(allocator, blocks),
                planes_a: allocator.zeros(largest.filter(|_| k == 0).unwrap_or(blocks)),
                planes_b: allocator.zeros(blocks),
            });
        }
        Workspace { levels, next_fraction: allocator.zeros(grid.movable.len()) }
    }

    /// Begins a correction of `level`. The finest level's step is stored in `result`, that of a coarser level in the
    /// finest level's planes A.
    pub fn assembling<'a>(&'a mut self, level: usize, result: &'a mut [[Plane; 2]]) -> Assembling<'a> {
        let (finer, levels) = self.levels.split_at_mut(level);
        let step = finer.first_mut().map_or(result, |finest| &mut finest.planes_a);
        Assembling { levels, step }
    }
}

/// First phase: the system of the corrected level is assembled.
pub struct Assembling<'a> {
    levels: &'a mut [LevelMemory],
    step: &'a mut [[Plane; 2]],
}

impl<'a> Assembling<'a> {
    /// The system's rows, and the residual of a step of 0, which is the right-hand side.
    pub fn system(&mut self) -> (&mut Rows, &mut [[Plane; 2]]) {
        let LevelMemory { rows, planes_a, .. } = &mut self.levels[0];
        (rows, planes_a)
    }

    /// Continues with the second phase, which overwrites the samples of the corrected level and of the coarser ones.
    /// The step makes them stale anyway.
    pub fn solving<'s>(self, samples: &'s mut [Buffers]) -> Solving<'a, 's> {
        let levels = self.levels.iter_mut().zip(samples).map(|(memory, buffers)| SolvingLevel {
            rows: &mut memory.rows,
            residual: &mut memory.planes_a,
            direction: &mut memory.planes_b,
            product: &mut buffers.value,
        });
        Solving { levels: levels.collect(), step: self.step }
    }
}

/// Second phase: the system is solved.
pub struct Solving<'a, 's> {
    /// The corrected level, and the coarser ones.
    pub levels: Vec<SolvingLevel<'a, 's>>,
    /// At first still that of the correction before.
    pub step: &'a mut [[Plane; 2]],
}

/// The matrix and the vectors of one level.
pub struct SolvingLevel<'a, 's> {
    pub rows: &'a mut Rows,
    /// The residual of the system; on coarser levels, the restricted residual of the next finer level.
    pub residual: &'a mut [[Plane; 2]],
    /// The V-cycle's approximate solution for the residual; on the way down, the blocks' contributions to the residual
    /// of the coarser level. On the corrected level, conjugate gradients turn it into their search direction.
    pub direction: &'a mut [[Plane; 2]],
    /// The product of the matrix with a vector, or the V-cycle's result on the way down, in two planes; or A P 1 as
    /// (xx, xy, yy) in three planes. In corrections that form no coarser level the third plane has the step of the
    /// correction before, two numbers in a word per node.
    pub product: &'s mut [[Plane; 3]],
}

impl<'a> Solving<'a, '_> {
    /// Continues with the third phase, which does not use the memory of the samples.
    pub fn limiting(self) -> Limiting<'a> {
        let mut levels = self.levels.into_iter();
        let Some(SolvingLevel { residual, direction, .. }) = levels.next() else {
            unreachable!("the corrected level is always there")
        };
        Limiting { fraction: residual, mark: direction, step: self.step }
    }
}

/// Third phase: the step is limited. Fraction and mark are in the first plane of each pair.
pub struct Limiting<'a> {
    /// Per node, the fraction of the step that it takes.
    pub fraction: &'a mut [[Plane; 2]],
    /// Per node, the factor by which a round of the limit shrinks its fraction.
    pub mark: &'a mut [[Plane; 2]],
    pub step: &'a [[Plane; 2]],
}

impl<'a> Limiting<'a> {
    /// Continues with the last phase.
    pub fn stepping(self, cut: Vec<f32>) -> Stepping<'a> {
        Stepping { fraction: self.fraction, before: self.mark, step: self.step, cut }
    }
}

/// Last phase: fractions of the step are tried.
pub struct Stepping<'a> {
    /// The step fractions, as in [`Limiting`].
    pub fraction: &'a [[Plane; 2]],
    /// Displacements before the step.
    pub before: &'a mut [[Plane; 2]],
    pub step: &'a [[Plane; 2]],
    /// Per chart, the largest part of the step that the limit's first fractions cut off at a corner.
    pub cut: Vec<f32>,
}
