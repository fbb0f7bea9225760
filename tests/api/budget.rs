//! A time budget: a result at any time, and the last one where there was none for a new one. Where the clock counts, it
//! is one that each reading moves.

use std::sync::LazyLock;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use vrtm::{Asset, SolveOptions, SolveRequest, Solver, Strided};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, bits, devices, scenes};

/// A clock that every reading moves by a millisecond.
fn ticking() -> Instant {
    static START: LazyLock<Instant> = LazyLock::new(Instant::now);
    static READINGS: AtomicU64 = AtomicU64::new(0);
    *START + Duration::from_millis(READINGS.fetch_add(1, Ordering::Relaxed))
}

fn with_budget(ms: u64) -> SolveOptions {
    SolveOptions { time_budget: Some(Duration::from_millis(ms)), ..SolveOptions::default() }
}

/// A part of the motion from rest to the first frame.
fn pose(model: &Model, part: f32) -> Vec<[f32; 3]> {
    let point = |(r, p): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|k| r[k] + part * (p[k] - r[k]));
    model.rest.iter().zip(&model.frames[0]).map(point).collect()
}

#[test]
fn no_frame_of_a_motion_is_the_identity() {
    let model = Model::from(scenes::mug_to_jug());
    for device in devices() {
        for solver in [Solver::Descent, Solver::Pbd] {
            for (warm, ms) in [(false, 0), (false, 12), (false, 24), (true, 0), (true, 12)] {
                let mut asset = model.asset_on(&device, 128);
                asset.set_clock(ticking);
                for frame in 0..10 {
                    let pose = pose(&model, 0.5 + 0.05 * frame as f32);
                    let options = SolveOptions { solver, warm, ..with_budget(ms) };
                    asset.solve(Strided::from_slice(&pose), &options).unwrap();
                    let report = asset.tile(0).report().unwrap();
                    let what = format!("{solver:?}, warm: {warm}, {ms} ms, frame {frame}: {report:?}");
                    assert!(report.max_displacement > 0.0, "{what}");
                    if solver == Solver::Descent {
                        assert!(report.energy <= report.energy_before, "{what}");
                        assert!(report.folds == 0 && report.min_jacobian > 0.0, "{what}");
                    }
                }
            }
        }
    }
}

/// Without any time one tile is solved all the same, and the other keeps its result and says so. They take turns, and a
/// later call solves what is late, even if no vertex has moved since.
#[test]
fn a_tile_without_time_keeps_its_last_result_and_says_so() {
    let model = Model::from(scenes::by_name("arm").unwrap());
    let mut asset = model.asset(2, 64);
    let tile_bits = |asset: &Asset, tile| asset.displacements(tile).unwrap().to_vec();
    let reports = |asset: &Asset| [0, 1].map(|tile| asset.tile(tile).report().unwrap());
    // Without a result to keep, all tiles are solved.
    asset.solve(model.frame(1), &with_budget(0)).unwrap();
    assert_eq!(reports(&asset).map(|report| report.kept), [false; 2]);
    for late in [1, 0, 1] {
        let before = tile_bits(&asset, late);
        asset.solve(model.frame(3), &with_budget(0)).unwrap();
        let reports = reports(&asset);
        assert!(reports[late].kept && reports[late].truncated && !reports[1 - late].kept, "{reports:?}");
        assert!(tile_bits(&asset, late) == before);
        let report = asset.report().unwrap();
        assert!(report.truncated && report.tiles_kept == 1);
    }
    let options = SolveOptions::default();
    let request = SolveRequest { positions: model.frame(3), options, ..SolveRequest::default() };
    asset.run(&SolveRequest { dirty_vertices: Some(&[]), ..request.clone() }, &mut []).unwrap();
    assert_eq!(reports(&asset).map(|report| (report.kept, report.truncated)), [(false, false); 2]);
    let mut whole = model.asset(2, 64);
    whole.run(&request, &mut []).unwrap();
    assert!(bits(&asset) == bits(&whole));
}

#[test]
fn a_budget_that_is_never_reached_gives_the_same_bits() {
    let model = Model::from(scenes::mug_to_jug());
    for device in devices() {
        for quality in [vrtm::Quality::Draft, vrtm::Quality::Normal] {
            let plain = vrtm_testkit::options(quality);
            let enough = SolveOptions { time_budget: Some(Duration::from_secs(3600)), ..plain };
            let [expected, found] = [plain, enough].map(|options| {
                let asset = model.solved(&device, 128, 1, &options);
                assert!(!asset.report().unwrap().truncated, "{quality:?}");
                bits(&asset)
            });
            assert!(found == expected, "{quality:?}");
        }
    }
}
