//! The part of the program that calls vrtm.

use serde_json::Value;
use vrtm::{
    Asset, Device, FetchKind, ImageLayout, ImageViewMut, MapDesc, MapReport, MeshSource, PbdSettings,
    PixelFormat, SolveOptions, Strided, TileReport, UvSource,
};

use crate::args::{Args, MapSize};
use crate::failure::{Failure, Result};
use crate::fingerprint::Fingerprint;
use crate::maps::{Field, Map};
use crate::outputs::{Image, Output};
use crate::report;
use crate::sheet::TileResult;
use crate::source::{Frame, Source};

/// Texels per side that maps have at least with `--map-size auto`.
const SMALLEST: u32 = 64;

/// A bake: the asset with its maps, and what is written of it.
pub struct Bake<'a> {
    pub asset: Asset,
    pub tiles: Vec<Tile<'a>>,
    options: SolveOptions,
    /// Of all poses that the next result depends on.
    poses: Fingerprint,
}

pub struct Tile<'a> {
    pub udim: u32,
    pub rigidity: Option<&'a Map>,
    pub mask: Option<&'a Map>,
    /// Size of the maps in texels.
    pub size: [u32; 2],
    /// Nodes of the grid, which the warp has a texel for each.
    nodes: [u32; 2],
    /// Of all that the tile's files depend on, poses excepted.
    inputs: Fingerprint,
}

impl<'a> Bake<'a> {
    pub fn new(source: &'a Source, args: &Args, device: &Device) -> Result<Bake<'a>> {
        let mesh = &source.mesh;
        let mesh_failure = |e| Failure::named(&source.origin, e);
        let uvs = Strided::from_f32x2(&mesh.uvs);
        let mut asset = Asset::new(
            device,
            &MeshSource {
                positions: Strided::from_f32x3(&mesh.rest),
                face_counts: Some(&mesh.face_counts),
                indices: &mesh.indices,
                uvs: UvSource { u: uvs, v: None, indices: Some(&mesh.uv_indices) },
                weld: args.weld.into(),
                ..MeshSource::default()
            },
        )
        .map_err(mesh_failure)?;

        let options = options(args);
        let mut common = Fingerprint::new(mesh, &device.info());
        common.text(&format!("{options:?} {:?}", args.weld));
        if let Some(values) = &source.vertex_rigidity {
            let set = asset.set_vertex_rigidity(Some(Strided::from_f32(values)));
            set.map_err(|e| Failure::named("--vertex-rigidity", e))?;
            common.text("rigidity");
            common.floats(values);
        }
        if let Some(values) = &source.vertex_mask {
            let set = asset.set_vertex_mask(Some(Strided::from_f32(values)));
            set.map_err(|e| Failure::named("--vertex-mask", e))?;
            common.text("mask");
            common.floats(values);
        }

        // A tile without a map is the identity; it gets the size of the others.
        let sizes = source.maps.values().filter_map(|tile| tile.rigidity.as_ref());
        let alone = if source.vertex_rigidity.is_some() { [1024; 2] } else { [512; 2] };
        let fallback = sizes.map(|map| [map.width, map.height]).max().unwrap_or(alone);
        let mut tiles = Vec::new();
        for index in 0..asset.tile_count() {
            let udim = asset.tile_info(index).map_err(mesh_failure)?.udim;
            let maps = source.maps.get(&udim);
            let rigidity = maps.and_then(|maps| maps.rigidity.as_ref());
            let mask = maps.and_then(|maps| maps.mask.as_ref());
            if let Some(map) = rigidity {
                let view = Some(map.view()?);
                asset.set_rigidity(index, view).map_err(|e| Failure::named(&map.origin, e))?;
            }
            if let Some(map) = mask {
                let view = Some(map.view()?);
                asset.set_mask(index, view).map_err(|e| Failure::named(&map.origin, e))?;
            }
            let own = rigidity.map_or(fallback, |map| [map.width, map.height]);
            let cells = args.size.map_or(own, |n| [n, n]);
            let mut settings = asset.settings(index).map_err(mesh_failure)?;
            settings.grid = cells.map(|n| Some(n.min(vrtm::MAX_GRID)));
            asset.set_settings(index, &settings).map_err(|e| Failure::named("--size", e))?;
            let nodes = asset.tile_info(index).map_err(mesh_failure)?.grid.map(|cells| cells + 1);
            let size = match args.map_size {
                Some(MapSize::Texels(n)) => [n, n],
                _ => cells,
            };
            let mut inputs = common.clone();
            inputs.text(&format!("{udim} {settings:?}"));
            inputs.map(rigidity);
            inputs.map(mask);
            tiles.push(Tile { udim, rigidity, mask, size, nodes, inputs });
        }
        Ok(Bake { asset, tiles, options, poses: Fingerprint::default() })
    }

    /// Figures of the tiles for the report.
    pub fn describe(&mut self) -> Result<Vec<Value>> {
        let mut list = Vec::new();
        for (index, tile) in self.tiles.iter().enumerate() {
            let failure = |e| Failure::named(&format!("tile {}", tile.udim), e);
            let info = self.asset.tile_info(index).map_err(failure)?;
            let settings = self.asset.settings(index).map_err(failure)?;
            let origin = |map: Option<&'a Map>| map.map(|map| map.origin.as_str());
            list.push(report::tile(&info, &settings, origin(tile.rigidity), origin(tile.mask)));
        }
        Ok(list)
    }

    /// Another bake of the same source, each tile's maps as small as the texture allows: the smallest power of two at which
    /// 99 % of every frame's map, read bilinearly, is off by at most half a texel of the texture. All frames get one size:
    /// programs that play a sequence take the first one's for all.
    pub fn sized_for_all(
        mut self,
        source: &'a Source,
        args: &Args,
        device: &Device,
        redirection: &Output,
    ) -> Result<Bake<'a>> {
        let fine = |map: &MapReport| map.error_p99 * f64::from(args.texture_size) <= 0.5;
        self.tiles.iter_mut().for_each(|tile| tile.size = [SMALLEST; 2]);
        for frame in source.chosen.iter().map(|&index| &source.frames[index]) {
            self.solve(frame, args)?;
            for tile in 0..self.tiles.len() {
                while self.tiles[tile].size[0] < vrtm::MAX_GRID
                    && !fine(&self.inspect_tile(frame, tile, redirection)?)
                {
                    self.tiles[tile].size = self.tiles[tile].size.map(|n| 2 * n);
                }
            }
        }
        let sizes: Vec<[u32; 2]> = self.tiles.iter().map(|tile| tile.size).collect();
        drop(self);
        // With a warm start the first frame has to start as it did.
        let mut sized = Bake::new(source, args, device)?;
        for (tile, size) in sized.tiles.iter_mut().zip(sizes) {
            tile.size = size;
        }
        Ok(sized)
    }

    /// Solves a pose.
    pub fn solve(&mut self, frame: &Frame, args: &Args) -> Result<()> {
        if !args.warm {
            self.poses = Fingerprint::default();
        }
        self.poses.floats(frame.positions.as_flattened());
        let solved = self.asset.solve(Strided::from_f32x3(&frame.positions), &self.options);
        solved.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// One output of a tile, and a hash of what it depends on.
    pub fn image(&self, frame: &Frame, tile: usize, output: Output) -> Result<(Image, String)> {
        let of = &self.tiles[tile];
        let size = if output.fetch == FetchKind::Warp { of.nodes } else { of.size };
        let image = output.image(&self.asset, tile, size).map_err(|e| Failure::named(&frame.origin, e))?;
        let mut inputs = of.inputs.clone();
        inputs.text(&self.poses.hex());
        output.add_to(&mut inputs, size);
        Ok((image, inputs.hex()))
    }

    /// What the sheet shows of each tile.
    pub fn shown(&self, frame: &Frame) -> Result<Vec<TileResult>> {
        let of = |(index, tile): (usize, &Tile)| -> vrtm::Result<TileResult> {
            // The sheet shows no more texels than that.
            let size = tile.size.map(|n| n.min(2048));
            let redirect = pairs(&self.asset, index, FetchKind::Redirection, size)?;
            let warp = pairs(&self.asset, index, FetchKind::Warp, tile.nodes)?;
            Ok(TileResult { redirect, warp, report: self.asset.tile_report(index)? })
        };
        let all: vrtm::Result<_> = self.tiles.iter().enumerate().map(of).collect();
        all.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// Each tile's report. After the outputs were fetched it has the time of the inversion, too.
    pub fn reports(&self, frame: &Frame) -> Result<Vec<TileReport>> {
        let all: vrtm::Result<_> = (0..self.tiles.len()).map(|tile| self.asset.tile_report(tile)).collect();
        all.map_err(|e| Failure::named(&frame.origin, e))
    }

    /// Each tile's redirection as it is written: how it does under bilinear lookup.
    pub fn inspect(&self, frame: &Frame, redirection: &Output) -> Result<Vec<MapReport>> {
        (0..self.tiles.len()).map(|tile| self.inspect_tile(frame, tile, redirection)).collect()
    }

    fn inspect_tile(&self, frame: &Frame, tile: usize, redirection: &Output) -> Result<MapReport> {
        let Output { fetch: kind, format, one_to_one, .. } = *redirection;
        let map = MapDesc { kind, format, size: self.tiles[tile].size, one_to_one };
        self.asset.inspect_map(tile, &map).map_err(|e| Failure::named(&frame.origin, e))
    }
}

/// How to solve.
fn options(args: &Args) -> SolveOptions {
    SolveOptions {
        quality: args.quality.into(),
        warm: args.warm,
        temporal_weight: args.temporal_weight,
        solver: args.solver.into(),
        pbd: PbdSettings { iterations: args.iterations, ..PbdSettings::default() },
        measure: true,
        ..SolveOptions::default()
    }
}

/// Reads an output of two f32 channels, first row at the top.
fn pairs(asset: &Asset, tile: usize, kind: FetchKind, [width, height]: [u32; 2]) -> vrtm::Result<Field<2>> {
    let (columns, rows) = (width as usize, height as usize);
    let mut bytes = vec![0u8; columns * rows * 8];
    let layout = ImageLayout::packed(width, height, PixelFormat::F32);
    asset.fetch(tile, kind, &mut ImageViewMut::new("image", &mut bytes, layout)?)?;
    let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    let data = bytes.chunks_exact(8).map(|b| [float(b), float(&b[4..])]).collect();
    Ok(Field { width: columns, height: rows, data })
}
