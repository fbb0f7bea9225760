//! A shot: a smooth motion through rest and all frames of an asset, solved frame by frame. It writes the input from
//! which `shot.py` makes a film and a plot, and prints where W changes least smoothly; see README.md.
//!
//!     cargo bench -p vrtm-benches --bench shot -- --out /tmp/shot
//!     cargo bench -p vrtm-benches --bench shot -- --out /tmp/warm --scenes fox,bulge --grid 512 --warm

#![allow(missing_docs)]

mod chart;
mod play;

use std::path::{Path as FilePath, PathBuf};
use std::process::ExitCode;

use clap::{Parser, ValueEnum};
use serde_json::json;
use vrtm::{Backend, Device, DeviceSettings, SolveOptions};
use vrtm_testkit::cases::Case;
use vrtm_testkit::scenes::path::Path;

/// Solves a shot of each asset, and writes its frames and how smoothly W changes.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Scenes and assets; by default all assets.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Frames of a shot.
    #[arg(long, default_value_t = 120)]
    frames: usize,
    /// Cells on a side of the grids.
    #[arg(long, default_value_t = 256)]
    grid: u32,
    /// Quality of each frame.
    #[arg(long, value_enum, default_value = "normal")]
    quality: Quality,
    /// Start each frame from the one before it, not from the identity.
    #[arg(long)]
    warm: bool,
    /// Weight that holds each frame to the one before it.
    #[arg(long, requires = "warm", default_value_t = 0.0)]
    temporal_weight: f32,
    /// Solve on a GPU.
    #[arg(long)]
    gpu: bool,
    /// Folder to write to, with a folder per scene.
    #[arg(long, required_if_eq("bench", "true"))]
    out: Option<PathBuf>,
    /// Passed by `cargo bench` and not by `cargo test`; without it one small scene is played.
    #[arg(long, hide = true)]
    bench: bool,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum Quality {
    Draft,
    Normal,
}

impl Args {
    /// The options of all solves.
    fn options(&self) -> SolveOptions {
        let quality = match self.quality {
            Quality::Draft => vrtm::Quality::Draft,
            Quality::Normal => vrtm::Quality::Normal,
        };
        let Args { warm, temporal_weight, .. } = *self;
        SolveOptions { quality, warm, temporal_weight, ..SolveOptions::default() }
    }

    /// The options as arguments for the bake program, whose pictures should show these solves.
    fn for_bake(&self) -> Vec<String> {
        let quality = format!("{:?}", self.quality).to_lowercase();
        let device = if self.gpu { "gpu" } else { "cpu" };
        let size = self.grid.to_string();
        let mut list =
            ["--quality", &quality, "--size", &size, "--device", device].map(String::from).to_vec();
        if self.warm {
            list.extend(["--warm".into(), "--temporal-weight".into(), self.temporal_weight.to_string()]);
        }
        list
    }
}

fn main() -> ExitCode {
    let mut args = Args::parse();
    if !args.bench {
        args.grid = args.grid.min(32);
        args.frames = 8;
        args.scenes = vec!["bulge".into()];
    }
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

fn run(args: &Args) -> Result<(), String> {
    let backend = if args.gpu { Backend::Gpu } else { Backend::Cpu };
    let device = Device::new(&DeviceSettings { backend, ..DeviceSettings::default() })
        .map_err(|error| error.to_string())?;
    let mut names = args.scenes.clone();
    if names.is_empty() {
        names = vrtm_testkit::assets().into_iter().map(|model| model.name).collect();
    }
    if names.is_empty() {
        return Err("no assets are there: name scenes with --scenes".into());
    }
    let out = args.out.clone().unwrap_or_else(|| FilePath::new(env!("CARGO_TARGET_TMPDIR")).join("shot"));
    for case in vrtm_testkit::cases::cases(&names, args.grid)? {
        shoot(args, &case, &device, &out.join(&case.name))?;
    }
    Ok(())
}

/// Plays one shot and writes its folder.
fn shoot(args: &Args, case: &Case, device: &Device, folder: &FilePath) -> Result<(), String> {
    let keys = std::iter::once(&case.model.rest).chain(&case.model.frames).map(Vec::as_slice).collect();
    let path = Path::new(keys, args.frames).map_err(|why| format!("{}: {why}", case.model.name))?;
    let poses: Vec<_> = (1..=args.frames).map(|frame| path.pose(frame)).collect();
    vrtm_testkit::save(&case.model, &poses, &folder.join("asset"))?;
    let rows = play::play(case, &path, args.frames, device, &args.options())?;
    let peak =
        rows.iter().max_by(|a, b| a.warp.max.total_cmp(&b.warp.max)).ok_or("fewer than three frames")?;
    let node = peak.node;
    let (chart, charts) =
        chart::find(&case.model, node.udim, node.mesh_uv()).ok_or("a tile without faces")?;
    println!(
        "{}: d2 is largest in frame {}: {:.3} cells, tile {}, node {} {}, UV {:.5} {:.5}, chart {} of {}",
        case.name,
        peak.frame,
        peak.warp.max,
        node.udim,
        node.at[0],
        node.at[1],
        node.uv[0],
        node.uv[1],
        chart,
        charts
    );
    let facts = json!({
        "scene": case.name, "frames": args.frames, "keys": path.times, "grid": args.grid, "warm": args.warm,
        "temporal_weight": args.temporal_weight,
        "quality": format!("{:?}", args.quality).to_lowercase(), "bake": args.for_bake(),
        "peak": {
            "frame": peak.frame, "largest": peak.warp.max, "tile": node.udim, "node": node.at, "uv": node.uv,
            "chart": chart,
        },
    });
    let write = |name: &str, text: &str| {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))
    };
    write("shot.csv", &play::csv(&rows))?;
    write("shot.json", &format!("{facts:#}\n"))
}
