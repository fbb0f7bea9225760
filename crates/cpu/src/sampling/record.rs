//! The record of a triangle that kernels read: its UV geometry and its pose in one cache line. Each half is loaded as
//! one vector.

use vrtm_core::allocation::Plain;
use vrtm_core::grid::pose::PoseTriangle;
use vrtm_core::grid::uv_triangle::UvTriangle;

/// A triangle's UVs and pose.
///
/// First half: UV origin (2), rows of the barycentric matrix (4), x and y of the pose origin. Second half: z of the
/// pose origin, ∂f/∂x (3), ∂f/∂y (3), padding (1).
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(64))]
pub struct TriangleRecord {
    pub halves: [[f32; 8]; 2],
}

// SAFETY: all fields are f32, sixteen in total.
unsafe impl Plain for TriangleRecord {}

impl TriangleRecord {
    pub fn new(uv: &UvTriangle, pose: &PoseTriangle) -> TriangleRecord {
        let ([ox, oy], [[a, b], [c, d]]) = (uv.origin, uv.barycentric);
        let [px, py, pz] = pose.origin;
        let [[x0, x1, x2], [y0, y1, y2]] = pose.tangent;
        TriangleRecord { halves: [[ox, oy, a, b, c, d, px, py], [pz, x0, x1, x2, y0, y1, y2, 0.0]] }
    }

    /// The first UV corner, in cells.
    #[inline(always)]
    pub fn uv_origin(&self) -> [f32; 2] {
        let [x, y, ..] = self.halves[0];
        [x, y]
    }

    /// Barycentric coordinates of the point at the offset d from the first UV corner.
    #[inline(always)]
    pub fn barycentrics(&self, d: [f32; 2]) -> [f32; 3] {
        let [_, _, a, b, c, e, ..] = self.halves[0];
        let (l1, l2) = (a * d[0] + b * d[1], c * d[0] + e * d[1]);
        [1.0 - l1 - l2, l1, l2]
    }
}
