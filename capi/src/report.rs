//! Reports of the last solve.

use super::desc;
use super::guard::{guard_struct, guard_value};
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::mirror::mirror;
use super::status::vrtm_status;
use vrtm_core::report::{AssetReport, Strain, TileReport, WorstFeature};

mirror! {
    plain report vrtm_strain of s: Strain {
        rms: f32, median: f32, p95: f32, p99: f32, max: f32, border_rms: f32, interior_rms: f32,
    }
}

mirror! {
    plain report vrtm_worst_feature of f: WorstFeature {
        u: f32 = f.uv[0], v: f32 = f.uv[1], area: f32, before: f32, after: f32, at_border: u32,
    }
}

mirror! {
    report vrtm_tile_report first 296 of r: TileReport {
        udim: u32, grid_width: u32 = r.grid[0], grid_height: u32 = r.grid[1],
        energy_before: f64, energy: f64, min_jacobian: f64, folds: u64, max_displacement: f32,
        truncated: u32, kept: u32, welds_torn: u32,
        charts: u32, charts_active: u32, charts_reused: u32, charts_identity: u32,
        charts_fallback: u32, charts_apart: u32,
        levels: u32,
        blocks_active: u64, blocks: u64, nodes_active: u64,
        sweeps: u32, corrections: u32, node_updates: u64, bytes: u64,
        ms_surface: f32 = r.times.surface, ms_maps: f32 = r.times.maps, ms_pyramid: f32 = r.times.pyramid,
        ms_prolong: f32 = r.times.prolong, ms_relax: f32 = r.times.relax, ms_correct: f32 = r.times.correct,
        ms_pbd: f32 = r.times.pbd, ms_certify: f32 = r.times.certify, ms_blend: f32 = r.times.blend,
        ms_total: f32 = r.times.total,
        ms_invert: f32 = r.times.invert, texels_limited: u64, max_limit: f32,
        /// 1 if the solve measured strain; otherwise this and the fields below are 0. They describe segments between
        /// neighbouring nodes whose rigidity is over half of the tile's largest at both ends: `strain_fixed` and
        /// `segments_fixed` cover the segments that a border, an overlap or the mask fixes at both ends. A feature is a
        /// connected set of such nodes of one chart with at least 12 segments, of both kinds; its error is the RMS
        /// strain of these. All other fields cover the segments that are not fixed.
        measured: u32 = r.strain.is_some(),
        before: vrtm_strain = r.strain.unwrap_or_default().before,
        after: vrtm_strain = r.strain.unwrap_or_default().after,
        harm: f32 = r.strain.unwrap_or_default().harm, help: f32 = r.strain.unwrap_or_default().help,
        strain_fixed: f32 = r.strain.unwrap_or_default().fixed,
        segments: u64 = r.strain.unwrap_or_default().segments,
        segments_fixed: u64 = r.strain.unwrap_or_default().segments_fixed,
        features: u32 = r.strain.unwrap_or_default().features,
        features_worse: u32 = r.strain.unwrap_or_default().features_worse,
        features_strained_before: u32 = r.strain.unwrap_or_default().features_strained_before,
        features_strained_after: u32 = r.strain.unwrap_or_default().features_strained_after,
    }
}

mirror! {
    report vrtm_asset_report first 80 of r: AssetReport {
        tiles: u32, tiles_active: u32, tiles_kept: u32, charts_active: u32, charts_reused: u32, charts_identity: u32,
        nodes_active: u64, min_jacobian: f64, folds: u64, bytes: u64, ms_total: f32 = r.total_ms, truncated: u32,
        scale: f32, stretched_share: f32, scale_spread: f32,
        /// 0.
        reserved: u32 = 0u32,
    }
}

/// Reports on a tile's last solve.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_report(tile: vrtm_tile, report: *mut vrtm_tile_report) -> vrtm_status {
    guard_struct("vrtm_tile_get_report", report, "report", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        Ok(asset.results.tile(tile).report()?.into())
    })
}

/// Writes the painted features of a tile that are worse than without vrtm in its last solve, those whose error rose
/// most first, to `features`, which has room for `capacity` of them. `count` gets their number: at most 16, and 0 if
/// the solve did not measure. With `features` null and `capacity` 0 nothing else is written.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_get_worst_features(
    tile: vrtm_tile,
    features: *mut vrtm_worst_feature,
    capacity: usize,
    count: *mut u32,
) -> vrtm_status {
    guard_value("vrtm_tile_get_worst_features", count, "count", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let strain = asset.results.tile(tile).report()?.strain.unwrap_or_default();
        if !features.is_null() || capacity > 0 {
            // SAFETY: the host vouches for `capacity` elements during the call.
            let out = unsafe { desc::slice_mut(features, capacity, "features") }?;
            out.iter_mut().zip(strain.worst()).for_each(|(out, worst)| *out = (*worst).into());
        }
        Ok(strain.worst().len() as u32)
    })
}

/// Reports on an asset's last solve, over all tiles.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_get_report(
    asset: vrtm_asset,
    report: *mut vrtm_asset_report,
) -> vrtm_status {
    guard_struct("vrtm_asset_get_report", report, "report", || {
        Ok(handle::asset(asset)?.results.report()?.into())
    })
}
