//! A solve: the host's request, the tiles that it includes, and the publication of all results at once.

use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Instant;

use vrtm_core::allocation::{Collect, Grow, copied, filled, zeroed};
use vrtm_core::control::Control;
use vrtm_core::error::{Error, Result};
use vrtm_core::mesh::Chart;
use vrtm_core::method::plan::Plan;
use vrtm_core::settings::{LogLevel, MAX_THREADS, SolveOptions};
use vrtm_core::team::{Crew, Team};
use vrtm_core::unwind::caught;
use vrtm_core::view::Strided;

use super::Asset;
use super::results::{Last, TileResult, not_solved};
use super::side_by_side;
use super::stretch::Stretch;
use super::tile::{SolveCall, TileState};
use crate::map::FetchKind;
use crate::map::fetch::Output;
use crate::solver::solved::{ChartInput, Solved};
use vrtm_core::grid::maps::Rigidity;
use vrtm_core::image::ImageViewMut;

/// One output of [`Asset::redirect`].
#[derive(Debug)]
pub struct Fetch<'a> {
    /// Index of the tile.
    pub tile: usize,
    /// The kind of image.
    pub kind: FetchKind,
    /// The destination.
    pub image: ImageViewMut<'a>,
}

/// The request for a solve: pose, options and threads. The default solves every tile, on the device's threads.
#[derive(Clone, Debug, Default)]
pub struct SolveRequest<'a> {
    /// The pose: the positions of all vertices.
    pub positions: Strided<'a>,
    /// Quality, limits and solver of this solve.
    pub options: SolveOptions,
    /// CPU threads, at most 1024; `None` = the device's. The result is bit-identical for any number.
    pub threads: Option<NonZeroU32>,
    /// The tiles to solve, in any order; `None` = all. The others keep their results.
    pub tiles: Option<&'a [usize]>,
    /// The vertices that have moved since the last solve, in any order; `None` = any may have. Tiles without a moved
    /// vertex keep their results, unless their maps, settings or the options have changed since, or they have no result.
    pub dirty_vertices: Option<&'a [u32]>,
    /// Drop the results of the tiles to be solved before solving them, which saves their memory, 8 bytes per node of the
    /// blocks in use. They cannot be read until the solve succeeds, and no part of them can be reused.
    pub release_last: bool,
    /// Free the memory of each tile's solver once the tile is solved, about 110 bytes per node of the blocks in use: tiles
    /// that are solved one after the other then need that of one. The next solve has to allocate it again.
    pub release_solvers: bool,
    /// Cancels the call and reports its progress.
    pub control: Option<Arc<Control>>,
}

/// The results of a solve before they are published: the requested outputs are written first, since that can fail.
struct Fresh {
    plan: Plan,
    /// The inputs of the charts' results, for each solved tile.
    inputs: Vec<(usize, Vec<Option<ChartInput>>)>,
    /// The solved tiles' results before the blend at seams.
    solved: Vec<(usize, Arc<Solved>)>,
    /// The results of all tiles.
    last: Last,
}

impl Asset {
    /// Solves every tile for a pose.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a position that is not finite; `OutOfMemory`. The last good result is kept.
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
        for (k, fetch) in fetches.iter().enumerate() {
            self.check_tile(fetch.tile)?;
            let channels = fetch.image.layout.channels;
            fetch.kind.check_channels(format_args!("fetches[{k}].image"), channels)?;
        }
        let crew = self.device.crew(request.threads, request.control.clone());
        self.call(|asset| {
            caught(|| {
                Team::of(&crew, |team| {
                    let fresh = asset.solve_tiles(team, &crew, request, start)?;
                    asset.write(team, &fresh, fetches)?;
                    asset.publish(fresh);
                    if let Some(control) = team.control() {
                        control.tell_end();
                    }
                    Ok(())
                })
            })
        })
    }

    /// Checks a request without side effects.
    #[doc(hidden)]
    pub fn check_request(&self, request: &SolveRequest) -> Result<()> {
        self.check_vertices("positions", &request.positions, 3)?;
        request.options.check()?;
        if let Some(threads) = request.threads.filter(|threads| threads.get() > MAX_THREADS) {
            return Err(Error::argument(format!("options.threads: {threads} is over {MAX_THREADS}")));
        }
        for (k, &tile) in request.tiles.unwrap_or_default().iter().enumerate() {
            if tile >= self.tiles.len() {
                let count = self.tiles.len();
                let message = format!("options.tiles[{k}]: {tile} is out of range, there are {count}");
                return Err(Error::argument(message));
            }
        }
        let vertices = self.mesh.rest.len();
        for (k, &vertex) in request.dirty_vertices.unwrap_or_default().iter().enumerate() {
            if vertex as usize >= vertices {
                return Err(Error::argument(format!(
                    "options.dirty_vertices[{k}]: {vertex} is out of range, the mesh has {vertices} vertices"
                )));
            }
        }
        Ok(())
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
        let asked = self.asked(request);
        let wanted = self.wanted(request, &plan, &asked);
        if request.release_last {
            self.release_results(&wanted);
        }
        let is_elastic = |state: &TileState| matches!(state.maps.rigidity, Rigidity::None);
        if self.tiles.iter().all(is_elastic) && self.tiles.iter().any(|state| state.grid.is_none()) {
            self.device.log(LogLevel::Warning, "no tile has a rigidity, so that nothing moves");
        }
        let maps = self.maps();
        let Asset { device, mesh, tiles, .. } = &mut *self;
        let maps = &maps;
        let (positions, release_solvers) = (request.positions, request.release_solvers);
        let call = SolveCall { team, device, mesh, maps, positions, plan: &plan, start, release_solvers };
        let states = tiles.iter_mut().enumerate().filter(|(tile, _)| wanted[*tile]).collected();
        let mut solved = match request.options.time_budget {
            Some(budget) => side_by_side::in_turn(&call, budget, states)?,
            None => side_by_side::solve(&call, crew, states)?,
        };
        let inputs =
            solved.iter_mut().map(|(tile, solved)| (*tile, std::mem::take(&mut solved.inputs))).collected();
        let mut solved: Vec<(usize, Arc<Solved>)> =
            solved.into_iter().map(|(tile, solved)| (tile, Arc::new(solved))).collected();
        let new = solved.len();
        solved.put_all(self.beside(&asked, &wanted));
        let mut published = self.blend(team, &solved)?;
        if request.options.measure {
            self.measure(team, request.positions, &solved[..new], &mut published)?;
        }
        let each = solved.iter().zip(published).enumerate();
        // What is beside the new results was blended again, where it changes.
        let results = each.filter(|(k, (_, published))| *k < new || published.is_some());
        let published = results
            .map(|(k, ((tile, solved), published))| {
                let solved = published.map_or_else(|| solved.clone(), Arc::new);
                (*tile, TileResult { solved, kept: k >= new })
            })
            .collected();
        solved.truncate(new);
        let solved_ms = start.elapsed().as_secs_f32() * 1000.0;
        let stretch = Stretch::new(&self.mesh, &request.positions);
        stretch.warn(&self.device);
        let fresh = self.fresh(solved, published, inputs, plan, solved_ms, stretch);
        // From here on the call has a result and can no longer be cancelled.
        if let Some(control) = team.control() {
            control.seal_or_unwind();
        }
        Ok(fresh)
    }

    /// Per tile, whether its result may change.
    fn asked(&self, request: &SolveRequest) -> Vec<bool> {
        let mut asked = filled(request.tiles.is_none(), self.tiles.len());
        for &tile in request.tiles.unwrap_or_default() {
            asked[tile] = true;
        }
        self.tiles.iter().zip(&mut asked).for_each(|(state, asked)| *asked &= !state.frozen);
        asked
    }

    /// Per tile, whether it has to be solved.
    fn wanted(&self, request: &SolveRequest, plan: &Plan, asked: &[bool]) -> Vec<bool> {
        let mut wanted = copied(asked);
        if let Some(dirty) = request.dirty_vertices {
            let mut is_dirty = zeroed(self.mesh.rest.len());
            for &vertex in dirty {
                is_dirty[vertex as usize] = true;
            }
            for ((state, tile), wanted) in self.tiles.iter().zip(&self.mesh.tiles).zip(&mut wanted) {
                let tile = state.extended.get().unwrap_or(tile);
                let mut vertices = tile.charts.iter().flat_map(Chart::of_mesh);
                *wanted &= !state.is_solved_with(plan) || vertices.any(|vertex| is_dirty[vertex as usize]);
            }
        }
        wanted
    }

    /// Drops the results of tiles.
    fn release_results(&mut self, tiles: &[bool]) {
        let last = self.results.last();
        let stays = |(tile, result): (usize, &Option<TileResult>)| result.clone().filter(|_| !tiles[tile]);
        let rest = last.tiles.iter().enumerate().map(stays).collected();
        self.results.replace(Last { tiles: rest, solved_ms: last.solved_ms, stretch: last.stretch });
        for (state, _) in self.tiles.iter_mut().zip(tiles).filter(|(_, of)| **of) {
            state.solved = None;
        }
    }

    /// The results of a solve, ready to replace the last ones.
    fn fresh(
        &self,
        solved: Vec<(usize, Arc<Solved>)>,
        published: Vec<(usize, TileResult)>,
        inputs: Vec<(usize, Vec<Option<ChartInput>>)>,
        plan: Plan,
        solved_ms: f32,
        stretch: Stretch,
    ) -> Fresh {
        let last = self.results.last();
        let mut all = filled(None, self.tiles.len());
        for (result, last) in all.iter_mut().zip(&last.tiles) {
            *result = last.as_ref().map(|last| TileResult { solved: last.solved.clone(), kept: true });
        }
        for (tile, result) in published {
            all[tile] = Some(result);
        }
        Fresh { plan, inputs, solved, last: Last { tiles: all, solved_ms: Some(solved_ms), stretch } }
    }

    /// Writes outputs of results that are not yet published.
    fn write(&self, team: &Team, fresh: &Fresh, fetches: &mut [Fetch]) -> Result<()> {
        let output = |fetch: &Fetch| {
            let result = fresh.last.tiles[fetch.tile].as_ref().ok_or_else(not_solved)?;
            Output::new(&self.mesh, &result.solved, fetch.kind, &fetch.image.whole(), &fetch.image.layout)
        };
        // All memory is allocated first, so that no output is written if memory runs short.
        let outputs: Vec<Output> = fetches.iter().map(output).try_collected()?;
        for (fetch, output) in fetches.iter_mut().zip(outputs) {
            self.results.write(team, output, &mut fetch.image)?;
        }
        Ok(())
    }

    /// Replaces the last results, all at once. Cannot fail.
    fn publish(&mut self, fresh: Fresh) {
        for ((tile, inputs), (_, solved)) in fresh.inputs.into_iter().zip(fresh.solved) {
            self.tiles[tile].take(solved, inputs, &fresh.plan);
        }
        self.results.replace(fresh.last);
    }
}
