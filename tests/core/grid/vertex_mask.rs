use glam::{DVec2, DVec3};
use vrtm_core::grid::vertex_mask::*;

#[test]
fn the_darkest_place_of_a_triangle_near_a_point_is_found() {
    // The mask grows along x, from 0 at x = 0 to 1 at x = 10.
    let corners = [DVec3::new(0.0, 0.0, 0.0), DVec3::new(10.0, 0.0, 1.0), DVec3::new(0.0, 10.0, 0.0)];
    let at = |x: f64, y: f64| darkest(&corners, DVec2::new(x, y));
    assert!((at(3.0, 3.0) - 0.25).abs() < 1e-12);
    assert!((at(0.0, 0.0) - 0.0).abs() < 1e-12);
    // Near the long side, where part of the square is outside.
    assert!((at(5.0, 5.0) - 0.45).abs() < 1e-12);
    // The triangle ends beyond the square's corner, at it, or before it.
    assert!((at(5.25, 5.25) - 0.475).abs() < 1e-12);
    assert!((at(5.5, 5.5) - 0.5).abs() < 1e-12);
    assert_eq!(at(5.6, 5.6), f64::INFINITY);
    assert_eq!(at(-0.6, 3.0), f64::INFINITY);
    // A triangle inside the square.
    let small = corners.map(|p| p * DVec3::new(0.01, 0.01, 1.0) + DVec3::new(4.0, 4.0, 0.25));
    assert_eq!(darkest(&small, DVec2::new(4.0, 4.0)), 0.25);
}

#[test]
#[cfg_attr(miri, ignore = "too long, and safe code")]
fn it_is_that_of_many_points_of_the_triangle() {
    let mut state = 1u64;
    let mut random = || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 40) as f64 / (1u64 << 24) as f64
    };
    let mut met = 0;
    for _ in 0..200 {
        let corners = [0; 3].map(|_| DVec3::new(4.0 * random() - 2.0, 4.0 * random() - 2.0, random()));
        let found = darkest(&corners, DVec2::ZERO);
        const N: usize = 400;
        let mut least = f64::INFINITY;
        for a in 0..=N {
            for b in 0..=N - a {
                let weights = DVec3::new(a as f64, b as f64, (N - a - b) as f64) / N as f64;
                let p = corners[0] * weights.x + corners[1] * weights.y + corners[2] * weights.z;
                if p.x.abs().max(p.y.abs()) <= 0.5 {
                    least = least.min(p.z);
                }
            }
        }
        assert!(least >= found - 1e-12, "{corners:?}: {least} is under {found}");
        if least < f64::INFINITY {
            met += 1;
            // Neighbouring points differ by at most 1 / N of the mask's range of 1, and the corners of the polygon
            // that the square cuts out may lie between points. Thin triangles are exempt, since few points lie in
            // them.
            let area = (corners[1] - corners[0]).truncate().perp_dot((corners[2] - corners[0]).truncate());
            assert!(area.abs() < 0.5 || least - found < 0.05, "{corners:?}: {least} against {found}");
        }
    }
    assert!(met > 50, "{met}");
}
