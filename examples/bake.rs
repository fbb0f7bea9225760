//! Bakes redirection maps for a mesh and its poses, with a sheet for visual inspection and a report.
//!
//! `cargo run --release --example bake` bakes a built-in scene into `out/`; `--help` lists the options. `Bake` shows
//! how a host uses vrtm: it makes an asset, sets its maps, solves a pose, and fetches the results.

#[path = "bake/args.rs"]
mod args;
#[path = "bake/camera.rs"]
mod camera;
#[path = "bake/canvas.rs"]
mod canvas;
#[path = "bake/failure.rs"]
mod failure;
#[path = "bake/figures.rs"]
mod figures;
#[path = "bake/maps.rs"]
mod maps;
#[path = "bake/material.rs"]
mod material;
#[path = "bake/mesh.rs"]
mod mesh;
#[path = "bake/obj.rs"]
mod obj;
#[path = "bake/output.rs"]
mod output;
#[path = "bake/raster.rs"]
mod raster;
#[path = "bake/report.rs"]
mod report;
#[path = "scenes/mod.rs"]
mod scenes;
#[path = "bake/sheet.rs"]
mod sheet;
#[path = "bake/source.rs"]
mod source;
#[path = "bake/strain.rs"]
mod strain;

use std::process::ExitCode;

use serde_json::Value;
use vrtm::{
    Asset, Device, DeviceSettings, FetchKind, ImageLayout, ImageViewMut, MeshSource, PbdSettings,
    PixelFormat, SolveOptions, Strided, UvSource,
};

use args::Args;
use failure::{Failure, Result};
use maps::{Field, Map};
use output::Staging;
use sheet::{Stage, TileResult};
use source::{Frame, Source};

fn main() -> ExitCode {
    let result = args::parse().map_err(Failure).and_then(|args| run(&args));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(line)) => {
            eprintln!("bake: {line}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<()> {
    let source = Source::load(args)?;
    let settings = DeviceSettings {
        backend: args.device.into(),
        adapter: args.adapter,
        threads: std::num::NonZeroU32::new(args.threads),
        ..DeviceSettings::default()
    };
    let device = Device::new(&settings).map_err(|e| Failure::named("--device", e))?;
    let mut bake = Bake::new(&source, args, &device)?;

    let tiles: Vec<(u32, Option<&Map>)> = bake.tiles.iter().map(|t| (t.udim, t.rigidity)).collect();
    let poses: Vec<&[[f32; 3]]> = source.frames.iter().map(|f| f.positions.as_slice()).collect();
    let stage = Stage::new(&source.mesh, &tiles, &poses, args, device.info().threads as usize);

    let mut document = report::header(&source, args, &device.info(), &bake.asset.info());
    document["tiles"] = Value::Array(bake.describe()?);
    let mut frames = Vec::new();
    let mut table = report::Table::new();
    let mut staging = Staging::new(&args.out)?;
    let bar = report::progress(source.chosen.len());
    for frame in source.chosen.iter().map(|&index| &source.frames[index]) {
        let number = format!("{:04}", frame.number);
        bar.set_message(format!("solving {number}"));
        let results = bake.frame(frame, args)?;
        bar.set_message(format!("writing {number}"));
        for result in &results {
            let udim = result.report.udim;
            staging.exr(&format!("redirect.{number}.{udim}.exr"), &result.redirect)?;
            staging.exr(&format!("warp.{number}.{udim}.exr"), &result.warp)?;
            table.add(frame.number, &result.report);
        }
        let title = format!("{}   frame {}   {}", source.name, frame.number, frame.note);
        staging.png(&format!("sheet.{number}.png"), &stage.draw(&title, &frame.positions, &results))?;
        staging.commit()?;
        let reports: Vec<_> = results.iter().map(|r| r.report).collect();
        let total = bake.asset.report().map_err(|e| Failure::named(&frame.origin, e))?;
        frames.push(report::frame(frame.number, &frame.note, &total, &reports));
        bar.inc(1);
    }
    document["frames"] = Value::Array(frames);
    let text = serde_json::to_string_pretty(&document).map_err(|e| Failure::named("report.json", e))?;
    staging.text("report.json", (text + "\n").as_bytes())?;
    staging.commit()?;
    bar.finish_and_clear();
    table.print();
    println!("written to {}", args.out.display());
    Ok(())
}

/// The part of the program that calls vrtm.
struct Bake<'a> {
    asset: Asset,
    tiles: Vec<Tile<'a>>,
}

struct Tile<'a> {
    udim: u32,
    rigidity: Option<&'a Map>,
    mask: Option<&'a Map>,
    /// Size of the redirection map in texels.
    size: [u32; 2],
}

impl<'a> Bake<'a> {
    fn new(source: &'a Source, args: &Args, device: &Device) -> Result<Bake<'a>> {
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

        // A tile without a map is the identity; it gets the size of the others.
        let sizes = source.maps.values().filter_map(|tile| tile.rigidity.as_ref());
        let fallback = sizes.map(|map| [map.width, map.height]).max().unwrap_or([512, 512]);
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
            let size = args.size.map_or(own, |n| [n, n]);
            let mut settings = asset.settings(index).map_err(mesh_failure)?;
            settings.grid = size.map(|n| Some(n.min(vrtm::MAX_GRID)));
            asset.set_settings(index, &settings).map_err(|e| Failure::named("--size", e))?;
            tiles.push(Tile { udim, rigidity, mask, size });
        }
        Ok(Bake { asset, tiles })
    }

    /// Figures of the tiles for the report.
    fn describe(&mut self) -> Result<Vec<Value>> {
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

    /// Solves a pose and fetches each tile's results.
    fn frame(&mut self, frame: &Frame, args: &Args) -> Result<Vec<TileResult>> {
        let failure = |e| Failure::named(&frame.origin, e);
        let options = SolveOptions {
            quality: args.quality.into(),
            warm: args.warm,
            temporal_weight: args.temporal_weight,
            solver: args.solver.into(),
            pbd: PbdSettings { iterations: args.iterations, ..PbdSettings::default() },
            measure: true,
            ..SolveOptions::default()
        };
        self.asset.solve(Strided::from_f32x3(&frame.positions), &options).map_err(failure)?;
        let mut results = Vec::new();
        for (index, tile) in self.tiles.iter().enumerate() {
            let grid = self.asset.tile_info(index).map_err(failure)?.grid;
            let nodes = grid.map(|cells| cells + 1);
            let redirect =
                fetch(&mut self.asset, index, FetchKind::Redirection, tile.size).map_err(failure)?;
            let warp = fetch(&mut self.asset, index, FetchKind::Warp, nodes).map_err(failure)?;
            // The report is read after the fetch, so that it contains the time of the inversion.
            let report = self.asset.tile_report(index).map_err(failure)?;
            results.push(TileResult { redirect, warp, report });
        }
        Ok(results)
    }
}

/// Reads one output into an image of two f32 channels, first row at the top.
fn fetch(
    asset: &mut Asset,
    tile: usize,
    kind: FetchKind,
    [width, height]: [u32; 2],
) -> vrtm::Result<Field<2>> {
    let (columns, rows) = (width as usize, height as usize);
    let mut bytes = vec![0u8; columns * rows * 8];
    let layout = ImageLayout::packed(width, height, PixelFormat::F32);
    asset.fetch(tile, kind, &mut ImageViewMut::new("image", &mut bytes, layout)?)?;
    let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    let data = bytes.chunks_exact(8).map(|b| [float(b), float(&b[4..])]).collect();
    Ok(Field { width: columns, height: rows, data })
}
