//! The meshes of a file that can be opened: all together, and each node's own.

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
}

/// Name of all meshes together.
const ALL: &str = "all meshes";

/// All meshes together, if there are several, and each one with UVs.
pub fn list(file: &File, nodes: &Nodes) -> Result<Vec<Subject>, String> {
    let (mut alone, mut all): (Vec<Subject>, Vec<usize>) = (Vec::new(), Vec::new());
    for number in nodes.shown(&file.root) {
        let node = &file.root.nodes[number];
        let Some(index) = node.mesh else { continue };
        let mesh = file.root.get(index).ok_or_else(|| format!("mesh {} is missing", index.value()))?;
        all.extend(mesh.primitives.iter().any(has_triangles).then_some(number));
        if !mesh.primitives.iter().any(|part| has_triangles(part) && uvs(file, part).is_some()) {
            continue;
        }
        let name = [&node.name, &mesh.name].into_iter().flatten().find(|name| !name.is_empty());
        let name = name.cloned().unwrap_or_else(|| format!("mesh {}", index.value()));
        let before = alone.iter().filter(|other| other.name.split(" #").next() == Some(&name)).count();
        let name = if before > 0 { format!("{name} #{}", before + 1) } else { name };
        alone.push(Subject { name, nodes: vec![number] });
    }
    if alone.is_empty() {
        let has_meshes = !file.root.meshes.is_empty();
        return Err(if has_meshes { "no triangles with UVs (TEXCOORD_0)" } else { "no meshes" }.into());
    }
    if all.len() > 1 {
        alone.insert(0, Subject { name: ALL.into(), nodes: all });
    }
    Ok(alone)
}

/// Index of the mesh with a name, or of all together.
pub fn choose(all: &[Subject], name: Option<&str>) -> Result<usize, String> {
    let Some(name) = name else { return Ok(0) };
    all.iter().position(|subject| subject.name == name).ok_or_else(|| {
        let names: Vec<&str> = all.iter().map(|subject| subject.name.as_str()).collect();
        format!("no mesh \"{name}\"; there are: {}", names.join(", "))
    })
}

pub fn has_triangles(part: &Primitive) -> bool {
    matches!(part.mode, Checked::Valid(Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan))
}

/// The accessor of the UVs by which the base colour is looked up, if it has any.
pub fn uvs(file: &File, part: &Primitive) -> Option<Index<json::Accessor>> {
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
