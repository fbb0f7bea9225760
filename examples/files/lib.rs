//! The files that the example `bake` and the viewer read: OBJ meshes with their poses, rigidity maps by tile, asset
//! folders, built-in scenes. Files are written whole.

#![allow(
    missing_docs,
    rustdoc::invalid_html_tags,
    reason = "for vrtm's own programs alone; <UDIM> is no tag"
)]

pub mod options;
pub mod failure;
pub mod whole;
pub mod mesh;
pub mod islands;
pub mod maps;
pub mod obj;
pub mod source;
