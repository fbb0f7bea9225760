//! What is open: a mesh with its poses, triangles and tiles.

use std::path::PathBuf;

use glam::Vec3;
use vrtm::{Asset, Backend, Device, DeviceSettings, MeshSource, Strided};
use vrtm_paint::Surface;

use crate::failure::{Failure, Result};
use crate::gltf::{self, Choice, Contents, Opened};
use crate::maps::Map;
use crate::mesh::{Mesh, Positions, Triangle};
use crate::numbers;
use crate::pictures::Pictures;
use crate::source::{Files, Frame, Source};
use crate::timeline::Timeline;

/// Keys, and points of each of them, that are looked at to tell how much room a mesh takes.
const MOST_KEYS: usize = 12;
const MOST_POINTS: usize = 5_000;
/// Triangles of all poses that are looked at to tell which one stretches most.
const MOST_TRIANGLES: usize = 2_000_000;

/// A mesh with its poses and maps.
pub struct Model {
    pub name: String,
    pub mesh: Mesh,
    pub frames: Vec<Frame>,
    /// The rest pose, and those of the frames, in f32 and near the origin.
    pub rest: Vec<[f32; 3]>,
    pub poses: Vec<Vec<[f32; 3]>>,
    /// The frames of rest and of the poses.
    pub timeline: Timeline,
    /// Sorted by tile.
    pub triangles: Vec<Triangle>,
    pub tiles: Vec<Tile>,
    pub pages: Vec<Page>,
    /// Most layers of a page; 0 = charts that lie over one another are solved together.
    pub layers: u32,
    /// The files that were read: they are replaced only if the user says so.
    pub inputs: Vec<PathBuf>,
    /// The request.
    pub files: Files,
    pub choice: Choice,
    /// Names of all that a glTF file holds.
    pub contents: Option<Contents>,
    /// Textures that the file brings.
    pub pictures: Pictures,
    /// A texture of the file that cannot be read.
    pub notice: Option<String>,
    /// Centre and radius of the mesh in all poses.
    pub centre: Vec3,
    pub radius: f32,
    /// The triangles to paint on.
    pub surface: Surface,
}

/// The layers that charts come into at most where they lie over one another, as in Blender.
pub const LAYERS: u32 = 32;

/// A unit of solving: a UDIM number with at least one triangle, or a layer of it.
pub struct Tile {
    pub page: usize,
    /// Index among the tiles of its page.
    pub layer: u32,
    /// Its triangles.
    pub range: std::ops::Range<usize>,
}

/// The maps of a UDIM number, which its layers share.
pub struct Page {
    pub udim: u32,
    pub rigidity: Option<Map>,
    pub mask: Option<Map>,
}

impl Model {
    /// A built-in scene without layers.
    #[cfg(test)]
    pub fn scene(name: &str) -> Model {
        let files = Files { scene: Some(name.into()), ..Files::default() };
        Model::layered(&files, &Choice::default(), 0).unwrap_or_else(|failure| panic!("{}", failure.0))
    }

    /// Charts that lie over one another come into up to so many layers.
    pub fn layered(files: &Files, choice: &Choice, layers: u32) -> Result<Model> {
        let Opened { source, contents, numbers, pictures: of_tiles, notice } = match &files.rest {
            Some(path) if gltf::is_gltf(path) => gltf::load(path, files, choice)?,
            _ => Opened { source: Source::load(files)?, ..Opened::default() },
        };
        let Source { name, origin, mesh, frames, mut maps, inputs, .. } = source;
        let near = |pose: &Positions| pose.around(pose.origin(&mesh.rest));
        let rest = near(&mesh.rest);
        let of_triangles = layers_of(&mesh, &rest, layers).map_err(|e| Failure::named(&origin, e.message))?;
        let mut sorted: Vec<_> = mesh.triangles().into_iter().zip(of_triangles).collect();
        sorted.sort_by_key(|(triangle, layer)| (triangle.udim, *layer));
        let (mut tiles, mut pages): (Vec<Tile>, Vec<Page>) = (Vec::new(), Vec::new());
        for (k, (triangle, layer)) in sorted.iter().enumerate() {
            if pages.last().is_none_or(|page| page.udim != triangle.udim) {
                let of_page = maps.remove(&triangle.udim).unwrap_or_default();
                pages.push(Page { udim: triangle.udim, rigidity: of_page.rigidity, mask: of_page.mask });
            }
            let page = pages.len() - 1;
            match tiles.last_mut() {
                Some(tile) if (tile.page, tile.layer) == (page, *layer) => tile.range.end = k + 1,
                _ => tiles.push(Tile { page, layer: *layer, range: k..k + 1 }),
            }
        }
        let triangles: Vec<Triangle> = sorted.into_iter().map(|(triangle, _)| triangle).collect();
        let poses: Vec<_> = frames.iter().map(|frame| near(&frame.positions)).collect();
        let mut pictures = Pictures::none(pages.len());
        for (k, page) in pages.iter().enumerate() {
            [pictures.colours[k], pictures.normals[k]] =
                of_tiles.get(&page.udim).cloned().unwrap_or_default();
        }
        let (centre, radius) = ball(rest.iter().chain(poses.iter().flatten()));
        let uvs = triangles.iter().map(|t| t.uvs.map(|uv| uv.map(|x| x as f32))).collect();
        let surface = Surface::new(triangles.iter().map(|t| t.vertices).collect(), uvs, rest.len());
        Ok(Model {
            timeline: timeline(numbers.or_else(|| numbers_of(&files.pose)), frames.len()),
            name,
            mesh,
            frames,
            rest,
            poses,
            triangles,
            tiles,
            pages,
            layers,
            inputs,
            files: files.clone(),
            choice: choice.clone(),
            contents,
            pictures,
            notice,
            centre,
            radius,
            surface,
        })
    }

    /// Rest and all poses: the keys of the timeline.
    pub fn keys(&self) -> Vec<&[[f32; 3]]> {
        std::iter::once(&self.rest).chain(&self.poses).map(Vec::as_slice).collect()
    }

    /// Points of all poses, or of some, that tell how much room the mesh takes.
    pub fn sample(&self) -> Vec<[f32; 3]> {
        let keys = self.keys();
        let keys = keys.iter().step_by(keys.len().div_ceil(MOST_KEYS));
        let step = self.rest.len().div_ceil(MOST_POINTS);
        keys.flat_map(|key| key.iter().step_by(step)).copied().collect()
    }

    /// The key that stretches or squeezes the edges of the mesh most, in the mean of the squares of relative changes.
    pub fn most_stretched(&self) -> usize {
        // Of many poses of many triangles some tell as much.
        let step = (self.triangles.len() * self.poses.len()).div_ceil(MOST_TRIANGLES).max(1);
        let change = |pose: &[[f32; 3]]| {
            let of_edge = |[a, b]: [u32; 2]| {
                let [rest, now] =
                    [&self.rest, pose].map(|p| Vec3::from(p[b as usize]).distance(p[a as usize].into()));
                if rest > 0.0 { f64::from(now / rest - 1.0).powi(2) } else { 0.0 }
            };
            let edges = |[a, b, c]: [u32; 3]| [[a, b], [b, c], [c, a]];
            self.triangles.iter().step_by(step).flat_map(|t| edges(t.vertices)).map(of_edge).sum::<f64>()
        };
        let changes: Vec<f64> = self.keys().into_iter().map(change).collect();
        (0..changes.len()).max_by(|&a, &b| changes[a].total_cmp(&changes[b])).unwrap_or(0)
    }

    /// The name of a key.
    pub fn note(&self, key: usize) -> String {
        match key.checked_sub(1).map(|k| &self.frames[k]) {
            None => "rest".into(),
            Some(frame) if frame.note.is_empty() => format!("pose {}", self.timeline.label(key)),
            Some(frame) => format!("pose {}: {}", self.timeline.label(key), frame.note),
        }
    }

    /// The tile of a triangle.
    pub fn tile_of(&self, triangle: usize) -> usize {
        self.tiles.partition_point(|tile| tile.range.end <= triangle)
    }
}

/// A mesh as vrtm takes it.
pub fn mesh_source<'a>(mesh: &'a Mesh, rest: &'a [[f32; 3]], layers: u32) -> MeshSource<'a> {
    MeshSource { max_layers: layers, ..mesh.source(Strided::from_slice(rest)) }
}

/// The layer of each triangle.
fn layers_of(mesh: &Mesh, rest: &[[f32; 3]], layers: u32) -> vrtm::Result<Vec<u32>> {
    let mut of_faces = vec![0; mesh.face_counts.len()];
    if layers > 1 {
        let device = Device::new(&DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() })?;
        Asset::new(&device, &mesh_source(mesh, rest, layers))?.results().face_layers(0, &mut of_faces)?;
    }
    let faces = mesh.faces().zip(of_faces).filter(|(face, _)| mesh.udim(face.clone()).is_some());
    let triangles = |(face, layer): (std::ops::Range<usize>, u32)| std::iter::repeat_n(layer, face.len() - 2);
    Ok(faces.flat_map(triangles).collect())
}

/// The numbers of files that are numbered as the frames of a shot.
fn numbers_of(files: &[PathBuf]) -> Option<Vec<i64>> {
    let stems: Vec<_> =
        files.iter().filter_map(|path| path.file_stem()).map(|s| s.to_string_lossy()).collect();
    numbers::frames(&stems.iter().map(AsRef::as_ref).collect::<Vec<_>>())
}

/// Poses with the numbers of frames, or without.
fn timeline(numbers: Option<Vec<i64>>, poses: usize) -> Timeline {
    // A file that holds several poses says nothing of their frames.
    match numbers.filter(|numbers| numbers.len() == poses) {
        Some(numbers) => Timeline::of_shot(&numbers),
        None => Timeline::new(poses + 1),
    }
}

/// A ball around points: the middle of their box, and the largest distance from it.
fn ball<'a>(points: impl Iterator<Item = &'a [f32; 3]> + Clone) -> (Vec3, f32) {
    let points = points.map(|&point| Vec3::from(point));
    let low = points.clone().fold(Vec3::MAX, Vec3::min);
    let centre = low.midpoint(points.clone().fold(Vec3::MIN, Vec3::max));
    (centre, points.map(|point| point.distance(centre)).fold(1e-12, f32::max))
}
