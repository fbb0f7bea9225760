//! Relative costs of the stages of a solve, for its progress (`progress`). A cost is a number of microseconds on two
//! cores of 2.5 GHz.

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
}

impl Costs {
    pub fn new(input: &Input) -> Costs {
        let active = |level: &Level| {
            let list = level.blocks.list.iter();
            list.filter(|block| block.active && input.charts[block.chart as usize]).count() as f64
        };
        let blocks: Vec<f64> = input.grid.levels.iter().map(active).collect();
        let triangles = input.grid.triangles.len() as f64;
        let dense = (triangles / (blocks[0] * NODES as f64)).min(16.0);
        Costs { blocks, triangles, dense }
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
            // A correction knows the energies of its last state; this is the cost without one.
            Stage::Energies { .. } => 6.0,
            Stage::Certify { .. } => 3.0,
        };
        // Grids may have a single level.
        10.0 + of_block * self.blocks.get(stage.level()).unwrap_or(&0.0)
    }

    /// The cost of the whole solve, if no chart is crowded.
    pub fn whole(&self, plan: &Plan, coarsest: usize) -> f64 {
        let finest = plan.finest.min(coarsest);
        let steps = plan.pbd.map_or(1.0, |settings| f64::from(settings.iterations));
        let of_level = |level| {
            let step = plan.step(level, 0, false).map_or(0.0, |step| self.of(&step));
            self.of(&plan.start(level)) + steps * step
        };
        let passing = |level| self.of(&Stage::Start { level, from: Start::Passing });
        let allow_folds = plan.pbd.is_some();
        self.of(&Stage::Surface)
            + self.of(&Stage::Pyramid { coarsest: 1 })
            + (finest..=coarsest).map(of_level).sum::<f64>()
            // On level 0, certification computes them unless a correction has.
            + self.of(&Stage::Energies { level: finest, allow_folds })
            + (0..finest).map(passing).sum::<f64>()
            + self.of(&Stage::Certify { allow_folds })
    }
}
