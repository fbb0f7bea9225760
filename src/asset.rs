//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

mod backend;
mod canvas;
mod chart_texels;
mod external;
mod fetch;
mod form;
mod inspect;
mod kind;
mod log;
mod measure;
mod nodes;
#[cfg(feature = "oracle")]
mod oracle;
mod output;
#[cfg(all(feature = "oracle", feature = "gpu"))]
mod parity;
mod prepare;
mod quad;
mod refine;
mod results;
mod side_by_side;
mod solve;
mod tiles;
#[cfg(feature = "gpu")]
mod on_gpu;
#[cfg(feature = "gpu")]
mod switched;
mod solved;
mod stretch;
mod tile_state;
mod torn;
mod untangle;

use std::sync::Arc;

use crate::device::Device;
use crate::error::{Error, ErrorKind, Result};
use crate::image::ImageViewMut;
use crate::image::external::ExternalImage;
use crate::memory::Collect;
use crate::mesh::{Mesh, MeshSource};
use crate::report::{AssetInfo, AssetReport, GpuWork, TileReport};
use crate::settings::SolveOptions;
use crate::view::Strided;
pub use inspect::{MapDesc, MapReport};
pub use kind::FetchKind;
#[cfg(feature = "oracle")]
pub use oracle::ReferenceMinimum;
pub use refine::{Refinement, RefinementInfo, RefinementPattern, RefinementSettings};
pub use results::Results;
pub use solve::SolveRequest;
use tile_state::TileState;

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
    mesh: Arc<Mesh>,
    tiles: Vec<TileState>,
    results: Results,
}

impl Asset {
    /// Reads a mesh. Everything is copied.
    ///
    /// # Errors
    /// `InvalidArgument` naming the array and the index: an index out of range, a value that is not finite, counts
    /// that do not add up, a face with UVs at some corners only, an empty mesh.
    pub fn new(device: &Device, source: &MeshSource) -> Result<Asset> {
        device.alive()?;
        device.call(|| Asset::make(device, source))
    }

    fn make(device: &Device, source: &MeshSource) -> Result<Asset> {
        let mesh = Arc::new(Mesh::new(source)?);
        log::describe(device, &mesh);
        let tiles = mesh.tiles.iter().map(|_| TileState::default()).collected();
        let results = Results::new(device, &mesh);
        Ok(Asset { device: device.clone(), mesh, tiles, results })
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
        self.results.find_tile_of_set(uv_set, udim)
    }

    /// The last good results, to be read by other threads as well, also while the asset is solved.
    #[must_use]
    pub fn results(&self) -> &Results {
        &self.results
    }

    /// Solves every tile for a pose.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a position that is not finite; `OutOfMemory`. The last good result
    /// stays.
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

    /// [`Results::fetch`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn fetch(&self, tile: usize, kind: FetchKind, image: &mut ImageViewMut) -> Result<()> {
        self.results.fetch(tile, kind, image)
    }

    /// [`Results::fetch_part`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn fetch_part(
        &self,
        tile: usize,
        kind: FetchKind,
        image: &mut ImageViewMut,
        size: [u32; 2],
        first: [u32; 2],
    ) -> Result<()> {
        self.results.fetch_part(tile, kind, image, size, first)
    }

    /// [`Results::fetch_external`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    ///
    /// # Safety
    /// That of that.
    pub unsafe fn fetch_external(&self, tile: usize, kind: FetchKind, image: &ExternalImage) -> Result<()> {
        // SAFETY: the caller's.
        unsafe { self.results.fetch_external(tile, kind, image) }
    }

    /// [`Results::inspect_map`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn inspect_map(&self, tile: usize, desc: &MapDesc) -> Result<MapReport> {
        self.results.inspect_map(tile, desc)
    }

    /// [`Results::corner_uvs`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        self.results.corner_uvs(out)
    }

    /// [`Results::corner_uvs_of_set`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn corner_uvs_of_set(&self, uv_set: u32, out: &mut [[f32; 2]]) -> Result<()> {
        self.results.corner_uvs_of_set(uv_set, out)
    }

    /// [`Results::refine`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn refine(&self, settings: &RefinementSettings) -> Result<Refinement> {
        self.results.refine(settings)
    }

    /// [`Results::tile_report`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn tile_report(&self, tile: usize) -> Result<TileReport> {
        self.results.tile_report(tile)
    }

    /// [`Results::gpu_work`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn gpu_work(&self, tile: usize) -> Result<Option<GpuWork>> {
        self.results.gpu_work(tile)
    }

    /// [`Results::report`] of the asset's results.
    ///
    /// # Errors
    /// Those of that.
    pub fn report(&self) -> Result<AssetReport> {
        self.results.report()
    }

    /// Calls `f` with the device's memory. Where some is missing, that is an error: every tile keeps what it has, and what
    /// was booked for more goes back.
    fn call<R>(&mut self, f: impl FnOnce(&mut Asset) -> Result<R>) -> Result<R> {
        let device = self.device.clone();
        let result = device.call(|| f(self));
        if result.as_ref().is_err_and(|error| error.kind == ErrorKind::OutOfMemory) {
            self.tiles.iter_mut().for_each(|tile| tile.settle(&device));
        }
        result
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
        self.tiles.clear();
        if let Some(gpu) = self.device.gpu() {
            gpu.reclaim();
        }
    }
}
