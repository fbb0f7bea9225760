//! The figures: report.json has all of them, and a printed line per frame and tile has the most important ones.

use serde_json::{Value, json};
use vrtm::{AssetInfo, AssetReport, DeviceInfo, MapReport, Strain, StrainReport, TileInfo, TileReport};

use crate::args::Args;
use crate::maps::Map;
use crate::overwrite;
use crate::source::{Frame, Source};

/// The name of an enum variant as on the command line.
fn name(value: impl std::fmt::Debug) -> String {
    format!("{value:?}").to_lowercase()
}

/// Figures that are known before the first frame.
pub fn header(
    source: &Source,
    args: &Args,
    device: &DeviceInfo,
    info: &AssetInfo,
    tiles: &[TileInfo],
) -> Value {
    let tile = |tile: &TileInfo| {
        let maps = source.maps.get(&tile.udim);
        let origin = |map: &Option<Map>| map.as_ref().map(|map| map.origin.clone());
        let rigidity = maps.and_then(|maps| origin(&maps.rigidity));
        let mask = maps.and_then(|maps| origin(&maps.mask));
        json!({
            "udim": tile.udim, "rigidity": rigidity, "mask": mask, "charts": tile.charts,
            "triangles": tile.triangles, "grid": tile.grid, "movable_nodes": tile.movable_nodes,
            "overlap": tile.overlap, "fixed": tile.fixed, "border_edges": tile.border_edges,
            "welded_edges": tile.welded_edges, "edges_apart": tile.edges_apart,
        })
    };
    json!({
        "program": { "name": overwrite::PROGRAM, "version": env!("CARGO_PKG_VERSION") },
        "scene": { "name": source.name, "mesh": source.origin, "credits": source.asset },
        "settings": {
            "quality": name(args.quality), "warm": args.warm, "temporal_weight": args.temporal_weight,
            "size": args.size, "map_size": args.map_size,
        },
        "device": {
            "backend": name(device.backend), "name": device.name, "reason": device.reason,
            "threads": device.threads, "bytes_held": device.bytes_held,
        },
        "asset": {
            "vertices": info.vertices, "faces": info.faces, "corners": info.corners,
            "triangles": info.triangles, "tiles": info.tiles, "charts": info.charts,
            "degenerate_triangles": info.degenerate_triangles, "clipped_faces": info.clipped_faces,
            "faces_outside": info.faces_outside, "faces_untextured": info.faces_untextured,
            "faces_skipped": info.faces_skipped, "border_edges": info.border_edges,
            "welded_edges": info.welded_edges, "edges_apart": info.edges_apart,
        },
        "tiles": tiles.iter().map(tile).collect::<Vec<_>>(),
    })
}

/// All figures of a frame.
pub fn frame(frame: &Frame, asset: &AssetReport, tiles: &[(TileReport, MapReport)]) -> Value {
    json!({
        "frame": frame.number, "note": frame.note,
        "tiles": tiles.iter().map(|(solve, map)| tile(solve, map)).collect::<Vec<_>>(),
        "asset": {
            "tiles": asset.tiles, "tiles_active": asset.tiles_active, "charts_active": asset.charts_active,
            "charts_reused": asset.charts_reused, "charts_identity": asset.charts_identity,
            "nodes_active": asset.nodes_active, "min_jacobian": asset.min_jacobian, "folds": asset.folds,
            "bytes": asset.bytes, "total_ms": asset.total_ms, "truncated": asset.truncated,
            "median_stretch": asset.median_stretch, "stretched_share": asset.stretched_share,
        },
    })
}

fn tile(r: &TileReport, map: &MapReport) -> Value {
    let t = &r.times;
    json!({
        "udim": r.udim, "grid": r.grid, "energy_before": r.energy_before, "energy": r.energy,
        "min_jacobian": r.min_jacobian, "folds": r.folds, "max_displacement": r.max_displacement,
        "charts": r.charts, "charts_active": r.charts_active, "charts_reused": r.charts_reused,
        "charts_identity": r.charts_identity, "charts_fallback": r.charts_fallback, "welds_torn": r.welds_torn,
        "blocks_active": r.blocks_active, "blocks": r.blocks, "nodes_active": r.nodes_active,
        "levels": r.levels, "sweeps": r.sweeps, "corrections": r.corrections, "node_updates": r.node_updates,
        "bytes": r.bytes, "truncated": r.truncated,
        "ms": {
            "surface": t.surface, "maps": t.maps, "pyramid": t.pyramid, "prolong": t.prolong, "relax": t.relax,
            "correct": t.correct, "certify": t.certify, "invert": t.invert, "total": t.total,
        },
        "strain": r.strain.as_ref().map(|s| json!({
            "segments": s.segments, "before": strain(&s.before), "after": strain(&s.after), "harm": s.harm,
            "help": s.help, "segments_fixed": s.segments_fixed, "fixed": s.fixed,
        })),
        // The redirection under bilinear lookup; errors are distances in the tile's UV.
        "map": {
            "size": map.size, "folds": map.folds, "min_jacobian": map.min_jacobian,
            "error_rms": map.error_rms, "error_p99": map.error_p99, "error_max": map.error_max,
            "sufficient_size": map.sufficient_size,
        },
    })
}

fn strain(s: &Strain) -> Value {
    json!({
        "rms": s.rms, "median": s.median, "p95": s.p95, "p99": s.p99, "max": s.max,
        "border_rms": s.border_rms, "interior_rms": s.interior_rms, "free_rms": s.free_rms,
    })
}

/// RMS strain of the rigid features of all tiles with the original UVs.
pub fn strain_before(tiles: &[(TileReport, MapReport)]) -> f64 {
    let measured = tiles.iter().filter_map(|(tile, _)| tile.strain.as_ref());
    let [edges, squares] = measured.fold([0.0, 0.0], |[edges, squares], strain| {
        let (own, rms) = (strain.segments as f64, f64::from(strain.before.rms));
        [edges + own, squares + own * rms * rms]
    });
    (squares / f64::max(edges, 1.0)).sqrt()
}

/// Titles of the columns of [`line`].
pub const TITLES: &str = "tile      grid  strain RMS        95 %            helped  min J   nodes     ms";

/// A tile's figures in less than 80 characters.
pub fn line(r: &TileReport) -> String {
    let measured = |s: &StrainReport| {
        let (rms, p95) = ([s.before.rms, s.after.rms], [s.before.p95, s.after.p95]);
        let help = 100.0 * s.help;
        format!("{:.4} -> {:.4}  {:.3} -> {:.3}  {help:5.1} %", rms[0], rms[1], p95[0], p95[1])
    };
    let strain = r.strain.as_ref().filter(|s| s.segments > 0).map_or("nothing to measure".into(), measured);
    let grid = format!("{}x{}", r.grid[0], r.grid[1]);
    let (jacobian, nodes, ms) = (r.min_jacobian, r.nodes_active, r.times.total);
    format!("{}  {grid:>8}  {strain:<41}  {jacobian:.3} {nodes:7} {ms:6.0}", r.udim)
}
