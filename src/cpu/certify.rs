//! certify: computes all corner Jacobians of a warp in f64 from its stored displacements, and decides per chart whether
//! the warp or the identity is the result (method §8). If all are positive, the warp is one-to-one and onto, because
//! the borders are fixed (method §11.1).

use crate::allocation::{Collect, filled};
use crate::grid::Level;
use crate::grid::planes::{NODES, Plane};
use crate::grid::window::{self, WINDOW_NODES, Window, place};
use crate::mesh::NONE;
use crate::method::plan::ChartResult;

use super::run::Run;
use crate::team::SharedSlice;

impl Run<'_> {
    /// Certifies the finest level's state and makes it the result. A chart becomes the identity if it is folded or if
    /// its energy is above that of the identity or not finite; with `allow_folds`, only if its energy is not finite.
    pub(super) fn certify_result(&mut self, allow_folds: bool) {
        let all_known = (0..self.charts.len()).all(|c| !self.charts[c] || self.known_energies[c].is_some());
        let energies = match (allow_folds, all_known) {
            (true, _) => self.energies_allowing_folds(0),
            (false, true) => self.known_energies.iter().map(|energy| energy.unwrap_or_default()).collected(),
            (false, false) => self.energies(0),
        };
        let certificates = self.certificates();
        for c in 0..self.charts.len() {
            if !self.charts[c] {
                continue;
            }
            let certificate = &certificates[c];
            let result = &mut self.results[c];
            result.energy = energies[c];
            result.min_jacobian = certificate.min_jacobian;
            result.folds = certificate.folds;
            result.max_displacement = certificate.max_displacement;
            // Any comparison with NaN is false.
            let better = result.energy.is_finite()
                && (allow_folds || (result.energy <= result.energy_before && certificate.folds == 0));
            if !better {
                *result = ChartResult {
                    energy: result.energy_before,
                    min_jacobian: 1.0,
                    folds: 0,
                    max_displacement: 0.0,
                    fallback: true,
                    ..*result
                };
            }
            let blocks = self.grid.levels[0].blocks.of_chart[c].clone();
            let u = &self.memory.levels[0].u[blocks.clone()];
            let result = SharedSlice::new(&mut self.result[blocks]);
            self.team.run(u.len(), |k| {
                // SAFETY: each item has its own block.
                unsafe { *result.get_mut(k) = if better { u[k] } else { [[0.0; NODES]; 2] } };
            });
        }
    }

    /// Makes the identity the result of all charts that are solved, without certification.
    pub(super) fn fall_back_everywhere(&mut self) {
        for c in (0..self.charts.len()).filter(|&c| self.charts[c]) {
            self.results[c] = ChartResult { min_jacobian: 1.0, fallback: true, ..ChartResult::default() };
            if self.result_is_used {
                self.result[self.grid.levels[0].blocks.of_chart[c].clone()].fill([[0.0; NODES]; 2]);
            }
        }
    }

    /// Computes the certificate of each chart.
    fn certificates(&self) -> Vec<Certificate> {
        let blocks = &self.work[0].active;
        let level = &self.grid.levels[0];
        let u = &self.memory.levels[0].u;
        let mut parts = filled(Certificate::default(), blocks.len());
        let shared = SharedSlice::new(&mut parts);
        self.team.run(blocks.len(), |k| {
            // SAFETY: each item has its own certificate.
            unsafe { *shared.get_mut(k) = certify_block(level, u, blocks[k] as usize) };
        });
        let mut certificates = filled(Certificate::default(), self.charts.len());
        for (part, &b) in parts.iter().zip(blocks) {
            certificates[level.blocks.list[b as usize].chart as usize].add(part);
        }
        certificates
    }
}

/// The length of a vector; 0 only if both components are 0, and NaN if one of them is NaN.
fn length(x: f32, y: f32) -> f32 {
    let (least, most) = (x.abs().min(y.abs()), x.abs().max(y.abs()));
    if x.is_nan() || y.is_nan() {
        f32::NAN
    } else if most == 0.0 {
        0.0
    } else {
        most * (1.0 + (least / most) * (least / most)).sqrt()
    }
}

/// The least corner Jacobian (at most 1), the number of corners whose Jacobian is not positive, and the longest
/// displacement in cells, of a chart or of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Certificate {
    pub min_jacobian: f64,
    pub folds: u64,
    pub max_displacement: f32,
}

impl Default for Certificate {
    /// The certificate of the identity.
    fn default() -> Self {
        Certificate { min_jacobian: 1.0, folds: 0, max_displacement: 0.0 }
    }
}

impl Certificate {
    /// Combines this certificate with that of another part of the chart.
    pub fn add(&mut self, other: &Certificate) {
        self.add_jacobian(other.min_jacobian);
        self.folds += other.folds;
        self.add_displacement(other.max_displacement);
    }

    /// Includes a corner Jacobian in the minimum, which becomes NaN if `x` is NaN.
    fn add_jacobian(&mut self, x: f64) {
        if x.is_nan() || x < self.min_jacobian {
            self.min_jacobian = x;
        }
    }

    /// Includes a displacement in the maximum, which becomes NaN if `x` is NaN.
    fn add_displacement(&mut self, x: f32) {
        if x.is_nan() || x > self.max_displacement {
            self.max_displacement = x;
        }
    }
}

/// The Jacobians at the corners of the cell (i - 1, j - 1) of a block, from the windows of its displacements.
pub(crate) fn corner_jacobians(windows: &[Window; 2], i: usize, j: usize) -> [f64; 4] {
    let w = |di: usize, dj: usize| {
        let at = place(i + di, j + dj);
        [di as f64 + f64::from(windows[0][at]), dj as f64 + f64::from(windows[1][at])]
    };
    let (a, b, c, d) = (w(0, 0), w(1, 0), w(0, 1), w(1, 1));
    let cross =
        |o: [f64; 2], p: [f64; 2], q: [f64; 2]| (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0]);
    [cross(a, b, c), cross(b, d, a), cross(d, c, b), cross(c, a, d)]
}

/// Computes the certificate of an active block: of the block's cells, and of the adjacent cells of inactive blocks.
/// Cells that are adjacent to no active block are at rest, with J = 1.
pub(crate) fn certify_block(level: &Level, u: &[[Plane; 2]], b: usize) -> Certificate {
    let mut certificate = Certificate::default();
    let mut windows = [[0.0f32; WINDOW_NODES]; 2];
    for (c, window) in windows.iter_mut().enumerate() {
        window::load(&level.blocks.neighbours[b], 0.0, |b| &u[b][c], window);
    }
    let [x, y] = &u[b];
    x.iter().zip(y).for_each(|(x, y)| certificate.add_displacement(length(*x, *y)));
    let is_active = |k: usize| {
        let b = level.blocks.neighbours[b][k];
        b != NONE && level.blocks.list[b as usize].active
    };
    // Cells (-1, -1) to (15, 15). A cell belongs to the block that holds its lower left node. Cells of other blocks are
    // included only if these blocks are inactive, since inactive blocks are not checked themselves.
    for j in 0..17 {
        for i in 0..17 {
            let holder = if j == 0 { 0 } else { 3 } + usize::from(i > 0);
            if holder != 4 && is_active(holder) {
                continue;
            }
            for jacobian in corner_jacobians(&windows, i, j) {
                certificate.add_jacobian(jacobian);
                certificate.folds += u64::from(jacobian.is_nan() || jacobian <= 0.0);
            }
        }
    }
    certificate
}
