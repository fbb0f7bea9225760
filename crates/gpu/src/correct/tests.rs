//! Tests the rules of acceptance, which exist both in `method/acceptance.rs` and in `shaders/correct/control.wgsl`, on
//! a table of inputs.

use bytemuck::{Pod, Zeroable};

use crate::context::tests::{computed, gpu};
use crate::identity::is_software;
use crate::kernels::Kernel;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Options;
use vrtm_core::method::acceptance::{Correction, Gain};

/// A row of the table; `Case` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Case {
    before: f32,
    after: f32,
    identity: f32,
    predicted: f32,
    cut: f32,
    fraction: f32,
    tolerance: f32,
    /// 1 for a first correction whose model is trusted.
    trusted: u32,
}

const ENTRY: &str = "
struct Case {
    before: f32,
    after: f32,
    identity: f32,
    predicted: f32,
    cut: f32,
    fraction: f32,
    tolerance: f32,
    trusted: u32,
}

@group(0) @binding(20) var<storage, read> cases: array<Case>;
@group(0) @binding(21) var<storage, read_write> decisions: array<vec2f>;

@compute @workgroup_size(64)
fn run_cases(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&cases) {
        return;
    }
    let c = cases[id.x];
    let gain = Gain(c.before, c.after, c.identity, c.predicted, c.cut, c.fraction);
    let next = next_fraction(gain, c.tolerance, c.trusted == 1u);
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
                        for (tolerance, trusted) in [(3e-3, 1), (3e-3, 0), (1e-4, 0), (0.07, 1)] {
                            let predicted = before * (gain + error).max(0.0);
                            let (after, identity) = (before - before * gain, before * identity);
                            all.push(Case {
                                before,
                                after,
                                identity,
                                predicted,
                                cut,
                                fraction,
                                tolerance,
                                trusted,
                            });
                        }
                    }
                }
            }
        }
    }
    all
}

/// The results of the CPU's rules in f32.
fn expected(case: &Case) -> [f32; 2] {
    let &Case { before, after, identity, predicted, cut, fraction, tolerance, trusted } = case;
    let correction =
        Correction { first: trusted == 1, iterations: 2, sweeps: 0, tolerance, trusts_model: true };
    let gain = Gain { before, after, identity, predicted, cut, fraction };
    [correction.next_fraction(&gain), f32::from(u8::from(gain.suffices()))]
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
        let expected = expected(case);
        let near = (found[0] - expected[0]).abs() <= tolerance;
        assert!(near && found[1] == expected[1], "{case:?}: {found:?}, on the CPU {expected:?}");
        between += u32::from(expected[0] > 0.0 && expected[0] < 1.0);
    }
    // Some inputs fall inside the ramps, not only at their ends.
    assert!(between > 100, "{between} of {}", cases.len());
}

/// Decisions in f32 agree with those in f64, up to rounding.
#[test]
fn both_precisions_decide_alike() {
    for case in table() {
        let [next, suffices] = expected(&case);
        let correction = Correction {
            first: case.trusted == 1,
            iterations: 2,
            sweeps: 0,
            tolerance: case.tolerance,
            trusts_model: true,
        };
        let gain = Gain {
            before: f64::from(case.before),
            after: f64::from(case.after),
            identity: f64::from(case.identity),
            predicted: f64::from(case.predicted),
            cut: f64::from(case.cut),
            fraction: case.fraction,
        };
        let in_f64 = correction.next_fraction(&gain);
        // A gain is a difference of two energies of 24 bits, in units of the tolerance of 1e-4.
        assert!((f64::from(next) - in_f64).abs() < 2e-3, "{case:?}: {next}, in f64 {in_f64}");
        assert_eq!(suffices, f32::from(u8::from(gain.suffices())), "{case:?}");
    }
}
