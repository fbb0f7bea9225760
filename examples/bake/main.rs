//! Bakes redirection maps for a mesh and its poses, with sheets and a film for visual inspection.
//!
//! `cargo run --release --example bake` bakes a built-in scene into `out/`; `--help` lists the options. `Bake`, in
//! `bake.rs`, shows how a host uses vrtm. For production there is the command `vrtm bake` in bindings/python.

mod bake;
mod draw;
mod encode;
mod field;
mod report;

use std::collections::BTreeSet;
use std::io::Write;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex};

use clap::Parser;
use vrtm::{Backend, Device, DeviceSettings, LogLevel, MAX_GRID, Quality};
use vrtm_examples::failure::{Failure, Result};
use vrtm_examples::options::{DEVICES, one_of};
use vrtm_examples::source::{Files, Frame, Source};
use vrtm_examples::whole;

use bake::{Bake, OUTPUTS};
use draw::sheet::Sheet;
use draw::stage::Stage;

/// Bakes UV redirection maps that keep painted features rigid while the mesh under them deforms.
///
/// Without an argument it bakes a built-in scene, a mug that is edited into a jug. Per frame (numbered from 1) and UDIM
/// tile it writes redirect.####.<UDIM>.exr and warp.####.<UDIM>.exr: UVs in the channels R and G, v up, first row = top
/// of the tile. They are data, not colour: read them without a colour space, and with clamped edges. A texture looked
/// up at the redirected UV keeps its rigid features in shape. Per frame it writes sheet.####.png, a picture to judge
/// by, and at the end turning.png, a film for a browser in which the mesh turns and goes from rest to the frame with
/// the most strain and back.
///
/// For production there is `vrtm bake` in bindings/python: it reads USD and Alembic, too, and has many more options.
#[derive(Debug, Parser)]
#[command(name = "bake", version, max_term_width = 100)]
struct Args {
    #[command(flatten)]
    files: Files,

    /// Frames to bake, e.g. 1-3,7 [default: all]
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    frames: Option<Frames>,

    /// Folder to write to; files there are replaced, but for those that the bake reads
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,

    /// Draw no sheets
    #[arg(long)]
    no_sheet: bool,

    /// Draw no film
    #[arg(long)]
    no_film: bool,

    /// Camera of the sheets and, at first, of the film, in degrees around the mesh and upward
    #[arg(long, value_name = "YAW,PITCH", value_parser = parse_view, allow_hyphen_values = true)]
    view: Option<[f64; 2]>,

    /// Cells of the grid per side [default: as many as resolve the rigid features]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_GRID)))]
    size: Option<u32>,

    /// Texels of the redirection maps per side [default: --size, or the rigidity map's texels]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_GRID)))]
    map_size: Option<u32>,

    /// Quality of each frame
    #[arg(long, default_value = "normal", value_parser = one_of(QUALITIES))]
    quality: Quality,

    /// Start each frame from the one that was baked before it, not from the original UVs
    #[arg(long)]
    warm: bool,

    /// Weight that holds each frame to the one before it, against jitter; 0.03 to 0.3 is a useful range
    #[arg(long, value_name = "X", requires = "warm", default_value_t = 0.0)]
    temporal_weight: f32,

    /// Device to compute on; auto takes a hardware GPU if there is one, the CPU otherwise. GPUs need a build with the
    /// feature gpu: cargo run --release -p vrtm-examples --features gpu --example bake
    #[arg(long, default_value = "auto", value_parser = one_of(DEVICES))]
    device: Backend,
}

const QUALITIES: [(&str, Quality); 2] = [("draft", Quality::Draft), ("normal", Quality::Normal)];

/// Ranges of frame numbers, in the order given. The number of frames is only known once the scene is loaded.
#[derive(Clone, Debug)]
struct Frames(Vec<RangeInclusive<usize>>);

fn parse_frames(text: &str) -> std::result::Result<Frames, String> {
    let number = |t: &str| match t.trim().parse::<usize>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{}' is not a frame number (they start at 1)", t.trim())),
    };
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (number(first)?, number(last)?);
        if first > last { Err(format!("'{part}' runs backwards")) } else { Ok(first..=last) }
    };
    text.split(',').map(range).collect::<std::result::Result<_, _>>().map(Frames)
}

fn parse_view(text: &str) -> std::result::Result<[f64; 2], String> {
    let angle = |t: &str| t.trim().parse::<f64>().ok().filter(|a| a.is_finite());
    let pair = text.split_once(',').and_then(|(yaw, pitch)| Some([angle(yaw)?, angle(pitch)?]));
    pair.ok_or_else(|| "expected two angles in degrees, as in 30,15".to_string())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(Failure(line)) => {
            say(&line);
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<()> {
    let source = Source::load(&args.files)?;
    let chosen = chosen(args, &source)?;
    protect(&args.out, &source.inputs)?;
    let settings = DeviceSettings { backend: args.device, log: Some(log()), ..DeviceSettings::default() };
    let device = Device::new(&settings).map_err(|e| Failure::named("--device", e))?;
    let mut bake = Bake::new(&source, args, &device)?;
    warn_of_tiles(args, &bake);
    let stage = Stage::new(&source, &bake);
    let sheet = (!args.no_sheet).then(|| Sheet::new(&stage, &bake, args.view));

    std::fs::create_dir_all(&args.out).map_err(|e| Failure::file(&args.out, e))?;
    let write = |name: &str, bytes: &[u8]| whole::write(&args.out.join(name), bytes).map_err(Failure);
    let mut worst: Option<(&Frame, f64)> = None;
    print(&format!("frame  {}", report::TITLES));
    for frame in chosen {
        let failure = |e| Failure::named(&frame.origin, e);
        bake.solve(frame)?;
        for (tile, udim) in bake.tiles.iter().map(|tile| tile.udim).enumerate() {
            for (kind, fetch) in OUTPUTS {
                let image = bake.image(tile, fetch).map_err(failure)?;
                let name = format!("{kind}.{:04}.{udim}.exr", frame.number);
                write(&name, &encode::exr(&image).map_err(|e| Failure::named(&name, e))?)?;
            }
        }
        let reports = bake.reports().map_err(failure)?;
        if let Some(sheet) = &sheet {
            let title = format!("{}   frame {}   {}", source.name, frame.number, frame.note);
            let name = format!("sheet.{:04}.png", frame.number);
            let redirections = bake.redirections().map_err(failure)?;
            let picture = sheet.draw(&title, &frame.positions, &redirections, &reports);
            write(&name, &encode::png(&picture).map_err(|e| Failure::named(&name, e))?)?;
        }
        reports.iter().for_each(|tile| print(&format!("{:>5}  {}", frame.number, report::line(tile))));
        let strain = report::strain_before(&reports);
        if worst.is_none_or(|(_, most)| strain > most) {
            worst = Some((frame, strain));
        }
    }
    if let (Some((frame, _)), false) = (worst, args.no_film) {
        let pictures = draw::film::draw(&stage, &mut bake, args.view, frame)?;
        let bytes = encode::film(&pictures, draw::film::DURATION).map_err(|e| Failure::named(FILM, e))?;
        write(FILM, &bytes)?;
    }
    print(&format!("written to {}", args.out.display()));
    Ok(())
}

const FILM: &str = "turning.png";

/// The frames to bake, each once.
fn chosen<'a>(args: &Args, source: &'a Source) -> Result<Vec<&'a Frame>> {
    let count = source.frames.len();
    if count == 0 {
        return Err(Failure::named("--rest", "there are no poses: name them with --pose"));
    }
    let Some(Frames(ranges)) = &args.frames else { return Ok(source.frames.iter().collect()) };
    if let Some(last) = ranges.iter().map(|range| *range.end()).find(|&last| last > count) {
        return Err(Failure::named(
            &format!("--frames {last}"),
            format!("{} has {count} frames", source.name),
        ));
    }
    let mut indices: Vec<usize> = Vec::new();
    for number in ranges.iter().cloned().flatten() {
        if !indices.contains(&(number - 1)) {
            indices.push(number - 1);
        }
    }
    Ok(indices.into_iter().map(|index| &source.frames[index]).collect())
}

/// Refuses to replace an input. A file that takes the place of a link leaves the link's target as it is.
fn protect(out: &Path, inputs: &[PathBuf]) -> Result<()> {
    let folder = |path: &Path| Path::new(".").join(path.parent()?).canonicalize().ok();
    let out = folder(&out.join("file"));
    for input in inputs {
        for path in [Some(input.clone()), input.canonicalize().ok()].into_iter().flatten() {
            // Some systems ignore case.
            let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
            let is_output =
                name == FILM || ["redirect.", "warp.", "sheet."].iter().any(|kind| name.starts_with(kind));
            if is_output && out.is_some() && folder(&path) == out {
                return Err(Failure::file(
                    input,
                    "is read, and has the name of a file to write: choose another --out",
                ));
            }
        }
    }
    Ok(())
}

/// Prints a line. The bake does not fail if a reader closes the pipe early (`bake | head`).
fn print(line: &str) {
    let _ = writeln!(std::io::stdout(), "{line}");
}

/// Writes a line to stderr. The bake continues if it cannot be written, as on a full disk.
fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "bake: {line}");
}

/// Prints each of the library's warnings once.
fn log() -> vrtm::LogFn {
    let told = Mutex::new(BTreeSet::new());
    Arc::new(move |entry| {
        let new = || told.lock().is_ok_and(|mut told| told.insert(entry.message.to_string()));
        if entry.level == LogLevel::Warning && new() {
            say(&format!("warning: {}", entry.message));
        }
    })
}

/// Names the tiles that stay unchanged because they have no map.
fn warn_of_tiles(args: &Args, bake: &Bake) {
    let tiles = bake.tiles.iter().filter(|tile| tile.rigidity.is_none());
    let without: Vec<String> = tiles.map(|tile| tile.udim.to_string()).collect();
    if !without.is_empty() {
        let pattern =
            args.files.rigidity.as_ref().map_or(String::new(), |text| format!("--rigidity {text}: "));
        say(&format!(
            "warning: {pattern}no map for these tiles, which are not warped: {}",
            without.join(", ")
        ));
    }
}
