//! The nodes of a file and their transforms.

use glam::{DMat4, DQuat, DVec3};
use gltf::json::{Index, Node, Root};

/// A node's transform relative to its parent.
#[derive(Clone, Copy, Debug)]
pub struct Local {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

impl Local {
    fn of(node: &Node) -> Local {
        if let Some(matrix) = node.matrix {
            let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
            let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
            return Local { translation, rotation, scale };
        }
        let vector =
            |v: Option<[f32; 3]>, default| v.map_or(default, |v| DVec3::from_array(v.map(f64::from)));
        let rotation = node.rotation.map_or(DQuat::IDENTITY, |q| rotation(&q.0.map(f64::from)));
        let translation = vector(node.translation, DVec3::ZERO);
        Local { translation, rotation, scale: vector(node.scale, DVec3::ONE) }
    }
}

/// A rotation; the identity if all four numbers are 0.
pub fn rotation(q: &[f64]) -> DQuat {
    let q = DQuat::from_slice(q);
    if q.length_squared() > 0.0 { q.normalize() } else { DQuat::IDENTITY }
}

/// All nodes of a file.
pub struct Nodes {
    parents: Vec<Option<usize>>,
    /// Parents before their children.
    order: Vec<usize>,
    /// Transforms where nothing is animated.
    pub locals: Vec<Local>,
}

impl Nodes {
    pub fn new(root: &Root) -> Result<Nodes, String> {
        let count = root.nodes.len();
        let mut parents = vec![None; count];
        for (parent, node) in root.nodes.iter().enumerate() {
            for child in children(node) {
                let place = parents.get_mut(child).ok_or_else(|| format!("node {child} is missing"))?;
                if place.replace(parent).is_some() {
                    return Err(format!("node {child} has two parents"));
                }
            }
        }
        let mut order: Vec<usize> = (0..count).filter(|&node| parents[node].is_none()).collect();
        let mut next = 0;
        while next < order.len() {
            order.extend(children(&root.nodes[order[next]]));
            next += 1;
        }
        if order.len() < count {
            return Err("its nodes form a circle".into());
        }
        Ok(Nodes { parents, order, locals: root.nodes.iter().map(Local::of).collect() })
    }

    /// Transforms to the world.
    pub fn globals(&self, locals: &[Local]) -> Vec<DMat4> {
        let mut globals = vec![DMat4::IDENTITY; locals.len()];
        for &node in &self.order {
            let parent = self.parents[node].map_or(DMat4::IDENTITY, |parent| globals[parent]);
            let Local { translation, rotation, scale } = locals[node];
            globals[node] = parent * DMat4::from_scale_rotation_translation(scale, rotation, translation);
        }
        globals
    }

    /// The nodes of the scene that is shown first, or all; parents before their children.
    pub fn shown(&self, root: &Root) -> Vec<usize> {
        let scene = root.scene.unwrap_or(Index::new(0));
        let Some(scene) = root.get(scene) else { return self.order.clone() };
        let mut is_shown = vec![false; self.parents.len()];
        for &node in &self.order {
            let in_parent = self.parents[node].is_some_and(|parent| is_shown[parent]);
            is_shown[node] = in_parent || scene.nodes.iter().any(|start| start.value() == node);
        }
        self.order.iter().copied().filter(|&node| is_shown[node]).collect()
    }

    /// The first of these nodes that is under no other of them.
    pub fn topmost(&self, nodes: &[usize]) -> Option<usize> {
        let first = self.order.iter().find(|node| nodes.contains(node))?;
        nodes.iter().position(|node| node == first)
    }
}

fn children(node: &Node) -> impl Iterator<Item = usize> + '_ {
    node.children.iter().flatten().map(|child| child.value())
}
