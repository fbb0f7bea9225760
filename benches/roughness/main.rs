//! Measures how smoothly the warp depends on the pose, on all scenes, and writes a table, and JSON for comparisons.
//!
//!     cargo bench -p vrtm-benches --bench roughness
//!     cargo bench -p vrtm-benches --bench roughness -- --grid 512 --qualities draft,normal --scenes fox
//!     cargo bench -p vrtm-benches --bench roughness -- --follow --scenes fox,arm

#![allow(missing_docs)]

mod follow;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use follow::Followed;
use serde_json::json;
use vrtm::{Backend, Device, DeviceSettings, Quality};
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
    #[arg(long, value_delimiter = ',', default_values_t = ["normal".to_owned()])]
    qualities: Vec<String>,
    /// cpu or gpu.
    #[arg(long, default_value = "cpu")]
    backend: String,
    /// Follow the minimum from pose to pose, to tell its jumps from those of the solver.
    #[arg(long)]
    follow: bool,
    /// Also write the table there, and JSON beside it.
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
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
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
    let head = if args.follow { FOLLOWED } else { HEAD };
    let mut text = head.to_owned();
    print!("{head}");
    let mut rows = Vec::new();
    for case in vrtm_testkit::cases::cases(&args.scenes, args.grid)? {
        for quality in &args.qualities {
            let (mut asset, tile) = case.asset(&device);
            let options = vrtm_testkit::options(parsed(quality)?);
            if args.follow {
                let line = followed(
                    &format!("{} {} | {quality}", case.name, case.frame),
                    &follow::follow(&mut asset, tile, &case.model, case.frame, &options),
                );
                print!("{line}");
                text += &line;
                continue;
            }
            let r = Roughness::of(&mut asset, tile, &case.model, case.frame, &options);
            let s = &r.smoothness;
            let line = format!(
                "| {} {} | {quality} | {:.4} | {:.4} | {:.4} | {:.2} % | {:.2} | {:.5} | {:.1} |\n",
                case.name,
                case.frame,
                r.strain,
                s.first,
                s.second,
                100.0 * s.large,
                s.largest,
                r.noise,
                r.ms
            );
            print!("{line}");
            text += &line;
            rows.push(json!({
                "scene": case.name, "frame": case.frame, "udim": case.udim, "grid": case.grid, "quality": quality,
                "backend": args.backend, "strain": r.strain, "energy": r.energy, "first": s.first,
                "second": s.second, "large": s.large, "largest": s.largest, "noise": r.noise, "ms": r.ms,
            }));
        }
    }
    if let Some(path) = &args.out {
        let write = |path: &PathBuf, text: &str| {
            std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))
        };
        write(path, &text)?;
        let lines: Vec<String> = rows.iter().map(|row| row.to_string()).collect();
        write(&path.with_extension("json"), &format!("[\n{}\n]\n", lines.join(",\n")))?;
    }
    Ok(())
}

fn parsed(quality: &str) -> Result<Quality, String> {
    Ok(match quality {
        "draft" => Quality::Draft,
        "normal" => Quality::Normal,
        other => return Err(format!("--qualities {other}: neither draft nor normal")),
    })
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
