//! Models that failed once, as printed by the random tests.

// Any of these may be used in a recipe.
#[allow(unused_imports)]
use super::recipe::{
    Joints, Layer, Move::*, Paint::*, Piece, Recipe, Refusal::*, Rigidity::*, Shape::*, Then::*,
};
#[allow(unused_imports)]
use vrtm::{OpenBorders, Overlap::*, Quality::*, Seams::*, SolveOptions, TileSettings, WeldBy::*};

#[rustfmt::skip] // As printed.
pub fn cases() -> Vec<(&'static str, Recipe)> {
    vec![
        // The test handed over positions beyond the range of f32, which are refused.
        ("a spike beyond f32",
    Recipe { pieces: vec![Piece { shape: Sheet(1, 1), low: [0.0, 0.0], size: [0.3, 0.3], turn: 0.0, mirrored: false, jitter: 0.0, flip: 0, weld: 0, stretch: [1.0, 1.0], bend: 0.0, crumple: 0.0, seed: 0 }], joints: Joints::default(), polygons: false, split_uvs: false, doubles: false, unit: 30, away: 0.0, rigidity: Map(Layer { size: [16, 16], paint: Constant(1.0) }), mask: None, settings: TileSettings { grid: [Some(16); 2], smoothness: 0.05, seam_reach: 0.0625, ..TileSettings::default() }, options: SolveOptions { quality: Draft, warm: false, measure: false, ..SolveOptions::default() }, frames: vec![vec![Spike(0, 263638.65625), Scale([237444.796875, 237444.796875, 237444.796875])]], output: [16, 16], threads: 1, then: Rest }),
        // On a GPU, grids of one level could not be joined: no coarse node of theirs may move.
        ("two tiles of one level",
    Recipe { pieces: vec![Piece { shape: Sheet(2, 1), low: [0.9026592, 0.75176984], size: [0.3, 0.3], turn: 0.0,
    mirrored: false, jitter: 0.0, flip: 0, weld: 0, stretch: [1.0, 1.0], bend: 0.0, crumple: 0.0, seed: 0 }, Piece {
    shape: Sheet(6, 1), low: [0.0, 0.0], size: [0.8475917, 0.3], turn: 0.0, mirrored: false, jitter: 0.0, flip: 0,
    weld: 0, stretch: [1.0, 1.0], bend: 0.0, crumple: 0.0, seed: 0 }], joints: Joints { cut: 0.23132636, noise: 0.0,
    weld: Off, seams: 0, bare: 0, offsets: false, seed: 21 }, polygons: false, split_uvs: false, doubles: false, unit:
    0, away: 0.0, rigidity: Map(Layer { size: [16, 16], paint: Constant(1.0) }), mask: None, settings: TileSettings {
    grid: [Some(16); 2], ..TileSettings::default() }, options: SolveOptions { quality: Draft, ..SolveOptions::default()
    }, frames: vec![vec![Scale([1.0, 0.3, 1.0])]], output: [16, 16], threads: 1, then: Rest }),
    ]
}
