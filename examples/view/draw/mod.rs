//! Draws the mesh into a texture that the window shows, and that pictures are saved from.

pub mod beyond;
pub mod camera;
pub mod gpu;
pub mod levels;
pub mod paint;
pub mod picture;
pub mod scene;
