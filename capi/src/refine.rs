//! Refinements: meshes split until interpolated corner UVs are accurate.

use std::ops::Range;
use std::sync::{Arc, Mutex, TryLockError};

use super::desc::{self, sized};
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, Kind, Table, vrtm_asset, vrtm_refinement};
use super::mirror::mirror;
use super::status::{Failure, Outcome, VRTM_ERROR_BUSY, vrtm_status};
use vrtm::{Refinement, RefinementInfo, RefinementPattern, RefinementSettings};
use vrtm_core::panics::lock;

mirror! {
    settings vrtm_refinement_desc of s: RefinementSettings in "desc" {
        uv_set: u32, tolerance: f64, max_triangles: u64,
    }
}

mirror! {
    report vrtm_refinement_info of r: RefinementInfo {
        uv_set: u32, vertices: u64, faces: u64, corners: u64, triangles: u64, bytes: u64,
        tolerance: f64, error: f64, reached: u32, ms: f32,
    }
}

/// Destinations of the pattern of a refinement: the caller's arrays; null arrays are skipped. From the pattern
/// a host interpolates positions and all other values per vertex or corner. Start from
/// vrtm_refinement_pattern_init().
///
/// Each vertex and corner has three sources, with weights that add up to 1. If fewer are needed, the others repeat the
/// first source with weight 0.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_refinement_pattern {
    /// sizeof(vrtm_refinement_pattern); set by vrtm_refinement_pattern_init().
    pub struct_size: u32,
    /// vrtm_refinement_info.vertices: the room in the arrays by vertex.
    pub vertex_count: usize,
    /// vrtm_refinement_info.faces: the room in the arrays by face.
    pub face_count: usize,
    /// vrtm_refinement_info.corners: the room in the arrays by corner.
    pub corner_count: usize,
    /// Three per vertex: vertices of the mesh. The mesh's own vertices come first, in their original order, each its
    /// own source.
    pub vertex_sources: *mut u32,
    /// Three per vertex: the weights of `vertex_sources`.
    pub vertex_weights: *mut f32,
    /// One per face: the face of the mesh that contains it. Faces are sorted by the mesh's faces.
    pub face_sources: *mut u32,
    /// One per face: its number of corners. 3 for a part of a face; an unsplit face keeps its number of corners.
    pub face_corners: *mut u32,
    /// One per corner: the index of its vertex.
    pub corner_vertices: *mut u32,
    /// Three per corner: corners of the mesh that form the triangle containing it.
    pub corner_sources: *mut u32,
    /// Three per corner: the weights of `corner_sources`.
    pub corner_weights: *mut f32,
    /// Two per corner: its original UV in the set, with the tile's offset: the weighted sum of its sources' UVs.
    pub corner_uvs: *mut f32,
}

// SAFETY: repr(C), struct_size first, plain numbers and raw pointers.
sized!(vrtm_refinement_pattern);

/// A refinement shared by threads: readers get the present version, even while another thread extends it.
#[derive(Debug)]
pub(super) struct SharedRefinement {
    present: Mutex<Arc<Refinement>>,
    /// Locked by the call that extends it.
    extending: Mutex<()>,
}

impl SharedRefinement {
    fn present(&self) -> Arc<Refinement> {
        lock(&self.present).clone()
    }

    fn extend(&self) -> Outcome<()> {
        let turn = self.extending.try_lock();
        if let Err(TryLockError::WouldBlock) = turn {
            return Err(Failure::new(VRTM_ERROR_BUSY, "refinement: another call is extending it"));
        }
        let mut next = (*self.present()).clone();
        next.extend()?;
        let next = Arc::new(next);
        // The old version is dropped after the lock is released.
        let _old = std::mem::replace(&mut *lock(&self.present), next);
        Ok(())
    }
}

static REFINEMENTS: Table<SharedRefinement> = Table::new(Kind::Refinement, "refinement");

/// Refines the mesh of an asset for its last result, for hosts that support only UV sets. Where the mesh is coarser
/// than the painted detail, its own corner UVs recover less than the map, since a renderer interpolates linearly
/// between corners. Here triangles are split until the interpolated UV is nowhere farther from the redirection than the
/// tolerance.
///
/// Edges are split at their midpoints, in all faces that share them, also across seams and chart borders: no cracks
/// open, and no angle gets much smaller than half of the mesh's smallest one. A face that needs no split stays
/// unchanged; a quadrilateral stays whole only if it keeps the tolerance along either diagonal. Where nothing moves,
/// nothing is split. The pattern depends only on the result and on `desc`. `desc` may be null: the defaults.
///
/// The caller destroys `*refinement`. It keeps the data that it needs alive, including the mesh and the last result,
/// and may be used after the asset is destroyed. Never busy: it reads the last good result, even during a solve.
///
/// Errors: VRTM_ERROR_NOT_SOLVED before the first solve.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_create(
    asset: vrtm_asset,
    desc: *const vrtm_refinement_desc,
    refinement: *mut vrtm_refinement,
) -> vrtm_status {
    guard_value("vrtm_refinement_create", refinement, "refinement", || {
        let asset = handle::asset(asset)?;
        // SAFETY: the host's pointer.
        let desc: vrtm_refinement_desc = unsafe { desc::read_or_default(desc, "desc") }?;
        let settings = desc.settings()?;
        let present = Mutex::new(Arc::new(asset.results.refine(&settings)?));
        let shared = SharedRefinement { present, extending: Mutex::default() };
        Ok(vrtm_refinement { id: REFINEMENTS.add(shared)? })
    })
}

/// Refines further, for the asset's last result. Existing splits stay: a refinement that was extended for each frame
/// of a shot has one topology for all frames. Vertices keep their numbers, and new ones are appended; faces and
/// corners are renumbered. vrtm_refinement_get_info gives the new sizes. To keep the tolerance in all frames, repeat
/// the pass over the frames until the number of triangles no longer changes: a split for one frame may push another
/// slightly over the tolerance.
///
/// Errors: VRTM_ERROR_BUSY while another call extends the same refinement. On any error the refinement is as it was.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_extend(refinement: vrtm_refinement) -> vrtm_status {
    guard("vrtm_refinement_extend", || REFINEMENTS.get("refinement", refinement.id)?.extend())
}

/// Gets the sizes and the accuracy of a refinement. Never busy.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_get_info(
    refinement: vrtm_refinement,
    info: *mut vrtm_refinement_info,
) -> vrtm_status {
    guard_struct("vrtm_refinement_get_info", info, "info", || {
        Ok(REFINEMENTS.get("refinement", refinement.id)?.present().info().into())
    })
}

/// Writes the pattern into the caller's arrays. It changes only when the refinement is extended. Never busy.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT if two arrays overlap.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_fetch_pattern(
    refinement: vrtm_refinement,
    pattern: *const vrtm_refinement_pattern,
) -> vrtm_status {
    guard("vrtm_refinement_fetch_pattern", || {
        let refinement = REFINEMENTS.get("refinement", refinement.id)?.present();
        // SAFETY: the host's pointer.
        let p = unsafe { desc::read(pattern, "pattern") }?;
        let info = refinement.info();
        let counts = [
            ("vertex_count", p.vertex_count, info.vertices, "vertices"),
            ("face_count", p.face_count, info.faces, "faces"),
            ("corner_count", p.corner_count, info.corners, "corners"),
        ];
        for (name, given, needed, of) in counts {
            ensure!(
                given as u64 == needed,
                "pattern.{name} is {given}, but the refinement has {needed} {of}"
            );
        }
        let (vertices, faces, corners) = (p.vertex_count, p.face_count, p.corner_count);
        let mut spans = Spans::default();
        // SAFETY: the host vouches for arrays of these sizes; `Spans` checks that they are apart.
        let mut pattern = unsafe {
            RefinementPattern {
                vertex_sources: spans.array(p.vertex_sources.cast(), vertices, "vertex_sources")?,
                vertex_weights: spans.array(p.vertex_weights.cast(), vertices, "vertex_weights")?,
                face_sources: spans.array(p.face_sources, faces, "face_sources")?,
                face_counts: spans.array(p.face_corners, faces, "face_corners")?,
                corner_vertices: spans.array(p.corner_vertices, corners, "corner_vertices")?,
                corner_sources: spans.array(p.corner_sources.cast(), corners, "corner_sources")?,
                corner_weights: spans.array(p.corner_weights.cast(), corners, "corner_weights")?,
                corner_uvs: spans.array(p.corner_uvs.cast(), corners, "corner_uvs")?,
            }
        };
        Ok(refinement.pattern(&mut pattern)?)
    })
}

/// Names and addresses of the output arrays, which must not overlap.
#[derive(Default)]
struct Spans([(&'static str, Range<usize>); 8], usize);

impl Spans {
    /// An array of the host's, unless it is null.
    unsafe fn array<'a, T: Copy>(
        &mut self,
        pointer: *mut T,
        count: usize,
        name: &'static str,
    ) -> Outcome<Option<&'a mut [T]>> {
        if pointer.is_null() {
            return Ok(None);
        }
        let bytes = count.saturating_mul(size_of::<T>());
        let span = pointer.addr()..pointer.addr().saturating_add(bytes);
        for (other, taken) in &self.0[..self.1] {
            ensure!(
                span.start >= taken.end || taken.start >= span.end,
                "pattern.{other} and pattern.{name} overlap in memory"
            );
        }
        (self.0[self.1], self.1) = ((name, span), self.1 + 1);
        // SAFETY: passed on; no other array of this call overlaps this one.
        unsafe { desc::slice_mut(pointer, count, &format!("pattern.{name}")) }.map(Some)
    }
}

/// Writes the redirected UV of every corner of the refined mesh in the asset's last result: `count` pairs (u, v), with
/// the tile's offset added as in the mesh's own UVs; 0, 0 at corners of faces without UVs. Call it after each frame's
/// solve. At corners of the mesh the UVs equal those of vrtm_asset_fetch_corner_uvs bit for bit. `count` is the
/// number of corners, vrtm_refinement_info.corners; `uvs` has room for 2 * count floats. Never busy.
///
/// For a pose that the refinement was not created or extended for, the error may exceed the tolerance.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_fetch_corner_uvs(
    refinement: vrtm_refinement,
    uvs: *mut f32,
    count: usize,
) -> vrtm_status {
    guard("vrtm_refinement_fetch_corner_uvs", || {
        let refinement = REFINEMENTS.get("refinement", refinement.id)?.present();
        let corners = refinement.info().corners;
        ensure!(count as u64 == corners, "count is {count}, but the refinement has {corners} corners");
        // SAFETY: the host vouches for `count` pairs during the call.
        let out = unsafe { desc::slice_mut(uvs.cast::<[f32; 2]>(), count, "uvs") }?;
        Ok(refinement.corner_uvs(out)?)
    })
}

/// Destroys a refinement. Calls that are using it run to their end; the memory is freed afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_refinement_destroy(refinement: vrtm_refinement) -> vrtm_status {
    guard("vrtm_refinement_destroy", || REFINEMENTS.remove(refinement.id).map(drop))
}
