//! Bakes redirection maps for a mesh and its poses, with sheets and a film for visual inspection and a report.
//!
//! `cargo run --release --example bake` bakes a built-in scene into `out/`; `--help` lists the options. `Bake`, in
//! `bake.rs`, shows how a host uses vrtm. For production there is the command `vrtm bake` in bindings/python.

mod args;
mod bake;
mod draw;
mod encode;
mod failure;
mod maps;
mod mesh;
mod obj;
mod output;
mod overwrite;
mod report;
mod source;

use std::collections::BTreeSet;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use serde_json::Value;
use vrtm::{AssetReport, Device, DeviceSettings, FetchKind, LogCode, LogLevel};

use args::Args;
use bake::{Bake, OUTPUTS};
use draw::sheet::Sheet;
use draw::stage::Stage;
use encode::Facts;
use failure::{Failure, Result, say};
use maps::Map;
use output::Output;
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
    output::watch_signals()?;
    let mut source = Source::load(&args.files())?;
    if let Some(frames) = &args.frames {
        source.chosen = frames.among(&source)?;
    }
    let settings = DeviceSettings { backend: args.device, log: Some(log()), ..DeviceSettings::default() };
    let device = Device::new(&settings).map_err(|e| Failure::named("--device", e))?;
    let mut bake = Bake::new(&source, args, &device)?;
    let planned = planned(args, &source, &bake);
    overwrite::check(&args.out, &planned, &source.inputs, args.overwrite)?;
    warn_of_order(&args.pose);
    warn_of_tiles(args, &bake);
    warn_of_maps(&source, &bake);
    let stage = (!args.no_sheet || !args.no_film).then(|| Stage::new(&source, &bake));
    let sheet = stage.as_ref().filter(|_| !args.no_sheet).map(|stage| Sheet::new(stage, &bake, args.view));

    let failure = |e| Failure::named(&source.origin, e);
    let tiles: vrtm::Result<Vec<_>> = (0..bake.tiles.len()).map(|tile| bake.asset.tile_info(tile)).collect();
    let mut document =
        report::header(&source, args, &device.info(), &bake.asset.info(), &tiles.map_err(failure)?);
    let mut frames = Vec::new();
    let mut worst: Option<(&Frame, f64)> = None;
    let mut output = Output::new(&args.out, planned)?;
    print(&format!("frame  {}", report::TITLES));
    for frame in source.chosen.iter().map(|&index| &source.frames[index]) {
        let failure = |e| Failure::named(&frame.origin, e);
        bake.solve(frame)?;
        let mut redirections = Vec::new();
        for (tile, udim) in bake.tiles.iter().map(|tile| tile.udim).enumerate() {
            for (kind, fetch) in OUTPUTS {
                let (image, inputs) = bake.image(tile, fetch).map_err(failure)?;
                let name = map_name(kind, frame.number, udim);
                let facts = Facts { kind, udim, frame: frame.number, inputs };
                let bytes = encode::exr(&image, &facts).map_err(|e| Failure::named(&name, e))?;
                output.write(&name, &bytes)?;
                if fetch == FetchKind::Redirection {
                    redirections.push(image);
                }
            }
        }
        let (asset, tiles) = bake.reports().map_err(failure)?;
        let reports: Vec<_> = tiles.iter().map(|(tile, _)| tile).collect();
        if let Some(sheet) = &sheet {
            let title = format!("{}   frame {}   {}", source.name, frame.number, frame.note);
            let name = sheet_name(frame.number);
            let picture = sheet.draw(&title, &frame.positions, &redirections, &reports);
            output.write(&name, &encode::png(&picture).map_err(|e| Failure::named(&name, e))?)?;
        }
        reports.iter().for_each(|tile| print(&format!("{:>5}  {}", frame.number, report::line(tile))));
        warn_of_pose(frame, &asset);
        frames.push(report::frame(frame, &asset, &tiles));
        let strain = report::strain_before(&tiles);
        if worst.is_none_or(|(_, most)| strain > most) {
            worst = Some((frame, strain));
        }
    }
    if let (Some(stage), Some((frame, _)), false) = (&stage, worst, args.no_film) {
        let film = draw::film::draw(stage, &mut bake, args.view, frame)?;
        let bytes = encode::film(&film, draw::film::DURATION).map_err(|e| Failure::named(FILM, e))?;
        output.write(FILM, &bytes)?;
    }
    document["frames"] = Value::Array(frames);
    output.write(REPORT, format!("{document:#}\n").as_bytes())?;
    print(&format!("written to {}", args.out.display()));
    Ok(())
}

const REPORT: &str = "report.json";
const FILM: &str = "turning.png";

fn map_name(kind: &str, frame: usize, udim: u32) -> String {
    format!("{kind}.{frame:04}.{udim}.exr")
}

fn sheet_name(frame: usize) -> String {
    format!("sheet.{frame:04}.png")
}

/// The names of all files that will be written.
fn planned(args: &Args, source: &Source, bake: &Bake) -> Vec<String> {
    let mut names = vec![REPORT.to_string()];
    for number in source.chosen.iter().map(|&index| source.frames[index].number) {
        for tile in &bake.tiles {
            names.extend(OUTPUTS.map(|(kind, _)| map_name(kind, number, tile.udim)));
        }
        if !args.no_sheet {
            names.push(sheet_name(number));
        }
    }
    if !args.no_film {
        names.push(FILM.into());
    }
    names
}

/// Prints a line. The bake does not fail if a reader closes the pipe early (`bake | head`).
fn print(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Prints each of the library's warnings once. Warnings about a pose are printed with the frame, by `warn_of_pose`.
fn log() -> vrtm::LogFn {
    let told = Mutex::new(BTreeSet::new());
    Arc::new(move |entry| {
        if entry.level == LogLevel::Warning
            && !matches!(entry.code, LogCode::PoseScale | LogCode::PoseOrder)
            && told.lock().is_ok_and(|mut told| told.insert(entry.message.to_string()))
        {
            say(&format!("warning: {}", entry.message));
        }
    })
}

/// Names the tiles that stay unchanged because they have no map.
fn warn_of_tiles(args: &Args, bake: &Bake) {
    let tiles = bake.tiles.iter().filter(|tile| tile.rigidity.is_none());
    let without: Vec<String> = tiles.map(|tile| tile.udim.to_string()).collect();
    if !without.is_empty() {
        let pattern = args.rigidity.as_ref().map_or(String::new(), |text| format!("--rigidity {text}: "));
        let list = without.join(", ");
        say(&format!("warning: {pattern}no map for these tiles, which are not warped: {list}"));
    }
}

/// Warns of poses that are not in the order of their numbers, as a shell lists `pose.-2.obj`, or `pose.10.obj`.
fn warn_of_order(poses: &[PathBuf]) {
    let numbers: Vec<_> = poses.iter().map(|path| number(path)).collect();
    let is_back = |pair: &[Option<(String, i64)>]| match pair {
        [Some((name, before)), Some((other, after))] => name == other && before > after,
        _ => false,
    };
    if let Some(k) = numbers.windows(2).position(is_back) {
        let [before, after] = [&poses[k], &poses[k + 1]].map(|path| path.display());
        let text = "frames are in the order in which --pose lists them";
        say(&format!("warning: {before} comes before {after}: {text}"));
    }
}

/// The last number of a file's name, and the name without it. A hyphen before it is a minus sign, but for one behind a letter
/// or a digit.
fn number(path: &Path) -> Option<(String, i64)> {
    let name = path.file_stem()?.to_str()?;
    let is_digit = |c: char| c.is_ascii_digit();
    let end = name.rfind(is_digit)? + 1;
    let before = name[..end].trim_end_matches(is_digit);
    let signed = before.strip_suffix('-').filter(|before| !before.ends_with(|c: char| c.is_alphanumeric()));
    let start = signed.unwrap_or(before).len();
    Some((format!("{} {}", &name[..start], &name[end..]), name[start..end].parse().ok()?))
}

/// Warns of faces that are not baked, and of maps that are hardly meant as they are: of 0 and 1 in the place of 0 and 255, or
/// of 8 to 12 bits in an image of 16. The limit is that of `vrtm bake`.
fn warn_of_maps(source: &Source, bake: &Bake) {
    let without = bake.asset.info().faces_untextured;
    if without > 0 {
        say(&format!("warning: {}: faces without UVs (vt), which are not baked: {without}", source.origin));
    }
    let all = || bake.tiles.iter().filter_map(|tile| source.maps.get(&tile.udim));
    let rigidity: Vec<&Map> = all().filter_map(|maps| maps.rigidity.as_ref()).collect();
    let masks = all().filter_map(|maps| maps.mask.as_ref());
    // A black map beside others is one of a tile without features.
    if !rigidity.is_empty() && rigidity.iter().all(|map| map.largest().0 == 0) {
        let names: Vec<&str> = rigidity.iter().map(|map| map.origin.as_str()).collect();
        say(&format!("warning: {}: black all over: nothing keeps its shape there", names.join(", ")));
    }
    for (maps, then) in [(rigidity, "keeps its shape"), (masks.collect(), "moves")] {
        for map in maps {
            let (largest, one) = map.largest();
            if largest > 0 && largest < one / 10 {
                let (origin, least) = (&map.origin, format!("no value above {largest} of {one}"));
                say(&format!("warning: {origin} has {least}: next to nothing {then} there, white is {one}"));
            }
        }
    }
}

/// Warns of results that are certainly unintended.
fn warn_of_pose(frame: &Frame, asset: &AssetReport) {
    let (factor, percent) = (asset.median_stretch, 100.0 * asset.stretched_share);
    let text = if !(1.0 / 3.0..=3.0).contains(&factor) {
        format!(
            "edges are {factor:.3} times as long as at rest (median): is it in other units, or are the vertices in \
             another order?"
        )
    } else if percent > 5.0 {
        format!(
            "{percent:.1} % of the edges are more than 3 times as long as at rest: are the vertices in the order of the \
             rest mesh?"
        )
    } else {
        return;
    };
    say(&format!("warning: frame {}: {}: {text}", frame.number, frame.origin));
}
