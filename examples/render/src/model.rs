//! The model to draw: a built-in scene, or an asset's folder.

use std::path::Path;

use vrtm_examples::mesh::Mesh;
use vrtm_examples::source::{Files, Frame, Source};
use vrtm_testkit::scenes::TileMaps;

use super::Result;

/// A mesh at rest, its frames, and the rigidity of its tiles.
pub struct Model {
    pub name: String,
    pub mesh: Mesh,
    pub rest: Vec<[f32; 3]>,
    pub frames: Vec<Vec<[f32; 3]>>,
    pub tiles: Vec<TileMaps>,
}

impl Model {
    /// A built-in scene.
    pub fn scene(name: &str) -> Result<Model> {
        Model::load(&Files { scene: Some(name.into()), ..Files::default() })
    }

    /// A folder with asset.json, rest.obj, frames.f32 and rigidity maps, as the bake example takes it.
    pub fn folder(folder: &Path) -> Result<Model> {
        Model::load(&Files { asset: Some(folder.into()), ..Files::default() })
    }

    fn load(files: &Files) -> Result<Model> {
        let Source { name, mesh, frames, maps, .. } = Source::load(files).map_err(|failure| failure.0)?;
        let tiles = maps.into_iter().filter_map(|(udim, maps)| {
            let map = maps.rigidity?;
            let rigidity = map.values().into_iter().map(|value| (255.0 * value).round() as u8).collect();
            Some(TileMaps { udim, width: map.size[0], height: map.size[1], rigidity, mask: None })
        });
        let near = |frame: Frame| frame.positions.around([0.0; 3]);
        let (frames, tiles) = (frames.into_iter().map(near).collect(), tiles.collect());
        Ok(Model { name, rest: mesh.rest.around([0.0; 3]), mesh, frames, tiles })
    }

    /// Positions of a frame, numbered from 1.
    pub fn frame(&self, number: usize) -> Result<&[[f32; 3]]> {
        let frame = number.checked_sub(1).and_then(|k| self.frames.get(k));
        frame
            .map(Vec::as_slice)
            .ok_or_else(|| format!("--frame {number}: {} has frames 1 to {}", self.name, self.frames.len()))
    }
}
