//! The bake example as its users run it: the files that it writes, their contents, and the refusal of bad input.

mod built_in;
mod common;
mod full_disk;
mod inputs;
mod maps;
mod outputs;
mod overwrite;
mod poses;
mod refusals;
mod signals;
