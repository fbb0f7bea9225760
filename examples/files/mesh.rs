//! The mesh of the program: polygons, and UVs with separate indices, as in files and hosts.

use std::ops::Range;

use vrtm::{MeshSource, Strided, UvSource};

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub rest: Positions,
    pub face_counts: Vec<u32>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    /// [`NO_UV`] at all corners of a face without UVs.
    pub uv_indices: Vec<u32>,
}

/// The index that stands for no UV.
pub const NO_UV: u32 = u32::MAX;

/// Positions of vertices, as exact as their file has them: those of an OBJ may lie far from the origin.
#[derive(Clone, Debug)]
pub enum Positions {
    F32(Vec<[f32; 3]>),
    F64(Vec<[f64; 3]>),
}

impl Default for Positions {
    fn default() -> Self {
        Positions::F32(Vec::new())
    }
}

impl Positions {
    pub fn view(&self) -> Strided<'_> {
        match self {
            Positions::F32(points) => Strided::from_slice(points),
            Positions::F64(points) => Strided::from_slice(points),
        }
    }

    #[allow(clippy::len_without_is_empty, reason = "no mesh is empty")]
    pub fn len(&self) -> usize {
        self.view().len()
    }

    pub fn iter(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        let view = self.view();
        (0..view.len()).map(move |vertex| view.get3(vertex))
    }

    /// Rounded to f32, relative to a point.
    pub fn around(&self, origin: [f64; 3]) -> Vec<[f32; 3]> {
        self.iter().map(|p| minus(p, origin).map(|x| x as f32)).collect()
    }

    /// The point to draw this pose of a mesh around: the one that the rest pose is drawn around, which is the origin unless
    /// that is so far away that f32 would be too coarse. A pose far from there has a point of its own.
    pub fn origin(&self, rest: &Positions) -> [f64; 3] {
        let far = |points: &Positions, from: [f64; 3]| {
            let (centre, radius) = points.ball();
            let way = minus(centre, from);
            (dot(way, way).sqrt() > 100.0 * radius).then_some(centre)
        };
        let of_rest = far(rest, [0.0; 3]).unwrap_or_default();
        far(self, of_rest).unwrap_or(of_rest)
    }

    /// The middle of the box around all points, and half of its diagonal.
    fn ball(&self) -> ([f64; 3], f64) {
        let low = self.iter().fold([f64::MAX; 3], |a, p| [0, 1, 2].map(|c| a[c].min(p[c])));
        let high = self.iter().fold([f64::MIN; 3], |a, p| [0, 1, 2].map(|c| a[c].max(p[c])));
        let size = minus(high, low);
        ([0, 1, 2].map(|c| 0.5 * (low[c] + high[c])), 0.5 * dot(size, size).sqrt())
    }
}

/// A triangle for the sheet. UVs are relative to its tile.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub vertices: [u32; 3],
    pub uvs: [[f64; 2]; 3],
    /// UV indices of the corners: triangles that share them are connected.
    pub corners: [u32; 3],
    pub udim: u32,
}

impl Mesh {
    /// The mesh as vrtm takes it, with these positions at rest.
    pub fn source<'a>(&'a self, positions: Strided<'a>) -> MeshSource<'a> {
        MeshSource {
            positions,
            face_counts: Some(&self.face_counts),
            indices: &self.indices,
            uvs: UvSource { u: Strided::from_slice(&self.uvs), v: None, indices: Some(&self.uv_indices) },
            ..MeshSource::default()
        }
    }

    /// The range of corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = Range<usize>> {
        let mut end = 0;
        self.face_counts.iter().map(move |&count| {
            let start = end;
            end += count as usize;
            start..end
        })
    }

    /// UDIM number of the tile that holds a face's UV centroid.
    pub fn udim(&self, face: Range<usize>) -> Option<u32> {
        if self.uv_indices[face.start] == NO_UV {
            return None;
        }
        let n = face.len() as f64;
        let mut centroid = [0.0; 2];
        for &corner in &self.uv_indices[face] {
            let uv = self.uvs[corner as usize];
            centroid = [centroid[0] + f64::from(uv[0]) / n, centroid[1] + f64::from(uv[1]) / n];
        }
        let [u, v] = centroid.map(f64::floor);
        ((0.0..10.0).contains(&u) && (0.0..900.0).contains(&v)).then(|| 1001 + u as u32 + 10 * v as u32)
    }

    /// Triangulates the polygons as fans.
    pub fn triangles(&self) -> Vec<Triangle> {
        let mut triangles = Vec::new();
        for face in self.faces() {
            let Some(udim) = self.udim(face.clone()) else { continue };
            let offset = [f64::from((udim - 1001) % 10), f64::from((udim - 1001) / 10)];
            for k in face.start + 1..face.end - 1 {
                let corners = [face.start, k, k + 1];
                let uv_corners = corners.map(|c| self.uv_indices[c]);
                let uvs = uv_corners.map(|c| self.uvs[c as usize].map(f64::from));
                triangles.push(Triangle {
                    vertices: corners.map(|c| self.indices[c]),
                    uvs: uvs.map(|[u, v]| [u - offset[0], v - offset[1]]),
                    corners: uv_corners,
                    udim,
                });
            }
        }
        triangles
    }
}

/// Normals of vertices in a pose, weighted with the areas around them.
pub fn normals(triangles: &[Triangle], positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut normals = vec![[0.0; 3]; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.vertices.map(|v| positions[v as usize].map(f64::from));
        let area = cross(minus(b, a), minus(c, a));
        for v in triangle.vertices {
            let sum = &mut normals[v as usize];
            *sum = [0, 1, 2].map(|k| sum[k] + area[k]);
        }
    }
    let unit = |normal: [f64; 3]| {
        let length = dot(normal, normal).sqrt();
        if length > 0.0 { normal.map(|x| (x / length) as f32) } else { [0.0, 0.0, 1.0] }
    };
    normals.into_iter().map(unit).collect()
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
