use vrtm_core::method::acceptance::*;

fn next(first: bool, trusts_model: bool, [gain, predicted, cut]: [f64; 3], fraction: f32) -> f64 {
    let correction = Correction { first, iterations: 2, sweeps: 2, tolerance: 1e-2, trusts_model };
    // The unit of gains is 1 for this energy.
    let before = 100.0;
    correction.next_fraction(&Gain { before, after: before - gain, identity: 0.0, predicted, cut, fraction })
}

#[test]
fn a_trusted_first_correction_goes_on_where_its_model_erred() {
    let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-6, "{a} {b}");
    near(next(true, true, [10.0, 10.0, 0.0], 1.0), 0.0);
    near(next(true, true, [10.0, 10.2, 0.0], 1.0), 0.0);
    near(next(true, true, [10.0, 11.125, 0.0], 1.0), 0.5);
    near(next(true, true, [10.0, 15.0, 0.0], 1.0), 1.0);
    // Limited by the gain's own ramp.
    near(next(true, true, [2.5, 15.0, 0.0], 1.0), 0.5);
    // The gain that a limited step lost and sweeps made up for.
    near(next(true, true, [10.0, 10.0, 0.1125], 1.0), 0.5);
    near(next(true, true, [10.0, 10.0, 0.5], 1.0), 1.0);
    near(next(true, true, [10.0, 10.0, 0.02], 1.0), 0.0);
    // Without trust in the model, and in later corrections, the fraction grows fourfold at most.
    near(next(true, false, [10.0, 10.0, 0.0], 1.0), 1.0);
    near(next(false, true, [10.0, 10.0, 0.0], 0.05), 0.2);
    for nothing in [0.0, -1.0, f64::NAN] {
        assert_eq!(next(false, true, [nothing, 10.0, 0.0], 1.0), 0.0);
    }
}

#[test]
fn a_trial_is_accepted_for_a_fiftieth_of_its_prediction() {
    let gain =
        |after: f64| Gain { before: 1.0, after, identity: 0.0, predicted: 0.5, cut: 0.0, fraction: 1.0 };
    assert!(gain(0.98).suffices() && !gain(0.995).suffices() && !gain(f64::NAN).suffices());
}
