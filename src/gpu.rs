//! The GPU backend: the CPU's stages, twin by name, as compute shaders on wgpu.

pub(crate) mod context;
