//! Checks what holds for every result of `descent` (method §11.1), recomputed here in f64 from the library's outputs.

mod identity;
mod maps;
mod outputs;
mod same_bits;
mod stretch;
mod warps;
