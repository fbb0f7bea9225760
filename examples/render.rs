//! Draws a mesh through its redirection map on a GPU, in several ways, and prints the cost of each way and its
//! difference from a texture that was warped beforehand.
//!
//! `cargo run --release --example render` draws a built-in scene into `out/`; `--help` lists the options. The shaders
//! in `examples/render/` are short and meant to be copied: `map_filtered.wgsl` and `forward.wgsl` are all that a
//! forward renderer needs; `deferred.wgsl` is for a deferred renderer.

#[path = "render/mod.rs"]
mod render;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use render::Result;
use render::camera::View;
use render::difference::{self, difference};
use render::gpu::Gpu;
use render::model::Model;
use render::stage::{Stage, medians, shot};
use render::ways::{self, Way};
use vrtm::DeviceSettings;

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
    /// Light with a normal map, whose tangents follow the redirected UVs. Pictures are not compared then.
    #[arg(long)]
    normals: bool,
    /// Degrees around the mesh, and upward.
    #[arg(long, value_name = "YAW,PITCH", allow_hyphen_values = true, value_parser = degrees)]
    view: Option<[f64; 2]>,
    /// How much larger than the picture the mesh is.
    #[arg(long, value_name = "X", default_value_t = 1.0)]
    zoom: f64,
    /// Z points up, not y.
    #[arg(long)]
    z_up: bool,
    /// Frames to time for each way, in nine rounds of which the median counts.
    #[arg(long, value_name = "N", default_value_t = 3)]
    frames: u32,
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

fn degrees(text: &str) -> std::result::Result<[f64; 2], String> {
    let pair = text.split_once(',').and_then(|(y, p)| Some([y.parse().ok()?, p.parse().ok()?]));
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
    if !args.map.is_power_of_two() {
        return Err(format!("--map {}: not a power of two", args.map));
    }
    if !(args.zoom > 0.0 && args.zoom.is_finite()) {
        return Err(format!("--zoom {}: not more than 0", args.zoom));
    }
    let gpu = Gpu::open(args.adapter)?;
    gpu.check("--map", args.map, 1)?;
    gpu.check(
        "--texture, and twice that for the one that is warped beforehand",
        args.texture.saturating_mul(if args.normals { 1 } else { 2 }),
        1,
    )?;
    let model = match &args.asset {
        Some(folder) => Model::folder(folder)?,
        None => Model::scene(&args.scene)?,
    };
    let frame = args.frame.unwrap_or(model.frames.len());
    let side = args.texture as usize;
    let stage = Stage::new(&model, frame, side, args.normals, &DeviceSettings::default())?;

    let renderer = stage.renderer(&gpu, args.size)?;
    let mut view = View { zoom: args.zoom, z_up: args.z_up, ..View::of(&stage.positions) };
    if let Some([yaw, pitch]) = args.view {
        view = View { yaw, pitch, ..view };
    }
    let camera = stage.camera(&renderer, &view, args.size);
    let material = renderer.material(&stage.colours, stage.normals.as_deref())?;
    let maps = renderer.maps(&stage.solved, args.map)?;
    let pipelines: Vec<_> = ways::ALL.iter().map(|way| renderer.pipelines(way, args.normals)).collect();
    let shots: Vec<_> = ways::ALL
        .iter()
        .zip(&pipelines)
        .map(|(way, pipelines)| shot(way, pipelines, &camera, &material, &maps))
        .collect();

    std::fs::create_dir_all(&args.out).map_err(|error| format!("{}: {error}", args.out.display()))?;
    let save = |name: &str, texels: &[u8]| save(&args.out.join(name), args.size, texels);
    let reference = match &stage.warped {
        None => None,
        Some(warped) => {
            let warped = renderer.material(warped, None)?;
            let pipelines = renderer.pipelines(&ways::ORIGINAL, false);
            let picture = renderer.picture(&shot(&ways::ORIGINAL, &pipelines, &camera, &warped, &maps))?;
            save("reference.png", &picture)?;
            Some(picture)
        }
    };
    let mut lines = Vec::new();
    for (way, shot) in ways::ALL.iter().zip(&shots) {
        let picture = renderer.picture(shot)?;
        save(&format!("{}.png", way.name), &picture)?;
        let mut line = String::new();
        if let Some(reference) = &reference {
            save(&format!("{}.difference.png", way.name), &difference::picture(&picture, reference))?;
            let d = difference(&picture, reference);
            line = format!("{:9.2} {:5} {:5}", d.mean, d.p99, d.max);
        }
        lines.push(line);
    }
    let times = medians(&renderer, &shots, 9, args.frames.max(1))?;
    let clock = if gpu.software { ", a software driver: its times say nothing about GPUs" } else { "" };
    println!("{}{clock}", gpu.name);
    println!("{:18} {:>9} {:>9} {:>5} {:>5}  map", "way", "ms/frame", "mean", "99 %", "max");
    for ((way, line), ms) in ways::ALL.iter().zip(lines).zip(times) {
        let Way { name, .. } = way;
        println!("{name:18} {ms:9.3} {line:21}  {}", way.reads(gpu.filterable));
    }
    println!("differences, of 255, are from reference.png; written to {}", args.out.display());
    Ok(())
}

/// Writes a picture over a dark grey background.
fn save(path: &Path, [width, height]: [u32; 2], texels: &[u8]) -> Result<()> {
    let over = |texel: &[u8]| if texel[3] == 255 { [texel[0], texel[1], texel[2]] } else { [38; 3] };
    let bytes: Vec<u8> = texels.chunks_exact(4).flat_map(over).collect();
    image::save_buffer(path, &bytes, width, height, image::ExtendedColorType::Rgb8)
        .map_err(|error| format!("{}: {error}", path.display()))
}
