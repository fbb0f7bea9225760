use glam::DVec2;

use super::batch::{BATCH, Batch};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::fill::Fill;

const REST: [f64; 2] = [3.0, 5.0];
/// Texels on a side.
const TEXELS: usize = 8;

/// A texel and W⁻¹ at its centre.
type Found = ([usize; 2], [f64; 2]);

/// W⁻¹ at the texel centres that a warped cell covers.
fn covered(corners: [[f64; 2]; 4]) -> Vec<Found> {
    let mut found = Vec::new();
    let mut batch = Batch::new();
    for n in 0..TEXELS * TEXELS {
        batch.push([n % TEXELS, n / TEXELS], REST, &corners, false);
        if batch.len == BATCH {
            batch.flush(0, |x, y, inverse| found.push(([x, y], inverse.point())));
        }
    }
    found
}

/// The same, one triangle after the other by the rule that also covers the grid; of two layers the last one counts.
fn covered_by_triangles(corners: [[f64; 2]; 4]) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    let corners = corners.map(DVec2::from);
    let rest = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|at| DVec2::from(REST) + DVec2::from(at));
    for triangle in [[0, 1, 2], [0, 2, 3]] {
        let ([a, b, c], rest) = (triangle.map(|k| corners[k]), triangle.map(|k| rest[k]));
        let (e1, e2) = (b - a, c - a);
        if e1.perp_dot(e2) == 0.0 {
            continue;
        }
        let inverse = 1.0 / e1.perp_dot(e2);
        Fill::new([a, b, c]).visit_in([0; 2], [TEXELS; 2], |x, y, inside| {
            let d = DVec2::new(x as f64, y as f64) - a;
            let l1 = (d.perp_dot(e2) * inverse).clamp(0.0, 1.0);
            let l2 = (e1.perp_dot(d) * inverse).clamp(0.0, 1.0 - l1);
            if inside {
                found.retain(|other| other.0 != [x, y]);
                found.push(([x, y], (rest[0] + l1 * (rest[1] - rest[0]) + l2 * (rest[2] - rest[0])).into()));
            }
        });
    }
    found.sort_unstable_by_key(|found| (found.0[1], found.0[0]));
    found
}

/// Numbers between 0 and 1.
fn random(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
    (*seed >> 11) as f64 / (1u64 << 53) as f64
}

#[test]
#[cfg_attr(miri, ignore = "too long, and safe code")]
fn a_cell_covers_what_its_triangles_cover() {
    let mut seed = 1;
    let (mut texels, mut folded) = (0, 0);
    for k in 0..20_000 {
        // Corners on and off texel centres, of cells that may be folded.
        let size = [0.6, 2.0, 5.0][k % 3];
        let base = [0, 1].map(|_| 7.0 * random(&mut seed) - 1.0);
        let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|at| {
            let p = [0, 1].map(|c| base[c] + size * (at[c] + 1.4 * (random(&mut seed) - 0.5)));
            if k % 5 == 0 { p.map(f64::round) } else { p }
        });
        let found = covered(corners);
        assert_eq!(found, covered_by_triangles(corners), "{corners:?}");
        let [a, b, c, d] = corners.map(DVec2::from);
        folded += usize::from((b - a).perp_dot(c - a) < 0.0 || (c - a).perp_dot(d - a) < 0.0);
        texels += found.len();
    }
    assert!(texels > 50_000 && folded > 1_000, "{texels} {folded}");
}

#[test]
fn a_triangle_without_area_covers_nothing() {
    assert_eq!(covered([[2.0, 2.0]; 4]), []);
    assert_eq!(covered([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0], [1.0, 1.0]]), []);
    assert_eq!(covered([[1.5, 1.5], [2.5, 1.5], [2.5, 2.5], [1.5, 2.5]]).len(), 1);
}

/// Slivers through a texel centre have coordinates with few significant digits.
#[test]
#[cfg_attr(miri, ignore = "too long, and safe code")]
fn a_sliver_keeps_its_texels_within_the_cell() {
    let mut count = 0;
    for k in 0..2000 {
        let tiny = 4.5e-16 * f64::from(k % 50);
        let along = f64::from(k) * 1e-3;
        let low = [2.0 - along, 2.0 - along];
        let corners = [low, [3.0 + along, 3.0 + along + tiny], [2.0, 2.0 - 3.0 * tiny], low];
        for (_, p) in covered(corners) {
            count += 1;
            assert!((3.0..=4.0).contains(&p[0]) && (5.0..=6.0).contains(&p[1]), "{corners:?} {p:?}");
        }
    }
    assert!(count > 100, "{count}");
}
