//! report.json: the inputs, the options, and every figure of every solve.

use std::io::IsTerminal;

use serde_json::{Value, json};
use vrtm::{AssetInfo, AssetReport, DeviceInfo, MapReport, Strain, StrainReport, TileInfo, TileReport};

use crate::args::Args;
use crate::overwrite;
use crate::source::{Frame, Source};

/// Figures that are known before the first frame.
pub fn header(source: &Source, args: &Args, device: &DeviceInfo, info: &AssetInfo) -> Value {
    json!({
        "program": { "name": overwrite::PROGRAM, "version": env!("CARGO_PKG_VERSION") },
        "scene": { "name": source.name, "mesh": source.origin, "credits": source.credits },
        "settings": {
            "quality": format!("{:?}", args.quality).to_lowercase(),
            "solver": format!("{:?}", args.solver).to_lowercase(),
            "iterations": args.iterations,
            "warm": args.warm,
            "temporal_weight": args.temporal_weight,
            "size": args.size,
            "form": format!("{:?}", args.form).to_lowercase(),
            "half": args.half,
            "weld": format!("{:?}", args.weld).to_lowercase(),
        },
        "device": {
            "backend": format!("{:?}", device.backend).to_lowercase(),
            "name": device.name,
            "reason": device.reason,
            "threads": device.threads,
            "bytes_held": device.bytes_held,
        },
        "asset": {
            "vertices": info.vertices,
            "faces": info.faces,
            "corners": info.corners,
            "triangles": info.triangles,
            "tiles": info.tiles,
            "charts": info.charts,
            "degenerate_triangles": info.degenerate_triangles,
            "clipped_faces": info.clipped_faces,
            "faces_outside": info.faces_outside,
            "faces_untextured": info.faces_untextured,
            "faces_skipped": info.faces_skipped,
            "border_edges": info.border_edges,
            "welded_edges": info.welded_edges,
            "edges_apart": info.edges_apart,
        },
    })
}

/// Figures of a tile that are known before the first frame.
pub fn tile(
    info: &TileInfo,
    settings: &vrtm::TileSettings,
    rigidity: Option<&str>,
    mask: Option<&str>,
) -> Value {
    json!({
        "udim": info.udim,
        "rigidity": rigidity,
        "mask": mask,
        "charts": info.charts,
        "triangles": info.triangles,
        "grid": info.grid,
        "movable_nodes": info.movable_nodes,
        "overlap": info.overlap,
        "frozen": info.frozen,
        "border_edges": info.border_edges,
        "welded_edges": info.welded_edges,
        "edges_apart": info.edges_apart,
        "settings": {
            "smoothness": settings.smoothness,
            "smoothness_floor": settings.smoothness_floor,
            "orientation": settings.orientation,
            "orientation_density": settings.orientation_density,
            "room": settings.room,
            "room_threshold": settings.room_threshold,
            "overlap": format!("{:?}", settings.overlap).to_lowercase(),
        },
    })
}

/// All figures of a frame. Errors of the maps are told in texels of a texture with so many texels per side.
pub fn frame(
    frame: &Frame,
    asset: &AssetReport,
    tiles: &[TileReport],
    maps: &[MapReport],
    texture_size: u32,
) -> Value {
    let of = |(tile, written): (&TileReport, &MapReport)| {
        let mut value = solve(tile);
        value["map"] = map(written, texture_size);
        value
    };
    json!({
        "frame": frame.number,
        "note": frame.note,
        "tiles": tiles.iter().zip(maps).map(of).collect::<Vec<_>>(),
        "asset": {
            "tiles": asset.tiles,
            "tiles_active": asset.tiles_active,
            "charts_active": asset.charts_active,
            "charts_reused": asset.charts_reused,
            "charts_identity": asset.charts_identity,
            "nodes_active": asset.nodes_active,
            "min_jacobian": asset.min_jacobian,
            "folds": asset.folds,
            "bytes": asset.bytes,
            "total_ms": asset.total_ms,
            "truncated": asset.truncated,
            "median_stretch": asset.median_stretch,
            "stretched_share": asset.stretched_share,
        },
    })
}

/// The redirection as it was written, under bilinear lookup.
fn map(map: &MapReport, texture_size: u32) -> Value {
    let texels = |error: f64| error * f64::from(texture_size);
    json!({
        "size": map.size,
        "folds": map.folds,
        "min_jacobian": map.min_jacobian,
        "error_texels": {
            "texture_size": texture_size,
            "rms": texels(map.error_rms),
            "p99": texels(map.error_p99),
            "max": texels(map.error_max),
        },
        "sufficient_size": map.sufficient_size,
    })
}

fn solve(r: &TileReport) -> Value {
    let t = &r.times;
    json!({
        "udim": r.udim,
        "grid": r.grid,
        "energy_before": r.energy_before,
        "energy": r.energy,
        "min_jacobian": r.min_jacobian,
        "folds": r.folds,
        "max_displacement": r.max_displacement,
        "charts": r.charts,
        "charts_active": r.charts_active,
        "charts_reused": r.charts_reused,
        "charts_identity": r.charts_identity,
        "charts_fallback": r.charts_fallback,
        "welds_torn": r.welds_torn,
        "blocks_active": r.blocks_active,
        "blocks": r.blocks,
        "nodes_active": r.nodes_active,
        "levels": r.levels,
        "sweeps": r.sweeps,
        "corrections": r.corrections,
        "node_updates": r.node_updates,
        "bytes": r.bytes,
        "truncated": r.truncated,
        "ms": {
            "surface": t.surface,
            "maps": t.maps,
            "pyramid": t.pyramid,
            "prolong": t.prolong,
            "relax": t.relax,
            "correct": t.correct,
            "pbd": t.pbd,
            "certify": t.certify,
            "invert": t.invert,
            "total": t.total,
        },
        "strain": r.strain.as_ref().map(strains),
    })
}

fn strains(s: &StrainReport) -> Value {
    json!({
        "edges": s.edges,
        "before": strain(&s.before),
        "after": strain(&s.after),
        "harm": s.harm,
        "help": s.help,
        "edges_fixed": s.edges_fixed,
        "fixed": s.fixed,
    })
}

fn strain(s: &Strain) -> Value {
    json!({
        "rms": s.rms,
        "median": s.median,
        "p95": s.p95,
        "p99": s.p99,
        "max": s.max,
        "border_rms": s.border_rms,
        "interior_rms": s.interior_rms,
        "free_rms": s.free_rms,
    })
}

/// The summary: a line per frame and tile.
pub struct Table(Vec<String>);

impl Table {
    pub fn new() -> Table {
        let titles =
            "frame  tile      grid  strain RMS        95 %             harm %  help %  min J     ms   nodes";
        Table(vec![titles.into()])
    }

    pub fn add(&mut self, frame: usize, r: &TileReport) {
        let grid = format!("{}x{}", r.grid[0], r.grid[1]);
        let strain = match r.strain.as_ref().filter(|s| s.edges > 0) {
            Some(s) => format!(
                "{:.4} -> {:.4}  {:.4} -> {:.4}  {:6.3}  {:6.2}",
                s.before.rms,
                s.after.rms,
                s.before.p95,
                s.after.p95,
                100.0 * s.harm,
                100.0 * s.help
            ),
            None => format!("{:<52}", "nothing to measure"),
        };
        self.0.push(format!(
            "{frame:>5}  {}  {grid:>8}  {strain}  {:.3}  {:5.0} {:7}",
            r.udim, r.min_jacobian, r.times.total, r.nodes_active
        ));
    }

    pub fn print(&self, last: &str) {
        let text = self.0.join("\n");
        // A reader that closes the pipe early (`bake | head`) does not make the bake fail.
        use std::io::Write;
        let _ = writeln!(std::io::stdout(), "{text}\n{last}");
    }
}

/// A progress bar on a terminal; silent elsewhere.
pub fn progress(frames: usize) -> indicatif::ProgressBar {
    if !std::io::stderr().is_terminal() {
        return indicatif::ProgressBar::hidden();
    }
    let style = indicatif::ProgressStyle::with_template("{wide_bar} frame {pos}/{len}, {msg} [{eta} left]");
    // The message of a failure gets a line of its own, without the rest of the bar.
    indicatif::ProgressBar::new(frames as u64)
        .with_finish(indicatif::ProgressFinish::AndClear)
        .with_style(style.unwrap_or_else(|_| indicatif::ProgressStyle::default_bar()))
}
