//! Solving, and solving and fetching in one call, for a host's compute().

use std::ffi::c_void;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use super::desc::{self, Sized32};
use super::fetch::{targets, vrtm_fetch};
use super::guard::guard;
use super::handle::{self, vrtm_asset, vrtm_tile};
use super::status::{Failure, Outcome, vrtm_status};
use super::types::{flag, strided, strided_and_span, vrtm_array};
use vrtm::{Fetch, SolveRequest};
use vrtm_core::allocation::{Collect, Grow, with_capacity};
use vrtm_core::control::Control;
use vrtm_core::settings::{PbdSettings, Quality, SolveOptions, Solver};
use vrtm_core::view::Strided;

/// How much work a solve does on each level of its grid.
pub type vrtm_quality = i32;
/// One correction on each level, and more on the finest level in crowded charts; the default.
pub const VRTM_QUALITY_NORMAL: vrtm_quality = 0;
/// As VRTM_QUALITY_NORMAL, but with relaxation only on the finest level: a preview.
pub const VRTM_QUALITY_DRAFT: vrtm_quality = 1;
/// More sweeps, and corrections until they gain little.
pub const VRTM_QUALITY_HIGH: vrtm_quality = 2;

/// How a solve finds its warp.
pub type vrtm_solver = i32;
/// Gauss-Newton corrections and relaxation, which never folds; the default.
pub const VRTM_SOLVER_DESCENT: vrtm_solver = 0;
/// The solver of the paper that the library follows: position-based dynamics on a hierarchy of grids. For comparison:
/// its result is returned unchecked, and may fold (the report's `folds`) or be worse than the mesh's own UVs. Where it
/// folds, a texel has several possible lookups and gets one of them. Nodes may leave their charts, and even the tile,
/// by 0.08 of its side in the worst pose tested. Redirections stay within the tile.
pub const VRTM_SOLVER_PBD: vrtm_solver = 1;

/// Settings of VRTM_SOLVER_PBD; vrtm_solve_options_init() sets the defaults. A plain value that never grows.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_pbd_settings {
    /// Iterations on each level of the grid, 1..1024; default 16. Each projects all constraints once; every fourth is
    /// followed by a regularisation.
    pub iterations: u32,
    /// Fraction (0..1) of its velocity that a node loses from one regularisation to the next; default 0.
    pub damping: f32,
    /// Fraction (0..1) of its turn that a segment takes back after its projection; default 0.
    pub orientation_preservation: f32,
    /// How much (0..1) as-rigid-as-possible material is smoothed; default 0.8.
    pub smoothing: f32,
    /// Factor (0..1) on the corrections of each level over those of the next finer one; default 0.7.
    pub coarse_correction: f32,
}

/// Options of one solve. Start from vrtm_solve_options_init(), which sets the defaults.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_solve_options {
    /// sizeof(vrtm_solve_options); set by vrtm_solve_options_init().
    pub struct_size: u32,
    /// VRTM_QUALITY_NORMAL (0, the default), DRAFT (a preview: unless it is `warm`, solved on half as many cells along
    /// each axis) or HIGH. This and the two limits below apply to VRTM_SOLVER_DESCENT only.
    pub quality: vrtm_quality,
    /// Maximum corrections per level, 0..64, overriding the quality's limit; 0 = the quality's own.
    pub max_corrections: u32,
    /// A chart is done when a correction gains less than this fraction of its energy (to which 6 % of the energy of the
    /// original UVs is added), or when the gain of a level's first correction matches the prediction of its quadratic
    /// model to a quarter of that fraction; 0 <= tolerance < 1; 0 = the quality's own.
    pub tolerance: f32,
    /// Milliseconds that the call may take, excluding fetches, measuring and rebuilding after a change of maps or
    /// settings; 0 = no limit. The result comes from the finest level of the grid that the time allows, interpolated to
    /// the finest level and certified: never worse than the identity, and the identity itself if no level fits (the
    /// report is then `truncated`, with energies of 0). Costs are predicted from the last solves: the call returns
    /// within 1.2 times the budget plus 5 ms, unless the machine is suddenly busier than before. On a GPU this holds up
    /// to delays of the driver. With a limit the result depends on the speed of the machine.
    pub time_budget_ms: f32,
    /// 0 (the default): start from the identity, so that a frame's result depends on its inputs alone. 1: start from
    /// the last result, for interactive use: faster on small changes, but it depends on the order of the frames.
    pub warm: u32,
    /// With `warm` and VRTM_SOLVER_DESCENT: how strongly the warp is pulled towards the last result, 0..1e6, in the
    /// unit of the tile settings' smoothness; 0 = not at all. 0.03 to 0.3 is a useful range: 0.1 reduces jumps between
    /// frames to between three quarters and a fifth, and delays the warp of a steady motion by one to two frames.
    /// Without `warm` it has no effect.
    pub temporal_weight: f32,
    /// CPU threads of this solve, at most 1024; 0 = the device's. The result is the same bit for bit.
    pub threads: u32,
    /// 1: also measure the strain on the mesh, for vrtm_tile_report. Slow.
    pub measure: u32,
    /// What is released to save memory, as a sum. 1: the last results of the solved tiles before solving, 8 bytes per
    /// node of the blocks in use; they cannot be read until the solve succeeds. 2: the memory of each tile's solver once
    /// the tile is solved, about 110 bytes per node, so that tiles which are solved one after the other need that of
    /// one; the next solve takes longer, as a first one does. 0 (the default): nothing; results can be read at any time.
    pub release_last: u32,
    /// VRTM_SOLVER_DESCENT (0, the default) or PBD.
    pub solver: vrtm_solver,
    /// Settings of VRTM_SOLVER_PBD.
    pub pbd: vrtm_pbd_settings,
    /// The tiles to solve, in any order; null = all. The others keep their results.
    pub tiles: *const vrtm_tile,
    /// The length of `tiles`. Ignored when that is null.
    pub tile_count: usize,
    /// The vertices that have moved since the last solve, in any order; null = any vertex may have moved. Tiles that
    /// none of these vertices touches keep their results, unless they have no result yet, or their maps, settings or
    /// these options have changed.
    pub dirty_vertices: *const u32,
    /// The length of `dirty_vertices`. Ignored when that is null.
    pub dirty_vertex_count: usize,
    /// Called about 500 times per second while the tiles are solved, on the thread that does the work: the calling
    /// thread or the job's, or one of the executor's if the device has one. Null = no progress function.
    pub progress: vrtm_progress_fn,
    /// Passed to `progress` unchanged. Both must stay valid until the call returns, or the job is destroyed.
    pub progress_user: *mut c_void,
}

/// A host's function that receives a solve's predicted progress, 0..1, which never decreases. If it returns a nonzero
/// value, the solve is cancelled. A solve that succeeds reports 1 at its end, when it can no longer be cancelled. It may
/// call vrtm functions: results of the asset can be read, and calls that would change the asset give VRTM_ERROR_BUSY. On
/// a device with an executor, such calls use only the calling thread, so that they never wait for threads that wait for
/// this function. It must return normally: no exception, no longjmp.
pub type vrtm_progress_fn = Option<unsafe extern "C" fn(user: *mut c_void, progress: f32) -> u32>;

// SAFETY: repr(C), struct_size first, plain numbers.
unsafe impl Sized32 for vrtm_solve_options {
    const NAME: &'static str = "vrtm_solve_options";
}

impl Default for vrtm_solve_options {
    fn default() -> vrtm_solve_options {
        let pbd = PbdSettings::default().resolved();
        let pbd = vrtm_pbd_settings {
            iterations: pbd.iterations,
            damping: pbd.damping,
            orientation_preservation: pbd.orientation_preservation,
            smoothing: pbd.smoothing,
            coarse_correction: pbd.coarse_correction,
        };
        vrtm_solve_options { pbd, ..Sized32::zeroed() }
    }
}

/// A host's checked options for one solve.
pub(super) struct Wishes<'a> {
    options: SolveOptions,
    threads: Option<NonZeroU32>,
    tiles: Option<Vec<usize>>,
    pub dirty_vertices: Option<&'a [u32]>,
    release_last: bool,
    release_solvers: bool,
    pub control: Arc<Control>,
}

impl<'a> Wishes<'a> {
    /// Reads a host's options for an asset.
    pub unsafe fn read(asset: vrtm_asset, pointer: *const vrtm_solve_options) -> Outcome<Wishes<'a>> {
        // SAFETY: the host's pointer.
        let from = unsafe { desc::read_or_default(pointer, "options") }?;
        let mut tiles = None;
        if !from.tiles.is_null() {
            // SAFETY: the host vouches for `tile_count` handles.
            let handles = unsafe { desc::slice(from.tiles, from.tile_count, "options.tiles") }?;
            let index = |(k, &handle): (usize, &vrtm_tile)| {
                let name = format!("options.tiles[{k}]");
                let (_, index) = handle::tile(&name, handle)?;
                match handle::is_tile_of(handle, asset) {
                    true => Ok(index),
                    false => Err(Failure::argument(format!("{name} belongs to another asset"))),
                }
            };
            tiles = Some(handles.iter().enumerate().map(index).try_collected()?);
        }
        let mut dirty_vertices = None;
        if !from.dirty_vertices.is_null() {
            let (first, count) = (from.dirty_vertices, from.dirty_vertex_count);
            // SAFETY: the host vouches for `dirty_vertex_count` numbers.
            dirty_vertices = Some(unsafe { desc::slice(first, count, "options.dirty_vertices") }?);
        }
        if from.release_last > 3 {
            let message =
                format!("options.release_last is {}, which is no sum of 1 and 2", from.release_last);
            return Err(Failure::argument(message));
        }
        let control = from.progress.map_or_else(Control::new, |call| {
            let host = HostProgress { call, user: from.progress_user };
            Control::with_progress(Arc::new(move |progress| host.tell(progress)))
        });
        Ok(Wishes {
            options: options(&from)?,
            threads: NonZeroU32::new(from.threads),
            tiles,
            dirty_vertices,
            release_last: from.release_last & 1 != 0,
            release_solvers: from.release_last & 2 != 0,
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

    /// These options without the host's list of dirty vertices, of which a job keeps a copy.
    pub fn without_dirty_vertices<'b>(self) -> Wishes<'b> {
        Wishes { dirty_vertices: None, ..self }
    }
}

/// A host's progress function and its user data.
struct HostProgress {
    call: unsafe extern "C" fn(*mut c_void, f32) -> u32,
    user: *mut c_void,
}

// SAFETY: the header tells the host on which threads its function is called.
unsafe impl Send for HostProgress {}
// SAFETY: as above.
unsafe impl Sync for HostProgress {}

impl HostProgress {
    /// Reports progress; true if the host cancels.
    fn tell(&self, progress: f32) -> bool {
        // SAFETY: the host vouches for the function and for its user data.
        unsafe { (self.call)(self.user, progress) != 0 }
    }
}

fn options(from: &vrtm_solve_options) -> Outcome<SolveOptions> {
    Ok(SolveOptions {
        quality: match from.quality {
            VRTM_QUALITY_NORMAL => Quality::Normal,
            VRTM_QUALITY_DRAFT => Quality::Draft,
            VRTM_QUALITY_HIGH => Quality::High,
            other => {
                return Err(Failure::argument(format!("options.quality is {other}, no VRTM_QUALITY_ value")));
            }
        },
        warm: flag(from.warm, "options.warm")?,
        temporal_weight: from.temporal_weight,
        tolerance: (from.tolerance != 0.0).then_some(from.tolerance),
        max_corrections: (from.max_corrections != 0).then_some(from.max_corrections),
        time_budget: time_budget(from.time_budget_ms)?,
        measure: flag(from.measure, "options.measure")?,
        solver: match from.solver {
            VRTM_SOLVER_DESCENT => Solver::Descent,
            VRTM_SOLVER_PBD => Solver::Pbd,
            other => {
                return Err(Failure::argument(format!("options.solver is {other}, no VRTM_SOLVER_ value")));
            }
        },
        pbd: PbdSettings {
            iterations: Some(from.pbd.iterations),
            damping: Some(from.pbd.damping),
            orientation_preservation: Some(from.pbd.orientation_preservation),
            smoothing: Some(from.pbd.smoothing),
            coarse_correction: Some(from.pbd.coarse_correction),
        },
    })
}

/// Milliseconds, 0 for no limit. A limit too large for a `Duration` counts as no limit.
fn time_budget(ms: f32) -> Outcome<Option<Duration>> {
    if !(ms >= 0.0 && ms.is_finite()) {
        let message = format!("options.time_budget_ms: {ms} is not a finite, non-negative number");
        return Err(Failure::argument(message));
    }
    Ok(Duration::try_from_secs_f32(ms / 1000.0).ok().filter(|_| ms > 0.0))
}

/// Solves every tile for a pose; returns when all are done. `positions` are the deformed positions of all vertices (3
/// components, as many and in the same order as at rest). `options` may be null: all defaults. On any error the last
/// good result stays readable.
///
/// The result is the same bit for bit for any number of threads, on any machine and in any floating-point mode, unless
/// options->warm or options->time_budget_ms is set. Charts whose inputs have not changed keep their result at no
/// cost, unless this solve or the last one is warm.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT, naming the field or the vertex, for null, a wrong
/// count, a short stride, a position that is not finite or an option out of range; VRTM_ERROR_CANCELLED;
/// VRTM_ERROR_BUSY; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_solve(
    asset: vrtm_asset,
    positions: *const vrtm_array,
    options: *const vrtm_solve_options,
) -> vrtm_status {
    guard("vrtm_asset_solve", || {
        let shared = handle::asset(asset)?;
        // SAFETY: the host's pointers, valid during the call.
        let (positions, wishes) =
            unsafe { (strided(positions, 3, "positions")?, Wishes::read(asset, options)?) };
        let request = wishes.request(positions);
        shared.claim()?.solve(&wishes.control, |asset| Ok(asset.run(&request, &mut [])?))
    })
}

/// Solves every tile for a pose and writes `count` outputs, in one call: all that a host's compute() needs for a frame.
/// Equivalent to vrtm_asset_solve followed by a vrtm_tile_fetch for each of `fetches`, except that all arguments are
/// checked before any work, and nothing else can use the asset in between. `fetches` may be null if `count` is 0. No
/// two images may write the same byte, but they may be interleaved, such as two pairs of channels of one image. No
/// image may overlap the memory that the positions span.
///
/// Errors: those of vrtm_asset_solve and vrtm_tile_fetch; VRTM_ERROR_INVALID_ARGUMENT for a tile of another asset and
/// for images that overlap. On an error no image is written, unless a GPU fails while the images are written.
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
        let (view, wishes) =
            unsafe { (strided_and_span(positions, 3, "positions")?, Wishes::read(asset, options)?) };
        let (positions, span) = view;
        // SAFETY: as above; `targets` checks that no two of the images write the same byte, and that none overlaps the
        // positions.
        let targets = unsafe { targets(asset, fetches, count, span) }?;
        let mut wanted = with_capacity(targets.len());
        for (name, tile, kind, target) in &targets {
            // SAFETY: the host vouches for the memory, and no other view shares it.
            wanted.put(Fetch { tile: *tile, kind: *kind, image: unsafe { target.view(name) }? });
        }
        let request = wishes.request(positions);
        shared.claim()?.solve(&wishes.control, |asset| Ok(asset.run(&request, &mut wanted)?))
    })
}

/// Cancels the solve of an asset that is in progress, whether another thread's call or a job: it soon gives
/// VRTM_ERROR_CANCELLED, and the last good result stays. A solve that already has its result is not cancelled. Does
/// nothing if no solve is in progress. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_cancel(asset: vrtm_asset) -> vrtm_status {
    guard("vrtm_asset_cancel", || {
        handle::asset(asset)?.cancel();
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_budget_of_zero_is_none_and_what_cannot_be_is_named() {
        let message = |outcome: Outcome<_>| match outcome {
            Err(failure) => failure.message,
            Ok(budget) => panic!("{budget:?}"),
        };
        assert_eq!(time_budget(0.0).unwrap(), None);
        assert_eq!(time_budget(2.0).unwrap(), Some(Duration::from_millis(2)));
        assert_eq!(time_budget(f32::MAX).unwrap(), None);
        for (ms, text) in [(-1.0, "-1"), (f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
            let expected = format!("options.time_budget_ms: {text} is not a finite, non-negative number");
            assert_eq!(message(time_budget(ms)), expected);
        }
    }
}
