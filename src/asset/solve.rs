//! A solve: the tiles that a request includes, all threads on large ones and one thread on each of the others, and the
//! publication of all results at once.

use std::cmp::Reverse;
use std::sync::Arc;
use std::time::Duration;

use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::grid::maps::{TileMaps, Values};
use vrtm_core::log::LogCode;
use vrtm_core::mesh::Chart;
use vrtm_core::method::plan::Plan;
use vrtm_core::settings::SolveOptions;
use vrtm_core::team::{Crew, Team};
use vrtm_core::unwind::caught;
use vrtm_core::view::Strided;

use super::Asset;
use super::after;
use super::outputs::Fetch;
use super::request::SolveRequest;
use super::results::{KeptPose, Last, TileResult};
use super::shape::{Call, Prepared};
use super::side_by_side::together;
use super::solver::SolveCall;
use super::stretch::Stretch;
use super::tile::{Begun, TileSolved, TileState};
use super::together::{Queued, solve as solve_unit, units};
use crate::solved::Solved;

/// The share of a call's progress for preparing its tiles, if any tile needs it.
const PREPARING: f32 = 0.3;

/// The results of a solve before they are published: the requested outputs are written first, since that can fail.
struct Fresh {
    /// Of the solved tiles.
    solved: Vec<TileSolved>,
    /// The results of all tiles.
    last: Last,
}

impl Asset {
    /// Solves every tile for a pose.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a position that is not finite; `OutOfMemory`. The last good result is
    /// kept.
    pub fn solve(&mut self, positions: Strided, options: &SolveOptions) -> Result<()> {
        self.redirect(positions, options, &mut [])
    }

    /// Solves and fetches in one call: all arguments are checked before anything is written.
    ///
    /// # Errors
    /// Those of [`Asset::solve`] and [`Asset::fetch`].
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
    /// `InvalidArgument` for a wrong count, a position that is not finite, an unknown tile or vertex; `Cancelled`;
    /// `OutOfMemory`; those of [`Asset::fetch`]. The last good results are kept.
    pub fn run(&mut self, request: &SolveRequest, fetches: &mut [Fetch]) -> Result<()> {
        let start = Instant::now();
        self.check_request(request)?;
        self.results.check_fetches(fetches)?;
        let crew = self.device.crew(request.threads, request.control.clone());
        self.device.clone().call(|| {
            caught(|| {
                Team::of(&crew, |team| {
                    let fresh = self.solve_tiles(team, &crew, request, start)?;
                    self.results.write_all(team, &fresh.last, fetches)?;
                    self.publish(fresh);
                    if let Some(control) = team.control() {
                        control.tell_end();
                    }
                    Ok(())
                })
            })
        })
    }

    fn solve_tiles(
        &mut self,
        team: &Team,
        crew: &Crew,
        request: &SolveRequest,
        start: Instant,
    ) -> Result<Fresh> {
        let _working = team.control().map(|control| control.begin());
        team.check_or_unwind();
        let plan = Plan::new(&request.options);
        let may_solve = self.may_solve(request);
        let must_solve = self.must_solve(request, &plan, &may_solve);
        if request.release_last {
            self.release_results(&must_solve);
        }
        let Asset { device, mesh, given, tiles, after, .. } = &mut *self;
        let is_elastic = |maps: &TileMaps| matches!(maps.rigidity, Values::None);
        if given.maps.iter().all(is_elastic) && tiles.iter().any(|state| state.grid(given).is_none()) {
            let message = "no tile has a rigidity, so that nothing moves";
            device.log(LogCode::NoRigidity, None, &[], message);
        }
        let has_seams = given.maps.iter().any(|maps| maps.settings.beyond().is_some());
        // Collars read maps as the grids of other tiles do.
        let sized = (0..must_solve.len()).filter(|&tile| must_solve[tile] || has_seams);
        given.find_sizes(team, mesh, sized, device);
        let call = SolveCall {
            on: Call { team, device, mesh, given },
            positions: request.positions,
            plan: &plan,
            start,
            release_solvers: request.release_solvers,
            budget: None,
            progress: if has_seams { 1.0 - after::SHARE } else { 1.0 },
            learns: true,
        };
        let states = tiles.iter_mut().filter(|state| must_solve[state.tile]).collect();
        let solved = match request.options.time_budget {
            Some(budget) => in_turn(&call, budget.saturating_sub(after.of(budget)), states)?,
            None => solve(&call, crew, states)?,
        };
        let begin = Instant::now();
        let of = |new: &TileSolved| (new.tile(), new.solved.clone());
        let mut results: Vec<(usize, Arc<Solved>)> = solved.iter().map(of).collect();
        results.extend(self.beside(&may_solve, &must_solve));
        let has_time = request.options.time_budget.is_none_or(|budget| self.after.has_time(budget));
        let (new, mut published) = (solved.len(), self.blend(team, &results, has_time)?);
        let blended = begin.elapsed();
        let is_still = results.iter().all(|(_, solved)| solved.report.max_displacement == 0.0);
        if request.options.measure {
            self.measure(team, request.positions, &results[..new], &mut published)?;
        }
        let solved_ms = start.elapsed().as_secs_f32() * 1000.0;
        let stretch = Stretch::new(&self.mesh, &request.positions);
        stretch.warn(&self.device);
        let keep = || KeptPose::new(&self.device, &request.positions, &self.given.maps).map(Arc::new);
        let pose = (self.results.count_carriers(0) > 0).then(keep).transpose()?;
        let mut last = Last { tiles: self.kept(), solved_ms: Some(solved_ms), stretch, pose };
        for (k, ((tile, solved), published)) in results.into_iter().zip(published).enumerate() {
            let kept = k >= new;
            // What is beside the new results was blended again, where it changes.
            if let Some(solved) = published.map(Arc::new).or((!kept).then_some(solved)) {
                last.tiles[tile] = Some(TileResult { solved, kept });
            }
        }
        self.after.rest = begin.elapsed().saturating_sub(blended);
        if request.options.time_budget.is_some() && (is_still || !has_time) {
            self.after = self.after.less();
        }
        // From here on the call has a result and can no longer be cancelled.
        if let Some(control) = team.control() {
            control.seal_or_unwind();
        }
        Ok(Fresh { solved, last })
    }

    /// Per tile, whether its result may change.
    fn may_solve(&self, request: &SolveRequest) -> Vec<bool> {
        let mut may_solve = vec![request.tiles.is_none(); self.tiles.len()];
        for &tile in request.tiles.unwrap_or_default() {
            may_solve[tile] = true;
        }
        self.given.frozen.iter().zip(&mut may_solve).for_each(|(frozen, may_solve)| *may_solve &= !frozen);
        may_solve
    }

    /// Per tile, whether it has to be solved.
    fn must_solve(&self, request: &SolveRequest, plan: &Plan, may_solve: &[bool]) -> Vec<bool> {
        let mut must_solve = Vec::from(may_solve);
        if let Some(dirty) = request.dirty_vertices {
            let mut is_dirty = zeroed(self.mesh.rest.len());
            for &vertex in dirty {
                is_dirty[vertex as usize] = true;
            }
            for (state, must_solve) in self.tiles.iter().zip(&mut must_solve) {
                let last = state.last.as_ref().filter(|last| last.is_of(plan, &self.given));
                *must_solve &= last.is_none_or(|TileSolved { solved, .. }| {
                    let charts = &solved.extended.as_ref().unwrap_or(&solved.mesh).charts;
                    charts.iter().flat_map(Chart::of_mesh).any(|vertex| is_dirty[vertex as usize])
                });
            }
        }
        must_solve
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
    fn kept(&self) -> Vec<Option<TileResult>> {
        let last = self.results.last();
        let kept = |tile: usize| Some(TileResult { kept: true, ..last.tiles.get(tile)?.clone()? });
        (0..self.tiles.len()).map(kept).collect()
    }

    /// Replaces the last results, all at once. Cannot fail.
    fn publish(&mut self, fresh: Fresh) {
        for solved in fresh.solved {
            let tile = solved.tile();
            self.tiles[tile].last = Some(solved);
        }
        self.results.replace(fresh.last);
    }
}

/// Solves tiles.
fn solve(call: &SolveCall, crew: &Crew, tiles: Vec<&mut TileState>) -> Result<Vec<TileSolved>> {
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
        Team::of(&alone, |team| {
            let on = Call { team, ..call.on };
            solve_unit(&SolveCall { on, learns: false, ..*call }, unit);
        });
    });
    results(units)
}

/// The results of tiles, in their order.
fn results(units: Vec<Vec<Queued>>) -> Result<Vec<TileSolved>> {
    let mut queue: Vec<Queued> = units.into_iter().flatten().collect();
    queue.sort_unstable_by_key(|queued| queued.state.tile);
    queue.into_iter().filter_map(|queued| queued.result).collect::<Result<Vec<_>>>()
}

/// Solves tiles one after the other within a time budget, dividing the remaining time among the remaining tiles. A GPU
/// solves together what it can.
fn in_turn(call: &SolveCall, budget: Duration, tiles: Vec<&mut TileState>) -> Result<Vec<TileSolved>> {
    if call.on.device.gpu().is_some() {
        let mut units = units(call, prepare(call, tiles)?);
        let nodes = |unit: &Vec<Queued>| unit.iter().map(|queued| queued.nodes).sum::<u64>();
        let mut left = units.iter().map(nodes).sum();
        for unit in &mut units {
            let budget = Some(share(call, budget, nodes(unit), &mut left));
            solve_unit(&SolveCall { budget, ..*call }, unit);
        }
        return results(units);
    }
    // Nothing is known yet of a tile without a grid.
    let movable = |state: &TileState| state.grid(call.on.given).map_or(0, |grid| grid.movable.iter().sum());
    let mut left: u64 = tiles.iter().map(|state| movable(state)).sum();
    let progress = call.progress / tiles.len() as f32;
    let mut solved = Vec::with_capacity(tiles.len());
    for state in tiles {
        let budget = Some(share(call, budget, movable(state), &mut left));
        let prepared = state.prepare(call)?;
        let call = SolveCall { budget, progress, ..*call };
        let mut begun = state.begin(&call, &prepared);
        solved.push(state.solve(&call, &prepared, &mut begun)?);
    }
    Ok(solved)
}

/// The time, from the call's start, by which some tiles are to be solved: their share of what is left of the budget.
fn share(call: &SolveCall, budget: Duration, own: u64, left: &mut u64) -> Duration {
    let spent = call.start.elapsed();
    let part = if own < *left { own as f64 / *left as f64 } else { 1.0 };
    *left -= own.min(*left);
    spent.saturating_add(budget.saturating_sub(spent).mul_f64(part))
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
