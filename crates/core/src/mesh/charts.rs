//! The charts of a tile (method §1), from its triangles: which of them are neighbours in the UV plane, and the
//! connected components of this relation.

use glam::DVec2;

use super::gaps::{self, Given};
use super::triangle::doubled_area;
use super::{Chart, Cut, NONE, RawTriangle, TileMesh, Triangle, WeldedEdge, inverse};
use crate::allocation::{Vec, vec};

/// Edges at which the host wants charts to end, as sorted pairs of vertices, in ascending order.
pub(super) type Seams = Vec<[u32; 2]>;

/// Builds the charts of a tile's triangles, sorted by chart.
///
/// Two triangles are neighbours if exactly these two share a UV edge, lie on opposite sides of it, and it is not a
/// seam: a mirrored half folded onto the other one, and an edge of three triangles, are borders. `numbers` holds the
/// numbers of each triangle's UV corners; `given`, the UVs before welding. Also returns the UV corners at gaps that
/// welding closed, ascending.
pub(super) fn build(
    udim: u32,
    raw: &[RawTriangle],
    numbers: &[[u32; 3]],
    given: &Given,
    seams: &Seams,
) -> (TileMesh, Vec<u32>) {
    let (neighbours, welds) = neighbours(raw, numbers, seams);
    let tile = TileMesh { udim, ..assemble(&neighbours, |t| (raw[t].vertices, raw[t].uv)) };
    let (outlines, corners) = gaps::find(&tile, raw, numbers, given, &neighbours);
    (TileMesh { welds, ..with_cuts(tile, outlines) }, corners)
}

impl TileMesh {
    /// The number in `chart_of` of each triangle of a chart.
    pub fn numbers(&self) -> Vec<u32> {
        order(&self.chart_of)
    }

    /// The borders: the sides of triangles without a neighbour, as triangle numbers of `chart_of` in that order, with a
    /// corner.
    pub fn borders(&self) -> impl Iterator<Item = (u32, u8)> {
        let new_index = inverse(&order(&self.chart_of));
        (0..self.chart_of.len() as u32).flat_map(move |t| {
            let neighbours = self.triangles[new_index[t as usize] as usize].neighbours;
            (0..3).filter(move |&k| neighbours[k as usize] == NONE).map(move |k| (t, k))
        })
    }

    /// The same tile with charts that also end at the `torn` ones of its `welds`. Triangles keep their numbers in
    /// `chart_of`.
    pub fn cut(&self, torn: &[u32]) -> TileMesh {
        let all: Vec<u32> = (0..self.chart_of.len() as u32).collect();
        self.part(&all, &all, torn)
    }

    /// A layer of the tile: the triangles for which `layers` has its number, numbered anew in their order. A chart has
    /// its triangles in one layer.
    pub fn of_layer(&self, layers: &[u32], layer: u32) -> TileMesh {
        let count = self.chart_of.len() as u32;
        let of_layer: Vec<u32> = (0..count).filter(|&t| layers[t as usize] == layer).collect();
        let mut numbers = vec![NONE; count as usize];
        for (number, &t) in of_layer.iter().enumerate() {
            numbers[t as usize] = number as u32;
        }
        let tile = self.part(&of_layer, &numbers, &[]);
        let of_layer = |weld: &&WeldedEdge| layers[weld.sides[0].0 as usize] == layer;
        let renumbered = |weld: &WeldedEdge| WeldedEdge {
            sides: weld.sides.map(|(t, k)| (numbers[t as usize], k)),
            ends: weld.ends,
        };
        let welds = self.welds.iter().filter(of_layer).map(renumbered).collect();
        TileMesh { layer, welds, ..tile }
    }

    /// The tile of the triangles `kept`, with charts that also end at the `torn` welds, and without welds. `numbers`
    /// has the new number of each triangle, or `NONE`.
    fn part(&self, kept: &[u32], numbers: &[u32], torn: &[u32]) -> TileMesh {
        let order = order(&self.chart_of);
        let new_index = inverse(&order);
        let triangle = |t: u32| &self.triangles[new_index[t as usize] as usize];
        let renumbered = |n: u32| if n == NONE { NONE } else { numbers[order[n as usize] as usize] };
        let mut neighbours: Vec<[u32; 3]> =
            kept.iter().map(|&t| triangle(t).neighbours.map(renumbered)).collect();
        for (t, k) in torn.iter().flat_map(|&weld| self.welds[weld as usize].sides) {
            neighbours[numbers[t as usize] as usize][k as usize] = NONE;
        }
        let tile = assemble(&neighbours, |number| {
            let t = kept[number];
            let vertices = &self.charts[self.chart_of[t as usize] as usize].vertices;
            (triangle(t).local.map(|v| vertices[v as usize]), triangle(t).uv)
        });
        let cut = |cut: &Cut| Cut { triangle: renumbered(cut.triangle), ..*cut };
        let cuts = self.cuts.iter().map(cut).filter(|cut| cut.triangle != NONE).collect();
        TileMesh { udim: self.udim, uv_set: self.uv_set, layer: self.layer, ..with_cuts(tile, cuts) }
    }
}

/// Triangle indices sorted by chart, and within a chart by face.
fn order(chart_of: &[u32]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..chart_of.len() as u32).collect();
    order.sort_unstable_by_key(|&t| (chart_of[t as usize], t));
    order
}

/// Gives a tile its cuts, with triangles by their numbers in `chart_of`.
fn with_cuts(tile: TileMesh, mut cuts: Vec<Cut>) -> TileMesh {
    if !cuts.is_empty() {
        let new_index = inverse(&order(&tile.chart_of));
        cuts.iter_mut().for_each(|cut| cut.triangle = new_index[cut.triangle as usize]);
        cuts.sort_unstable_by_key(|cut| cut.triangle);
    }
    TileMesh { cuts, ..tile }
}

/// Sorts triangles by chart. `source` gives a triangle's vertices and UVs.
fn assemble(neighbours: &[[u32; 3]], source: impl Fn(usize) -> ([u32; 3], [DVec2; 3])) -> TileMesh {
    let chart_of = components(neighbours);
    let chart_count = chart_of.iter().max().map_or(0, |&c| c + 1);
    let order = order(&chart_of);
    let new_index = inverse(&order);
    let mut charts = Vec::with_capacity(chart_count as usize);
    let mut triangles = Vec::with_capacity(order.len());
    let mut remaining = &order[..];
    for chart in 0..chart_count {
        let count = remaining.partition_point(|&t| chart_of[t as usize] == chart);
        let (members, others) = remaining.split_at(count);
        remaining = others;
        let mut vertices: Vec<u32> = members.iter().flat_map(|&t| source(t as usize).0).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let start = triangles.len();
        for &t in members {
            let (of_triangle, uv) = source(t as usize);
            triangles.push(Triangle {
                local: of_triangle.map(|v| vertices.partition_point(|&w| w < v) as u32),
                uv,
                neighbours: neighbours[t as usize]
                    .map(|n| if n == NONE { NONE } else { new_index[n as usize] }),
            });
        }
        charts.push(Chart { triangles: start..triangles.len(), vertices, ..Chart::default() });
    }
    TileMesh { triangles, charts, chart_of, ..TileMesh::default() }
}

/// Per triangle, its neighbour across the edge opposite to each corner; and the edges whose sides have different
/// vertices.
fn neighbours(raw: &[RawTriangle], numbers: &[[u32; 3]], seams: &Seams) -> (Vec<[u32; 3]>, Vec<WeldedEdge>) {
    let mut neighbours = vec![[NONE; 3]; raw.len()];
    let mut welds = Vec::new();
    let sides = (0..raw.len() as u32).flat_map(|t| (0..3).map(move |k| (t, k)));
    for [(t, k), (s, j)] in pairs(raw, numbers, sides) {
        let [here, there] =
            [(t, k), (s, j)].map(|(t, k)| ends(numbers, t, k).map(|c| raw[t as usize].vertices[c]));
        if is_seam(seams, here) || is_seam(seams, there) {
            continue;
        }
        neighbours[t as usize][k as usize] = s;
        neighbours[s as usize][j as usize] = t;
        if here != there {
            let ends = [0, 1].map(|end| [here[end], there[end]]);
            welds.push(WeldedEdge { sides: [(t, k), (s, j)], ends });
        }
    }
    (neighbours, welds)
}

pub(super) fn is_seam(seams: &Seams, [a, b]: [u32; 2]) -> bool {
    seams.binary_search(&[a.min(b), a.max(b)]).is_ok()
}

/// A side of a triangle: the triangle, and the corner opposite to the side.
type Side = (u32, u8);

/// The pairs of sides that form one edge, with no third side at it and with their triangles on opposite sides of it.
/// `numbers` holds the numbers of each triangle's UV corners.
///
/// Where welding by position joins more than two sides, as for the front and the back of a sheet, sides with the same
/// vertices are paired first: a weld must not separate what the vertices connect.
pub(super) fn pairs(
    raw: &[RawTriangle],
    numbers: &[[u32; 3]],
    sides: impl Iterator<Item = Side>,
) -> Vec<[Side; 2]> {
    // Entries of (edge as a sorted pair of UV corners, its vertices, triangle, its corner opposite to the edge),
    // sorted, so that the triangles at an edge are adjacent, and among these the ones with the same vertices.
    let with_ends = |(t, k): Side| {
        let ends = ends(numbers, t, k);
        let edge = ends.map(|c| numbers[t as usize][c]);
        (edge, ends.map(|c| raw[t as usize].vertices[c]), t, k)
    };
    let mut edges: Vec<([u32; 2], [u32; 2], u32, u8)> = sides.map(with_ends).collect();
    edges.sort_unstable();
    let lies = |t: u32, k: u8| {
        let [a, b] = ends(numbers, t, k);
        doubled_area([a, b, k as usize].map(|c| raw[t as usize].uv[c])).signum()
    };
    let mut found = Vec::new();
    let mut left = Vec::new();
    for at_edge in edges.chunk_by(|x, y| x.0 == y.0) {
        left.clear();
        for same in at_edge.chunk_by(|x, y| x.1 == y.1) {
            match *same {
                [(_, _, t, k), (_, _, s, j)] if lies(t, k) * lies(s, j) < 0.0 => found.push([(t, k), (s, j)]),
                _ => left.extend(same.iter().map(|&(_, _, t, k)| (t, k))),
            }
        }
        if let [(t, k), (s, j)] = left[..]
            && lies(t, k) * lies(s, j) < 0.0
        {
            found.push([(t, k), (s, j)]);
        }
    }
    found
}

/// The corners of a triangle at the edge opposite to its corner `k`, the lower-numbered UV corner first.
fn ends(numbers: &[[u32; 3]], t: u32, k: u8) -> [usize; 2] {
    let [a, b] = [1, 2].map(|d| (k as usize + d) % 3);
    let of = &numbers[t as usize];
    if of[a] > of[b] { [b, a] } else { [a, b] }
}

/// Per triangle, the number of its connected component. Components are numbered in the order of their first triangles.
fn components(neighbours: &[[u32; 3]]) -> Vec<u32> {
    let mut component = vec![NONE; neighbours.len()];
    let mut count = 0;
    let mut stack = Vec::new();
    for seed in 0..neighbours.len() {
        if component[seed] != NONE {
            continue;
        }
        component[seed] = count;
        stack.push(seed as u32);
        while let Some(t) = stack.pop() {
            for &n in neighbours[t as usize].iter().filter(|&&n| n != NONE) {
                if component[n as usize] == NONE {
                    component[n as usize] = count;
                    stack.push(n);
                }
            }
        }
        count += 1;
    }
    component
}
