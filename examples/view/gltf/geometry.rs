//! The mesh of a file as vrtm takes it. Files have a vertex for each UV; here vertices that coincide and move alike are
//! one, so that the surface holds together at the seams of the UV map, and each corner has its own UV.

use std::collections::HashMap;
use std::ops::Range;

use glam::{DMat4, Mat4};
use gltf::json::accessor::Type;
use gltf::json::material::AlphaMode;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

use super::file::File;
use super::nodes::Nodes;
use super::subject::{Subject, attribute, has_triangles, uvs};
use crate::mesh::Mesh;

/// Most tiles that UDIM numbers reach.
const MOST_TILES: usize = 9000;

/// Triangles, and all that moves their vertices.
#[derive(Default)]
pub struct Geometry {
    /// Without its positions.
    pub mesh: Mesh,
    pub points: Vec<[f32; 3]>,
    pub bones: Vec<Bone>,
    /// Bones and their weights, which add up to 1, per vertex.
    pub influences: Vec<Vec<(u32, f64)>>,
    pub targets: Vec<Target>,
    /// Materials, a tile each: those with the same textures share one.
    pub materials: Vec<Material>,
    vertices: HashMap<Vec<u32>, u32>,
    corners: HashMap<(u32, [u32; 2]), u32>,
}

/// A joint of a skin, or the node of a mesh without one.
pub struct Bone {
    pub node: usize,
    pub inverse_bind: DMat4,
    /// The topmost bone of its skin.
    pub top: usize,
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
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    pub colour: Option<Index<json::Image>>,
    pub normal: Option<Index<json::Image>>,
    /// Factors of red, green, blue and alpha, linear.
    pub factor: [f32; 4],
    /// Alpha from which a texel is there: 0 throughout where it is opaque; `None` where it is blended.
    pub cutoff: Option<f32>,
    /// Number of a material without an image.
    number: Option<usize>,
}

impl Geometry {
    pub fn read(file: &File, nodes: &Nodes, subject: &Subject) -> Result<Geometry, String> {
        let mut geometry = Geometry::default();
        for &node in &subject.nodes {
            let Some(mesh) = file.root.nodes[node].mesh.and_then(|mesh| file.root.get(mesh)) else {
                continue;
            };
            let bones = geometry.bones(file, nodes, node)?;
            let is_skinned = file.root.nodes[node].skin.is_some();
            let first = geometry.targets.len();
            let names = target_names(mesh);
            let count = mesh.primitives.iter().map(|part| part.targets.as_ref().map_or(0, Vec::len)).max();
            for k in 0..count.unwrap_or(0) {
                let name = names.get(k).cloned().unwrap_or_else(|| format!("target {k}"));
                geometry.targets.push(Target { name, weight: (node, k), moves: Vec::new() });
            }
            for part in mesh.primitives.iter().filter(|part| has_triangles(part)) {
                geometry.add(file, part, (&bones, is_skinned), first)?;
            }
        }
        match geometry.points.is_empty() {
            true => Err("no triangles with UVs (TEXCOORD_0)".into()),
            false => Ok(geometry),
        }
    }

    /// The bones of a node's mesh: the joints of its skin, or itself. Skins that are alike share theirs.
    fn bones(&mut self, file: &File, nodes: &Nodes, node: usize) -> Result<Range<u32>, String> {
        let joints = match file.root.nodes[node].skin {
            Some(skin) => joints(file, skin).map_err(|reason| format!("skin {}: {reason}", skin.value()))?,
            None => vec![(node, DMat4::IDENTITY)],
        };
        let count = joints.len();
        let is = |(bone, joint): (&Bone, &(usize, DMat4))| (bone.node, bone.inverse_bind) == *joint;
        let known = self.bones.windows(count).position(|bones| bones.iter().zip(&joints).all(is));
        let first = known.unwrap_or(self.bones.len());
        if known.is_none() {
            let of_joints: Vec<usize> = joints.iter().map(|joint| joint.0).collect();
            let top = first + nodes.topmost(&of_joints).unwrap_or(0);
            let bone = |(node, inverse_bind)| Bone { node, inverse_bind, top };
            self.bones.extend(joints.into_iter().map(bone));
        }
        Ok(first as u32..(first + count) as u32)
    }

    /// Adds triangles; `first` is the first target of their node.
    fn add(
        &mut self,
        file: &File,
        part: &Primitive,
        (bones, is_skinned): (&Range<u32>, bool),
        first: usize,
    ) -> Result<(), String> {
        let positions = attribute(part, Semantic::Positions).ok_or("a mesh has no positions")?;
        let points = file.points(positions)?;
        let source = Source {
            uvs: match uvs(file, part) {
                Some(uvs) => placed(file, part, &file.numbers(uvs, Type::Vec2)?),
                // Nothing of them can be painted or moves on the texture: they are there to be seen.
                None => vec![[0.5; 2]; points.len()],
            },
            influences: influences(file, part, points.len(), bones, is_skinned)?,
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
        let influences = &source.influences[index];
        let moves = source.targets.iter().zip(first..).filter_map(|(target, number)| {
            let by = target.as_ref()?[index];
            (by != [0.0; 3]).then_some((number, by))
        });
        let moves: Vec<(usize, [f32; 3])> = moves.collect();
        let mut key = bits(point).to_vec();
        for (joint, weight) in influences {
            key.extend([*joint, (*weight as f32).to_bits()]);
        }
        for (target, by) in &moves {
            // No bone.
            key.extend([u32::MAX, *target as u32]);
            key.extend(bits(*by));
        }
        let next = self.points.len() as u32;
        let vertex = *self.vertices.entry(key).or_insert(next);
        if vertex == next {
            self.points.push(point);
            self.influences.push(influences.clone());
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
        let seen = material.filter(|_| uvs(file, part).is_some());
        let colour = seen.and_then(|m| m.pbr_metallic_roughness.base_color_texture.as_ref());
        let colour = colour.and_then(|info| image(info.index));
        let normal = seen.and_then(|m| m.normal_texture.as_ref()).and_then(|info| image(info.index));
        let number = part.material.filter(|_| colour.is_none()).map(|material| material.value());
        let factor = material.map_or([1.0; 4], |m| m.pbr_metallic_roughness.base_color_factor.0);
        let cutoff = material.map_or(Some(0.0), |m| match m.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Some(m.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0)),
            Checked::Valid(AlphaMode::Blend) => None,
            _ => Some(0.0),
        });
        let material = Material { colour, normal, factor, cutoff, number };
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

/// The joints of a skin, with their inverse bind matrices.
fn joints(file: &File, skin: Index<json::Skin>) -> Result<Vec<(usize, DMat4)>, String> {
    let skin = file.root.get(skin).ok_or("is missing")?;
    let joints: Vec<usize> = skin.joints.iter().map(|joint| joint.value()).collect();
    if let Some(joint) = joints.iter().find(|&&joint| joint >= file.root.nodes.len()) {
        return Err(format!("node {joint} is missing"));
    }
    let binds = skin.inverse_bind_matrices.map(|matrices| file.numbers(matrices, Type::Mat4)).transpose()?;
    let binds: Vec<DMat4> = match &binds {
        Some(numbers) => numbers.as_chunks().0.iter().map(|m| Mat4::from_cols_array(m).as_dmat4()).collect(),
        None => vec![DMat4::IDENTITY; joints.len()],
    };
    if joints.is_empty() || binds.len() < joints.len() {
        return Err(format!("{} inverse bind matrices for {} joints", binds.len(), joints.len()));
    }
    Ok(joints.into_iter().zip(binds).collect())
}

/// Bones and weights of each vertex; without a weight it follows the first bone.
fn influences(
    file: &File,
    part: &Primitive,
    count: usize,
    bones: &Range<u32>,
    is_skinned: bool,
) -> Result<Vec<Vec<(u32, f64)>>, String> {
    let mut all = vec![Vec::new(); count];
    let sets = if is_skinned { 0..u32::MAX } else { 0..0 };
    for set in sets {
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
                if joint as usize >= bones.len() {
                    return Err(format!("vertex {}: joint {joint} of {}", k / 4, bones.len()));
                }
                all[k / 4].push((bones.start + joint, f64::from(weight)));
            }
        }
    }
    for vertex in &mut all {
        let sum: f64 = vertex.iter().map(|(_, weight)| weight).sum();
        vertex.iter_mut().for_each(|(_, weight)| *weight /= sum);
        vertex.sort_by_key(|(joint, _)| *joint);
        if vertex.is_empty() {
            vertex.push((bones.start, 1.0));
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
