//! Measures speed against error: every solver at every effort on every scene, with error and time as CSV, plots and
//! a table.
//!
//!     cargo bench -p vrtm-benches --bench speed_error
//!     cargo bench -p vrtm-benches --bench speed_error -- --quick

#![allow(missing_docs)]

mod claims;
mod efforts;
mod machine;
mod oracle;
mod plots;
mod rows;
mod runs;
mod table;

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use clap::Parser;
use vrtm::{Backend, Device, DeviceSettings};
use vrtm_testkit::bench;

use machine::Machine;
use oracle::Done;
use rows::Row;
use runs::{Repeats, Target};

/// Measures error over time: all solvers, all efforts, all scenes.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Check that the bench runs: one scene, a small grid, few efforts.
    #[arg(long)]
    quick: bool,
    /// Scenes and assets; by default all.
    #[arg(long, value_delimiter = ',')]
    scenes: Vec<String>,
    /// Cells on a side of the grids.
    #[arg(long, default_value_t = 512)]
    grid: u32,
    /// Backends: cpu, gpu. By default the CPU and a hardware GPU; a software GPU is measured only if gpu is given.
    #[arg(long, value_delimiter = ',')]
    backends: Vec<String>,
    /// Rounds of timed solves.
    #[arg(long, default_value_t = 7)]
    repeats: usize,
    /// An effort takes part in no further round once it has taken this number of milliseconds.
    #[arg(long, default_value_t = 4000.0)]
    budget: f64,
    /// Without the reference: gaps are then relative to the lowest of the results.
    #[arg(long)]
    no_reference: bool,
    /// Folder for the results.
    #[arg(long, default_value = "benches/results")]
    out: PathBuf,
    /// Passed by `cargo bench` and not by `cargo test`; without it the bench behaves as with `--quick`, and writes
    /// nothing.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let mut args = Args::parse();
    if args.quick || !args.bench {
        args.quick = true;
        args.grid = args.grid.min(64);
        args.repeats = args.repeats.min(2);
        if args.scenes.is_empty() {
            args.scenes = vec!["bulge".into()];
        }
    }
    bench::main(|| run(&args))
}

fn run(args: &Args) -> Result<(), String> {
    let cases = vrtm_testkit::cases::cases(&args.scenes, args.grid)?;
    let start = Instant::now();
    let machine = Machine::look();
    let targets = targets(&args.backends)?;
    let efforts = efforts::efforts(args.quick);
    let repeats = Repeats { most: args.repeats, budget_ms: args.budget };
    let mut done = Vec::new();
    for case in cases {
        let mut ran = Vec::new();
        for target in &targets {
            ran.extend(runs::run(&case, target, &efforts, repeats)?);
        }
        eprintln!("{:6.0} s  {}", start.elapsed().as_secs_f64(), case.name);
        done.push(Done::new(case, ran)?);
    }
    if !args.no_reference {
        oracle::consult(&mut done)?;
        eprintln!("{:6.0} s  reference", start.elapsed().as_secs_f64());
    }
    let rows: Vec<Row> = done.iter().flat_map(Done::rows).collect();
    let claims = claims::claims(&rows);
    let text = table::text(&machine, &done, &rows, &claims);
    println!("{text}");
    if !args.bench {
        return Ok(());
    }
    bench::write(&args.out.join("speed_error.csv"), &rows::csv(&rows))?;
    bench::write(&args.out.join("speed_error.md"), &text)?;
    let note = format!(
        "{}, {} threads, {}; grid {}²; medians of whole solves, all solvers in turn in one run",
        machine.cpu, machine.threads, machine.simd, args.grid
    );
    for plot in [plots::GAP, plots::STRAIN] {
        plot.draw(&args.out.join(plot.file), &done, &note)?;
    }
    println!("written to {} after {:.0} s", args.out.display(), start.elapsed().as_secs_f64());
    Ok(())
}

/// The CPU, and the first hardware GPU, unless backends are given.
fn targets(wanted: &[String]) -> Result<Vec<Target>, String> {
    let is_wanted = |name: &str| wanted.iter().any(|w| w == name);
    if let Some(name) = wanted.iter().find(|name| !["cpu", "gpu"].contains(&name.as_str())) {
        return Err(format!("--backends {name}: neither cpu nor gpu"));
    }
    let device = |backend: Backend, adapter: usize| {
        let settings = DeviceSettings { backend, adapter: adapter as u32, ..DeviceSettings::default() };
        Device::new(&settings).map_err(|error| error.to_string())
    };
    let mut targets = Vec::new();
    if wanted.is_empty() || is_wanted("cpu") {
        targets.push(Target { name: "cpu", device: device(Backend::Cpu, 0)? });
    }
    let adapters = vrtm::adapters();
    let hardware = adapters.iter().position(|adapter| !adapter.software);
    let adapter = hardware.or_else(|| is_wanted("gpu").then_some(0));
    if let Some(adapter) = adapter.filter(|_| wanted.is_empty() || is_wanted("gpu")) {
        targets.push(Target { name: "gpu", device: device(Backend::Gpu, adapter)? });
    }
    Ok(targets)
}
