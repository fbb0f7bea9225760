//! The structs and planes that Rust and WGSL share; their twin is `shaders/common.wgsl`, and a test compares the two.

use bytemuck::{Pod, Zeroable};

/// Threads of a workgroup.
pub const THREADS: u32 = 64;
/// Workgroups in x; more go to y.
pub const SPREAD: u32 = 65535;

/// Planes per block of the constants of a level: rigidity (sign bit: fixed), four rest lengths, triangle or coverage, density.
pub const NODE_PLANES: usize = 7;
/// Planes per block of a level's state: displacement (2), position or metric at W (3), triangle.
pub const STATE_PLANES: usize = 6;
/// Planes per block of the system: diagonal (3), words of pairs (8), interpolation's weights.
pub const ROW_PLANES: usize = 12;
/// The last of these: uploaded once per grid.
pub const INTERPOLATION: usize = ROW_PLANES - 1;
/// Planes per block of the vectors: r, z, t, x (2 each).
pub const VECTOR_PLANES: usize = 8;
/// Planes per block of a metric.
pub const METRIC_PLANES: usize = 3;
/// Planes per block of a result.
pub const RESULT_PLANES: usize = 2;

/// One dispatch.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Params {
    pub first: u32,
    pub count: u32,
    pub partial: u32,
    pub mode: u32,
    pub sweeps: u32,
    pub items: u32,
    pub scale: f32,
    pub part: f32,
    pub tolerance: f32,
    pub smoothness: f32,
    pub smoothness_floor: f32,
    pub orientation: f32,
    pub room: f32,
    pub room_threshold: f32,
    pub level: u32,
    pub base: u32,
    pub other_base: u32,
    pub correction: f32,
    pub preservation: f32,
    pub momentum: f32,
    pub smoothing: f32,
    pub orientation_density: f32,
}

/// A chart, and what is decided about it on the way.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct Chart {
    pub solve: u32,
    pub working: u32,
    pub done: u32,
    pub fallback: u32,
    pub floor: f32,
    pub identity: f32,
    pub before: f32,
    pub energy: f32,
    pub rz: f32,
    pub alpha: f32,
    pub beta: f32,
    pub predicted: f32,
    pub first: u32,
    pub next: f32,
    pub min_jacobian: f32,
    pub max_displacement: f32,
    pub folds: u32,
    pub cuts: u32,
}

/// A block, with its neighbours' places in the same buffers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Block {
    pub around: [u32; 9],
    pub links: [u32; 9],
    pub chart: u32,
    pub x: u32,
    pub y: u32,
    pub moves: u32,
    pub parent: u32,
    pub children: [u32; 4],
    pub chart_first: u32,
    pub chart_count: u32,
    pub continues: u32,
}

/// A triangle: UVs, then its pose.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Triangle {
    pub corner: [f32; 2],
    pub barycentric: [f32; 4],
    pub neighbours: [u32; 3],
    pub chart: u32,
    pub pose: [f32; 9],
}

/// What `shaders/invert.wgsl` is asked for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct Request {
    pub first: u32,
    pub count: u32,
    pub parts: u32,
    pub bits: u32,
    pub width: u32,
    pub height: u32,
    pub row: u32,
    pub rows: u32,
    pub texels: [f32; 2],
}

#[cfg(test)]
mod tests;
