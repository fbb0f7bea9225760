//! The part of the program that calls vrtm: it creates an asset, sets its maps, solves a pose, and fetches the results.

use vrtm::{
    Asset, AssetReport, Backend, Device, FetchKind, ImageViewMut, MapDesc, MapReport, MeshSource,
    PixelFormat, SolveOptions, Strided, TileReport, UvSource,
};
use xxhash_rust::xxh3::Xxh3;

use crate::args::Args;
use crate::failure::{Failure, Result};
use crate::maps::{Field, Map};
use crate::mesh::Positions;
use crate::source::{Frame, Source};

/// The outputs written per frame and tile.
pub const OUTPUTS: [(&str, FetchKind); 2] = [("redirect", FetchKind::Redirection), ("warp", FetchKind::Warp)];

/// The asset with its maps.
pub struct Bake<'a> {
    pub asset: Asset,
    pub tiles: Vec<Tile<'a>>,
    options: SolveOptions,
    /// A hash of all poses that the next result depends on.
    poses: Xxh3,
}

pub struct Tile<'a> {
    pub udim: u32,
    pub rigidity: Option<&'a Map>,
    /// Cells of the grid in u.
    pub cells: u32,
    /// Texels of the redirection, and nodes of the grid; the warp has one texel per node.
    sizes: [[u32; 2]; 2],
    /// A hash of everything that the tile's files depend on, except poses and sizes.
    inputs: Xxh3,
}

impl<'a> Bake<'a> {
    pub fn new(source: &'a Source, args: &Args, device: &Device) -> Result<Bake<'a>> {
        let mesh = &source.mesh;
        let failure = |e| Failure::named(&source.origin, e);
        let uvs = Strided::from_f32x2(&mesh.uvs);
        let mut asset = Asset::new(
            device,
            &MeshSource {
                positions: mesh.rest.view(),
                face_counts: Some(&mesh.face_counts),
                indices: &mesh.indices,
                uvs: UvSource { u: uvs, v: None, indices: Some(&mesh.uv_indices) },
                ..MeshSource::default()
            },
        )
        .map_err(failure)?;
        let options = SolveOptions {
            quality: args.quality,
            warm: args.warm,
            temporal_weight: args.temporal_weight,
            measure: true,
            ..SolveOptions::default()
        };

        let mut common = Xxh3::new();
        // The CPU gives the same bits on every machine.
        let info = device.info();
        let name = (info.backend == Backend::Gpu).then_some(info.name);
        add(&mut common, format!("{} {name:?} {options:?}", env!("CARGO_PKG_VERSION")).bytes());
        add(&mut common, numbers(&mesh.rest));
        add(&mut common, floats(mesh.uvs.as_flattened()));
        for list in [&mesh.face_counts, &mesh.indices, &mesh.uv_indices] {
            add(&mut common, list.iter().flat_map(|n| n.to_le_bytes()));
        }

        // A tile without a map is the identity, and gets the size of the other tiles.
        let maps = source.maps.values().filter_map(|tile| tile.rigidity.as_ref());
        let fallback = maps.map(|map| map.size).max().unwrap_or([512; 2]);
        let mut tiles = Vec::new();
        for index in 0..asset.tile_count() {
            let udim = asset.tile_info(index).map_err(failure)?.udim;
            let maps = source.maps.get(&udim);
            let [rigidity, mask] =
                [maps.and_then(|maps| maps.rigidity.as_ref()), maps.and_then(|maps| maps.mask.as_ref())];
            if let Some(map) = rigidity {
                let set = asset.set_rigidity(index, Some(map.view()?));
                set.map_err(|e| Failure::named(&map.origin, e))?;
            }
            if let Some(map) = mask {
                let set = asset.set_mask(index, Some(map.view()?));
                set.map_err(|e| Failure::named(&map.origin, e))?;
            }
            let cells = args.size.map_or(rigidity.map_or(fallback, |map| map.size), |n| [n, n]);
            let mut settings = asset.settings(index).map_err(failure)?;
            settings.grid = [args.size.map(|n| n.min(vrtm::MAX_GRID)); 2];
            asset.set_settings(index, &settings).map_err(|e| Failure::named("--size", e))?;
            let nodes = asset.tile_info(index).map_err(failure)?.grid.map(|cells| cells + 1);
            let mut inputs = common.clone();
            add(&mut inputs, format!("{udim} {settings:?}").bytes());
            for map in [rigidity, mask] {
                add(&mut inputs, format!("{:?}", map.map(|map| (map.format, map.size))).bytes());
                add(&mut inputs, map.iter().flat_map(|map| map.bytes.iter().copied()));
            }
            let sizes = [args.map_size.map_or(cells, |n| [n, n]), nodes];
            tiles.push(Tile { udim, rigidity, cells: nodes[0] - 1, sizes, inputs });
        }
        Ok(Bake { asset, tiles, options, poses: Xxh3::new() })
    }

    /// Solves a pose.
    pub fn solve(&mut self, frame: &Frame) -> Result<()> {
        if !self.options.warm {
            self.poses = Xxh3::new();
        }
        add(&mut self.poses, numbers(&frame.positions));
        let solved = self.asset.solve(frame.positions.view(), &self.options);
        solved.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// An output of a tile, with the channels u, v and 0, and a hash of its inputs.
    pub fn image(&self, tile: usize, kind: FetchKind) -> vrtm::Result<(Field<3>, String)> {
        let Tile { sizes, inputs, .. } = &self.tiles[tile];
        let [width, height] = sizes[usize::from(kind == FetchKind::Warp)];
        let mut data = vec![[0.0f32; 3]; width as usize * height as usize];
        let mut image = ImageViewMut::from_texels("image", &mut data, [width, height])?;
        self.asset.fetch(tile, kind, &mut image)?;
        let mut inputs = inputs.clone();
        add(&mut inputs, format!("{kind:?} {width} {height} {}", self.poses.digest128()).bytes());
        let size = [width as usize, height as usize];
        Ok((Field { size, data }, format!("{:032x}", inputs.digest128())))
    }

    /// The redirection of each tile in a pose that is not a frame of its own.
    pub fn redirections(&mut self, frame: &Frame) -> Result<Vec<Field<3>>> {
        self.solve(frame)?;
        let of = |tile: usize| self.image(tile, FetchKind::Redirection).map(|(image, _)| image);
        let all: vrtm::Result<_> = (0..self.tiles.len()).map(of).collect();
        all.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// The figures of a frame: those of the asset, those of each tile, and the accuracy of each redirection under
    /// bilinear lookup. Once the outputs are fetched, the tiles' figures include the time of the inversion.
    pub fn reports(&self) -> vrtm::Result<(AssetReport, Vec<(TileReport, MapReport)>)> {
        let of = |(index, tile): (usize, &Tile)| {
            let (kind, format) = (FetchKind::Redirection, PixelFormat::F32);
            let map = MapDesc { kind, format, size: tile.sizes[0] };
            Ok((self.asset.tile_report(index)?, self.asset.inspect_map(index, &map)?))
        };
        Ok((self.asset.report()?, self.tiles.iter().enumerate().map(of).collect::<vrtm::Result<_>>()?))
    }
}

/// The bytes of positions, which also tell their format: a result depends on it.
fn numbers(positions: &Positions) -> Box<dyn Iterator<Item = u8> + '_> {
    match positions {
        Positions::F32(points) => Box::new(floats(points.as_flattened())),
        Positions::F64(points) => Box::new(points.as_flattened().iter().flat_map(|x| x.to_le_bytes())),
    }
}

fn floats(values: &[f32]) -> impl Iterator<Item = u8> {
    values.iter().flat_map(|x| x.to_le_bytes())
}

/// Adds bytes to a hash, preceded by their length, so that different lists of inputs never form the same bytes.
fn add(hash: &mut Xxh3, bytes: impl Iterator<Item = u8>) {
    let bytes: Vec<u8> = bytes.collect();
    hash.update(&(bytes.len() as u64).to_le_bytes());
    hash.update(&bytes);
}
