//! One solve of one tile on the CPU: the data that all of its stages share, and the stages that the schedule calls
//! (method §5).

use std::ops::AddAssign;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use vrtm_core::allocation::{Vec, vec, zeroed, zeroed_box};
use vrtm_core::backend::{TileSolution, TileSolve, TileSolver, Warp};
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::pose::Pose;
use vrtm_core::grid::window::Window;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::law::WARM_MULTIPLIER;
use vrtm_core::method::plan::{ChartResult, Input, Purpose};
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_core::team::{PerThread, SharedSlice, Team, Worker};

use super::buffers::State;
use super::correct::rows::WordWindows;
use super::memory::{Lists, Memory};
use super::patch::{Patch, Source, Weights};
use super::sampling::Surface;
use super::sampling::chords::Chords;
use super::sampling::metrics::Metrics;

impl TileSolver for Memory {
    fn is_for(&self, grid: &Arc<Grid>, purpose: Purpose) -> bool {
        self.purpose == purpose && self.blocks.upgrade().is_some_and(|own| Arc::ptr_eq(&own, &grid.triangle))
    }

    fn run(&mut self, solve: &mut TileSolve) -> Result<TileSolution> {
        let mut u = solve.initial_displacements()?;
        let mut run = Run::new(solve.team, &solve.input, self, &mut u, solve.anchor()?);
        let summary = solve.run_schedule(&mut run);
        let (charts, multipliers) = (std::mem::take(&mut run.results), std::mem::take(&mut run.multipliers));
        let node_updates = run.node_updates.load(Ordering::Relaxed);
        let blocks_active = run.work[0].active.len() as u64;
        // For the next solve.
        run.memory.lists = [run.work, run.spare];
        Ok(TileSolution {
            warp: Warp::Host(u),
            charts,
            multipliers,
            summary,
            node_updates,
            blocks_active,
            work: None,
        })
    }
}

/// One solve of one tile.
pub struct Run<'a> {
    pub(super) team: &'a Team,
    pub(super) grid: &'a Grid,
    pub(super) mesh: &'a TileMesh,
    pub(super) pose: &'a Pose,
    pub(super) memory: &'a mut Memory,
    /// Weights of the energy per level.
    pub(super) weights: Vec<Weights>,
    /// H of method §4, Harm.
    pub(super) harm: f32,
    /// Per piece of level 0, the sum of the squares of the strain that the pose alone gives its edges.
    pub(super) identity_squares: Vec<f32>,
    /// Per feature, its multiplier.
    pub(super) multipliers: Vec<f32>,
    pub(super) work: Vec<Lists>,
    /// Memory for a copy of these.
    pub(super) spare: Vec<Lists>,
    /// The charts to solve.
    pub(super) charts: &'a [bool],
    /// Displacements of the result. Where charts are solved it is 0 until certification writes this solve's result;
    /// corrections of the finest level keep their step in it meanwhile.
    pub(super) result: &'a mut [[Plane; 2]],
    /// Displacements of the previous result if the solve starts from them or is pulled towards them; otherwise empty.
    pub(super) anchor: &'a [[Plane; 2]],
    /// Result per chart; the default for charts that are not solved.
    pub results: Vec<ChartResult>,
    /// Per chart, the energy of the present state of the level that is worked on, if it is known.
    pub(super) known_energies: Vec<Option<f64>>,
    pub(super) node_updates: AtomicU64,
    pub(super) patches: PerThread<'a, Patch>,
    pub(super) words: PerThread<'a, WordWindows>,
    pub(super) slopes: PerThread<'a, [Window; 6]>,
}

impl<'a> Run<'a> {
    /// Begins a solve. `result` must be 0 where charts are solved. `anchor` is the previous result, if the solve starts
    /// from it or the input's pull is not 0.
    pub fn new(
        team: &'a Team,
        input: &Input<'a>,
        memory: &'a mut Memory,
        result: &'a mut [[Plane; 2]],
        anchor: &'a [[Plane; 2]],
    ) -> Run<'a> {
        let Input { grid, mesh, pose, charts, .. } = *input;
        let [mut work, mut spare] = std::mem::take(&mut memory.lists);
        for lists in [&mut work, &mut spare] {
            lists.extend((lists.len()..grid.levels.len()).map(|_| Lists::default()));
        }
        for (work, level) in work.iter_mut().zip(&grid.levels) {
            work.all().into_iter().for_each(Vec::clear);
            for (b, block) in level.blocks.list.iter().enumerate() {
                if charts[block.chart as usize] {
                    work.stored.push(b as u32);
                    if block.active {
                        work.active.push(b as u32);
                        work.colours[(block.y % 2 * 2 + block.x % 2) as usize].push(b as u32);
                    }
                }
            }
        }
        memory.levels.iter_mut().for_each(|level| level.is_weighed = false);
        Run {
            team,
            grid,
            mesh,
            pose,
            memory,
            weights: (0..grid.levels.len()).map(|level| Weights::new(input, level)).collect(),
            harm: input.harm,
            identity_squares: Vec::new(),
            multipliers: match input.multipliers.len() == grid.features.count {
                true => Vec::from(input.multipliers),
                false => zeroed(grid.features.count),
            },
            work,
            spare,
            charts,
            result,
            anchor,
            results: vec![ChartResult::default(); charts.len()],
            known_energies: vec![None; charts.len()],
            node_updates: AtomicU64::new(0),
            patches: PerThread::new(team, Patch::zeroed),
            words: PerThread::new(team, zeroed_box),
            slopes: PerThread::new(team, zeroed_box),
        }
    }

    /// Calls `f(worker, k, block)` for the `k`-th of the blocks, for all of them. Before that, `next` is called with
    /// the block that is probably this thread's next one, to prefetch it.
    pub(super) fn each_of(
        &self,
        blocks: &[u32],
        next: impl Fn(usize) + Sync,
        f: impl Fn(&Worker, usize, usize) + Sync,
    ) {
        self.team.run_on(blocks.len(), |worker, k| {
            if let Some(&b) = blocks.get(k + 1) {
                next(b as usize);
            }
            f(worker, k, blocks[k] as usize);
        });
    }

    /// Calls `f(worker, block, chart)` for all active blocks of a level; `next` as in `each_of`.
    pub(super) fn each_block(
        &self,
        level: usize,
        next: impl Fn(usize) + Sync,
        f: impl Fn(&Worker, usize, usize) + Sync,
    ) {
        let list = &self.grid.levels[level].blocks.list;
        self.each_of(&self.work[level].active, next, |worker, _, b| f(worker, b, list[b].chart as usize));
    }

    /// Sums `f(worker, block)` over the active blocks of a level chart by chart, in the order of the blocks; `next` as
    /// in `each_of`.
    pub(super) fn sum_blocks<T: Copy + Default + AddAssign + Send + Sync>(
        &self,
        level: usize,
        next: impl Fn(usize) + Sync,
        f: impl Fn(&Worker, usize) -> T + Sync,
    ) -> Vec<T> {
        let (blocks, list) = (&self.work[level].active, &self.grid.levels[level].blocks.list);
        let mut values = vec![T::default(); blocks.len()];
        let shared = SharedSlice::new(&mut values);
        self.each_of(blocks, next, |worker, k, b| {
            // SAFETY: each item has its own value.
            unsafe { *shared.get_mut(k) = f(worker, b) };
        });
        let mut sums = vec![T::default(); self.charts.len()];
        for (value, &b) in values.into_iter().zip(blocks) {
            sums[list[b as usize].chart as usize] += value;
        }
        sums
    }

    /// Counts sweeps over the movable nodes of a level.
    pub(super) fn count_updates(&self, level: usize, sweeps: u32) {
        let grid = &self.grid.levels[level];
        let movable = |b: &u32| grid.movable[*b as usize].iter().map(|&m| u64::from(m)).sum::<u64>();
        let nodes: u64 = self.work[level].active.iter().map(movable).sum();
        self.node_updates.fetch_add(nodes * u64::from(sweeps), Ordering::Relaxed);
    }

    /// The sources of the patch of block `b` of a level with this state and surface.
    pub(super) fn source<S>(&self, level: usize, state: State, surface: S, b: usize) -> Source<'_, S> {
        let (weights, anchor) = (&self.weights[level], self.anchor);
        Source { level: &self.grid.levels[level], state, surface, weights, anchor, b }
    }

    /// Calls `f` with a level's state and with the level's surface: chords on level 0, metrics on the others.
    pub(super) fn with_surface<R>(&mut self, level: usize, f: impl SurfaceFn<R>) -> R {
        let state = self.memory.levels[level].state();
        let Run { grid, ref memory, .. } = *self;
        if level == 0 {
            f.call(self, state, Chords { grid, triangles: &memory.triangles })
        } else {
            f.call(self, state, Metrics { level: &grid.levels[level], metric: &memory.levels[level].metric })
        }
    }
}

/// `Start` delegates to `prolong`, `Iterate` to `pbd`, and each other stage to the file of its name.
impl Stages for Run<'_> {
    fn run(&mut self, stage: &Stage) {
        if let Stage::Start { from, .. } = *stage
            && from != Start::Passing
        {
            self.known_energies.fill(None);
        }
        match *stage {
            Stage::Surface => self.pose_triangles(),
            Stage::Pyramid { coarsest } => self.pose_metrics(coarsest),
            Stage::Start { level, from } => match from {
                Start::Identity => self.start_from_identity(level),
                Start::Previous => {
                    self.start_from_previous();
                    self.weigh(level, WARM_MULTIPLIER);
                }
                Start::Coarser => {
                    self.prolong_level(level);
                    self.weigh(level, 1.0);
                }
                Start::Smoothed(smoothing) => {
                    self.prolong_level(level);
                    self.regularise_level(level, smoothing);
                }
                Start::Passing => self.interpolate_level(level),
            },
            Stage::Relax { level, sweeps } => {
                self.known_energies.fill(None);
                self.relax_level(level, sweeps, None);
            }
            Stage::Correct { level, ref correction } => self.correct_level(level, correction),
            Stage::Iterate { level, ref iteration } => self.iterate_level(level, iteration),
            Stage::Energies { level, allow_folds } => {
                self.store_identity_energy(level);
                self.complete_energies(level, allow_folds);
            }
            Stage::Certify { allow_folds } => self.certify_result(allow_folds),
        }
    }
}

/// A function that is generic in the surface.
pub(super) trait SurfaceFn<R> {
    fn call<S: Surface>(self, run: &Run, state: State, surface: S) -> R;
}
