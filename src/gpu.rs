//! The GPU backend: the stages of `cpu`, under the same names, as compute shaders on wgpu.

pub(crate) mod adapters;
mod bands;
pub(crate) mod context;
mod correct;
mod dispatch;
pub(crate) mod external;
mod generated;
mod identity;
#[cfg(feature = "lab")]
#[path = "lab/gpu_state.rs"]
pub(crate) mod state;
mod invert;
mod kernels;
pub(crate) mod layout;
mod lists;
mod memory;
mod pbd;
mod pipelines;
mod recorder;
mod records;
mod results;
mod run;
mod sizes;
mod stages;
mod timestamps;
mod transfer;
mod upload;

pub(crate) use invert::Output;
pub(crate) use memory::Memory;
pub(crate) use results::{Displacements, ResultBuffers};
pub(crate) use run::{Run, Solution};
