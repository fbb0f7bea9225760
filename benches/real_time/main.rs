//! Measures what a host that plays frames waits for: solves with their stages, what they leave of the strain, and
//! outputs.
//!
//!     cargo bench -p vrtm-benches --bench real_time
//!     cargo bench -p vrtm-benches --bench real_time -- --grids 512 --scenes bulge,squash --level avx2

#![allow(missing_docs)]

use std::time::{Duration, Instant};

use clap::Parser;
use vrtm::{
    Asset, Device, FetchKind, ImageViewMut, OutputTexel, Quality, SolveOptions, StageTimes, TileReport, f16,
};
use vrtm_testkit::{Model, bench};

/// Measures solves, their stages, and outputs.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Built-in scenes.
    #[arg(long, value_delimiter = ',', default_values = ["bulge"])]
    scenes: Vec<String>,
    /// Cells on a side of the grids.
    #[arg(long, value_delimiter = ',', default_values_t = [256, 512, 1024, 2048])]
    grids: Vec<u32>,
    /// The shortest time of so many runs counts.
    #[arg(long, default_value_t = 7)]
    repeats: usize,
    /// Texels on a side of the images; by default as many as cells, and an eighth of that.
    #[arg(long, value_delimiter = ',')]
    texels: Vec<u32>,
    /// Leave out the solves, and measure outputs alone.
    #[arg(long)]
    outputs: bool,
    /// Leave out the outputs, and measure solves alone.
    #[arg(long, conflicts_with = "outputs")]
    solves: bool,
    /// Qualities of the solves.
    #[arg(long, value_parser = bench::quality, value_delimiter = ',', default_values = ["draft", "normal"])]
    qualities: Vec<Quality>,
    /// CPU threads; 0 for one per core.
    #[arg(long, default_value_t = 0)]
    threads: u32,
    /// Processor level of the kernels, `avx512`, `avx2` or `baseline`; by default the highest.
    #[arg(long)]
    level: Option<String>,
    /// Passed by `cargo bench` and not by `cargo test`; without it one small grid is measured.
    #[arg(long, hide = true)]
    bench: bool,
}

fn main() -> Result<(), String> {
    let mut args = Args::parse();
    if !args.bench {
        (args.grids, args.repeats) = (vec![128], 1);
    }
    bench::at_level(args.level.as_deref(), || run(&args))
}

fn run(args: &Args) {
    let device = vrtm_testkit::cpu(args.threads);
    println!("Milliseconds on {} threads, the shortest of {} runs.", device.info().threads, args.repeats);
    let models: Vec<Model> = args.scenes.iter().map(|name| bench::model(name)).collect();
    if !args.outputs {
        all_solves(args, &device, &models);
    }
    if args.solves {
        return;
    }
    println!("\n## Outputs, of a result at `normal`\n");
    println!(
        "| scene | grid | texels | map | nanoseconds per texel | derivatives | f16, 4 channels | corner UVs |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for model in &models {
        for &grid in &args.grids {
            outputs(args, &device, model, grid);
        }
    }
}

/// The shortest time in milliseconds.
fn shortest(repeats: usize, mut work: impl FnMut()) -> f64 {
    let times = (0..repeats).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed()
    });
    times.min().unwrap_or(Duration::ZERO).as_secs_f64() * 1e3
}

/// Each row once, then all of them again: a disturbance of the machine affects all alike.
fn all_solves(args: &Args, device: &Device, models: &[Model]) {
    println!("\n## Solves\n");
    println!(
        "| scene | grid | quality | prepare | first | next | ns per active node | map | next and map | strain | \
         energy | surface | pyramid | prolong | relax | correct | certify |"
    );
    println!("|{}", "---|".repeat(17));
    let mut rows = Vec::new();
    for model in models {
        for &grid in &args.grids {
            rows.extend(args.qualities.iter().map(|&quality| Row::new(device, model, grid, quality)));
        }
    }
    let largest = args.grids.iter().max().map_or(0, |&n| n as usize);
    let mut texels = vec![[0.0f32; 2]; largest * largest];
    for round in 0..args.repeats {
        rows.iter_mut().for_each(|row| row.measure(2 - round % 2, &mut texels));
    }
    rows.iter_mut().for_each(Row::print);
}

/// A tile's solves at a quality.
struct Row<'a> {
    model: &'a Model,
    grid: u32,
    options: SolveOptions,
    asset: Asset,
    /// Milliseconds, the shortest.
    prepare: f64,
    first: f64,
    next: f64,
    map: f64,
    stages: StageTimes,
}

impl Row<'_> {
    /// A tile that has been solved once.
    fn new<'a>(device: &Device, model: &'a Model, grid: u32, quality: Quality) -> Row<'a> {
        let options = SolveOptions { quality, ..SolveOptions::default() };
        let start = Instant::now();
        let mut asset = model.asset_on(device, grid);
        asset.tile_mut(0).info().expect("a tile");
        let prepare = start.elapsed().as_secs_f64() * 1e3;
        let first = shortest(1, || asset.solve(model.frame(1), &options).expect("a solve"));
        let (next, map, stages) = (f64::INFINITY, f64::INFINITY, StageTimes::default());
        Row { model, grid, options, asset, prepare, first, next, map, stages }
    }

    /// Solves for a frame, and fetches the map.
    fn measure(&mut self, frame: usize, texels: &mut [[f32; 2]]) {
        let pose = self.model.frame(frame);
        let ms = shortest(1, || self.asset.solve(pose, &self.options).expect("a solve"));
        if ms < self.next {
            (self.next, self.stages) = (ms, self.report().times);
        }
        let texels = &mut texels[..(self.grid * self.grid) as usize];
        let map = shortest(1, || image(&self.asset, FetchKind::Redirection, texels, self.grid));
        self.map = self.map.min(map);
    }

    fn report(&self) -> TileReport {
        self.asset.tile(0).report().expect("a report")
    }

    fn print(&mut self) {
        let nodes = self.report().nodes_active as f64;
        let options = SolveOptions { measure: true, ..self.options };
        self.asset.solve(self.model.frame(1), &options).expect("a solve");
        let report = self.report();
        let Row { model, grid, options, prepare, first, next, map, stages, .. } = self;
        print!("| {} | {grid} | {:?} | {prepare:.0} | {first:.1} | {next:.1}", model.name, options.quality);
        print!(" | {:.0} | {map:.1} | {:.1}", *next * 1e6 / nodes, *next + *map);
        print!(" | {:.5}", report.strain.map_or(f32::NAN, |strain| strain.after.rms));
        print!(" | {:.6} | {:.2}", report.energy / report.energy_before, stages.surface);
        print!(" | {:.2} | {:.2} | {:.2}", stages.pyramid, stages.prolong, stages.relax);
        println!(" | {:.2} | {:.2} |", stages.correct, stages.certify);
    }
}

/// Fetches a packed image of a size on a side.
fn image<T: OutputTexel>(asset: &Asset, kind: FetchKind, texels: &mut [T], size: u32) {
    let mut image = ImageViewMut::from_texels("image", texels, [size; 2]).expect("an image");
    asset.tile(0).fetch(kind, &mut image).expect("an output");
}

fn outputs(args: &Args, device: &Device, model: &Model, grid: u32) {
    let mut asset = model.asset_on(device, grid);
    asset.solve(model.frame(1), &SolveOptions::default()).expect("a solve");
    let corners = asset.info().corners as usize;
    let mut uvs = vec![[0.0f32; 2]; corners];
    let sizes = if args.texels.is_empty() { vec![grid, grid / 8] } else { args.texels.clone() };
    for texels in sizes {
        let count = (texels * texels) as usize;
        let mut floats = vec![[0.0f32; 2]; count];
        let mut halves = vec![[f16::ZERO; 4]; count];
        let mut matrices = vec![[0.0f32; 4]; count];
        let map = shortest(args.repeats, || image(&asset, FetchKind::Redirection, &mut floats, texels));
        let jacobian = shortest(args.repeats, || image(&asset, FetchKind::Jacobian, &mut matrices, texels));
        let half = shortest(args.repeats, || image(&asset, FetchKind::RedirectionDelta, &mut halves, texels));
        let corner = shortest(args.repeats, || {
            asset.corner_uvs(0, &mut uvs).expect("corner UVs");
        });
        println!(
            "| {} | {grid} | {texels} | {map:.2} | {:.1} | {jacobian:.2} | {half:.2} | {corner:.2} |",
            model.name,
            map * 1e6 / f64::from(texels * texels),
        );
    }
}
