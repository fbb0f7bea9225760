//! Measures the error of each painted feature, everywhere, inside of charts, at open borders and at seams, over
//! settings of the tiles; and how smoothly the warp follows the pose. Writes a table.
//!
//!     cargo bench -p vrtm-benches --bench features
//!     cargo bench -p vrtm-benches --bench features -- --grid 256 --scenes fox --settings draft,default,seams=continue
//!     cargo bench -p vrtm-benches --bench features -- --dense --settings default,harm=0
//!     cargo bench -p vrtm-benches --bench features -- --grid 0 --at-texels

#![allow(missing_docs)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use vrtm::{Asset, OpenBorders, Quality, Seams, SolveOptions, Strided, TileSettings};
use vrtm_testkit::Lab as _;
use vrtm_testkit::features::dense::dense;
use vrtm_testkit::features::{CASES, Feature, Kind, at_texels, gaps, models, of_asset, rms};
use vrtm_testkit::roughness::{moving, second_difference, way};
use vrtm_testkit::{Model, bench, options};

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
    /// Measure at the texels of the maps, not at the nodes of the grids.
    #[arg(long)]
    at_texels: bool,
    /// Settings of the tiles that are compared, such as harm=0, room=0+smoothness=0.1, seams=continue or
    /// open_borders=slide; also draft, a quality.
    #[arg(long, value_delimiter = ',', default_values_t = ["default".to_owned()])]
    settings: Vec<String>,
    /// Paint the scenes densely, in place of their own rigidity.
    #[arg(long)]
    dense: bool,
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
    bench::main(|| run(&args))
}

const HEAD: &str = "\
    | scene | setting | ms | where | features | RMS error before | after | mean before | after | over 0.05 before \
    | after | worse by 0.02 | worst | second difference, cells | both sides apart, texels of 4096: 50, 90, 99, 99.9 % |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|
";

fn run(args: &Args) -> Result<(), String> {
    let mut text = HEAD.to_owned();
    print!("{HEAD}");
    let models = models();
    if let Some(name) = args.scenes.iter().find(|name| !models.iter().any(|model| model.name == **name)) {
        return Err(format!("no scene or asset '{name}'"));
    }
    let wanted = |name: &str| args.scenes.is_empty() || args.scenes.iter().any(|scene| scene == name);
    for (name, frame) in CASES.into_iter().filter(|case| wanted(case.0)) {
        let Some(model) = models.iter().find(|model| model.name == name) else { continue };
        let model = &if args.dense { dense(model) } else { model.clone() };
        for setting in &args.settings {
            let rows = rows(args, model, frame, setting)?;
            print!("{rows}");
            text += &rows;
        }
    }
    bench::write_out(&args.out, &text)
}

/// Changes the settings by a word such as `room=0`; `default` and qualities change nothing.
fn change(settings: &mut TileSettings, word: &str) -> Result<(), String> {
    let bad = || format!("--settings {word}: neither 'default', 'draft' nor NAME=VALUE of a tile's setting");
    let Some((name, text)) = word.split_once('=') else {
        return if ["default", "draft"].contains(&word) { Ok(()) } else { Err(bad()) };
    };
    match name {
        "open_borders" if text == "slide" => settings.open_borders = OpenBorders::Slide,
        "seams" if text == "continue" => settings.seams = Seams::Continue,
        "seams" if text == "keep" => settings.seams = Seams::Keep,
        _ => *settings.number(name).ok_or_else(bad)? = text.parse().map_err(|_| bad())?,
    }
    Ok(())
}

/// Parts of the way from rest to the frame at which the second difference is taken.
const WAY: [f64; 4] = [0.92, 0.925, 0.93, 0.935];

/// The lines of a scene and of settings that are changed by the words of `setting`, joined by `+`: one for all features
/// of all tiles, and one for each place that has some.
fn rows(args: &Args, model: &Model, frame: usize, setting: &str) -> Result<String, String> {
    let fail = |error: vrtm::Error| error.to_string();
    let pose = &model.frames[frame - 1];
    let draft = setting.split('+').any(|word| word == "draft");
    let options = options(if draft { Quality::Draft } else { Quality::Normal });
    let mut asset = model.asset(0, args.grid);
    for tile in 0..asset.tile_count() {
        let mut settings = asset.tile_mut(tile).settings().map_err(fail)?;
        setting.split('+').try_for_each(|word| change(&mut settings, word))?;
        asset.tile_mut(tile).set_settings(&settings).map_err(fail)?;
    }
    let second = steps(&mut asset, model, frame, &options).map_err(fail)?;
    // With everything prepared; the least of three.
    let mut ms = f64::INFINITY;
    for _ in 0..3 {
        asset.solve(Strided::from_slice(&model.rest), &options).map_err(fail)?;
        let start = Instant::now();
        asset.solve(Strided::from_slice(pose), &options).map_err(fail)?;
        ms = ms.min(1000.0 * start.elapsed().as_secs_f64());
    }
    let features = if args.at_texels { at_texels } else { of_asset }(model, pose, &asset);
    let start = format!("| {} {frame} | {setting} | {ms:.0}", model.name);
    let mut text =
        format!("{start} | everywhere {} {second:.4} | |\n", figures(&features.iter().collect::<Vec<_>>()));
    for (kind, place) in [(Kind::Inner, "inside"), (Kind::Open, "open border"), (Kind::Seam, "seam")] {
        let some: Vec<&Feature> = features.iter().filter(|feature| feature.kind == kind).collect();
        if !some.is_empty() {
            let gaps = if kind == Kind::Seam { apart(&gaps(model, &asset)) } else { String::new() };
            text += &format!("{start} | {place} {} | {gaps} |\n", figures(&some));
        }
    }
    Ok(text)
}

/// The distances between both sides of seams, in ascending order, at 50, 90, 99 and 99.9 %.
fn apart(gaps: &[f64]) -> String {
    let gap = |q: f64| gaps.get(((gaps.len() as f64 - 1.0) * q) as usize).copied().unwrap_or(0.0);
    format!("{:.2}, {:.2}, {:.2}, {:.2}", gap(0.5), gap(0.9), gap(0.99), gap(0.999))
}

/// Root mean square of the second differences of the warp on the way to a pose, over the nodes that move.
fn steps(asset: &mut Asset, model: &Model, frame: usize, options: &SolveOptions) -> vrtm::Result<f64> {
    let mut warps = Vec::new();
    for t in WAY {
        asset.solve(Strided::from_slice(&way(model, frame, t)), options)?;
        let mut warp = Vec::new();
        for tile in 0..asset.tile_count() {
            warp.extend(asset.displacements(tile)?.iter().map(|u| u.map(f64::from)));
        }
        warps.push(warp);
    }
    let moving = moving(&warps);
    Ok(rms(warps.windows(3).flat_map(|w| moving.iter().map(|&n| second_difference(w, n)))))
}

/// The columns from the number of features to the one whose error rises most.
fn figures(features: &[&Feature]) -> String {
    let errors: [fn(&Feature) -> f64; 2] = [|f| f.before, |f| f.after];
    let all = |k: usize| features.iter().map(move |f| errors[k](f));
    let mean = |k: usize| all(k).sum::<f64>() / features.len().max(1) as f64;
    let bad = |k: usize| all(k).filter(|error| *error > 0.05).count();
    let rise = || features.iter().map(|f| f.after - f.before);
    format!(
        "| {} | {:.4} | {:.4} | {:.4} | {:.4} | {} | {} | {} | {:.3} |",
        features.len(),
        rms(all(0)),
        rms(all(1)),
        mean(0),
        mean(1),
        bad(0),
        bad(1),
        rise().filter(|rise| *rise > 0.02).count(),
        rise().fold(0.0, f64::max),
    )
}
