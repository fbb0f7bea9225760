//! Wavefront OBJ: polygons stay polygons, vertices and UVs keep their order in the file.

use std::path::Path;

use obj::{LoadConfig, ObjData, ObjError, Object, SimplePolygon};

use crate::failure::{Failure, Result, read};
use crate::mesh::Mesh;

/// Reads a mesh with UVs.
pub fn load_mesh(path: &Path) -> Result<Mesh> {
    let data = load(path)?;
    let mut mesh = Mesh { rest: data.position, uvs: data.texture, ..Mesh::default() };
    check_finite(path, "vt", &mesh.uvs)?;
    for (face, polygon) in polygons(&data.objects).enumerate() {
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

/// Reads the vertices of a pose. Faces, if it has some, must be those of the rest mesh: others tell that the vertices are in
/// another order.
pub fn load_positions(path: &Path, rest: &Mesh) -> Result<Vec<[f32; 3]>> {
    let data = load(path)?;
    let faces: Vec<Vec<u32>> =
        polygons(&data.objects).map(|face| face.0.iter().map(|corner| corner.0 as u32).collect()).collect();
    // A wrong number of vertices is told first, elsewhere.
    if faces.is_empty() || data.position.len() != rest.rest.len() {
        return Ok(data.position);
    }
    for (number, (face, range)) in (1..).zip(faces.iter().zip(rest.faces())) {
        let expected = &rest.indices[range];
        if !is_rotated(face, expected) {
            let list = |face: &[u32]| {
                face.iter().map(|vertex| (vertex + 1).to_string()).collect::<Vec<_>>().join(" ")
            };
            let reason = format!(
                "face {number} has the vertices {}, but that of the rest mesh has {}: the vertices must be in the same order",
                list(face),
                list(expected)
            );
            return Err(Failure::file(path, reason));
        }
    }
    if faces.len() != rest.face_counts.len() {
        let reason = format!("{} faces, but the rest mesh has {}", faces.len(), rest.face_counts.len());
        return Err(Failure::file(path, reason));
    }
    Ok(data.position)
}

fn polygons(objects: &[Object]) -> impl Iterator<Item = &SimplePolygon> {
    objects.iter().flat_map(|object| &object.groups).flat_map(|group| &group.polys)
}

/// True if two faces have the same corners in the same order, whichever comes first.
fn is_rotated(face: &[u32], expected: &[u32]) -> bool {
    let n = face.len();
    n == expected.len() && (0..n).any(|first| (0..n).all(|k| face[(first + k) % n] == expected[k]))
}

fn load(path: &Path) -> Result<ObjData> {
    let bytes = read(path)?;
    let config = LoadConfig { strict: false };
    let data = ObjData::load_buf_with_config(bytes.as_slice(), config)
        .map_err(|error| Failure::file(path, explain(&error)))?;
    if data.position.is_empty() {
        return Err(Failure::file(path, "no vertices (v); is it an OBJ file?"));
    }
    check_finite(path, "v", &data.position)?;
    Ok(data)
}

/// The OBJ reader counts lines from 0, editors from 1.
fn explain(error: &ObjError) -> String {
    match error {
        ObjError::MalformedFaceGroup { line_number, group } => {
            format!("line {}: '{group}' is not a face corner", line_number + 1)
        }
        ObjError::ArgumentListFailure { line_number, list } => {
            format!("line {}: cannot read {list}", line_number + 1)
        }
        ObjError::ZeroVertexNumber { line_number } => {
            format!("line {}: index 0, but they start at 1", line_number + 1)
        }
        other => other.to_string(),
    }
}

fn check_finite<const N: usize>(path: &Path, name: &str, values: &[[f32; N]]) -> Result<()> {
    match values.iter().position(|value| value.iter().any(|x| !x.is_finite())) {
        Some(i) => Err(Failure::file(path, format!("{name} {} is {:?}, not finite", i + 1, values[i]))),
        None => Ok(()),
    }
}
