//! One tile of an asset: its maps, its grid (built when needed), its solver's memory, and its last good result.

use std::sync::atomic::AtomicU32;
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use crate::device::Device;
use vrtm_core::allocation::{Collect, copied, filled, zeroed};
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::gutter::{Gutter, LimitedTexels};
use vrtm_core::grid::maps::{Mask, Rigidity, TileMaps};
use vrtm_core::grid::planes::SIDE;
use vrtm_core::grid::pose::Pose;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::{ChartResult, Input, Plan, Purpose, Summary};
use vrtm_core::method::progress::Progress;
use vrtm_core::report::{GpuWork, TileReport, report};
use vrtm_core::settings::Solver;
use vrtm_core::team::Team;
use vrtm_core::unwind::caught;
use vrtm_core::view::Strided;

use super::torn::Torn;
use crate::solver::TileSolver;
use crate::solver::solved::{ChartInput, Solved};
use crate::solver::tile_solve::{TileSolution, TileSolve, Warp};
use vrtm_beyond::Copies;

/// A call that solves tiles of an asset.
pub(crate) struct SolveCall<'a> {
    pub team: &'a Team,
    pub device: &'a Device,
    pub mesh: &'a Mesh,
    /// The maps of all tiles, if charts of any go on beyond seams.
    pub maps: &'a [TileMaps],
    pub positions: Strided<'a>,
    pub plan: &'a Plan,
    /// When it began.
    pub start: Instant,
    /// Whether tiles free their solver's memory once they are solved.
    pub release_solvers: bool,
}

impl SolveCall<'_> {
    /// Adds a fraction of the call's work to the completed part.
    pub fn advance(&self, fraction: f32) {
        if let Some(control) = self.team.control() {
            control.advance(fraction);
        }
    }
}

/// A tile's share of a call that solves several tiles.
pub(crate) struct SolveShare {
    /// The tile's time limit, from the call's start.
    pub budget: Option<Duration>,
    /// The tile's share of the call's progress.
    pub progress: f32,
    /// True if the measured times of stages are typical of the device.
    pub learns: bool,
}

impl SolveShare {
    /// The share of a tile that uses all threads of the call.
    pub fn of_all_threads() -> SolveShare {
        SolveShare { budget: None, progress: 1.0, learns: true }
    }
}

/// The tile with the connectivity of a pose, and its grid.
pub(crate) struct Prepared {
    /// As it is solved: with collars, if charts go on beyond seams.
    pub mesh: Arc<TileMesh>,
    /// Without collars.
    pub own: Arc<TileMesh>,
    pub grid: Arc<Grid>,
}

/// One tile of an asset.
#[derive(Debug, Default)]
pub(crate) struct TileState {
    pub maps: TileMaps,
    /// Whether the maps count as memory of the tile; of layers, those of the first.
    counts_maps: bool,
    pub(super) grid: Option<Arc<Grid>>,
    /// The tile with collars, once it is needed.
    pub(super) extended: OnceLock<Arc<TileMesh>>,
    /// The tile as torn by the last pose that tore it.
    pub(super) torn: Option<Torn>,
    /// The welds that the last pose tore.
    pub(super) torn_now: Vec<u32>,
    /// What the blend at seams needs for the grid.
    pub(super) copies: Option<Copies>,
    /// A tile with collars, and the room for redirections beside its charts.
    pub(super) gutter: Option<(Arc<TileMesh>, Arc<Gutter>)>,
    solver: Option<TileSolver>,
    /// Bytes of the solver's memory.
    solver_bytes: u64,
    /// True if the solver's memory has never been used.
    solver_is_fresh: bool,
    /// The last good result; at seams as it was before the blend.
    pub solved: Option<Arc<Solved>>,
    /// The inputs of each chart's result; `None` if the result also depends on time or on earlier frames.
    pub(super) inputs: Vec<Option<ChartInput>>,
    /// The plan of the result, unless maps or settings have changed since.
    pub(super) solved_with: Option<Plan>,
    /// True if solves skip the tile.
    pub frozen: bool,
    /// Bytes booked on the device's account for this tile.
    booked: u64,
    /// Milliseconds of the last grid build that was not yet reported.
    pub(super) build_ms: f32,
}

impl TileState {
    pub fn new(tile: &TileMesh) -> TileState {
        TileState { counts_maps: tile.layer == 0, ..TileState::default() }
    }

    /// Books the memory that is held, and `more` that is about to be allocated, on the device's account.
    pub(super) fn book(&mut self, device: &Device, more: u64, tile: &TileMesh) -> Result<()> {
        let held = self.held() + more;
        device.rebook(self.booked, held, &tile.name())?;
        self.booked = held;
        Ok(())
    }

    /// Bytes of maps, grid, solver and result.
    pub(super) fn held(&self) -> u64 {
        let grid = self.grid.as_ref().map_or(0, |grid| grid.bytes() + Solved::bytes_for(grid));
        let torn = self.torn.as_ref().map_or(0, Torn::bytes);
        // The blend is a result of its own.
        let blended = self.copies.as_ref().map_or(0, |copies| copies.bytes() as u64)
            + self.grid.as_ref().filter(|_| self.copies.is_some()).map_or(0, |grid| Solved::bytes_for(grid));
        let gutter = self.gutter.as_ref().map_or(0, |_| Gutter::BYTES);
        self.map_bytes() + grid + torn + blended + gutter + self.solver_bytes
    }

    /// Bytes of the maps.
    pub(super) fn map_bytes(&self) -> u64 {
        if !self.counts_maps {
            return 0;
        }
        let rigidity = match &self.maps.rigidity {
            Rigidity::None => 0,
            Rigidity::Map(map) => map.bytes(),
            Rigidity::Vertices(values) => values.len() as u64 * 4,
        };
        let mask = match &self.maps.mask {
            Mask::None => 0,
            Mask::Map(map) => map.bytes(),
            Mask::Vertices(values) => values.len() as u64 * 4,
        };
        rigidity + mask
    }

    /// Solves the tile for a pose. The last result is unchanged: the caller passes the new one to `take` when all tiles
    /// are solved.
    pub fn solve(&mut self, call: &SolveCall, share: &SolveShare, prepared: &Prepared) -> Result<Solved> {
        let start = Instant::now();
        let Prepared { mesh, own, grid } = prepared;
        let pose = Pose::new(mesh, |v| call.positions.get3(v as usize), Some(&grid.rest));
        let tasks = self.tasks(grid, mesh, &pose, call.plan);
        let WarpResult { warp, results, mut report, work } =
            self.warp(call, share, prepared, &pose, &tasks)?;
        let gutter = self.gutter_of(call, mesh)?;
        self.fill_report(&mut report, grid, mesh, &tasks, &results);
        let inputs = self.inputs_of(grid, pose, &tasks, call.plan, report.truncated);
        report.welds_torn = self.torn_now.len() as u32;
        report.times.total = start.elapsed().as_secs_f32() * 1000.0 + report.times.maps;
        Ok(Solved {
            mesh: own.clone(),
            extended: (!mesh.sources.is_empty()).then(|| mesh.clone()),
            grid: grid.clone(),
            warp,
            inputs,
            results,
            overlap: self.maps.settings.overlap,
            report,
            invert_ms: AtomicU32::new(0),
            gutter,
            limited: LimitedTexels::default(),
            work,
        })
    }

    /// The room for redirections beside the charts of a tile, if it has collars.
    fn gutter_of(&mut self, call: &SolveCall, tile: &Arc<TileMesh>) -> Result<Option<Arc<Gutter>>> {
        if tile.sources.is_empty() {
            return Ok(None);
        }
        if !self.gutter.as_ref().is_some_and(|(of, _)| Arc::ptr_eq(of, tile)) {
            self.gutter = None;
            self.book(call.device, Gutter::BYTES, tile)?;
            let others = call.mesh.other_layers(tile);
            self.gutter = Some((tile.clone(), Arc::new(Gutter::new(call.team, tile, others))));
        }
        Ok(self.gutter.as_ref().map(|(_, gutter)| gutter.clone()))
    }

    /// Stores a new result.
    pub fn take(&mut self, solved: Arc<Solved>, inputs: Vec<Option<ChartInput>>, plan: &Plan) {
        self.inputs = inputs;
        self.solved_with = Some(*plan);
        self.solved = Some(solved);
    }

    /// True if the last result was solved with this plan and the present maps and settings.
    pub fn is_solved_with(&self, plan: &Plan) -> bool {
        self.solved.is_some() && self.solved_with == Some(*plan)
    }

    /// Nodes of the present grid that a solve may have to move; 0 without a grid.
    pub fn movable_nodes(&self) -> u64 {
        self.grid.as_ref().map_or(0, |grid| grid.movable.iter().sum())
    }

    /// The last result, if it was solved on a grid with the same blocks.
    fn last(&self, grid: &Arc<Grid>) -> Option<&Solved> {
        self.solved.as_deref().filter(|solved| solved.grid.has_blocks_of(grid))
    }

    /// The task for each chart.
    fn tasks(&self, grid: &Arc<Grid>, tile: &TileMesh, pose: &Pose, plan: &Plan) -> Vec<ChartTask> {
        let last = self.last(grid);
        let same = |c: usize| {
            let input = last.and_then(|_| self.inputs[c].as_ref());
            input.is_some_and(|input| input.plan == *plan && input.pose == pose.charts[c])
        };
        let task = |c: usize| match () {
            () if grid.is_still(tile, pose, c) => ChartTask::Identity,
            () if same(c) => ChartTask::Reuse,
            () => ChartTask::Solve,
        };
        (0..tile.charts.len()).map(task).collected()
    }

    /// The warp, solved if necessary, with its report.
    fn warp(
        &mut self,
        call: &SolveCall,
        share: &SolveShare,
        prepared: &Prepared,
        pose: &Pose,
        tasks: &[ChartTask],
    ) -> Result<WarpResult> {
        let grid = &prepared.grid;
        let last = self.last(grid);
        let mut results =
            last.map_or_else(|| filled(ChartResult::default(), tasks.len()), |l| copied(&l.results));
        let solves = tasks.contains(&ChartTask::Solve);
        // A chart that has become the identity changes its part of the last result.
        let mut unchanged = !solves && last.is_some();
        for (result, _) in results.iter_mut().zip(tasks).filter(|(_, task)| **task == ChartTask::Identity) {
            unchanged &= result.max_displacement == 0.0;
            *result = ChartResult { min_jacobian: 1.0, ..ChartResult::default() };
        }
        let last = last.map(|last| last.warp.clone());
        let report = TileReport::default();
        if let (true, Some(last)) = (unchanged, &last) {
            return Ok(WarpResult { warp: last.clone(), results, report, work: None });
        }
        if !solves && !tasks.contains(&ChartTask::Reuse) {
            let identity = zeroed(grid.levels[0].blocks.list.len());
            let warp = Arc::new(Warp::Host(identity));
            return Ok(WarpResult { warp, results, report, work: None });
        }
        let solution = self.run_solver(call, share, prepared, pose, last.as_deref(), tasks)?;
        for c in (0..tasks.len()).filter(|&c| tasks[c] == ChartTask::Solve) {
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
            levels: grid.levels.len() as u32,
        });
        Ok(WarpResult { warp: Arc::new(solution.warp), results, report, work: solution.work })
    }

    /// Runs the tile's solver; makes it if necessary.
    fn run_solver(
        &mut self,
        call: &SolveCall,
        share: &SolveShare,
        prepared: &Prepared,
        pose: &Pose,
        last: Option<&Warp>,
        tasks: &[ChartTask],
    ) -> Result<TileSolution> {
        let Prepared { mesh: tile, grid, .. } = prepared;
        let charts: Vec<bool> = tasks.iter().map(|&task| task == ChartTask::Solve).collected();
        let keep: Vec<bool> = tasks.iter().map(|&task| task != ChartTask::Identity).collected();
        self.allocate(call.device, grid, tile, call.plan.solver())?;
        // Taken out during the run: if a stage panics, the memory is dropped.
        let missing = || Error::new(ErrorKind::Internal, "the tile has no solver");
        let mut solver = self.solver.take().ok_or_else(missing)?;
        let settings = &self.maps.settings;
        let continuation = call.plan.continuation;
        let pull = if last.is_some() { call.plan.temporal_weight } else { 0.0 };
        let protect = call.plan.protect(settings);
        let input = Input { grid, mesh: tile, pose, settings, protect, charts: &charts, continuation, pull };
        let (team, plan) = (call.team, call.plan);
        let fresh = std::mem::replace(&mut self.solver_is_fresh, false);
        let deadline =
            Deadline::new(call.start, [share.budget, plan.budget], *call.device.pace(), fresh).into();
        let progress = Progress::new(team.control(), share.progress).into();
        let solve = TileSolve { team, input, grid, plan, deadline, progress, last, keep: &keep };
        // A cancelled solve leaves its memory usable: each solve writes what it reads.
        let solution = caught(|| solver.run(&solve));
        if share.learns {
            *call.device.pace() = solve.deadline.into_inner().learnt();
        }
        match &solution {
            Err(error) if error.kind != ErrorKind::Cancelled => {
                drop(solver);
                return Err(self.give_up(call.device, tile, error.clone()));
            }
            _ => self.solver = Some(solver),
        }
        if call.release_solvers {
            self.forget(call.device);
            // Booking less always succeeds.
            let _ = self.book(call.device, 0, tile);
        }
        solution
    }

    /// Fills in what follows from the charts' results.
    fn fill_report(
        &mut self,
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
        report.times.maps = std::mem::take(&mut self.build_ms);
        report.bytes = self.held();
    }

    /// The inputs of each chart's result.
    fn inputs_of(
        &self,
        grid: &Arc<Grid>,
        pose: Pose,
        tasks: &[ChartTask],
        plan: &Plan,
        truncated: bool,
    ) -> Vec<Option<ChartInput>> {
        let last = self.last(grid);
        let reused = |c: usize| {
            last.filter(|_| tasks[c] == ChartTask::Reuse)?;
            self.inputs[c].clone()
        };
        // A warm or truncated result depends on more than its inputs.
        let depends_on_more = plan.warm || truncated;
        let input = |pose| (!depends_on_more).then_some(ChartInput { pose, plan: *plan });
        pose.charts.into_iter().enumerate().map(|(c, pose)| reused(c).or_else(|| input(pose))).collected()
    }

    /// Frees the solver's remaining memory after a failure, and removes it from the device's account.
    fn give_up(&mut self, device: &Device, tile: &TileMesh, error: Error) -> Error {
        self.solver = None;
        self.solver_bytes = 0;
        if let Some(gpu) = device.gpu() {
            gpu.reclaim();
        }
        // Booking less always succeeds.
        let _ = self.book(device, 0, tile);
        error
    }

    /// Corrects the account after a call ran out of memory: the solver may be gone, and too much may be booked.
    pub(super) fn settle(&mut self, device: &Device) {
        if self.solver.is_none() {
            self.forget(device);
        }
        let held = self.held().min(self.booked);
        let _ = device.rebook(self.booked, held, "");
        self.booked = held;
    }

    /// Drops the solver.
    pub(super) fn forget(&mut self, device: &Device) {
        self.solver_bytes = 0;
        if self.solver.take().is_some()
            && let Some(gpu) = device.gpu()
        {
            gpu.reclaim();
        }
    }

    /// Makes the solver for a grid unless it exists. Its memory is booked before it is allocated.
    fn allocate(&mut self, device: &Device, grid: &Arc<Grid>, tile: &TileMesh, solver: Solver) -> Result<()> {
        let purpose = Purpose::new(solver, &self.maps.settings);
        let fits = self.solver.as_ref().is_some_and(|solver| solver.is_for(grid, purpose));
        if !fits {
            // The old memory is freed before the new memory is allocated.
            self.forget(device);
            let bytes = TileSolver::bytes_for(device, grid, tile, purpose)?;
            self.book(device, bytes, tile)?;
            match caught(|| TileSolver::new(device, grid, tile, purpose)) {
                Ok(solver) => self.solver = Some(solver),
                Err(error) => return Err(self.give_up(device, tile, error)),
            }
            (self.solver_bytes, self.solver_is_fresh) = (bytes, true);
        }
        Ok(())
    }

    /// Removes the memory from the device's account.
    pub fn release(&mut self, device: &Device) {
        self.solved = None;
        self.torn = None;
        self.forget(device);
        let _ = device.rebook(self.booked, 0, "");
        self.booked = 0;
    }
}

/// A tile's new warp.
struct WarpResult {
    warp: Arc<Warp>,
    /// The results of all charts.
    results: Vec<ChartResult>,
    /// Filled in as far as it follows from the solve itself.
    report: TileReport,
    /// The GPU's dispatches, submissions and transfers.
    work: Option<GpuWork>,
}

/// The task for a chart.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChartTask {
    /// The chart must be solved.
    Solve,
    /// None of its inputs changed: it keeps its last result.
    Reuse,
    /// The identity is its best warp.
    Identity,
}
