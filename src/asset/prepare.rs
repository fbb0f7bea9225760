//! Prepares a tile: its maps and settings, the grid that follows from them, its estimate, and saved grids.

use std::sync::Arc;
use std::time::Instant;

use crate::device::Device;
use vrtm_beyond::extended;
use vrtm_core::error::Result;
use vrtm_core::grid::gutter::Gutter;
use vrtm_core::grid::maps::{MapsOfTile, Mask, Rigidity, TileMaps};
use vrtm_core::grid::repaint::{Repainted, repaint};
use vrtm_core::grid::survey::Survey;
use vrtm_core::grid::{Grid, build, saved};
use vrtm_core::image::map::TexelRect;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::method::plan::Purpose;
use vrtm_core::report::{TileEstimate, TileInfo, report};
use vrtm_core::settings::{LogLevel, Seams, Solver, TileSettings};
use vrtm_core::team::Team;
use vrtm_core::unwind::caught;

use super::tile::{Prepared, SolveCall, TileState};
use super::torn::{self, Torn};
use crate::solver::TileSolver;
use crate::solver::solved::Solved;

impl TileState {
    /// Sets the rigidity. The grid is rebuilt at the next solve if the rigidity differs, which is returned.
    pub fn set_rigidity(&mut self, rigidity: Rigidity) -> bool {
        let differs = self.maps.rigidity != rigidity;
        if differs {
            self.maps.rigidity = rigidity;
            self.grid = None;
            self.solved_with = None;
            self.torn.iter_mut().for_each(Torn::forget_grid);
        }
        differs
    }

    /// The tile's grid after some texels of the rigidity map have changed; `None` if there is no grid, or if other nodes may
    /// move than before.
    pub fn repainted(&self, team: &Team, tile: &TileMesh, texels: &TexelRect) -> Result<Option<Repainted>> {
        let tile = self.extended.get().map_or(tile, |extended| extended);
        caught(|| match (&self.maps.rigidity, &self.grid) {
            (Rigidity::Map(map), Some(grid)) => Ok(repaint(team, grid, tile, &self.maps, map, texels)),
            _ => Ok(None),
        })
    }

    /// Takes over what `repainted` found. `start` is when the map was changed.
    pub fn take_repainted(&mut self, device: &Device, repainted: Option<Repainted>, start: Instant) {
        self.solved_with = None;
        self.torn.iter_mut().for_each(Torn::forget_grid);
        if self.grid.take().is_none() {
            return;
        }
        if let Some(repainted) = repainted {
            let inputs = self.inputs.iter_mut().zip(&repainted.charts);
            inputs.filter(|(_, changed)| **changed).for_each(|(input, _)| *input = None);
            self.grid = Some(Arc::new(repainted.grid));
            if device.gpu().is_some() {
                // A GPU's memory holds the rigidity of the grid that it was made for.
                self.forget(device);
            }
        }
        self.build_ms += start.elapsed().as_secs_f32() * 1000.0;
    }

    /// Sets the mask. The grid is rebuilt at the next solve if the mask differs, which is returned.
    pub fn set_mask(&mut self, mask: Mask) -> bool {
        let differs = self.maps.mask != mask;
        if differs {
            self.maps.mask = mask;
            self.grid = None;
            self.solved_with = None;
            self.torn.iter_mut().for_each(Torn::forget_grid);
        }
        differs
    }

    /// Changes the settings. The grid is rebuilt at the next solve if it depends on the change. Returns whether the grid's
    /// size has changed, at which others read this tile's maps.
    pub fn set_settings(&mut self, settings: &TileSettings) -> bool {
        let of_grid = |maps: &TileMaps| {
            let TileSettings { overlap, seams, smoothness, smoothness_floor, orientation_density, .. } =
                maps.settings;
            let keeps = seams == Seams::Keep;
            (maps.grid_size(), overlap, keeps, smoothness, smoothness_floor, orientation_density > 0.0)
        };
        let grid_before = of_grid(&self.maps);
        let before = std::mem::replace(&mut self.maps.settings, *settings);
        if before != *settings {
            self.solved_with = None;
        }
        let goes_on = before.beyond() != settings.beyond();
        if goes_on {
            self.extended.take();
            self.gutter = None;
        }
        if goes_on || of_grid(&self.maps) != grid_before {
            self.grid = None;
            self.torn.iter_mut().for_each(Torn::forget_grid);
        } else if before != *settings {
            // The grid is the same but the weights differ: no result can be reused.
            self.inputs.fill(None);
        }
        self.maps.grid_size() != grid_before.0
    }

    /// The tile as it is solved: with collars, if charts go on beyond their borders.
    pub(crate) fn source(&self, team: &Team, mesh: &Mesh, tile: usize) -> Arc<TileMesh> {
        if self.maps.settings.beyond().is_none() {
            return mesh.tiles[tile].clone();
        }
        self.extended.get_or_init(|| self.new_source(team, mesh, tile)).clone()
    }

    fn new_source(&self, team: &Team, mesh: &Mesh, tile: usize) -> Arc<TileMesh> {
        match self.maps.settings.beyond() {
            None => mesh.tiles[tile].clone(),
            Some(beyond) => Arc::new(extended(team, mesh, tile, &beyond)),
        }
    }

    /// Drops what depends on the maps of another tile, if the tile's collars lie there.
    pub fn forget_maps_of(&mut self, tile: usize) {
        let is_there = |mesh: &Arc<TileMesh>| mesh.sources.iter().any(|source| source.tile as usize == tile);
        if self.extended.get().is_some_and(is_there) {
            self.copies = None;
            self.grid = None;
            self.solved_with = None;
        }
    }

    /// The tile's grid; builds it if necessary.
    pub fn grid(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
    ) -> Result<Arc<Grid>> {
        if let Some(grid) = &self.grid {
            return Ok(grid.clone());
        }
        let source = &self.source(team, mesh, tile);
        let grid = self.build(team, device, mesh, source, maps)?;
        if grid.overlap > 0.0 {
            let percent = 100.0 * grid.overlap;
            device.log(
                LogLevel::Warning,
                &format!(
                    "{}: {percent:.2} % of it is overlapped, and what charts share does not move in one map",
                    source.name()
                ),
            );
        }
        if grid.at_gaps > 0 {
            let message = format!(
                "{}: {} nodes are fixed at gaps in the UVs that welding closes: if they are none, give UVs with less noise",
                source.name(),
                grid.at_gaps
            );
            device.log(LogLevel::Warning, &message);
        }
        let message = format!(
            "{}: {} nodes of {} x {} cells may move, {:.1} % of its rigid texels are frozen, {:.1} % overlapped, {:.1} % may move",
            source.name(),
            grid.movable.iter().sum::<u64>(),
            grid.levels[0].nx,
            grid.levels[0].ny,
            100.0 * grid.frozen(),
            100.0 * grid.rigid_sum(|of| of.overlapped) as f32 / grid.rigid_sum(|of| of.rigid).max(1) as f32,
            100.0 * (1.0 - grid.frozen())
        );
        device.log(LogLevel::Info, &message);
        self.grid = Some(grid.clone());
        self.copies = None;
        if let Err(error) = self.book(device, 0, source) {
            self.grid = None;
            return Err(error);
        }
        Ok(grid)
    }

    /// Builds a grid. Its memory is booked before it is allocated.
    fn build(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        source: &TileMesh,
        maps: &[TileMaps],
    ) -> Result<Arc<Grid>> {
        let start = Instant::now();
        // The solver's memory is for another grid and no longer useful.
        self.forget(device);
        let of_tile = MapsOfTile { own: &self.maps, all: maps };
        let survey = Survey::new(team, source, of_tile, self.maps.grid_size());
        self.book(device, survey.grid_bytes(), source)?;
        if survey.has_rigid_nodes() && survey.movable.iter().all(|&count| count == 0) {
            let message = format!("{}: it has rigid texels, but nothing that may move", source.name());
            device.log(LogLevel::Warning, &message);
        }
        let grid = Arc::new(build::grid(team, mesh, MapsOfTile { own: &self.maps, all: maps }, survey));
        self.build_ms = start.elapsed().as_secs_f32() * 1000.0;
        Ok(grid)
    }

    /// The tile with the connectivity of a pose, and its grid; builds the grid if necessary.
    pub(super) fn prepare(&mut self, call: &SolveCall, tile: usize) -> Result<Prepared> {
        let whole = &call.mesh.tiles[tile];
        let torn = torn::welds(call.mesh, whole, &call.positions);
        if torn != self.torn_now {
            let (count, of) = (torn.len(), whole.welds.len());
            let message = format!("{}: the pose tears {count} of {of} welded edges", whole.name());
            let level = if count > 0 { LogLevel::Warning } else { LogLevel::Info };
            call.device.log(level, &message);
        }
        self.torn_now = torn;
        if self.torn_now.is_empty() {
            let grid = self.grid(call.team, call.device, call.mesh, tile, call.maps)?;
            let mesh = self.source(call.team, call.mesh, tile);
            return Ok(Prepared { mesh, own: whole.clone(), grid });
        }
        let kept = self.torn.take().filter(|kept| kept.is(&self.torn_now));
        let mut torn = kept.unwrap_or_else(|| Torn::new(whole, &self.torn_now));
        let source = torn.mesh.clone();
        if let Some(grid) = torn.grid.clone() {
            self.torn = Some(torn);
            return Ok(Prepared { mesh: source.clone(), own: source, grid });
        }
        let grid = self.build(call.team, call.device, call.mesh, &source, &[])?;
        torn.grid = Some(grid.clone());
        self.torn = Some(torn);
        if let Err(error) = self.book(call.device, Solved::bytes_for(&grid), &source) {
            self.torn = None;
            return Err(error);
        }
        Ok(Prepared { mesh: source.clone(), own: source, grid })
    }

    /// Bytes that `save` writes for the prepared tile; prepares it if necessary.
    pub fn saved_size(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
    ) -> Result<usize> {
        self.grid(team, device, mesh, tile, maps).map(|grid| saved::size(&grid))
    }

    /// Writes the prepared tile to a buffer of `saved_size` bytes.
    pub fn save(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
        out: &mut [u8],
    ) -> Result<()> {
        let grid = self.grid(team, device, mesh, tile, maps)?;
        let of_tile = MapsOfTile { own: &self.maps, all: maps };
        saved::save(&grid, saved::key(mesh, &self.source(team, mesh, tile), of_tile), out);
        Ok(())
    }

    /// Loads a prepared tile that was saved with the same mesh, maps and settings.
    pub fn load(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
        data: &[u8],
    ) -> Result<()> {
        let source = &self.source(team, mesh, tile);
        let key = saved::key(mesh, source, MapsOfTile { own: &self.maps, all: maps });
        let grid = saved::load(team, data, key, mesh, source, |bytes| self.book(device, bytes, source));
        let loaded = grid.and_then(|grid| {
            self.forget(device);
            self.copies = None;
            let before = self.grid.replace(Arc::new(grid));
            self.book(device, 0, source).inspect_err(|_| self.grid = before)
        });
        if loaded.is_err() {
            // Releases the booked memory of the old grid: booking less always succeeds.
            let _ = self.book(device, 0, source);
        }
        loaded
    }

    /// The memory for preparing and solving the tile, estimated from a survey alone.
    pub fn estimate(
        &self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
    ) -> Result<TileEstimate> {
        // Nothing is kept.
        let source = &match self.extended.get() {
            Some(extended) => extended.clone(),
            None => self.new_source(team, mesh, tile),
        };
        let of_tile = MapsOfTile { own: &self.maps, all: maps };
        let survey = Survey::new(team, source, of_tile, self.maps.grid_size());
        let (grid_bytes, parts) = (survey.grid_bytes(), survey.bytes());
        let grid = build::skeleton(survey);
        let result = Solved::bytes_for(&grid);
        let solver =
            TileSolver::bytes_for(device, &grid, source, Purpose::new(Solver::Descent, &self.maps.settings))?;
        let prepared = self.map_bytes() + grid_bytes;
        // What is published is a result of its own.
        let beyond = if source.sources.is_empty() { 0 } else { Gutter::BYTES + result };
        Ok(report!(TileEstimate {
            movable_nodes: grid.movable.iter().sum(),
            prepared_bytes: prepared,
            // Level 1 needs temporary metrics and edge lengths while the grid is built.
            preparing_bytes: prepared + parts + grid_bytes / 5,
            // The last result is kept until the next one exists.
            solving_bytes: prepared + solver + 2 * result + beyond,
        }))
    }

    /// Facts about the tile that need no solve.
    pub fn info(
        &mut self,
        team: &Team,
        device: &Device,
        mesh: &Mesh,
        tile: usize,
        maps: &[TileMaps],
    ) -> Result<TileInfo> {
        let grid = self.grid(team, device, mesh, tile, maps)?;
        let source = &mesh.tiles[tile];
        Ok(report!(TileInfo {
            udim: source.udim,
            layer: source.layer,
            layers: mesh.layers(tile).len() as u32,
            charts: source.charts.len() as u32,
            triangles: source.triangles.len() as u64,
            grid: [grid.levels[0].nx as u32, grid.levels[0].ny as u32],
            movable_nodes: grid.movable.iter().sum(),
            overlap: grid.overlap,
            frozen: grid.frozen(),
            rigid_nodes: grid.rigid_sum(|square| square.rigid),
            rigid_overlapped: grid.rigid_sum(|square| square.overlapped),
            gap_nodes: grid.at_gaps,
            uv_set: source.uv_set,
            border_edges: source.border_edges(),
            welded_edges: source.welds.len() as u64,
            edges_apart: source.edges_apart,
        }))
    }
}
