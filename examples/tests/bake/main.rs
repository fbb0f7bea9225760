//! The bake example as its users run it: the files that it writes, their contents, and the refusal of bad input.

mod built_in;
mod common;
mod files;
mod film;
mod interrupted;
mod obj_files;
mod overwrite;
mod refusals;

// Parts of the program.
#[allow(dead_code)]
#[path = "../../bake/failure.rs"]
mod failure;
#[allow(dead_code)]
#[path = "../../bake/mesh.rs"]
mod mesh;
#[allow(dead_code)]
#[path = "../../bake/draw/palette.rs"]
mod palette;
#[allow(dead_code)]
#[path = "../../bake/obj.rs"]
mod obj;
