//! pyramid: computes the pose metrics at the nodes of the coarser levels, those of level 1 from the metrics of the
//! triangles, and those of each other level from the next finer one (method §3).

use vrtm_core::grid::metric;

use super::run::Run;
use vrtm_core::team::SharedSlice;

impl Run<'_> {
    /// Computes the metrics of level 1, from those of the triangles, to `coarsest`.
    pub(super) fn pose_metrics(&mut self, coarsest: usize) {
        for k in 1..self.grid.levels.len().min(coarsest + 1) {
            let (finer, coarser) = self.memory.levels.split_at_mut(k);
            let (finer, buffers) = (&finer[k - 1], &mut coarser[0]);
            let metric = SharedSlice::new(&mut buffers.metric);
            let (grid, metrics) = (self.grid, &self.memory.metrics);
            let blocks = &self.work[k].stored;
            self.team.run(blocks.len(), |n| {
                let b = blocks[n] as usize;
                // SAFETY: each item has its own block.
                let out = unsafe { metric.get_mut(b) };
                match k {
                    1 => grid.gather.block(b, metrics, out),
                    _ => {
                        metric::restrict_block(&grid.levels[k], &grid.levels[k - 1], &finer.metric, b, out);
                    }
                }
            });
        }
    }
}
