//! The mesh of the program: polygons with UVs that have indices of their own, as in files and hosts.

use std::collections::BTreeSet;

use crate::camera::{cross, dot};

#[derive(Clone, Debug, Default)]
pub struct Mesh {
    pub rest: Vec<[f32; 3]>,
    pub face_counts: Vec<u32>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    pub uv_indices: Vec<u32>,
}

/// A triangle for the sheet's renderer. UVs are relative to its tile.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    pub vertices: [u32; 3],
    pub uvs: [[f64; 2]; 3],
    /// UV indices of the corners: triangles that share them are connected.
    pub corners: [u32; 3],
    pub udim: u32,
}

impl Triangle {
    /// Area in UV.
    pub fn uv_area(&self) -> f64 {
        let [a, b, c] = self.uvs;
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    }

    /// Area on the surface.
    pub fn area(&self, positions: &[[f32; 3]]) -> f64 {
        let [a, b, c] = self.vertices.map(|v| positions[v as usize].map(f64::from));
        let edge = |p: [f64; 3]| [p[0] - a[0], p[1] - a[1], p[2] - a[2]];
        let normal = cross(edge(b), edge(c));
        0.5 * dot(normal, normal).sqrt()
    }
}

impl Mesh {
    /// The range of corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let mut end = 0;
        self.face_counts.iter().map(move |&count| {
            let start = end;
            end += count as usize;
            start..end
        })
    }

    /// UDIM number of the tile that holds a face's UV centroid.
    fn udim(&self, face: std::ops::Range<usize>) -> Option<u32> {
        let n = face.len() as f64;
        let mut centroid = [0.0; 2];
        for &corner in &self.uv_indices[face] {
            let uv = self.uvs[corner as usize];
            centroid = [centroid[0] + f64::from(uv[0]) / n, centroid[1] + f64::from(uv[1]) / n];
        }
        let [u, v] = centroid.map(f64::floor);
        ((0.0..10.0).contains(&u) && (0.0..900.0).contains(&v)).then(|| 1001 + u as u32 + 10 * v as u32)
    }

    /// UDIM numbers of the tiles that faces lie in.
    pub fn udims(&self) -> BTreeSet<u32> {
        self.faces().filter_map(|face| self.udim(face)).collect()
    }

    /// Triangulates the polygons as fans.
    pub fn triangles(&self) -> Vec<Triangle> {
        let mut triangles = Vec::new();
        for face in self.faces() {
            let Some(udim) = self.udim(face.clone()) else { continue };
            let offset = [f64::from((udim - 1001) % 10), f64::from((udim - 1001) / 10)];
            for k in face.start + 1..face.end - 1 {
                let corners = [face.start, k, k + 1];
                triangles.push(Triangle {
                    vertices: corners.map(|c| self.indices[c]),
                    uvs: corners.map(|c| {
                        let uv = self.uvs[self.uv_indices[c] as usize];
                        [f64::from(uv[0]) - offset[0], f64::from(uv[1]) - offset[1]]
                    }),
                    corners: corners.map(|c| self.uv_indices[c]),
                    udim,
                });
            }
        }
        triangles
    }
}
