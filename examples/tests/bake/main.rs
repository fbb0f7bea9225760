//! The example `bake` as its users run it: the files that it writes, and the refusal of bad input; and the reading of
//! files, which the viewer does with the same code.

mod common;
mod files;
mod film;
mod obj_files;
mod pictures;
mod refusals;
