//! Rigidity and mobility on the coarser levels (method §3), each from the next finer level: the paper's eq. 7 and eq.
//! 8.

use crate::mesh::NONE;

/// Rigidity and mobility at all nodes of one level; node (i, j) has the index `j * (nx + 1) + i`.
#[derive(Clone, Debug)]
pub(crate) struct NodeMaps {
    pub nx: usize,
    pub ny: usize,
    pub rigidity: Vec<f32>,
    /// The chart of a movable node, `NONE` for a fixed one.
    pub chart: Vec<u32>,
}

impl NodeMaps {
    /// The next coarser level. A coarse node may move only if all of the 3x3 finer nodes around it may (eq. 8), so that
    /// bilinear prolongation never moves a fixed node, nor one of another chart. Rigidity is a 3x3 Gaussian (eq. 7). An
    /// odd last column or row of cells is dropped; the nodes at its inner side are fixed by the same rule.
    pub fn coarser(&self) -> NodeMaps {
        let (nx, ny) = (self.nx / 2, self.ny / 2);
        let width = self.nx + 1;
        let mut rigidity = Vec::with_capacity((nx + 1) * (ny + 1));
        let mut chart = Vec::with_capacity((nx + 1) * (ny + 1));
        for j in 0..=ny {
            for i in 0..=nx {
                let mut sum = 0.0;
                let mut weights = 0.0;
                let mut owner = self.chart[2 * j * width + 2 * i];
                for dj in -1i64..=1 {
                    for di in -1i64..=1 {
                        let (x, y) = (2 * i as i64 + di, 2 * j as i64 + dj);
                        if x < 0 || y < 0 || x > self.nx as i64 || y > self.ny as i64 {
                            owner = NONE;
                            continue;
                        }
                        let at = y as usize * width + x as usize;
                        let weight = ((2 - di.abs()) * (2 - dj.abs())) as f32;
                        sum += weight * self.rigidity[at];
                        weights += weight;
                        if self.chart[at] == NONE {
                            owner = NONE;
                        }
                    }
                }
                rigidity.push(sum / weights);
                chart.push(owner);
            }
        }
        NodeMaps { nx, ny, rigidity, chart }
    }

    /// True if no node of this level may move.
    pub fn is_fixed(&self) -> bool {
        self.chart.iter().all(|&c| c == NONE)
    }
}
