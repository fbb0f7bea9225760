//! Measures the cost of preparing a tile: seconds, the process's peak memory and the memory kept, over the grid's size
//! and its active share. Each case runs in a separate process, so that peaks are independent.
//!
//!     cargo bench -p vrtm-benches --bench prepare
//!     cargo bench -p vrtm-benches --bench prepare -- --grids 4096,8192 --solve --out benches/results/prepare.md

#![allow(missing_docs)]

mod case;
mod memory;

use std::path::PathBuf;
use std::process::{Command, ExitCode};

use case::{Case, HEAD};
use clap::Parser;
use vrtm_testkit::bench;

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
    /// Also write the table there.
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
    bench::main(|| run(&args))
}

fn run(args: &Args) -> Result<(), String> {
    if let Some(one) = &args.one {
        let case = Case { grid: one[0] as u32, share: one[1], solve: args.solve, threads: args.threads };
        println!("{}", case.run()?);
        return Ok(());
    }
    let program = std::env::current_exe().map_err(|e| e.to_string())?;
    let mut table = format!("{HEAD}\n");
    print!("{table}");
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
            let [text, why] = [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes));
            let row = match text.lines().last() {
                Some(row) if output.status.success() => format!("{row}\n"),
                _ => format!(
                    "| {grid}² | {share} | {} {} |\n",
                    output.status,
                    why.lines().last().unwrap_or_default()
                ),
            };
            print!("{row}");
            table += &row;
        }
    }
    bench::write_out(&args.out, &format!("{ABOUT}\n{table}"))
}

const ABOUT: &str = "\
# Preparing a tile

`cargo bench -p vrtm-benches --bench prepare -- --solve` on the CPU. Sixteen charts cover a share of the tile, with
discs of rigidity all over its map (8 bits). Seconds of preparing it; bytes of the process beyond what the caller holds,
at the peak and when the tile is prepared, so that the mesh (16,384 quads) and the map count; then a first solve
(`normal`), another one, the whole map fetched in bands of 128 rows, the peak of all of that, and what stays.
";
