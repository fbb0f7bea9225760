//! A level's constants around a block, from their codes.

use crate::tile::Level;
use crate::tile::codes;
use crate::tile::window::{self, WINDOW_NODES, Window};

use super::lanes::{LANES, Lanes};

/// Where vectors over all of a window begin; the last one overlaps the one before it.
#[inline(always)]
pub fn window_vectors() -> impl Iterator<Item = usize> {
    (0..WINDOW_NODES - LANES).step_by(LANES).chain([WINDOW_NODES - LANES])
}

/// Rigidity around block `b`; 0 where nothing is stored.
#[inline(always)]
pub fn rigidity<V: Lanes>(level: &Level, b: usize, out: &mut Window) {
    let mut codes: Window<u16> = [0; WINDOW_NODES];
    window::load(&level.blocks.neighbours[b], 0, |b| &level.rigidity[b], &mut codes);
    for at in window_vectors() {
        (V::load_u16(&codes, at) / V::splat(codes::SHARES)).store(out, at);
    }
}

/// Rest lengths of the edges `e` that the nodes around block `b` own; 0 where nothing is stored.
#[inline(always)]
pub fn rest_length<V: Lanes>(level: &Level, b: usize, e: usize, out: &mut Window) {
    let lengths = level.lengths[level.blocks.list[b].chart as usize][e];
    let mut codes: Window<u16> = [0; WINDOW_NODES];
    window::load(&level.blocks.neighbours[b], 0, |b| &level.rest_length[b][e], &mut codes);
    for at in window_vectors() {
        V::load_lengths(&codes, at, lengths).store(out, at);
    }
}

/// P's weights in a block and on its ring, from the blocks `neighbours`; 0 where there is none.
pub fn interpolation(level: &Level, neighbours: &[u32; 9]) -> Window {
    let mut codes: Window<u8> = [0; WINDOW_NODES];
    window::load(neighbours, 0, |b| &level.interpolation[b], &mut codes);
    codes.map(codes::of_weight)
}
