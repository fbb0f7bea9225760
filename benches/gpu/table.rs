//! The rows of the tables: one scene at one size, at each quality.

use std::fmt::Write;
use std::time::Instant;

use vrtm::{
    Asset, Device, FetchKind, GpuWork, ImageLayout, ImageViewMut, PbdSettings, PixelFormat, Quality,
    SolveOptions, Solver, Strided,
};

use crate::warm;
use vrtm_testkit::{Model, scenes};

pub fn head() -> String {
    "Milliseconds, medians with a warm GPU: after two seconds of solves; \"first\" is the first of these on the GPU, \"clock\" that of\n\
     the multiprocessors after the last and its maximum in MHz. \"excess\": (E - best E) / (E of the identity - best E), best = seven corrections that go on to the last 1e-6 of gain;\n\
     a `draft` reports the energy on the level that it ends on, which has no excess. \"pbd\" is the paper's solver. \"strain\": RMS on the mesh, with the original UVs and after.\n\n\
     | scene | size | quality | active nodes | upload | solve (GPU) | first | solve (wall) | invert + readback: f32, delta in f16 | strain | excess, % | min J, folds | MB held | clock |\n\
     |---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .into()
}

/// A pose, and the same pose moved slightly towards rest. They are solved alternately, so that no result is reused.
fn poses(model: &Model, frame: usize) -> [Vec<[f32; 3]>; 2] {
    let pose = &model.frames[frame - 1];
    let nearly = pose.iter().zip(&model.rest).map(|(p, r)| [0, 1, 2].map(|k| p[k] + 0.001 * (r[k] - p[k])));
    [nearly.collect(), pose.clone()]
}

#[derive(Default)]
struct Times {
    upload: Vec<f32>,
    gpu: Vec<f32>,
    wall: Vec<f32>,
    /// Of a redirection in f32, and of a delta in f16.
    invert: [Vec<f32>; 2],
}

fn median(values: &mut [f32]) -> f32 {
    values.sort_by(f32::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

fn draft() -> SolveOptions {
    SolveOptions { quality: Quality::Draft, ..SolveOptions::default() }
}

/// The paper's solver. It says that an iteration is 70 passes, which is one iteration on each level, and not how many a
/// frame has; 16 on each level are this library's default.
fn paper(iterations: u32) -> SolveOptions {
    let pbd = PbdSettings { iterations, ..PbdSettings::default() };
    SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() }
}

/// Solves and fetches once, and records the times.
fn once(
    asset: &mut Asset,
    pose: &[[f32; 3]],
    options: &SolveOptions,
    map: &mut [u8],
    times: &mut Times,
) -> vrtm::Result<()> {
    asset.solve(Strided::from_slice(pose), options)?;
    let report = asset.tile(0).report()?;
    times.wall.push(report.times.total);
    if let Some(work) = asset.tile(0).gpu_work()? {
        times.upload.push(work.upload_ms);
        times.gpu.push(work.gpu_ms.unwrap_or(f32::NAN));
    }
    let [width, height] = report.grid;
    // In turn, the second of each fetch: the first one makes its buffers.
    let images =
        [(PixelFormat::F32, FetchKind::Redirection), (PixelFormat::F16, FetchKind::RedirectionDelta)];
    for ((format, kind), times) in images.into_iter().zip(&mut times.invert) {
        let bytes = &mut map[..width as usize * height as usize * 2 * format.size()];
        let mut image = ImageViewMut::new("map", bytes, ImageLayout::packed(width, height, format))?;
        asset.tile(0).fetch(kind, &mut image)?;
        let start = Instant::now();
        asset.tile(0).fetch(kind, &mut image)?;
        times.push(start.elapsed().as_secs_f32() * 1000.0);
    }
    Ok(())
}

pub fn rows(
    device: &Device,
    model: &Model,
    frame: usize,
    size: u32,
    solves: usize,
    say: &mut impl FnMut(String),
) -> Result<(), String> {
    let fail = |error: vrtm::Error| format!("{} at {size}: {error}", model.name);
    let poses = poses(model, frame);
    let mut asset = model.asset_on(device, size);
    let mut map = vec![0u8; size as usize * size as usize * 8];
    let best = SolveOptions { max_corrections: Some(7), tolerance: Some(1e-6), ..SolveOptions::default() };
    once(&mut asset, &poses[1], &best, &mut map, &mut Times::default()).map_err(fail)?;
    let best = asset.tile(0).report().map_err(fail)?.energy;
    let efforts = [
        ("draft", draft()),
        ("normal", SolveOptions::default()),
        ("pbd, 1 iteration per level", paper(1)),
        ("pbd, 16 iterations per level", paper(16)),
    ];
    for (name, options) in efforts {
        let mut times = Times::default();
        let mut solve = |pose: usize, times: &mut Times| {
            once(&mut asset, &poses[pose], &options, &mut map, times).map_err(fail)
        };
        let first = warm::load(|| {
            let mut first = Times::default();
            solve(0, &mut first)?;
            solve(1, &mut Times::default())?;
            Ok(median(&mut first.gpu))
        })?;
        solve(0, &mut Times::default())?;
        for n in 0..2 * solves.div_ceil(2) {
            solve((n + 1) % 2, &mut times)?;
        }
        let clock = warm::clock(&device.info().name).unwrap_or_else(|| "-".into());
        let options = SolveOptions { measure: true, ..options };
        once(&mut asset, &poses[1], &options, &mut map, &mut Times::default()).map_err(fail)?;
        let report = asset.tile(0).report().map_err(fail)?;
        let excess = match options.quality {
            Quality::Draft => "-".into(),
            _ => format!("{:.4}", 100.0 * (report.energy - best) / (report.energy_before - best)),
        };
        say(format!(
            "| {} | {size}² | {name} | {} | {:.3} | {:.3} | {first:.3} | {:.3} | {:.3}, {:.3} | {:.4} -> {:.4} | {excess} | {:.3}, {} | {:.0} | {clock} |\n",
            model.name,
            report.nodes_active,
            median(&mut times.upload),
            median(&mut times.gpu),
            median(&mut times.wall),
            median(&mut times.invert[0]),
            median(&mut times.invert[1]),
            report.strain.map_or(f32::NAN, |strain| strain.before.rms),
            report.strain.map_or(f32::NAN, |strain| strain.after.rms),
            report.min_jacobian,
            report.folds,
            report.bytes as f64 / f64::from(1 << 20),
        ));
    }
    Ok(())
}

/// Bytes of each kernel in one `normal` solve, and the time that they would take at the ceiling's bandwidth.
pub fn kernels(device: &Device, size: u32, solves: usize, ceiling: f64) -> Result<String, String> {
    let model = Model::from(scenes::analytic::bulge());
    let fail = |error: vrtm::Error| error.to_string();
    let mut asset = model.asset_on(device, size);
    let poses = poses(&model, 1);
    let mut n = 0;
    let mut in_turn = || -> Result<GpuWork, String> {
        n += 1;
        asset.solve(Strided::from_slice(&poses[n % 2]), &SolveOptions::default()).map_err(fail)?;
        asset.tile(0).gpu_work().map_err(fail)?.ok_or_else(|| "no GPU work".into())
    };
    device.time_kernels(true);
    let works = warm::load(&mut in_turn).and_then(|first| {
        (0..solves).map(|_| in_turn()).collect::<Result<Vec<_>, _>>().map(|works| (first, works))
    });
    device.time_kernels(false);
    let (first, works) = works?;
    let clock = warm::clock(&device.info().name).unwrap_or_else(|| "not told".into());
    let Some(work) = works.last() else { return Ok(String::new()) };
    let of_kernel = |name: &str| {
        let same = works.iter().flat_map(|work| &work.kernels).filter(|kernel| kernel.name == name);
        median(&mut same.filter_map(|kernel| kernel.ms).collect::<Vec<_>>())
    };
    let of_all = median(&mut works.iter().filter_map(|work| work.gpu_ms).collect::<Vec<_>>());
    let mut text = format!(
        "\n`normal` at {size}², kernel by kernel, one after the other, medians with a warm GPU (clock {clock}): {of_all:.2} ms, the \
         first {:.2} ms; {} dispatches, {} more that no chart needed, \
         {} barriers, {} submissions, {:.2} GB, {:.2} GB held.\n\n\
         | kernel | dispatches | blocks | MB | ms | floor, ms |\n|---|---|---|---|---|---|\n",
        first.gpu_ms.unwrap_or(f32::NAN),
        work.dispatches(),
        work.skipped,
        work.barriers,
        work.submissions,
        work.bytes() as f64 * 1e-9,
        work.bytes_held as f64 * 1e-9
    );
    for kernel in &work.kernels {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.1} | {:.3} | {:.3} |",
            kernel.name,
            kernel.dispatches,
            kernel.workgroups,
            kernel.bytes as f64 * 1e-6,
            of_kernel(&kernel.name),
            kernel.bytes as f64 / ceiling * 1e3
        );
    }
    Ok(text)
}
