//! Measures solves with a time budget: the time that a solve takes, and the fraction of the full solve's gain in energy
//! that it reaches. First for a tile whose memory has never been used, then for a tile that has been solved before.
//!
//!     cargo bench -p vrtm-benches --bench budget
//!     cargo bench -p vrtm-benches --bench budget -- --grids 512 --scenes squash

#![allow(missing_docs)]

use std::time::{Duration, Instant};

use clap::Parser;
use vrtm::{Asset, Backend, Device, DeviceSettings, SolveOptions};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{Model, scenes};

/// Measures solves with a time budget.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Built-in scenes.
    #[arg(long, value_delimiter = ',', default_values = scenes::NAMES)]
    scenes: Vec<String>,
    /// Cells on a side of the grids.
    #[arg(long, value_delimiter = ',', default_values_t = [256, 512, 1024, 2048])]
    grids: Vec<u32>,
    /// Budgets in milliseconds.
    #[arg(long, value_delimiter = ',', default_values_t = [5.0, 20.0, 100.0])]
    budgets: Vec<f64>,
    /// Budgets as fractions of the time of a solve without one
    #[arg(long, value_delimiter = ',', default_values_t = [0.1, 0.15, 0.25, 0.5])]
    fractions: Vec<f64>,
    /// Solves per budget; the median and the longest time are printed.
    #[arg(long, default_value_t = 5)]
    repeats: usize,
    /// cpu or gpu.
    #[arg(long, default_value = "cpu")]
    backend: String,
    /// Leave out the solves of fresh tiles, which need a newly built grid each
    #[arg(long)]
    no_first: bool,
    /// Passed by `cargo bench` and not by `cargo test`; without it one small grid is measured.
    #[arg(long, hide = true)]
    bench: bool,
    /// Measure without `cargo bench`.
    #[arg(long, hide = true)]
    full: bool,
}

fn main() {
    let mut args = Args::parse();
    if !args.bench && !args.full {
        (args.grids, args.repeats, args.budgets) = (vec![128], 1, vec![1.0, 1000.0]);
        args.scenes.truncate(2);
    }
    let backend = if args.backend == "gpu" { Backend::Gpu } else { Backend::Cpu };
    let device = Device::new(&DeviceSettings { backend, ..DeviceSettings::default() }).expect("a device");
    println!(
        "Milliseconds: median and longest of {} solves. Gain: of the full solve's, in per cent, median and least.",
        args.repeats
    );
    println!("| scene | grid | budget | first | gain | median | longest | gain | least | over the bound |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    for name in &args.scenes {
        let scene = scenes::by_name(name).expect("the name of a built-in scene");
        let model = Model::from(scene);
        for &grid in &args.grids {
            measure(&args, &device, &model, grid);
        }
    }
}

/// An asset with its grids built.
fn prepared(model: &Model, device: &Device, grid: u32) -> Asset {
    let mut asset = model.asset_on(device, grid);
    for tile in 0..asset.tile_count() {
        asset.tile_info(tile).expect("a tile");
    }
    asset
}

/// Milliseconds of a solve, and the fraction by which it lowers the energy.
fn solve(asset: &mut Asset, model: &Model, frame: usize, budget: Option<f64>) -> (f64, f64) {
    let time_budget = budget.map(|ms| Duration::from_secs_f64(ms / 1000.0));
    let options = SolveOptions { time_budget, ..SolveOptions::default() };
    let start = Instant::now();
    asset.solve(model.frame(frame), &options).expect("a solve");
    let ms = start.elapsed().as_secs_f64() * 1000.0;
    let (mut before, mut after) = (0.0, 0.0);
    for tile in 0..asset.tile_count() {
        // The report's energies are those of a coarser level where time was up there.
        let [identity, result] = asset.energies_on_level_0(tile, model.frame(frame)).expect("energies");
        before += identity;
        after += result;
    }
    (ms, if before > 0.0 { 1.0 - after / before } else { 0.0 })
}

fn measure(args: &Args, device: &Device, model: &Model, grid: u32) {
    let frame = model.frames.len().min(5);
    let name = &model.name;
    let mut asset = prepared(model, device, grid);
    let (first, full) = solve(&mut asset, model, frame, None);
    let other = if frame > 1 { frame - 1 } else { frame };
    // Changing the settings back and forth makes the tile forget its inputs but keep its memory.
    let mut full_ms: Vec<f64> = Vec::new();
    for _ in 0..args.repeats {
        forget(&mut asset, model, other);
        full_ms.push(solve(&mut asset, model, frame, None).0);
    }
    full_ms.sort_by(f64::total_cmp);
    let (median, longest) = (full_ms[full_ms.len() / 2], full_ms[full_ms.len() - 1]);
    println!("| {name} | {grid} | none | {first:.1} | 100 | {median:.1} | {longest:.1} | 100 | 100 | |");
    let fractions = args.fractions.iter().map(|part| (part * median, format!(" ({part})")));
    for (budget, part) in args.budgets.iter().map(|&budget| (budget, String::new())).chain(fractions) {
        let fresh = (!args.no_first).then(|| {
            let mut asset = prepared(model, device, grid);
            solve(&mut asset, model, frame, Some(budget))
        });
        let mut runs = Vec::new();
        for _ in 0..args.repeats {
            forget(&mut asset, model, other);
            runs.push(solve(&mut asset, model, frame, Some(budget)));
        }
        runs.sort_by(|a, b| f64::total_cmp(&a.0, &b.0));
        let (median, longest) = (runs[runs.len() / 2].0, runs[runs.len() - 1].0);
        let mut gains: Vec<f64> = runs.iter().map(|run| 100.0 * run.1 / full).collect();
        gains.sort_by(f64::total_cmp);
        let (gain, least) = (gains[gains.len() / 2], gains[0]);
        let bound = budget * 1.2 + 5.0;
        let over = runs.iter().filter(|run| run.0 > bound).count();
        let over_first = if fresh.is_some_and(|(ms, _)| ms > bound) { ", first" } else { "" };
        let first =
            fresh.map_or("- | -".into(), |(ms, part)| format!("{ms:.1} | {:.1}", 100.0 * part / full));
        println!(
            "| {name} | {grid} | {budget:.1}{part} | {first} | {median:.1} | {longest:.1} | {gain:.1} | {least:.1} | \
             {over} of {}{over_first} |",
            runs.len()
        );
    }
}

/// Makes the next solve compute everything from scratch: a warm result is never reused.
fn forget(asset: &mut Asset, model: &Model, frame: usize) {
    let options =
        SolveOptions { warm: true, time_budget: Some(Duration::from_nanos(1)), ..SolveOptions::default() };
    asset.solve(model.frame(frame), &options).expect("a solve");
}
