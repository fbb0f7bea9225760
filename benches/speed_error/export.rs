//! Writes cases as files for other programs: see benches/peers/.

use std::path::Path;

use serde_json::json;
use vrtm::{SolveOptions, Strided};
use vrtm_testkit::Lab as _;

use crate::rows::{Times, median};
use vrtm_testkit::cases::Case;
use vrtm_testkit::{cpu, obj};

/// Writes `DIR/SCENE/`: rest.obj and pose.obj with the original UVs, rigidity.png, warp.f32 (displacements of `normal`
/// in cells, row by row from v = 0, two little-endian f32 each), movable.u8 (per node, 1 if it may move) and case.json.
pub fn export(case: &Case, folder: &Path, solves: usize) -> Result<(), String> {
    let fail = |error: vrtm::Error| error.to_string();
    let folder = folder.join(&case.name);
    std::fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()))
    };
    let (mut asset, tile) = case.asset(&cpu(0));
    let mut times = Vec::new();
    for k in 0..=2 * solves {
        asset.solve(case.pose(k), &SolveOptions::default()).map_err(fail)?;
        if k > 0 {
            times.push(f64::from(asset.tile_report(tile).map_err(fail)?.times.total));
        }
    }
    let ms = Times { median: median(&times), ..Times::default() };
    asset.solve(case.pose(0), &SolveOptions { measure: true, ..SolveOptions::default() }).map_err(fail)?;
    let report = asset.tile_report(tile).map_err(fail)?;
    let strain = report.strain.ok_or("the solve was asked to measure")?;
    let u = asset.displacements(tile).map_err(fail)?;
    // A node whose chart is the identity in this pose would not count as movable. In a stretched pose every movable
    // node moves.
    let stretched: Vec<[f32; 3]> =
        case.model.rest.iter().map(|[x, y, z]| [1.3 * x + 0.2 * y, y - 0.1 * z, 0.8 * z]).collect();
    asset.solve(Strided::from_f32x3(&stretched), &SolveOptions::default()).map_err(fail)?;
    let moved = asset.displacements(tile).map_err(fail)?;
    write("movable.u8", &moved.iter().map(|u| u8::from(*u != [0.0; 2])).collect::<Vec<u8>>())?;
    write("rest.obj", obj(&case.model, &case.model.rest).as_bytes())?;
    write("pose.obj", obj(&case.model, &case.poses[0]).as_bytes())?;
    write("warp.f32", &u.iter().flatten().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>())?;
    let maps = case.model.maps.iter().find(|maps| maps.udim == case.udim).ok_or("no map")?;
    let image =
        image::GrayImage::from_raw(maps.width, maps.height, maps.rigidity.clone()).ok_or("a map's size")?;
    let path = folder.join("rigidity.png");
    image.save(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let side = |s: &vrtm::Strain| json!({ "rms": s.rms, "free_rms": s.free_rms, "p95": s.p95, "max": s.max });
    let text = json!({
        "scene": case.name,
        "frame": case.frame,
        "udim": case.udim,
        "grid": case.grid,
        "vrtm_seconds": ms.median / 1000.0,
        "threads": asset.device().info().threads,
        "edges": strain.segments,
        "before": side(&strain.before),
        "after": side(&strain.after),
    });
    write("case.json", format!("{text:#}\n").as_bytes())
}
