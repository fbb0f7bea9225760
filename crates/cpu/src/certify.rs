//! certify: computes all corner Jacobians of a warp in f64 from its stored displacements, and decides per chart whether
//! the warp or the identity is the result (method §8). If all are positive, the warp is one-to-one and onto, because
//! the borders are fixed (method §11.1).

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{NODES, Plane, SIDE};
use vrtm_core::grid::window::{self, Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::method::plan::ChartResult;

use super::lanes::{LANES, Lanes, Vectorised, dispatch};
use super::run::Run;

impl Run<'_> {
    /// Certifies the finest level's state and makes it the result. A chart becomes the identity if it is folded or if
    /// its energy is above that of the identity or not finite; with `allow_folds`, only if its energy is not finite.
    pub(super) fn certify_result(&mut self, allow_folds: bool) {
        // If work has ended on a coarser level, the energies there count, and are known.
        self.complete_energies(0, allow_folds);
        if !allow_folds {
            self.weigh_identity();
        }
        let certificates = self.certificates();
        for c in 0..self.charts.len() {
            if !self.charts[c] {
                continue;
            }
            let certificate = &certificates[c];
            let result = &mut self.results[c];
            result.energy = self.known_energies[c].unwrap_or_default();
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
            let identity = [[0.0; NODES]; 2];
            self.team.fill(&mut self.result[blocks], |k, of| *of = if better { u[k] } else { identity });
        }
    }

    /// Computes the certificate of each chart.
    fn certificates(&self) -> Vec<Certificate> {
        let blocks = &self.work[0].active;
        let level = &self.grid.levels[0];
        let u = &self.memory.levels[0].u;
        let mut parts = vec![Certificate::default(); blocks.len()];
        self.team.fill(&mut parts, |k, part| *part = certify_block(level, u, blocks[k] as usize));
        let mut certificates = vec![Certificate::default(); self.charts.len()];
        for (part, &b) in parts.iter().zip(blocks) {
            certificates[level.blocks.list[b as usize].chart as usize].add(part);
        }
        certificates
    }
}

/// The length of a vector, from the absolute values of its components: 0 only if both are 0, and NaN if one is NaN.
#[inline(always)]
fn length(x: f32, y: f32) -> f32 {
    let (least, most) = if x < y { (x, y) } else { (y, x) };
    let ratio = if most == 0.0 { least } else { least / most };
    most * (1.0 + ratio * ratio).sqrt()
}

/// The least corner Jacobian (at most 1), the number of corners whose Jacobian is not positive, and the longest
/// displacement in cells, of a chart or of a block.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
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
pub fn corner_jacobians(windows: &[Window; 2], i: usize, j: usize) -> [f64; 4] {
    let w = |di: usize, dj: usize| {
        let at = place(i + di, j + dj);
        [di as f64 + f64::from(windows[0][at]), dj as f64 + f64::from(windows[1][at])]
    };
    jacobians(w(0, 0), w(1, 0), w(0, 1), w(1, 1))
}

/// The Jacobians at the corners of a cell: (0,0), (1,0), (1,1) and (0,1).
#[inline(always)]
fn jacobians(a: [f64; 2], b: [f64; 2], c: [f64; 2], d: [f64; 2]) -> [f64; 4] {
    [cross(a, b, c), cross(b, d, a), cross(d, c, b), cross(c, a, d)]
}

/// Twice the area of a triangle.
#[inline(always)]
fn cross(o: [f64; 2], p: [f64; 2], q: [f64; 2]) -> f64 {
    (p[0] - o[0]) * (q[1] - o[1]) - (p[1] - o[1]) * (q[0] - o[0])
}

/// Computes the certificate of an active block: of the block's cells, and of the adjacent cells of inactive blocks.
/// Cells that are adjacent to no active block are at rest, with J = 1.
pub fn certify_block(level: &Level, u: &[[Plane; 2]], b: usize) -> Certificate {
    let windows = window::planes(&level.blocks.neighbours[b], |b, c| &u[b][c]);
    let mut certificate = dispatch(Bounds { u: &u[b], windows: &windows });
    if certificate.folds > 0 {
        (certificate.min_jacobian, certificate.folds) = (1.0, 0);
        count_folds(level, &windows, b, &mut certificate);
    }
    certificate
}

/// The least corner Jacobian and the longest displacement of a block and its adjacent cells. A loop over a row has no
/// branches, so that the compiler makes vectors of it. Its `folds` only tell whether a corner is folded: a cell that
/// two blocks share is seen by both.
struct Bounds<'a> {
    u: &'a [Plane; 2],
    windows: &'a [Window; 2],
}

/// Cells of a block and its surroundings along an axis.
const CELLS: usize = SIDE + 1;

impl Vectorised for Bounds<'_> {
    type Output = Certificate;

    #[inline(always)]
    fn run<V: Lanes>(self) -> Certificate {
        let mut longest = [0.0f32; LANES];
        let mut is_number = true;
        for s in (0..NODES).step_by(LANES) {
            for k in 0..LANES {
                let (x, y) = (self.u[0][s + k].abs(), self.u[1][s + k].abs());
                let length = length(x, y);
                is_number &= !length.is_nan();
                longest[k] = if length > longest[k] { length } else { longest[k] };
            }
        }
        let longest = longest.into_iter().fold(0.0, f32::max);
        let (mut low, mut high) = ([[0.0; CELLS + 1]; 2], [[0.0; CELLS + 1]; 2]);
        self.nodes(0, &mut low);
        let (mut least, mut all_positive) = ([1.0f64; CELLS], true);
        for j in 1..=CELLS {
            self.nodes(j, &mut high);
            for i in 0..CELLS {
                // In cells, from the cell's own lower left node.
                let (a, b) = ([low[0][i], low[1][i]], [1.0 + low[0][i + 1], low[1][i + 1]]);
                let (c, d) = ([high[0][i], 1.0 + high[1][i]], [1.0 + high[0][i + 1], 1.0 + high[1][i + 1]]);
                let jacobians = jacobians(a, b, c, d);
                for jacobian in jacobians {
                    all_positive &= jacobian > 0.0;
                    least[i] = if jacobian < least[i] { jacobian } else { least[i] };
                }
            }
            low = high;
        }
        let min_jacobian = least.into_iter().fold(1.0, f64::min);
        let max_displacement = if is_number { longest } else { f32::NAN };
        Certificate { min_jacobian, folds: u64::from(!all_positive), max_displacement }
    }
}

impl Bounds<'_> {
    /// The displacements of row `j` of the window's nodes.
    #[inline(always)]
    fn nodes(&self, j: usize, row: &mut [[f64; CELLS + 1]; 2]) {
        for (row, window) in row.iter_mut().zip(self.windows) {
            let (even, odd) = (&window[place(0, j)..], &window[place(1, j)..]);
            let (even, odd) = (&even[..CELLS / 2 + 1], &odd[..CELLS / 2 + 1]);
            for k in 0..CELLS / 2 + 1 {
                row[2 * k] = f64::from(even[k]);
                row[2 * k + 1] = f64::from(odd[k]);
            }
        }
    }
}

/// The exact certificate of the corners: each cell counts once.
fn count_folds(level: &Level, windows: &[Window; 2], b: usize, certificate: &mut Certificate) {
    let is_active = |k: usize| {
        let b = level.blocks.neighbours[b][k];
        b != NONE && level.blocks.list[b as usize].active
    };
    // Cells (-1, -1) to (15, 15). A cell belongs to the block that holds its lower left node. Cells of other blocks are
    // included only if these blocks are inactive, since inactive blocks are not checked themselves.
    for j in 0..CELLS {
        for i in 0..CELLS {
            let holder = if j == 0 { 0 } else { 3 } + usize::from(i > 0);
            if holder != 4 && is_active(holder) {
                continue;
            }
            for jacobian in corner_jacobians(windows, i, j) {
                certificate.add_jacobian(jacobian);
                certificate.folds += u64::from(jacobian.is_nan() || jacobian <= 0.0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vrtm_core::grid::window::WINDOW_NODES;

    /// Vectors find what the corners tell one by one, with numbers that are not numbers, too.
    #[test]
    #[cfg_attr(miri, ignore = "too long; tests/sound runs the same code")]
    fn the_bounds_are_those_of_all_corners() {
        let mut seed = 7u64;
        let mut random = || {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (seed >> 40) as f32 / (1u32 << 24) as f32 - 0.5
        };
        let mut folded = 0;
        for case in 0..400 {
            let size = [0.0, 1e-6, 0.4, 3.0][case % 4];
            let mut windows = [[0.0f32; WINDOW_NODES]; 2];
            windows.iter_mut().flatten().for_each(|u| *u = size * random());
            if case % 50 == 3 {
                windows[case / 50 % 2][place(3 + case / 50, 5)] = f32::NAN;
            }
            let mut u = [[0.0; NODES]; 2];
            let mut expected = Certificate::default();
            for (i, j) in (0..SIDE * SIDE).map(|n| (n % SIDE, n / SIDE)) {
                let s = vrtm_core::grid::planes::slot(i, j);
                [u[0][s], u[1][s]] = [0, 1].map(|c| windows[c][place(i + 1, j + 1)]);
                expected.add_displacement(length(u[0][s].abs(), u[1][s].abs()));
            }
            for (i, j) in (0..CELLS * CELLS).map(|n| (n % CELLS, n / CELLS)) {
                for jacobian in corner_jacobians(&windows, i, j) {
                    expected.add_jacobian(jacobian);
                    expected.folds += u64::from(jacobian.is_nan() || jacobian <= 0.0);
                }
            }
            let found = dispatch(Bounds { u: &u, windows: &windows });
            assert_eq!(found.folds > 0, expected.folds > 0, "{case}");
            let same = |a: f64, b: f64| a == b || (a.is_nan() && b.is_nan());
            assert!(same(found.max_displacement.into(), expected.max_displacement.into()), "{case}");
            assert!(found.folds > 0 || same(found.min_jacobian, expected.min_jacobian), "{case}");
            folded += usize::from(found.folds > 0);
        }
        assert!((100..300).contains(&folded), "{folded}");
        assert!(length(0.0, f32::NAN).is_nan() && length(f32::NAN, 0.0).is_nan() && length(3.0, 4.0) == 5.0);
    }
}
