//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

mod blended;
pub(crate) mod carrier;
pub(crate) mod derived;
mod given;
mod inside;
mod log;
pub(crate) mod measure;
pub(crate) mod outputs;
mod prepare;
pub(crate) mod read;
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
pub(crate) mod tiles;
mod together;

use std::ops::Deref;
use std::sync::Arc;

use crate::device::Device;
use derived::{Derived, Same};
use given::Given;
use results::Results;
use tile::TileState;
use vrtm_beyond::Places;
use vrtm_core::allocation::Vec;
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::mesh::{Mesh, MeshSource, TileMesh};
use vrtm_core::report::AssetInfo;
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
    /// The clock of time budgets.
    clock: fn() -> Instant,
}

impl Asset {
    /// Reads a mesh. Everything is copied.
    ///
    /// # Errors
    /// `InvalidArgument` for an empty mesh, and for a face with UVs at some corners only.
    pub fn new(device: &Device, source: &MeshSource) -> Result<Asset> {
        device.alive()?;
        device.call(|| {
            let mesh = Arc::new(Mesh::new(source)?);
            log::describe(device, &mesh);
            let given = Given::new(mesh.tiles.len());
            let tiles = (0..mesh.tiles.len()).map(|tile| TileState::new(tile, device)).collect();
            let results = Results::new(device, &mesh);
            let (places, clock) = (Derived::default(), Instant::now);
            Ok(Asset { device: device.clone(), mesh, given, tiles, results, places, clock })
        })
    }

    /// Sets the clock that time budgets are measured by: for tests.
    #[doc(hidden)]
    pub fn set_clock(&mut self, clock: fn() -> Instant) {
        self.clock = clock;
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
        self.results.find_tile_of_set(0, udim)
    }

    /// The last good results, which other threads may also read, even while the asset is being solved.
    #[must_use]
    pub fn results(&self) -> &Results {
        &self.results
    }

    pub(crate) fn check_tile(&self, tile: usize) -> Result<()> {
        self.device.alive()?;
        self.results.check_tile(tile)
    }

    pub(crate) fn check_vertices(
        (device, of): (&Device, &AssetInfo),
        name: &str,
        values: &Strided,
        components: usize,
    ) -> Result<()> {
        device.alive()?;
        ensure!(values.components() == components, "{name}: {components} components are needed");
        let (given, needed) = (values.len(), of.vertices as usize);
        ensure!(given == needed, "{name}: {given} elements, but the mesh has {needed} vertices");
        values.check_finite(name)
    }
}

/// An asset is read as its last good results are.
impl Deref for Asset {
    type Target = Results;

    fn deref(&self) -> &Results {
        &self.results
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
