//! surface: the pose's triangles, their tangents and their metrics (method §2).

use super::Run;
use super::sampling::TriangleRecord;
use super::team::SharedSlice;

/// Triangles of one item of work.
const CHUNK: usize = 256;

impl Run<'_> {
    /// Forms the pose triangles of the charts that are solved, from the pose's positions.
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
