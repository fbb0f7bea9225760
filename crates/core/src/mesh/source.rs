//! The mesh that a host supplies.

use crate::declare;
use crate::error::Result;
use crate::view::Strided;

/// A host's face-varying UVs.
#[derive(Clone, Copy, Debug, Default)]
pub struct UvSource<'a> {
    /// u of each UV; for interleaved pairs the view has two components and `v` is `None`.
    pub u: Strided<'a>,
    /// v of each UV, if it is a separate array (same length as `u`).
    pub v: Option<Strided<'a>>,
    /// Index of each face corner's UV; `None` = one UV per corner, in corner order. A face whose corners all have
    /// `u32::MAX` has no texture: it belongs to no tile, and its corners keep their places in the order.
    pub indices: Option<&'a [u32]>,
}

/// A host's mesh at rest. Unused fields are left to [`MeshSource::default`].
#[derive(Clone, Copy, Debug, Default)]
pub struct MeshSource<'a> {
    /// Rest positions, three components, f32 or f64.
    pub positions: Strided<'a>,
    /// Corners per face; `None` = all triangles, unless `face_offsets` is given. Faces with fewer than three corners
    /// (points, lines) are skipped and counted; their corners keep their places in the order.
    pub face_counts: Option<&'a [u32]>,
    /// Instead of `face_counts`: the first corner of each face, followed by the number of all corners, so that face f
    /// has the corners `face_offsets[f]..face_offsets[f + 1]`.
    pub face_offsets: Option<&'a [u32]>,
    /// Index of each face corner's vertex.
    pub indices: &'a [u32],
    /// UVs of the face corners: set 0. v points up; UDIM tile = 1001 + floor(u) + 10 floor(v).
    pub uvs: UvSource<'a>,
    /// Further UV sets, from set 1 on. Each has its own tiles, which follow those of the previous set.
    pub uv_sets: &'a [UvSource<'a>],
    /// Edges at which charts end in all UV sets, each as its two vertices. A pair that is not an edge of any face has
    /// no effect, and is counted.
    pub seams: &'a [[u32; 2]],
    /// The faces that carry the texture, in any order; `None` = all. All others count as faces without UVs.
    pub textured_faces: Option<&'a [u32]>,
    /// Rules by which corners of faces are welded.
    pub weld: Weld,
    /// The largest number of layers of a UDIM tile, in all UV sets. Up to 1, its charts are one tile, wherever they
    /// lie. Otherwise charts that lie over others, by more than a border, come into layers of their own, each of which
    /// is a tile: a chart goes into the first layer where nothing lies under it, the charts of the first faces first.
    /// Charts for which there is no such layer are left in the last one.
    pub max_layers: u32,
}

/// Rule by which two corners of different faces are one, so that charts continue across the edges between them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum WeldBy {
    /// The same vertex, and UVs within the tolerance. The host's vertices define what is connected: cuts made in the
    /// modelling program stay cuts, even lips that are closed at rest, and no pose changes that.
    #[default]
    Index,
    /// Also different vertices whose rest positions lie within the tolerance: for meshes from games, where vertices are
    /// duplicated along hard edges and seams. Where a pose pulls such vertices apart, the charts end there in this pose
    /// ([`crate::TileReport::welds_torn`]): by more than ten times the tolerance, along an axis, plus 8 times the
    /// positions' epsilon (2^-23 for f32, 2^-52 for f64) times the largest magnitude of their coordinates in the pose.
    Position,
    /// The same vertex, and exactly the same UV.
    Off,
}

/// Settings for welding corners of faces to one UV corner (method §1).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Weld {
    /// By vertex, by position, or not at all.
    pub by: WeldBy,
    /// Largest distance of welded vertices at rest, as a fraction of the longest side of the mesh's bounding box, 0..1;
    /// `None` = 1e-5. Unless it is 0, the positions' epsilon (2^-23 for f32, 2^-52 for f64) times the largest magnitude
    /// of a coordinate at rest is added. For each vertex it is limited to a quarter of its shortest edge. Applies to
    /// [`WeldBy::Position`] only.
    pub position_tolerance: Option<f64>,
    /// Largest difference of welded UVs in u and in v, 0..1; `None` = 1/2048, half a texel of a map of 1024, and the
    /// step of half floats under 1. For corners of small triangles it is limited to a quarter of the least height in UV
    /// of the triangles at the vertex. Welded corners have the mean of their UVs. Nodes do not move beside a slit that
    /// this closes: one wider than 1/8192 (or a step of half floats), unless all edges beside it are apart, by noise of
    /// the UVs.
    pub uv_tolerance: Option<f64>,
}

/// Default of [`Weld::position_tolerance`].
pub const POSITION_TOLERANCE: f64 = 1e-5;
/// Default of [`Weld::uv_tolerance`].
pub const UV_TOLERANCE: f64 = 1.0 / 2048.0;

impl Weld {
    pub(super) fn check(&self) -> Result<()> {
        let tolerances =
            [("position_tolerance", self.position_tolerance), ("uv_tolerance", self.uv_tolerance)];
        for (name, tolerance) in tolerances {
            if let Some(x) = tolerance {
                declare::check(&format!("weld.{name}"), &x, &(0.0..=1.0))?;
            }
        }
        Ok(())
    }

    /// The position tolerance, as a fraction of the mesh's extent.
    pub(super) fn of_positions(&self) -> f64 {
        self.position_tolerance.unwrap_or(POSITION_TOLERANCE)
    }

    /// The UV tolerance; 0 if UVs must be equal.
    pub(super) fn of_uvs(&self) -> f64 {
        if self.by == WeldBy::Off { 0.0 } else { self.uv_tolerance.unwrap_or(UV_TOLERANCE) }
    }
}
