//! Relative costs of the stages of a solve, for time budgets and for progress. Costs are microseconds on two cores of
//! 2.5 GHz; the actual times on this machine are measured (`deadline`, `progress`).

use crate::allocation::Vec;
use crate::grid::Level;
use crate::grid::planes::NODES;

use super::plan::{Input, Plan};
use super::stage::{Stage, Start};

/// The sizes that determine the cost of a tile's stages.
pub struct Costs {
    /// Per level, the active blocks of the charts that are solved.
    blocks: Vec<f64>,
    triangles: f64,
    /// Triangles per node of level 0, 0 to 16. Where there are many, nodes walk over several to find theirs.
    dense: f64,
    pbd: bool,
}

/// Stages with fewer blocks are not representative of larger ones.
const TYPICAL: f64 = 16.0;

impl Costs {
    pub fn new(input: &Input, pbd: bool) -> Costs {
        let active = |level: &Level| {
            let list = level.blocks.list.iter();
            list.filter(|block| block.active && input.charts[block.chart as usize]).count() as f64
        };
        let blocks: Vec<f64> = input.grid.levels.iter().map(active).collect();
        let triangles = input.grid.triangles.len() as f64;
        let dense = (triangles / (blocks[0] * NODES as f64)).min(16.0);
        Costs { blocks, triangles, dense, pbd }
    }

    /// The cost of a stage.
    pub fn of(&self, stage: &Stage) -> f64 {
        let finest = stage.level() == 0;
        let of_block = match *stage {
            Stage::Surface => return 10.0 + self.triangles / 64.0,
            Stage::Pyramid { .. } => return 10.0 + 3.0 * self.blocks.get(1).unwrap_or(&self.blocks[0]),
            Stage::Start { from: Start::Passing, .. } => 1.0,
            Stage::Start { from: Start::Identity, .. } if finest => 9.0,
            Stage::Start { .. } if finest => 9.0 + 4.0 * self.dense,
            Stage::Start { .. } => 5.0,
            Stage::Relax { sweeps, .. } => 9.0 * f64::from(sweeps),
            Stage::Correct { ref correction, .. } if correction.first => {
                45.0 + 15.0 * f64::from(correction.iterations) + if finest { self.dense } else { 0.0 }
            }
            // Most charts skip these corrections.
            Stage::Correct { .. } => 25.0,
            Stage::Iterate { .. } => 12.0,
            // Those of a correction's last state are known.
            Stage::Energies { .. } => 6.0,
            Stage::Certify { .. } => 3.0,
            Stage::GiveUp => return 0.0,
        };
        // Grids may have a single level.
        10.0 + of_block * self.blocks.get(stage.level()).unwrap_or(&0.0)
    }

    /// True if the time of a stage is representative of others.
    pub fn is_typical(&self, stage: &Stage) -> bool {
        let further = matches!(stage, Stage::Correct { correction, .. } if !correction.first);
        !further && self.blocks[stage.level()] >= TYPICAL
    }

    /// The cost of turning the state of a level into a result.
    pub fn result_of(&self, level: usize) -> f64 {
        let allow_folds = self.pbd;
        let passing = |level| self.of(&Stage::Start { level, from: Start::Passing });
        // On level 0, certification computes them unless a correction has.
        let energies = self.of(&Stage::Energies { level, allow_folds });
        energies + (0..level).map(passing).sum::<f64>() + self.of(&Stage::Certify { allow_folds })
    }

    /// The cost of a level's first step; 0 if the level has no steps.
    pub fn first_step(&self, plan: &Plan, level: usize) -> f64 {
        plan.step(level, 0, false).map_or(0.0, |step| self.of(&step))
    }

    /// The cost of a result of the coarsest level.
    pub fn least(&self, plan: &Plan, coarsest: usize) -> f64 {
        let before = self.of(&Stage::Surface) + self.of(&Stage::Pyramid { coarsest: 1 });
        // The start of a warm solve is already a result.
        before
            + self.of(&plan.start(coarsest))
            + if coarsest > 0 { self.first_step(plan, coarsest) } else { 0.0 }
            + self.result_of(coarsest)
    }

    /// The cost of the whole solve, if no chart is crowded.
    pub fn whole(&self, plan: &Plan, coarsest: usize) -> f64 {
        let steps = plan.pbd.map_or(1.0, |settings| f64::from(settings.iterations));
        let level = |level| self.of(&plan.start(level)) + steps * self.first_step(plan, level);
        let levels = (plan.finest.min(coarsest)..=coarsest).map(level);
        self.of(&Stage::Surface)
            + self.of(&Stage::Pyramid { coarsest: 1 })
            + levels.sum::<f64>()
            + self.result_of(plan.finest.min(coarsest))
    }
}
