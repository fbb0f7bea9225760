//! How smooth the warp is as a function of the pose. Poses a small part of a motion apart are solved, each from the
//! identity; the second difference of the warps, beside the first one, tells whether it changes smoothly. Noise of the
//! size of a rounding of f32 in the pose tells how much the solve magnifies it.

use crate::asset::Lab as _;
use vrtm::{Asset, SolveOptions, Strided};

use crate::model::Model;
use crate::motion::Spread;
use crate::random::splitmix;

/// Poses along a motion from rest to a frame: 0.92, 0.925 ... 0.955 of the way.
const START: f64 = 0.92;
const STEP: f64 = 0.005;
const POSES: usize = 8;

/// Standard deviation of the noise, as a fraction of the largest side of the pose's bounding box.
const NOISE: f64 = 1e-7;
const SEEDS: u64 = 5;

/// A second difference from here on counts as large, in cells.
const LARGE: f64 = 0.1;

/// Displacements of the nodes, in cells.
type Warp = Vec<[f64; 2]>;

/// The roughness of one tile's warp near one frame. Lengths are in cells, the larger component of each; nodes that do
/// not move are left out.
#[derive(Clone, Debug, Default)]
pub struct Roughness {
    /// RMS strain of rigid features on the mesh, in the frame itself.
    pub strain: f64,
    /// Energy in the frame itself.
    pub energy: f64,
    pub smoothness: Smoothness,
    /// The change of W that 99.9 % of the nodes stay under when the frame gets noise: the median over five seeds.
    pub noise: f64,
    /// Milliseconds of the solve of the frame, the shortest of those with noise.
    pub ms: f64,
}

/// Smoothness of warps from pose to pose.
#[derive(Clone, Debug, Default)]
pub struct Smoothness {
    /// RMS of the first difference W(t + dt) - W(t).
    pub first: f64,
    /// RMS of the second difference W(t + dt) - 2 W(t) + W(t - dt).
    pub second: f64,
    /// Fraction of the second differences that are over 0.1.
    pub large: f64,
    /// The largest second difference, and its node and time step.
    pub largest: f64,
    pub largest_at: (usize, usize),
}

impl Roughness {
    /// Solves the poses near a frame, numbered from 1, of the asset's model, and the noisy ones.
    pub fn of(
        asset: &mut Asset,
        tile: usize,
        model: &Model,
        frame: usize,
        options: &SolveOptions,
    ) -> Roughness {
        let mut solve = |pose: &[[f64; 3]], measure: bool| {
            asset.solve(Strided::from_slice(pose), &SolveOptions { measure, ..*options }).unwrap();
            let report = asset.tile(tile).report().unwrap();
            (warp(asset, tile), report)
        };
        let warps: Vec<_> = poses(model, frame).iter().map(|pose| solve(pose, false).0).collect();
        let mut result = Roughness { smoothness: Smoothness::of(&warps), ..Roughness::default() };
        let frame = way(model, frame, 1.0);
        let (base, report) = solve(&frame, true);
        result.strain = report.strain.as_ref().map_or(f64::NAN, |strain| f64::from(strain.after.rms));
        result.energy = report.energy;
        result.ms = f64::INFINITY;
        let mut noise = Vec::new();
        for seed in 0..SEEDS {
            let (warp, report) = solve(&with_noise(&frame, seed), false);
            result.ms = result.ms.min(f64::from(report.times.total));
            noise.push(percentile_999(&base, &warp));
        }
        noise.sort_by(f64::total_cmp);
        result.noise = noise[noise.len() / 2];
        result
    }
}

/// A part of the motion from rest to a frame, numbered from 1.
pub fn way(model: &Model, frame: usize, t: f64) -> Vec<[f64; 3]> {
    let point = |(r, p): (&[f32; 3], &[f32; 3])| {
        [0, 1, 2].map(|k| f64::from(r[k]) + t * (f64::from(p[k]) - f64::from(r[k])))
    };
    model.rest.iter().zip(&model.frames[frame - 1]).map(point).collect()
}

/// The poses whose warps are compared.
fn poses(model: &Model, frame: usize) -> Vec<Vec<[f64; 3]>> {
    (0..POSES).map(|k| way(model, frame, START + STEP * k as f64)).collect()
}

fn warp(asset: &Asset, tile: usize) -> Warp {
    asset.displacements(tile).unwrap().iter().map(|u| u.map(f64::from)).collect()
}

/// Second difference of three warps at a node.
pub fn second_difference(w: &[Warp], n: usize) -> f64 {
    larger_component([0, 1].map(|c| w[2][n][c] - 2.0 * w[1][n][c] + w[0][n][c]))
}

fn larger_component(x: [f64; 2]) -> f64 {
    x[0].abs().max(x[1].abs())
}

/// The nodes that move in one of the poses.
pub fn moving(warps: &[Warp]) -> Vec<usize> {
    (0..warps[0].len()).filter(|&n| warps.iter().any(|warp| warp[n] != [0.0; 2])).collect()
}

impl Smoothness {
    pub fn of(warps: &[Warp]) -> Smoothness {
        let moving = moving(warps);
        let mut result = Smoothness::default();
        let (mut first, mut second, mut large) = (0.0, 0.0, 0usize);
        for pair in warps.windows(2) {
            let d = |n: usize| larger_component([0, 1].map(|c| pair[1][n][c] - pair[0][n][c]));
            first += moving.iter().map(|&n| d(n).powi(2)).sum::<f64>();
        }
        for (step, w) in warps.windows(3).enumerate() {
            for &n in &moving {
                let d = second_difference(w, n);
                second += d * d;
                large += usize::from(d > LARGE);
                if d > result.largest {
                    result.largest = d;
                    result.largest_at = (n, step + 1);
                }
            }
        }
        let count = |steps: usize| (steps * moving.len()).max(1) as f64;
        result.first = (first / count(warps.len() - 1)).sqrt();
        result.second = (second / count(warps.len() - 2)).sqrt();
        result.large = large as f64 / count(warps.len() - 2);
        result
    }
}

/// The difference that 99.9 % of the nodes that move stay under.
fn percentile_999(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let moving = a.iter().zip(b).enumerate().filter(|(_, (a, b))| **a != [0.0; 2] || **b != [0.0; 2]);
    Spread::of(moving.map(|(n, (a, b))| (n, larger_component([a[0] - b[0], a[1] - b[1]])))).p999
}

/// The points with Gaussian noise.
fn with_noise(points: &[[f64; 3]], seed: u64) -> Vec<[f64; 3]> {
    let side = |c: usize| {
        let (low, high) = points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[c]), high.max(p[c])));
        high - low
    };
    let scale = NOISE * side(0).max(side(1)).max(side(2));
    let mut state = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    // The sum of twelve uniform numbers in place of a normal one.
    let mut normal = || (0..12).map(|_| splitmix(&mut state)).sum::<f64>() - 6.0;
    points.iter().map(|p| p.map(|x| x + scale * normal())).collect()
}
