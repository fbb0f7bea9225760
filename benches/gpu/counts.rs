//! Counts the work of a `normal` solve on a GPU: dispatches, barriers, submissions, bytes. The counts are the same on
//! any machine, so a software driver will do.

use std::fmt::Write;

use vrtm::{Asset, Device, GpuWork, SolveOptions, TileReport};

use crate::table::{draft, paper};
use vrtm_testkit::{Model, assets, scenes};

/// Bandwidths for which lower bounds of the time are given: that of an H200's memory as stated by its maker, and that
/// of a laptop.
const BANDWIDTHS: [f64; 2] = [4.8e12, 300e9];

const HEAD: &str = "\
# What a solve has a GPU do, counted

`normal`, from the identity. The counts do not depend on the machine, apart from a few decisions that rounding may turn:
`benches/gpu.sh --counts` writes them anew. \"Empty\" dispatches are trials and rounds of the step limit that no chart
needed, \"barriers\" are dispatches that have to wait for those before them, empty ones included. \"MB\" and \"bytes\" count
each datum once per dispatch, without charts that sit a further correction out. \"Excess\" is (E - best E) / (E of the
identity - best E), with the best E of seven corrections that go on to the last 1e-6 of gain. Bytes held are per active node. 2048 x
2048 cells need bindings of more than 128 MiB, which Mesa's software driver lacks.

| scene | size | active nodes | dispatches | empty ones | barriers | submissions | MB | bytes per active node | floor at 4.8 TB/s, ms | at 300 GB/s, ms | excess, % | bytes held on the GPU | with the host's |
|---|---|---|---|---|---|---|---|---|---|---|---|---|---|
";

/// The table of all models and sizes, followed by the kernels of some of the models at each size, and of drafts and the
/// paper's solver of one. Tiles of an asset are solved together.
pub fn table(device: &Device, sizes: &[u32]) -> Result<String, String> {
    let mut text = String::from(HEAD);
    let mut kernels = String::new();
    let meshes = assets().into_iter().filter(|model| ["mh_face", "ict_inner"].contains(&&*model.name));
    let scenes = ["bulge", "mug_to_jug"].map(|name| scenes::by_name(name).map(Model::from));
    for model in scenes.into_iter().flatten().chain(meshes) {
        for &size in sizes {
            let fail = |error: vrtm::Error| format!("{} at {size}: {error}", model.name);
            let mut asset = model.asset_on(device, size);
            asset.solve(model.frame(1), &SolveOptions::default()).map_err(fail)?;
            let work = asset.tile(0).gpu_work().map_err(fail)?.ok_or("no GPU work")?;
            let all = Sums::of(&asset).map_err(fail)?;
            let nodes = all.nodes as f64;
            let bytes = work.bytes() as f64;
            let _ = write!(
                text,
                "| {} | {size}² | {} | {} | {} | {} | {} | {:.0} | {:.0} |",
                model.name,
                all.nodes,
                work.dispatches(),
                work.skipped,
                work.barriers,
                work.submissions,
                bytes * 1e-6,
                bytes / nodes,
            );
            for bandwidth in BANDWIDTHS {
                let _ = write!(text, " {:.2} |", bytes / bandwidth * 1e3);
            }
            let excess = excess(device, &model, size, &all)?;
            let [on_gpu, in_all] = [work.bytes_held, all.bytes].map(|bytes| bytes as f64 / nodes);
            let _ = writeln!(text, " {excess} | {on_gpu:.0} | {in_all:.0} |");
            if model.name != "mug_to_jug" {
                let _ = writeln!(
                    kernels,
                    "\n## {} at {size}², kernel by kernel{}\n\n{}",
                    model.name,
                    strain(&mut asset, &model, &SolveOptions::default()).map_err(fail)?,
                    of_kernels(&work, nodes)
                );
            }
            let others = [("draft", draft()), ("pbd 1", paper(1)), ("pbd 16", paper(16))];
            for (name, options) in others.into_iter().filter(|_| model.name == "bulge") {
                // A new asset, which has no result to start from.
                let mut asset = model.asset_on(device, size);
                asset.solve(model.frame(1), &options).map_err(fail)?;
                let work = asset.tile(0).gpu_work().map_err(fail)?.ok_or("no GPU work")?;
                let [dispatches, skipped, barriers] = [work.dispatches(), work.skipped, work.barriers];
                let _ = writeln!(
                    kernels,
                    "\n## bulge at {size}², `{name}`: {dispatches} dispatches, {skipped} empty ones, {barriers} barriers{}\n\n{}",
                    strain(&mut asset, &model, &options).map_err(fail)?,
                    of_kernels(&work, nodes)
                );
            }
            println!("{}", text.lines().last().unwrap_or_default());
        }
    }
    Ok(text + &kernels)
}

/// Sums over the tiles of an asset.
struct Sums {
    nodes: u64,
    bytes: u64,
    energy: f64,
    before: f64,
}

impl Sums {
    fn of(asset: &Asset) -> vrtm::Result<Sums> {
        let reports: Vec<TileReport> =
            (0..asset.tile_count()).map(|tile| asset.tile(tile).report()).collect::<vrtm::Result<_>>()?;
        Ok(Sums {
            nodes: reports.iter().map(|report| report.nodes_active).sum(),
            bytes: reports.iter().map(|report| report.bytes).sum(),
            energy: reports.iter().map(|report| report.energy).sum(),
            before: reports.iter().map(|report| report.energy_before).sum(),
        })
    }
}

/// (E - best E) / (E of the identity - best E) in per cent, where best is the energy of seven corrections that go on
/// until the gain is below 1e-6. It is computed on small grids only, since it takes long.
fn excess(device: &Device, model: &Model, size: u32, all: &Sums) -> Result<String, String> {
    if size > 1024 {
        return Ok("-".into());
    }
    let fail = |error: vrtm::Error| format!("{} at {size}: {error}", model.name);
    let mut asset = model.asset_on(device, size);
    let options = SolveOptions { max_corrections: Some(7), tolerance: Some(1e-6), ..SolveOptions::default() };
    asset.solve(model.frame(1), &options).map_err(fail)?;
    let best = Sums::of(&asset).map_err(fail)?.energy;
    Ok(format!("{:.4}", 100.0 * (all.energy - best) / (all.before - best)))
}

/// Strain after a solve, RMS on the mesh, if the asset has a single tile; the words follow others.
fn strain(asset: &mut Asset, model: &Model, options: &SolveOptions) -> vrtm::Result<String> {
    if asset.tile_count() > 1 {
        return Ok(String::new());
    }
    asset.solve(model.frame(1), &SolveOptions { measure: true, ..*options })?;
    let strain = asset.tile(0).report()?.strain;
    Ok(strain.map_or(String::new(), |strain| format!(", strain {:.4}", strain.after.rms)))
}

fn of_kernels(work: &GpuWork, nodes: f64) -> String {
    let mut text = String::from(
        "| kernel | dispatches | workgroups | MB | bytes per active node |\n|---|---|---|---|---|\n",
    );
    for kernel in &work.kernels {
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.1} | {:.1} |",
            kernel.name,
            kernel.dispatches,
            kernel.workgroups,
            kernel.bytes as f64 * 1e-6,
            kernel.bytes as f64 / nodes
        );
    }
    text
}
