use glam::DVec2;
use vrtm_core::grid::blocks::Block;
use vrtm_core::grid::gather::*;

#[test]
fn clipped_areas_add_up_to_the_triangle() {
    let corners = [[1.3, 2.1], [9.7, 3.2], [4.4, 11.9]].map(DVec2::from);
    let mut sum = 0.0;
    let block = Block { chart: 0, x: 0, y: 0, active: true };
    each_dual_cell(corners, &block, [10, 10], |i, j| {
        sum += area_in_box(corners, DUAL_SIDE * DVec2::new(i as f64, j as f64) - 1.0);
    });
    let exact: f64 = 0.5 * (8.4 * 9.8 - 1.1 * 3.1);
    assert!((sum - exact).abs() < 1e-9, "{sum} {exact}");
    let half_square = |side: f64| [DVec2::ZERO, side * DVec2::X, side * DVec2::Y];
    assert_eq!(area_in_box(half_square(20.0), DVec2::splat(1.0)), 4.0);
    assert_eq!(area_in_box(half_square(1.0), DVec2::splat(5.0)), 0.0);
}
