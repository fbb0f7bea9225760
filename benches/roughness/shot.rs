//! A shot: a smooth motion through rest and all frames of an asset (a cubic spline in time with continuous velocity,
//! exactly through each of them), solved frame by frame. W answers to the change of lengths in the pose: limbs that
//! turn as a whole leave it as it is, and a peak of W without one there is the solver's. With ten times as many frames
//! a jump stays as large, while the second difference of a motion falls to a hundredth.

use std::fmt::Write as _;

use vrtm::{Asset, Device, SolveOptions, Strided};

use vrtm_testkit::cases::Case;
use vrtm_testkit::motion::{Points, Spread, cells, edges, of_edges, of_positions};
use vrtm_testkit::roughness::{moving, second_difference};
use vrtm_testkit::scenes::path::Path;
use vrtm_testkit::{Warp, doubles};

pub const HEAD: &str = "\
    | scene | quality | d2 RMS, median frame | largest | frame, tile, UV | over a cell | energy | ms, median |
|---|---|---|---|---|---|---|---|
";

/// The second differences of one frame and its two neighbours.
struct Row {
    /// Number of the frame, counted from 1.
    frame: usize,
    /// Second differences of W, in cells, over all nodes that move.
    warp: Spread,
    /// The tile and the UV in it where the second difference of W is largest.
    place: (u32, [f64; 2]),
    /// Second differences of the vertices, in cells.
    positions: Spread,
    /// Second differences of the lengths of the mesh's edges, relative to their lengths at rest.
    edges: Spread,
    energy: f64,
    min_jacobian: f64,
    ms: f64,
}

/// Solves all frames of a case in order. Returns a line of the table that begins with `name`, and a table of the frames
/// as CSV.
pub fn play(
    case: &Case,
    name: &str,
    frames: usize,
    device: &Device,
    options: &SolveOptions,
) -> Result<(String, String), String> {
    let fail = |error: vrtm::Error| format!("{}: {error}", case.name);
    let keys = std::iter::once(&case.model.rest).chain(&case.model.frames).map(Vec::as_slice).collect();
    let path = Path::new(keys, frames).map_err(|why| format!("{}: {why}", case.name))?;
    let mut asset = case.model.asset_on(device, case.grid);
    let (cells, edges) = (cells(&case.model, case.grid), edges(&case.model));
    let rest = doubles(&case.model.rest);
    let (mut rows, mut poses, mut warps, mut sums) =
        (Vec::<Row>::new(), Vec::<Points>::new(), Vec::new(), Vec::new());
    for frame in 1..=frames {
        let pose = path.pose(frame);
        asset.solve(Strided::from_slice(&pose), options).map_err(fail)?;
        poses.push(doubles(&pose));
        warps.push(displacements(&asset));
        sums.push(sums_of_tiles(&asset).map_err(fail)?);
        if warps.len() < 3 {
            continue;
        }
        let warp = Spread::of(moving(&warps).into_iter().map(|n| (n, second_difference(&warps, n))));
        let three = [&poses[0], &poses[1], &poses[2]];
        let (energy, min_jacobian, ms) = sums[1];
        rows.push(Row {
            frame: frame - 1,
            warp,
            place: place(&asset, warp.at).map_err(fail)?,
            positions: of_positions(&cells, three),
            edges: of_edges(&edges, &rest, three),
            energy,
            min_jacobian,
            ms,
        });
        poses.remove(0);
        warps.remove(0);
        sums.remove(0);
    }
    let peak =
        rows.iter().max_by(|a, b| a.warp.max.total_cmp(&b.warp.max)).ok_or("fewer than three frames")?;
    let median = |of: fn(&Row) -> f64| {
        let mut values: Vec<f64> = rows.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values[values.len() / 2]
    };
    let (tile, [u, v]) = peak.place;
    let line = format!(
        "| {name} | {:.4} | {:.2} | {}, {tile}, {u:.5} {v:.5} | {} of {} | {:.5e} | {:.0} |\n",
        median(|row| row.warp.rms),
        peak.warp.max,
        peak.frame,
        rows.iter().filter(|row| row.warp.max > 1.0).count(),
        rows.len(),
        rows.iter().map(|row| row.energy).sum::<f64>(),
        median(|row| row.ms),
    );
    Ok((line, csv(&rows)))
}

/// Energy, smallest Jacobian and milliseconds of the last solve, over all tiles.
fn sums_of_tiles(asset: &Asset) -> vrtm::Result<(f64, f64, f64)> {
    (0..asset.tile_count()).try_fold((0.0, f64::INFINITY, 0.0), |(energy, jacobian, ms), tile| {
        let report = asset.tile(tile).report()?;
        Ok((energy + report.energy, report.min_jacobian.min(jacobian), ms + f64::from(report.times.total)))
    })
}

/// Displacements of all tiles, one after another.
fn displacements(asset: &Asset) -> Vec<[f64; 2]> {
    let tiles = 0..asset.tile_count();
    tiles.flat_map(|tile| Warp::of(asset, tile).u).map(|u| u.map(f64::from)).collect()
}

/// The tile, and the UV in it, of the node at an index into `displacements`.
fn place(asset: &Asset, mut index: usize) -> vrtm::Result<(u32, [f64; 2])> {
    for tile in 0..asset.tile_count() {
        let Warp { nx, ny, u } = Warp::of(asset, tile);
        if index < u.len() {
            let uv = [(index % (nx + 1)) as f64 / nx as f64, (index / (nx + 1)) as f64 / ny as f64];
            return Ok((asset.tile(tile).report()?.udim, uv));
        }
        index -= u.len();
    }
    Ok((0, [0.0; 2]))
}

fn csv(rows: &[Row]) -> String {
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
        let (udim, [u, v]) = row.place;
        let Row { energy, min_jacobian, ms, .. } = row;
        let _ = writeln!(text, ",{udim},{u:.5},{v:.5},{energy:.5e},{min_jacobian:.3e},{ms:.1}");
    }
    text
}
