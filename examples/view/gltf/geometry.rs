//! The mesh of a file as vrtm takes it. Files have a vertex for each UV; here vertices that coincide and move alike are
//! one, so that the surface holds together at the seams of the UV map, and each corner has its own UV.

use std::collections::HashMap;

use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

use super::file::File;
use super::subject::{Subject, attribute, uvs};
use crate::mesh::Mesh;

/// Most tiles that UDIM numbers reach.
const MOST_TILES: usize = 9000;

/// Triangles, and all that moves their vertices.
#[derive(Default)]
pub struct Geometry {
    /// Without its positions.
    pub mesh: Mesh,
    pub points: Vec<[f32; 3]>,
    /// Joints of the skin and their weights, which add up to 1, per vertex; empty without a skin.
    pub influences: Vec<Vec<(u32, f64)>>,
    pub targets: Vec<Target>,
    /// Materials, a tile each: those with the same textures share one.
    pub materials: Vec<Material>,
    vertices: HashMap<Vec<u32>, u32>,
    corners: HashMap<(u32, [u32; 2]), u32>,
}

/// A morph target.
pub struct Target {
    pub name: String,
    /// The node that weights it, and its number there.
    pub weight: (usize, usize),
    /// Vertices that it moves, and how far.
    pub moves: Vec<(u32, [f32; 3])>,
}

/// Images of a material.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Material {
    pub colour: Option<Index<json::Image>>,
    pub normal: Option<Index<json::Image>>,
    /// Number of a material without a colour.
    number: Option<usize>,
}

impl Geometry {
    pub fn read(file: &File, subject: &Subject) -> Result<Geometry, String> {
        let mut geometry = Geometry::default();
        for &node in &subject.nodes {
            let Some(mesh) = file.root.nodes[node].mesh.and_then(|mesh| file.root.get(mesh)) else {
                continue;
            };
            let first = geometry.targets.len();
            let names = target_names(mesh);
            let count = mesh.primitives.iter().map(|part| part.targets.as_ref().map_or(0, Vec::len)).max();
            for k in 0..count.unwrap_or(0) {
                let name = names.get(k).cloned().unwrap_or_else(|| format!("target {k}"));
                geometry.targets.push(Target { name, weight: (node, k), moves: Vec::new() });
            }
            for part in &mesh.primitives {
                geometry.add(file, part, subject, first)?;
            }
        }
        match geometry.points.is_empty() {
            true => Err("no triangles with UVs (TEXCOORD_0)".into()),
            false => Ok(geometry),
        }
    }

    /// Adds triangles; `first` is the first target of their node.
    fn add(&mut self, file: &File, part: &Primitive, subject: &Subject, first: usize) -> Result<(), String> {
        let Some(of_uvs) = uvs(file, part) else { return Ok(()) };
        let positions = attribute(part, Semantic::Positions).ok_or("a mesh has no positions")?;
        let points = file.points(positions)?;
        let source = Source {
            uvs: placed(file, part, &file.numbers(of_uvs, Type::Vec2)?),
            influences: match &subject.skin {
                Some(skin) => influences(file, part, points.len(), skin.joints.len())?,
                None => Vec::new(),
            },
            targets: part
                .targets
                .iter()
                .flatten()
                .map(|target| target.positions.map(|of| file.points(of)).transpose())
                .collect::<Result<_, _>>()?,
            points,
        };
        source.check()?;
        let indices = match part.indices {
            Some(indices) => file.integers(indices, Type::Scalar)?,
            None => (0..source.points.len() as u32).collect(),
        };
        if let Some(index) = indices.iter().find(|&&index| index as usize >= source.points.len()) {
            return Err(format!("a triangle has vertex {index}, but there are {}", source.points.len()));
        }
        let tile = self.tile(file, part)?;
        let mut known = vec![None; source.points.len()];
        for corners in triangles(&indices, part.mode) {
            let vertices = corners.map(|corner| {
                *known[corner as usize].get_or_insert_with(|| self.vertex(&source, corner as usize, first))
            });
            let [a, b, c] = vertices;
            if a == b || b == c || c == a {
                continue;
            }
            let uvs = in_tile(corners.map(|corner| source.uvs[corner as usize]), tile);
            for (vertex, uv) in vertices.into_iter().zip(uvs) {
                let next = self.mesh.uvs.len() as u32;
                let index = *self.corners.entry((vertex, uv.map(f32::to_bits))).or_insert(next);
                if index == next {
                    self.mesh.uvs.push(uv);
                }
                self.mesh.uv_indices.push(index);
                self.mesh.indices.push(vertex);
            }
            self.mesh.face_counts.push(3);
        }
        Ok(())
    }

    /// The one vertex of all that lie there and move alike.
    fn vertex(&mut self, source: &Source, index: usize, first: usize) -> u32 {
        let point = source.points[index];
        // -0 is 0.
        let bits = |p: [f32; 3]| p.map(|x| (x + 0.0).to_bits());
        let influences = source.influences.get(index);
        let moves = source.targets.iter().zip(first..).filter_map(|(target, number)| {
            let by = target.as_ref()?[index];
            (by != [0.0; 3]).then_some((number, by))
        });
        let moves: Vec<(usize, [f32; 3])> = moves.collect();
        let mut key = bits(point).to_vec();
        for (joint, weight) in influences.into_iter().flatten() {
            key.extend([*joint, (*weight as f32).to_bits()]);
        }
        for (target, by) in &moves {
            // No joint.
            key.extend([u32::MAX, *target as u32]);
            key.extend(bits(*by));
        }
        let next = self.points.len() as u32;
        let vertex = *self.vertices.entry(key).or_insert(next);
        if vertex == next {
            self.points.push(point);
            self.influences.extend(influences.cloned());
            for (target, by) in moves {
                self.targets[target].moves.push((vertex, by));
            }
        }
        vertex
    }

    /// The tile of a part's material.
    fn tile(&mut self, file: &File, part: &Primitive) -> Result<usize, String> {
        let material = part.material.and_then(|material| file.root.get(material));
        let image = |texture: Index<json::Texture>| {
            file.root
                .get(texture)
                .map(|texture| texture.source)
                .filter(|image| file.root.get(*image).is_some())
        };
        let colour = material.and_then(|m| m.pbr_metallic_roughness.base_color_texture.as_ref());
        let colour = colour.and_then(|info| image(info.index));
        let normal = material.and_then(|m| m.normal_texture.as_ref()).and_then(|info| image(info.index));
        let number = part.material.filter(|_| colour.is_none()).map(|material| material.value());
        let material = Material { colour, normal, number };
        let place = self.materials.iter().position(|other| *other == material);
        let place = place.unwrap_or(self.materials.len());
        if place == self.materials.len() {
            self.materials.push(material);
        }
        if place < MOST_TILES { Ok(place) } else { Err(format!("more than {MOST_TILES} materials")) }
    }
}

/// Vertices of a file.
struct Source {
    points: Vec<[f32; 3]>,
    uvs: Vec<[f64; 2]>,
    influences: Vec<Vec<(u32, f64)>>,
    targets: Vec<Option<Vec<[f32; 3]>>>,
}

impl Source {
    /// All have a value for each vertex.
    fn check(&self) -> Result<(), String> {
        let moves = self.targets.iter().flatten().map(|target| ("moves of a morph target", target.len()));
        let counts = moves.chain([("UVs", self.uvs.len())]);
        let count = self.points.len();
        match counts.into_iter().find(|&(_, other)| other != count) {
            Some((name, other)) => Err(format!("{other} {name} for {count} vertices")),
            None => Ok(()),
        }
    }
}

/// UVs with v upward, as the base colour's texture is placed.
fn placed(file: &File, part: &Primitive, uvs: &[f32]) -> Vec<[f64; 2]> {
    let material = part.material.and_then(|material| file.root.get(material));
    let texture = material.and_then(|m| m.pbr_metallic_roughness.base_color_texture.as_ref());
    let transform = texture.and_then(|info| info.extensions.as_ref()?.texture_transform.as_ref());
    let pairs = uvs.chunks_exact(2).map(|uv| [uv[0], uv[1]].map(f64::from));
    let Some(transform) = transform else { return pairs.map(|[u, v]| [u, 1.0 - v]).collect() };
    let [offset, scale] = [transform.offset.0, transform.scale.0].map(|pair| pair.map(f64::from));
    let (sine, cosine) = f64::from(transform.rotation.0).sin_cos();
    let placed = pairs.map(|uv| {
        let [u, v] = [uv[0] * scale[0], uv[1] * scale[1]];
        [cosine * u + sine * v + offset[0], 1.0 - (cosine * v - sine * u + offset[1])]
    });
    placed.collect()
}

/// The UVs of a triangle in a tile: textures repeat in files, but each material has one tile.
fn in_tile(uvs: [[f64; 2]; 3], tile: usize) -> [[f32; 2]; 3] {
    let mut placed = [[0.0; 2]; 3];
    for (c, first) in [tile % 10, tile / 10].into_iter().enumerate() {
        let first = first as f64;
        let centre = uvs.iter().map(|uv| uv[c] / 3.0).sum::<f64>();
        let at = |shift: f64| uvs.map(|uv| (uv[c] + shift) as f32);
        let mut moved = at(first - centre.floor());
        // Just under the next tile, f32 may be in it.
        if moved.iter().map(|&x| f64::from(x) / 3.0).sum::<f64>() >= first + 1.0 {
            moved = at(first - centre.floor() - 1.0);
        }
        (0..3).for_each(|corner| placed[corner][c] = moved[corner]);
    }
    placed
}

/// Joints and weights of each vertex; without a weight it follows the first joint.
fn influences(
    file: &File,
    part: &Primitive,
    count: usize,
    joints: usize,
) -> Result<Vec<Vec<(u32, f64)>>, String> {
    let mut all = vec![Vec::new(); count];
    for set in 0.. {
        let of = |semantic| attribute(part, semantic);
        let (Some(of_joints), Some(of_weights)) = (of(Semantic::Joints(set)), of(Semantic::Weights(set)))
        else {
            break;
        };
        let places = file.integers(of_joints, Type::Vec4)?;
        let weights = file.numbers(of_weights, Type::Vec4)?;
        if [places.len(), weights.len()] != [4 * count; 2] {
            return Err(format!(
                "{} joints and {} weights for {count} vertices",
                places.len(),
                weights.len()
            ));
        }
        for (k, (&joint, &weight)) in places.iter().zip(&weights).enumerate() {
            if weight > 0.0 {
                if joint as usize >= joints {
                    return Err(format!("vertex {}: joint {joint} of {joints}", k / 4));
                }
                all[k / 4].push((joint, f64::from(weight)));
            }
        }
    }
    for vertex in &mut all {
        let sum: f64 = vertex.iter().map(|(_, weight)| weight).sum();
        vertex.iter_mut().for_each(|(_, weight)| *weight /= sum);
        vertex.sort_by_key(|(joint, _)| *joint);
        if vertex.is_empty() {
            vertex.push((0, 1.0));
        }
    }
    Ok(all)
}

/// The corners of each triangle.
fn triangles(indices: &[u32], mode: Checked<Mode>) -> Vec<[u32; 3]> {
    let three = |[a, b, c]: [usize; 3]| [indices[a], indices[b], indices[c]];
    let last = indices.len().saturating_sub(2);
    match mode {
        Checked::Valid(Mode::TriangleStrip) => {
            (0..last).map(|k| three([k, k + 1 + k % 2, k + 2 - k % 2])).collect()
        }
        Checked::Valid(Mode::TriangleFan) => (0..last).map(|k| three([k + 1, k + 2, 0])).collect(),
        _ => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// Names of a mesh's morph targets, as most programs write them.
fn target_names(mesh: &json::Mesh) -> Vec<String> {
    let extras: Option<serde_json::Value> =
        mesh.extras.as_ref().and_then(|raw| serde_json::from_str(raw.get()).ok());
    let names = extras.as_ref().and_then(|extras| extras["targetNames"].as_array());
    names.into_iter().flatten().map(|name| name.as_str().unwrap_or_default().to_string()).collect()
}
