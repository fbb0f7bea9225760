//! The layers of a tile: charts that lie over one another, as the mirrored halves of a character do, are told apart by
//! layers, in each of which charts share no more than their borders.

use glam::DVec2;

use super::overlaps::{Overlaps, overlap};
use super::{NONE, RawTriangle, TileMesh};
use crate::allocation::{Vec, vec, zeroed};
use crate::sets::root;

/// Charts that lie over one another nowhere deeper than this, in UV, are neighbours: a quarter of a texel of a map of
/// 1024. What they share is then part of their borders, which do not move.
const DEPTH: f64 = 1.0 / 4096.0;

/// The layer of each triangle, by its number in `chart_of`, below `most`: of each chart the first layer in which it
/// lies over nothing else; charts come in the order of their first faces. Charts that have a face in common come
/// together.
pub(super) fn layers(tile: &TileMesh, raw: &[RawTriangle], most: u32) -> Vec<u32> {
    if tile.charts.len() == 1 {
        return zeroed(raw.len());
    }
    let stacks = Stacks::new(tile);
    let groups = groups(tile, raw);
    let mut members: Vec<(u32, u32)> =
        groups.iter().enumerate().map(|(c, &group)| (group, c as u32)).collect();
    members.sort_unstable();
    let mut layer_of = vec![NONE; tile.charts.len()];
    for group in members.chunk_by(|a, b| a.0 == b.0) {
        let layer = stacks.free_layer(group, &layer_of, most);
        group.iter().for_each(|&(_, chart)| layer_of[chart as usize] = layer);
    }
    tile.chart_of.iter().map(|&chart| layer_of[chart as usize]).collect()
}

/// For each chart, the first chart of those that have faces in common with it.
fn groups(tile: &TileMesh, raw: &[RawTriangle]) -> Vec<u32> {
    let mut first: Vec<u32> = (0..tile.charts.len() as u32).collect();
    let corners =
        raw.iter().flat_map(|triangle| triangle.corners).max().map_or(0, |corner| corner as usize + 1);
    let mut chart_at = vec![NONE; corners];
    for (triangle, &chart) in raw.iter().zip(&tile.chart_of) {
        for corner in triangle.corners {
            let before = std::mem::replace(&mut chart_at[corner as usize], chart);
            if before != NONE && before != chart {
                let [a, b] = [before, chart].map(|chart| root(&mut first, chart));
                first[a.max(b) as usize] = a.min(b);
            }
        }
    }
    (0..tile.charts.len() as u32).map(|chart| root(&mut first, chart)).collect()
}

/// The triangles of a tile, and the borders of its charts.
struct Stacks<'a> {
    tile: &'a TileMesh,
    charts: Vec<u32>,
    triangles: Overlaps,
    borders: Overlaps,
    /// The chart of each border, and its ends.
    of_border: Vec<(u32, [DVec2; 2])>,
}

impl<'a> Stacks<'a> {
    fn new(tile: &'a TileMesh) -> Stacks<'a> {
        let charts = tile.chart_of_triangles();
        let triangles = Overlaps::of(tile.triangles.iter().map(|t| t.uv).collect());
        let mut of_border = Vec::new();
        for (triangle, &chart) in tile.triangles.iter().zip(&charts) {
            for k in (0..3).filter(|&k| triangle.neighbours[k] == NONE) {
                of_border.push((chart, [1, 2].map(|d| triangle.uv[(k + d) % 3])));
            }
        }
        let borders = Overlaps::of(of_border.iter().map(|(_, [a, b])| [*a, *b, *b]).collect());
        Stacks { tile, charts, triangles, borders, of_border }
    }

    /// The layer for a group of charts: the first one below `most` in which no chart lies over one of the group. If
    /// charts of all these layers do, it is the last layer.
    fn free_layer(&self, group: &[(u32, u32)], layer_of: &[u32], most: u32) -> u32 {
        let mut taken: Vec<bool> = Vec::new();
        for &(_, chart) in group {
            for t in self.tile.charts[chart as usize].triangles.clone() {
                let corners = self.tile.triangles[t].uv;
                for other in self.triangles.near(corners) {
                    let layer = layer_of[self.charts[other] as usize];
                    if layer == NONE || taken.get(layer as usize) == Some(&true) || !self.stacked(t, other) {
                        continue;
                    }
                    let missing = (layer as usize + 1).saturating_sub(taken.len());
                    taken.extend((0..missing).map(|_| false));
                    taken[layer as usize] = true;
                    if taken.len() == most as usize && taken.iter().all(|&taken| taken) {
                        return most - 1;
                    }
                }
            }
        }
        taken.iter().position(|&taken| !taken).unwrap_or(taken.len()).min(most as usize - 1) as u32
    }

    /// True if two triangles of different charts lie over one another, deep inside of both charts.
    fn stacked(&self, a: usize, b: usize) -> bool {
        let [p, q] = [a, b].map(|t| self.tile.triangles[t].uv);
        overlap(p, q) && {
            let shared = shared(p, q);
            let middle = shared.iter().sum::<DVec2>() / shared.len().max(1) as f64;
            !shared.is_empty() && !self.at_border(middle, [a, b].map(|t| self.charts[t]))
        }
    }

    /// True if a border of one of the charts is near a point.
    fn at_border(&self, at: DVec2, charts: [u32; 2]) -> bool {
        self.borders.near([at - DEPTH, at + DEPTH, at]).any(|border| {
            let (chart, [a, b]) = self.of_border[border];
            charts.contains(&chart) && {
                let along = ((at - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
                at.distance(a + along * (b - a)) <= DEPTH
            }
        })
    }
}

/// The polygon that two triangles have in common.
fn shared(a: [DVec2; 3], b: [DVec2; 3]) -> Vec<DVec2> {
    let turn = (b[1] - b[0]).perp_dot(b[2] - b[0]).signum();
    let mut polygon = Vec::from(&a[..]);
    for k in 0..3 {
        let (from, to) = (b[k], b[(k + 1) % 3]);
        let inside = |p: DVec2| turn * (to - from).perp_dot(p - from);
        let mut cut = Vec::new();
        for (i, &p) in polygon.iter().enumerate() {
            let q = polygon[(i + 1) % polygon.len()];
            let (here, next) = (inside(p), inside(q));
            if here >= 0.0 {
                cut.push(p);
            }
            if here * next < 0.0 {
                cut.push(p + (q - p) * (here / (here - next)));
            }
        }
        polygon = cut;
    }
    polygon
}
