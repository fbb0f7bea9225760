//! Saving: rigidity maps, a picture. A file is there as a whole or not at all.

pub mod encode;
pub mod file;
pub mod rigidity;
