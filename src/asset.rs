//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

mod backend;
mod fetch;
mod measure;
#[cfg(feature = "oracle")]
mod oracle;
mod output;
#[cfg(all(feature = "oracle", feature = "gpu"))]
mod parity;
#[cfg(feature = "gpu")]
mod on_gpu;
#[cfg(feature = "gpu")]
mod switched;
mod solved;
mod tile_state;

use std::time::Instant;

use crate::cpu::invert::Part;
use crate::device::Device;
use crate::error::{Error, ErrorKind, Result};
use crate::image::{ImageView, ImageViewMut};
use crate::map::{Map, PAGE};
use crate::mesh::{Mesh, MeshSource};
use crate::method::schedule::Plan;
use crate::report::{AssetInfo, AssetReport, GpuWork, TileEstimate, TileInfo, TileReport};
use crate::settings::{LogLevel, SolveOptions, TileSettings};
use crate::team::Team;
use crate::tile::Rigidity;
use crate::tile::squares::pages_near;
use crate::view::Strided;
pub use fetch::FetchKind;
#[cfg(feature = "oracle")]
pub use oracle::ReferenceMinimum;
use output::Outputs;
use solved::Solved;
use tile_state::{SolveCall, TileState};

/// One output of [`Asset::redirect`].
#[derive(Debug)]
pub struct Fetch<'a> {
    /// Index of the tile.
    pub tile: usize,
    /// What to write.
    pub kind: FetchKind,
    /// Where to.
    pub image: ImageViewMut<'a>,
}

/// One mesh with its tiles, on a device. If the device's GPU goes away, everything that uses or reads the tiles gives
/// `DeviceLost`.
#[derive(Debug)]
pub struct Asset {
    device: Device,
    mesh: Mesh,
    tiles: Vec<TileState>,
    outputs: Outputs,
    /// Wall-clock milliseconds of the last good solve.
    solved_ms: Option<f32>,
}

impl Asset {
    /// Reads a mesh. Everything is copied.
    ///
    /// # Errors
    /// `InvalidArgument` naming the array and the index: an index out of range, a value that is not finite, counts
    /// that do not add up, an empty mesh.
    pub fn new(device: &Device, source: &MeshSource) -> Result<Asset> {
        device.alive()?;
        let mesh = Mesh::new(source)?;
        let AssetInfo { clipped_faces, faces_outside, degenerate_triangles, .. } = mesh.info;
        for (count, what) in [
            (clipped_faces, "faces reach out of their tile and are clipped to it"),
            (faces_outside, "faces lie in no UDIM tile and are left out"),
            (degenerate_triangles, "triangles without UV area are left out"),
        ] {
            if count > 0 {
                device.log(LogLevel::Warning, &format!("mesh: {count} {what}"));
            }
        }
        if mesh.rest.iter().all(|point| *point == mesh.rest[0]) {
            let message =
                "mesh: all rest positions are one point, so that no chart has an extent and none will move";
            device.log(LogLevel::Warning, message);
        }
        let tiles = mesh.tiles.iter().map(|_| TileState::default()).collect();
        Ok(Asset { device: device.clone(), mesh, tiles, outputs: Outputs::default(), solved_ms: None })
    }

    /// The device it was made on.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Sizes of the mesh, and the faces that were left out.
    #[must_use]
    pub fn info(&self) -> AssetInfo {
        self.mesh.info
    }

    /// Number of tiles; tiles are indexed from 0 in the order of their UDIM numbers.
    #[must_use]
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Index of the tile with this UDIM number.
    #[must_use]
    pub fn find_tile(&self, udim: u32) -> Option<usize> {
        self.mesh.tiles.iter().position(|tile| tile.udim == udim)
    }

    /// The facts of a tile that need no solve. Builds its grid if a map or setting changed.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; so for every function that takes a tile.
    pub fn tile_info(&mut self, tile: usize) -> Result<TileInfo> {
        self.check_tile(tile)?;
        let state = &mut self.tiles[tile];
        Team::with(self.device.threads(), |team| state.info(team, &self.device, &self.mesh, tile))
    }

    /// What preparing and solving a tile would take with its present maps and settings. It finds the nodes that may move,
    /// which takes a small part of the time and memory of preparing the tile, and keeps nothing.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range.
    pub fn tile_estimate(&self, tile: usize) -> Result<TileEstimate> {
        self.check_tile(tile)?;
        let (state, device) = (&self.tiles[tile], &self.device);
        Team::with(device.threads(), |team| state.estimate(team, device, &self.mesh, tile))
    }

    /// A tile, prepared with its present maps and settings, as bytes that [`Asset::load_tile`] takes on another machine.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; `OutOfMemory`.
    pub fn save_tile(&mut self, tile: usize) -> Result<Vec<u8>> {
        let mut bytes = vec![0; self.saved_tile_size(tile)?];
        self.save_tile_to(tile, &mut bytes)?;
        Ok(bytes)
    }

    /// Bytes that [`Asset::save_tile_to`] writes. Prepares the tile if need be.
    ///
    /// # Errors
    /// Those of [`Asset::save_tile`].
    pub fn saved_tile_size(&mut self, tile: usize) -> Result<usize> {
        self.check_tile(tile)?;
        let (state, device, mesh) = (&mut self.tiles[tile], &self.device, &self.mesh);
        Team::with(device.threads(), |team| state.saved_size(team, device, mesh, tile))
    }

    /// Writes a tile as [`Asset::save_tile`] returns it, to the first bytes of `out`; returns how many.
    ///
    /// # Errors
    /// `InvalidArgument` if `out` is too small; those of [`Asset::save_tile`].
    pub fn save_tile_to(&mut self, tile: usize, out: &mut [u8]) -> Result<usize> {
        let size = self.saved_tile_size(tile)?;
        let given = out.len();
        let out = out
            .get_mut(..size)
            .ok_or_else(|| Error::argument(format!("data: {given} bytes given, {size} needed")))?;
        let (state, device, mesh) = (&mut self.tiles[tile], &self.device, &self.mesh);
        Team::with(device.threads(), |team| state.save(team, device, mesh, tile, out))?;
        Ok(size)
    }

    /// Takes a tile that was prepared elsewhere, so that it need not be prepared here. Its maps and settings have to be set
    /// as they were when it was saved: the bytes hold what follows from them, not the maps themselves.
    ///
    /// # Errors
    /// `InvalidArgument` for bytes that are damaged, of another version, or saved with another mesh, map or setting;
    /// `OutOfMemory`. The tile is then as before.
    pub fn load_tile(&mut self, tile: usize, data: &[u8]) -> Result<()> {
        self.check_tile(tile)?;
        let (state, device, mesh) = (&mut self.tiles[tile], &self.device, &self.mesh);
        Team::with(device.threads(), |team| state.load(team, device, mesh, tile, data))
    }

    /// Sets a tile's rigidity, 0 (elastic) to 1 (rigid); `None` takes it away (the tile is then the identity).
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_rigidity(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        self.check_tile(tile)?;
        let rigidity = match image {
            Some(image) => Rigidity::Map(self.map_of("rigidity", tile, image)?),
            None => Rigidity::None,
        };
        self.tiles[tile].set_rigidity(rigidity);
        Ok(())
    }

    /// Sets a tile's warp mask: texels under 0.5 do not move; `None` = all may.
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_mask(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        self.check_tile(tile)?;
        let mask = image.map(|image| self.map_of("mask", tile, image)).transpose()?;
        self.tiles[tile].set_mask(mask);
        Ok(())
    }

    /// Takes a part of a tile's rigidity map anew: that of `size` texels from the column and row `first`, as they lie in
    /// memory. The image has the size and the format of the one that was set; its other texels are not read. A small part
    /// takes far less time than setting the map does.
    ///
    /// # Errors
    /// `InvalidArgument` if no map of this size and format was set, if the part is empty or not inside of it, or for a
    /// value that is not finite.
    pub fn update_rigidity(
        &mut self,
        tile: usize,
        image: ImageView,
        first: [u32; 2],
        size: [u32; 2],
    ) -> Result<()> {
        self.check_tile(tile)?;
        let texels = image.rect("rigidity", first, size)?;
        let (state, mesh) = (&mut self.tiles[tile], &self.mesh.tiles[tile]);
        let device = &self.device;
        Team::with(device.threads(), |team| state.update_rigidity(team, device, mesh, &image, texels))
    }

    /// Copies an image where the charts of a tile are.
    fn map_of(&self, name: &str, tile: usize, image: ImageView) -> Result<Map> {
        let (size, _) = image.shape();
        let near = pages_near(&self.mesh.tiles[tile], size);
        let columns = size[0].div_ceil(PAGE);
        image.to_map(name, |rect| near[rect.first[1] / PAGE * columns + rect.first[0] / PAGE])
    }

    /// Sets the rigidity of all tiles from one value per vertex (linear over each triangle); `None` takes it away.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a value that is not finite.
    pub fn set_vertex_rigidity(&mut self, values: Option<Strided>) -> Result<()> {
        let rigidity = match values {
            Some(values) => {
                self.check_vertices("rigidity", &values, 1)?;
                Rigidity::Vertices(
                    (0..values.len()).map(|v| (values.get(v, 0) as f32).clamp(0.0, 1.0)).collect(),
                )
            }
            None => Rigidity::None,
        };
        for tile in &mut self.tiles {
            tile.set_rigidity(rigidity.clone());
        }
        Ok(())
    }

    /// Sets a tile's settings.
    ///
    /// # Errors
    /// `InvalidArgument` naming the field.
    pub fn set_settings(&mut self, tile: usize, settings: &TileSettings) -> Result<()> {
        self.check_tile(tile)?;
        settings.check()?;
        self.tiles[tile].set_settings(settings);
        Ok(())
    }

    /// A tile's settings.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range.
    pub fn settings(&self, tile: usize) -> Result<TileSettings> {
        self.check_tile(tile)?;
        Ok(self.tiles[tile].maps.settings)
    }

    /// Solves every tile for a pose.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a position that is not finite; `OutOfMemory`. The last good result
    /// stays.
    pub fn solve(&mut self, positions: Strided, options: &SolveOptions) -> Result<()> {
        self.redirect(positions, options, &mut [])
    }

    /// Writes one output of the last solve.
    ///
    /// # Errors
    /// `NotSolved` before the first solve; on a GPU, `OutOfMemory` and `DeviceLost`. Nothing is written then.
    pub fn fetch(&mut self, tile: usize, kind: FetchKind, image: &mut ImageViewMut) -> Result<()> {
        self.check_tile(tile)?;
        let part = image.whole();
        Team::with(self.device.threads(), |team| self.fetch_with(team, tile, kind, &part, image))
    }

    /// Writes a part of one output of the last solve: of an image of `size` texels, those from the column and row `first`
    /// that `image` has room for. Rows are counted in the image's own order. Large outputs can thus be fetched band by
    /// band; the parts are those of the whole image, bit by bit on the CPU.
    ///
    /// # Errors
    /// Those of [`Asset::fetch`]; `InvalidArgument` if the part is not inside of the whole.
    pub fn fetch_part(
        &mut self,
        tile: usize,
        kind: FetchKind,
        image: &mut ImageViewMut,
        size: [u32; 2],
        first: [u32; 2],
    ) -> Result<()> {
        self.check_tile(tile)?;
        let part = image.part("image", size, first)?;
        Team::with(self.device.threads(), |team| self.fetch_with(team, tile, kind, &part, image))
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
        let start = Instant::now();
        self.check_vertices("positions", &positions, 3)?;
        options.check()?;
        for fetch in fetches.iter() {
            self.check_tile(fetch.tile)?;
        }
        let plan = Plan::new(options);
        Team::with(self.device.threads(), |team| {
            let (device, mesh) = (&self.device, &self.mesh);
            let mut results = Vec::with_capacity(self.tiles.len());
            // What is left of a time budget is divided among the tiles that are left.
            let mut nodes: u64 = self.tiles.iter().map(TileState::movable_nodes).sum();
            for (tile, state) in self.tiles.iter_mut().enumerate() {
                let own = state.movable_nodes();
                let budget = options.time_budget.map(|budget| {
                    let spent = start.elapsed();
                    let part = if own < nodes { own as f64 / nodes as f64 } else { 1.0 };
                    spent.saturating_add(budget.saturating_sub(spent).mul_f64(part))
                });
                nodes -= own;
                let call = SolveCall { team, device, mesh, positions, plan: &plan, start, budget };
                results.push(state.solve(&call, tile)?);
            }
            for (state, result) in self.tiles.iter_mut().zip(results) {
                state.solved = Some(result);
            }
            self.solved_ms = Some(start.elapsed().as_secs_f32() * 1000.0);
            if options.measure {
                self.measure(positions)?;
            }
            for fetch in fetches {
                let part = fetch.image.whole();
                self.fetch_with(team, fetch.tile, fetch.kind, &part, &mut fetch.image)?;
            }
            Ok(())
        })
    }

    fn fetch_with(
        &mut self,
        team: &Team,
        tile: usize,
        kind: FetchKind,
        part: &Part,
        image: &mut ImageViewMut,
    ) -> Result<()> {
        let solved = self.tiles[tile].solved.as_mut().ok_or_else(not_solved)?;
        let start = Instant::now();
        fetch::write(&self.device, team, solved, &mut self.outputs, kind, part, image)?;
        solved.report.times.invert = start.elapsed().as_secs_f32() * 1000.0;
        Ok(())
    }

    /// Redirected UV of every face corner of the mesh, in corner order, with the tile's offset added.
    ///
    /// # Errors
    /// `NotSolved`; `InvalidArgument` unless there is one element per corner.
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        if out.len() != self.mesh.corners.len() {
            return Err(Error::argument(format!(
                "uvs: {} elements, but the mesh has {} corners",
                out.len(),
                self.mesh.corners.len()
            )));
        }
        let tiles = self.solved()?;
        Team::with(self.device.threads(), |team| fetch::corner_uvs(team, &self.mesh, &tiles, out))
    }

    /// A tile's last solve.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn tile_report(&self, tile: usize) -> Result<TileReport> {
        self.check_tile(tile)?;
        self.tiles[tile].solved.as_ref().map(|solved| solved.report).ok_or_else(not_solved)
    }

    /// The dispatches, submissions and transfers of a tile's last solve; `None` on the CPU, or if no chart had to be
    /// solved.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn gpu_work(&self, tile: usize) -> Result<Option<GpuWork>> {
        self.check_tile(tile)?;
        self.tiles[tile].solved.as_ref().map(|solved| solved.work.clone()).ok_or_else(not_solved)
    }

    /// The last solve over all tiles.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn report(&self) -> Result<AssetReport> {
        let total_ms = self.solved_ms.ok_or_else(not_solved)?;
        let mut report =
            AssetReport { tiles: self.tiles.len() as u32, min_jacobian: 1.0, total_ms, ..Default::default() };
        for solved in self.solved()? {
            let tile = &solved.report;
            report.tiles_active += u32::from(tile.charts_active > 0);
            report.charts_active += tile.charts_active;
            report.charts_reused += tile.charts_reused;
            report.charts_identity += tile.charts_identity;
            report.nodes_active += tile.nodes_active;
            report.min_jacobian = report.min_jacobian.min(tile.min_jacobian);
            report.folds += tile.folds;
            report.bytes += tile.bytes;
            report.truncated |= tile.truncated;
        }
        Ok(report)
    }

    fn solved(&self) -> Result<Vec<&Solved>> {
        self.device.alive()?;
        self.solved_ms.ok_or_else(not_solved)?;
        self.tiles.iter().map(|tile| tile.solved.as_ref().ok_or_else(not_solved)).collect()
    }

    fn check_tile(&self, tile: usize) -> Result<()> {
        self.device.alive()?;
        if tile < self.tiles.len() {
            return Ok(());
        }
        Err(Error::argument(format!("tile: index {tile} is out of range, there are {}", self.tiles.len())))
    }

    fn check_vertices(&self, name: &str, values: &Strided, components: usize) -> Result<()> {
        self.device.alive()?;
        if values.components() != components {
            return Err(Error::argument(format!("{name}: {components} components are needed")));
        }
        if values.len() != self.mesh.rest.len() {
            return Err(Error::argument(format!(
                "{name}: {} elements, but the mesh has {} vertices",
                values.len(),
                self.mesh.rest.len()
            )));
        }
        values.check_finite(name)
    }
}

impl Drop for Asset {
    fn drop(&mut self) {
        for tile in &mut self.tiles {
            tile.release(&self.device);
        }
        self.outputs.release(&self.device);
        self.tiles.clear();
        if let Some(gpu) = self.device.gpu() {
            gpu.reclaim();
        }
    }
}

fn not_solved() -> Error {
    Error::new(ErrorKind::NotSolved, "the asset has no result yet: solve first")
}
