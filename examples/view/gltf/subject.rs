//! The meshes of a file that can be opened: each node's own, and together those that one skin moves.

use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{self, Index};

use super::file::File;
use super::nodes::Nodes;

/// A mesh that can be opened.
pub struct Subject {
    pub name: String,
    /// Nodes that hold its parts.
    pub nodes: Vec<usize>,
    /// Joints, if a skin moves it.
    pub skin: Option<Skin>,
    /// Number of indices, a measure of its size.
    size: u64,
}

/// Joints that move a mesh.
#[derive(Clone, PartialEq)]
pub struct Skin {
    /// Their nodes.
    pub joints: Vec<usize>,
    /// 16 numbers per joint, column by column; empty = identities.
    pub inverse_bind: Vec<f32>,
}

impl Skin {
    fn read(file: &File, index: Index<json::Skin>) -> Result<Skin, String> {
        let failed = |reason: String| format!("skin {}: {reason}", index.value());
        let skin = file.root.get(index).ok_or_else(|| failed("is missing".into()))?;
        let joints: Vec<usize> = skin.joints.iter().map(|joint| joint.value()).collect();
        if let Some(joint) = joints.iter().find(|&&joint| joint >= file.root.nodes.len()) {
            return Err(failed(format!("node {joint} is missing")));
        }
        let matrices = skin.inverse_bind_matrices.map(|matrices| file.numbers(matrices, Type::Mat4));
        let inverse_bind = matrices.transpose().map_err(failed)?.unwrap_or_default();
        if joints.is_empty() || (!inverse_bind.is_empty() && inverse_bind.len() < 16 * joints.len()) {
            let matrices = inverse_bind.len() / 16;
            return Err(failed(format!("{matrices} inverse bind matrices for {} joints", joints.len())));
        }
        Ok(Skin { joints, inverse_bind })
    }
}

/// All meshes with UVs, those of one skin first.
pub fn list(file: &File, nodes: &Nodes) -> Result<Vec<Subject>, String> {
    let (mut alone, mut skins): (Vec<Subject>, Vec<(Skin, Vec<usize>)>) = (Vec::new(), Vec::new());
    for number in nodes.shown(&file.root) {
        let node = &file.root.nodes[number];
        let Some(index) = node.mesh else { continue };
        let mesh = file.root.get(index).ok_or_else(|| format!("mesh {} is missing", index.value()))?;
        let size = mesh
            .primitives
            .iter()
            .filter(|part| uvs(file, part).is_some())
            .map(|part| corners(file, part))
            .sum();
        if size == 0 {
            continue;
        }
        let skin = node.skin.map(|skin| Skin::read(file, skin)).transpose()?;
        if let Some(skin) = &skin {
            match skins.iter_mut().find(|(known, _)| known == skin) {
                Some((_, members)) => members.push(alone.len()),
                None => skins.push((skin.clone(), vec![alone.len()])),
            }
        }
        let name = [&node.name, &mesh.name].into_iter().flatten().find(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("mesh {}", index.value()));
        let before = alone.iter().filter(|other| other.name.split(" #").next() == Some(&name)).count();
        let name = if before > 0 { format!("{name} #{}", before + 1) } else { name };
        alone.push(Subject { name, nodes: vec![number], skin, size });
    }
    let together =
        skins.into_iter().filter(|(_, members)| members.len() > 1).map(|(skin, members)| Subject {
            name: members.iter().map(|&k| alone[k].name.as_str()).collect::<Vec<_>>().join(" + "),
            nodes: members.iter().map(|&k| alone[k].nodes[0]).collect(),
            skin: Some(skin),
            size: members.iter().map(|&k| alone[k].size).sum(),
        });
    let mut all: Vec<Subject> = together.collect();
    all.extend(alone);
    match all.is_empty() {
        true if file.root.meshes.is_empty() => Err("no meshes".into()),
        true => Err("no triangles with UVs (TEXCOORD_0)".into()),
        false => Ok(all),
    }
}

/// Index of the mesh with a name, or of the largest one.
pub fn choose(all: &[Subject], name: Option<&str>) -> Result<usize, String> {
    match name {
        None => Ok((0..all.len()).rev().max_by_key(|&k| all[k].size).unwrap_or(0)),
        Some(name) => all.iter().position(|subject| subject.name == name).ok_or_else(|| {
            let names: Vec<&str> = all.iter().map(|subject| subject.name.as_str()).collect();
            format!("no mesh \"{name}\"; there are: {}", names.join(", "))
        }),
    }
}

/// The accessor of the UVs by which the base colour is looked up, of triangles.
pub fn uvs(file: &File, part: &Primitive) -> Option<Index<json::Accessor>> {
    if !matches!(part.mode, Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) {
        return None;
    }
    let texture = part
        .material
        .and_then(|material| file.root.get(material)?.pbr_metallic_roughness.base_color_texture.as_ref());
    let set = texture.map_or(0, |info| {
        let moved = info.extensions.as_ref().and_then(|all| all.texture_transform.as_ref()?.tex_coord);
        moved.unwrap_or(info.tex_coord)
    });
    attribute(part, Semantic::TexCoords(set))
}

/// The accessor of an attribute.
pub fn attribute(part: &Primitive, of: Semantic) -> Option<Index<json::Accessor>> {
    part.attributes.get(&Checked::Valid(of)).copied()
}

fn corners(file: &File, part: &Primitive) -> u64 {
    let all = part.indices.or_else(|| attribute(part, Semantic::Positions));
    all.and_then(|all| file.root.get(all)).map_or(0, |accessor| accessor.count.0)
}
