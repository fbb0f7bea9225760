//! Helpers of the scenes: patches of quads, and elementary functions with the same bits on every machine.

use super::Scene;

pub type Point = [f64; 3];

pub const TAU: f64 = std::f64::consts::TAU;

/// Sine and cosine by their series, with the same bits on every machine.
pub fn sin_cos(angle: f64) -> (f64, f64) {
    let turns = (angle / TAU).round();
    let x = angle - turns * TAU;
    // The angle is divided by four for fast convergence of the series, and two double-angle steps restore it.
    let y = 0.25 * x;
    let square = y * y;
    let (mut sin, mut cos, mut term_s, mut term_c) = (y, 1.0, y, 1.0);
    for k in 1..10 {
        let n = 2.0 * f64::from(k);
        term_c *= -square / ((n - 1.0) * n);
        term_s *= -square / (n * (n + 1.0));
        cos += term_c;
        sin += term_s;
    }
    for _ in 0..2 {
        (sin, cos) = (2.0 * sin * cos, cos * cos - sin * sin);
    }
    (sin, cos)
}

/// 0 below `a`, 1 above `b`, smooth in between.
pub fn smooth(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// A bump of height 1 at `centre` that falls to 0 at a distance of `width`.
pub fn bump(centre: f64, width: f64, x: f64) -> f64 {
    let t = 1.0 - ((x - centre) / width).powi(2);
    if t > 0.0 { t * t } else { 0.0 }
}

/// A point of a rectangle, given by its lower and its upper corner; `s` and `t` run from 0 to 1.
pub fn rect(r: [f64; 4], s: f64, t: f64) -> [f64; 2] {
    [r[0] + (r[2] - r[0]) * s, r[1] + (r[3] - r[1]) * t]
}

/// A mesh under construction; positions stay f64 until the end.
#[derive(Default)]
pub struct Builder {
    pub points: Vec<Point>,
    face_counts: Vec<u32>,
    indices: Vec<u32>,
    uvs: Vec<[f32; 2]>,
    uv_indices: Vec<u32>,
}

impl Builder {
    /// Adds a vertex.
    pub fn point(&mut self, point: Point) -> u32 {
        self.points.push(point);
        self.points.len() as u32 - 1
    }

    /// Adds a chart of `nx` by `ny` quads over existing vertices; `uv` gets the node's position in the chart, from 0 to
    /// 1.
    pub fn chart(
        &mut self,
        nx: usize,
        ny: usize,
        vertex: impl Fn(usize, usize) -> u32,
        uv: impl Fn(f64, f64) -> [f64; 2],
    ) {
        let first = self.uvs.len() as u32;
        for j in 0..=ny {
            for i in 0..=nx {
                let [u, v] = uv(i as f64 / nx as f64, j as f64 / ny as f64);
                self.uvs.push([u as f32, v as f32]);
            }
        }
        let node = |i: usize, j: usize| first + (j * (nx + 1) + i) as u32;
        for j in 0..ny {
            for i in 0..nx {
                self.face_counts.push(4);
                for (i, j) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                    self.indices.push(vertex(i, j));
                    self.uv_indices.push(node(i, j));
                }
            }
        }
    }

    /// Adds a chart that closes a ring of vertices: rings of quads toward the centre, and a polygon in the middle.
    pub fn disc(
        &mut self,
        ring: &[u32],
        rings: usize,
        centre: Point,
        uv_centre: [f64; 2],
        uv_radius: [f64; 2],
    ) {
        let n = ring.len();
        let outer: Vec<Point> = ring.iter().map(|&v| self.points[v as usize]).collect();
        let mut vertices: Vec<Vec<u32>> = vec![ring.to_vec()];
        for k in 1..rings {
            let fraction = k as f64 / rings as f64;
            let inner = outer.iter().map(|p| std::array::from_fn(|c| p[c] + (centre[c] - p[c]) * fraction));
            let inner: Vec<Point> = inner.collect();
            vertices.push(inner.into_iter().map(|p| self.point(p)).collect());
        }
        let first = self.uvs.len() as u32;
        for k in 0..rings {
            let fraction = 1.0 - k as f64 / rings as f64;
            for i in 0..n {
                let (sin, cos) = sin_cos(TAU * i as f64 / n as f64);
                let uv = [
                    uv_centre[0] + uv_radius[0] * fraction * cos,
                    uv_centre[1] + uv_radius[1] * fraction * sin,
                ];
                self.uvs.push([uv[0] as f32, uv[1] as f32]);
            }
        }
        for k in 0..rings - 1 {
            for i in 0..n {
                let next = (i + 1) % n;
                self.face_counts.push(4);
                for (k, i) in [(k, i), (k, next), (k + 1, next), (k + 1, i)] {
                    self.indices.push(vertices[k][i]);
                    self.uv_indices.push(first + (k * n + i) as u32);
                }
            }
        }
        self.face_counts.push(n as u32);
        for (i, &vertex) in vertices[rings - 1].iter().enumerate() {
            self.indices.push(vertex);
            self.uv_indices.push(first + ((rings - 1) * n + i) as u32);
        }
    }

    /// The scene without its poses and maps.
    pub fn scene(self, name: &'static str) -> Scene {
        Scene {
            name,
            rest: self.points.iter().map(|&p| to_f32(p)).collect(),
            face_counts: self.face_counts,
            indices: self.indices,
            uvs: self.uvs,
            uv_indices: self.uv_indices,
            ..Scene::default()
        }
    }
}

pub fn to_f32(p: Point) -> [f32; 3] {
    [p[0] as f32, p[1] as f32, p[2] as f32]
}

/// Applies a deformation of space to every point.
pub fn deform(points: &[Point], f: impl Fn(Point) -> Point) -> Vec<[f32; 3]> {
    points.iter().map(|&p| to_f32(f(p))).collect()
}
