//! What lies together and yet is not connected: cuts; the edges that a mesh out of a game wants welded by position; and
//! those whose UVs have more noise than their triangles can bear.

use super::charts::{self, Seams, is_seam};
use super::weld::Corners;
use super::{NONE, RawTriangle, TileMesh};
use crate::allocation::{Grow, filled};

/// The number of pairs of borders of a tile that have the same places (`place` takes a vertex to its place) and UVs,
/// with nothing else there: each is one edge that is not connected. Edges that the host made seams do not count.
pub(super) fn edges_apart(
    tile: &TileMesh,
    raw: &[RawTriangle],
    seams: &Seams,
    place: &dyn Fn(u32) -> u32,
    reach: &[f64],
    tolerance: f64,
) -> u64 {
    let mut corners = Corners::new(place, reach, tolerance);
    let mut numbers = filled([NONE; 3], raw.len());
    let mut sides = Vec::new();
    for (t, k) in tile.borders() {
        let triangle = &raw[t as usize];
        let ends = [1, 2].map(|d| (k as usize + d) % 3);
        if !is_seam(seams, ends.map(|c| triangle.vertices[c])) {
            let of_ends = ends.map(|c| corners.number(triangle.vertices[c], triangle.uv[c]).0);
            if of_ends[0] != of_ends[1] {
                (0..2).for_each(|end| numbers[t as usize][ends[end]] = of_ends[end]);
                sides.put((t, k));
            }
        }
    }
    charts::pairs(raw, &numbers, sides.into_iter()).len() as u64
}
