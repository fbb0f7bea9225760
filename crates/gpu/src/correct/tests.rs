//! Tests the rules of acceptance, which exist both in `method/acceptance.rs` and in `shaders/correct/control.wgsl`, on
//! a table of inputs.

use crate::context::tests::{computed, gpu};
use crate::identity::is_software;
use crate::kernels::Kernel;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Options;
use vrtm_core::method::acceptance::{Correction, Gain, Real};

/// A row of the table: the fields of `Gain`, in their order; the tolerance; and 1 for a first correction whose model is
/// trusted.
type Case = [f32; 8];

const ENTRY: &str = "
@group(0) @binding(20) var<storage, read> cases: array<array<f32, 8>>;
@group(0) @binding(21) var<storage, read_write> decisions: array<vec2f>;

@compute @workgroup_size(64)
fn run_cases(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&cases) {
        return;
    }
    let c = cases[id.x];
    let gain = Gain(c[0], c[1], c[2], c[3], c[4], c[5]);
    let next = next_fraction(gain, c[6], c[7] == 1.0);
    decisions[id.x] = vec2f(next, select(0.0, 1.0, suffices(gain)));
}
";

/// Energies from 1e-6 to 1e5, gains from a loss to the whole energy, and right and wrong predictions.
fn table() -> Vec<Case> {
    let mut all = Vec::new();
    for before in [1.0f32, 0.371, 1.3e-6, 2.7e5] {
        for gain in [-0.1f32, 0.0, 1e-5, 1.7e-3, 3.1e-3, 0.0071, 0.013, 0.4, 1.0] {
            for error in [-0.9f32, -2e-3, 0.0, 3e-4, 4.3e-3, 0.11] {
                for identity in [0.0f32, 3.3] {
                    for (fraction, cut) in
                        [(1.0f32, 0.0f32), (1.0, 3e-3), (1.0, 0.7), (0.29, 0.0), (0.011, 0.4)]
                    {
                        for (tolerance, trusted) in [(3e-3, 1.0), (3e-3, 0.0), (1e-4, 0.0), (0.07, 1.0)] {
                            let predicted = before * (gain + error).max(0.0);
                            let (after, identity) = (before - before * gain, before * identity);
                            all.push([before, after, identity, predicted, cut, fraction, tolerance, trusted]);
                        }
                    }
                }
            }
        }
    }
    all
}

/// The results of the CPU's rules, in one of two precisions.
fn expected<F: Real>(case: &Case) -> (F, bool) {
    let &[before, after, identity, predicted, cut, fraction, tolerance, trusted] = case;
    let first = trusted == 1.0;
    let correction = Correction { first, iterations: 2, sweeps: 0, tolerance, trusts_model: true };
    let [before, after, identity, predicted, cut] = [before, after, identity, predicted, cut].map(F::from);
    let gain = Gain { before, after, identity, predicted, cut, fraction };
    (correction.next_fraction(&gain), gain.suffices())
}

#[test]
fn both_backends_decide_alike() {
    let Some(context) = gpu(Options::default()) else { return };
    let cases = table();
    let text = Kernel::Decide.source().text(0) + ENTRY;
    let (input, bytes) = (bytemuck::cast_slice(&cases), cases.len() as u64 * 8);
    let found: std::vec::Vec<[f32; 2]> =
        computed(&context, text, "run_cases", input, bytes, cases.len().div_ceil(64));
    // Vulkan allows an error of 2.5 units in the last place per division, and there are two divisions in a row, the
    // second of a difference.
    let tolerance = if is_software(&context.adapter) { 0.0 } else { 1e-6 };
    let mut between = 0;
    for (case, found) in cases.iter().zip(&found) {
        let (next, suffices) = expected::<f32>(case);
        let near = (found[0] - next).abs() <= tolerance;
        let same = near && found[1] == f32::from(u8::from(suffices));
        assert!(same, "{case:?}: {found:?}, on the CPU {next} {suffices}");
        between += u32::from(next > 0.0 && next < 1.0);
    }
    // Some inputs fall inside the ramps, not only at their ends.
    assert!(between > 100, "{between} of {}", cases.len());
}

/// Decisions in f32 agree with those in f64, up to rounding.
#[test]
fn both_precisions_decide_alike() {
    for case in table() {
        let ((next, suffices), in_f64) = (expected::<f32>(&case), expected::<f64>(&case));
        // A gain is a difference of two energies of 24 bits, in units of the tolerance of 1e-4.
        assert!((f64::from(next) - in_f64.0).abs() < 2e-3, "{case:?}: {next}, in f64 {}", in_f64.0);
        assert_eq!(suffices, in_f64.1, "{case:?}");
    }
}
