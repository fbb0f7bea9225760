//! Draws a mesh through its redirection map on a GPU, in several ways, and prints the cost of each way and its
//! difference from a texture that was warped beforehand.
//!
//! `cargo run --release -p vrtm-render` draws a built-in scene into `out/`; `--help` lists the options. With `--live` it
//! solves, inverts and draws frame by frame with no map in the CPU's memory, and prints what each takes (`live.rs`,
//! `shared.rs`).
//! The shaders in `examples/render/` are short and meant to be copied: `map_filtered.wgsl` and `forward.wgsl` are all that a
//! forward renderer needs; `deferred.wgsl` is for a deferred renderer.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use vrtm::DeviceSettings;
use vrtm_render::camera::View;
use vrtm_render::difference::{self, difference};
use vrtm_render::draw::Shot;
use vrtm_render::gpu::Gpu;
#[cfg(target_os = "linux")]
use vrtm_render::live::{self, Live, Times, Transport};
use vrtm_render::maps::Solved;
use vrtm_render::model::Model;
use vrtm_render::stage::{Stage, medians, shot};
use vrtm_render::ways::{self, Way};
use vrtm_render::{Result, texture};

/// Draws a mesh through its redirection map, in several ways.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Args {
    /// Built-in scene.
    #[arg(long, default_value = "mug_to_jug", conflicts_with = "asset")]
    scene: String,
    /// Folder with asset.json, rest.obj, frames.f32 and rigidity maps.
    #[arg(long, value_name = "DIR")]
    asset: Option<PathBuf>,
    /// Frame, from 1 [default: the last one].
    #[arg(long, value_name = "N")]
    frame: Option<usize>,
    /// Size of the picture.
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = size)]
    size: [u32; 2],
    /// Texels on a side of the texture, a power of two.
    #[arg(long, value_name = "N", default_value_t = 4096)]
    texture: u32,
    /// Texels on a side of the redirection map, a power of two.
    #[arg(long, value_name = "N", default_value_t = 2048)]
    map: u32,
    /// Degrees around the mesh, and upward.
    #[arg(long, value_name = "YAW,PITCH", allow_hyphen_values = true, value_parser = pair)]
    view: Option<[f64; 2]>,
    /// Z points up, not y.
    #[arg(long)]
    z_up: bool,
    /// Frames to time for each way, in nine rounds of which the median counts.
    #[arg(long, value_name = "N", default_value_t = 3)]
    frames: u32,
    /// Solve, invert and draw so many frames one after the other, and print the time of each: with maps in memory that the
    /// library and this program share on the GPU, and then with maps that pass through the CPU. On Linux.
    #[arg(long, value_name = "N")]
    live: Option<usize>,
    /// Cells on a side of each tile's grid [default: the library's choice].
    #[arg(long, value_name = "N", requires = "live")]
    grid: Option<u32>,
    /// Number of the GPU; hardware comes first.
    #[arg(long, value_name = "N", default_value_t = 0)]
    adapter: usize,
    /// Folder for the pictures.
    #[arg(long, value_name = "DIR", default_value = "out")]
    out: PathBuf,
}

fn size(text: &str) -> std::result::Result<[u32; 2], String> {
    let pair = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    pair.ok_or_else(|| "not as in 1920x1080".into())
}

fn pair(text: &str) -> std::result::Result<[f64; 2], String> {
    let pair = text.split_once(',').and_then(|(a, b)| Some([a.parse().ok()?, b.parse().ok()?]));
    pair.ok_or_else(|| "not as in -25,14".into())
}

fn main() -> ExitCode {
    match run(&Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(line) => {
            eprintln!("render: {line}");
            ExitCode::from(2)
        }
    }
}

fn run(args: &Args) -> Result<()> {
    for (name, side) in [("--map", args.map), ("--texture", args.texture)] {
        if !side.is_power_of_two() {
            return Err(format!("{name} {side}: not a power of two"));
        }
    }
    let gpu = Gpu::open(args.adapter)?;
    gpu.check("--map", args.map, 1)?;
    let twice = args.texture.saturating_mul(2);
    gpu.check("--texture, and twice that for the one that is warped beforehand", twice, 1)?;
    let model = match &args.asset {
        Some(folder) => Model::folder(folder)?,
        None => Model::scene(&args.scene)?,
    };
    if let Some(count) = args.live {
        return live(args, &gpu, &model, count);
    }
    let frame = args.frame.unwrap_or(model.frames.len());
    let side = args.texture as usize;
    let stage = Stage::new(&model, frame, side, &DeviceSettings::default())?;

    let renderer = stage.renderer(&gpu, args.size)?;
    let camera = stage.camera(&renderer, &view(args, &stage.positions), args.size);
    let material = renderer.material(&stage.colours)?;
    let maps = renderer.maps(&stage.solved, args.map)?;
    let pipelines: Vec<_> = ways::ALL.iter().map(|way| renderer.pipelines(way)).collect();
    let shots: Vec<_> = ways::ALL
        .iter()
        .zip(&pipelines)
        .map(|(way, pipelines)| shot(way, pipelines, &camera, &material, &maps))
        .collect();

    create(&args.out)?;
    let save = |name: &str, texels: &[u8]| save(&args.out.join(name), args.size, texels);
    // The warped texture, with the original UVs.
    let warped = renderer.material(&stage.warped)?;
    let reference = renderer.picture(&Shot { material: &warped, ..shots[0] })?;
    save("reference.png", &reference)?;
    let mut lines = Vec::new();
    for (way, shot) in ways::ALL.iter().zip(&shots) {
        let picture = renderer.picture(shot)?;
        save(&format!("{}.png", way.name), &picture)?;
        save(&format!("{}.difference.png", way.name), &difference::picture(&picture, &reference))?;
        let d = difference(&picture, &reference);
        lines.push(format!("{:9.2} {:5} {:5}", d.mean, d.p99, d.max));
    }
    let times = medians(&renderer, &shots, 9, args.frames.max(1))?;
    let clock = if gpu.software { ", a software driver: its times say nothing about GPUs" } else { "" };
    println!("{}{clock}", gpu.name);
    println!("{:18} {:>9} {:>9} {:>5} {:>5}  map", "way", "ms/frame", "mean", "99 %", "max");
    for ((way, line), ms) in ways::ALL.iter().zip(lines).zip(times) {
        let Way { name, .. } = way;
        println!("{name:18} {ms:9.3} {line}  {}", way.reads(gpu.filterable));
    }
    println!("differences, of 255, are from reference.png; written to {}", args.out.display());
    Ok(())
}

/// Solves, inverts and draws frames one after the other.
#[cfg(target_os = "linux")]
fn live(args: &Args, gpu: &Gpu, model: &Model, count: usize) -> Result<()> {
    let mut solved = Solved::open(model, &live::settings(gpu))?;
    args.grid.map_or(Ok(()), |cells| solved.set_grid(cells))?;
    let painted = |udim: &u32| model.tiles.iter().find(|tile| tile.udim == *udim);
    let side = args.texture as usize;
    let colours: Vec<_> = solved.udims.iter().map(|udim| texture::colours(painted(udim), side)).collect();
    let mut live = Live::new(gpu, model, solved, &colours, &view(args, &model.rest), args.size, args.map)?;
    let shared = live.shared()?;
    let clock = if gpu.software { ", a software driver: its times say nothing about GPUs" } else { "" };
    println!("{}{clock}", gpu.name);
    let mut rows = Vec::new();
    for (name, transport) in [("shared memory", &shared), ("through the CPU", &Transport::Host)] {
        let mut times = Vec::new();
        // The first frame makes the solver's memory and the pipelines.
        for n in 0..=count {
            times.push(live.frame(&live::pose(model, n), transport)?);
            println!("{}", line(name, &times[n]));
        }
        let medians = live::medians(&times[1..]);
        create(&args.out)?;
        let path = args.out.join(format!("live {name}.png").replace(' ', "-"));
        save(&path, args.size, &live.picture()?)?;
        rows.push((name, medians));
    }
    println!("medians without the first frame:");
    rows.iter().for_each(|(name, medians)| println!("{}", line(name, medians)));
    println!("the last pictures are written to {}", args.out.display());
    Ok(())
}

/// Times of a frame.
#[cfg(target_os = "linux")]
fn line(name: &str, t: &live::Times) -> String {
    let Times { solve, map, draw } = t;
    format!("{name:16} {:8.2} ms: solve {solve:.2}, map {map:.2}, draw {draw:.2}", t.frame())
}

#[cfg(not(target_os = "linux"))]
fn live(_: &Args, _: &Gpu, _: &Model, _: usize) -> Result<()> {
    Err("--live: memory is shared through file descriptors of Vulkan, on Linux".into())
}

/// The view that the options ask for.
fn view(args: &Args, positions: &[[f32; 3]]) -> View {
    let view = View { z_up: args.z_up, ..View::of(positions) };
    args.view.map_or(view, |[yaw, pitch]| View { yaw, pitch, ..view })
}

fn create(folder: &Path) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))
}

/// Writes a picture over a dark grey background.
fn save(path: &Path, [width, height]: [u32; 2], texels: &[u8]) -> Result<()> {
    let over = |texel: &[u8]| if texel[3] == 255 { [texel[0], texel[1], texel[2]] } else { [38; 3] };
    let bytes: Vec<u8> = texels.chunks_exact(4).flat_map(over).collect();
    image::save_buffer(path, &bytes, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|error| format!("{}: {error}", path.display()))
}
