//! One tile of an asset: its maps, its grid (built when needed), its solver's memory, and its last good result.

use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::device::Device;
use crate::error::{Error, ErrorKind, Result};
use crate::image::ImageView;
use crate::map::{Map, TexelRect};
use crate::mesh::{Mesh, TileMesh};
use crate::method::budget::{Clock, History};
use crate::method::schedule::{ChartResult, Input, Plan, Summary};
use crate::report::{GpuWork, TileEstimate, TileInfo, TileReport};
use crate::settings::{LogLevel, Solver, TileSettings};
use crate::team::Team;
use crate::tile::blocks::{NODES, SIDE};
use crate::tile::pose::Pose;
use crate::tile::repaint::repaint;
use crate::tile::saved;
use crate::tile::survey::Survey;
use crate::tile::{Grid, Rigidity, TileMaps, build};
use crate::view::Strided;

use super::backend::{Job, TileSolution, TileSolver, Warp};
use super::solved::{ChartInput, Solved};

/// A call that solves all tiles of an asset.
pub(super) struct SolveCall<'a> {
    pub team: &'a Team,
    pub device: &'a Device,
    pub mesh: &'a Mesh,
    pub positions: Strided<'a>,
    pub plan: &'a Plan,
    /// When it began.
    pub start: Instant,
    /// The time that the tile may take, from then on.
    pub budget: Option<Duration>,
}

/// One tile of an asset.
#[derive(Debug, Default)]
pub(super) struct TileState {
    pub maps: TileMaps,
    grid: Option<Arc<Grid>>,
    solver: Option<TileSolver>,
    /// Bytes of the solver's memory, and what it was used for.
    solver_bytes: u64,
    history: History,
    pub solved: Option<Solved>,
    /// The memory that the device has on its account for this tile.
    booked: u64,
    /// Milliseconds of the last grid build, until reported.
    build_ms: f32,
}

impl TileState {
    /// Takes a new rigidity. The grid is rebuilt at the next solve if it differs.
    pub fn set_rigidity(&mut self, rigidity: Rigidity) {
        if self.maps.rigidity != rigidity {
            self.maps.rigidity = rigidity;
            self.grid = None;
        }
    }

    /// Takes some texels of the rigidity map anew, from an image of the same shape. Of the grid only what follows from them
    /// is computed, if nodes neither start nor stop to move.
    ///
    /// # Errors
    /// `InvalidArgument` if there is no map of this shape, or a value is not finite.
    pub fn update_rigidity(
        &mut self,
        team: &Team,
        device: &Device,
        tile: &TileMesh,
        image: &ImageView,
        texels: TexelRect,
    ) -> Result<()> {
        let Rigidity::Map(map) = &mut self.maps.rigidity else {
            return Err(Error::argument("rigidity: the tile has no map, a part of which could change"));
        };
        let (size, format) = image.shape();
        if (size, format) != map.shape() {
            let ([width, height], _) = map.shape();
            let message = format!(
                "rigidity: the map that was set has {width}x{height} texels of another format or size"
            );
            return Err(Error::argument(message));
        }
        image.check_finite("rigidity", texels)?;
        image.copy_to(map, texels);
        let Some(grid) = self.grid.take() else { return Ok(()) };
        let start = Instant::now();
        let Rigidity::Map(map) = &self.maps.rigidity else { return Ok(()) };
        if let Some(repainted) = repaint(team, &grid, tile, &self.maps, map, &texels) {
            if let Some(solved) = &mut self.solved {
                let inputs = solved.inputs.iter_mut().zip(&repainted.charts);
                inputs.filter(|(_, changed)| **changed).for_each(|(input, _)| *input = None);
            }
            self.grid = Some(Arc::new(repainted.grid));
            if device.gpu().is_some() {
                // A GPU's memory holds the rigidity of the grid that it was made for.
                self.forget(device);
            }
        }
        self.build_ms += start.elapsed().as_secs_f32() * 1000.0;
        Ok(())
    }

    /// Takes a new mask. The grid is rebuilt at the next solve if it differs.
    pub fn set_mask(&mut self, mask: Option<Map>) {
        if self.maps.mask != mask {
            self.maps.mask = mask;
            self.grid = None;
        }
    }

    /// Takes new settings. The grid is rebuilt at the next solve if it depends on what changed.
    pub fn set_settings(&mut self, settings: &TileSettings) {
        let of_grid = |maps: &TileMaps| {
            let TileSettings { overlap, smoothness, smoothness_floor, orientation_density, .. } =
                maps.settings;
            (maps.grid_size(), overlap, smoothness, smoothness_floor, orientation_density > 0.0)
        };
        let grid_before = of_grid(&self.maps);
        let before = std::mem::replace(&mut self.maps.settings, *settings);
        if of_grid(&self.maps) != grid_before {
            self.grid = None;
        } else if before != *settings
            && let Some(solved) = &mut self.solved
        {
            // Same grid, other weights: nothing can be reused.
            solved.inputs.fill(None);
        }
    }

    /// The tile's grid, built if need be.
    pub fn grid(&mut self, team: &Team, device: &Device, mesh: &Mesh, tile: usize) -> Result<Arc<Grid>> {
        if let Some(grid) = &self.grid {
            return Ok(grid.clone());
        }
        let start = Instant::now();
        let source = &mesh.tiles[tile];
        // The old grid's memory is of no more use.
        self.forget(device);
        let survey = Survey::new(team, source, &self.maps, self.maps.grid_size());
        self.book(device, survey.grid_bytes(), source.udim)?;
        if survey.counts.rigid > 0 && survey.movable.iter().all(|&count| count == 0) {
            let message = format!("tile {}: it has rigid texels, but nothing that may move", source.udim);
            device.log(LogLevel::Warning, &message);
        }
        let grid = Arc::new(build::grid(team, mesh, &self.maps, survey));
        if grid.overlap > 0.0 {
            let percent = 100.0 * grid.overlap;
            device
                .log(LogLevel::Warning, &format!("tile {}: {percent:.2} % of it is overlapped", source.udim));
        }
        self.build_ms = start.elapsed().as_secs_f32() * 1000.0;
        self.grid = Some(grid.clone());
        if let Err(error) = self.book(device, 0, source.udim) {
            self.grid = None;
            return Err(error);
        }
        Ok(grid)
    }

    /// Puts the memory that is held, and `more` that is about to be allocated, on the device's account.
    fn book(&mut self, device: &Device, more: u64, udim: u32) -> Result<()> {
        let held = self.held() + more;
        device.rebook(self.booked, held, &format!("tile {udim}"))?;
        self.booked = held;
        Ok(())
    }

    /// Bytes of maps, grid, solver and result.
    fn held(&self) -> u64 {
        let grid = self.grid.as_ref().map_or(0, |grid| grid.bytes() + Solved::bytes_for(grid));
        self.map_bytes() + grid + self.solver_bytes
    }

    /// Bytes of the maps.
    fn map_bytes(&self) -> u64 {
        let rigidity = match &self.maps.rigidity {
            Rigidity::None => 0,
            Rigidity::Map(map) => map.bytes(),
            Rigidity::Vertices(values) => values.len() as u64 * 4,
        };
        rigidity + self.maps.mask.as_ref().map_or(0, Map::bytes)
    }

    /// Solves the tile for a pose. Nothing of `solved` changes: the caller puts the result there when all tiles have
    /// theirs.
    pub fn solve(&mut self, call: &SolveCall, tile: usize) -> Result<Solved> {
        let start = Instant::now();
        let grid = self.grid(call.team, call.device, call.mesh, tile)?;
        let source = &call.mesh.tiles[tile];
        let pose = Pose::new(source, |v| call.positions.get3(v as usize), Some(&grid.rest));
        let tasks = self.tasks(&grid, source, &pose, call.plan);
        let WarpResult { warp, results, mut report, work } = self.warp(call, &grid, source, &pose, &tasks)?;
        self.fill_report(&mut report, &grid, source, &tasks, &results);
        let inputs = self.inputs(&grid, pose, &tasks, call.plan, report.truncated);
        report.times.total = start.elapsed().as_secs_f32() * 1000.0;
        let overlap = self.maps.settings.overlap;
        Ok(Solved { grid, warp, inputs, results, overlap, report, work })
    }

    /// Nodes that a solve may have to move, by the present grid; 0 without one.
    pub fn movable_nodes(&self) -> u64 {
        self.grid.as_ref().map_or(0, |grid| grid.movable.iter().sum())
    }

    /// The last result, if it was solved on a grid with the same blocks.
    fn last(&self, grid: &Arc<Grid>) -> Option<&Solved> {
        self.solved.as_ref().filter(|solved| solved.grid.has_blocks_of(grid))
    }

    /// What there is to do for each chart.
    fn tasks(&self, grid: &Arc<Grid>, tile: &TileMesh, pose: &Pose, plan: &Plan) -> Vec<ChartTask> {
        let last = self.last(grid);
        let same = |c: usize| {
            let input = last.and_then(|solved| solved.inputs[c].as_ref());
            input.is_some_and(|input| input.plan == *plan && input.pose == pose.charts[c])
        };
        let task = |c: usize| match () {
            () if grid.is_still(tile, pose, c) => ChartTask::Identity,
            () if same(c) => ChartTask::Reuse,
            () => ChartTask::Solve,
        };
        (0..tile.charts.len()).map(task).collect()
    }

    /// The warp, solved where need be, and what came of it.
    fn warp(
        &mut self,
        call: &SolveCall,
        grid: &Arc<Grid>,
        tile: &TileMesh,
        pose: &Pose,
        tasks: &[ChartTask],
    ) -> Result<WarpResult> {
        let last = self.last(grid);
        let mut results =
            last.map_or_else(|| vec![ChartResult::default(); tasks.len()], |l| l.results.clone());
        let solves = tasks.contains(&ChartTask::Solve);
        // A chart that has become the identity takes its part of the last result along.
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
            let identity = vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()];
            let warp = Arc::new(Warp::Host(identity));
            return Ok(WarpResult { warp, results, report, work: None });
        }
        let solution = self.run_solver(call, grid, tile, pose, last.as_deref(), tasks)?;
        for c in (0..tasks.len()).filter(|&c| tasks[c] == ChartTask::Solve) {
            results[c] = solution.charts[c];
        }
        let Summary { times, sweeps, corrections, truncated } = solution.summary;
        let report = TileReport {
            times,
            sweeps,
            corrections,
            truncated,
            node_updates: solution.node_updates,
            blocks_active: solution.blocks_active,
            levels: grid.levels.len() as u32,
            ..report
        };
        Ok(WarpResult { warp: Arc::new(solution.warp), results, report, work: solution.work })
    }

    /// Runs the tile's solver, which is made if need be.
    fn run_solver(
        &mut self,
        call: &SolveCall,
        grid: &Arc<Grid>,
        tile: &TileMesh,
        pose: &Pose,
        last: Option<&Warp>,
        tasks: &[ChartTask],
    ) -> Result<TileSolution> {
        let charts: Vec<bool> = tasks.iter().map(|&task| task == ChartTask::Solve).collect();
        let keep: Vec<bool> = tasks.iter().map(|&task| task != ChartTask::Identity).collect();
        self.allocate(call.device, grid, tile, call.plan.solver())?;
        // Taken out for the time being: should a stage panic, the memory goes with it.
        let missing = || Error::new(ErrorKind::Internal, "the tile has no solver");
        let mut solver = self.solver.take().ok_or_else(missing)?;
        let settings = &self.maps.settings;
        let continuation = call.plan.continuation;
        let pull = if last.is_some() { call.plan.temporal_weight } else { 0.0 };
        let input = Input { grid, mesh: tile, pose, settings, charts: &charts, continuation, pull };
        let (team, plan) = (call.team, call.plan);
        let history = std::mem::take(&mut self.history);
        let clock = Clock::new(call.start, call.budget, *call.device.costs(), history).into();
        let job = Job { team, input, grid, plan, clock, last, keep: &keep };
        let solution = solver.run(&job);
        let Clock { costs, history, .. } = job.clock.into_inner();
        self.history = history;
        *call.device.costs() = costs;
        match solution {
            Ok(_) => self.solver = Some(solver),
            Err(error) => {
                drop(solver);
                return Err(self.give_up(call.device, tile, error));
            }
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
    fn inputs(
        &self,
        grid: &Arc<Grid>,
        pose: Pose,
        tasks: &[ChartTask],
        plan: &Plan,
        truncated: bool,
    ) -> Vec<Option<ChartInput>> {
        let last = self.last(grid);
        let reused = |c: usize| last.filter(|_| tasks[c] == ChartTask::Reuse)?.inputs[c].clone();
        // A warm or truncated result depends on more than its inputs.
        let depends_on_more = plan.warm || truncated;
        let input = |pose| (!depends_on_more).then_some(ChartInput { pose, plan: *plan });
        pose.charts.into_iter().enumerate().map(|(c, pose)| reused(c).or_else(|| input(pose))).collect()
    }

    /// Frees the solver's remaining memory after a failure, and takes it off the device's account.
    fn give_up(&mut self, device: &Device, tile: &TileMesh, error: Error) -> Error {
        self.solver = None;
        self.solver_bytes = 0;
        self.history = History::default();
        if let Some(gpu) = device.gpu() {
            gpu.reclaim();
        }
        // Less than before always fits.
        let _ = self.book(device, 0, tile.udim);
        error
    }

    /// Drops the solver.
    fn forget(&mut self, device: &Device) {
        self.solver_bytes = 0;
        self.history = History::default();
        if self.solver.take().is_some()
            && let Some(gpu) = device.gpu()
        {
            gpu.reclaim();
        }
    }

    /// Makes the solver for a grid, if there is none yet. Its memory is booked before it is taken.
    fn allocate(&mut self, device: &Device, grid: &Arc<Grid>, tile: &TileMesh, solver: Solver) -> Result<()> {
        let fits = self.solver.as_ref().is_some_and(|solver_of| solver_of.is_for(grid, solver));
        if !fits {
            // The old memory goes before the new one comes.
            self.forget(device);
            let bytes = TileSolver::bytes_for(device, grid, tile, solver)?;
            self.book(device, bytes, tile.udim)?;
            match TileSolver::new(device, grid, tile, solver) {
                Ok(solver) => self.solver = Some(solver),
                Err(error) => return Err(self.give_up(device, tile, error)),
            }
            self.solver_bytes = bytes;
        }
        Ok(())
    }

    /// Bytes of the prepared tile as `save` writes it; prepares it if need be.
    pub fn saved_size(&mut self, team: &Team, device: &Device, mesh: &Mesh, tile: usize) -> Result<usize> {
        self.grid(team, device, mesh, tile).map(|grid| saved::size(&grid))
    }

    /// Writes the prepared tile to as many bytes as `saved_size` tells.
    pub fn save(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        out: &mut [u8],
    ) -> Result<()> {
        let grid = self.grid(team, device, mesh, tile)?;
        saved::save(&grid, saved::key(mesh, &mesh.tiles[tile], &self.maps), out);
        Ok(())
    }

    /// Takes a prepared tile that was saved with the same mesh, maps and settings.
    pub fn load(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        data: &[u8],
    ) -> Result<()> {
        let source = &mesh.tiles[tile];
        let key = saved::key(mesh, source, &self.maps);
        let grid = saved::load(team, data, key, mesh, source, |bytes| self.book(device, bytes, source.udim));
        if let Ok(grid) = grid {
            self.forget(device);
            self.grid = Some(Arc::new(grid));
            return self.book(device, 0, source.udim);
        }
        // What was booked for it goes back: less than before always fits.
        let _ = self.book(device, 0, source.udim);
        grid.map(drop)
    }

    /// What preparing and solving the tile would take, from a survey alone.
    pub fn estimate(&self, team: &Team, device: &Device, mesh: &Mesh, tile: usize) -> Result<TileEstimate> {
        let source = &mesh.tiles[tile];
        let survey = Survey::new(team, source, &self.maps, self.maps.grid_size());
        let (grid_bytes, parts) = (survey.grid_bytes(), survey.bytes());
        let grid = build::skeleton(survey);
        let result = Solved::bytes_for(&grid);
        let solver = TileSolver::bytes_for(device, &grid, source, Solver::Descent)?;
        let prepared = self.map_bytes() + grid_bytes;
        Ok(TileEstimate {
            movable_nodes: grid.movable.iter().sum(),
            prepared_bytes: prepared,
            // Of level 1: metrics and lengths of edges, which are gone when the grid is there.
            preparing_bytes: prepared + parts + grid_bytes / 5,
            // The last result stays until the next one is there.
            solving_bytes: prepared + solver + 2 * result,
        })
    }

    /// The facts of the tile that need no solve.
    pub fn info(&mut self, team: &Team, device: &Device, mesh: &Mesh, tile: usize) -> Result<TileInfo> {
        let grid = self.grid(team, device, mesh, tile)?;
        let source = &mesh.tiles[tile];
        Ok(TileInfo {
            udim: source.udim,
            charts: source.charts.len() as u32,
            triangles: source.triangles.len() as u64,
            grid: [grid.levels[0].nx as u32, grid.levels[0].ny as u32],
            movable_nodes: grid.movable.iter().sum(),
            overlap: grid.overlap,
            frozen: grid.frozen,
        })
    }

    /// Takes the memory off the device's budget.
    pub fn release(&mut self, device: &Device) {
        self.solved = None;
        self.forget(device);
        let _ = device.rebook(self.booked, 0, "");
        self.booked = 0;
    }
}

/// A tile's new warp.
struct WarpResult {
    warp: Arc<Warp>,
    /// Per chart.
    results: Vec<ChartResult>,
    /// Filled as far as it follows from the solve itself.
    report: TileReport,
    /// The GPU's dispatches, submissions and transfers.
    work: Option<GpuWork>,
}

/// What there is to do for a chart.
#[derive(Clone, Copy, PartialEq, Eq)]
enum ChartTask {
    /// It has to be solved.
    Solve,
    /// None of its inputs changed: it keeps its last result.
    Reuse,
    /// The identity is its best warp.
    Identity,
}
