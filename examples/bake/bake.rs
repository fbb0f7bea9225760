//! The part of the program that calls vrtm: it creates an asset, sets its maps, solves a pose, and fetches the results.

use vrtm::{Asset, Device, FetchKind, ImageViewMut, SolveOptions, TileReport};
use vrtm_examples::failure::{Failure, Result};
use vrtm_examples::maps::Map;
use vrtm_examples::source::{Frame, Source};

use crate::Args;
use crate::field::Field;

/// The outputs written per frame and tile.
pub const OUTPUTS: [(&str, FetchKind); 2] = [("redirect", FetchKind::Redirection), ("warp", FetchKind::Warp)];

/// The asset with its maps.
pub struct Bake<'a> {
    pub asset: Asset,
    pub tiles: Vec<Tile<'a>>,
    options: SolveOptions,
}

pub struct Tile<'a> {
    pub udim: u32,
    pub rigidity: Option<&'a Map>,
    /// Cells of the grid in u.
    pub cells: u32,
    /// Texels of the redirection, and nodes of the grid; the warp has one texel per node.
    sizes: [[u32; 2]; 2],
}

impl<'a> Bake<'a> {
    pub fn new(source: &'a Source, args: &Args, device: &Device) -> Result<Bake<'a>> {
        let mesh = &source.mesh;
        let failure = |e| Failure::named(&source.origin, e);
        let mut asset = Asset::new(device, &mesh.source(mesh.rest.view())).map_err(failure)?;
        // A tile without a map is the identity, and gets the size of the other tiles.
        let maps = source.maps.values().filter_map(|tile| tile.rigidity.as_ref());
        let fallback = maps.map(|map| map.size).max().unwrap_or([512; 2]);
        let mut tiles = Vec::new();
        for index in 0..asset.tile_count() {
            let udim = asset.tile_mut(index).info().map_err(failure)?.udim;
            let maps = source.maps.get(&udim);
            let rigidity = maps.and_then(|maps| maps.rigidity.as_ref());
            if let Some(map) = rigidity {
                let set = asset.tile_mut(index).set_rigidity(Some(map.view()?));
                set.map_err(|e| Failure::named(&map.origin, e))?;
            }
            if let Some(map) = maps.and_then(|maps| maps.mask.as_ref()) {
                let set = asset.tile_mut(index).set_mask(Some(map.view()?));
                set.map_err(|e| Failure::named(&map.origin, e))?;
            }
            let cells = args.size.map_or(rigidity.map_or(fallback, |map| map.size), |n| [n, n]);
            let mut settings = asset.tile_mut(index).settings().map_err(failure)?;
            settings.grid = [args.size; 2];
            asset.tile_mut(index).set_settings(&settings).map_err(|e| Failure::named("--size", e))?;
            let nodes = asset.tile_mut(index).info().map_err(failure)?.grid.map(|cells| cells + 1);
            let sizes = [args.map_size.map_or(cells, |n| [n, n]), nodes];
            tiles.push(Tile { udim, rigidity, cells: nodes[0] - 1, sizes });
        }
        let options = SolveOptions {
            quality: args.quality,
            warm: args.warm,
            temporal_weight: args.temporal_weight,
            measure: true,
            ..SolveOptions::default()
        };
        Ok(Bake { asset, tiles, options })
    }

    /// Solves a pose.
    pub fn solve(&mut self, frame: &Frame) -> Result<()> {
        let solved = self.asset.solve(frame.positions.view(), &self.options);
        solved.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// An output of a tile, with the channels u, v and 0.
    pub fn image(&self, tile: usize, kind: FetchKind) -> vrtm::Result<Field<3>> {
        let [width, height] = self.tiles[tile].sizes[usize::from(kind == FetchKind::Warp)];
        let mut data = vec![[0.0f32; 3]; width as usize * height as usize];
        let mut image = ImageViewMut::from_texels("image", &mut data, [width, height])?;
        self.asset.tile(tile).fetch(kind, &mut image)?;
        Ok(Field { size: [width as usize, height as usize], data })
    }

    /// The redirections of all tiles.
    pub fn redirections(&self) -> vrtm::Result<Vec<Field<3>>> {
        (0..self.tiles.len()).map(|tile| self.image(tile, FetchKind::Redirection)).collect()
    }

    /// The figures of all tiles. Once the outputs are fetched, they include the time of the inversion.
    pub fn reports(&self) -> vrtm::Result<Vec<TileReport>> {
        (0..self.tiles.len()).map(|tile| self.asset.tile(tile).report()).collect()
    }
}
