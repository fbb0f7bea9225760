//! Saving: rigidity maps, a picture, a clip (`clip`, with a file per format). A file is there as a whole or not at all.

mod apng;
pub mod clip;
pub mod encode;
pub mod file;
mod gif;
mod mp4;
pub mod rigidity;
mod sequence;
