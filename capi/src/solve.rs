//! Solving, and solving and fetching in one call, for a host's compute().

use std::ffi::c_void;
use std::num::NonZeroU32;
use std::sync::Arc;

use super::desc::{self, User};
use super::fetch::{Wanted, vrtm_fetch};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::mirror::{Mirror, choice, mirror};
use super::shared::SharedAsset;
use super::status::{Outcome, vrtm_status};
use super::types::{strided, strided_and_span, vrtm_array};
use vrtm::{Fetch, SolveRequest};
use vrtm_core::allocation::Vec;
use vrtm_core::control::Control;
use vrtm_core::settings::{PbdSettings, Quality, Scale, SolveOptions, Solver};
use vrtm_core::view::Strided;

choice! {
    QUALITIES: vrtm_quality of Quality {
        VRTM_QUALITY_NORMAL = 0: Normal, VRTM_QUALITY_DRAFT = 1: Draft,
    }
}

choice! {
    SCALES: vrtm_scale of Scale { VRTM_SCALE_KEEP = 0: Keep, VRTM_SCALE_FOLLOW = 1: Follow }
}

choice! {
    SOLVERS: vrtm_solver of Solver { VRTM_SOLVER_DESCENT = 0: Descent, VRTM_SOLVER_PBD = 1: Pbd }
}

mirror! {
    plain settings vrtm_pbd_settings of s: PbdSettings {
        iterations: u32, damping: f32, orientation_preservation: f32, smoothing: f32, coarse_correction: f32,
    }
}

mirror! {
    settings vrtm_solve_options first 112 of s: SolveOptions in "options" {
        quality: vrtm_quality, max_corrections: u32, tolerance: f32, time_budget_ms: f32 = s.time_budget,
        warm: u32, temporal_weight: f32,
        /// CPU threads of this solve, at most 1024; 0 = the device's. The result is the same bit for bit.
        threads: u32,
        measure: u32,
        /// Memory to release: a sum of VRTM_RELEASE_ flags; 0 (the default) = none, so that results can be read at any
        /// time.
        release: u32,
        solver: vrtm_solver, pbd: vrtm_pbd_settings,
        /// The tiles to solve, in any order and also twice; null = all, an empty list = none. The others keep their
        /// results.
        tiles: *const vrtm_tile,
        /// The length of `tiles`. Ignored when that is null.
        tile_count: usize,
        /// The vertices that have moved since the last solve, in any order; null = any vertex may have moved. Tiles
        /// that none of these vertices touches keep their results, unless they have no result yet, or their maps,
        /// settings or these options have changed.
        dirty_vertices: *const u32,
        /// The length of `dirty_vertices`. Ignored when that is null.
        dirty_vertex_count: usize,
        /// Called about 500 times per second while the tiles are solved, on the thread that does the work: the calling
        /// thread or the job's, or one of the executor's if the device has one. Null = no progress function.
        progress: vrtm_progress_fn,
        /// Passed to `progress` unchanged. Both must stay valid until the call returns, or the job is destroyed.
        progress_user: *mut c_void,
        /// 1, for vrtm_asset_submit only: the newest pose wins. A job or a solve that is using the asset is cancelled,
        /// the call waits for its end, some milliseconds, and the new job takes its place, instead of VRTM_ERROR_BUSY.
        /// Calls of several threads take their turns. 0 (the default) = the asset is busy, as it always is for a call
        /// from within another one, such as from a progress function.
        replace: u32,
        scale: vrtm_scale,
    }
}

/// For vrtm_solve_options.release: the last results of the solved tiles, before solving, 8 bytes per node of the blocks
/// in use; they cannot be read until the solve succeeds.
pub const VRTM_RELEASE_RESULTS: u32 = 1;
/// For vrtm_solve_options.release: the memory of each tile's solver once the tile is solved, about 110 bytes per node,
/// so that tiles which are solved one after the other need that of one; the next solve takes longer, as a first one
/// does.
pub const VRTM_RELEASE_SOLVERS: u32 = 2;

/// A host's function that receives a solve's predicted progress, 0..1, which never decreases. If it returns a nonzero
/// value, the solve is cancelled; one that succeeds reports 1 at its end, when it can no longer be cancelled. The
/// function may call vrtm: results of the asset can be read, and calls that would change the asset give
/// VRTM_ERROR_BUSY.
pub type vrtm_progress_fn = Option<unsafe extern "C" fn(user: *mut c_void, progress: f32) -> u32>;

/// A host's checked options for one solve.
pub(super) struct CheckedOptions<'a> {
    options: SolveOptions,
    threads: Option<NonZeroU32>,
    tiles: Option<Vec<usize>>,
    pub dirty_vertices: Option<&'a [u32]>,
    release_last: bool,
    release_solvers: bool,
    pub replace: bool,
    pub control: Arc<Control>,
}

impl<'a> CheckedOptions<'a> {
    /// Reads a host's options for an asset.
    pub unsafe fn read(asset: vrtm_asset, pointer: *const vrtm_solve_options) -> Outcome<CheckedOptions<'a>> {
        // SAFETY: the host's pointer.
        let from: vrtm_solve_options = unsafe { desc::read_or_default(pointer, "options") }?;
        let index = |(k, &handle): (usize, &vrtm_tile)| {
            let name = format!("options.tiles[{k}]");
            let (_, index) = handle::tile(&name, handle)?;
            ensure!(handle::is_tile_of(handle, asset), "{name} belongs to another asset");
            Ok(index)
        };
        // SAFETY: the host vouches for `tile_count` handles.
        let handles = unsafe { desc::slice_or_none(from.tiles, from.tile_count, "options.tiles") }?;
        let tiles =
            handles.map(|handles| handles.iter().enumerate().map(index).collect::<Result<Vec<_>, _>>());
        let (first, count) = (from.dirty_vertices, from.dirty_vertex_count);
        // SAFETY: the host vouches for `dirty_vertex_count` numbers.
        let dirty_vertices = unsafe { desc::slice_or_none(first, count, "options.dirty_vertices") }?;
        ensure!(
            from.release & !(VRTM_RELEASE_RESULTS | VRTM_RELEASE_SOLVERS) == 0,
            "options.release is {}, no sum of VRTM_RELEASE_ flags",
            from.release
        );
        let control = from.progress.map_or_else(Control::new, |call| {
            let user = User(from.progress_user);
            // SAFETY: the host vouches for the function and for its user data.
            Control::with_progress(Arc::new(move |progress| unsafe { call(user.pointer(), progress) != 0 }))
        });
        Ok(CheckedOptions {
            options: from.settings()?,
            threads: NonZeroU32::new(from.threads),
            tiles: tiles.transpose()?,
            dirty_vertices,
            release_last: from.release & VRTM_RELEASE_RESULTS != 0,
            release_solvers: from.release & VRTM_RELEASE_SOLVERS != 0,
            replace: bool::from_c(from.replace, "options.replace")?,
            control: Arc::new(control),
        })
    }

    /// The request for a pose.
    pub fn request<'r>(&'r self, positions: Strided<'r>) -> SolveRequest<'r> {
        SolveRequest {
            positions,
            options: self.options,
            threads: self.threads,
            tiles: self.tiles.as_deref(),
            dirty_vertices: self.dirty_vertices,
            release_last: self.release_last,
            release_solvers: self.release_solvers,
            control: Some(self.control.clone()),
        }
    }

    /// Solves in the host's call.
    fn solve(&self, shared: &Arc<SharedAsset>, positions: Strided, fetches: &mut [Fetch]) -> Outcome<()> {
        ensure!(!self.replace, "options.replace: only vrtm_asset_submit replaces a solve");
        let mut claim = shared.claim()?;
        shared.announce(self.control.clone());
        Ok(claim.asset().run(&self.request(positions), fetches)?)
    }

    /// These options without the host's list of dirty vertices, of which a job keeps a copy.
    pub fn without_dirty_vertices<'b>(self) -> CheckedOptions<'b> {
        CheckedOptions { dirty_vertices: None, ..self }
    }
}

/// Solves every tile for a pose; returns when all are done. `positions` are the deformed positions of all vertices (3
/// components, as many and in the same order as at rest). `options` may be null: all defaults. On any error the last
/// good result stays readable.
///
/// The result is the same bit for bit for any number of threads, on any machine and in any floating-point mode, unless
/// options->warm or options->time_budget_ms is set. Charts whose inputs have not changed keep their result at no
/// cost, unless this solve or the last one is warm.
///
/// Errors: VRTM_ERROR_CANCELLED; VRTM_ERROR_BUSY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_solve(
    asset: vrtm_asset,
    positions: *const vrtm_array,
    options: *const vrtm_solve_options,
) -> vrtm_status {
    guard("vrtm_asset_solve", || {
        let shared = handle::asset(asset)?;
        // SAFETY: the host's pointers, valid during the call.
        let (positions, checked) =
            unsafe { (strided(positions, 3, "positions")?, CheckedOptions::read(asset, options)?) };
        checked.solve(&shared, positions, &mut [])
    })
}

/// Solves every tile for a pose and writes `count` outputs, in one call: all that a host's compute() needs for a frame.
/// Equivalent to vrtm_asset_solve followed by vrtm_asset_fetch, except that all arguments are checked before any work,
/// and nothing else can use the asset in between. `fetches` may be null if `count` is 0. No two outputs may write the
/// same byte, but they may be interleaved, such as two pairs of channels of one image. No output may overlap the memory
/// that the positions span.
///
/// Errors: those of vrtm_asset_solve and vrtm_asset_fetch; VRTM_ERROR_INVALID_ARGUMENT for a tile or carrier of another
/// asset.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_redirect(
    asset: vrtm_asset,
    positions: *const vrtm_array,
    options: *const vrtm_solve_options,
    fetches: *const vrtm_fetch,
    count: usize,
) -> vrtm_status {
    guard("vrtm_asset_redirect", || {
        let shared = handle::asset(asset)?;
        // SAFETY: the host's pointers, valid during the call.
        let (view, checked) =
            unsafe { (strided_and_span(positions, 3, "positions")?, CheckedOptions::read(asset, options)?) };
        let (positions, span) = view;
        // SAFETY: as above.
        let mut wanted = unsafe { Wanted::read(Some(shared.results.clone()), fetches, count, span) }?;
        let mut fetches = wanted.fetches()?;
        checked.solve(&shared, positions, &mut fetches)
    })
}

/// Cancels the solve of an asset that is in progress, whether another thread's call or a job: it soon gives
/// VRTM_ERROR_CANCELLED, and the last good result stays. A solve that already has its result is not cancelled. Does
/// nothing if no solve is in progress. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_cancel(asset: vrtm_asset) -> vrtm_status {
    guard("vrtm_asset_cancel", || {
        handle::asset(asset)?.cancel();
        Ok(())
    })
}
