//! Measures the cost of preparing a tile: seconds, the process's peak memory and the memory kept, over the grid's size
//! and its active share. Each case runs in a separate process, so that peaks are independent.
//!
//!     cargo bench -p vrtm-benches --bench prepare
//!     cargo bench -p vrtm-benches --bench prepare -- --grids 4096,8192 --shares 0.02,0.25 --solve --out benches/results/prepare

#![allow(missing_docs)]

mod case;
mod memory;
mod plot;

use std::path::PathBuf;
use std::process::{Command, ExitCode};

use case::{Case, Outcome};
use clap::Parser;

/// Measures the cost of preparing a tile.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Cells on a side of the grids.
    #[arg(long, value_delimiter = ',', default_values_t = [1024, 2048, 4096, 8192])]
    grids: Vec<u32>,
    /// Shares of the tile that charts cover.
    #[arg(long, value_delimiter = ',', default_values_t = [0.02, 0.25, 1.0])]
    shares: Vec<f64>,
    /// Also solve (`normal`) and fetch.
    #[arg(long)]
    solve: bool,
    /// CPU threads; by default all cores.
    #[arg(long)]
    threads: Option<u32>,
    /// Write a table, JSON and a plot there, with these endings.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Run one case in this process: its grid and its share.
    #[arg(long, hide = true, num_args = 2)]
    one: Option<Vec<f64>>,
    /// Passed by `cargo bench` and not by `cargo test`; without it one small case is measured.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> ExitCode {
    let mut args = Args::parse();
    if !args.bench && args.one.is_none() {
        (args.grids, args.shares, args.out) = (vec![256], vec![0.25], None);
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
    if let Some(one) = &args.one {
        let case = Case { grid: one[0] as u32, share: one[1], solve: args.solve, threads: args.threads };
        println!("{}", case.run()?.to_json());
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut outcomes = Vec::new();
    println!("{}", Outcome::HEAD);
    for &grid in &args.grids {
        for &share in &args.shares {
            let mut command = Command::new(&program);
            command.args(["--one", &grid.to_string(), &share.to_string()]);
            if args.solve {
                command.arg("--solve");
            }
            if let Some(threads) = args.threads {
                command.args(["--threads", &threads.to_string()]);
            }
            let output = command.output().map_err(|e| e.to_string())?;
            let text = String::from_utf8_lossy(&output.stdout);
            match text.lines().last().and_then(Outcome::from_json) {
                Some(outcome) => {
                    println!("{}", outcome.row());
                    outcomes.push(outcome);
                }
                None => {
                    let why = String::from_utf8_lossy(&output.stderr);
                    println!(
                        "| {grid}² | {share} | {} {} |",
                        output.status,
                        why.lines().last().unwrap_or_default()
                    );
                }
            }
        }
    }
    match &args.out {
        Some(out) => plot::write(&outcomes, out),
        None => Ok(()),
    }
}
