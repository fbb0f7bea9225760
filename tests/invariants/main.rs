//! What holds for every result of `descent` (DESIGN 7), each recomputed here in f64 from what the library hands out.

#[path = "../common/mod.rs"]
mod common;
mod fixed;
mod identity;
mod maps;
mod outputs;
mod same_bits;
mod warps;
