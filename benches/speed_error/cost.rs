//! Measures the time per node: of one update, by the library and by a plain loop in f64, and of a whole solve over the
//! size of the grid.

use std::time::Instant;

use vrtm::{Quality, SolveOptions, TileSettings};
use vrtm_testkit::Lab as _;

use crate::machine::paired;
use crate::plain::Plain;
use crate::plain_mesh::PlainMesh;
use crate::rows::median;
use vrtm_testkit::cases::Case;
use vrtm_testkit::{Model, cpu, scenes};

/// Time of one node's update, in nanoseconds.
pub struct NodeCost {
    /// The plain loop: f64, one core.
    pub plain_ns: f64,
    /// The library: times.relax of a `draft` that starts from the last one, and so relaxes the finest level alone,
    /// divided by its updates; all cores.
    pub library_ns: f64,
    /// Median of the ratios of the pairs.
    pub ratio: f64,
    /// Ratio of the shortest times of both, which are least disturbed by other load on the machine.
    pub quickest: f64,
    /// |E of the identity by the plain loop / E by the reference - 1|: both compute the same energy.
    pub difference: f64,
}

fn bulge(grid: u32) -> Case {
    Case::new(Model::from(scenes::analytic::bulge()), 1, 1001, grid)
}

pub fn node_cost(grid: u32, pairs: usize) -> Result<NodeCost, String> {
    let fail = |error: vrtm::Error| error.to_string();
    let case = bulge(grid);
    let (mut asset, tile) = case.asset(&cpu(0));
    let draft = SolveOptions { quality: Quality::Draft, warm: true, ..SolveOptions::default() };
    asset.solve(case.pose(0), &draft).map_err(fail)?;
    // The nodes that the library moves are exactly the movable ones: where the sheet bulges, no movable node keeps its
    // exact position.
    let u = asset.displacements(tile).map_err(fail)?;
    let movable = u.iter().map(|u| *u != [0.0; 2]).collect();
    let mesh = PlainMesh::new(&case, rigidity(&case), movable);
    let mut plain = Plain::new(mesh, &TileSettings::default());
    let zeros = vec![[0.0; 2]; u.len()];
    let reference = asset.reference_energy(tile, case.pose(0), &zeros).map_err(fail)?;
    let before = plain.energy();
    let mut times = Vec::new();
    for k in 0..pairs {
        let start = Instant::now();
        let updates = plain.sweep();
        let plain_ns = start.elapsed().as_secs_f64() * 1e9 / updates as f64;
        asset.solve(case.pose(k + 1), &draft).map_err(fail)?;
        let report = asset.tile_report(tile).map_err(fail)?;
        times.push((plain_ns, f64::from(report.times.relax) * 1e6 / report.node_updates as f64));
    }
    let (plain_ns, library_ns, ratio) = paired(&times);
    let least = |f: fn(&(f64, f64)) -> f64| times.iter().map(f).fold(f64::INFINITY, f64::min);
    Ok(NodeCost {
        quickest: least(|pair| pair.0) / least(|pair| pair.1),
        plain_ns,
        library_ns,
        ratio,
        difference: (before / reference - 1.0).abs(),
    })
}

/// Rigidity at the nodes: the mean over a box of one cell around each, provided that the map is at least as fine as the
/// grid.
fn rigidity(case: &Case) -> Vec<f64> {
    let maps = case.model.maps.iter().find(|maps| maps.udim == case.udim).expect("maps of the tile");
    let size = case.grid as usize;
    let axis = |texels: u32| {
        let per_cell = f64::from(texels) / size as f64;
        let half = 0.5 * per_cell.max(1.0);
        move |node: usize| {
            let (low, high) = (node as f64 * per_cell - half, node as f64 * per_cell + half);
            (low.floor() as i64..high.ceil() as i64).map(move |texel| {
                let fraction = (high.min(texel as f64 + 1.0) - low.max(texel as f64)).max(0.0) / (high - low);
                (texel.clamp(0, i64::from(texels) - 1) as usize, fraction)
            })
        }
    };
    let (columns, rows) = (axis(maps.width), axis(maps.height));
    let mut nodes = Vec::with_capacity((size + 1) * (size + 1));
    for j in 0..=size {
        for i in 0..=size {
            let mut sum = 0.0;
            for (y, row) in rows(j) {
                // The first row of the map is at v = 1.
                let from = (maps.height as usize - 1 - y) * maps.width as usize;
                sum += columns(i)
                    .map(|(x, fraction)| row * fraction * f64::from(maps.rigidity[from + x]))
                    .sum::<f64>();
            }
            nodes.push(sum / 255.0);
        }
    }
    nodes
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
            times.push(f64::from(asset.tile_report(tile).map_err(fail)?.times.total));
        }
    }
    let report = asset.tile_report(tile).map_err(fail)?;
    Ok(SizeCost {
        grid,
        nodes: report.nodes_active,
        ms: median(&times),
        bytes: report.bytes,
        node_updates: report.node_updates,
    })
}
