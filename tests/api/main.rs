//! The Rust API: what a call does besides solving, what it costs, and what it hands out.

mod allocations;
mod beyond;
mod budget;
mod carry;
mod control;
mod fresh;
mod grid;
mod layers;
mod log;
mod maps;
mod new_maps;
mod prepare;
mod refine;
mod saved;
mod selection;
mod set_maps;
mod uv_sets;
mod web;

/// As in a program that lets hosts give it memory.
#[global_allocator]
static ALLOCATOR: vrtm::Allocator = vrtm::Allocator;
