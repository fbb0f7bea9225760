//! The model to draw: a built-in scene, or an asset's folder.

use std::path::Path;

use obj::ObjData;
use serde_json::Value;

use super::Result;
use vrtm_testkit::scenes::{self, Scene, TileMaps};

/// A mesh at rest, its frames, and the rigidity of its tiles.
#[derive(Default)]
pub struct Model {
    pub name: String,
    pub rest: Vec<[f32; 3]>,
    pub face_counts: Vec<u32>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    pub uv_indices: Vec<u32>,
    pub frames: Vec<Vec<[f32; 3]>>,
    pub tiles: Vec<TileMaps>,
}

impl Model {
    /// A built-in scene.
    ///
    /// # Errors
    /// An unknown name.
    pub fn scene(name: &str) -> Result<Model> {
        let names = || format!("--scene {name}: not one of {}", scenes::NAMES.join(", "));
        let Scene { name, rest, face_counts, indices, uvs, uv_indices, poses, tiles, .. } =
            scenes::by_name(name).ok_or_else(names)?;
        Ok(Model { name: name.into(), rest, face_counts, indices, uvs, uv_indices, frames: poses, tiles })
    }

    /// A folder with asset.json, rest.obj, frames.f32 and rigidity maps, as the bake example takes it.
    ///
    /// # Errors
    /// A missing or invalid file.
    pub fn folder(folder: &Path) -> Result<Model> {
        let said =
            |name: &str, why: &dyn std::fmt::Display| format!("{}: {why}", folder.join(name).display());
        let read = |name: &str| std::fs::read(folder.join(name)).map_err(|e| said(name, &e));
        let json: Value = serde_json::from_slice(&read("asset.json")?).map_err(|e| said("asset.json", &e))?;
        let data = ObjData::load_buf(read("rest.obj")?.as_slice()).map_err(|e| said("rest.obj", &e))?;
        let mut model = Model {
            name: json["name"].as_str().unwrap_or("asset").into(),
            rest: data.position,
            uvs: data.texture,
            ..Model::default()
        };
        let groups = data.objects.iter().flat_map(|object| &object.groups);
        for polygon in groups.flat_map(|group| &group.polys) {
            model.face_counts.push(polygon.0.len() as u32);
            for corner in &polygon.0 {
                let uv = corner.1.ok_or_else(|| said("rest.obj", &"a face corner has no UV"))?;
                model.indices.push(corner.0 as u32);
                model.uv_indices.push(uv as u32);
            }
        }
        let bytes = read("frames.f32")?;
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let points: Vec<[f32; 3]> =
            bytes.chunks_exact(12).map(|p| [float(p), float(&p[4..]), float(&p[8..])]).collect();
        if model.rest.is_empty() || bytes.len() % (12 * model.rest.len()) != 0 {
            let why = format!("not a whole number of frames of {} vertices", model.rest.len());
            return Err(said("frames.f32", &why));
        }
        model.frames = points.chunks_exact(model.rest.len()).map(<[_]>::to_vec).collect();
        for (udim, file) in json["rigidity"].as_object().into_iter().flatten() {
            let bad = || said("asset.json", &"\"rigidity\" should map UDIM numbers to file names");
            let udim = udim.parse().map_err(|_| bad())?;
            let file = file.as_str().ok_or_else(bad)?;
            let image = image::open(folder.join(file)).map_err(|e| said(file, &e))?.into_luma8();
            let (width, height) = image.dimensions();
            model.tiles.push(TileMaps { udim, width, height, rigidity: image.into_raw(), mask: None });
        }
        Ok(model)
    }

    /// Positions of a frame, numbered from 1.
    ///
    /// # Errors
    /// An unknown frame number.
    pub fn frame(&self, number: usize) -> Result<&[[f32; 3]]> {
        let frame = number.checked_sub(1).and_then(|k| self.frames.get(k));
        frame
            .map(Vec::as_slice)
            .ok_or_else(|| format!("--frame {number}: {} has frames 1 to {}", self.name, self.frames.len()))
    }

    /// The range of corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = std::ops::Range<usize>> {
        let mut end = 0;
        self.face_counts.iter().map(move |&count| {
            end += count as usize;
            end - count as usize..end
        })
    }
}
