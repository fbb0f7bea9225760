//! Reads Wavefront OBJ: polygons stay polygons, and vertices and UVs keep their order in the file.

use std::path::Path;

use obj::{LoadConfig, ObjData, SimplePolygon};

use crate::failure::{Failure, Result, read};
use crate::mesh::Mesh;

/// Reads a mesh with UVs.
pub fn load_mesh(path: &Path) -> Result<Mesh> {
    let data = load(path)?;
    let mut mesh = Mesh { rest: data.position.clone(), uvs: data.texture.clone(), ..Mesh::default() };
    for (face, polygon) in polygons(&data).enumerate() {
        let bad = |what: String| Failure::file(path, format!("face {} {what}", face + 1));
        if polygon.0.len() < 3 {
            return Err(bad(format!("has {} corners", polygon.0.len())));
        }
        mesh.face_counts.push(polygon.0.len() as u32);
        for corner in &polygon.0 {
            let uv = corner.1.ok_or_else(|| bad("has no texture coordinates (vt)".into()))?;
            for (index, count, name) in [(corner.0, mesh.rest.len(), "v"), (uv, mesh.uvs.len(), "vt")] {
                if index >= count {
                    return Err(bad(format!("names a {name} that the file does not have (of {count})")));
                }
            }
            mesh.indices.push(corner.0 as u32);
            mesh.uv_indices.push(uv as u32);
        }
    }
    if mesh.face_counts.is_empty() {
        return Err(Failure::file(path, "no faces"));
    }
    Ok(mesh)
}

/// Reads the vertices of a pose. If the file has faces, they must be those of the rest mesh: other faces mean that the
/// vertices are in a different order.
pub fn load_positions(path: &Path, rest: &Mesh) -> Result<Vec<[f32; 3]>> {
    let data = load(path)?;
    let count = polygons(&data).count();
    // A wrong number of vertices is reported first, elsewhere.
    if count == 0 || data.position.len() != rest.rest.len() {
        return Ok(data.position);
    }
    for (number, (face, range)) in (1..).zip(polygons(&data).zip(rest.faces())) {
        let face: Vec<u32> = face.0.iter().map(|corner| corner.0 as u32).collect();
        if !is_rotated(&face, &rest.indices[range.clone()]) {
            let list = |face: &[u32]| face.iter().map(|v| format!(" {}", v + 1)).collect::<String>();
            let reason = format!(
                "face {number} has the vertices{}, but that of the rest mesh has{}: the vertices must be in the same order",
                list(&face),
                list(&rest.indices[range])
            );
            return Err(Failure::file(path, reason));
        }
    }
    if count != rest.face_counts.len() {
        let reason = format!("{count} faces, but the rest mesh has {}", rest.face_counts.len());
        return Err(Failure::file(path, reason));
    }
    Ok(data.position)
}

fn polygons(data: &ObjData) -> impl Iterator<Item = &SimplePolygon> {
    data.objects.iter().flat_map(|object| &object.groups).flat_map(|group| &group.polys)
}

/// True if two faces have the same corners in the same cyclic order.
fn is_rotated(face: &[u32], expected: &[u32]) -> bool {
    let n = face.len();
    n == expected.len() && (0..n).any(|first| (0..n).all(|k| face[(first + k) % n] == expected[k]))
}

fn load(path: &Path) -> Result<ObjData> {
    // The reader counts lines from 0 and editors count from 1, so one more line makes both agree.
    let text = [b"\n", read(path)?.as_slice()].concat();
    let data = ObjData::load_buf_with_config(text.as_slice(), LoadConfig { strict: false })
        .map_err(|error| Failure::file(path, error))?;
    if data.position.is_empty() {
        return Err(Failure::file(path, "no vertices (v); is it an OBJ file?"));
    }
    Ok(data)
}
