//! Compares the GPU with the CPU, and both with the f64 reference, before anything is timed.

use std::fmt::Write;

use vrtm::{Device, Quality, SolveOptions};
use vrtm_testkit::Lab as _;

use vrtm_testkit::{Model, scenes};

const GRID: u32 = 256;
/// The RMS difference of the displacements, in cells, above which the times of the two backends are not compared.
const MOST: f64 = 0.01;

pub fn table(device: &Device) -> Result<String, String> {
    let mut text = String::from(
        "| parity at 256² | RMS, cells | max, cells | E GPU / E CPU - 1 | gap GPU, % | gap CPU, % |\n|---|---|---|---|---|---|\n",
    );
    for name in ["bulge", "shear", "mug_to_jug"] {
        let model = Model::from(scenes::by_name(name).ok_or("no such scene")?);
        let options = SolveOptions { quality: Quality::Normal, ..SolveOptions::default() };
        let solve = |mut asset: vrtm::Asset| -> vrtm::Result<_> {
            asset.solve(model.frame(1), &options)?;
            let (u, report) = (asset.displacements(0)?, asset.tile(0).report()?);
            let start: Vec<[f64; 2]> = u.iter().map(|u| u.map(f64::from)).collect();
            let energy = asset.reference_energy(0, model.frame(1), &start)?;
            let least = asset.reference_minimum(0, model.frame(1), Some(&start), false)?.energy;
            Ok((u, report, 100.0 * (energy - least) / (report.energy_before - least)))
        };
        let fail = |error: vrtm::Error| format!("{name}: {error}");
        let (gpu, gpu_report, gpu_gap) = solve(model.asset_on(device, GRID)).map_err(fail)?;
        let (cpu, cpu_report, cpu_gap) = solve(model.asset(0, GRID)).map_err(fail)?;
        let distance = |(a, b): (&[f32; 2], &[f32; 2])| f64::from(a[0] - b[0]).hypot(f64::from(a[1] - b[1]));
        let distances: Vec<f64> = gpu.iter().zip(&cpu).map(distance).collect();
        let rms = (distances.iter().map(|d| d * d).sum::<f64>() / distances.len() as f64).sqrt();
        let max = distances.iter().copied().fold(0.0, f64::max);
        let ratio = gpu_report.energy / cpu_report.energy - 1.0;
        let _ =
            writeln!(text, "| {name} | {rms:.2e} | {max:.2e} | {ratio:.1e} | {gpu_gap:.4} | {cpu_gap:.4} |");
        if rms > MOST || gpu_report.folds > 0 {
            return Err(format!("{text}\n{name}: the backends part, or there are folds: nothing was timed"));
        }
    }
    text.push('\n');
    Ok(text)
}
