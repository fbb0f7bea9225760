//! Writes asset folders: asset.json, rest.obj, frames.f32 (little-endian, frames x vertices x 3), rigidity maps and masks as
//! PNG.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Map, json};

use crate::scenes::Scene;

/// Writes a scene as the folder of an asset with this name. A file of an earlier asset is replaced.
pub fn save(scene: &Scene, name: &str, folder: &Path) -> Result<(), String> {
    let fail = |path: &Path, error: &dyn std::fmt::Display| format!("{}: {error}", path.display());
    std::fs::create_dir_all(folder).map_err(|error| fail(folder, &error))?;
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|error| fail(&path, &error))
    };
    let mut lists = [Map::new(), Map::new()];
    for tile in &scene.tiles {
        let both = [("rigidity", Some(&tile.rigidity)), ("mask", tile.mask.as_ref())];
        for ((kind, bytes), list) in both.into_iter().zip(&mut lists) {
            let Some(bytes) = bytes else { continue };
            let name = format!("{kind}.{}.png", tile.udim);
            let path = folder.join(&name);
            image::save_buffer(&path, bytes, tile.width, tile.height, image::ExtendedColorType::L8)
                .map_err(|error| fail(&path, &error))?;
            list.insert(tile.udim.to_string(), name.into());
        }
    }
    let [rigidity, mask] = lists;
    let mut text = json!({ "name": name, "frames": scene.poses.len(), "rigidity": rigidity, "mask": mask });
    if scene.notes.len() == scene.poses.len() {
        text["frame_notes"] = json!(scene.notes);
    }
    write("asset.json", format!("{text:#}\n").as_bytes())?;
    write("rest.obj", obj(scene, &scene.rest).as_bytes())?;
    let bytes: Vec<u8> = scene.poses.iter().flatten().flatten().flat_map(|x| x.to_le_bytes()).collect();
    write("frames.f32", &bytes)
}

/// A scene's mesh as the text of an OBJ file, with given positions.
pub fn obj(scene: &Scene, positions: &[[f32; 3]]) -> String {
    let mut text = String::new();
    for [x, y, z] in positions {
        let _ = writeln!(text, "v {x} {y} {z}");
    }
    for [u, v] in &scene.uvs {
        let _ = writeln!(text, "vt {u} {v}");
    }
    let mut corners = scene.indices.iter().zip(&scene.uv_indices);
    for &count in &scene.face_counts {
        text += "f";
        for (vertex, uv) in corners.by_ref().take(count as usize) {
            let _ = write!(text, " {}/{}", vertex + 1, uv + 1);
        }
        text += "\n";
    }
    text
}
