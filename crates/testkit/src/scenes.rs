//! Scenes that need no files.
//!
//! All numbers come from f64 arithmetic without library transcendentals, so that a scene has the same bits on every
//! machine.

pub mod analytic;
mod arm;
mod build;
mod creature;
mod mug;
mod paint;
pub mod path;

pub use arm::arm;
pub use creature::creature;
pub use mug::mug_to_jug;

/// A mesh at rest, poses of it, and the maps of its tiles.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    pub name: &'static str,
    /// Description for a caption.
    pub notes: Vec<&'static str>,
    pub rest: Vec<[f32; 3]>,
    pub face_counts: Vec<u32>,
    /// Vertex of each face corner.
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    /// UV of each face corner.
    pub uv_indices: Vec<u32>,
    pub poses: Vec<Vec<[f32; 3]>>,
    pub tiles: Vec<TileMaps>,
}

/// Maps of one tile, 8 bits per texel, first row at v = 1 as in image files.
#[derive(Clone, Debug)]
pub struct TileMaps {
    pub udim: u32,
    pub width: u32,
    pub height: u32,
    pub rigidity: Vec<u8>,
    /// Texels under 128 are fixed; `None` = no texel is fixed.
    pub mask: Option<Vec<u8>>,
}

/// The scene with this name, or `None` if the name is unknown.
pub fn by_name(name: &str) -> Option<Scene> {
    match name {
        "mug_to_jug" => Some(mug_to_jug()),
        "creature" => Some(creature()),
        "arm" => Some(arm()),
        _ => analytic::all().into_iter().find(|scene| scene.name == name),
    }
}

/// The names for [`by_name`].
pub const NAMES: [&str; 9] =
    ["mug_to_jug", "creature", "arm", "squash", "bulge", "pinch", "shear", "torus", "strips"];
