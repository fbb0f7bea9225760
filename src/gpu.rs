//! The GPU backend: the CPU's stages, twin by name, as compute shaders on wgpu.

// The stages that use all of it are still to come.
#![allow(dead_code)]

pub(crate) mod adapters;
pub(crate) mod context;
mod transfer;

/// True once assets can be solved on a GPU: until then a device is made on the CPU only.
pub(crate) const SOLVES: bool = false;
