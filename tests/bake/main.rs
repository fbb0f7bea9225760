//! The bake example as its users run it: the files that it writes, their contents, and the refusal of bad input.

mod built_in;
mod common;
mod files;
mod interrupted;
mod overwrite;
mod refusals;
