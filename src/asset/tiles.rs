//! The tiles of an asset: facts, maps and settings, and prepared tiles as bytes.

use std::sync::Arc;

use super::given::{Call, Which};
use super::tile::TileState;
use super::{Asset, log};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::error::{Error, Result};
use vrtm_core::grid::maps::Values;
use vrtm_core::grid::squares::pages_near;
use vrtm_core::image::ImageView;
use vrtm_core::image::map::{Map, PAGE};
use vrtm_core::report::{TileEstimate, TileInfo};
use vrtm_core::settings::TileSettings;
use vrtm_core::view::Strided;

impl Asset {
    /// Facts about a tile that need no solve. Builds its grid if a map or setting changed.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; this holds for every function that takes a tile.
    pub fn tile_info(&mut self, tile: usize) -> Result<TileInfo> {
        self.on_tile(tile, TileState::info)
    }

    /// Cells of the grid in u and v that a tile has with its present rigidity and settings. The tile is not prepared.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; `OutOfMemory`.
    pub fn tile_grid(&mut self, tile: usize) -> Result<[u32; 2]> {
        self.check_tile(tile)?;
        let Asset { device, mesh, given, .. } = self;
        device.call(|| {
            device.team(|team| given.find_sizes(team, mesh, tile..tile + 1, device));
            Ok(())
        })?;
        Ok(given.maps[tile].grid_size().map(|cells| cells as u32))
    }

    /// The memory for preparing and solving a tile with its present maps and settings. It counts the movable nodes,
    /// which takes a small part of the time and memory of preparing the tile, and keeps nothing but the collars of its
    /// charts.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; `Unsupported` if the GPU's buffers are too small for the grid, with
    /// the largest size that fits, as in all calls that prepare a tile.
    pub fn tile_estimate(&mut self, tile: usize) -> Result<TileEstimate> {
        self.on_tile(tile, TileState::estimate)
    }

    /// A tile, prepared with its present maps and settings, as bytes that [`Asset::load_tile`] takes on another
    /// machine.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range; `OutOfMemory`.
    ///
    /// # Example
    /// ```
    /// # use vrtm::{Asset, Device, DeviceSettings, ImageView, MeshSource, SolveOptions, Strided, UvSource};
    /// # fn main() -> vrtm::Result<()> {
    /// # let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    /// # let rest = uvs.map(|[x, y]: [f32; 2]| [x, y, 0.0]);
    /// # let source = MeshSource {
    /// #     positions: Strided::from_slice(&rest),
    /// #     face_counts: Some(&[4]),
    /// #     indices: &[0, 1, 2, 3],
    /// #     uvs: UvSource { u: Strided::from_slice(&uvs), ..UvSource::default() },
    /// #     ..MeshSource::default()
    /// # };
    /// # let spot = |k: usize| [k % 32, k / 32].iter().all(|x| (12..20).contains(x));
    /// # let painted: Vec<u8> = (0..32 * 32).map(|k| if spot(k) { 255 } else { 0 }).collect();
    /// # let pose = rest.map(|[x, y, z]| [2.0 * x, y, z]);
    /// # let device = Device::new(&DeviceSettings::default())?;
    /// let prepared = || {
    ///     let mut asset = Asset::new(&device, &source)?;
    ///     let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
    ///     asset.set_rigidity(tile, Some(ImageView::from_texels("rigidity", &painted, [32, 32])?))?;
    ///     vrtm::Result::Ok((asset, tile))
    /// };
    /// let (mut asset, tile) = prepared()?;
    /// let bytes = asset.save_tile(tile)?;
    /// asset.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
    ///
    /// // In another process, or on another machine:
    /// let (mut other, tile) = prepared()?;
    /// other.load_tile(tile, &bytes)?;
    /// other.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
    /// assert_eq!(other.tile_report(tile)?.energy, asset.tile_report(tile)?.energy);
    /// # Ok(())
    /// # }
    /// ```
    #[expect(clippy::disallowed_types, reason = "public: that of the standard library")]
    pub fn save_tile(&mut self, tile: usize) -> Result<std::vec::Vec<u8>> {
        let size = self.saved_tile_size(tile)?;
        let mut bytes = self.device.call(|| Ok(zeroed(size)))?;
        self.save_tile_to(tile, &mut bytes)?;
        Ok(bytes.into())
    }

    /// Bytes that [`Asset::save_tile_to`] writes. Prepares the tile if necessary.
    ///
    /// # Errors
    /// Those of [`Asset::save_tile`].
    pub fn saved_tile_size(&mut self, tile: usize) -> Result<usize> {
        self.on_tile(tile, TileState::saved_size)
    }

    /// Writes the bytes of [`Asset::save_tile`] to the start of `out`; returns their number.
    ///
    /// # Errors
    /// `InvalidArgument` if `out` is too small; those of [`Asset::save_tile`].
    pub fn save_tile_to(&mut self, tile: usize, out: &mut [u8]) -> Result<usize> {
        let size = self.saved_tile_size(tile)?;
        let given = out.len();
        let out = out
            .get_mut(..size)
            .ok_or_else(|| Error::argument(format!("data: {given} bytes given, {size} needed")))?;
        self.on_tile(tile, |state, call| state.save(call, out))?;
        Ok(size)
    }

    /// Loads a tile that was prepared elsewhere, so that it need not be prepared here. Its maps and settings must be
    /// set as they were when it was saved: the bytes hold what was derived from the maps, not the maps themselves.
    ///
    /// # Errors
    /// `InvalidArgument` for bytes that are damaged, of another version, or saved with another mesh, map or setting;
    /// `OutOfMemory`. The tile is then unchanged.
    pub fn load_tile(&mut self, tile: usize, data: &[u8]) -> Result<()> {
        self.on_tile(tile, |state, call| state.load(call, data))
    }

    fn on_tile<R: Send>(
        &mut self,
        tile: usize,
        f: impl FnOnce(&mut TileState, &Call) -> Result<R> + Send,
    ) -> Result<R> {
        self.check_tile(tile)?;
        let Asset { device, mesh, given, tiles, .. } = self;
        let sized =
            if given.maps[tile].settings.beyond().is_some() { 0..tiles.len() } else { tile..tile + 1 };
        device.call(|| {
            device.team(|team| {
                given.find_sizes(team, mesh, sized, device);
                f(&mut tiles[tile], &Call { team, device, mesh, given })
            })
        })
    }

    /// Sets a tile's rigidity, 0 (elastic) to 1 (rigid), for all of its layers; `None` removes it. Where a tile has
    /// none, the rigidity of the vertices counts ([`Asset::set_vertex_rigidity`]); without that, too, the tile is the
    /// identity.
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_rigidity(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        self.set_map("rigidity", Which::Rigidity, tile, image)
    }

    /// Sets a tile's warp mask, for all of its layers: texels under 0.5 do not move; `None` removes it. Where a tile
    /// has none, the mask of the vertices counts ([`Asset::set_vertex_mask`]); without that, too, all may move.
    ///
    /// # Errors
    /// `InvalidArgument` for a value that is not finite.
    pub fn set_mask(&mut self, tile: usize, image: Option<ImageView>) -> Result<()> {
        self.set_map("mask", Which::Mask, tile, image)
    }

    fn set_map(&mut self, name: &str, which: Which, tile: usize, image: Option<ImageView>) -> Result<()> {
        self.check_tile(tile)?;
        let map =
            image.map(|image| self.device.call(|| self.map_of(name, which, tile, image))).transpose()?;
        self.given.set(self.mesh.layers(tile), which, map);
        Ok(())
    }

    /// Replaces a part of a tile's rigidity map: `size` texels from the column and row `first`, in the image's memory
    /// order. The image has the size and the format of the original map; its other texels are not read. A small part
    /// takes far less time than setting the whole map.
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
        let Values::Map(map) = &self.given.maps[tile].rigidity else {
            return Err(Error::argument("rigidity: the tile has no map to update"));
        };
        let (shape, [width, height]) = (map.shape(), map.shape().0);
        ensure!(
            image.shape() == shape,
            "rigidity: the map that was set has {width}x{height} texels of another format or size"
        );
        image.check_finite("rigidity", texels)?;
        let Asset { device, mesh, given, .. } = self;
        device.call(|| {
            given.stroke(mesh.layers(tile), texels, |map| image.copy_to(map, texels));
            Ok(())
        })
    }

    /// Copies the part of an image near the charts of all layers of a tile.
    fn map_of(&self, name: &str, which: Which, tile: usize, image: ImageView) -> Result<Arc<Map>> {
        let (size, _) = image.shape();
        let mut near: Vec<bool> = Vec::new();
        for layer in self.mesh.layers(tile) {
            let of_layer = pages_near(&self.mesh.tiles[layer], size);
            if near.is_empty() {
                near = of_layer;
            } else {
                near.iter_mut().zip(of_layer).for_each(|(near, also)| *near |= also);
            }
        }
        let columns = size[0].div_ceil(PAGE);
        let map = image.to_map(name, |rect| near[rect.first[1] / PAGE * columns + rect.first[0] / PAGE])?;
        let own = Some(&*self.mesh.tiles[tile]);
        log::doubt(&self.device, which, own, &format!("its {name}"), map.largest());
        Ok(Arc::new(map))
    }

    /// Sets the rigidity of all vertices, linear over each triangle, for the tiles that have no map of their own
    /// ([`Asset::set_rigidity`]), in whatever order both are set; `None` removes it.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a value that is not finite.
    pub fn set_vertex_rigidity(&mut self, values: Option<Strided>) -> Result<()> {
        self.set_of_vertices("rigidity", Which::Rigidity, values)
    }

    /// Sets the mask of all vertices, linear over each triangle, for the tiles that have no mask of their own
    /// ([`Asset::set_mask`]), in whatever order both are set: nodes within half a cell of a value under 0.5 do not
    /// move; `None` removes it.
    ///
    /// # Errors
    /// `InvalidArgument` for a wrong count or a value that is not finite.
    pub fn set_vertex_mask(&mut self, values: Option<Strided>) -> Result<()> {
        self.set_of_vertices("mask", Which::Mask, values)
    }

    /// Copies one value per vertex, clamped to 0..1.
    fn set_of_vertices(&mut self, name: &str, which: Which, values: Option<Strided>) -> Result<()> {
        let mut copy = Values::None;
        if let Some(values) = values {
            Asset::check_vertices((&self.device, &self.mesh.info), name, &values, 1)?;
            let largest = (0..values.len()).map(|v| values.get(v, 0)).fold(0.0, f64::max);
            let what = format!("the {name} of the vertices");
            log::doubt(&self.device, which, None, &what, largest as f32);
            let value = |v: usize| (values.get(v, 0) as f32).clamp(0.0, 1.0);
            let values = self.device.call(|| Ok((0..values.len()).map(value).collect()))?;
            copy = Values::Vertices(Arc::new(values));
        }
        self.given.set_of_vertices(which, copy);
        Ok(())
    }

    /// Sets the settings of a tile and of all of its layers.
    ///
    /// # Errors
    /// `InvalidArgument` naming the field.
    pub fn set_settings(&mut self, tile: usize, settings: &TileSettings) -> Result<()> {
        self.check_tile(tile)?;
        settings.check()?;
        for layer in self.mesh.layers(tile) {
            self.given.maps[layer].settings = *settings;
        }
        Ok(())
    }

    /// Sets whether solves skip a tile, so that it keeps its result, or stays without one.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range.
    pub fn freeze(&mut self, tile: usize, frozen: bool) -> Result<()> {
        self.check_tile(tile)?;
        self.given.frozen[tile] = frozen;
        Ok(())
    }

    /// A tile's settings.
    ///
    /// # Errors
    /// `InvalidArgument` if `tile` is out of range.
    pub fn settings(&self, tile: usize) -> Result<TileSettings> {
        self.check_tile(tile)?;
        Ok(self.given.maps[tile].settings)
    }
}
