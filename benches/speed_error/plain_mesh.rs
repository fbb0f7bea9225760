//! The tile's grid and the pose's triangles for `plain`: built once, without being timed.

use std::collections::HashMap;

use vrtm_testkit::cases::Case;

const NONE: u32 = u32::MAX;
/// Barycentric tolerance: a point on an edge belongs to the triangles on both sides.
const SLACK: f64 = 1e-12;

/// A triangle of the pose over its UVs, in cells.
pub struct Triangle {
    origin: [f64; 2],
    /// Rows of the matrix that maps an offset from `origin` to the barycentric coordinates of corners 1 and 2.
    barycentric: [[f64; 2]; 2],
    value: [f64; 3],
    /// Derivatives of the position per cell along u and v.
    pub tangent: [[f64; 3]; 2],
    /// The neighbour at the edge opposite to corner k, or NONE.
    neighbours: [u32; 3],
}

pub struct PlainMesh {
    /// Cells on a side.
    pub size: usize,
    pub triangles: Vec<Triangle>,
    /// Per node: position at rest, rigidity, whether it is movable, and the triangle under it.
    pub rest: Vec<[f64; 3]>,
    pub rigidity: Vec<f64>,
    pub movable: Vec<bool>,
    pub under: Vec<u32>,
}

impl Triangle {
    fn new(uv: [[f64; 2]; 3], at: [[f64; 3]; 3]) -> Triangle {
        let [a, b, c] = uv;
        let (e, f) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
        let det = e[0] * f[1] - e[1] * f[0];
        let barycentric = [[f[1] / det, -f[0] / det], [-e[1] / det, e[0] / det]];
        let tangent = [0, 1].map(|axis| {
            std::array::from_fn(|k| {
                (at[1][k] - at[0][k]) * barycentric[0][axis] + (at[2][k] - at[0][k]) * barycentric[1][axis]
            })
        });
        Triangle { origin: a, barycentric, value: at[0], tangent, neighbours: [NONE; 3] }
    }

    fn barycentrics(&self, at: [f64; 2]) -> [f64; 3] {
        let d = [at[0] - self.origin[0], at[1] - self.origin[1]];
        let [b, c] = self.barycentric.map(|row| row[0] * d[0] + row[1] * d[1]);
        [1.0 - b - c, b, c]
    }

    pub fn at(&self, at: [f64; 2]) -> [f64; 3] {
        let d = [at[0] - self.origin[0], at[1] - self.origin[1]];
        std::array::from_fn(|k| self.value[k] + d[0] * self.tangent[0][k] + d[1] * self.tangent[1][k])
    }
}

impl PlainMesh {
    /// Builds the mesh. `movable` marks the nodes that the library moves; `rigidity` is per node.
    pub fn new(case: &Case, rigidity: Vec<f64>, movable: Vec<bool>) -> PlainMesh {
        let size = case.grid as usize;
        let (rest, posed) = (triangles(case, &case.model.rest), triangles(case, &case.poses[0]));
        let nodes = (size + 1) * (size + 1);
        let mut mesh = PlainMesh {
            size,
            triangles: posed,
            rest: vec![[0.0; 3]; nodes],
            rigidity,
            movable,
            under: vec![NONE; nodes],
        };
        for (t, triangle) in rest.iter().enumerate() {
            let corners =
                [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].map(|weights: [f64; 2]| triangle.corner(weights));
            let span = |axis: usize| {
                let at = corners.map(|corner| corner[axis]);
                let low = at.iter().fold(f64::INFINITY, |m, &x| m.min(x)).ceil().max(0.0) as usize;
                let high = at.iter().fold(0.0f64, |m, &x| m.max(x)).floor() as usize;
                low..(high.min(size) + 1)
            };
            for (j, i) in span(1).flat_map(|j| span(0).map(move |i| (j, i))) {
                let (n, at) = (j * (size + 1) + i, [i as f64, j as f64]);
                if mesh.under[n] == NONE && triangle.barycentrics(at).iter().all(|&b| b >= -SLACK) {
                    mesh.under[n] = t as u32;
                    mesh.rest[n] = triangle.at(at);
                }
            }
        }
        mesh
    }

    pub fn triangle(&self, t: u32) -> Option<&Triangle> {
        self.triangles.get(t as usize)
    }

    /// Warped position of a node in the plane, in cells.
    pub fn warped(&self, n: usize, u: [f64; 2]) -> [f64; 2] {
        [(n % (self.size + 1)) as f64 + u[0], (n / (self.size + 1)) as f64 + u[1]]
    }

    /// The triangle under a point, found by crossing the edge with the most negative barycentric coordinate.
    pub fn walk(&self, start: u32, at: [f64; 2]) -> Option<u32> {
        let mut t = start;
        for _ in 0..100 {
            let triangle = self.triangle(t)?;
            let l = triangle.barycentrics(at);
            let k = (0..3).min_by(|&a, &b| l[a].total_cmp(&l[b]))?;
            if l[k] >= -SLACK {
                return Some(t);
            }
            t = triangle.neighbours[k];
        }
        None
    }
}

impl Triangle {
    /// The UV at the barycentric coordinates (1 - b - c, b, c), in cells.
    fn corner(&self, [b, c]: [f64; 2]) -> [f64; 2] {
        let [p, q] = self.barycentric;
        let det = p[0] * q[1] - p[1] * q[0];
        [self.origin[0] + (b * q[1] - c * p[1]) / det, self.origin[1] + (c * p[0] - b * q[0]) / det]
    }
}

/// Triangulates the model's polygons as fans; neighbours share an edge of the UVs.
fn triangles(case: &Case, positions: &[[f32; 3]]) -> Vec<Triangle> {
    let model = &case.model;
    let offset = [f64::from((case.udim - 1001) % 10), f64::from((case.udim - 1001) / 10)];
    let mut triangles: Vec<Triangle> = Vec::new();
    let mut across: HashMap<(u32, u32), (usize, usize)> = HashMap::new();
    for face in model.faces() {
        for k in face.start + 1..face.end - 1 {
            let corners = [face.start, k, k + 1];
            let uv = corners.map(|c| {
                let uv = model.uvs[model.uv_indices[c] as usize];
                [0, 1].map(|axis| (f64::from(uv[axis]) - offset[axis]) * f64::from(case.grid))
            });
            let at = corners.map(|c| positions[model.indices[c] as usize].map(f64::from));
            let t = triangles.len();
            triangles.push(Triangle::new(uv, at));
            for side in 0..3 {
                let [a, b] = [1, 2].map(|k| model.uv_indices[corners[(side + k) % 3]]);
                match across.remove(&(b, a)) {
                    Some((other, other_side)) => {
                        triangles[t].neighbours[side] = other as u32;
                        triangles[other].neighbours[other_side] = t as u32;
                    }
                    None => _ = across.insert((a, b), (t, side)),
                }
            }
        }
    }
    triangles
}
