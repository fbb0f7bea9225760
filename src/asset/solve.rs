//! A solve: the tiles that a request includes, all threads on large ones and one thread on each of the others, and the
//! publication of all results at once.

use std::cmp::Reverse;
use std::sync::Arc;

use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::grid::maps::{TileMaps, Values};
use vrtm_core::log::LogCode;
use vrtm_core::mesh::Chart;
use vrtm_core::method::deadline::Deadline;
use vrtm_core::method::plan::Plan;
use vrtm_core::settings::SolveOptions;
use vrtm_core::team::{Crew, Team};
use vrtm_core::unwind::caught;
use vrtm_core::view::Strided;

use super::Asset;
use super::given::Call;
use super::outputs::Fetch;
use super::request::SolveRequest;
use super::results::{KeptPose, Last, TileResult};
use super::seams;
use super::shape::Prepared;
use super::side_by_side::together;
use super::solver::SolveCall;
use super::stretch::Stretch;
use super::tile::{Begun, TileSolved, TileState};
use super::together::{Queued, solve as solve_unit, units};
use crate::solved::Solved;

/// The share of a call's progress for preparing its tiles, if any tile needs it.
const PREPARING: f32 = 0.3;

impl Asset {
    /// Solves every tile for a pose.
    pub fn solve(&mut self, positions: Strided, options: &SolveOptions) -> Result<()> {
        self.redirect(positions, options, &mut [])
    }

    /// Solves and fetches in one call: all arguments are checked before anything is written.
    ///
    /// # Errors
    /// The errors of [`crate::Tile::fetch`].
    pub fn redirect(
        &mut self,
        positions: Strided,
        options: &SolveOptions,
        fetches: &mut [Fetch],
    ) -> Result<()> {
        self.run(&SolveRequest { positions, options: *options, ..SolveRequest::default() }, fetches)
    }

    /// Solves for a pose, and writes outputs. All arguments are checked before anything is changed. The call can be
    /// cancelled until all tiles are solved; the outputs are then always written to the end.
    ///
    /// # Errors
    /// `Cancelled`; those of [`crate::Tile::fetch`].
    pub fn run(&mut self, request: &SolveRequest, fetches: &mut [Fetch]) -> Result<()> {
        let start = (self.clock)();
        request.check(&self.device, &self.mesh.info)?;
        self.results.check_fetches(fetches)?;
        let (scale, before) = (request.options.scale, self.results.last().stretch);
        let stretch = Stretch::new(&self.mesh, &request.positions, scale);
        let positions = request.positions.scaled(stretch.factor(scale));
        let request = &SolveRequest { positions, ..request.clone() };
        let crew = self.device.crew(request.threads, request.control.clone());
        self.device.clone().call(|| {
            caught(|| {
                Team::of(&crew, |team| {
                    let (solved, late, last) = self.solve_tiles(team, &crew, request, stretch, start)?;
                    stretch.warn(&self.device, scale, &before);
                    // Results are published after the requested outputs are written, since that can fail.
                    self.results.write_all(team, &last, fetches)?;
                    for solved in solved {
                        let tile = solved.tile();
                        self.tiles[tile].last = Some(solved);
                    }
                    self.tiles.iter_mut().zip(late).for_each(|(state, late)| state.late = late);
                    self.results.replace(last);
                    if let Some(control) = team.control() {
                        control.tell_end();
                    }
                    Ok(())
                })
            })
        })
    }

    /// Solves the tiles of a request; returns the results to be published: those of the solved tiles, per tile whether
    /// it is late (see `Asset::late`), and the results of all tiles.
    fn solve_tiles(
        &mut self,
        team: &Team,
        crew: &Crew,
        request: &SolveRequest,
        stretch: Stretch,
        start: Instant,
    ) -> Result<(Vec<TileSolved>, Vec<bool>, Last)> {
        let _working = team.control().map(|control| control.begin());
        team.check_or_unwind();
        let plan = Plan::new(&request.options);
        let asked = self.asked(request);
        let due = self.due(request, &plan, &asked);
        if request.release_last {
            self.release_results(&due);
        }
        self.warn_of_no_rigidity();
        // With collars, a grid reads the maps of other tiles as their grids do.
        let has_collars = self.has_collars();
        let sized = (0..due.len()).filter(|&tile| due[tile] || has_collars);
        self.given.find_sizes(team, &self.mesh, sized, &self.device);
        let solved = self.solved(team, crew, request, &plan, &due, start)?;
        let late = self.late(&due, &solved);
        let mut last = self.last(team, request, &asked, &solved, &late, start)?;
        last.stretch = stretch;
        // From here on the call has a result and can no longer be cancelled.
        if let Some(control) = team.control() {
            control.seal_or_unwind();
        }
        Ok((solved, late, last))
    }

    /// Per tile, whether the request allows that its result changes.
    fn asked(&self, request: &SolveRequest) -> Vec<bool> {
        let mut asked = vec![request.tiles.is_none(); self.tiles.len()];
        for &tile in request.tiles.unwrap_or_default() {
            asked[tile] = true;
        }
        self.given.frozen.iter().zip(&mut asked).for_each(|(frozen, asked)| *asked &= !frozen);
        asked
    }

    /// Per tile, whether it has to be solved.
    fn due(&self, request: &SolveRequest, plan: &Plan, asked: &[bool]) -> Vec<bool> {
        let mut due = Vec::from(asked);
        let Some(dirty) = request.dirty_vertices else { return due };
        let mut is_dirty = zeroed(self.mesh.rest.len());
        for &vertex in dirty {
            is_dirty[vertex as usize] = true;
        }
        for (state, due) in self.tiles.iter().zip(&mut due).filter(|(state, _)| !state.late) {
            let factor = request.positions.factor();
            let last = state.last.as_ref().filter(|last| last.is_of(plan, factor, &self.given));
            *due &= last.is_none_or(|TileSolved { solved, .. }| {
                let charts = &solved.extended.as_ref().unwrap_or(&solved.mesh).charts;
                charts.iter().flat_map(Chart::of_mesh).any(|vertex| is_dirty[vertex as usize])
            });
        }
        due
    }

    /// Warns of an asset in which nothing can move, before its first tile is prepared.
    fn warn_of_no_rigidity(&self) {
        let Asset { device, given, tiles, .. } = self;
        let is_elastic = |maps: &TileMaps| matches!(maps.rigidity, Values::None);
        if given.maps.iter().all(is_elastic) && tiles.iter().any(|state| state.grid(given).is_none()) {
            device.log(LogCode::NoRigidity, None, &[], "no tile has a rigidity, so that nothing moves");
        }
    }

    /// True if charts of a tile continue beyond their borders.
    fn has_collars(&self) -> bool {
        self.given.maps.iter().any(|maps| maps.settings.beyond().is_some())
    }

    /// The new results of tiles, before they are blended; a tile for which a time budget leaves no time has none.
    fn solved(
        &mut self,
        team: &Team,
        crew: &Crew,
        request: &SolveRequest,
        plan: &Plan,
        due: &[bool],
        start: Instant,
    ) -> Result<Vec<TileSolved>> {
        let progress = if self.has_collars() { 1.0 - seams::SHARE } else { 1.0 };
        let Asset { device, mesh, given, tiles, clock, .. } = self;
        let call = SolveCall {
            on: Call { team, device, mesh, given },
            positions: request.positions,
            plan,
            deadline: Deadline::new(start, request.options.time_budget, *clock),
            release_solvers: request.release_solvers,
            progress,
        };
        let states = tiles.iter_mut().filter(|state| due[state.tile]).collect();
        if call.deadline.is_limited() { in_turn(&call, states) } else { side_by_side(&call, crew, states) }
    }

    /// Per tile, whether it keeps the result of an earlier pose because a time budget left no time for it.
    fn late(&self, due: &[bool], solved: &[TileSolved]) -> Vec<bool> {
        let mut late: Vec<bool> = self.tiles.iter().zip(due).map(|(state, due)| *due || state.late).collect();
        solved.iter().for_each(|solved| late[solved.tile()] = false);
        late
    }

    /// All results as they are published: the new ones, and their neighbours, blended with one another.
    fn last(
        &mut self,
        team: &Team,
        request: &SolveRequest,
        asked: &[bool],
        solved: &[TileSolved],
        late: &[bool],
        start: Instant,
    ) -> Result<Last> {
        let of = |new: &TileSolved| (new.tile(), new.solved.clone());
        let mut results: Vec<(usize, Arc<Solved>)> = solved.iter().map(of).collect();
        let new = results.len();
        results.extend(self.neighbours(asked, solved));
        let mut blended = self.blend(team, &results)?;
        if request.options.measure {
            self.measure(team, request.positions, &results[..new], &mut blended)?;
        }
        let solved_ms = ((self.clock)() - start).as_secs_f32() * 1000.0;
        let keep = || KeptPose::new(&self.device, &request.positions, &self.given.maps).map(Arc::new);
        let pose = (self.results.count_carriers(0) > 0).then(keep).transpose()?;
        let mut last = Last { tiles: self.kept(late), solved_ms: Some(solved_ms), pose, ..Last::default() };
        for (k, ((tile, solved), blended)) in results.into_iter().zip(blended).enumerate() {
            let kept = k >= new;
            // Unsolved neighbours are republished only if the blend changed them.
            if let Some(solved) = blended.map(Arc::new).or((!kept).then_some(solved)) {
                last.tiles[tile] = Some(TileResult { solved, kept, late: late[tile] });
            }
        }
        Ok(last)
    }

    /// The last results of tiles that were asked for and have no new one, whose neighbours may have changed at their
    /// seams.
    fn neighbours(&self, asked: &[bool], solved: &[TileSolved]) -> Vec<(usize, Arc<Solved>)> {
        let is_new = |tile: usize| solved.iter().any(|solved| solved.tile() == tile);
        let tiles = (0..self.tiles.len()).filter(|&tile| asked[tile] && !is_new(tile));
        tiles.filter_map(|tile| Some((tile, self.tiles[tile].last.as_ref()?.solved.clone()))).collect()
    }

    /// Drops the results of tiles.
    fn release_results(&mut self, tiles: &[bool]) {
        let last = self.results.last();
        let stays = |(tile, result): (usize, &Option<TileResult>)| result.clone().filter(|_| !tiles[tile]);
        let rest = last.tiles.iter().enumerate().map(stays).collect();
        self.results.replace(Last { tiles: rest, pose: last.pose.clone(), ..*last });
        for (state, _) in self.tiles.iter_mut().zip(tiles).filter(|(_, of)| **of) {
            state.last = None;
            state.blended.free();
        }
    }

    /// The last results, as those of tiles that a solve skips.
    fn kept(&self, late: &[bool]) -> Vec<Option<TileResult>> {
        let last = self.results.last();
        let kept = |(tile, &late): (usize, &bool)| {
            Some(TileResult { kept: true, late, ..last.tiles.get(tile)?.clone()? })
        };
        late.iter().enumerate().map(kept).collect()
    }
}

/// Solves large tiles one after the other on all threads, then small ones side by side.
fn side_by_side(call: &SolveCall, crew: &Crew, tiles: Vec<&mut TileState>) -> Result<Vec<TileSolved>> {
    let mut queue = prepare(call, tiles)?;
    // Longest first, so that no long tile is left for a single thread at the end.
    queue.sort_unstable_by_key(|queued| (Reverse(queued.nodes), queued.state.tile));
    let nodes: Vec<u64> = queue.iter().map(|queued| queued.nodes).collect();
    // A GPU executes submissions in order, so its threads would only submit work.
    let together = if call.on.device.gpu().is_some() { 0 } else { together(&nodes, call.on.team.threads()) };
    let mut units = units(call, queue);
    let (large, small) = units.split_at_mut(together);
    for unit in large {
        solve_unit(call, unit);
        if let Some(Err(error)) = &unit[0].result {
            return Err(error.clone());
        }
    }
    let alone = crew.alone();
    call.on.team.fill_large(small, |_, unit| {
        Team::of(&alone, |team| solve_unit(&SolveCall { on: Call { team, ..call.on }, ..*call }, unit));
    });
    results(units)
}

/// Solves tiles one after the other within a time budget, dividing the remaining time among the remaining tiles. A tile
/// whose turn comes after the end keeps its last result; the first one, and one without a result, is solved all the
/// same.
fn in_turn(call: &SolveCall, tiles: Vec<&mut TileState>) -> Result<Vec<TileSolved>> {
    let mut queue = prepare(call, tiles)?;
    queue.sort_unstable_by_key(|queued| (!queued.state.late, queued.state.tile));
    let nodes = |unit: &Vec<Queued>| unit.iter().map(|queued| queued.nodes).sum::<u64>();
    let mut units = units(call, queue);
    let mut left: u64 = units.iter().map(nodes).sum();
    for (k, unit) in units.iter_mut().enumerate() {
        let deadline = call.deadline.part(nodes(unit) as f64 / left.max(1) as f64);
        left -= nodes(unit);
        let may_keep = k > 0 && unit.iter().all(|queued| queued.state.last.is_some());
        if !(may_keep && call.deadline.is_over()) {
            solve_unit(&SolveCall { deadline, ..*call }, unit);
        }
    }
    results(units)
}

/// The results of tiles, in their order.
fn results(units: Vec<Vec<Queued>>) -> Result<Vec<TileSolved>> {
    let mut queue: Vec<Queued> = units.into_iter().flatten().collect();
    queue.sort_unstable_by_key(|queued| queued.state.tile);
    queue.into_iter().filter_map(|queued| queued.result).collect::<Result<Vec<_>>>()
}

/// Prepares the tiles one after the other, so that the host's log is called on the thread that does the call's work.
fn prepare<'a>(call: &SolveCall, tiles: Vec<&'a mut TileState>) -> Result<Vec<Queued<'a>>> {
    let fresh = tiles.iter().any(|state| state.grid(call.on.given).is_none());
    let (preparing, count) = (if fresh { PREPARING } else { 0.0 }, tiles.len() as f32);
    let mut all = Vec::with_capacity(tiles.len());
    for state in tiles {
        let prepared = state.prepare(call)?;
        all.push((state, prepared));
        if let Some(control) = call.on.team.control() {
            control.advance(call.progress * preparing / count);
        }
    }
    let begun = call.on.team.map(all.len(), |k| all[k].0.begin(call, &all[k].1));
    let queued = |((state, prepared), begun): ((_, Prepared), Begun)| {
        let nodes = prepared.grid.movable.iter().sum();
        Queued { state, prepared, begun, nodes, progress: 0.0, result: None }
    };
    let mut queue: Vec<Queued> = all.into_iter().zip(begun).map(queued).collect();
    // Even an empty tile has a fixed cost.
    let weight = |queued: &Queued| (queued.nodes + 1000) as f32;
    let all: f32 = queue.iter().map(weight).sum();
    for queued in &mut queue {
        queued.progress = call.progress * (1.0 - preparing) * weight(queued) / all;
    }
    Ok(queue)
}
