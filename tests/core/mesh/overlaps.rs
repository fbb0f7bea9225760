use glam::DVec2;
use vrtm_core::mesh::overlaps::*;

#[test]
fn triangles_overlap_by_area_alone() {
    let at = |x: f64, y: f64| [[x, y], [x + 0.1, y], [x, y + 0.1]].map(DVec2::from);
    let flipped = [[0.3, 0.3], [0.3, 0.2], [0.2, 0.3]].map(DVec2::from);
    let all = Overlaps::of([at(0.2, 0.2), at(0.5, 0.5), at(0.9, 0.1)].into_iter().collect());
    // Two halves of a square, and triangles that touch at a corner.
    assert!(!all.any(flipped, |_| true));
    assert!(!all.any(at(0.3, 0.2), |_| true));
    assert!(all.any(at(0.25, 0.21), |_| true));
    assert!(!all.any(at(0.25, 0.21), |t| t != 0));
    assert!(all.any(at(0.5, 0.5), |t| t == 1));
}
