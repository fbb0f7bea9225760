//! Measures solves with a time budget. On an idle machine: the time that a solve takes, and the fraction of the full
//! solve's gain in energy that it reaches. Beside two busy threads per core: the frames of a motion.
//!
//!     cargo bench -p vrtm-benches --bench budget
//!     cargo bench -p vrtm-benches --bench budget -- --grids 512 --scenes squash

#![allow(missing_docs)]

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use clap::Parser;
use vrtm::{Asset, Device, DeviceSettings, SolveOptions, Strided};
use vrtm_testkit::roughness::{Smoothness, Warp, warp};
use vrtm_testkit::{Lab as _, Model, scenes};

/// Measures solves with a time budget.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Built-in scenes.
    #[arg(long, value_delimiter = ',', default_values = scenes::NAMES)]
    scenes: Vec<String>,
    /// Cells on a side of the grids.
    #[arg(long, value_delimiter = ',', default_values_t = [256, 1024])]
    grids: Vec<u32>,
    /// Cells on a side of the grid of a motion.
    #[arg(long, default_value_t = 128)]
    motion_grid: u32,
    /// Budgets of a motion in milliseconds.
    #[arg(long, value_delimiter = ',', default_values_t = [10.0, 30.0, 100.0])]
    budgets: Vec<f64>,
    /// Budgets as fractions of the time of a solve without one
    #[arg(long, value_delimiter = ',', default_values_t = [0.25, 0.5])]
    fractions: Vec<f64>,
    /// Frames of a motion.
    #[arg(long, default_value_t = 200)]
    frames: usize,
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
        (args.grids, args.frames, args.budgets) = (vec![128], 4, vec![10.0]);
        args.scenes.truncate(1);
    }
    let device = Device::new(&DeviceSettings::default()).expect("a device");
    let models: Vec<Model> =
        args.scenes.iter().map(|name| Model::from(scenes::by_name(name).expect("a scene"))).collect();
    println!("| scene | grid | whole solve, ms | part | ms | gain |\n|---|---|---|---|---|---|");
    for (model, &grid) in models.iter().flat_map(|model| args.grids.iter().map(move |grid| (model, grid))) {
        parts(&args, &device, model, grid);
    }
    println!(
        "\n| scene | budget, ms | longest, ms | truncated | identity | second difference | in those of no budget |"
    );
    println!("|---|---|---|---|---|---|---|");
    let ends = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
        for _ in 0..2 * cores {
            scope.spawn(|| {
                while !ends.load(Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        models.iter().for_each(|model| motion(&args, &device, model));
        ends.store(true, Ordering::Relaxed);
    });
}

fn with_budget(ms: Option<f64>) -> SolveOptions {
    let time_budget = ms.map(|ms| Duration::from_secs_f64(ms / 1000.0));
    SolveOptions { time_budget, ..SolveOptions::default() }
}

/// Milliseconds of the solve of a frame, and the fraction by which it lowers the energy.
fn solve(asset: &mut Asset, model: &Model, ms: Option<f64>) -> (f64, f64) {
    let frame = model.frames.len().min(5);
    // Another pose, so that no result is kept.
    asset.solve(Strided::from_f32x3(&model.rest), &SolveOptions::default()).expect("a solve");
    let start = Instant::now();
    asset.solve(model.frame(frame), &with_budget(ms)).expect("a solve");
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

/// Solves in parts of the time of a whole solve.
fn parts(args: &Args, device: &Device, model: &Model, grid: u32) {
    let mut asset = model.asset_on(device, grid);
    solve(&mut asset, model, None);
    let (whole, gain) = solve(&mut asset, model, None);
    for part in &args.fractions {
        let (ms, found) = solve(&mut asset, model, Some(part * whole));
        println!("| {} | {grid} | {whole:.1} | {part} | {ms:.1} | {:.3} |", model.name, found / gain);
    }
}

/// The frames of a motion between 0.3 and the whole of the way from rest to a pose, with and without budgets.
fn motion(args: &Args, device: &Device, model: &Model) {
    let target = &model.frames[model.frames.len().min(5) - 1];
    let mut second = 0.0;
    for budget in std::iter::once(None).chain(args.budgets.iter().copied().map(Some)) {
        let mut asset = model.asset_on(device, args.motion_grid);
        let mut warps: Vec<Vec<Warp>> = vec![Vec::new(); asset.tile_count()];
        let (mut longest, mut truncated, mut identity) = (0.0f64, 0, 0);
        for frame in 0..args.frames {
            let part = 0.65 - 0.35 * (std::f32::consts::TAU * frame as f32 / 100.0).cos();
            let point = |(r, p): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|k| r[k] + part * (p[k] - r[k]));
            let pose: Vec<[f32; 3]> = model.rest.iter().zip(target).map(point).collect();
            let start = Instant::now();
            asset.solve(Strided::from_f32x3(&pose), &with_budget(budget)).expect("a solve");
            longest = longest.max(start.elapsed().as_secs_f64() * 1000.0);
            truncated += usize::from(asset.report().expect("a report").truncated);
            let moves = |tile: usize| asset.tile_report(tile).expect("a report").max_displacement > 0.0;
            identity += usize::from(!(0..warps.len()).any(moves));
            warps.iter_mut().enumerate().for_each(|(tile, warps)| warps.push(warp(&asset, tile)));
        }
        let found = warps.iter().map(|warps| Smoothness::of(warps).second).fold(0.0, f64::max);
        second = if budget.is_none() { found } else { second };
        let budget = budget.map_or("none".into(), |ms| ms.to_string());
        println!(
            "| {} | {budget} | {longest:.0} | {truncated} | {identity} | {found:.4} | {:.2} |",
            model.name,
            found / second
        );
    }
}
