//! One tile of an asset: its maps, its grid (built when needed), its solver's memory, and its last good result.

use std::sync::Arc;
use std::time::Instant;

use crate::cpu::Team;
use crate::device::Device;
use crate::error::{Error, ErrorKind, Result};
use crate::image::Map;
use crate::mesh::{Mesh, TileMesh};
use crate::report::{GpuWork, TileInfo, TileReport};
use crate::settings::{LogLevel, Overlap, Solver};
use crate::solve::{ChartResult, Input, Plan};
use crate::tile::blocks::{NODES, Plane, SIDE};
use crate::tile::coverage::Coverage;
use crate::tile::pose::{ChartPose, Pose};
use crate::tile::{Grid, Rigidity, TileMaps};

use super::backend::{Memory, Warp};

/// A tile's last good solve.
#[derive(Debug)]
pub(super) struct Solved {
    /// The grid it was solved on, which may be older than the maps.
    pub grid: Arc<Grid>,
    pub warp: Arc<Warp>,
    /// What each chart's result was computed from; `None` where it is not a function of its inputs.
    inputs: Vec<Option<ChartInput>>,
    outcome: Vec<ChartResult>,
    /// The setting that it was solved with.
    overlap: Overlap,
    pub report: TileReport,
    /// What a GPU had to do.
    pub work: Option<GpuWork>,
}

impl Solved {
    /// Bytes of a result on a grid.
    fn bytes_for(grid: &Grid) -> u64 {
        (grid.levels[0].blocks.list.len() * size_of::<[Plane; 2]>()) as u64
    }

    /// Largest displacement of a chart, in cells.
    pub fn reach(&self, chart: u32) -> f32 {
        self.outcome[chart as usize].max_displacement
    }

    /// Charts whose warp may move a corner of `chart`: its own, and where the first face owns shared texels, any.
    pub fn candidates(&self, chart: u32) -> impl Iterator<Item = u32> + use<> {
        let others = if self.overlap == Overlap::FirstFace { self.outcome.len() as u32 } else { 0 };
        std::iter::once(chart).chain((0..others).filter(move |&other| other != chart))
    }
}

#[derive(Clone, Debug, PartialEq)]
struct ChartInput {
    pose: ChartPose,
    plan: Plan,
}

/// One tile of an asset.
#[derive(Debug, Default)]
pub(super) struct TileState {
    pub maps: TileMaps,
    coverage: Option<Coverage>,
    grid: Option<Arc<Grid>>,
    memory: Option<Memory>,
    /// What the memory takes.
    memory_bytes: u64,
    pub solved: Option<Solved>,
    /// What the device's books say.
    booked: u64,
    /// Milliseconds of the last grid build, until reported.
    build_ms: f32,
}

impl TileState {
    /// Takes new maps or settings; the grid is rebuilt at the next solve if it depends on what changed.
    pub fn set_maps(&mut self, change: impl FnOnce(&mut TileMaps)) {
        let before = self.maps.clone();
        change(&mut self.maps);
        let resized = before.grid_size() != self.maps.grid_size()
            || before.settings.overlap != self.maps.settings.overlap;
        if resized {
            self.coverage = None;
        }
        let dense = |maps: &TileMaps| maps.settings.orientation_density > 0.0;
        let smoothness = |maps: &TileMaps| (maps.settings.smoothness, maps.settings.smoothness_floor);
        let resized =
            resized || dense(&before) != dense(&self.maps) || smoothness(&before) != smoothness(&self.maps);
        if resized || before.rigidity != self.maps.rigidity || before.mask != self.maps.mask {
            self.grid = None;
        } else if before.settings != self.maps.settings
            && let Some(solved) = &mut self.solved
        {
            // Same grid, other weights: nothing can be reused.
            solved.inputs.fill(None);
        }
    }

    /// The tile's grid, built if need be.
    pub fn grid(&mut self, device: &Device, mesh: &Mesh, tile: usize) -> Result<Arc<Grid>> {
        if let Some(grid) = &self.grid {
            return Ok(grid.clone());
        }
        let start = Instant::now();
        let source = &mesh.tiles[tile];
        let coverage = self.coverage.get_or_insert_with(|| {
            let [nx, ny] = self.maps.grid_size();
            Coverage::new(source, nx, ny, self.maps.settings.overlap)
        });
        let grid = Arc::new(Grid::new(mesh, source, &self.maps, coverage));
        if grid.overlap > 0.0 {
            let share = 100.0 * grid.overlap;
            device.log(LogLevel::Warning, &format!("tile {}: {share:.2} % of it is overlapped", source.udim));
        }
        self.build_ms = start.elapsed().as_secs_f32() * 1000.0;
        // The old grid's memory is of no more use.
        self.forget(device);
        self.grid = Some(grid.clone());
        if let Err(error) = self.book(device, 0, source.udim) {
            self.grid = None;
            self.coverage = None;
            return Err(error);
        }
        Ok(grid)
    }

    /// Books what is held, and `more` that is about to be taken.
    fn book(&mut self, device: &Device, more: u64, udim: u32) -> Result<()> {
        let held = self.held() + more;
        device.rebook(self.booked, held, &format!("tile {udim}"))?;
        self.booked = held;
        Ok(())
    }

    /// Bytes of maps, coverage, grid, solver and result.
    fn held(&self) -> u64 {
        let map = |map: &Map| map.values.len() as u64 * 4;
        let rigidity = match &self.maps.rigidity {
            Rigidity::None => 0,
            Rigidity::Map(image) => map(image),
            Rigidity::Vertices(values) => values.len() as u64 * 4,
        };
        let coverage = self.coverage.as_ref().map_or(0, |c| c.triangle.len() as u64 * 5);
        let grid = self.grid.as_ref().map_or(0, |grid| grid.bytes() + Solved::bytes_for(grid));
        rigidity + self.maps.mask.as_ref().map_or(0, map) + coverage + grid + self.memory_bytes
    }

    /// Solves the tile for a pose. Nothing of `solved` changes: the caller puts the result there when all tiles have
    /// theirs.
    #[allow(clippy::too_many_arguments, reason = "one caller, and a struct for it would only rename them")]
    pub fn solve(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        position: impl Fn(u32) -> [f64; 3],
        plan: &Plan,
        called: Instant,
    ) -> Result<Solved> {
        let start = Instant::now();
        let grid = self.grid(device, mesh, tile)?;
        let source = &mesh.tiles[tile];
        let pose = Pose::new(source, position, Some(&grid.rest));
        let last = self.solved.as_ref().filter(|solved| Arc::ptr_eq(&solved.grid, &grid));
        let state: Vec<ChartState> = (0..source.charts.len())
            .map(|c| {
                if grid.is_still(source, &pose, c) {
                    return ChartState::Identity;
                }
                let same = last
                    .and_then(|solved| solved.inputs[c].as_ref())
                    .is_some_and(|input| input.plan == *plan && input.pose == pose.charts[c]);
                if same { ChartState::Reused } else { ChartState::Active }
            })
            .collect();
        let reused: Vec<Option<ChartInput>> = (0..state.len())
            .map(|c| last.filter(|_| state[c] == ChartState::Reused).and_then(|last| last.inputs[c].clone()))
            .collect();
        let charts: Vec<bool> = state.iter().map(|&s| s == ChartState::Active).collect();
        let any = charts.contains(&true);

        let mut outcome =
            last.map_or_else(|| vec![ChartResult::default(); charts.len()], |last| last.outcome.clone());
        // A chart that has become the identity takes its part of the last result along.
        let mut unchanged = !any && last.is_some();
        for (c, _) in state.iter().enumerate().filter(|(_, state)| **state == ChartState::Identity) {
            unchanged &= outcome[c].max_displacement == 0.0;
            outcome[c] = ChartResult { min_jacobian: 1.0, ..ChartResult::default() };
        }

        let mut report = TileReport::default();
        let mut work = None;
        let warp = if let (true, Some(last)) = (unchanged, last) {
            last.warp.clone()
        } else if !any && !state.contains(&ChartState::Reused) {
            Arc::new(Warp::Host(vec![[[0.0; NODES]; 2]; grid.levels[0].blocks.list.len()]))
        } else {
            let last = last.map(|last| last.warp.clone());
            self.allocate(device, &grid, source, plan.solver())?;
            // Taken out for the time being: should a stage panic, the memory goes with it.
            let mut memory =
                self.memory.take().ok_or_else(|| Error::new(ErrorKind::Internal, "no memory"))?;
            let settings = &self.maps.settings;
            let continuation = plan.continuation;
            let input =
                Input { grid: &grid, mesh: source, pose: &pose, settings, charts: &charts, continuation };
            let keep: Vec<bool> = state.iter().map(|&s| s != ChartState::Identity).collect();
            let ran = match memory.run(team, &input, &grid, plan, called, last.as_deref(), &keep) {
                Ok(ran) => ran,
                Err(error) => {
                    drop(memory);
                    return Err(self.give_up(device, source, error));
                }
            };
            for c in (0..charts.len()).filter(|&c| charts[c]) {
                outcome[c] = ran.charts[c];
            }
            report.times = ran.outcome.times;
            report.sweeps = ran.outcome.sweeps;
            report.corrections = ran.outcome.corrections;
            report.truncated = ran.outcome.truncated;
            report.node_updates = ran.node_updates;
            report.blocks_active = ran.blocks_active;
            report.levels = grid.levels.len() as u32;
            self.memory = Some(memory);
            work = ran.work;
            Arc::new(ran.warp)
        };
        let count = |wanted: ChartState| state.iter().filter(|&&s| s == wanted).count() as u32;
        report.udim = source.udim;
        report.grid = [grid.levels[0].nx as u32, grid.levels[0].ny as u32];
        report.energy_before = outcome.iter().map(|o| o.energy_before).sum();
        report.energy = outcome.iter().map(|o| o.energy).sum();
        report.min_jacobian = outcome.iter().map(|o| o.min_jacobian).fold(1.0, f64::min);
        report.folds = outcome.iter().map(|o| o.folds).sum();
        report.max_displacement = outcome.iter().map(|o| o.max_displacement).fold(0.0, f32::max);
        report.charts = charts.len() as u32;
        report.charts_active = count(ChartState::Active);
        report.charts_reused = count(ChartState::Reused);
        report.charts_identity = count(ChartState::Identity);
        report.charts_fallback = (0..charts.len())
            .filter(|&c| state[c] != ChartState::Identity && outcome[c].fallback)
            .count() as u32;
        report.blocks = report.grid.map(|n| (n as usize + 1).div_ceil(SIDE) as u64).iter().product();
        report.nodes_active = (0..charts.len()).filter(|&c| charts[c]).map(|c| grid.movable[c]).sum();
        report.times.maps = std::mem::take(&mut self.build_ms);
        let inputs = pose
            .charts
            .into_iter()
            .zip(reused)
            .map(|(pose, reused)| match reused {
                Some(input) => Some(input),
                // A warm or truncated result depends on more than its inputs.
                None => (!plan.warm && !report.truncated).then_some(ChartInput { pose, plan: *plan }),
            })
            .collect();
        report.bytes = self.held();
        report.times.total = start.elapsed().as_secs_f32() * 1000.0;
        let overlap = self.maps.settings.overlap;
        Ok(Solved { grid, warp, inputs, outcome, overlap, report, work })
    }

    /// What is left of the solver's memory after a failure goes, and is taken out of the books.
    fn give_up(&mut self, device: &Device, tile: &TileMesh, error: Error) -> Error {
        self.memory = None;
        self.memory_bytes = 0;
        if let Some(gpu) = device.gpu() {
            gpu.reclaim();
        }
        // Less than before always fits.
        let _ = self.book(device, 0, tile.udim);
        error
    }

    /// Lets the solver's memory go.
    fn forget(&mut self, device: &Device) {
        self.memory_bytes = 0;
        if self.memory.take().is_some()
            && let Some(gpu) = device.gpu()
        {
            gpu.reclaim();
        }
    }

    /// The solver's memory for a grid, booked before it is taken.
    fn allocate(&mut self, device: &Device, grid: &Arc<Grid>, tile: &TileMesh, solver: Solver) -> Result<()> {
        let fits = self.memory.as_ref().is_some_and(|memory| memory.is_for(grid, solver));
        if !fits {
            // The old memory goes before the new one comes.
            self.forget(device);
            let bytes = Memory::bytes_for(device, grid, tile, solver)?;
            self.book(device, bytes, tile.udim)?;
            match Memory::new(device, grid, tile, solver) {
                Ok(memory) => self.memory = Some(memory),
                Err(error) => return Err(self.give_up(device, tile, error)),
            }
            self.memory_bytes = bytes;
        }
        Ok(())
    }

    /// What is known of the tile before a solve.
    pub fn info(&mut self, device: &Device, mesh: &Mesh, tile: usize) -> Result<TileInfo> {
        let grid = self.grid(device, mesh, tile)?;
        let source = &mesh.tiles[tile];
        Ok(TileInfo {
            udim: source.udim,
            charts: source.charts.len() as u32,
            triangles: source.triangles.len() as u64,
            grid: [grid.levels[0].nx as u32, grid.levels[0].ny as u32],
            movable_nodes: grid.movable.iter().sum(),
            overlap: grid.overlap,
        })
    }

    /// Gives the memory's share of the device's budget back.
    pub fn release(&mut self, device: &Device) {
        self.solved = None;
        self.forget(device);
        let _ = device.rebook(self.booked, 0, "");
        self.booked = 0;
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum ChartState {
    Active,
    Reused,
    Identity,
}
