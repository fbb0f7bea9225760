//! Pictures: the sheet of a frame, and the film that turns the mesh.

mod camera;
mod canvas;
mod figures;
pub mod film;
mod material;
mod raster;
pub mod sheet;
pub mod stage;
mod strain;
