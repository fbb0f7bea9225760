//! A posed mesh as triangles for a GPU: the normal, the UV within the tile and the tile's layer of each corner.

use bytemuck::{Pod, Zeroable};

use vrtm_examples::mesh::{Triangle, normals};

/// A corner of a triangle in the layout of `view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Corner {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub uv: [f32; 2],
    pub layer: u32,
}

/// The corners of triangles in a pose. `udims` lists the tiles in the order of their layers; triangles of other tiles
/// are left out.
pub fn corners(triangles: &[Triangle], positions: &[[f32; 3]], udims: &[u32]) -> Vec<Corner> {
    let normals = normals(triangles, positions);
    let mut corners = Vec::new();
    for triangle in triangles {
        let Some(layer) = udims.iter().position(|&udim| udim == triangle.udim) else { continue };
        for (vertex, uv) in triangle.vertices.into_iter().zip(triangle.uvs) {
            let (position, normal) = (positions[vertex as usize], normals[vertex as usize]);
            corners.push(Corner { position, normal, uv: uv.map(|x| x as f32), layer: layer as u32 });
        }
    }
    corners
}
