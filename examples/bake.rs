//! Bakes redirection maps for a mesh and its poses, with a sheet for visual inspection and a report.
//!
//! `cargo run --release --example bake` bakes a built-in scene into `out/`; `--help` lists the options. `Bake`, in
//! `bake/baker.rs`, shows how a host uses vrtm: it makes an asset, sets its maps, solves a pose, and fetches the results.

#[path = "bake/args.rs"]
mod args;
#[path = "bake/baker.rs"]
mod baker;
#[path = "bake/camera.rs"]
mod camera;
#[path = "bake/canvas.rs"]
mod canvas;
#[path = "bake/failure.rs"]
mod failure;
#[path = "bake/figures.rs"]
mod figures;
#[path = "bake/fingerprint.rs"]
mod fingerprint;
#[path = "bake/image_file.rs"]
mod image_file;
#[path = "bake/maps.rs"]
mod maps;
#[path = "bake/material.rs"]
mod material;
#[path = "bake/mesh.rs"]
mod mesh;
#[path = "bake/names.rs"]
mod names;
#[path = "bake/obj.rs"]
mod obj;
#[path = "bake/output.rs"]
mod output;
#[path = "bake/outputs.rs"]
mod outputs;
#[path = "bake/overwrite.rs"]
mod overwrite;
#[path = "bake/raster.rs"]
mod raster;
#[path = "bake/report.rs"]
mod report;
#[path = "scenes/mod.rs"]
mod scenes;
#[path = "bake/sheet.rs"]
mod sheet;
#[path = "bake/signals.rs"]
mod signals;
#[path = "bake/source.rs"]
mod source;
#[path = "bake/strain.rs"]
mod strain;
#[path = "bake/vertices.rs"]
mod vertices;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use serde_json::Value;
use vrtm::{AssetReport, Device, DeviceSettings, MapReport, TileReport};

use args::{Args, MapSize};
use baker::Bake;
use failure::{Failure, Result, say};
use maps::Map;
use names::Pattern;
use output::{Facts, Staging};
use outputs::Output;
use sheet::Stage;
use source::{Frame, Source};

fn main() -> ExitCode {
    let result = args::parse().map_err(Failure).and_then(|args| run(&args));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(line)) => {
            say(&line);
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<()> {
    let unfinished = signals::watch()?;
    let source = Source::load(args)?;
    let settings = DeviceSettings {
        backend: args.device.into(),
        adapter: args.adapter,
        threads: std::num::NonZeroU32::new(args.threads),
        log: Some(log()),
        ..DeviceSettings::default()
    };
    let device = Device::new(&settings).map_err(|e| Failure::named("--device", e))?;
    let outputs = Output::list(args);
    let mut bake = Bake::new(&source, args, &device)?;
    let pattern = Pattern::new(&args.name, outputs.len(), source.chosen.len(), bake.tiles.len())?;
    let planned = planned(args, &source, &bake, &outputs, &pattern);
    overwrite::check(&planned, &source.inputs, args.overwrite)?;
    warn_of_tiles(args, &source, &bake);
    let stage = Drawing::new(&source, &bake, args, &device)?;
    let bar = report::progress(source.chosen.len());
    if args.map_size == Some(MapSize::Auto) {
        bar.set_message("choosing the maps' size");
        bake = bake.sized_for_all(&source, args, &device, &outputs[0])?;
    }

    let mut document = report::header(&source, args, &device.info(), &bake.asset.info());
    document["tiles"] = Value::Array(bake.describe()?);
    let mut frames = Vec::new();
    let mut table = report::Table::new();
    let mut staging = Staging::new(&args.out, planned, unfinished)?;
    for frame in source.chosen.iter().map(|&index| &source.frames[index]) {
        let number = format!("{:04}", frame.number);
        bar.set_message(format!("solving {number}"));
        bake.solve(frame, args)?;
        bar.set_message(format!("writing {number}"));
        for tile in 0..bake.tiles.len() {
            let udim = bake.tiles[tile].udim;
            for &output in &outputs {
                let (image, inputs) = bake.image(frame, tile, output)?;
                let facts = Facts { output, udim, frame: frame.number, inputs };
                staging.exr(&pattern.name(output.kind, frame.number, udim), &image, &facts)?;
            }
        }
        if let Some(stage) = &stage {
            staging.png(&names::sheet(frame.number), &stage.draw(&source, frame, &bake)?)?;
        }
        staging.commit()?;
        let reports = bake.reports(frame)?;
        reports.iter().for_each(|report| table.add(frame.number, report));
        let maps = bake.inspect(frame, &outputs[0])?;
        let total = bake.asset.report().map_err(|e| Failure::named(&frame.origin, e))?;
        bar.suspend(|| warn(args, frame, &total, &reports, &maps));
        frames.push(report::frame(frame, &total, &reports, &maps, args.texture_size));
        bar.inc(1);
    }
    document["frames"] = Value::Array(frames);
    let text = serde_json::to_string_pretty(&document).map_err(|e| Failure::named(names::REPORT, e))?;
    staging.write(names::REPORT, (text + "\n").as_bytes())?;
    staging.commit()?;
    bar.finish_and_clear();
    table.print(&format!("written to {}", args.out.display()));
    Ok(())
}

/// Tells what the library warns of, once. What it says of a pose is told with the frame, by `warn`.
fn log() -> vrtm::LogFn {
    let told = Mutex::new(BTreeSet::new());
    Arc::new(move |level, message| {
        if level == vrtm::LogLevel::Warning
            && !message.starts_with("pose")
            && told.lock().is_ok_and(|mut told| told.insert(message.to_string()))
        {
            say(&format!("warning: {message}"));
        }
    })
}

/// All files that will be written.
fn planned(args: &Args, source: &Source, bake: &Bake, outputs: &[Output], pattern: &Pattern) -> Vec<PathBuf> {
    let mut names = vec![names::REPORT.to_string()];
    for number in source.chosen.iter().map(|&index| source.frames[index].number) {
        for tile in &bake.tiles {
            names.extend(outputs.iter().map(|output| pattern.name(output.kind, number, tile.udim)));
        }
        if !args.no_sheet {
            names.push(names::sheet(number));
        }
    }
    names.iter().map(|name| args.out.join(name)).collect()
}

/// Tells on stderr which tiles are left as they are, for want of a map.
fn warn_of_tiles(args: &Args, source: &Source, bake: &Bake) {
    let without: Vec<String> =
        bake.tiles.iter().filter(|tile| tile.rigidity.is_none()).map(|tile| tile.udim.to_string()).collect();
    if source.vertex_rigidity.is_none() && !without.is_empty() {
        let pattern =
            args.rigidity.as_ref().map_or(String::new(), |pattern| format!("--rigidity {pattern}: "));
        say(&format!(
            "warning: {pattern}no map for these tiles, which are not warped: {}",
            without.join(", ")
        ));
    }
}

/// What draws the sheets.
struct Drawing<'a>(Stage<'a>);

impl<'a> Drawing<'a> {
    /// `None` if no sheets are wanted.
    fn new(source: &'a Source, bake: &Bake, args: &Args, device: &Device) -> Result<Option<Drawing<'a>>> {
        if args.no_sheet {
            return Ok(None);
        }
        // Rigidity per vertex is shown as a map.
        let triangles = source.mesh.triangles();
        let painted: Vec<Option<Map>> = bake
            .tiles
            .iter()
            .map(|tile| {
                let values = source.vertex_rigidity.as_ref()?;
                Some(vertices::rasterised(values, &triangles, tile.udim))
            })
            .collect();
        let maps = bake.tiles.iter().zip(&painted);
        let tiles: Vec<_> =
            maps.map(|(tile, painted)| (tile.udim, painted.as_ref().or(tile.rigidity))).collect();
        let poses: Vec<&[[f32; 3]]> = source.frames.iter().map(|f| f.positions.as_slice()).collect();
        Ok(Some(Drawing(Stage::new(&source.mesh, &tiles, &poses, args, device.info().threads as usize))))
    }

    fn draw(&self, source: &Source, frame: &Frame, bake: &Bake) -> Result<image::RgbImage> {
        let title = format!("{}   frame {}   {}", source.name, frame.number, frame.note);
        Ok(self.0.draw(&title, &frame.positions, &bake.shown(frame)?))
    }
}

/// Tells on stderr what nobody can have meant.
fn warn(args: &Args, frame: &Frame, asset: &AssetReport, tiles: &[TileReport], maps: &[MapReport]) {
    let say = |text: String| failure::say(&format!("warning: frame {}: {text}", frame.number));
    let origin = &frame.origin;
    if !(1.0 / 3.0..=3.0).contains(&asset.median_stretch) {
        let factor = asset.median_stretch;
        say(format!(
            "{origin}: edges are {factor:.3} times as long as at rest (median): is it in other units, or are the \
             vertices in another order?"
        ));
    } else if asset.stretched_share > 0.05 {
        let percent = 100.0 * asset.stretched_share;
        say(format!(
            "{origin}: {percent:.1} % of the edges are more than 3 times as long as at rest: are the vertices in the order \
             of the rest mesh?"
        ));
    }
    let advice = match (args.exact, args.half) {
        (true, _) => "; without --exact they need not",
        (false, true) => "; numbers of 16 bits are too coarse for it: leave --half out, or take --form delta",
        (false, false) => "",
    };
    for (tile, map) in tiles.iter().zip(maps).filter(|(_, map)| map.folds > 0) {
        say(format!(
            "tile {}: {} squares between four texels of the redirection fold under bilinear lookup{advice}",
            tile.udim, map.folds
        ));
    }
}
