//! Tiles that a GPU solves together, as one: what small tiles take there is the time of their dispatches, not of their
//! nodes. The results are bit-identical to those of each tile alone.

use std::ops::Range;
use std::sync::Arc;

use super::shape::Prepared;
use super::solver::{BookedSolver, Member, Shared, SolveCall, Together, is_usable_after};
use super::tile::{Begun, TileSolved, TileState};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::backend::{TileSolution, Warp};
use vrtm_core::clock::Instant;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::pose::{ChartPose, Pose};
use vrtm_core::mesh::{Chart, TileMesh};
use vrtm_core::method::plan::{Input, Purpose};
use vrtm_core::panics::lock;
use vrtm_core::unwind::caught;

pub(super) struct Queued<'a> {
    pub state: &'a mut TileState,
    pub prepared: Prepared,
    pub begun: Begun,
    pub nodes: u64,
    /// This tile's share of the call's progress.
    pub progress: f32,
    /// `None` if the tile was not solved, or keeps its last result for want of time.
    pub result: Option<Result<TileSolved>>,
}

/// Name of its memory in errors.
const WHAT: &str = "solving tiles together";

/// Divides tiles into those that can be solved together. Who frees solvers after each tile wants the memory of one.
pub(super) fn units<'a>(call: &SolveCall, queue: Vec<Queued<'a>>) -> Vec<Vec<Queued<'a>>> {
    let Some(gpu) = call.on.device.gpu() else {
        return queue.into_iter().map(|one| Vec::of([one])).collect();
    };
    let weights = |queued: &Queued| call.on.given.maps[queued.state.tile].settings.weights();
    let blocks = |queued: &Queued| queued.prepared.grid.levels[0].blocks.list.len();
    let mut units: Vec<Vec<Queued>> = Vec::new();
    for queued in queue {
        let fits = |unit: &&mut Vec<Queued>| {
            let (first, all) = (&unit[0], unit.iter().map(blocks).sum::<usize>());
            !call.release_solvers
                && all + blocks(&queued) <= gpu.most_blocks()
                && queued.begun.needs_solver() == first.begun.needs_solver()
                && [&queued, first].iter().all(|queued| !queued.state.is_torn())
                && start(call, &queued) == start(call, first)
                && weights(&queued) == weights(first)
                && gpu.are_alike(&queued.prepared.grid, &first.prepared.grid)
        };
        match units.iter_mut().find(fits) {
            Some(unit) => unit.push(queued),
            None => units.push(Vec::of([queued])),
        }
    }
    units
}

/// Start of a tile's solve: the last result, if there is one, and if it is on the GPU.
fn start(call: &SolveCall, queued: &Queued) -> Option<bool> {
    let last = queued.state.last_warp(&queued.prepared.grid).filter(|_| call.plan.warm);
    last.map(|last| last.on_gpu().is_some())
}

/// Solves tiles that can be solved together.
pub(super) fn solve(call: &SolveCall, unit: &mut [Queued]) {
    let solved = with_one_solver(call, unit);
    match solved {
        Ok(true) => {}
        Ok(false) => {
            for queued in unit {
                let call = SolveCall { progress: queued.progress, ..*call };
                queued.result = queued.state.solve(&call, &queued.prepared, &mut queued.begun).transpose();
            }
        }
        Err(error) => unit.iter_mut().for_each(|queued| queued.result = Some(Err(error.clone()))),
    }
}

/// Solves tiles with the solver that they share; false if each has to be solved with its own.
fn with_one_solver(call: &SolveCall, unit: &mut [Queued]) -> Result<bool> {
    if !unit[0].begun.needs_solver() {
        return Ok(false);
    }
    let shared = match shared(unit) {
        Some(shared) => shared,
        None if unit.len() == 1 => return Ok(false),
        None => match make(call, unit) {
            Ok(Some(shared)) => shared,
            Ok(None) => return Ok(false),
            // Tiles may fit one by one.
            Err(error) if error.kind == ErrorKind::OutOfMemory => return Ok(false),
            Err(error) => return Err(error),
        },
    };
    let mut guard = lock(&shared);
    let Some(together) = &mut *guard else { return Ok(false) };
    let start = Instant::now();
    let solutions = together.run(call, unit);
    let all: u64 = unit.iter().map(|queued| queued.nodes).sum();
    for queued in &mut *unit {
        queued.begun.spent += start.elapsed().mul_f64(queued.nodes as f64 / all.max(1) as f64);
    }
    if together.solver.is_none() || call.release_solvers {
        *guard = None;
    }
    drop(guard);
    for (queued, solution) in unit.iter_mut().zip(solutions?) {
        queued.result =
            queued.state.end(call, &queued.prepared, &mut queued.begun, Some(solution)).transpose();
    }
    Ok(true)
}

/// The solver that all of these tiles share, if it is for their grids.
fn shared(unit: &[Queued]) -> Option<Shared> {
    let is_for = |together: &Together| {
        let has = |queued: &Queued| together.place(queued.state.tile, &queued.prepared.grid).is_some();
        together.solver.is_some() && unit.iter().all(has)
    };
    let mut all = unit.iter().filter_map(|queued| queued.state.together.as_ref());
    all.find(|shared| lock(shared).as_ref().is_some_and(is_for)).cloned()
}

/// Makes a solver for some tiles, and for those that share one with them now; `None` if the memory budget has no room.
fn make(call: &SolveCall, unit: &mut [Queued]) -> Result<Option<Shared>> {
    let (device, purpose) = (call.on.device, purpose(call, unit[0].state.tile));
    let before = unit.iter().find_map(|queued| {
        let shared = queued.state.together.clone()?;
        let members = lock(&shared).take()?.members;
        Some((shared, members))
    });
    let (shared, members) = members(call, unit, before);
    let mut bytes = 0;
    for Member { grid, mesh, .. } in &members {
        bytes += grid.bytes() + device.solver_bytes(grid, &[&**mesh], purpose);
    }
    let held: u64 = unit.iter().map(|queued| queued.state.solver_bytes()).sum();
    // Tiles keep their own solvers if there is no room.
    let mut booked = device.booking();
    match booked.set(bytes.saturating_sub(held), WHAT) {
        Err(error) if error.kind == ErrorKind::OutOfMemory => return Ok(None),
        booked => booked?,
    }
    for queued in &mut *unit {
        queued.state.free_solvers();
        queued.state.together = Some(shared.clone());
    }
    let grids: Vec<Arc<Grid>> = members.iter().map(|member| member.grid.clone()).collect();
    let grid = Arc::new(Grid::joined(&grids, None));
    let meshes: Vec<&TileMesh> = members.iter().map(|member| &*member.mesh).collect();
    booked.set(grid.bytes(), WHAT)?;
    let mut of_solver = device.booking();
    of_solver.set(device.solver_bytes(&grid, &meshes, purpose), WHAT)?;
    let solver = caught(|| device.solver(&grid, &meshes, purpose))?;
    let solver = Some(BookedSolver { solver, booked: of_solver });
    *lock(&shared) = Some(Together { members, grid, solver, booked });
    Ok(Some(shared))
}

/// Some tiles and, since which have to be solved differs from pose to pose, those before that can still be solved
/// together with them; with the place where all find the solver.
fn members(
    call: &SolveCall,
    unit: &[Queued],
    before: Option<(Shared, Vec<Member>)>,
) -> (Shared, Vec<Member>) {
    let new = |queued: &Queued| Member {
        tile: queued.state.tile,
        grid: queued.prepared.grid.clone(),
        mesh: queued.prepared.mesh.clone(),
    };
    let mut members: Vec<Member> = unit.iter().map(new).collect();
    let (Some(gpu), Some((shared, before))) = (call.on.device.gpu(), before) else {
        return (Shared::default(), members);
    };
    let weights = |tile: usize| call.on.given.maps[tile].settings.weights();
    let first = unit[0].state.tile;
    let is_new = |member: &Member| members.iter().all(|other| other.tile != member.tile);
    let others: Vec<Member> = before.into_iter().filter(is_new).collect();
    let stays = |member: &Member| {
        weights(member.tile) == weights(first) && gpu.are_alike(&member.grid, &unit[0].prepared.grid)
    };
    let blocks: usize = members.iter().chain(&others).map(Member::blocks).sum();
    if !others.iter().all(stays) || blocks > gpu.most_blocks() {
        // The others will share another one.
        return (Shared::default(), members);
    }
    members.extend(others);
    (shared, members)
}

fn purpose(call: &SolveCall, tile: usize) -> Purpose {
    Purpose::new(call.plan.solver(), &call.on.given.maps[tile].settings)
}

impl Together {
    /// The number of a tile among these, if it is one of them on a grid with the same blocks.
    fn place(&self, tile: usize, grid: &Grid) -> Option<usize> {
        self.members.iter().position(|member| member.tile == tile && member.grid.has_blocks_of(grid))
    }

    /// Per member, the range of what all have so many of.
    fn ranges(&self, count: impl Fn(&Member) -> usize) -> Vec<Range<usize>> {
        let mut start = 0;
        let range = |member: &Member| {
            let end = start + count(member);
            std::mem::replace(&mut start, end)..end
        };
        self.members.iter().map(range).collect()
    }

    /// Takes over grids of other rigidities.
    fn follow(&mut self, unit: &[Queued], places: &[usize]) {
        let mut is_new = false;
        for (queued, &place) in unit.iter().zip(places) {
            let (member, grid) = (&mut self.members[place], &queued.prepared.grid);
            is_new |= !Arc::ptr_eq(&member.grid, grid);
            member.grid = grid.clone();
        }
        if is_new {
            let grids: Vec<Arc<Grid>> = self.members.iter().map(|member| member.grid.clone()).collect();
            self.grid = Arc::new(Grid::joined(&grids, Some(&self.grid)));
        }
    }

    fn run(&mut self, call: &SolveCall, unit: &[Queued]) -> Result<Vec<TileSolution>> {
        let place = |queued: &Queued| self.place(queued.state.tile, &queued.prepared.grid);
        let places: Vec<usize> = unit.iter().filter_map(place).collect();
        self.follow(unit, &places);
        let of_charts = self.ranges(|member| member.grid.movable.len());
        let of_blocks = self.ranges(Member::blocks);
        // Tiles that take no part have a pose that nothing reads.
        let nowhere = |chart: &Chart| ChartPose { positions: vec![[0.0; 3]; chart.count()], scale: 1.0 };
        let mut charts: Vec<bool> = vec![false; self.grid.movable.len()];
        let mut keep = charts.clone();
        let mut pose = Pose { charts: Vec::with_capacity(charts.len()) };
        let mut lasts: Vec<Option<&Warp>> = Vec::with_capacity(self.members.len());
        let mut multipliers: Vec<f32> = Vec::new();
        let of_features = self.ranges(|member| member.grid.features.count);
        for (m, member) in self.members.iter().enumerate() {
            let Some(k) = places.iter().position(|&place| place == m) else {
                pose.charts.extend(member.mesh.charts.iter().map(nowhere));
                lasts.push(None);
                multipliers.resize(of_features[m].end, 0.0);
                continue;
            };
            let Queued { state, prepared, begun, .. } = &unit[k];
            pose.charts.extend(begun.pose.charts.iter().cloned());
            lasts.push(state.last_warp(&prepared.grid));
            multipliers.extend_from_slice(state.multipliers(&prepared.grid));
            multipliers.resize(of_features[m].end, 0.0);
            charts[of_charts[m].clone()].copy_from_slice(&begun.solved());
            keep[of_charts[m].clone()].copy_from_slice(&begun.kept());
        }
        let settings = &call.on.given.maps[unit[0].state.tile].settings;
        let (grid, plan, mesh) = (&self.grid, call.plan, &*unit[0].prepared.mesh);
        let pull = if lasts.iter().any(Option::is_some) { plan.temporal_weight } else { 0.0 };
        let (continuation, harm) = (plan.continuation, plan.harm(settings));
        let multipliers = if plan.warm { &multipliers[..] } else { &[] };
        let (pose, charts) = (&pose, &charts[..]);
        let input = Input { grid, mesh, pose, settings, harm, multipliers, charts, continuation, pull };
        let lost = || Error::new(ErrorKind::Internal, "the solver of tiles together is gone");
        // Taken out during the run: if a stage panics, the memory is dropped.
        let mut solver = self.solver.take().ok_or_else(lost)?;
        let progress = unit.iter().map(|queued| queued.progress).sum();
        let solution = solver.run(call, input, progress, &lasts, &keep);
        if is_usable_after(&solution) {
            self.solver = Some(solver);
        }
        let solution = solution?;
        let all: u64 = unit.iter().map(|queued| queued.nodes).sum();
        let part = |(&m, queued): (&usize, &Queued)| {
            let warp = solution.warp.on_gpu().ok_or_else(lost)?;
            let share = queued.nodes as f64 / all.max(1) as f64;
            let of = |count: u64| (count as f64 * share).round() as u64;
            Ok(TileSolution {
                warp: Warp::Gpu(warp.part(&self.members[m].grid, of_blocks[m].clone())),
                charts: Vec::from(&solution.charts[of_charts[m].clone()]),
                multipliers: Vec::from(solution.multipliers.get(of_features[m].clone()).unwrap_or(&[])),
                summary: solution.summary.share(share as f32),
                node_updates: of(solution.node_updates),
                blocks_active: of(solution.blocks_active),
                work: solution.work.clone(),
            })
        };
        places.iter().zip(unit).map(part).collect()
    }
}
