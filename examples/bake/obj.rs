//! Wavefront OBJ: polygons stay polygons, vertices and UVs keep their order in the file.

use std::path::Path;

use obj::{LoadConfig, ObjData, ObjError};

use crate::failure::{Failure, Result, read};
use crate::mesh::Mesh;

/// Reads a mesh with UVs.
pub fn load_mesh(path: &Path) -> Result<Mesh> {
    let data = load(path)?;
    let mut mesh = Mesh { rest: data.position, uvs: data.texture, ..Mesh::default() };
    check_finite(path, "vt", &mesh.uvs)?;
    let polygons = data.objects.iter().flat_map(|object| &object.groups).flat_map(|group| &group.polys);
    for (face, polygon) in polygons.enumerate() {
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

/// Reads the vertices of a pose.
pub fn load_positions(path: &Path) -> Result<Vec<[f32; 3]>> {
    Ok(load(path)?.position)
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
