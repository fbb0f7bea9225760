//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

mod backend;
mod fetch;
mod log;
mod measure;
#[cfg(feature = "oracle")]
mod oracle;
mod output;
#[cfg(all(feature = "oracle", feature = "gpu"))]
mod parity;
mod prepare;
mod tiles;
#[cfg(feature = "gpu")]
mod on_gpu;
#[cfg(feature = "gpu")]
mod switched;
mod solved;
mod tile_state;
mod torn;

use std::time::Instant;

use crate::device::{Device, LiveAsset};
use crate::error::{Error, ErrorKind, Result};
use crate::image::ImagePart;
use crate::image::ImageViewMut;
use crate::mesh::{Mesh, MeshSource};
use crate::method::schedule::Plan;
use crate::report::{AssetInfo, AssetReport, GpuWork, TileReport};
use crate::settings::SolveOptions;
use crate::team::Team;
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
    /// Dropped after everything above.
    _live: LiveAsset,
}

impl Asset {
    /// Reads a mesh. Everything is copied.
    ///
    /// # Errors
    /// `InvalidArgument` naming the array and the index: an index out of range, a value that is not finite, counts
    /// that do not add up, a face with UVs at some corners only, an empty mesh.
    pub fn new(device: &Device, source: &MeshSource) -> Result<Asset> {
        device.alive()?;
        let mesh = Mesh::new(source)?;
        log::describe(device, &mesh);
        let tiles = mesh.tiles.iter().map(|_| TileState::default()).collect();
        Ok(Asset {
            device: device.clone(),
            mesh,
            tiles,
            outputs: Outputs::default(),
            solved_ms: None,
            _live: LiveAsset::new(device),
        })
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

    /// Number of tiles; tiles are indexed from 0, first those of UV set 0 in the order of their UDIM numbers, then those
    /// of set 1, and so on.
    #[must_use]
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Index of the tile with this UDIM number, of UV set 0.
    #[must_use]
    pub fn find_tile(&self, udim: u32) -> Option<usize> {
        self.find_tile_of_set(0, udim)
    }

    /// Index of the tile with this UDIM number, of a UV set.
    #[must_use]
    pub fn find_tile_of_set(&self, uv_set: u32, udim: u32) -> Option<usize> {
        self.mesh.tiles.iter().position(|tile| tile.udim == udim && tile.uv_set == uv_set)
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
        part: &ImagePart,
        image: &mut ImageViewMut,
    ) -> Result<()> {
        let solved = self.tiles[tile].solved.as_mut().ok_or_else(not_solved)?;
        let start = Instant::now();
        fetch::write(&self.device, team, solved, &mut self.outputs, kind, part, image)?;
        solved.report.times.invert = start.elapsed().as_secs_f32() * 1000.0;
        Ok(())
    }

    /// Redirected UV of every face corner of the mesh in UV set 0, in corner order, with the tile's offset added; 0, 0
    /// at corners of faces without UVs.
    ///
    /// # Errors
    /// `NotSolved`; `InvalidArgument` unless there is one element per corner.
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        self.corner_uvs_of_set(0, out)
    }

    /// The same of another UV set.
    ///
    /// # Errors
    /// Those of [`Asset::corner_uvs`]; `InvalidArgument` if there is no such set.
    pub fn corner_uvs_of_set(&self, uv_set: u32, out: &mut [[f32; 2]]) -> Result<()> {
        let corners = self.mesh.corners.get(uv_set as usize).ok_or_else(|| {
            let sets = self.mesh.corners.len();
            Error::argument(format!("uv_set: {uv_set} is out of range, there are {sets}"))
        })?;
        if out.len() != corners.len() {
            return Err(Error::argument(format!(
                "uvs: {} elements, but the mesh has {} corners",
                out.len(),
                corners.len()
            )));
        }
        let tiles = self.solved()?;
        Team::with(self.device.threads(), |team| fetch::corner_uvs(team, corners, &tiles, out))
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
