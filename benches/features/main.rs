//! Measures the error of each painted feature: inside of charts, at open borders and at seams. Writes a table.
//!
//!     cargo bench -p vrtm-benches --bench features
//!     cargo bench -p vrtm-benches --bench features -- --grid 256 --scenes fox --qualities draft,normal
//!     cargo bench -p vrtm-benches --bench features -- --dense --settings default,protect=0.5,protect=1
//!     cargo bench -p vrtm-benches --bench features -- --grid 0 --at-texels --settings default

#![allow(missing_docs)]

mod sweep;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use vrtm::{OpenBorders, Quality, Seams, Strided};
use vrtm_testkit::Model;
use vrtm_testkit::features::dense::dense;
use vrtm_testkit::features::{CASES, Kind, Summary, gaps, models, of_asset, solve};

/// Measures the error of each painted feature.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Scenes and assets; by default all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Cells on a side of the grids; 0 for those that resolve the features.
    #[arg(long, default_value_t = 512)]
    grid: u32,
    /// With --settings: measure at the texels of the maps, not at the nodes of the grids.
    #[arg(long, requires = "settings")]
    at_texels: bool,
    /// draft, normal.
    #[arg(long, value_delimiter = ',', default_values_t = ["normal".to_owned()])]
    qualities: Vec<String>,
    /// shut, keep, continue: what happens at seams.
    #[arg(long, value_delimiter = ',', default_values_t = ["shut".to_owned()])]
    seams: Vec<String>,
    /// fixed, slide: what happens at open borders.
    #[arg(long, value_delimiter = ',', default_values_t = ["fixed".to_owned()])]
    open_borders: Vec<String>,
    /// Paint the scenes densely, in place of their own rigidity.
    #[arg(long)]
    dense: bool,
    /// Compare settings of the tiles, such as protect=1 or room=0+smoothness=0.1, with one line for each, in place of
    /// --qualities, --seams and --open-borders.
    #[arg(long, value_delimiter = ',')]
    settings: Vec<String>,
    /// Also write the table there.
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
        args.scenes = vec!["arm".into()];
    }
    match run(&args) {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

const HEAD: &str = "| scene | quality | seams | open borders | ms | where | features | mean error before | after | over 0.05 before | after | worse by 0.02 | both sides apart, texels of 4096: 50, 90, 99, 99.9 % |
|---|---|---|---|---|---|---|---|---|---|---|---|---|
";

fn run(args: &Args) -> Result<(), String> {
    let head = if args.settings.is_empty() { HEAD } else { sweep::HEAD };
    let mut text = head.to_owned();
    print!("{head}");
    let models = models();
    if let Some(name) = args.scenes.iter().find(|name| !models.iter().any(|model| model.name == **name)) {
        return Err(format!("no scene or asset '{name}'"));
    }
    let wanted = |name: &str| args.scenes.is_empty() || args.scenes.iter().any(|scene| scene == name);
    for (name, frame) in CASES.into_iter().filter(|case| wanted(case.0)) {
        let Some(model) = models.iter().find(|model| model.name == name) else { continue };
        let model = &if args.dense { dense(model) } else { model.clone() };
        for setting in &args.settings {
            let row = sweep::row(model, frame, setting, args.grid, args.at_texels)?;
            print!("{row}");
            text += &row;
        }
        if !args.settings.is_empty() {
            continue;
        }
        for quality in &args.qualities {
            let open = |seams| args.open_borders.iter().map(move |open| [seams, open]);
            for borders in args.seams.iter().flat_map(open) {
                let rows = rows(model, frame, quality, borders, args.grid)?;
                print!("{rows}");
                text += &rows;
            }
        }
    }
    match &args.out {
        Some(path) => std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display())),
        None => Ok(()),
    }
}

/// A line for each place at which the scene has features, on all of its tiles.
fn rows(
    model: &Model,
    frame: usize,
    quality: &str,
    [seams, open]: [&String; 2],
    grid: u32,
) -> Result<String, String> {
    let options = vrtm_testkit::options(match quality {
        "draft" => Quality::Draft,
        "normal" => Quality::Normal,
        other => return Err(format!("--qualities {other}: neither draft nor normal")),
    });
    let of_seams = match &**seams {
        "shut" => Seams::Shut,
        "keep" => Seams::Keep,
        "continue" => Seams::Continue,
        other => return Err(format!("--seams {other}: neither shut, keep nor continue")),
    };
    let wanted = match &**open {
        "fixed" => (of_seams, OpenBorders::Fixed),
        "slide" => (of_seams, OpenBorders::Slide),
        other => return Err(format!("--open-borders {other}: neither fixed nor slide")),
    };
    let pose = &model.frames[frame - 1];
    let mut asset = solve(model, pose, 0, grid, wanted, &options);
    // Once more, with everything prepared; the least of three.
    let mut seconds = f64::INFINITY;
    for _ in 0..3 {
        asset.solve(Strided::from_f32x3(&model.rest), &options).unwrap();
        let start = Instant::now();
        asset.solve(Strided::from_f32x3(pose), &options).unwrap();
        seconds = seconds.min(start.elapsed().as_secs_f64());
    }
    let features = of_asset(model, pose, &asset);
    let gaps = gaps(model, &asset);
    let gap = |q: f64| gaps.get(((gaps.len() as f64 - 1.0) * q) as usize).copied().unwrap_or(0.0);
    let gaps = format!("{:.2}, {:.2}, {:.2}, {:.2}", gap(0.5), gap(0.9), gap(0.99), gap(0.999));
    let mut rows = String::new();
    for (kind, place) in [(Kind::Inner, "inside"), (Kind::Open, "open border"), (Kind::Seam, "seam")] {
        let s = Summary::of(&features, kind);
        if s.count > 0 {
            rows += &format!(
                "| {} {} | {quality} | {seams} | {open} | {:.0} | {place} | {} | {:.4} | {:.4} | {} | {} | {} | {} |\n",
                model.name,
                frame,
                1000.0 * seconds,
                s.count,
                s.mean[0],
                s.mean[1],
                s.bad[0],
                s.bad[1],
                s.worse,
                if kind == Kind::Seam { &gaps } else { "" }
            );
        }
    }
    Ok(rows)
}
