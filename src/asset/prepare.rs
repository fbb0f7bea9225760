//! Prepares a tile before it is solved; its estimate, facts, and saved grids.

use std::sync::Arc;

use crate::device::Device;
use vrtm_beyond::Copies;
use vrtm_beyond::gutter::Gutter;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::grid::pieces::resolving;
use vrtm_core::grid::survey::Survey;
use vrtm_core::grid::{Grid, build, saved};
use vrtm_core::log::LogCode;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::plan::Purpose;
use vrtm_core::report::{TileEstimate, TileInfo, report};
use vrtm_core::settings::Solver;

use super::given::{Call, Change, Given};
use super::room;
use super::shape::{Built, Prepared, Shape, ShapeKey, new_mesh};
use super::tile::TileState;
use crate::solved::Solved;

impl TileState {
    /// The key of the tile's triangles.
    fn shape_key(&self, given: &Given, welds: &[u32]) -> ShapeKey {
        let beyond = given.maps[self.tile].settings.beyond();
        // Charts of a tile that a pose tears do not go on.
        let beyond = beyond.filter(|_| welds.is_empty()).map(|beyond| (beyond, given.stay(self.tile)));
        (beyond, Vec::from(welds))
    }

    /// The tile with these welds torn, with collars if its charts go on beyond their borders. Nothing is kept.
    pub fn mesh(&self, call: &Call, welds: &[u32]) -> Arc<TileMesh> {
        let key = self.shape_key(call.given, welds);
        let known = self.whole.known(&key).or(self.torn.known(&key));
        known.map_or_else(|| new_mesh(call, self.tile, &key), |shape| shape.mesh.clone())
    }

    /// The tile with these welds torn, and what is made for that.
    fn shape(&mut self, call: &Call, welds: &[u32]) -> Result<&mut Shape> {
        let (tile, key) = (self.tile, self.shape_key(call.given, welds));
        let shape = if welds.is_empty() { &mut self.whole } else { &mut self.torn };
        shape.get(call.device, key, |key, _| Ok(Shape::new(new_mesh(call, tile, key), call.mesh.tiles.len())))
    }

    /// Books the triangles of the tile, which an estimate does not; they are gone if there is no room.
    fn book_shape(&mut self, call: &Call, welds: &[u32]) -> Result<()> {
        let own = &call.mesh.tiles[self.tile];
        let mesh = self.shape(call, welds)?.mesh.clone();
        let shape = if welds.is_empty() { &mut self.whole } else { &mut self.torn };
        let bytes = if Arc::ptr_eq(&mesh, own) { 0 } else { mesh.bytes() };
        let booked = shape.book(bytes, &own.name());
        if booked.is_err() {
            shape.free();
        }
        booked
    }

    /// The tile with these welds torn, and its grid; builds it if it is not there.
    pub fn prepared(&mut self, call: &Call, welds: &[u32]) -> Result<Prepared> {
        let (tile, own, is_whole) = (self.tile, &call.mesh.tiles[self.tile], welds.is_empty());
        self.maps.set(call.given.bytes(call.mesh, tile), &own.name())?;
        self.book_shape(call, welds)?;
        let shape = self.shape(call, welds)?;
        let is_repainted = shape.repaint(call);
        let key = call.given.grid_key(tile, shape.beyond.iter().copied());
        if shape.grid.known(&key).is_none() {
            // Memory for another grid is of no more use.
            self.free_solvers();
            if is_whole {
                self.copies.free();
                self.blended.free();
            }
        }
        let Shape { mesh, grid, .. } = self.shape(call, welds)?;
        let built = grid.get(call.device, key.clone(), |key, booked| {
            let built = Built::new(call, key, mesh, booked)?;
            if is_whole {
                describe(call.device, own, &built.grid);
                compare(call, key.tile);
            }
            Ok(built)
        })?;
        if is_repainted {
            describe_rigidity(call.device, own, &built.grid);
        }
        Ok(Prepared { mesh: mesh.clone(), grid: built.grid.clone(), key, since: built.since.clone() })
    }

    /// The tile's grid, if it need not be built anew.
    pub fn grid(&self, given: &Given) -> Option<&Grid> {
        let (key, built) = self.whole.known(&self.shape_key(given, &[]))?.grid.last()?;
        (!matches!(given.change_since(key), Change::Other)).then_some(&*built.grid)
    }

    /// The room for redirections beside charts, and the time for the grid that was not yet reported, of the tile that
    /// was prepared last.
    pub fn gutter_and_ms(&mut self, call: &Call, is_torn: bool) -> Result<(Option<Arc<Gutter>>, f32)> {
        let shape = if is_torn { &mut self.torn } else { &mut self.whole };
        let Some(shape) = shape.last_mut() else { return Ok((None, 0.0)) };
        let gutter = shape.gutter(call)?;
        Ok((gutter, shape.grid.last_mut().map_or(0.0, |built| std::mem::take(&mut built.ms))))
    }

    /// Bytes that `save` writes for the prepared tile; prepares it if necessary.
    pub fn saved_size(&mut self, call: &Call) -> Result<usize> {
        self.prepared(call, &[]).map(|prepared| saved::size(&prepared.grid))
    }

    /// Writes the prepared tile to a buffer of `saved_size` bytes.
    pub fn save(&mut self, call: &Call, out: &mut [u8]) -> Result<()> {
        let Prepared { mesh, grid, .. } = self.prepared(call, &[])?;
        saved::save(&grid, saved::key(call.mesh, &mesh, call.given.of(self.tile)), out);
        Ok(())
    }

    /// Loads a prepared tile that was saved with the same mesh, maps and settings.
    pub fn load(&mut self, call: &Call, data: &[u8]) -> Result<()> {
        let tile = self.tile;
        let name = call.mesh.tiles[tile].name();
        self.maps.set(call.given.bytes(call.mesh, tile), &name)?;
        let shape = self.shape(call, &[])?;
        let hash = saved::key(call.mesh, &shape.mesh, call.given.of(tile));
        let mut booked = call.device.booking();
        let book = |bytes: u64| booked.set(bytes, &name);
        let grid = saved::load(call.team, data, hash, call.mesh, &shape.mesh, book)?;
        room::of_grid(call, tile, &shape.mesh, &grid)?;
        let key = call.given.grid_key(tile, shape.beyond.iter().copied());
        let built = Built::of(grid, key.generation, 0.0);
        built.book(&mut booked, &name)?;
        shape.grid.put(key, built, booked);
        Ok(())
    }

    /// The memory for preparing and solving the tile, estimated from a survey alone. Collars are kept.
    pub fn estimate(&mut self, call: &Call) -> Result<TileEstimate> {
        let (mesh, given) = (&self.shape(call, &[])?.mesh.clone(), call.given);
        let maps = &given.maps[self.tile];
        let survey = Survey::new(call.team, mesh, given.of(self.tile), maps.grid_size());
        room::of_survey(call, self.tile, &survey)?;
        let (grid_bytes, parts) = (survey.grid_bytes(), survey.bytes());
        let grid = build::skeleton(survey);
        let result = Solved::bytes_for(&grid);
        let purpose = Purpose::new(Solver::Descent, &maps.settings);
        let solver = call.device.solver_bytes(&grid, &[&**mesh], purpose);
        let has_collars = !mesh.sources.is_empty();
        let collars = if has_collars { mesh.bytes() } else { 0 };
        let prepared = given.bytes(call.mesh, self.tile) + collars + grid_bytes;
        // With collars the published result is one of its own, beside the solver's.
        let [copies, depths] = if has_collars { Copies::bytes_for(mesh, &grid) } else { [0; 2] };
        let beyond = if has_collars { Gutter::BYTES + result + copies + depths } else { 0 };
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
    pub fn info(&mut self, call: &Call) -> Result<TileInfo> {
        let (own, grid) = (&call.mesh.tiles[self.tile], self.prepared(call, &[])?.grid);
        Ok(report!(TileInfo {
            udim: own.udim,
            layer: own.layer,
            layers: call.mesh.layers(self.tile).len() as u32,
            charts: own.charts.len() as u32,
            triangles: own.triangles.len() as u64,
            grid: [grid.levels[0].nx as u32, grid.levels[0].ny as u32],
            movable_nodes: grid.movable.iter().sum(),
            overlap: grid.overlap,
            fixed: grid.fixed(),
            rigid_nodes: grid.rigid_sum(|square| square.rigid),
            rigid_overlapped: grid.rigid_sum(|square| square.overlapped),
            gap_nodes: grid.at_gaps,
            uv_set: own.uv_set,
            border_edges: own.border_edges(),
            welded_edges: own.welds.len() as u64,
            edges_apart: own.edges_apart,
        }))
    }
}

/// Tells of a grid that was asked for and has a quarter of the cells on a side that resolve the rigidity, or four times
/// as many.
fn compare(call: &Call, tile: usize) {
    let maps = &call.given.maps[tile];
    if !call.device.has_log() || maps.settings.grid == [None; 2] {
        return;
    }
    let (tile, rigidity) = (&call.mesh.tiles[tile], &maps.rigidity);
    let Some(cells) = resolving(call.team, tile, rigidity, None, &mut None) else { return };
    let [width, height] = maps.grid_size().map(|cells| cells as u32);
    let (code, what) = if 4 * width.min(height) <= cells {
        (LogCode::GridTooCoarse, "are too few")
    } else if width.max(height) >= 4 * cells {
        (LogCode::GridTooFine, "take time and gain little")
    } else {
        return;
    };
    let message = format!("{width} x {height} cells {what}: {cells} x {cells} resolve its rigid features");
    call.device.log(code, Some(tile), &[width, height, cells].map(f64::from), &message);
}

fn describe(device: &Device, tile: &TileMesh, grid: &Grid) {
    if grid.overlap > 0.0 {
        let percent = 100.0 * grid.overlap;
        let message =
            format!("{percent:.2} % of it is overlapped, and what charts share does not move in one map");
        device.log(LogCode::Overlap, Some(tile), &[grid.overlap.into()], &message);
    }
    if grid.at_gaps > 0 {
        let message = format!(
            "{} nodes are fixed at gaps in the UVs that welding closes: if they are none, give UVs with less noise",
            grid.at_gaps
        );
        device.log(LogCode::NodesAtGaps, Some(tile), &[grid.at_gaps as f64], &message);
    }
    describe_rigidity(device, tile, grid);
}

/// Tells how much of what is rigid may move.
fn describe_rigidity(device: &Device, tile: &TileMesh, grid: &Grid) {
    let rigid = grid.rigid_sum(|of| of.rigid);
    let fixed = if rigid > 0 { grid.fixed() } else { 0.0 };
    let overlapped = grid.rigid_sum(|of| of.overlapped) as f32 / rigid.max(1) as f32;
    let of_rigid = match rigid {
        0 => "nothing is rigid".to_owned(),
        _ => format!(
            "{:.1} % of its rigid texels are fixed, {:.1} % overlapped, {:.1} % may move",
            100.0 * fixed,
            100.0 * overlapped,
            100.0 * (1.0 - fixed)
        ),
    };
    let (movable, level) = (grid.movable.iter().sum::<u64>(), &grid.levels[0]);
    let message = format!("{movable} nodes of {} x {} cells may move, {of_rigid}", level.nx, level.ny);
    let values = [movable as f64, level.nx as f64, level.ny as f64, fixed.into(), overlapped.into()];
    device.log(LogCode::Grid, Some(tile), &values, &message);
}
