//! An asset: a mesh with its tiles, their maps, settings and results. The public entry to everything.

use crate::device::Device;
use crate::error::Result;
use crate::image::{ImageView, ImageViewMut};
use crate::mesh::MeshSource;
use crate::report::{AssetInfo, AssetReport, TileInfo, TileReport};
use crate::settings::{SolveOptions, TileSettings};
use crate::view::Strided;

/// What a fetch writes: two channels (u, v) per texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FetchKind {
    /// Inverse warp at texel centres, absolute within the tile (0..1); f32 only.
    Redirection,
    /// The same less the texel centre itself; f32 or f16.
    RedirectionDelta,
    /// The warp itself at the nodes, absolute within the tile; (nx+1) x (ny+1) texels give the nodes exactly,
    /// any other size its bilinear interpolation from corner to corner; f32 only.
    Warp,
}

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

/// One mesh with its tiles, on a device.
#[derive(Debug)]
pub struct Asset {
    device: Device,
}

impl Asset {
    /// Reads a mesh. Everything is copied.
    ///
    /// # Errors
    /// `InvalidArgument` naming the array and the index: an index out of range, a value that is not finite, counts
    /// that do not add up, an empty mesh.
    pub fn new(device: &Device, mesh: &MeshSource) -> Result<Asset> {
        let _ = mesh;
        Ok(Asset { device: device.clone() })
    }

    /// The device it was made on.
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// What was read.
    pub fn info(&self) -> AssetInfo {
        todo!()
    }

    /// Number of tiles; tiles are indexed from 0 in the order of their UDIM numbers.
    pub fn tile_count(&self) -> usize {
        todo!()
    }

    /// Index of the tile with this UDIM number.
    pub fn find_tile(&self, udim: u32) -> Option<usize> {
        let _ = udim;
        todo!()
    }

    /// What is known of a tile.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; so for every function that takes a tile.
    pub fn tile_info(&mut self, tile: usize) -> Result<TileInfo> {
        let _ = tile;
        todo!()
    }

    /// Sets a tile's rigidity, 0 (elastic) to 1 (rigid); `None` takes it away (the tile is then the identity).
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_rigidity(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        let _ = (tile, image);
        todo!()
    }

    /// Sets a tile's warp mask: texels under 0.5 do not move; `None` = all may.
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_mask(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        let _ = (tile, image);
        todo!()
    }

    /// Sets the rigidity of all tiles from one value per vertex (linear over each triangle).
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a value that is not finite.
    pub fn set_vertex_rigidity(&mut self, values: Option<Strided>) -> Result<()> {
        let _ = values;
        todo!()
    }

    /// Sets a tile's settings.
    ///
    /// # Errors
    /// `InvalidArgument` naming the field.
    pub fn set_settings(&mut self, tile: usize, settings: &TileSettings) -> Result<()> {
        let _ = (tile, settings);
        todo!()
    }

    /// A tile's settings.
    pub fn settings(&self, tile: usize) -> Result<TileSettings> {
        let _ = tile;
        todo!()
    }

    /// Solves every tile for a pose.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a position that is not finite; `OutOfMemory`. The last good result
    /// stays.
    pub fn solve(&mut self, positions: Strided, options: &SolveOptions) -> Result<()> {
        let _ = (positions, options);
        todo!()
    }

    /// Writes one output of the last solve.
    ///
    /// # Errors
    /// `NotSolved` before the first solve; `Unsupported` for a format that the kind does not have.
    pub fn fetch(&mut self, tile: usize, kind: FetchKind, image: &mut ImageViewMut) -> Result<()> {
        let _ = (tile, kind, image);
        todo!()
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
        let _ = (positions, options, fetches);
        todo!()
    }

    /// Redirected UV of every face corner of the mesh, in corner order, with the tile's offset added.
    ///
    /// # Errors
    /// `NotSolved`; `InvalidArgument` unless there is one element per corner.
    pub fn corner_uvs(&self, out: &mut [[f32; 2]]) -> Result<()> {
        let _ = out;
        todo!()
    }

    /// A tile's last solve.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn tile_report(&self, tile: usize) -> Result<TileReport> {
        let _ = tile;
        todo!()
    }

    /// The last solve over all tiles.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn report(&self) -> Result<AssetReport> {
        todo!()
    }
}
