//! Reads and writes asset folders: asset.json, rest.obj, frames.f32 (little-endian, frames x vertices x 3), rigidity
//! maps as PNG.

use std::path::{Path, PathBuf};

use obj::ObjData;
use serde_json::Value;

use crate::model::Model;
use crate::scenes::Scene;
use crate::scenes::TileMaps as Maps;

/// The folder of the assets, if it exists. With VRTM_REQUIRE_ASSETS=1 it must exist.
fn folder() -> Option<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets");
    if folder.is_dir() {
        return Some(folder);
    }
    assert!(
        std::env::var_os("VRTM_REQUIRE_ASSETS").is_none_or(|value| value != "1"),
        "VRTM_REQUIRE_ASSETS is set, but {} is not there",
        folder.display()
    );
    println!("skipped: ../shared/assets is not there");
    None
}

/// All assets. Empty, with a message, if there is no folder of assets.
pub fn assets() -> Vec<Model> {
    let Some(folder) = folder() else { return Vec::new() };
    let mut names: Vec<PathBuf> = std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    names.retain(|path| path.join("asset.json").is_file());
    names.sort();
    assert!(!names.is_empty(), "no asset in ../shared/assets");
    names.iter().map(|path| load(path)).collect()
}

fn load(folder: &Path) -> Model {
    let read = |name: &str| {
        let path = folder.join(name);
        std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
    };
    let json: Value = serde_json::from_slice(&read("asset.json")).unwrap();
    let data = ObjData::load_buf(read("rest.obj").as_slice()).unwrap();
    let mut model = Model {
        name: json["name"].as_str().unwrap().into(),
        rest: data.position,
        uvs: data.texture,
        ..Model::default()
    };
    for polygon in data.objects.iter().flat_map(|object| &object.groups).flat_map(|group| &group.polys) {
        model.face_counts.push(polygon.0.len() as u32);
        for corner in &polygon.0 {
            model.indices.push(corner.0 as u32);
            model.uv_indices.push(corner.1.unwrap() as u32);
        }
    }
    let floats = read("frames.f32");
    let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
    let points: Vec<[f32; 3]> =
        floats.chunks_exact(12).map(|p| [float(p), float(&p[4..]), float(&p[8..])]).collect();
    model.frames = points.chunks_exact(model.rest.len()).map(<[_]>::to_vec).collect();
    assert_eq!(model.frames.len() as u64, json["frames"].as_u64().unwrap(), "{}", model.name);
    for (udim, file) in json["rigidity"].as_object().unwrap() {
        let bytes = read(file.as_str().unwrap());
        let image = image::load_from_memory(&bytes).unwrap().into_luma8();
        let (width, height) = image.dimensions();
        let rigidity = image.into_raw();
        model.maps.push(Maps { udim: udim.parse().unwrap(), width, height, rigidity, mask: None });
    }
    model
}

/// Writes a model as a folder of an asset, with other frames than its own.
pub fn save(model: &Model, frames: &[Vec<[f32; 3]>], folder: &Path) -> Result<(), String> {
    crate::save::save(&Scene { poses: frames.to_vec(), ..model.scene() }, &model.name, folder)
}

/// A model as the text of an OBJ file, with given positions.
pub fn obj(model: &Model, positions: &[[f32; 3]]) -> String {
    crate::save::obj(&model.scene(), positions)
}
