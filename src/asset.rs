//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

mod after;
mod blended;
pub(crate) mod carrier;
pub(crate) mod derived;
mod given;
mod inside;
mod log;
pub(crate) mod measure;
pub(crate) mod outputs;
mod prepare;
pub(crate) mod request;
pub(crate) mod results;
mod room;
mod seams;
mod shape;
mod side_by_side;
pub(crate) mod solve;
mod solver;
mod stretch;
pub(crate) mod tile;
mod tiles;
mod together;

use std::sync::Arc;

use crate::device::Device;
use crate::map::FetchKind;
use crate::map::certificate::desc::{MapDesc, MapReport};
use after::After;
use derived::{Derived, Same};
use given::Given;
use results::Results;
use tile::TileState;
use vrtm_beyond::Places;
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, Result};
use vrtm_core::image::ImageViewMut;
use vrtm_core::image::external::ExternalImage;
use vrtm_core::mesh::{Mesh, MeshSource, TileMesh};
use vrtm_core::report::{AssetInfo, AssetReport, GpuWork, TileReport};
use vrtm_core::view::Strided;

/// One mesh with its tiles, on a device. If the device's GPU is lost, everything that uses or reads the tiles returns
/// `DeviceLost`.
#[derive(Debug)]
pub struct Asset {
    pub(crate) device: Device,
    pub(crate) mesh: Arc<Mesh>,
    /// Maps and settings that the host has set.
    given: Given,
    /// Tiles, with all that follows from these.
    tiles: Vec<TileState>,
    pub(crate) results: Results,
    /// Places of the surface beyond seams in the charts that have collars.
    places: Derived<Vec<Same<TileMesh>>, Places>,
    /// Time of the last calls after their tiles were solved, which time budgets leave free.
    after: After,
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
        let given = Given::new(mesh.tiles.len());
        let tiles = (0..mesh.tiles.len()).map(|tile| TileState::new(tile, device)).collect();
        let results = Results::new(device, &mesh);
        let (places, after) = (Derived::default(), After::default());
        Ok(Asset { device: device.clone(), mesh, given, tiles, results, places, after })
    }

    /// The device that the asset was made on.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Sizes of the mesh, and the faces that were left out.
    #[must_use]
    pub fn info(&self) -> AssetInfo {
        self.mesh.info
    }

    /// Number of tiles; tiles are indexed from 0, first those of UV set 0 in the order of their UDIM numbers, then
    /// those of set 1, and so on. The layers of a UDIM number follow one another ([`MeshSource::max_layers`]).
    #[must_use]
    pub fn tile_count(&self) -> usize {
        self.tiles.len()
    }

    /// Index of the tile of UV set 0 with this UDIM number, or of its first layer.
    #[must_use]
    pub fn find_tile(&self, udim: u32) -> Option<usize> {
        self.find_tile_of_set(0, udim)
    }

    /// Index of the tile of a UV set with this UDIM number, or of its first layer.
    #[must_use]
    pub fn find_tile_of_set(&self, uv_set: u32, udim: u32) -> Option<usize> {
        self.results.find_tile_of_set(uv_set, udim)
    }

    /// The last good results, which other threads may also read, even while the asset is being solved.
    #[must_use]
    pub fn results(&self) -> &Results {
        &self.results
    }

    /// See [`Results::fetch`].
    ///
    /// # Errors
    /// Those of [`Results::fetch`].
    pub fn fetch(&self, tile: usize, kind: FetchKind, image: &mut ImageViewMut) -> Result<()> {
        self.results.fetch(tile, kind, image)
    }

    /// See [`Results::fetch_external`].
    ///
    /// # Errors
    /// Those of [`Results::fetch_external`].
    ///
    /// # Safety
    /// See [`Results::fetch_external`].
    pub unsafe fn fetch_external(&self, tile: usize, kind: FetchKind, image: &ExternalImage) -> Result<()> {
        // SAFETY: the caller keeps the promises of `Results::fetch_external`.
        unsafe { self.results.fetch_external(tile, kind, image) }
    }

    /// See [`Results::inspect_map`].
    ///
    /// # Errors
    /// Those of [`Results::inspect_map`].
    pub fn inspect_map(&self, tile: usize, desc: &MapDesc) -> Result<MapReport> {
        self.results.inspect_map(tile, desc)
    }

    /// See [`Results::corner_uvs`].
    ///
    /// # Errors
    /// Those of [`Results::corner_uvs`].
    ///
    /// # Example
    /// ```
    /// # use vrtm::{Asset, Device, DeviceSettings, ErrorKind, MeshSource, SolveOptions, Strided, UvSource};
    /// # fn main() -> vrtm::Result<()> {
    /// # let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    /// # let rest = uvs.map(|[x, y]: [f32; 2]| [x, y, 0.0]);
    /// # let source = MeshSource {
    /// #     positions: Strided::from_f32x3(&rest),
    /// #     face_counts: Some(&[4]),
    /// #     indices: &[0, 1, 2, 3],
    /// #     uvs: UvSource { u: Strided::from_f32x2(&uvs), ..UvSource::default() },
    /// #     ..MeshSource::default()
    /// # };
    /// let mut asset = Asset::new(&Device::new(&DeviceSettings::default())?, &source)?;
    /// let mut corners = [[0.0; 2]; 4];
    /// let error = asset.corner_uvs(&mut corners).expect_err("nothing is solved yet");
    /// assert_eq!(error.kind, ErrorKind::NotSolved);
    /// asset.solve(Strided::from_f32x3(&rest), &SolveOptions::default())?;
    /// asset.corner_uvs(&mut corners)?;
    /// assert_eq!(corners, uvs, "at rest a corner has its own UV");
    /// # Ok(())
    /// # }
    /// ```
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        self.results.corner_uvs(out)
    }

    /// See [`Results::corner_uvs_of_set`].
    ///
    /// # Errors
    /// Those of [`Results::corner_uvs_of_set`].
    pub fn corner_uvs_of_set(&self, uv_set: u32, out: &mut [[f32; 2]]) -> Result<()> {
        self.results.corner_uvs_of_set(uv_set, out)
    }

    /// See [`Results::tile_report`].
    ///
    /// # Errors
    /// Those of [`Results::tile_report`].
    pub fn tile_report(&self, tile: usize) -> Result<TileReport> {
        self.results.tile_report(tile)
    }

    /// See [`Results::gpu_work`].
    ///
    /// # Errors
    /// Those of [`Results::gpu_work`].
    pub fn gpu_work(&self, tile: usize) -> Result<Option<GpuWork>> {
        self.results.gpu_work(tile)
    }

    /// See [`Results::report`].
    ///
    /// # Errors
    /// Those of [`Results::report`].
    pub fn report(&self) -> Result<AssetReport> {
        self.results.report()
    }

    pub(crate) fn check_tile(&self, tile: usize) -> Result<()> {
        self.device.alive()?;
        if tile < self.tiles.len() {
            return Ok(());
        }
        Err(Error::argument(format!("tile: index {tile} is out of range, there are {}", self.tiles.len())))
    }

    pub(crate) fn check_vertices(&self, name: &str, values: &Strided, components: usize) -> Result<()> {
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
        self.tiles.clear();
        if let Some(gpu) = self.device.gpu() {
            gpu.reclaim();
        }
    }
}
