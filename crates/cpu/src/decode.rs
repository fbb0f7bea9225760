//! Decodes constants of a level into windows: rigidities, rest lengths and interpolation weights (method §1, codes).

use vrtm_core::grid::Level;
use vrtm_core::grid::codes;
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::MULTIPLIER_STEPS;

use super::lanes::{LANES, Lanes, Mask};

/// First indices of the vectors that cover a window. The last vector overlaps the previous one.
#[inline(always)]
pub fn window_vectors() -> impl Iterator<Item = usize> {
    (0..WINDOW_NODES - LANES).step_by(LANES).chain([WINDOW_NODES - LANES])
}

/// Rigidities in the window of block `b`; 0 where no block is stored. Returns whether any is above 0.
#[inline(always)]
pub fn rigidity<V: Lanes>(level: &Level, b: usize, out: &mut Window) -> bool {
    let codes = window::of(&level.blocks.neighbours[b], 0, |b| &level.rigidity[b]);
    let mut most = V::zero();
    for at in window_vectors() {
        let rigidity = V::load_u16(&codes, at) * (1.0 / codes::RIGIDITY_STEPS);
        most = most.max(rigidity);
        rigidity.store(out, at);
    }
    V::zero().lt(most).any()
}

/// Mobilities in the window of block `b`, 1 or 0; 0 where no block is stored.
#[inline(always)]
pub fn movable<V: Lanes>(level: &Level, b: usize, out: &mut Window) {
    let codes = window::of(&level.blocks.neighbours[b], 0, |b| &level.movable[b]);
    for at in window_vectors() {
        V::load_u8(&codes, at).store(out, at);
    }
}

/// Multiplies the rigidities in the window of block `b` by 1 plus their multipliers (method §4, Harm).
#[inline(always)]
pub fn stiffen<'a, V: Lanes>(
    level: &Level,
    multiplier: impl Fn(usize) -> &'a Plane<u16>,
    b: usize,
    rigidity: &mut Window,
) {
    let codes = window::of(&level.blocks.neighbours[b], 0, multiplier);
    // Vectors overlap, so that what has been stiffened must not be read again.
    let whole = *rigidity;
    for at in window_vectors() {
        let factor = V::one() + V::load_u16(&codes, at) * (1.0 / MULTIPLIER_STEPS);
        (V::load(&whole, at) * factor).store(rigidity, at);
    }
}

/// Rest lengths of the owned edges `e` of the nodes in the window of block `b`; 0 where no block is stored.
#[inline(always)]
pub fn rest_length<V: Lanes>(level: &Level, b: usize, e: usize, out: &mut Window) {
    let lengths = level.lengths[level.blocks.list[b].chart as usize][e];
    let codes = window::of(
        &level.blocks.neighbours[b],
        0,
        #[inline(always)]
        |b| &level.rest_length[b][e],
    );
    for at in window_vectors() {
        V::load_lengths(&codes, at, lengths).store(out, at);
    }
}

/// Weights of the interpolation P in the window of a block with the given neighbour blocks; 0 where no block is stored.
pub fn interpolation(level: &Level, neighbours: &[u32; 9]) -> Window {
    window::of(neighbours, 0, |b| &level.interpolation[b]).map(codes::decode_weight)
}
