//! Gaps that welding closes (method §1). Corners whose UVs differ become one, so that the chart covers what lay between
//! them and the surface map goes on across it. Where that is a slit of the host's layout, and not noise of its UVs, no
//! node may end there, since no triangle of the host covers it.

use glam::DVec2;
use half::f16;

use super::{Cut, NONE, RawTriangle, TileMesh};
use crate::allocation::{Vec, zeroed};

/// UVs that differ by no more than this differ by rounding: that of five digits, or of integers of 16 bits.
const ROUNDING: f64 = 2e-5;
/// No gap is narrower than this: an eighth of a cell on a grid of 1024 by 1024. It is what shells that were sewn by
/// hand are apart.
const NARROWEST: f64 = 1.0 / 8192.0;
/// Share of the edges inside a chart that are apart by more than rounding, from which on the chart's UVs are
/// noisy, as UVs of faces that were written one by one. Beside a gap there are edges that are not apart.
const NOISY_SHARE: f64 = 0.6;

/// The UV that the host gave a face corner.
pub(super) type Given<'a> = dyn Fn(usize) -> Option<[f32; 2]> + 'a;

/// Finds the gaps of a tile with charts, but without cuts. Returns their outlines, which are the sides that the host
/// gave where they are apart from those across, or from the border that welding made of them, and what joins the ends
/// of both; triangles have the numbers of `raw`. Also returns the numbers of the UV corners on them, ascending.
pub(super) fn find(
    tile: &TileMesh,
    raw: &[RawTriangle],
    numbers: &[[u32; 3]],
    given: &Given,
    neighbours: &[[u32; 3]],
) -> (Vec<Cut>, Vec<u32>) {
    let origin = tile.origin();
    let of_host =
        |corner: u32| DVec2::from(given(corner as usize).unwrap_or_default().map(f64::from)) - origin;
    let is_moved = |triangle: &RawTriangle| (0..3).any(|k| of_host(triangle.corners[k]) != triangle.uv[k]);
    if !raw.iter().any(is_moved) {
        return Default::default();
    }
    // Per chart: the edges between faces, and those of them that are apart. Each edge inside is seen from both sides.
    let mut edges: Vec<[u32; 2]> = zeroed(tile.charts.len());
    // Per UV corner, whether an edge at it is not apart. Where all are, that is noise, too.
    let corners = numbers.iter().flatten().max().map_or(0, |last| *last as usize + 1);
    let mut joined: Vec<bool> = zeroed(corners);
    let mut found = Vec::new();
    for (t, triangle) in raw.iter().enumerate() {
        for (k, &next) in neighbours[t].iter().enumerate() {
            let ends = [1, 2].map(|d| (k + d) % 3);
            let across = |c: usize| {
                let corner = (0..3).find(|&other| numbers[next as usize][other] == numbers[t][c]);
                corner.map(|other| raw[next as usize].corners[other])
            };
            let here = ends.map(|c| of_host(triangle.corners[c]));
            let there = match next {
                NONE => ends.map(|c| triangle.uv[c]),
                _ => ends.map(|c| across(c).map_or(triangle.uv[c], of_host)),
            };
            let chart = tile.chart_of[t] as usize;
            if next != NONE && ends.iter().any(|&c| across(c) != Some(triangle.corners[c])) {
                let is_apart = (0..2).any(|end| (here[end] - there[end]).abs().max_element() > ROUNDING);
                edges[chart] = [edges[chart][0] + 1, edges[chart][1] + u32::from(is_apart)];
                ends.iter().for_each(|&c| joined[numbers[t][c] as usize] |= !is_apart);
            }
            if (0..2).any(|end| are_apart(here[end], there[end])) {
                found.push((t as u32, chart, ends.map(|c| numbers[t][c]), [here, there]));
            }
        }
    }
    let (mut outlines, mut on_gaps) = (Vec::new(), Vec::new());
    let is_noisy = |[inside, apart]: [u32; 2]| f64::from(apart) > NOISY_SHARE * f64::from(inside);
    for (triangle, chart, corners, [here, there]) in found {
        if is_noisy(edges[chart]) || !corners.iter().any(|&corner| joined[corner as usize]) {
            continue;
        }
        on_gaps.extend(corners);
        let sides = [here, there, [here[0], there[0]], [here[1], there[1]]];
        let cut = |uv| Cut { triangle, uv, is_gap: true };
        outlines.extend(sides.into_iter().filter(|[a, b]| a != b).map(cut));
    }
    on_gaps.sort_unstable();
    on_gaps.dedup();
    (outlines, on_gaps)
}

/// True if two UVs differ as much as UVs at a gap, and by more than one step of half floats, if they are such.
pub fn are_apart(a: DVec2, b: DVec2) -> bool {
    (0..2).any(|c| (a[c] - b[c]).abs() > NARROWEST && !are_adjacent_halves(a[c], b[c]))
}

/// True if two numbers are half floats that follow one another, or 1 minus such: v may have been turned over.
fn are_adjacent_halves(a: f64, b: f64) -> bool {
    let adjacent = |a: f64, b: f64| {
        let [p, q] = [a, b].map(f16::from_f64);
        p.to_f64() == a && q.to_f64() == b && i32::from(p.to_bits()).abs_diff(i32::from(q.to_bits())) == 1
    };
    adjacent(a, b) || adjacent(1.0 - a, 1.0 - b)
}
