//! Measures the cost of drawing through a redirection map, and the picture's difference from one whose texture was
//! warped beforehand: over sizes of the map, for a view of the whole mesh and for a view of a part of it.
//!
//!     cargo bench -p vrtm-benches --bench render
//!     cargo bench -p vrtm-benches --bench render -- --size 1920x1080 --maps 1024,4096 --rounds 31

#![allow(missing_docs)]

mod table;

use std::process::ExitCode;

use clap::Parser;
use table::Row;
use vrtm::{Backend, DeviceSettings};
use vrtm_render::Result;
use vrtm_render::camera::View;
use vrtm_render::difference::difference;
use vrtm_render::draw::Renderer;
use vrtm_render::gpu::Gpu;
#[cfg(target_os = "linux")]
use vrtm_render::live::{self, Live, Transport};
#[cfg(target_os = "linux")]
use vrtm_render::maps::Solved;
use vrtm_render::model::Model;
use vrtm_render::stage::{Stage, medians, shot};
use vrtm_render::ways::{ALL, Map, ORIGINAL};
use vrtm_testkit::bench;

/// Measures drawing through a redirection map.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Built-in scene.
    #[arg(long, default_value = "mug_to_jug")]
    scene: String,
    /// Frame, from 1; the last one if there are fewer.
    #[arg(long, default_value_t = 5)]
    frame: usize,
    /// Size of the picture; 640x360 on a software driver, else 1920x1080.
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// Texels on a side of the texture.
    #[arg(long, default_value_t = 4096)]
    texture: u32,
    /// Texels on a side of the maps.
    #[arg(long, value_delimiter = ',', default_values_t = [512, 1024, 2048, 4096])]
    maps: Vec<u32>,
    /// Times of which the median counts.
    #[arg(long, default_value_t = 15)]
    rounds: usize,
    /// Frames of which each time is the mean.
    #[arg(long, default_value_t = 0)]
    frames: u32,
    /// Number of the adapter.
    #[arg(long, default_value_t = 0)]
    adapter: usize,
    /// File for the table [default: render-NAME.md in benches/results with the GPU's name, render.md for a software
    /// driver].
    #[arg(long, value_name = "FILE")]
    out: Option<String>,
    /// Passed by `cargo bench` and not by `cargo test`; without it small maps are drawn once and nothing is written.
    #[arg(long, hide = true)]
    bench: bool,
}

fn size(text: &str) -> std::result::Result<[u32; 2], String> {
    let pair = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    pair.ok_or_else(|| "not as in 1920x1080".into())
}

fn main() -> ExitCode {
    let mut args = Args::parse();
    if !args.bench {
        if vrtm::adapters().is_empty() {
            println!("skipped: no GPU adapter");
            return ExitCode::SUCCESS;
        }
        args = Args { texture: 512, maps: vec![128], rounds: 1, size: Some([160, 90]), ..args };
    }
    bench::main(|| run(&args))
}

fn run(args: &Args) -> Result<()> {
    if let Some(side) = args.maps.iter().find(|side| !side.is_power_of_two()) {
        return Err(format!("--maps {side}: not a power of two"));
    }
    let gpu = Gpu::open(args.adapter)?;
    args.maps.iter().try_for_each(|&side| gpu.check("--maps", side, 1))?;
    gpu.check(
        "--texture, and twice that for the one that is warped beforehand",
        args.texture.saturating_mul(2),
        1,
    )?;
    let size = args.size.unwrap_or(if gpu.software { [640, 360] } else { [1920, 1080] });
    let frames = if args.frames > 0 {
        args.frames
    } else if gpu.software {
        1
    } else {
        50
    };
    let model = Model::scene(&args.scene)?;
    let frame = args.frame.min(model.frames.len());
    let settings = DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() };
    let stage = Stage::new(&model, frame, args.texture as usize, false, &settings)?;
    let renderer = stage.renderer(&gpu, size)?;

    let whole = View::of(&stage.positions);
    // Pixels are then about as large as the texels of a texture of 4096.
    let part = View { zoom: 3240.0 / f64::from(size[1]), ..whole };
    let mut text = table::head(&gpu, &model.name, frame, size, args.texture, args.rounds * frames as usize);
    for (title, view) in [("The whole mesh", whole), ("A part of it, a texel of 4096 for each pixel", part)] {
        let rows = measure(args, &gpu, &stage, &renderer, &view, size, frames)?;
        text += &table::view(title, &rows);
    }
    text += &table::maps_head(args.texture);
    for (&side, delta) in args.maps.iter().flat_map(|side| [(side, false), (side, true)]) {
        let reports = (0..stage.solved.udims.len()).map(|tile| stage.solved.inspect(tile, side, delta));
        text += &table::map(side, delta, args.texture, &reports.collect::<Result<Vec<_>>>()?);
    }
    // On a software driver a solve would take longer than all else, and its time would say nothing.
    #[cfg(target_os = "linux")]
    if !gpu.software || !args.bench {
        text += table::FRAMES;
        for &side in &args.maps {
            text += &live_frames(&gpu, &model, &stage, &whole, side, size, args.rounds)?;
        }
    }
    print!("{text}");
    if args.bench {
        let name =
            if gpu.software { String::new() } else { format!("-{}", bench::in_file_name(&gpu.adapter)) };
        let path = args.out.clone().unwrap_or_else(|| format!("benches/results/render{name}.md"));
        bench::write(path.as_ref(), &text)?;
        println!("written to {path}");
    }
    Ok(())
}

/// Rows for whole frames, solved on grids with as many cells as the maps have texels.
#[cfg(target_os = "linux")]
fn live_frames(
    gpu: &Gpu,
    model: &Model,
    stage: &Stage,
    view: &View,
    side: u32,
    size: [u32; 2],
    count: usize,
) -> Result<String> {
    let mut solved = Solved::open(model, &live::settings(gpu))?;
    solved.set_grid(side)?;
    let mut live = Live::new(gpu, model, solved, &stage.colours, view, size, side)?;
    let shared = live.shared()?;
    let mut text = String::new();
    for (name, transport) in [("shared memory", &shared), ("through the CPU", &Transport::Host)] {
        // The first frames make memory and pipelines, and raise the GPU's clock.
        let frames = (0..2 * count).map(|n| live.frame(&live::pose(model, n), transport));
        let frames = frames.collect::<Result<Vec<_>>>()?;
        text += &table::frame(name, side, &live::medians(&frames[count..]));
    }
    Ok(text)
}

/// Measures all ways with all maps in turn.
fn measure(
    args: &Args,
    gpu: &Gpu,
    stage: &Stage,
    renderer: &Renderer,
    view: &View,
    size: [u32; 2],
    frames: u32,
) -> Result<Vec<Row>> {
    let camera = stage.camera(renderer, view, size);
    let material = renderer.material(&stage.colours, None)?;
    let warped = renderer.material(stage.warped.as_ref().ok_or("no reference")?, None)?;
    // All sensible ways. The error of a map with mip levels is measured in `crates/gpu/tests/gpu/draw.rs`.
    let ways: Vec<_> = ALL.into_iter().filter(|way| way.map != Map::DeltaMips).collect();
    let pipelines: Vec<_> = ways.iter().map(|way| renderer.pipelines(way, false)).collect();
    let maps =
        args.maps.iter().map(|&side| renderer.maps(&stage.solved, side)).collect::<Result<Vec<_>>>()?;
    // A way without a map is drawn once, the others are drawn with each of the maps.
    let mut plan = Vec::new();
    for (way, pipelines) in ways.iter().zip(&pipelines) {
        let used = if way.map == Map::None { 1 } else { maps.len() };
        let sides = maps.iter().zip(&args.maps).take(used);
        plan.extend(sides.map(|(maps, &side)| (*way, side, shot(way, pipelines, &camera, &material, maps))));
    }
    let reference = renderer.picture(&shot(&ORIGINAL, &pipelines[0], &camera, &warped, &maps[0]))?;
    let shots: Vec<_> = plan.iter().map(|(_, _, shot)| *shot).collect();
    let times = medians(renderer, &shots, args.rounds, frames)?;
    let base = |deferred: bool| {
        let at = plan.iter().position(|(way, ..)| way.map == Map::None && way.deferred == deferred);
        at.map_or(f64::NAN, |at| times[at])
    };
    let rows = plan.iter().zip(&times).map(|((way, side, shot), &ms)| {
        let d = difference(&renderer.picture(shot)?, &reference);
        let more = 100.0 * (ms / base(way.deferred) - 1.0);
        let (map, more) = if way.map == Map::None { (None, None) } else { (Some(*side), Some(more)) };
        Ok(Row { way: way.name, reads: way.reads(gpu.filterable), map, ms, more, d })
    });
    rows.collect()
}
