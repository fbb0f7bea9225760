//! The part that calls vrtm: solves a pose, and fetches each tile's maps in the layout of a GPU.

use half::f16;
use vrtm::{
    Asset, Device, DeviceSettings, ExternalImage, FetchKind, ImageLayout, ImageView, ImageViewMut, Origin,
    PixelFormat, SolveOptions, Strided, TileSettings,
};

use super::model::Model;
use super::{Result, mips};

/// A solved pose.
pub struct Solved {
    asset: Asset,
    /// UDIM numbers of the tiles, in the order of the layers of all textures.
    pub udims: Vec<u32>,
}

impl Solved {
    /// Solves a pose with vrtm's defaults.
    pub fn new(model: &Model, positions: &[[f32; 3]], settings: &DeviceSettings) -> Result<Solved> {
        let mut solved = Solved::open(model, settings)?;
        solved.solve(positions)?;
        Ok(solved)
    }

    /// Makes the asset, without a pose.
    pub fn open(model: &Model, settings: &DeviceSettings) -> Result<Solved> {
        let said = |error: vrtm::Error| format!("{}: {error}", model.name);
        let device = Device::new(settings).map_err(said)?;
        let source = model.mesh.source(Strided::from_slice(&model.rest));
        let mut asset = Asset::new(&device, &source).map_err(said)?;
        for maps in &model.tiles {
            let Some(tile) = asset.find_tile(maps.udim) else { continue };
            let layout = ImageLayout::packed(maps.width, maps.height, PixelFormat::U8);
            let map = ImageView::new("map", &maps.rigidity, layout).map_err(said)?;
            asset.tile_mut(tile).set_rigidity(Some(map)).map_err(said)?;
        }
        let tiles = 0..asset.tile_count();
        let udims = tiles.map(|tile| asset.tile_mut(tile).info().map(|info| info.udim));
        let udims = udims.collect::<vrtm::Result<_>>().map_err(said)?;
        Ok(Solved { asset, udims })
    }

    /// Sets the cells on a side of each tile's grid, in place of the library's choice.
    pub fn set_grid(&mut self, cells: u32) -> Result<()> {
        let settings = TileSettings { grid: [Some(cells); 2], ..TileSettings::default() };
        let set =
            (0..self.udims.len()).try_for_each(|tile| self.asset.tile_mut(tile).set_settings(&settings));
        set.map_err(|error| error.to_string())
    }

    /// Solves another pose.
    pub fn solve(&mut self, positions: &[[f32; 3]]) -> Result<()> {
        let solved = self.asset.solve(Strided::from_slice(positions), &SolveOptions::default());
        solved.map_err(|error| error.to_string())
    }

    /// Fetches a tile's output with two f32 channels.
    fn fetch(&self, tile: usize, kind: FetchKind, [width, height]: [u32; 2]) -> Result<Vec<[f32; 2]>> {
        let mut texels = vec![[0.0f32; 2]; width as usize * height as usize];
        self.read(tile, kind, bytemuck::cast_slice_mut(&mut texels), [width, height], PixelFormat::F32)?;
        Ok(texels)
    }

    /// The first row is v = 0, so that shaders use UVs as they are: with the first row at the top, as in image files,
    /// they would read all textures at 1 - v.
    fn read(
        &self,
        tile: usize,
        kind: FetchKind,
        bytes: &mut [u8],
        [width, height]: [u32; 2],
        format: PixelFormat,
    ) -> Result<()> {
        let layout = ImageLayout { origin: Origin::Bottom, ..ImageLayout::packed(width, height, format) };
        let image = ImageViewMut::new("image", bytes, layout);
        image
            .and_then(|mut image| self.asset.tile(tile).fetch(kind, &mut image))
            .map_err(|error| format!("tile {}: {error}", self.udims[tile]))
    }

    /// The redirection within the tile, for a texture of rg32float.
    pub fn absolute(&self, tile: usize, side: u32) -> Result<Vec<[f32; 2]>> {
        self.fetch(tile, FetchKind::Redirection, [side; 2])
    }

    /// The redirection minus the texel's own UV, as bits for a texture of rg16float, with all mip levels. Only the way
    /// that demonstrates why mip levels must not be read needs them.
    pub fn delta(&self, tile: usize, side: u32) -> Result<Vec<Vec<[u16; 2]>>> {
        let levels = mips::levels(self.fetch(tile, FetchKind::RedirectionDelta, [side; 2])?, mips::mean_uv);
        let bits = |uv: [f32; 2]| uv.map(|x| f16::from_f32(x).to_bits());
        Ok(levels.into_iter().map(|level| level.into_iter().map(bits).collect()).collect())
    }

    /// The redirection minus the texel's own UV, in f16 as the library gives it: bytes of two numbers for each texel.
    pub fn half_delta(&self, tile: usize, side: u32) -> Result<Vec<u8>> {
        let mut bytes = vec![0; side as usize * side as usize * 4];
        self.read(tile, FetchKind::RedirectionDelta, &mut bytes, [side; 2], PixelFormat::F16)?;
        Ok(bytes)
    }

    /// The same into memory of a graphics device.
    ///
    /// # Safety
    /// The handle refers to memory as the image describes it, and nothing uses the image's texels during the call.
    pub unsafe fn write_delta(&self, tile: usize, image: &ExternalImage) -> Result<()> {
        // SAFETY: the caller's promise.
        unsafe { self.asset.tile(tile).fetch_external(FetchKind::RedirectionDelta, image) }
            .map_err(|error| format!("tile {}: {error}", self.udims[tile]))
    }

    /// The warped position of each node of a tile's grid, and the cells of the grid in u and v.
    pub fn warp(&self, tile: usize) -> Result<([usize; 2], Vec<[f32; 2]>)> {
        let report = self.asset.tile(tile).report().map_err(|error| error.to_string())?;
        let nodes = self.fetch(tile, FetchKind::Warp, report.grid.map(|cells| cells + 1))?;
        Ok((report.grid.map(|cells| cells as usize), nodes))
    }
}
