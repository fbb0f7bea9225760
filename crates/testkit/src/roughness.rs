//! How smooth the warp is as a function of the pose. Poses a small part of a motion apart are solved, each from the
//! identity; the second difference of the warps, beside the first one, tells whether it changes smoothly. Noise of the
//! size of a rounding of f32 in the pose tells how much the solve magnifies it.

use crate::asset::Lab as _;
use vrtm::{Asset, SolveOptions, Strided};

use crate::model::Model;
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

/// Size of values: the root of the mean square, the bound of 99.9 %, and the largest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spread {
    pub rms: f64,
    pub p999: f64,
    pub max: f64,
}

impl Spread {
    pub fn of(values: impl IntoIterator<Item = f64>) -> Spread {
        let mut values: Vec<f64> = values.into_iter().collect();
        values.sort_unstable_by(f64::total_cmp);
        let Some(&max) = values.last() else { return Spread::default() };
        let rms = (values.iter().map(|x| x * x).sum::<f64>() / values.len() as f64).sqrt();
        Spread { rms, p999: values[values.len() - 1 - values.len() / 1000], max }
    }
}

/// The roughness of one tile's warp near one frame. Lengths are in cells, the larger component of each; nodes that do
/// not move are left out.
#[derive(Clone, Debug, Default)]
pub struct Roughness {
    /// RMS of the second difference W(t + dt) - 2 W(t) + W(t - dt).
    pub second: f64,
    /// Fraction of the second differences that are over 0.1.
    pub large: f64,
    /// The largest second difference.
    pub largest: f64,
    /// The change of W that 99.9 % of the nodes stay under when the frame gets noise: the median over five seeds.
    pub noise: f64,
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
        let mut solve = |pose: &[[f64; 3]]| {
            asset.solve(Strided::from_slice(pose), options).unwrap();
            warp(asset, tile)
        };
        let warps: Vec<_> = poses(model, frame).iter().map(|pose| solve(pose)).collect();
        let frame = way(model, frame, 1.0);
        let base = solve(&frame);
        let of_seed = |seed| percentile_999(&base, &solve(&with_noise(&frame, seed)));
        let mut noise: Vec<f64> = (0..SEEDS).map(of_seed).collect();
        noise.sort_by(f64::total_cmp);
        let mut result = Roughness { noise: noise[noise.len() / 2], ..Roughness::default() };
        let moving = moving(&warps);
        let all: Vec<f64> =
            warps.windows(3).flat_map(|w| moving.iter().map(|&n| second_difference(w, n))).collect();
        let count = all.len().max(1) as f64;
        result.second = (all.iter().map(|d| d * d).sum::<f64>() / count).sqrt();
        result.large = all.iter().filter(|d| **d > LARGE).count() as f64 / count;
        result.largest = all.iter().copied().fold(0.0, f64::max);
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

/// The difference that 99.9 % of the nodes that move stay under.
fn percentile_999(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    let moving = a.iter().zip(b).enumerate().filter(|(_, (a, b))| **a != [0.0; 2] || **b != [0.0; 2]);
    Spread::of(moving.map(|(_, (a, b))| larger_component([a[0] - b[0], a[1] - b[1]]))).p999
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
