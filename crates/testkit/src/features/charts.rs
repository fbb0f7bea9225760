//! The charts of a mesh over the grids of its tiles: which triangle is under a node, what lies beyond a border.

use std::collections::{HashMap, HashSet};

use super::Node;
use crate::model::Model;
use crate::warp::{Warp, barycentric, cross};

type Point = [f64; 2];

/// A triangle in the plane of its tile, in cells.
pub struct Triangle {
    pub vertices: [usize; 3],
    /// The face corners of the mesh.
    pub corners: [usize; 3],
    pub at: [Point; 3],
    pub chart: usize,
    /// The triangles of the same chart beyond the edges opposite to the corners.
    pub neighbours: [Option<usize>; 3],
}

/// A node within a cell of a border of its chart.
pub struct Border {
    pub node: Node,
    /// The nodes about the same point of the surface beyond a seam; `None` at an open border.
    pub beyond: Option<Vec<Node>>,
}

pub struct Charts {
    pub triangles: Vec<Triangle>,
    /// Per warp and node, the triangle under the node, if only one chart covers it.
    pub under: Vec<Vec<Option<usize>>>,
    pub borders: Vec<Border>,
    /// Per triangle, its warp.
    pub warp_of: Vec<usize>,
    /// Per warp and cell, the triangles that may overlap the cell.
    cells: Vec<HashMap<[i64; 2], Vec<usize>>>,
}

/// Barycentric coordinates over minus this are inside.
const SLACK: f64 = 1e-9;

impl Charts {
    /// `warps` are those of the model's maps, in their order. Faces of other tiles are left out.
    pub fn new(model: &Model, warps: &[Warp]) -> Charts {
        let (mut triangles, warp_of) = triangles(model, warps);
        let sides = connect(&mut triangles, &warp_of, model);
        number_charts(&mut triangles);
        let mut charts = Charts {
            under: warps.iter().map(|warp| vec![None; warp.u.len()]).collect(),
            cells: vec![HashMap::new(); warps.len()],
            triangles,
            borders: Vec::new(),
            warp_of: Vec::new(),
        };
        charts.cover(warps, &warp_of);
        charts.warp_of = warp_of.clone();
        charts.borders = sides.iter().flat_map(|side| charts.along(side, warps, &warp_of)).collect();
        charts
    }

    fn cover(&mut self, warps: &[Warp], warp_of: &[usize]) {
        let mut shared = vec![HashSet::new(); warps.len()];
        for (t, triangle) in self.triangles.iter().enumerate() {
            let w = warp_of[t];
            let warp = &warps[w];
            let [x, y] = [0, 1].map(|axis| {
                let of = |f: fn(f64, f64) -> f64| triangle.at.iter().map(|p| p[axis]).reduce(f).unwrap();
                of(f64::min)..of(f64::max)
            });
            for j in y.start.floor() as i64..=y.end.ceil() as i64 {
                for i in x.start.floor() as i64..=x.end.ceil() as i64 {
                    self.cells[w].entry([i, j]).or_default().push(t);
                    let outside = i < 0 || j < 0 || i > warp.nx as i64 || j > warp.ny as i64;
                    if outside || least(&triangle.at, [i as f64, j as f64]) < -SLACK {
                        continue;
                    }
                    let n = j as usize * (warp.nx + 1) + i as usize;
                    match self.under[w][n] {
                        Some(other) if self.triangles[other].chart != triangle.chart => {
                            shared[w].insert(n);
                        }
                        _ => self.under[w][n] = Some(t),
                    }
                }
            }
        }
        for (under, shared) in self.under.iter_mut().zip(shared) {
            shared.into_iter().for_each(|n| under[n] = None);
        }
    }

    /// The triangle of the chart of `home` that contains a point, or that comes nearest to it.
    pub fn find(&self, w: usize, home: usize, at: Point) -> usize {
        let cell = at.map(|x| x.floor() as i64);
        let mut best = (least(&self.triangles[home].at, at), home);
        for k in 0..9 {
            let near = [cell[0] + k % 3 - 1, cell[1] + k / 3 - 1];
            for &t in self.cells[w].get(&near).into_iter().flatten() {
                let inside = least(&self.triangles[t].at, at);
                if self.triangles[t].chart == self.triangles[home].chart && inside > best.0 {
                    best = (inside, t);
                }
            }
        }
        best.1
    }

    /// The chart that contains a point.
    pub fn chart_at(&self, w: usize, at: Point) -> Option<usize> {
        let cell = at.map(|x| x.floor() as i64);
        let near = self.cells[w].get(&cell).into_iter().flatten();
        let found = near.copied().find(|&t| least(&self.triangles[t].at, at) >= -SLACK)?;
        Some(self.triangles[found].chart)
    }

    /// True if the surface continues from a triangle to a point that is near to it.
    pub fn goes_on(&self, from: usize, to: Point) -> bool {
        let mut t = from;
        for _ in 0..200 {
            let triangle = &self.triangles[t];
            let inside = barycentric(&triangle.at, to);
            if inside.iter().all(|&x| x >= -SLACK) {
                return true;
            }
            let mut corners = [0, 1, 2];
            corners.sort_by(|&a, &b| inside[a].total_cmp(&inside[b]));
            let beyond = corners.into_iter().filter(|&k| inside[k] < -SLACK);
            let Some(next) = beyond.filter_map(|k| triangle.neighbours[k]).next() else { return false };
            t = next;
        }
        false
    }

    /// The nodes within a cell of one side of a chart.
    fn along(&self, side: &Side, warps: &[Warp], warp_of: &[usize]) -> Vec<Border> {
        let (w, chart) = (warp_of[side.triangle], self.triangles[side.triangle].chart);
        let nodes = self.near(w, side.ends, chart, &warps[w]);
        let border = |(n, t): (usize, f64)| {
            let beyond = side.beyond.map(|(other, ends)| {
                let at = [0, 1].map(|c| ends[0][c] + t * (ends[1][c] - ends[0][c]));
                let v = warp_of[other];
                let there = self.near(v, [at, at], self.triangles[other].chart, &warps[v]);
                there.into_iter().map(|(n, _)| (v, n)).collect()
            });
            Border { node: (w, n), beyond }
        };
        nodes.into_iter().map(border).collect()
    }

    /// The nodes of a chart within a cell of a line, and where on the line they are nearest to it, from 0 to 1.
    fn near(&self, w: usize, [a, b]: [Point; 2], chart: usize, warp: &Warp) -> Vec<(usize, f64)> {
        let span = |axis: usize, most: usize| {
            let (low, high) = (a[axis].min(b[axis]), a[axis].max(b[axis]));
            (low - 1.0).ceil().max(0.0) as usize..=((high + 1.0).floor().max(0.0) as usize).min(most)
        };
        let mut found = Vec::new();
        for j in span(1, warp.ny) {
            for i in span(0, warp.nx) {
                let n = j * (warp.nx + 1) + i;
                let along = [b[0] - a[0], b[1] - a[1]];
                let from = [i as f64 - a[0], j as f64 - a[1]];
                let square = along[0] * along[0] + along[1] * along[1];
                let t = (along[0] * from[0] + along[1] * from[1]) / square.max(f64::MIN_POSITIVE);
                let t = t.clamp(0.0, 1.0);
                let off = (from[0] - t * along[0]).hypot(from[1] - t * along[1]);
                if off <= 1.0 && self.under[w][n].is_some_and(|t| self.triangles[t].chart == chart) {
                    found.push((n, t));
                }
            }
        }
        found
    }
}

/// A side of a triangle that is a border of its chart.
struct Side {
    triangle: usize,
    ends: [Point; 2],
    /// The triangle beyond a seam, and where the ends lie there.
    beyond: Option<(usize, [Point; 2])>,
}

/// The triangles of the faces in the tiles of the warps, and the index of each one's warp.
fn triangles(model: &Model, warps: &[Warp]) -> (Vec<Triangle>, Vec<usize>) {
    let (mut triangles, mut warp_of) = (Vec::new(), Vec::new());
    for face in model.faces() {
        let corners: Vec<usize> = face.collect();
        let uv = |c: usize| model.uvs[model.uv_indices[c] as usize].map(f64::from);
        let middle = [0, 1].map(|k| corners.iter().map(|&c| uv(c)[k]).sum::<f64>() / corners.len() as f64);
        let udim = 1001 + middle[0].floor() as i64 + 10 * middle[1].floor() as i64;
        let Some(w) = model.maps.iter().position(|maps| i64::from(maps.udim) == udim) else { continue };
        let cells = [warps[w].nx as f64, warps[w].ny as f64];
        for k in 1..corners.len() - 1 {
            let of = [corners[0], corners[k], corners[k + 1]];
            let at = of.map(|c| [0, 1].map(|axis| (uv(c)[axis] - middle[axis].floor()) * cells[axis]));
            if cross(at[0], at[1], at[2]) != 0.0 {
                let vertices = of.map(|c| model.indices[c] as usize);
                triangles.push(Triangle { vertices, corners: of, at, chart: 0, neighbours: [None; 3] });
                warp_of.push(w);
            }
        }
    }
    (triangles, warp_of)
}

/// Finds the neighbours of the triangles, and returns the sides without one.
fn connect(triangles: &mut [Triangle], warp_of: &[usize], model: &Model) -> Vec<Side> {
    let cuts: HashSet<[usize; 2]> = model.seams.iter().map(|pair| sorted(pair.map(|v| v as usize))).collect();
    let mut by_vertices: HashMap<[usize; 2], Vec<(usize, usize)>> = HashMap::new();
    for (t, triangle) in triangles.iter().enumerate() {
        for k in 0..3 {
            let ends = [triangle.vertices[(k + 1) % 3], triangle.vertices[(k + 2) % 3]];
            by_vertices.entry(sorted(ends)).or_default().push((t, k));
        }
    }
    let mut sides = Vec::new();
    let mut neighbours = Vec::new();
    for (vertices, list) in &by_vertices {
        let ends = |(t, _): (usize, usize)| -> [Point; 2] {
            vertices.map(|v| triangles[t].at[triangles[t].vertices.iter().position(|&w| w == v).unwrap()])
        };
        match list[..] {
            [a, b] if warp_of[a.0] == warp_of[b.0] && ends(a) == ends(b) && !cuts.contains(vertices) => {
                neighbours.push((a, b.0));
                neighbours.push((b, a.0));
            }
            [a, b] => {
                for (near, far) in [(a, b), (b, a)] {
                    let beyond = Some((far.0, ends(far)));
                    sides.push(Side { triangle: near.0, ends: ends(near), beyond });
                }
            }
            _ => {
                sides.extend(list.iter().map(|&a| Side { triangle: a.0, ends: ends(a), beyond: None }));
            }
        }
    }
    for ((t, k), other) in neighbours {
        triangles[t].neighbours[k] = Some(other);
    }
    sides
}

fn number_charts(triangles: &mut [Triangle]) {
    let mut numbered = vec![false; triangles.len()];
    for first in 0..triangles.len() {
        let mut open = vec![first];
        while let Some(t) = open.pop() {
            if !std::mem::replace(&mut numbered[t], true) {
                triangles[t].chart = first;
                open.extend(triangles[t].neighbours.into_iter().flatten());
            }
        }
    }
}

fn sorted([a, b]: [usize; 2]) -> [usize; 2] {
    [a.min(b), a.max(b)]
}

/// The least barycentric coordinate.
pub fn least(triangle: &[Point; 3], at: Point) -> f64 {
    barycentric(triangle, at).into_iter().fold(f64::INFINITY, f64::min)
}

/// The position of a point of a triangle, from those of the mesh's vertices.
pub fn interpolate(triangle: &Triangle, positions: &[[f32; 3]], at: Point) -> [f64; 3] {
    let weights = barycentric(&triangle.at, at);
    [0, 1, 2].map(|axis| {
        let of = |k: usize| weights[k] * f64::from(positions[triangle.vertices[k]][axis]);
        of(0) + of(1) + of(2)
    })
}

pub fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (b[0] - a[0]).hypot(b[1] - a[1]).hypot(b[2] - a[2])
}
