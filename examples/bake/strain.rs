//! Strain as a picture: for each node of a tile's grid, the stretch and the compression of its edges when the texture
//! lies on the posed mesh, without the warp and with it. Both ends of an edge are located on the triangles.

use crate::maps::Field;
use crate::material::Material;
use crate::mesh::Triangle;

/// Per node: stretch and compression, each >= 0, and 1 where the node has values; without the warp, then with it.
pub struct StrainMaps {
    pub before: Field<3>,
    pub after: Field<3>,
}

/// Nodes with less rigidity get no strain colour.
const RIGID: f32 = 0.3;

struct Node {
    chart: u32,
    rest: [f64; 3],
    before: [f64; 3],
    after: Option<(u32, [f64; 3])>,
}

/// Measures the strain of a tile. `triangles` and `charts` are those of the tile; `warp` is at its nodes.
pub fn measure(
    triangles: &[&Triangle],
    charts: &[u32],
    rest: &[[f32; 3]],
    pose: &[[f32; 3]],
    material: &Material,
    warp: &Field<2>,
) -> StrainMaps {
    let locator = Locator::new(triangles);
    let (w, h) = (warp.width, warp.height);
    let position = |positions: &[[f32; 3]], (triangle, weights): (usize, [f64; 3])| -> [f64; 3] {
        let corners = triangles[triangle].vertices.map(|v| positions[v as usize]);
        std::array::from_fn(|c| (0..3).map(|k| weights[k] * f64::from(corners[k][c])).sum())
    };
    let node = |x: usize, y: usize| -> Option<Node> {
        let uv = [x as f64 / (w - 1) as f64, 1.0 - y as f64 / (h - 1) as f64];
        if material.rigidity(uv.map(|x| x as f32)) < RIGID {
            return None;
        }
        let at = locator.locate(triangles, uv)?;
        let warped = locator.locate(triangles, warp.at(x, y).map(f64::from));
        Some(Node {
            chart: charts[at.0],
            rest: position(rest, at),
            before: position(pose, at),
            after: warped.map(|at| (charts[at.0], position(pose, at))),
        })
    };
    let nodes: Vec<Option<Node>> = (0..w * h).map(|i| node(i % w, i / w)).collect();

    let empty = Field { width: w, height: h, data: vec![[0.0; 3]; w * h] };
    let mut maps = StrainMaps { before: empty.clone(), after: empty };
    let mut book = |a: usize, b: usize| {
        let (Some(p), Some(q)) = (&nodes[a], &nodes[b]) else { return };
        let length = distance(p.rest, q.rest);
        if p.chart != q.chart || length <= 0.0 {
            return;
        }
        let add = |field: &mut Field<3>, posed: f64| {
            let strain = (posed / length - 1.0) as f32;
            for i in [a, b] {
                let [stretch, squeeze, _] = field.data[i];
                field.data[i] = [stretch.max(strain), squeeze.max(-strain), 1.0];
            }
        };
        add(&mut maps.before, distance(p.before, q.before));
        if let (Some((chart_p, p)), Some((chart_q, q))) = (p.after, q.after)
            && chart_p == chart_q
        {
            add(&mut maps.after, distance(p, q));
        }
    };
    for y in 0..h {
        for x in 0..w {
            let at = y * w + x;
            if x + 1 < w {
                book(at, at + 1);
            }
            if y + 1 < h {
                book(at, at + w);
                if x + 1 < w {
                    book(at, at + w + 1);
                    book(at + 1, at + w);
                }
            }
        }
    }
    maps
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    ((a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2) + (a[2] - b[2]).powi(2)).sqrt()
}

/// Stretch and compression at a UV, from the nodes with values around it.
pub fn sample(field: &Field<3>, uv: [f32; 2]) -> Option<[f32; 2]> {
    // Nodes lie on the tile's edges, texel centres half a texel inside.
    let shift = |x: f32, size: usize| (x * (size - 1) as f32 + 0.5) / size as f32;
    let node = [shift(uv[0], field.width), 1.0 - shift(1.0 - uv[1], field.height)];
    let known = Field::sample(field, node);
    // Nodes without values hold zeros, so that the third channel is the weight of the others.
    (known[2] > 0.05).then(|| [known[0] / known[2], known[1] / known[2]])
}

/// Numbers the components of triangles that are connected by shared corners.
pub fn charts(triangles: &[Triangle], corners: usize) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..corners as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for t in triangles {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, t.corners[0]), root(&mut parent, t.corners[k]));
            parent[a as usize] = b;
        }
    }
    triangles.iter().map(|t| root(&mut parent, t.corners[0])).collect()
}

/// Finds the triangle under a UV by a grid of bins.
struct Locator {
    bins: usize,
    starts: Vec<u32>,
    items: Vec<u32>,
}

impl Locator {
    fn new(triangles: &[&Triangle]) -> Locator {
        let bins = ((triangles.len() as f64).sqrt() as usize).clamp(8, 1024);
        let cell = |x: f64| (x * bins as f64).clamp(0.0, bins as f64 - 1.0) as usize;
        let cover = |t: &Triangle, f: &mut dyn FnMut(usize)| {
            let span = |k: usize| {
                let [a, b, c] = t.uvs.map(|uv| uv[k]);
                cell(a.min(b).min(c))..=cell(a.max(b).max(c))
            };
            for y in span(1) {
                for x in span(0) {
                    f(y * bins + x);
                }
            }
        };
        let mut starts = vec![0u32; bins * bins + 1];
        for t in triangles {
            cover(t, &mut |bin| starts[bin + 1] += 1);
        }
        for i in 0..bins * bins {
            starts[i + 1] += starts[i];
        }
        let mut next = starts.clone();
        let mut items = vec![0; starts[bins * bins] as usize];
        for (index, t) in triangles.iter().enumerate() {
            cover(t, &mut |bin| {
                items[next[bin] as usize] = index as u32;
                next[bin] += 1;
            });
        }
        Locator { bins, starts, items }
    }

    /// The first triangle that contains the UV, with its barycentric weights.
    fn locate(&self, triangles: &[&Triangle], uv: [f64; 2]) -> Option<(usize, [f64; 3])> {
        let cell = |x: f64| (x * self.bins as f64).clamp(0.0, self.bins as f64 - 1.0) as usize;
        let bin = cell(uv[1]) * self.bins + cell(uv[0]);
        let range = self.starts[bin] as usize..self.starts[bin + 1] as usize;
        self.items[range].iter().find_map(|&index| {
            let [a, b, c] = triangles[index as usize].uvs;
            let side =
                |p: [f64; 2], q: [f64; 2]| (q[0] - p[0]) * (uv[1] - p[1]) - (q[1] - p[1]) * (uv[0] - p[0]);
            let (wa, wb, wc) = (side(b, c), side(c, a), side(a, b));
            let area = wa + wb + wc;
            let weights = [wa / area, wb / area, wc / area];
            // A small tolerance: a UV in f32 may lie beside the edge on which it was computed.
            weights.iter().all(|&w| w >= -1e-6).then_some((index as usize, weights))
        })
    }
}
