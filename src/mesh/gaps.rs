//! Gaps that welding closes (method §1). Corners whose UVs differ become one, so that the chart covers what lay between
//! them and the surface map goes on across it; but the host's triangles do not cover it, so that no node may end there.

use glam::DVec2;
use half::f16;

use super::{Cut, NONE, RawTriangle};
use crate::allocation::Grow;

/// UVs that differ by no more than this differ by rounding: that of five digits, or of integers of 16 bits.
const ROUNDING: f64 = 2e-5;

/// The triangles of which welding moved a corner, ascending: each with the UVs that the host gave.
pub(super) type Moved = Vec<(u32, [DVec2; 3])>;

/// The outlines of the gaps: the sides that the host gave where they are apart from those across, or from the border
/// that welding made of them, and what joins the ends of both. The result has the numbers of `raw`.
pub(super) fn outlines(raw: &[RawTriangle], moved: &Moved, neighbours: &[[u32; 3]]) -> Vec<Cut> {
    let find = |t: u32| moved.binary_search_by_key(&t, |(t, _)| *t).ok();
    let mut cuts = Vec::new();
    for (t, given) in moved {
        let welded = &raw[*t as usize].uv;
        for (k, &next) in neighbours[*t as usize].iter().enumerate() {
            let ends = [1, 2].map(|d| (k + d) % 3);
            let here = ends.map(|c| given[c]);
            let there = match next {
                NONE => ends.map(|c| welded[c]),
                _ => {
                    let of_next = &raw[next as usize].uv;
                    let given_there = find(next).map_or(of_next, |at| &moved[at].1);
                    let corner = |c: usize| (0..3).find(|&other| of_next[other] == welded[c]);
                    ends.map(|c| corner(c).map_or(welded[c], |other| given_there[other]))
                }
            };
            if !(0..2).any(|end| are_apart(here[end], there[end])) {
                continue;
            }
            let sides = [here, there, [here[0], there[0]], [here[1], there[1]]];
            for uv in sides.into_iter().filter(|[a, b]| a != b) {
                cuts.put(Cut { triangle: *t, uv });
            }
        }
    }
    cuts
}

/// Whether two UVs differ by more than rounding: also by more than one step of half floats, if they are such.
fn are_apart(a: DVec2, b: DVec2) -> bool {
    (0..2).any(|c| (a[c] - b[c]).abs() > ROUNDING && !are_adjacent_halves(a[c], b[c]))
}

/// Whether two numbers are half floats that follow one another, or 1 minus such: v may have been turned over.
fn are_adjacent_halves(a: f64, b: f64) -> bool {
    let adjacent = |a: f64, b: f64| {
        let [p, q] = [a, b].map(f16::from_f64);
        p.to_f64() == a && q.to_f64() == b && i32::from(p.to_bits()).abs_diff(i32::from(q.to_bits())) == 1
    };
    adjacent(a, b) || adjacent(1.0 - a, 1.0 - b)
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
