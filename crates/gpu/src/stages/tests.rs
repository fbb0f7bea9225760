//! Tests how certification turns level 0's state into the result.

use std::sync::Arc;

use super::*;
use crate::Memory;
use crate::context::tests::gpu;
use crate::state::STATE_PLANES;
use vrtm_core::backend::Options;
use vrtm_core::backend::TileSolution;
use vrtm_core::fixtures::{Posed, discs, maps};
use vrtm_core::grid::planes::NODES;
use vrtm_core::method::acceptance::Correction;
use vrtm_core::method::plan::Summary;
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_core::settings::TileSettings;

/// Solves level 0 of a stretched sheet, lets `change` alter its state, and certifies it. Returns the outcome, and
/// whether any node moved.
fn certified(context: &Arc<crate::context::Context>, change: impl Fn(&mut [u32])) -> (TileSolution, bool) {
    let moved = |u: f64, v: f64| [u + 0.4 * u * u, v, 0.1 * u * v];
    let sheet = Posed::new(8, maps(64, TileSettings::default(), discs), moved);
    let mut memory = Memory::new(context, &sheet.grid, &[sheet.tile()]).unwrap();
    let mut run = Run::new(&sheet.input(), &mut memory, None, &[false], None).unwrap();
    run.run(&Stage::Surface);
    run.run(&Stage::Pyramid { coarsest: 8 });
    run.run(&Stage::Start { level: 0, from: Start::Identity });
    let first = Correction { first: true, iterations: 2, sweeps: 2, tolerance: 3e-3, trusts_model: true };
    run.run(&Stage::Correct { level: 0, correction: first });
    let mut state = run.state(0).unwrap();
    change(&mut state);
    run.set_state(0, &state).unwrap();
    run.run(&Stage::Certify { allow_folds: false });
    let solution = run.finish(Summary::default()).unwrap();
    let moves = solution.warp.host().unwrap().as_flattened().as_flattened().iter().any(|&u| u != 0.0);
    (solution, moves)
}

#[test]
fn a_chart_that_does_not_pass_is_the_identity() {
    let Some(context) = gpu(Options::default()) else { return };
    let context = Arc::new(context);
    let (solution, moves) = certified(&context, |_| {});
    let chart = solution.charts[0];
    assert!(moves && !chart.fallback && chart.energy < chart.energy_before, "{chart:?}");
    // Moves a node in the middle of the sheet across its neighbours.
    let fold = |state: &mut [u32]| {
        let block = &mut state[5 * STATE_PLANES * NODES..][..STATE_PLANES * NODES];
        block[17] = (f32::from_bits(block[17]) + 3.0).to_bits();
    };
    let (solution, moves) = certified(&context, fold);
    let chart = solution.charts[0];
    assert!(!moves && chart.fallback && chart.energy == chart.energy_before, "{chart:?}");
}
