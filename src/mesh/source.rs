//! A host's mesh, as it is handed over.

use crate::error::{Error, Result};
use crate::view::Strided;

/// A host's face-varying UVs.
#[derive(Clone, Copy, Debug, Default)]
pub struct UvSource<'a> {
    /// u of each UV; for interleaved pairs the view has two components and `v` is `None`.
    pub u: Strided<'a>,
    /// v of each UV, where it comes as an array of its own (same length as `u`).
    pub v: Option<Strided<'a>>,
    /// Index of each face corner's UV; `None` = one UV per corner, in corner order. A face all of whose corners have
    /// `u32::MAX` has no texture: it belongs to no tile, and its corners keep their places in the order.
    pub indices: Option<&'a [u32]>,
}

/// A host's mesh at rest. What is not needed is left to [`MeshSource::default`].
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshSource<'a> {
    /// Rest positions, three components, f32 or f64.
    pub positions: Strided<'a>,
    /// Corners per face; `None` = all triangles, unless there are `face_offsets`. Faces with fewer than three corners
    /// (points, lines) are skipped and counted; their corners keep their places in the order.
    pub face_counts: Option<&'a [u32]>,
    /// In place of `face_counts`: the first corner of each face, and at the end the number of all corners, so that face
    /// f has the corners `face_offsets[f]..face_offsets[f + 1]`.
    pub face_offsets: Option<&'a [u32]>,
    /// Index of each face corner's vertex.
    pub indices: &'a [u32],
    /// UVs of the face corners: set 0. v points up; UDIM tile = 1001 + floor(u) + 10 floor(v).
    pub uvs: UvSource<'a>,
    /// Further UV sets, from set 1 on. Each has tiles of its own, which follow those of the set before it.
    pub uv_sets: &'a [UvSource<'a>],
    /// Edges at which charts end in all UV sets, each as its two vertices. A pair that is no edge of a face does
    /// nothing, and is counted.
    pub seams: &'a [[u32; 2]],
    /// The faces that carry the texture, in any order; `None` = all. The others have none, as if they had no UVs.
    pub textured_faces: Option<&'a [u32]>,
    /// Which corners of faces count as one.
    pub weld: Weld,
}

/// By what two corners of different faces are recognised as one, so that charts go on across the edges between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum WeldBy {
    /// The same vertex, and UVs within the tolerance. The host's vertices say what hangs together: what is cut in the
    /// modelling program is cut here, lips that are closed at rest included, and no pose changes that.
    #[default]
    Index,
    /// Also different vertices whose rest positions lie within the tolerance: for meshes out of games, where vertices
    /// are doubled along hard edges and seams. Where a pose pulls such vertices apart, the charts end there in this pose
    /// ([`crate::TileReport::welds_torn`]): by more than ten times the tolerance, along an axis, plus 8 times the
    /// positions' epsilon (2^-23 for f32, 2^-52 for f64) of the largest magnitude of their coordinates in the pose.
    Position,
    /// The same vertex, and exactly the same UV.
    Off,
}

/// Which corners of faces count as one UV corner (method §1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weld {
    /// By vertex, by position, or not at all.
    pub by: WeldBy,
    /// Largest distance of welded vertices at rest, as a fraction of the longest side of the mesh's bounding box, 0..1;
    /// `None` = 1e-5. Unless it is 0, the positions' epsilon (2^-23 for f32, 2^-52 for f64) times the largest magnitude
    /// of a coordinate at rest is added. A vertex has at most a quarter of its shortest edge. Speaks to
    /// [`WeldBy::Position`] alone.
    pub position_tolerance: Option<f64>,
    /// Largest difference of welded UVs in u and in v, 0..1; `None` = 1/2048, half a texel of a map of 1024, and the
    /// step of half floats under 1. Corners of small triangles have less: a quarter of the least height in UV of the
    /// triangles at the vertex.
    pub uv_tolerance: Option<f64>,
}

/// [`Weld::position_tolerance`], unless given.
pub(crate) const POSITION_TOLERANCE: f64 = 1e-5;
/// [`Weld::uv_tolerance`], unless given.
pub(crate) const UV_TOLERANCE: f64 = 1.0 / 2048.0;

impl Weld {
    pub(super) fn check(&self) -> Result<()> {
        let tolerances =
            [("position_tolerance", self.position_tolerance), ("uv_tolerance", self.uv_tolerance)];
        for (name, tolerance) in tolerances {
            if let Some(x) = tolerance.filter(|x| !(0.0..=1.0).contains(x)) {
                return Err(Error::argument(format!("weld.{name}: {x} is not in 0..=1")));
            }
        }
        Ok(())
    }

    /// As a fraction of the mesh's extent.
    pub(super) fn of_positions(&self) -> f64 {
        self.position_tolerance.unwrap_or(POSITION_TOLERANCE)
    }

    /// In UV; 0 if UVs have to be equal.
    pub(super) fn of_uvs(&self) -> f64 {
        if self.by == WeldBy::Off { 0.0 } else { self.uv_tolerance.unwrap_or(UV_TOLERANCE) }
    }
}
