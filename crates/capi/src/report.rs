//! Reports of the last solve.

use super::desc::{Out, Sized32};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::status::vrtm_status;
use vrtm_core::report::{Strain, StrainReport};

/// Statistics of strain: deformed length over rest length, minus 1, of segments that are fixed in the texture. A plain
/// value that never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_strain {
    /// Root of the mean square.
    pub rms: f32,
    /// Median of the magnitudes.
    pub median: f32,
    /// 95th percentile of the magnitudes.
    pub p95: f32,
    /// 99th percentile of the magnitudes.
    pub p99: f32,
    /// Largest magnitude.
    pub max: f32,
    /// RMS over segments within 10 cells of a chart's border, which cannot move.
    pub border_rms: f32,
    /// RMS over the other segments.
    pub interior_rms: f32,
}

/// A tile's last solve. Start from vrtm_tile_report_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_tile_report_data {
    /// sizeof(vrtm_tile_report_data); set by vrtm_tile_report_data_init().
    pub struct_size: u32,
    /// UDIM number: 1001 + U + 10 V.
    pub udim: u32,
    /// Cells of the grid in u.
    pub grid_width: u32,
    /// Cells of the grid in v.
    pub grid_height: u32,
    /// Energy of the identity, summed over the charts that were solved or reused, on the finest level that was worked
    /// on: level 1 for a draft, a coarser one if time was up there. It and `energy` are 0 if a time budget left no
    /// time to compute them.
    pub energy_before: f64,
    /// Energy of the result, on the same level.
    pub energy: f64,
    /// Smallest corner Jacobian of the result (1 at rest), computed in double precision (on a GPU in single precision
    /// minus a bound of the rounding error, so never too large): greater than 0 certifies that the warp is one-to-one
    /// and onto.
    pub min_jacobian: f64,
    /// Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    pub folds: u64,
    /// Length of the longest displacement, in cells.
    pub max_displacement: f32,
    /// 1 if the time budget ended the solve early.
    pub truncated: u32,
    /// 1 if the asset's last solve skipped the tile: it was frozen, not requested, or touched by no dirty vertex. The
    /// other fields then describe the tile's own last solve.
    pub kept: u32,
    /// Edges welded by position whose sides the pose pulls apart: charts end there in this result.
    pub welds_torn: u32,
    /// Charts in the tile.
    pub charts: u32,
    /// Charts solved in this call.
    pub charts_active: u32,
    /// Charts that kept their last result because none of their inputs changed.
    pub charts_reused: u32,
    /// Charts whose warp is the identity: nothing rigid, nothing movable, or deformed without strain.
    pub charts_identity: u32,
    /// Charts that fell back to the identity because nothing better was found.
    pub charts_fallback: u32,
    /// Levels of the grid.
    pub levels: u32,
    /// Blocks of 16 x 16 nodes that were visited on the finest level.
    pub blocks_active: u64,
    /// All blocks of the tile.
    pub blocks: u64,
    /// Movable nodes of the solved charts on the finest level.
    pub nodes_active: u64,
    /// Relaxation sweeps, or iterations of VRTM_SOLVER_PBD, over all levels.
    pub sweeps: u32,
    /// Gauss-Newton corrections, over all levels.
    pub corrections: u32,
    /// Node updates by relaxation sweeps or iterations, over all levels.
    pub node_updates: u64,
    /// Bytes held for this tile: maps, state, result.
    pub bytes: u64,
    /// Milliseconds: positions to triangles and their metrics. The times of stages are measured on the device; on a GPU
    /// without timestamps they are 0, and only the total is known.
    pub ms_surface: f32,
    /// Milliseconds: maps to grids; 0 unless a map or a setting changed.
    pub ms_maps: f32,
    /// Milliseconds: pose metrics to all levels.
    pub ms_pyramid: f32,
    /// Milliseconds: displacements to the next finer level.
    pub ms_prolong: f32,
    /// Milliseconds: relaxation, node by node.
    pub ms_relax: f32,
    /// Milliseconds: Gauss-Newton corrections.
    pub ms_correct: f32,
    /// Milliseconds: iterations of VRTM_SOLVER_PBD.
    pub ms_pbd: f32,
    /// Milliseconds: the certificate.
    pub ms_certify: f32,
    /// Milliseconds: the latest inversion of the warp; not part of the total.
    pub ms_invert: f32,
    /// Milliseconds: the whole solve of this tile, without measuring strain.
    pub ms_total: f32,
    /// 1 if the solve measured strain; otherwise this and the fields below are 0. They describe segments between
    /// neighbouring nodes whose rigidity is over 0.5 at both ends: `strain_fixed` and `edges_fixed` cover the segments
    /// that a border, an overlap or the mask fixes at both ends, and the other fields cover the rest.
    pub measured: u32,
    /// Strain with the mesh's own UVs.
    pub before: vrtm_strain,
    /// Strain with the warp.
    pub after: vrtm_strain,
    /// Fraction (0..1) of the segments whose strain rose by more than 0.25.
    pub harm: f32,
    /// Fraction of the segments whose strain fell by more than 0.10.
    pub help: f32,
    /// RMS strain of the segments that are fixed at both ends; the warp does not change it. The RMS strain of all rigid
    /// segments is the root of (edges * rms^2 + edges_fixed * strain_fixed^2) / (edges + edges_fixed), with before.rms
    /// or after.rms.
    pub strain_fixed: f32,
    /// Segments that are not fixed at both ends.
    pub edges: u64,
    /// Segments that are fixed at both ends.
    pub edges_fixed: u64,
    /// With VRTM_SEAMS_CONTINUE: charts that could not be brought together at their seams with what their neighbours
    /// say, or not wholly, without crushing a cell.
    pub charts_apart: u32,
    /// Milliseconds: bringing charts together at seams.
    pub ms_blend: f32,
    /// With VRTM_SEAMS_CONTINUE or VRTM_OPEN_BORDERS_SLIDE: texels in charts whose redirection was limited in the latest
    /// image, or part of one, since it would have led over the border of the chart into texture of another chart.
    pub texels_limited: u64,
    /// By how much at most, in texels of that image.
    pub max_limit: f32,
}

/// An asset's last solve, over all tiles. Start from vrtm_asset_report_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_asset_report_data {
    /// sizeof(vrtm_asset_report_data); set by vrtm_asset_report_data_init().
    pub struct_size: u32,
    /// Tiles in the asset.
    pub tiles: u32,
    /// Tiles with at least one chart solved in the last call.
    pub tiles_active: u32,
    /// Tiles that the last call skipped: frozen, not requested, or touched by no dirty vertex. Their charts count as
    /// reused.
    pub tiles_kept: u32,
    /// Charts solved.
    pub charts_active: u32,
    /// Charts that kept their last result because none of their inputs changed.
    pub charts_reused: u32,
    /// Charts whose warp is the identity.
    pub charts_identity: u32,
    /// Movable nodes of the solved charts.
    pub nodes_active: u64,
    /// Smallest corner Jacobian over all tiles: greater than 0 certifies that no warp folds.
    pub min_jacobian: f64,
    /// Corner Jacobians that are not greater than 0: always 0 from VRTM_SOLVER_DESCENT.
    pub folds: u64,
    /// Bytes held for the asset.
    pub bytes: u64,
    /// Wall-clock milliseconds of the last solve, without measuring strain.
    pub ms_total: f32,
    /// 1 if the time budget ended a tile's solve early.
    pub truncated: u32,
    /// Median ratio of posed length to rest length, over a few thousand edges. If it is over 3 or under 1/3, the log
    /// warns: the pose probably has other units, or its vertices are in another order.
    pub median_stretch: f32,
    /// Share (0..1) of these edges that are more than 3 times as long as at rest. If it is over 0.05, the log warns:
    /// the pose's vertices are probably in another order than the mesh's.
    pub stretched_share: f32,
}

// SAFETY: repr(C), struct_size first, plain numbers.
unsafe impl Sized32 for vrtm_tile_report_data {
    // It ended with `edges_fixed`.
    const FIRST: usize = 264;
    const NAME: &'static str = "vrtm_tile_report_data";
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_asset_report_data {
    const NAME: &'static str = "vrtm_asset_report_data";
}

impl From<Strain> for vrtm_strain {
    fn from(s: Strain) -> vrtm_strain {
        vrtm_strain {
            rms: s.rms,
            median: s.median,
            p95: s.p95,
            p99: s.p99,
            max: s.max,
            border_rms: s.border_rms,
            interior_rms: s.interior_rms,
        }
    }
}

/// Reports on a tile's last solve.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT if
/// `report` is null or has a wrong struct_size. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_report(
    tile: vrtm_tile,
    report: *mut vrtm_tile_report_data,
) -> vrtm_status {
    guard("vrtm_tile_report", || {
        let out = Out::new(report, "report")?;
        let (asset, tile) = handle::tile("tile", tile)?;
        let r = asset.results.tile_report(tile)?;
        let strain: StrainReport = r.strain.unwrap_or_default();
        out.write(vrtm_tile_report_data {
            struct_size: 0,
            udim: r.udim,
            grid_width: r.grid[0],
            grid_height: r.grid[1],
            energy_before: r.energy_before,
            energy: r.energy,
            min_jacobian: r.min_jacobian,
            folds: r.folds,
            max_displacement: r.max_displacement,
            truncated: u32::from(r.truncated),
            charts: r.charts,
            charts_active: r.charts_active,
            charts_reused: r.charts_reused,
            charts_identity: r.charts_identity,
            charts_fallback: r.charts_fallback,
            levels: r.levels,
            blocks_active: r.blocks_active,
            blocks: r.blocks,
            nodes_active: r.nodes_active,
            sweeps: r.sweeps,
            corrections: r.corrections,
            node_updates: r.node_updates,
            bytes: r.bytes,
            ms_surface: r.times.surface,
            ms_maps: r.times.maps,
            ms_pyramid: r.times.pyramid,
            ms_prolong: r.times.prolong,
            ms_relax: r.times.relax,
            ms_correct: r.times.correct,
            ms_certify: r.times.certify,
            ms_invert: r.times.invert,
            ms_total: r.times.total,
            measured: u32::from(r.strain.is_some()),
            edges: strain.edges,
            before: strain.before.into(),
            after: strain.after.into(),
            harm: strain.harm,
            help: strain.help,
            ms_pbd: r.times.pbd,
            welds_torn: r.welds_torn,
            kept: u32::from(r.kept),
            edges_fixed: strain.edges_fixed,
            strain_fixed: strain.fixed,
            charts_apart: r.charts_apart,
            ms_blend: r.times.blend,
            texels_limited: r.texels_limited,
            max_limit: r.max_limit,
        });
        Ok(())
    })
}

/// Reports on an asset's last solve, over all tiles.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_NOT_SOLVED before the first solve; VRTM_ERROR_INVALID_ARGUMENT if
/// `report` is null or has a wrong struct_size. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_report(
    asset: vrtm_asset,
    report: *mut vrtm_asset_report_data,
) -> vrtm_status {
    guard("vrtm_asset_report", || {
        let out = Out::new(report, "report")?;
        let r = handle::asset(asset)?.results.report()?;
        out.write(vrtm_asset_report_data {
            struct_size: 0,
            tiles: r.tiles,
            tiles_active: r.tiles_active,
            charts_active: r.charts_active,
            charts_reused: r.charts_reused,
            charts_identity: r.charts_identity,
            nodes_active: r.nodes_active,
            min_jacobian: r.min_jacobian,
            folds: r.folds,
            bytes: r.bytes,
            ms_total: r.total_ms,
            truncated: u32::from(r.truncated),
            tiles_kept: r.tiles_kept,
            median_stretch: r.median_stretch,
            stretched_share: r.stretched_share,
        });
        Ok(())
    })
}
