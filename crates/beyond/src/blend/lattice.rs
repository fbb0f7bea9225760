//! Points in the plane of a chart.

use glam::DVec2;

use vrtm_core::grid::Level;

/// Cells along u and v.
pub(super) fn cells(level: &Level) -> DVec2 {
    DVec2::new(level.nx as f64, level.ny as f64)
}

/// The point of a triangle with barycentric coordinates of corners 1 and 2.
pub(super) fn point([a, b, c]: [DVec2; 3], [s, t]: [f64; 2]) -> DVec2 {
    a + s * (b - a) + t * (c - a)
}
