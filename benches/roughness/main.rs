//! Measures how smoothly the warp depends on the pose, on all scenes, or over the frames of shots, and writes a table.
//!
//!     cargo bench -p vrtm-benches --bench roughness
//!     cargo bench -p vrtm-benches --bench roughness -- --grid 512 --qualities draft,normal --scenes fox
//!     cargo bench -p vrtm-benches --bench roughness -- --follow --scenes fox,arm
//!     cargo bench -p vrtm-benches --bench roughness -- --shot 120 --warm --temporal-weight 0.1 --out shots.md

#![allow(missing_docs)]

mod follow;
mod shot;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use follow::Followed;
use vrtm::{Backend, Device, DeviceSettings, Quality, SolveOptions};
use vrtm_testkit::bench;
use vrtm_testkit::roughness::Roughness;

/// Measures how smooth the warp is as a function of the pose.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Scenes and assets; by default all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Cells on a side of the grids.
    #[arg(long, default_value_t = 256)]
    grid: u32,
    /// draft, normal.
    #[arg(long, value_parser = bench::quality, value_delimiter = ',', default_values = ["normal"])]
    qualities: Vec<Quality>,
    /// cpu or gpu.
    #[arg(long, default_value = "cpu")]
    backend: String,
    /// Follow the minimum from pose to pose, to tell its jumps from those of the solver.
    #[arg(long, conflicts_with = "shot")]
    follow: bool,
    /// Play a shot of so many frames through rest and all frames of each scene, by default of each asset.
    #[arg(long, value_name = "FRAMES")]
    shot: Option<usize>,
    /// With --shot: start each frame from the one before it, not from the identity.
    #[arg(long, requires = "shot")]
    warm: bool,
    /// Weight that holds each frame to the one before it.
    #[arg(long, requires = "warm", default_value_t = 0.0)]
    temporal_weight: f32,
    /// Also write the table there; with --shot, tables of the frames beside it.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Passed by `cargo bench` and not by `cargo test`; without it one small scene is measured.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let mut args = Args::parse();
    if !args.bench {
        args.grid = args.grid.min(64);
        args.scenes = vec!["bulge".into()];
    }
    bench::main(|| {
        run(&args)?;
        if args.bench { Ok(()) } else { run(&Args { shot: Some(8), ..args }) }
    })
}

const HEAD: &str =
    "| scene | quality | strain | d1 RMS | d2 RMS | d2 over 0.1 | largest d2 | noise 1e-7, 99.9 % | ms |
|---|---|---|---|---|---|---|---|---|
";

const FOLLOWED: &str =
    "| scene | quality | d2 RMS, over 0.1, largest: from the identity | followed forwards | backwards \
     | energy | still moved | apart | explained | by chance |
|---|---|---|---|---|---|---|---|---|---|
";

fn run(args: &Args) -> Result<(), String> {
    let backend = match args.backend.as_str() {
        "cpu" => Backend::Cpu,
        "gpu" => Backend::Gpu,
        other => return Err(format!("--backend {other}: neither cpu nor gpu")),
    };
    let device = Device::new(&DeviceSettings { backend, ..DeviceSettings::default() })
        .map_err(|error| error.to_string())?;
    let head = match args.shot {
        Some(_) => shot::HEAD,
        None if args.follow => FOLLOWED,
        None => HEAD,
    };
    let mut text = head.to_owned();
    print!("{head}");
    let mut scenes = args.scenes.clone();
    if args.shot.is_some() && scenes.is_empty() {
        scenes = vrtm_testkit::assets().into_iter().map(|model| model.name).collect();
    }
    for case in vrtm_testkit::cases::cases(&scenes, args.grid)? {
        for &quality in &args.qualities {
            let options = SolveOptions {
                warm: args.warm,
                temporal_weight: args.temporal_weight,
                ..vrtm_testkit::options(quality)
            };
            let quality = format!("{quality:?}").to_lowercase();
            let line = if let Some(frames) = args.shot {
                let (line, of_frames) =
                    shot::play(&case, &format!("{} | {quality}", case.name), frames, &device, &options)?;
                if let Some(path) = &args.out {
                    bench::write(&path.with_file_name(format!("{}.{quality}.csv", case.name)), &of_frames)?;
                }
                line
            } else {
                let (mut asset, tile) = case.asset(&device);
                let name = format!("{} {} | {quality}", case.name, case.frame);
                if args.follow {
                    followed(&name, &follow::follow(&mut asset, tile, &case.model, case.frame, &options))
                } else {
                    rough(&name, &Roughness::of(&mut asset, tile, &case.model, case.frame, &options))
                }
            };
            print!("{line}");
            text += &line;
        }
    }
    bench::write_out(&args.out, &text)
}

fn rough(name: &str, r: &Roughness) -> String {
    let s = &r.smoothness;
    format!(
        "| {name} | {:.4} | {:.4} | {:.4} | {:.2} % | {:.2} | {:.5} | {:.1} |\n",
        r.strain,
        s.first,
        s.second,
        100.0 * s.large,
        s.largest,
        r.noise,
        r.ms
    )
}

fn followed(name: &str, f: &Followed) -> String {
    let smoothness = f
        .smoothness
        .each_ref()
        .map(|s| format!("{:.4}, {:.2} %, {:.2}", s.second, 100.0 * s.large, s.largest));
    format!(
        "| {name} | {} | {:.3}, {:.3} | {:.4} | {:.2} % | {:.0} % | {:.1} % |\n",
        smoothness.join(" | "),
        f.energy[0],
        f.energy[1],
        f.moved,
        100.0 * f.apart,
        100.0 * f.explained,
        100.0 * f.chance
    )
}
