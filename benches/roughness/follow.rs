//! Tells jumps of the minimum from jumps of the solver. The poses of the roughness are solved once more, each from the
//! result of the pose before it and until nothing moves any more: forwards, and backwards. Where the two meet, the
//! minimum moves smoothly and a jump of a solve from the identity is the solver's; where they stay apart, two minima
//! lie side by side, and every solve that knows a single pose has to change from one to the other somewhere.

use vrtm::{Asset, SolveOptions, Strided};

use vrtm_testkit::Model;
use vrtm_testkit::roughness::{self, LARGE, Smoothness, Warp};

/// Solves of one pose, with so many corrections each, until no node moves by more than `STILL` cells.
const SOLVES: usize = 20;
const CORRECTIONS: u32 = 50;
const STILL: f64 = 2e-3;

/// Nodes to each side of a jump that belong to it: a feature jumps as a whole.
const REACH: usize = 4;

pub struct Followed {
    /// Of the solves from the identity, of the followed minimum forwards, and backwards.
    pub smoothness: [Smoothness; 3],
    /// Energies over those of the solves from the identity, the mean over the poses: forwards, backwards.
    pub energy: [f64; 2],
    /// Largest movement of a node in the last solve of a pose.
    pub moved: f64,
    /// Fraction of the nodes and poses where the minimum forwards and the one backwards are over 0.1 cells apart.
    pub apart: f64,
    /// Of the second differences over 0.1 of the solves from the identity, the fraction where the two minima are apart
    /// in one of the three poses, or one of the minima has such a second difference itself, within `REACH` nodes.
    pub explained: f64,
    /// The same fraction of all second differences: what `explained` would be by chance.
    pub chance: f64,
}

struct Solver<'a> {
    asset: &'a mut Asset,
    tile: usize,
    options: SolveOptions,
}

impl Solver<'_> {
    fn solve(&mut self, pose: &[[f64; 3]], options: &SolveOptions) -> (Warp, f64) {
        self.asset.solve(Strided::from_slice(pose), options).unwrap();
        (roughness::warp(self.asset, self.tile), self.asset.tile(self.tile).report().unwrap().energy)
    }

    /// The minimum that the last result leads to.
    fn follow(&mut self, pose: &[[f64; 3]], moved: &mut f64) -> (Warp, f64) {
        let options = SolveOptions {
            warm: true,
            tolerance: Some(1e-7),
            max_corrections: Some(CORRECTIONS),
            ..self.options
        };
        let mut last = self.solve(pose, &options);
        for n in 1.. {
            let next = self.solve(pose, &options);
            let change = roughness::apart(&last.0, &next.0).fold(0.0, f64::max);
            last = next;
            if change < STILL || n == SOLVES {
                *moved = moved.max(change);
                break;
            }
        }
        last
    }
}

pub fn follow(
    asset: &mut Asset,
    tile: usize,
    model: &Model,
    frame: usize,
    options: &SolveOptions,
) -> Followed {
    let poses = roughness::poses(model, frame);
    let mut solver = Solver { asset, tile, options: *options };
    let mut moved = 0.0;
    let mut follow = |backwards: bool| {
        let mut order: Vec<usize> = (0..poses.len()).collect();
        if backwards {
            order.reverse();
        }
        solver.solve(&poses[order[0]], options);
        let mut found: Vec<_> = order.iter().map(|&k| solver.follow(&poses[k], &mut moved)).collect();
        if backwards {
            found.reverse();
        }
        found
    };
    let (forwards, backwards) = (follow(false), follow(true));
    let cold: Vec<_> = poses.iter().map(|pose| solver.solve(pose, options)).collect();
    let warps: [Vec<Warp>; 3] =
        [&cold, &forwards, &backwards].map(|solves| solves.iter().map(|(warp, _)| warp.clone()).collect());
    let energy = [&forwards, &backwards]
        .map(|solves| solves.iter().zip(&cold).map(|(a, b)| a.1 / b.1).sum::<f64>() / poses.len() as f64);
    let smoothness = [0, 1, 2].map(|k| Smoothness::of(&warps[k]));

    let side = (warps[0][0].len() as f64).sqrt() as usize;
    let moving = roughness::moving(&warps[0]);
    let pair: Vec<Vec<bool>> = (0..poses.len())
        .map(|k| roughness::apart(&warps[1][k], &warps[2][k]).map(|d| d > LARGE).collect())
        .collect();
    let both = moving.iter().map(|&n| pair.iter().filter(|apart| apart[n]).count()).sum::<usize>();
    let (mut large, mut explained, mut near) = (0usize, 0usize, 0usize);
    for step in 0..poses.len() - 2 {
        let jumps: Vec<bool> = (0..side * side)
            .map(|n| {
                (step..step + 3).any(|k| pair[k][n])
                    || [1, 2].iter().any(|&b| roughness::second_difference(&warps[b][step..], n) > LARGE)
            })
            .collect();
        let close = widened(&jumps, side);
        near += moving.iter().filter(|&&n| close[n]).count();
        for &n in moving.iter().filter(|&&n| roughness::second_difference(&warps[0][step..], n) > LARGE) {
            large += 1;
            explained += usize::from(close[n]);
        }
    }
    Followed {
        smoothness,
        energy,
        moved,
        apart: both as f64 / (moving.len() * poses.len()).max(1) as f64,
        explained: explained as f64 / large.max(1) as f64,
        chance: near as f64 / (moving.len() * (poses.len() - 2)).max(1) as f64,
    }
}

/// The nodes within `REACH` of one that is set.
fn widened(nodes: &[bool], side: usize) -> Vec<bool> {
    let along = |nodes: &[bool], stride: usize| -> Vec<bool> {
        (0..nodes.len())
            .map(|n| {
                let place = n / stride % side;
                (place.saturating_sub(REACH)..(place + REACH + 1).min(side))
                    .any(|other| nodes[n - place * stride + other * stride])
            })
            .collect()
    };
    along(&along(nodes, 1), side)
}
