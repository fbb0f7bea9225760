//! The mesh of the program: polygons, and UVs with separate indices, as in files and hosts.

use std::ops::Range;

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub rest: Vec<[f32; 3]>,
    pub face_counts: Vec<u32>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    pub uv_indices: Vec<u32>,
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

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}
