//! Saving: rigidity maps, a picture, a clip. A file is there as a whole or not at all.

pub mod clip;
pub mod encode;
pub mod file;
pub mod rigidity;
