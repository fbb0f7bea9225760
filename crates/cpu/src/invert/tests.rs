use std::cell::RefCell;

use glam::DVec2;

use super::cells::{Cells, FOUND, Spans, Texel};
use crate::lanes::{LANES, Lanes, Vectorised, dispatch, forced};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::fill::Fill;

/// Texels on a side.
const TEXELS: usize = 8;

type Corners = [[f64; 2]; 4];

/// A texel and W⁻¹ at its centre.
type Found = ([u32; 2], [f64; 2]);

/// The first node of cell `n`.
fn rest(n: usize) -> [f64; 2] {
    [(3 * n) as f64, 5.0]
}

/// W⁻¹ at the texel centres that each of eight warped cells covers.
struct Covered([Corners; LANES]);

impl Vectorised for Covered {
    type Output = [Vec<Found>; LANES];

    #[inline(always)]
    fn run<V: Lanes>(self) -> [Vec<Found>; LANES] {
        let mut cells = Cells::default();
        for n in 0..LANES {
            for c in 0..2 {
                cells.node[c][n] = rest(n)[c];
                (0..4).for_each(|k| cells.corners[k][c][n] = self.0[n][k][c]);
            }
        }
        cells.complete();
        let last = TEXELS as f32 - 1.0;
        let part = [[0.0, last.into()]; 2];
        let spans =
            Spans { origin: [1.0, -2.0], part, first: [[-1.0; LANES]; 2], last: [[last + 3.0; LANES]; 2] };
        let found = RefCell::new(std::array::from_fn(|_| Vec::new()));
        cells.locate(0, u8::MAX, &spans, &mut [Texel::default(); FOUND], &|of| {
            for texel in of.texels {
                found.borrow_mut()[texel.point[0] as usize / 3].push((texel.at, texel.point));
            }
        });
        found.into_inner()
    }
}

/// The same, one triangle after the other by the rule that also covers the grid; of two layers the last one counts.
fn covered_by_triangles(n: usize, corners: Corners) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    let corners = corners.map(DVec2::from);
    let rest =
        [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|at| DVec2::from(rest(n)) + DVec2::from(at));
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
                let texel = [x as u32, y as u32];
                found.retain(|other| other.0 != texel);
                found.push((texel, (rest[0] + l1 * (rest[1] - rest[0]) + l2 * (rest[2] - rest[0])).into()));
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
    for k in 0..2500 {
        let cells = [0, 1, 2, 3, 4, 5, 6, 7].map(|n| {
            // Corners on and off texel centres, of cells that may be folded.
            let size = [0.6, 2.0, 5.0][(k + n) % 3];
            let base = [0, 1].map(|_| 7.0 * random(&mut seed) - 1.0);
            [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|at| {
                let p = [0, 1].map(|c| base[c] + size * (at[c] + 1.4 * (random(&mut seed) - 0.5)));
                if (k + n) % 5 == 0 { p.map(f64::round) } else { p }
            })
        });
        let level = forced::LEVELS[k % forced::LEVELS.len()];
        let found = forced::at_most(level, || dispatch(Covered(cells)));
        for (n, (found, corners)) in found.into_iter().zip(cells).enumerate() {
            assert_eq!(found, covered_by_triangles(n, corners), "{level:?} {corners:?}");
            let [a, b, c, d] = corners.map(DVec2::from);
            folded += usize::from((b - a).perp_dot(c - a) < 0.0 || (c - a).perp_dot(d - a) < 0.0);
            texels += found.len();
        }
    }
    assert!(texels > 50_000 && folded > 1_000, "{texels} {folded}");
}

/// The texels of one cell.
fn covered(corners: Corners) -> Vec<Found> {
    let mut cells = [[[-9.0; 2]; 4]; LANES];
    cells[1] = corners;
    let [_, found, ..] = dispatch(Covered(cells));
    found
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
