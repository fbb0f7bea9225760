//! A posed mesh as triangles for a GPU: the normal, the UV within the tile and the tile's layer of each corner.

use bytemuck::{Pod, Zeroable};

use super::model::Model;

/// A corner of a triangle in the layout of `view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Corner {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub uv: [f32; 2],
    pub layer: u32,
}

/// Triangulates the polygons as fans. `udims` lists the tiles in the order of their layers; faces of other tiles are left
/// out.
pub fn corners(model: &Model, positions: &[[f32; 3]], udims: &[u32]) -> Vec<Corner> {
    let normals = normals(model, positions);
    let mut corners = Vec::new();
    for face in model.faces() {
        let uv = |corner: usize| model.uvs[model.uv_indices[corner] as usize];
        let centre = [0, 1].map(|c| face.clone().map(|k| uv(k)[c]).sum::<f32>() / face.len() as f32);
        let tile = centre.map(f32::floor);
        let udim = 1001 + tile[0].max(0.0) as u32 + 10 * tile[1].max(0.0) as u32;
        let Some(layer) = udims.iter().position(|&u| u == udim) else { continue };
        for k in face.start + 1..face.end - 1 {
            corners.extend([face.start, k, k + 1].map(|corner| {
                let vertex = model.indices[corner] as usize;
                Corner {
                    position: positions[vertex],
                    normal: normals[vertex],
                    uv: [0, 1].map(|c| uv(corner)[c] - tile[c]),
                    layer: layer as u32,
                }
            }));
        }
    }
    corners
}

/// Normals of the vertices, weighted by the faces' areas.
fn normals(model: &Model, positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut normals = vec![[0.0; 3]; positions.len()];
    for face in model.faces() {
        let vertices = &model.indices[face];
        for k in 1..vertices.len() - 1 {
            let [a, b, c] = [0, k, k + 1].map(|k| positions[vertices[k] as usize]);
            let edge = |p: [f32; 3]| [0, 1, 2].map(|i| p[i] - a[i]);
            let (p, q) = (edge(b), edge(c));
            let area = [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]];
            for corner in [0, k, k + 1] {
                let sum = &mut normals[vertices[corner] as usize];
                *sum = [0, 1, 2].map(|i| sum[i] + area[i]);
            }
        }
    }
    for normal in &mut normals {
        let length = normal.iter().map(|x| x * x).sum::<f32>().sqrt().max(1e-30);
        *normal = normal.map(|x| x / length);
    }
    normals
}
