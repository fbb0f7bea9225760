//! Plays a shot: solves its frames in order, and computes the second differences of each three consecutive frames.

use std::fmt::Write as _;

use vrtm::{Asset, Device, SolveOptions, Strided};

use vrtm_testkit::cases::Case;
use vrtm_testkit::motion::{Points, Spread, cells, edges, of_edges, of_positions};
use vrtm_testkit::roughness::second_difference;
use vrtm_testkit::scenes::path::Path;
use vrtm_testkit::{Warp, doubles};

/// The second differences of one frame and its two neighbours.
pub struct Row {
    /// Number of the frame, counted from 1.
    pub frame: usize,
    /// Second differences of W, in cells, over all nodes that move.
    pub warp: Spread,
    /// The node where the second difference of W is largest.
    pub node: Node,
    /// Second differences of the vertices, in cells.
    pub positions: Spread,
    /// Second differences of the lengths of the mesh's edges, relative to their lengths at rest.
    pub edges: Spread,
    /// Energy, smallest Jacobian and milliseconds of the frame's solve, over all tiles.
    pub energy: f64,
    pub min_jacobian: f64,
    pub ms: f64,
}

#[derive(Clone, Copy, Debug, Default)]
pub struct Node {
    pub udim: u32,
    /// Column and row.
    pub at: [usize; 2],
    /// UV within the tile.
    pub uv: [f64; 2],
}

impl Node {
    /// The UV in the mesh, which includes the tile's position.
    pub fn mesh_uv(&self) -> [f64; 2] {
        let tile = self.udim - 1001;
        [self.uv[0] + f64::from(tile % 10), self.uv[1] + f64::from(tile / 10)]
    }
}

/// One solved frame.
struct Moment {
    pose: Points,
    energy: f64,
    min_jacobian: f64,
    ms: f64,
}

/// Solves all frames of a case in order. Returns a row for each frame except the first and the last.
pub fn play(
    case: &Case,
    path: &Path,
    frames: usize,
    device: &Device,
    options: &SolveOptions,
) -> Result<Vec<Row>, String> {
    let fail = |error: vrtm::Error| format!("{}: {error}", case.name);
    let mut asset = case.model.asset_on(device, case.grid);
    let (cells, edges) = (cells(&case.model, case.grid), edges(&case.model));
    let rest = doubles(&case.model.rest);
    let (mut rows, mut moments, mut warps) = (Vec::new(), Vec::<Moment>::new(), Vec::new());
    for frame in 1..=frames {
        let pose = path.pose(frame);
        asset.solve(Strided::from_f32x3(&pose), options).map_err(fail)?;
        moments.push(moment(&asset, doubles(&pose)).map_err(fail)?);
        warps.push(displacements(&asset));
        if warps.len() < 3 {
            continue;
        }
        let still = [0.0; 2];
        let moving = (0..warps[0].len()).filter(|&n| warps.iter().any(|w: &Vec<[f64; 2]>| w[n] != still));
        let warp = Spread::of(moving.map(|n| (n, second_difference(&warps, n))));
        let poses = [&moments[0].pose, &moments[1].pose, &moments[2].pose];
        let Moment { energy, min_jacobian, ms, .. } = moments[1];
        rows.push(Row {
            frame: frame - 1,
            warp,
            node: node(&asset, warp.at),
            positions: of_positions(&cells, poses),
            edges: of_edges(&edges, &rest, poses),
            energy,
            min_jacobian,
            ms,
        });
        moments.remove(0);
        warps.remove(0);
    }
    Ok(rows)
}

fn moment(asset: &Asset, pose: Points) -> vrtm::Result<Moment> {
    let mut moment = Moment { pose, energy: 0.0, min_jacobian: f64::INFINITY, ms: 0.0 };
    for tile in 0..asset.tile_count() {
        let report = asset.tile_report(tile)?;
        moment.energy += report.energy;
        moment.min_jacobian = moment.min_jacobian.min(report.min_jacobian);
        moment.ms += f64::from(report.times.total);
    }
    Ok(moment)
}

/// Displacements of all tiles, one after another.
fn displacements(asset: &Asset) -> Vec<[f64; 2]> {
    let tiles = 0..asset.tile_count();
    tiles.flat_map(|tile| Warp::of(asset, tile).u).map(|u| u.map(f64::from)).collect()
}

/// The node at an index into `displacements`.
fn node(asset: &Asset, mut index: usize) -> Node {
    for tile in 0..asset.tile_count() {
        let Warp { nx, ny, u } = Warp::of(asset, tile);
        if index < u.len() {
            let at = [index % (nx + 1), index / (nx + 1)];
            let uv = [at[0] as f64 / nx as f64, at[1] as f64 / ny as f64];
            let udim = asset.tile_report(tile).map_or(0, |report| report.udim);
            return Node { udim, at, uv };
        }
        index -= u.len();
    }
    Node::default()
}

/// The rows as a table.
pub fn csv(rows: &[Row]) -> String {
    let mut text = String::from("frame");
    for kind in ["warp", "positions", "edges"] {
        let _ = write!(text, ",{kind} RMS,{kind} 99.9 %,{kind} largest");
    }
    text += ",tile,u,v,energy,smallest Jacobian,ms\n";
    for row in rows {
        let _ = write!(text, "{}", row.frame);
        for spread in [row.warp, row.positions, row.edges] {
            let _ = write!(text, ",{:.3e},{:.3e},{:.3e}", spread.rms, spread.p999, spread.max);
        }
        let Node { udim, uv, .. } = row.node;
        let _ = writeln!(
            text,
            ",{udim},{:.5},{:.5},{:.5e},{:.3e},{:.1}",
            uv[0], uv[1], row.energy, row.min_jacobian, row.ms
        );
    }
    text
}
