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

/// One tile of an asset, to be set and prepared, as [`Asset::tile_mut`] gives it. Calls for a tile that the asset has
/// not return `InvalidArgument`. [`crate::Tile`] reads its results.
#[derive(Debug)]
pub struct TileMut<'a> {
    asset: &'a mut Asset,
    index: usize,
}

impl TileMut<'_> {
    /// Facts that need no solve. Builds the grid if a map or setting changed.
    pub fn info(&mut self) -> Result<TileInfo> {
        self.on_tile(TileState::info)
    }

    /// Cells of the grid in u and v that it has with its present rigidity and settings. The tile is not prepared.
    pub fn grid(&mut self) -> Result<[u32; 2]> {
        let (Asset { device, mesh, given, .. }, tile) = self.checked()?;
        device.call(|| {
            device.team(|team| given.find_sizes(team, mesh, tile..tile + 1, device));
            Ok(())
        })?;
        Ok(given.maps[tile].grid_size().map(|cells| cells as u32))
    }

    /// The memory for preparing and solving it with its present maps and settings. It counts the movable nodes,
    /// which takes a small part of the time and memory of preparing the tile, and keeps nothing but the collars of its
    /// charts.
    ///
    /// # Errors
    /// `Unsupported` if the GPU's buffers are too small for the grid, with the largest size that fits, as in all calls
    /// that prepare a tile.
    pub fn estimate(&mut self) -> Result<TileEstimate> {
        self.on_tile(TileState::estimate)
    }

    /// The tile, prepared with its present maps and settings, as bytes that [`TileMut::load`] takes on another
    /// machine.
    ///
    /// # Example
    /// ```
    /// # use vrtm::{Asset, Device, DeviceSettings, ImageView, SolveOptions, Strided};
    /// # fn main() -> vrtm::Result<()> {
    /// # let (rest, source) = vrtm_core::fixtures::square();
    /// # let spot = |k: usize| [k % 32, k / 32].iter().all(|x| (12..20).contains(x));
    /// # let painted: Vec<u8> = (0..32 * 32).map(|k| if spot(k) { 255 } else { 0 }).collect();
    /// # let pose = rest.map(|[x, y, z]| [2.0 * x, y, z]);
    /// # let device = Device::new(&DeviceSettings::default())?;
    /// let prepared = || {
    ///     let mut asset = Asset::new(&device, &source)?;
    ///     let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
    ///     asset.tile_mut(tile).set_rigidity(Some(ImageView::from_texels("rigidity", &painted, [32, 32])?))?;
    ///     vrtm::Result::Ok((asset, tile))
    /// };
    /// let (mut asset, tile) = prepared()?;
    /// let bytes = asset.tile_mut(tile).save()?;
    /// asset.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
    ///
    /// // In another process, or on another machine:
    /// let (mut other, tile) = prepared()?;
    /// other.tile_mut(tile).load(&bytes)?;
    /// other.solve(Strided::from_slice(&pose), &SolveOptions::default())?;
    /// assert_eq!(other.tile(tile).report()?.energy, asset.tile(tile).report()?.energy);
    /// # Ok(())
    /// # }
    /// ```
    #[expect(clippy::disallowed_types, reason = "public: that of the standard library")]
    pub fn save(&mut self) -> Result<std::vec::Vec<u8>> {
        let size = self.saved_size()?;
        let mut bytes = self.asset.device.call(|| Ok(zeroed(size)))?;
        self.save_to(&mut bytes)?;
        Ok(bytes.into())
    }

    /// Bytes that [`TileMut::save_to`] writes. Prepares the tile if necessary.
    pub fn saved_size(&mut self) -> Result<usize> {
        self.on_tile(TileState::saved_size)
    }

    /// Writes the bytes of [`TileMut::save`] to the start of `out`; returns their number.
    pub fn save_to(&mut self, out: &mut [u8]) -> Result<usize> {
        let size = self.saved_size()?;
        let given = out.len();
        let out = out
            .get_mut(..size)
            .ok_or_else(|| Error::argument(format!("data: {given} bytes given, {size} needed")))?;
        self.on_tile(|state, call| state.save(call, out))?;
        Ok(size)
    }

    /// Loads a tile that was prepared elsewhere, so that it need not be prepared here. Its maps and settings must be
    /// set as they were when it was saved: the bytes hold what was derived from the maps, not the maps themselves.
    ///
    /// # Errors
    /// `InvalidArgument` for bytes that are damaged, of another version, or saved with another mesh, map or setting.
    pub fn load(&mut self, data: &[u8]) -> Result<()> {
        self.on_tile(|state, call| state.load(call, data))
    }

    /// Sets its rigidity, 0 (elastic) to 1 (rigid), for all of its layers; `None` removes it. Where a tile has
    /// none, the rigidity of the vertices counts ([`Asset::set_vertex_rigidity`]); without that, too, the tile is the
    /// identity.
    pub fn set_rigidity(&mut self, image: Option<ImageView>) -> Result<()> {
        self.set_map("rigidity", Which::Rigidity, image)
    }

    /// Sets its warp mask, for all of its layers: texels under 0.5 do not move; `None` removes it. Where a tile
    /// has none, the mask of the vertices counts ([`Asset::set_vertex_mask`]); without that, too, all may move.
    pub fn set_mask(&mut self, image: Option<ImageView>) -> Result<()> {
        self.set_map("mask", Which::Mask, image)
    }

    fn set_map(&mut self, name: &str, which: Which, image: Option<ImageView>) -> Result<()> {
        let (asset, tile) = self.checked()?;
        let map =
            image.map(|image| asset.device.call(|| asset.map_of(name, which, tile, image))).transpose()?;
        asset.given.set(asset.mesh.layers(tile), which, map);
        Ok(())
    }

    /// Replaces a part of its rigidity map: `size` texels from the column and row `first`, in the image's memory
    /// order. The image has the size and the format of the original map; its other texels are not read. A small part
    /// takes far less time than setting the whole map.
    ///
    /// # Errors
    /// `InvalidArgument` if no map of this size and format was set.
    pub fn update_rigidity(&mut self, image: ImageView, first: [u32; 2], size: [u32; 2]) -> Result<()> {
        let (Asset { device, mesh, given, .. }, tile) = self.checked()?;
        let texels = image.rect("rigidity", first, size)?;
        let Values::Map(map) = &given.maps[tile].rigidity else {
            return Err(Error::argument("rigidity: the tile has no map to update"));
        };
        let (shape, [width, height]) = (map.shape(), map.shape().0);
        ensure!(
            image.shape() == shape,
            "rigidity: the map that was set has {width}x{height} texels of another format or size"
        );
        image.check_finite("rigidity", texels)?;
        device.call(|| {
            given.stroke(mesh.layers(tile), texels, |map| image.copy_to(map, texels));
            Ok(())
        })
    }

    /// Sets the settings, for all of its layers.
    pub fn set_settings(&mut self, settings: &TileSettings) -> Result<()> {
        let (asset, tile) = self.checked()?;
        settings.check()?;
        for layer in asset.mesh.layers(tile) {
            asset.given.maps[layer].settings = *settings;
        }
        Ok(())
    }

    /// Sets whether solves skip it, so that it keeps its result, or stays without one.
    pub fn freeze(&mut self, frozen: bool) -> Result<()> {
        let (asset, tile) = self.checked()?;
        asset.given.frozen[tile] = frozen;
        Ok(())
    }

    /// The settings.
    pub fn settings(&self) -> Result<TileSettings> {
        self.asset.check_tile(self.index)?;
        Ok(self.asset.given.maps[self.index].settings)
    }

    fn on_tile<R: Send>(&mut self, f: impl FnOnce(&mut TileState, &Call) -> Result<R> + Send) -> Result<R> {
        let (Asset { device, mesh, given, tiles, .. }, tile) = self.checked()?;
        let sized =
            if given.maps[tile].settings.beyond().is_some() { 0..tiles.len() } else { tile..tile + 1 };
        device.call(|| {
            device.team(|team| {
                given.find_sizes(team, mesh, sized, device);
                f(&mut tiles[tile], &Call { team, device, mesh, given })
            })
        })
    }

    /// The asset, and the index of one of its tiles.
    fn checked(&mut self) -> Result<(&mut Asset, usize)> {
        self.asset.check_tile(self.index)?;
        Ok((self.asset, self.index))
    }
}

impl Asset {
    /// The tile at `index`, to be set and prepared, counted as [`Asset::tile_count`] says.
    pub fn tile_mut(&mut self, index: usize) -> TileMut<'_> {
        TileMut { asset: self, index }
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
    /// ([`TileMut::set_rigidity`]), in whatever order both are set; `None` removes it.
    pub fn set_vertex_rigidity(&mut self, values: Option<Strided>) -> Result<()> {
        self.set_of_vertices("rigidity", Which::Rigidity, values)
    }

    /// Sets the mask of all vertices, linear over each triangle, for the tiles that have no mask of their own
    /// ([`TileMut::set_mask`]), in whatever order both are set: nodes within half a cell of a value under 0.5 do not
    /// move; `None` removes it.
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
}
