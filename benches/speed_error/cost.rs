//! Measures the time per node: of one update, and of a whole solve over the size of the grid.

use vrtm::{Quality, SolveOptions};

use vrtm_testkit::bench::median;
use vrtm_testkit::cases::Case;
use vrtm_testkit::{Model, cpu, scenes};

fn bulge(grid: u32) -> Case {
    Case::new(Model::from(scenes::analytic::bulge()), 1, 1001, grid)
}

/// Nanoseconds of one node's update by the library, on all cores: times.relax of a `draft` that starts from the last
/// one, and so relaxes the finest level alone, divided by its updates; the median of so many solves.
pub fn node_update(grid: u32, solves: usize) -> Result<f64, String> {
    let fail = |error: vrtm::Error| error.to_string();
    let case = bulge(grid);
    let (mut asset, tile) = case.asset(&cpu(0));
    let draft = SolveOptions { quality: Quality::Draft, warm: true, ..SolveOptions::default() };
    let mut times = Vec::new();
    for k in 0..=solves {
        asset.solve(case.pose(k), &draft).map_err(fail)?;
        let report = asset.tile(tile).report().map_err(fail)?;
        if k > 0 {
            times.push(f64::from(report.times.relax) * 1e6 / report.node_updates as f64);
        }
    }
    Ok(median(&times))
}

/// The cost of solving the bulge on one grid at `normal`.
pub struct SizeCost {
    pub grid: u32,
    pub nodes: u64,
    pub ms: f64,
    pub bytes: u64,
    pub node_updates: u64,
}

pub fn size_cost(grid: u32, solves: usize) -> Result<SizeCost, String> {
    let fail = |error: vrtm::Error| format!("bulge at {grid}: {error}");
    let case = bulge(grid);
    let (mut asset, tile) = case.asset(&cpu(0));
    let mut times = Vec::new();
    for k in 0..=solves {
        asset.solve(case.pose(k), &SolveOptions::default()).map_err(fail)?;
        // The first frame also allocates memory.
        if k > 0 {
            times.push(f64::from(asset.tile(tile).report().map_err(fail)?.times.total));
        }
    }
    let report = asset.tile(tile).report().map_err(fail)?;
    Ok(SizeCost {
        grid,
        nodes: report.nodes_active,
        ms: median(&times),
        bytes: report.bytes,
        node_updates: report.node_updates,
    })
}
