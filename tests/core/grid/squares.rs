use glam::DVec2;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::SIDE;
use vrtm_core::grid::squares::*;

/// Squares whose windows hold one of many points of the triangle.
fn sampled(corners: [DVec2; 3], n: usize) -> Vec<(u32, u32)> {
    let mut found = Vec::new();
    for i in 0..=400 {
        for j in 0..=400 - i {
            let p = corners[0]
                + (corners[1] - corners[0]) * (i as f64 / 400.0)
                + (corners[2] - corners[0]) * (j as f64 / 400.0);
            for y in 0..=n / SIDE {
                for x in 0..=n / SIDE {
                    let origin = DVec2::new((x * SIDE) as f64, (y * SIDE) as f64) - 1.0;
                    let d = p - origin;
                    if d.min_element() >= 0.0 && d.max_element() <= 17.0 {
                        found.push((x as u32, y as u32));
                    }
                }
            }
        }
    }
    found.sort_unstable();
    found.dedup();
    found
}

#[test]
fn the_squares_of_a_triangle_are_those_that_it_meets() {
    let cases = [
        [[3.0, 4.0], [70.0, 9.0], [20.0, 75.0]],
        [[-30.0, 10.0], [50.0, 20.0], [10.0, 60.0]],
        [[5.0, 5.0], [6.0, 5.0], [5.5, 6.0]],
        [[15.5, 15.5], [17.0, 31.0], [15.2, 47.0]],
        [[0.0, 0.0], [79.0, 79.0], [79.0, 78.0]],
    ];
    for corners in cases {
        let corners = corners.map(DVec2::from);
        for corners in [corners, [corners[0], corners[2], corners[1]]] {
            let mut listed = Vec::new();
            each_square(corners, [[0, 0], [4, 4]], [DVec2::ONE, DVec2::ZERO], |x, y| listed.push((x, y)));
            listed.sort_unstable();
            let needed = sampled(corners, 64);
            assert!(needed.iter().all(|square| listed.contains(square)), "{corners:?}");
            assert!(listed.len() <= needed.len() + 3, "{corners:?}: {listed:?} {needed:?}");
        }
    }
}
