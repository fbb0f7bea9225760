//! Host arrays -> validated mesh: triangles, UV corners, tiles, charts.

use crate::view::Strided;

/// A host's face-varying UVs.
#[derive(Clone, Copy, Debug)]
pub struct UvSource<'a> {
    /// u of each UV; for interleaved pairs the view has two components and `v` is `None`.
    pub u: Strided<'a>,
    /// v of each UV, where it comes as an array of its own (same length as `u`).
    pub v: Option<Strided<'a>>,
    /// UV of each face corner; `None` = one UV per corner, in corner order.
    pub indices: Option<&'a [u32]>,
}

/// A host's mesh at rest.
#[derive(Clone, Copy, Debug)]
pub struct MeshSource<'a> {
    /// Rest positions, three components, f32 or f64.
    pub positions: Strided<'a>,
    /// Corners per face, each >= 3; `None` = all triangles.
    pub face_counts: Option<&'a [u32]>,
    /// Vertex of each face corner.
    pub indices: &'a [u32],
    /// UVs of the face corners. v points up; UDIM tile = 1001 + floor(u) + 10 floor(v).
    pub uvs: UvSource<'a>,
}
