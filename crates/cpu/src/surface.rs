//! surface: computes the origin, tangents and metric of each triangle from the positions of the pose (method §2 and
//! §3).

use super::run::Run;
use super::sampling::record::TriangleRecord;
use vrtm_core::team::SharedSlice;

/// Triangles per work item.
const CHUNK: usize = 256;

impl Run<'_> {
    /// Computes the triangles of the charts that are solved.
    pub(super) fn pose_triangles(&mut self) {
        let triangle = self.grid.pose_triangles(self.mesh, self.pose);
        let (triangles, metrics) =
            (SharedSlice::new(&mut self.memory.triangles), SharedSlice::new(&mut self.memory.metrics));
        let count = self.grid.triangles.len();
        self.team.run(count.div_ceil(CHUNK), |k| {
            for t in k * CHUNK..((k + 1) * CHUNK).min(count) {
                if self.charts[self.grid.chart_of[t] as usize] {
                    let pose = triangle(t);
                    // SAFETY: each item has its own triangles.
                    unsafe {
                        *metrics.get_mut(t) = pose.metric();
                        *triangles.get_mut(t) = TriangleRecord::new(&self.grid.triangles[t], &pose);
                    }
                }
            }
        });
    }
}
