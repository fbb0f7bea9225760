use glam::DVec2;
use half::f16;
use vrtm_core::mesh::gaps::*;

#[test]
fn rounding_is_no_gap() {
    let apart = |a: f64, b: f64| are_apart(DVec2::new(a, 0.3), DVec2::new(b, 0.3));
    assert!(!apart(0.7, 0.7 + 1.0 / 65535.0));
    assert!(apart(0.7, 0.7 + 1.0 / 4096.0));
    // Half floats, and 1 minus half floats.
    let half = |x: f64| f16::from_f64(x).to_f64();
    assert!(!apart(half(0.7), half(0.7) + 1.0 / 2048.0));
    assert!(!apart(1.0 - half(0.2), 1.0 - half(0.2) - 1.0 / 8192.0));
    assert!(apart(half(0.3), half(0.3) + 2.0 / 4096.0));
}
