//! The CPU backend: f32, displacements in cells, blocks of colour planes, the same bits for any number of threads.

#![allow(clippy::needless_range_loop, reason = "index loops over several planes at once are what vectorises")]
#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "a NaN must fail a check, not pass it")]

pub(crate) mod certify;
mod correct;
pub(crate) mod invert;
mod lanes;
mod patch;
mod prolong;
mod relax;
mod surface;
mod team;

use std::marker::PhantomData;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError, Weak};

use crate::mesh::{NONE, TileMesh};
use crate::settings::TileSettings;
use crate::solve::{Correction, Stages};
use crate::tile::blocks::{NODES, Plane, SIDE, node_at, slot};
use crate::tile::pose::{Pose, PoseTriangle};
use crate::tile::{Grid, metric};
use certify::Certificate;
use correct::Systems;
use lanes::wide;
use patch::{BlockEnergy, Patch, State, Weights};
use surface::{Chords, Metrics, Surface};
use team::Shared;
pub(crate) use team::Team;

/// What a chart's solve ended with.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ChartResult {
    pub energy_before: f64,
    pub energy: f64,
    pub min_jacobian: f64,
    pub folds: u64,
    pub max_displacement: f32,
    /// True if the solve found nothing better than the identity.
    pub fallback: bool,
}

/// The changing state of one level.
#[derive(Debug, Default)]
struct Buffers {
    /// Displacements, in cells of this level.
    u: Vec<[Plane; 2]>,
    /// Positions (finest) or metrics at W(p).
    value: Vec<[Plane; 3]>,
    /// The triangle under W(p); finest level only.
    triangle: Vec<Plane<u32>>,
    /// Pose metrics at the nodes; coarser levels only.
    metric: Vec<[Plane; 3]>,
}

impl Buffers {
    fn state(&mut self) -> State {
        State {
            u: Shared::new(&mut self.u),
            value: Shared::new(&mut self.value),
            triangle: Shared::new(&mut self.triangle),
        }
    }
}

/// Blocks of one level that take part in a solve.
#[derive(Clone, Debug, Default)]
struct Work {
    /// Blocks with movable nodes, by block colour.
    colours: [Vec<u32>; 4],
    /// The same in storage order.
    active: Vec<u32>,
    /// These and the ones that are stored for their neighbours' sake.
    stored: Vec<u32>,
}

impl Work {
    /// Keeps the blocks for which `f` is true.
    fn retain(&mut self, f: impl Fn(u32) -> bool) {
        for list in self.colours.iter_mut().chain([&mut self.active, &mut self.stored]) {
            list.retain(|&b| f(b));
        }
    }
}

/// The memory of one tile's solver, kept between solves.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    grid: Weak<Grid>,
    levels: Vec<Buffers>,
    systems: Systems,
    triangles: Vec<PoseTriangle>,
    metrics: Vec<[f32; 3]>,
}

impl Memory {
    /// Allocates for a grid.
    pub fn new(grid: &Arc<Grid>) -> Memory {
        let mut levels: Vec<Buffers> = Vec::with_capacity(grid.levels.len());
        for (k, level) in grid.levels.iter().enumerate() {
            let n = level.blocks.list.len();
            levels.push(Buffers {
                u: vec![[[0.0; NODES]; 2]; n],
                value: vec![[[0.0; NODES]; 3]; n],
                triangle: if k == 0 { vec![[NONE; NODES]; n] } else { Vec::new() },
                metric: if k > 0 { vec![[[0.0; NODES]; 3]; n] } else { Vec::new() },
            });
        }
        Memory {
            grid: Arc::downgrade(grid),
            levels,
            systems: Systems::new(grid),
            triangles: vec![PoseTriangle::default(); grid.triangles.len()],
            metrics: vec![[0.0; 3]; grid.triangles.len()],
        }
    }

    /// Bytes that `new` takes for a grid.
    pub fn bytes_for(grid: &Grid) -> u64 {
        let plane = NODES * 4;
        let levels: usize =
            grid.levels.iter().map(|level| level.blocks.list.len() * (2 + 3 + 3) * plane).sum();
        // The finest level has triangles where the others have metrics.
        let finest = grid.levels[0].blocks.list.len() * 2 * plane;
        let triangles = grid.triangles.len() * (size_of::<PoseTriangle>() + 12);
        (levels - finest + triangles) as u64 + Systems::bytes_for(grid)
    }

    /// True if this is the memory of a grid (grids of other sizes or maps have other blocks).
    pub fn is_for(&self, grid: &Arc<Grid>) -> bool {
        self.grid.upgrade().is_some_and(|own| Arc::ptr_eq(&own, grid))
    }
}

/// One solve of one tile.
pub(crate) struct Run<'a> {
    team: &'a Team,
    grid: &'a Grid,
    mesh: &'a TileMesh,
    pose: &'a Pose,
    memory: &'a mut Memory,
    weights: Weights,
    work: Vec<Work>,
    /// The charts to solve.
    charts: &'a [bool],
    /// Displacements of the previous result, then of this one.
    result: &'a mut [[Plane; 2]],
    /// Per chart; of those that were solved.
    pub outcome: Vec<ChartResult>,
    node_updates: AtomicU64,
    patches: Patches,
}

/// Patches that are not in use: each thread takes one while it works on a block.
#[derive(Debug, Default)]
struct Patches(Mutex<Vec<Box<Patch>>>);

impl Patches {
    /// Calls `f` with a patch of its own.
    fn with<R>(&self, f: impl FnOnce(&mut Patch) -> R) -> R {
        let pool = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let free = pool().pop();
        let mut patch = free.unwrap_or_else(Patch::zeroed);
        let result = f(&mut patch);
        pool().push(patch);
        result
    }
}

/// What a run works with.
pub(crate) struct Input<'a> {
    pub grid: &'a Grid,
    pub mesh: &'a TileMesh,
    pub pose: &'a Pose,
    pub settings: &'a TileSettings,
    pub charts: &'a [bool],
}

impl<'a> Run<'a> {
    pub fn new(
        team: &'a Team,
        input: &Input<'a>,
        memory: &'a mut Memory,
        result: &'a mut [[Plane; 2]],
    ) -> Run<'a> {
        let Input { grid, mesh, pose, settings, charts } = *input;
        let work = grid
            .levels
            .iter()
            .map(|level| {
                let mut work = Work::default();
                for (b, block) in level.blocks.list.iter().enumerate() {
                    if charts[block.chart as usize] {
                        work.stored.push(b as u32);
                        if block.active {
                            work.active.push(b as u32);
                            work.colours[(block.y % 2 * 2 + block.x % 2) as usize].push(b as u32);
                        }
                    }
                }
                work
            })
            .collect();
        Run {
            team,
            grid,
            mesh,
            pose,
            memory,
            weights: Weights::new(settings),
            work,
            charts,
            result,
            outcome: vec![ChartResult::default(); charts.len()],
            node_updates: AtomicU64::new(0),
            patches: Patches::default(),
        }
    }

    /// Node updates of all relaxations.
    pub fn node_updates(&self) -> u64 {
        self.node_updates.load(Ordering::Relaxed)
    }

    /// Blocks with movable nodes on the finest level.
    pub fn blocks_active(&self) -> u64 {
        self.work[0].active.len() as u64
    }

    /// Samples the surface anew under all nodes of the blocks, from their displacements.
    fn refresh(&mut self, level: usize, blocks: &[u32]) {
        let grid = self.grid;
        let (finest, coarser) = self.memory.levels.split_at_mut(1);
        let buffers = if level == 0 { &mut finest[0] } else { &mut coarser[level - 1] };
        let metric = std::mem::take(&mut buffers.metric);
        let state = buffers.state();
        let chords = Chords { grid, triangles: &self.memory.triangles };
        let metrics = Metrics { level: &grid.levels[level], metric: &metric };
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            unsafe {
                if level == 0 {
                    refresh_chords(chords, state, b);
                } else {
                    refresh_metrics(metrics, state, b);
                }
            }
        });
        self.memory.levels[level].metric = metric;
    }

    /// Calls `f` on all active blocks of a level, block colour by block colour.
    fn each_colour(&self, level: usize, backwards: bool, f: impl Fn(usize) + Sync) {
        for k in 0..4 {
            let blocks = &self.work[level].colours[if backwards { 3 - k } else { k }];
            self.team.run(blocks.len(), |k| f(blocks[k] as usize));
        }
    }

    /// Calls `f(chords)` or `f(metrics)`, whichever measures a level, with the level's state.
    fn with_surface<R>(&mut self, level: usize, f: impl SurfaceFn<R>) -> R {
        let metric = std::mem::take(&mut self.memory.levels[level].metric);
        let triangles = std::mem::take(&mut self.memory.triangles);
        let state = self.memory.levels[level].state();
        let result = if level == 0 {
            f.call(self, state, Chords { grid: self.grid, triangles: &triangles })
        } else {
            f.call(self, state, Metrics { level: &self.grid.levels[level], metric: &metric })
        };
        self.memory.triangles = triangles;
        self.memory.levels[level].metric = metric;
        result
    }

    /// Per chart, the energy of a level's present state (only charts that are solved; others 0).
    fn energies(&mut self, level: usize) -> Vec<f64> {
        self.with_surface(level, Energies { level })
    }
}

/// A function over both kinds of surface.
trait SurfaceFn<R> {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) -> R;
}

struct Energies {
    level: usize,
}

impl SurfaceFn<Vec<f64>> for Energies {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) -> Vec<f64> {
        let level = &run.grid.levels[self.level];
        let blocks = &run.work[self.level].active;
        let mut sums = vec![0.0f64; blocks.len()];
        let shared = Shared::new(&mut sums);
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            let sum = run.patches.with(|patch| {
                // SAFETY: nothing is written to the state now.
                unsafe { patch.load(level, state, surface, b) };
                wide(BlockEnergy { patch, weights: &run.weights, surface: PhantomData::<S> })
            });
            // SAFETY: each item has its own sum.
            unsafe { *shared.get_mut(k) = sum };
        });
        let mut energies = vec![0.0; run.charts.len()];
        for (sum, &b) in sums.iter().zip(blocks) {
            energies[level.blocks.list[b as usize].chart as usize] += sum;
        }
        energies
    }
}

struct Relax {
    level: usize,
    sweeps: u32,
}

impl SurfaceFn<()> for Relax {
    fn call<S: Surface>(self, run: &mut Run, state: State, surface: S) {
        let level = &run.grid.levels[self.level];
        for _ in 0..self.sweeps {
            run.each_colour(self.level, false, |b| {
                // Blocks of one colour do not touch.
                run.patches.with(|patch| {
                    wide(relax::Sweep { patch, level, state, surface, weights: &run.weights, b });
                });
            });
        }
    }
}

impl Stages for Run<'_> {
    fn levels(&self) -> usize {
        self.grid.levels.len()
    }

    fn surface(&mut self) {
        let triangle = self.grid.pose_triangles(self.mesh, self.pose);
        let (triangles, metrics) =
            (Shared::new(&mut self.memory.triangles), Shared::new(&mut self.memory.metrics));
        const CHUNK: usize = 256;
        let count = self.grid.triangles.len();
        self.team.run(count.div_ceil(CHUNK), |k| {
            for t in k * CHUNK..((k + 1) * CHUNK).min(count) {
                if self.charts[self.grid.chart_of[t] as usize] {
                    let pose = triangle(t);
                    // SAFETY: each item has its own triangles.
                    unsafe {
                        *metrics.get_mut(t) = pose.metric();
                        *triangles.get_mut(t) = pose;
                    }
                }
            }
        });
    }

    fn pyramid(&mut self) {
        for k in 1..self.grid.levels.len() {
            let (finer, coarser) = self.memory.levels.split_at_mut(k);
            let (finer, buffers) = (&finer[k - 1], &mut coarser[0]);
            let metric = Shared::new(&mut buffers.metric);
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

    fn identity(&mut self, level: usize) {
        for &b in &self.work[level].stored {
            self.memory.levels[level].u[b as usize] = [[0.0; NODES]; 2];
        }
        let stored = std::mem::take(&mut self.work[level].stored);
        self.refresh(level, &stored);
        self.work[level].stored = stored;
        if level == 0 {
            self.energy_before();
        }
    }

    fn previous(&mut self) {
        self.identity(0);
        for &b in &self.work[0].active {
            self.memory.levels[0].u[b as usize] = self.result[b as usize];
        }
        let active = std::mem::take(&mut self.work[0].active);
        self.refresh(0, &active);
        self.work[0].active = active;
    }

    fn prolong(&mut self, level: usize) {
        // Fixed nodes, and the identity's energy, first.
        self.identity(level);
        let (finer, coarser) = self.memory.levels.split_at_mut(level + 1);
        let coarse = &coarser[0].u;
        let u = Shared::new(&mut finer[level].u);
        let (fine_level, coarse_level) = (&self.grid.levels[level], &self.grid.levels[level + 1]);
        let blocks = &self.work[level].active;
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block. The factor: a coarse cell is two fine ones.
            let out = unsafe { u.get_mut(b) };
            prolong::block(fine_level, coarse_level, |b, c| &coarse[b][c], b, 2.0, out);
        });
        let active = std::mem::take(&mut self.work[level].active);
        self.refresh(level, &active);
        self.work[level].active = active;
    }

    fn relax(&mut self, level: usize, sweeps: u32) {
        self.relax_level(level, sweeps);
    }

    fn correct(&mut self, level: usize, correction: &Correction) {
        self.correct_level(level, correction);
    }

    fn certify(&mut self) {
        let energies = self.energies(0);
        let certificates = self.certificates();
        for c in 0..self.charts.len() {
            if !self.charts[c] {
                continue;
            }
            let certificate = &certificates[c];
            let outcome = &mut self.outcome[c];
            outcome.energy = energies[c];
            outcome.min_jacobian = certificate.min_jacobian;
            outcome.folds = certificate.folds;
            outcome.max_displacement = certificate.max_displacement;
            // A comparison with NaN is false: then too, the identity.
            let better = outcome.energy <= outcome.energy_before && certificate.folds == 0;
            if !better {
                *outcome = ChartResult {
                    energy: outcome.energy_before,
                    min_jacobian: 1.0,
                    folds: 0,
                    max_displacement: 0.0,
                    fallback: true,
                    ..*outcome
                };
            }
            for b in self.grid.levels[0].blocks.of_chart[c].clone() {
                self.result[b] = if better { self.memory.levels[0].u[b] } else { [[0.0; NODES]; 2] };
            }
        }
    }
}

impl Run<'_> {
    /// Per chart, what its corners say.
    fn certificates(&self) -> Vec<Certificate> {
        let blocks = &self.work[0].active;
        let level = &self.grid.levels[0];
        let u = &self.memory.levels[0].u;
        let mut parts = vec![Certificate::default(); blocks.len()];
        let shared = Shared::new(&mut parts);
        self.team.run(blocks.len(), |k| {
            // SAFETY: each item has its own certificate.
            unsafe { *shared.get_mut(k) = certify::block(level, u, blocks[k] as usize) };
        });
        let mut certificates = vec![Certificate::default(); self.charts.len()];
        for (part, &b) in parts.iter().zip(blocks) {
            certificates[level.blocks.list[b as usize].chart as usize].add(part);
        }
        certificates
    }

    fn relax_level(&mut self, level: usize, sweeps: u32) {
        let grid = &self.grid.levels[level];
        let movable = |b: &u32| grid.movable[*b as usize].iter().map(|&m| u64::from(m)).sum::<u64>();
        let nodes: u64 = self.work[level].active.iter().map(movable).sum();
        self.node_updates.fetch_add(nodes * u64::from(sweeps), Ordering::Relaxed);
        self.with_surface(level, Relax { level, sweeps });
    }

    fn energy_before(&mut self) {
        let energies = self.energies(0);
        for (outcome, energy) in self.outcome.iter_mut().zip(energies) {
            outcome.energy_before = energy;
        }
    }
}

/// Samples all nodes of a finest block anew.
///
/// # Safety
/// No other item touches this block now.
unsafe fn refresh_chords(surface: Chords, state: State, b: usize) {
    let level = &surface.grid.levels[0];
    let block = &level.blocks.list[b];
    // SAFETY: the caller's promise.
    let (u, value, triangle) = unsafe { (state.u.get(b), state.value.get_mut(b), state.triangle.get_mut(b)) };
    for s in 0..NODES {
        let (i, j) = node_at(s);
        let (i, j) =
            (i64::from(block.x) * SIDE as i64 + i as i64, i64::from(block.y) * SIDE as i64 + j as i64);
        let d = [u[0][s], u[1][s]];
        let rest = surface.grid.triangle[b][s];
        let sample = if level.movable[b][s] == 0 {
            (rest != NONE).then(|| surface.on(rest, i, j, [0.0; 2]))
        } else {
            // The node nearest to W(p) is a better start than p.
            let (x, y) = (i + d[0].round() as i64, j + d[1].round() as i64);
            let near = match level.blocks.holding(b, x, y) {
                NONE => NONE,
                near => surface.grid.triangle[near as usize][slot(x as usize % SIDE, y as usize % SIDE)],
            };
            let usable = near != NONE && surface.grid.chart_of[near as usize] == block.chart;
            let start = if usable { near } else { rest };
            Some(surface.sample(b, i, j, d, start).unwrap_or_else(|| surface.on(start, i, j, d)))
        };
        let sample = sample.unwrap_or_default();
        for (plane, x) in value.iter_mut().zip(sample.value) {
            plane[s] = x;
        }
        triangle[s] = if rest == NONE { NONE } else { sample.triangle };
    }
}

/// Samples all nodes of a coarser block anew.
///
/// # Safety
/// No other item touches this block now.
unsafe fn refresh_metrics(surface: Metrics, state: State, b: usize) {
    let block = &surface.level.blocks.list[b];
    // SAFETY: the caller's promise.
    let (u, value) = unsafe { (state.u.get(b), state.value.get_mut(b)) };
    for s in 0..NODES {
        let d = [u[0][s], u[1][s]];
        let mut metric = surface.metric[b].each_ref().map(|plane| plane[s]);
        if surface.level.movable[b][s] != 0 {
            let (i, j) = node_at(s);
            let (i, j) =
                (i64::from(block.x) * SIDE as i64 + i as i64, i64::from(block.y) * SIDE as i64 + j as i64);
            if let Some(sample) = surface.sample(b, i, j, d, NONE) {
                metric = sample.value;
            }
        }
        for (plane, x) in value.iter_mut().zip(metric) {
            plane[s] = x;
        }
    }
}
