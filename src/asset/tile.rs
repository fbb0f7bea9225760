//! One tile of an asset: what is made for it, and its solve.

use std::sync::Arc;
use std::time::Duration;

use crate::device::{Booked, Device};
use vrtm_beyond::Copies;
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::clock::Instant;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::SIDE;
use vrtm_core::grid::pose::{ChartPose, Pose};
use vrtm_core::log::LogCode;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::plan::{ChartResult, Input, Plan, Purpose, Summary};
use vrtm_core::panics::lock;
use vrtm_core::report::{GpuWork, TileReport, report};
use vrtm_core::settings::TileSettings;
use vrtm_core::unwind::caught;

use super::blended::{BlendKey, Blended, CopiesKey};
use super::derived::Derived;
use super::given::{Call, Change, Given, GridKey};
use super::shape::{Prepared, Shape, ShapeKey, torn_welds};
use super::solver::{BookedSolver, Shared, SolveCall, is_usable_after};
use crate::solved::Solved;
use vrtm_core::backend::{TileSolution, Warp};

/// A tile's derived things, made from the mesh, from maps and settings of the host, and from poses. Each stores its
/// key.
#[derive(Debug)]
pub(crate) struct TileState {
    pub(super) tile: usize,
    /// The bytes of its maps, and that they have a place on the device's account.
    pub(super) maps: Booked,
    /// The whole tile, and the tile as torn by the last pose that tore it.
    pub(super) whole: Derived<ShapeKey, Shape>,
    pub(super) torn: Derived<ShapeKey, Shape>,
    /// Copies of nodes, for the blend at seams.
    pub(super) copies: Derived<Arc<CopiesKey>, Copies>,
    /// The last blend at seams, which is part of what is published.
    pub(super) blended: Derived<Arc<BlendKey>, Blended>,
    pub(super) solver: Option<BookedSolver>,
    /// The solver that it shares with other tiles.
    pub(super) together: Option<Shared>,
    pub(super) last: Option<TileSolved>,
    /// True if a time budget left no time for the last pose.
    pub(super) late: bool,
    /// The welds that the last pose tore.
    welds_torn: Vec<u32>,
}

/// A tile's last good result, and what it follows from.
#[derive(Debug)]
pub(crate) struct TileSolved {
    /// At seams as it was before the blend.
    pub solved: Arc<Solved>,
    plan: Plan,
    /// The factor of the pose's positions.
    factor: f64,
    settings: TileSettings,
    grid: GridKey,
    /// Per chart; `None` if its result also depends on time or on earlier frames.
    inputs: Vec<Option<ChartInput>>,
}

/// The input of a chart's result, compared with that of another with the same blocks, plan and settings.
#[derive(Debug, PartialEq)]
struct ChartInput {
    pose: ChartPose,
    /// The generation of the maps from which on its rigidity is this.
    since: u64,
}

impl TileSolved {
    pub fn tile(&self) -> usize {
        self.grid.tile
    }

    /// True if it was solved with this plan, positions with this factor, and the present maps and settings.
    pub fn is_of(&self, plan: &Plan, factor: f64, given: &Given) -> bool {
        let has_maps = matches!(given.change_since(&self.grid), Change::Nothing);
        has_maps
            && self.plan == *plan
            && self.factor == factor
            && self.settings == given.maps[self.tile()].settings
    }
}

impl TileState {
    pub fn new(tile: usize, device: &Device) -> TileState {
        TileState {
            tile,
            maps: device.booking(),
            whole: Derived::default(),
            torn: Derived::default(),
            copies: Derived::default(),
            blended: Derived::default(),
            solver: None,
            together: None,
            last: None,
            late: false,
            welds_torn: Vec::new(),
        }
    }

    /// Bytes of maps, grids, solver and result.
    fn bytes(&self) -> u64 {
        let of_shape =
            |of: &Derived<ShapeKey, Shape>| of.bytes() + of.last().map_or(0, |(_, shape)| shape.bytes());
        let shapes: u64 = [&self.whole, &self.torn].into_iter().map(of_shape).sum();
        let together =
            |shared: &Shared| lock(shared).as_ref().map_or(0, |together| together.bytes_of(self.tile));
        let shared = self.together.as_ref().map_or(0, together);
        self.maps.bytes() + shapes + self.copies.bytes() + self.solver_bytes() + shared
    }

    pub fn solver_bytes(&self) -> u64 {
        self.solver.as_ref().map_or(0, |solver| solver.booked.bytes())
    }

    /// Frees its solver, and the one that it shares.
    pub fn free_solvers(&mut self) {
        self.solver = None;
        if let Some(shared) = self.together.take() {
            *lock(&shared) = None;
        }
    }

    /// True if the last pose tears welds.
    pub fn is_torn(&self) -> bool {
        !self.welds_torn.is_empty()
    }

    /// The tile with the connectivity of a pose, and its grid; builds the grid if necessary.
    pub fn prepare(&mut self, call: &SolveCall) -> Result<Prepared> {
        let whole = &call.on.mesh.tiles[self.tile];
        let torn = torn_welds(call.on.mesh, whole, &call.positions);
        if torn != self.welds_torn {
            let (count, of) = (torn.len(), whole.welds.len());
            let message = format!("the pose tears {count} of {of} welded edges");
            let code = if count > 0 { LogCode::WeldsTorn } else { LogCode::WeldsWhole };
            call.on.device.log(code, Some(whole), &[count as f64, of as f64], &message);
        }
        let prepared = self.prepared(&call.on, &torn);
        self.welds_torn = torn;
        prepared
    }

    /// The pose of the prepared tile, and what has to be done for it.
    pub fn begin(&self, call: &SolveCall, prepared: &Prepared) -> Begun {
        let start = Instant::now();
        let Prepared { mesh, grid, .. } = prepared;
        let settings = call.on.given.maps[self.tile].settings;
        let pose = Pose::new(mesh, |v| call.positions.get3(v as usize), Some(&grid.rest));
        let tasks = self.tasks(prepared, &pose, call.plan, &settings);
        let (results, warp) = self.without_solver(grid, &tasks);
        Begun { pose, tasks, results, warp, spent: start.elapsed() }
    }

    /// Solves the prepared tile with its own solver; see `end`. The last result is unchanged: the caller replaces it
    /// when all tiles are solved.
    pub fn solve(
        &mut self,
        call: &SolveCall,
        prepared: &Prepared,
        begun: &mut Begun,
    ) -> Result<Option<TileSolved>> {
        let start = Instant::now();
        let solution = match begun.warp {
            Some(_) => None,
            None => Some(self.run_solver(call, prepared, begun)?),
        };
        begun.spent += start.elapsed();
        self.end(call, prepared, begun, solution)
    }

    /// The result of the prepared tile; `None` if it keeps its last result for want of time.
    pub fn end(
        &mut self,
        call: &SolveCall,
        prepared: &Prepared,
        begun: &mut Begun,
        mut solution: Option<TileSolution>,
    ) -> Result<Option<TileSolved>> {
        let Prepared { mesh, grid, .. } = prepared;
        let own = if self.is_torn() { mesh } else { &call.on.mesh.tiles[self.tile] };
        let settings = call.on.given.maps[self.tile].settings;
        if call.release_solvers {
            // That of an earlier call, too, if no chart had to be solved.
            self.free_solvers();
        }
        if let Some(solution) = &mut solution
            && solution.summary.truncated
            && self.keeps_last(grid, begun, solution)
        {
            return Ok(None);
        }
        let multipliers = match &mut solution {
            Some(solution) => std::mem::take(&mut solution.multipliers),
            None => Vec::from(self.multipliers(grid)),
        };
        let (gutter, build_ms) = self.gutter_and_ms(&call.on, self.is_torn())?;
        let (warp, results, mut report, work) = begun.result(call.plan, grid, solution)?;
        self.fill_report(&mut report, grid, mesh, &begun.tasks, &results);
        report.times.maps = build_ms;
        report.times.total = begun.spent.as_secs_f32() * 1000.0 + build_ms;
        // A warm or truncated result depends on more than its inputs.
        let depends_on_more = call.plan.warm || report.truncated;
        let charts = begun.pose.charts.drain(..).zip(&prepared.since).zip(&begun.tasks);
        let input = |((pose, &since), task): ((ChartPose, &u64), &ChartTask)| {
            (*task == ChartTask::Reuse || !depends_on_more).then_some(ChartInput { pose, since })
        };
        let inputs = charts.map(input).collect();
        let solved = Solved {
            mesh: own.clone(),
            extended: (!mesh.sources.is_empty()).then(|| mesh.clone()),
            grid: grid.clone(),
            warp,
            results,
            multipliers,
            overlap: settings.overlap,
            report,
            invert_ms: Arc::default(),
            gutter,
            limited: Arc::default(),
            work,
        };
        let (solved, plan, grid) = (Arc::new(solved), *call.plan, prepared.key.clone());
        Ok(Some(TileSolved { solved, plan, factor: call.positions.factor(), settings, grid, inputs }))
    }

    /// Gives charts their last results where the time of a solve sufficed for nothing better than the identity. True if
    /// no chart moves otherwise, so that the whole last result can be kept.
    fn keeps_last(&self, grid: &Grid, begun: &Begun, solution: &mut TileSolution) -> bool {
        let moves = |result: &ChartResult| result.max_displacement > 0.0;
        let solved = begun.solved();
        let moves_now = |c: usize| solved[c] && moves(&solution.charts[c]);
        if !(0..solved.len()).any(moves_now) {
            return self.last.as_ref().is_some_and(|last| last.solved.results.iter().any(moves));
        }
        let Some(TileSolved { solved: last, .. }) = self.last_on(grid) else { return false };
        // A GPU's results stay in its memory.
        if let (Warp::Host(u), Warp::Host(before)) = (&mut solution.warp, &*last.warp) {
            for (c, result) in solution.charts.iter_mut().enumerate().filter(|(c, _)| solved[*c]) {
                if !moves(result) && moves(&last.results[c]) {
                    let blocks = grid.levels[0].blocks.of_chart[c].clone();
                    u[blocks.clone()].copy_from_slice(&before[blocks]);
                    *result = last.results[c];
                }
            }
        }
        false
    }

    /// The last result, if it was solved on a grid with the same blocks.
    fn last_on(&self, grid: &Grid) -> Option<&TileSolved> {
        self.last.as_ref().filter(|last| last.solved.grid.has_blocks_of(grid))
    }

    /// The last warp on a grid with the same blocks.
    pub fn last_warp(&self, grid: &Grid) -> Option<&Warp> {
        self.last_on(grid).map(|last| &*last.solved.warp)
    }

    /// The multipliers of the last result's features; empty if the grid has others.
    pub fn multipliers(&self, grid: &Grid) -> &[f32] {
        let last = self.last_on(grid).filter(|last| Arc::ptr_eq(&last.solved.grid.features, &grid.features));
        last.map_or(&[], |last| &last.solved.multipliers)
    }

    fn tasks(
        &self,
        prepared: &Prepared,
        pose: &Pose,
        plan: &Plan,
        settings: &TileSettings,
    ) -> Vec<ChartTask> {
        let Prepared { mesh, grid, since, .. } = prepared;
        let last = self.last_on(grid).filter(|last| last.plan == *plan && last.settings == *settings);
        let same = |c: usize| {
            let input = last.and_then(|last| last.inputs[c].as_ref());
            input.is_some_and(|input| input.since == since[c] && input.pose == pose.charts[c])
        };
        let task = |c: usize| {
            if grid.is_still(mesh, pose, c) {
                ChartTask::Identity
            } else if same(c) {
                ChartTask::Reuse
            } else {
                ChartTask::Solve
            }
        };
        (0..mesh.charts.len()).map(task).collect()
    }

    /// The results of the charts as they are before the solver runs, and the warp, if it is known without a solver.
    fn without_solver(&self, grid: &Grid, tasks: &[ChartTask]) -> (Vec<ChartResult>, Option<Arc<Warp>>) {
        let last = self.last_on(grid).map(|last| &last.solved);
        let mut results =
            last.map_or_else(|| vec![ChartResult::default(); tasks.len()], |l| l.results.clone());
        let solves = tasks.contains(&ChartTask::Solve);
        // A chart that has become the identity changes its part of the last result.
        let mut unchanged = !solves && last.is_some();
        for (result, _) in results.iter_mut().zip(tasks).filter(|(_, task)| **task == ChartTask::Identity) {
            unchanged &= result.max_displacement == 0.0;
            *result = ChartResult { min_jacobian: 1.0, ..ChartResult::default() };
        }
        let last = last.filter(|_| unchanged).map(|last| last.warp.clone());
        let is_identity = !solves && !tasks.contains(&ChartTask::Reuse);
        let identity = || Arc::new(Warp::Host(zeroed(grid.levels[0].blocks.list.len())));
        (results, last.or_else(|| is_identity.then(identity)))
    }

    /// Runs the tile's solver; makes it if necessary.
    fn run_solver(&mut self, call: &SolveCall, prepared: &Prepared, begun: &Begun) -> Result<TileSolution> {
        let Call { device, given, .. } = call.on;
        let (Prepared { mesh, grid, .. }, plan) = (prepared, call.plan);
        let settings = &given.maps[self.tile].settings;
        // Taken out during the run: if a stage panics, the memory is dropped.
        let mut solver = self.take_solver(device, prepared, Purpose::new(plan.solver(), settings))?;
        let last = self.last_warp(grid);
        let (continuation, harm) = (plan.continuation, plan.harm(settings));
        let pull = if last.is_some() { plan.temporal_weight } else { 0.0 };
        let (charts, pose) = (&begun.solved()[..], &begun.pose);
        let multipliers = if plan.warm { self.multipliers(grid) } else { &[] };
        let input = Input { grid, mesh, pose, settings, harm, multipliers, charts, continuation, pull };
        let solution = solver.run(call, input, call.progress, &[last], &begun.kept());
        if is_usable_after(&solution) {
            self.solver = Some(solver);
        }
        solution
    }

    /// Takes the solver for a grid out; makes it unless it exists. Its memory is booked before it is allocated.
    fn take_solver(&mut self, device: &Device, on: &Prepared, purpose: Purpose) -> Result<BookedSolver> {
        // The old memory is freed before the new memory is allocated.
        if let Some(solver) = self.solver.take().filter(|of| of.solver.is_for(&on.grid, purpose)) {
            return Ok(solver);
        }
        let mut booked = device.booking();
        booked.set(device.solver_bytes(&on.grid, &[&*on.mesh], purpose), &on.mesh.name())?;
        let solver = caught(|| device.solver(&on.grid, &[&*on.mesh], purpose))?;
        Ok(BookedSolver { solver, booked })
    }

    /// Fills in what follows from the charts' results.
    fn fill_report(
        &self,
        report: &mut TileReport,
        grid: &Grid,
        tile: &TileMesh,
        tasks: &[ChartTask],
        results: &[ChartResult],
    ) {
        let count = |wanted: ChartTask| tasks.iter().filter(|&&task| task == wanted).count() as u32;
        report.udim = tile.udim;
        report.grid = [grid.levels[0].nx as u32, grid.levels[0].ny as u32];
        report.energy_before = results.iter().map(|r| r.energy_before).sum();
        report.energy = results.iter().map(|r| r.energy).sum();
        report.min_jacobian = results.iter().map(|r| r.min_jacobian).fold(1.0, f64::min);
        report.folds = results.iter().map(|r| r.folds).sum();
        report.max_displacement = results.iter().map(|r| r.max_displacement).fold(0.0, f32::max);
        report.charts = tasks.len() as u32;
        report.charts_active = count(ChartTask::Solve);
        report.charts_reused = count(ChartTask::Reuse);
        report.charts_identity = count(ChartTask::Identity);
        let fell_back =
            |(task, result): &(&ChartTask, &ChartResult)| **task != ChartTask::Identity && result.fallback;
        report.charts_fallback = tasks.iter().zip(results).filter(fell_back).count() as u32;
        report.blocks = report.grid.map(|n| (n as usize + 1).div_ceil(SIDE) as u64).iter().product();
        let solved = tasks.iter().zip(&grid.movable).filter(|(task, _)| **task == ChartTask::Solve);
        report.nodes_active = solved.map(|(_, movable)| movable).sum();
        report.welds_torn = self.welds_torn.len() as u32;
        report.bytes = self.bytes();
    }
}

/// A warp, the results of all charts, the report as far as it follows from the solve itself, and the GPU's work.
type WarpResult = (Arc<Warp>, Vec<ChartResult>, TileReport, Option<GpuWork>);

/// A tile in a pose, before its solver runs.
#[derive(Debug)]
pub(crate) struct Begun {
    /// Time that the tile took so far.
    pub(super) spent: Duration,
    pub(super) pose: Pose,
    tasks: Vec<ChartTask>,
    results: Vec<ChartResult>,
    /// The warp, if it is known without a solver.
    warp: Option<Arc<Warp>>,
}

impl Begun {
    pub fn needs_solver(&self) -> bool {
        self.warp.is_none()
    }

    /// Per chart, whether it is solved.
    pub fn solved(&self) -> Vec<bool> {
        self.tasks.iter().map(|&task| task == ChartTask::Solve).collect()
    }

    /// Per chart, whether it keeps its last result unless it is solved.
    pub fn kept(&self) -> Vec<bool> {
        self.tasks.iter().map(|&task| task != ChartTask::Identity).collect()
    }

    /// The warp and the results of all charts, given the solver's solution if it ran.
    fn result(&mut self, plan: &Plan, grid: &Grid, solution: Option<TileSolution>) -> Result<WarpResult> {
        let mut results = std::mem::take(&mut self.results);
        let report = TileReport::default();
        let Some(solution) = solution else {
            let nothing = || Error::new(ErrorKind::Internal, "a tile was not solved");
            let warp = self.warp.take().ok_or_else(nothing)?;
            return Ok((warp, results, report, None));
        };
        for (c, _) in self.tasks.iter().enumerate().filter(|(_, task)| **task == ChartTask::Solve) {
            results[c] = solution.charts[c];
        }
        let Summary { times, sweeps, corrections, truncated } = solution.summary;
        let report = report!(report, {
            times: times,
            sweeps: sweeps,
            corrections: corrections,
            truncated: truncated,
            node_updates: solution.node_updates,
            blocks_active: solution.blocks_active,
            levels: plan.coarsest(grid) as u32 + 1,
        });
        Ok((Arc::new(solution.warp), results, report, solution.work))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ChartTask {
    Solve,
    /// None of its inputs changed: it keeps its last result.
    Reuse,
    /// The identity is its best warp.
    Identity,
}
