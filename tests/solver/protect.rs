//! The setting `protect`: features that a pose does not strain come before those that it strains.

use vrtm::{Asset, Quality, SolveOptions, Strided, TileSettings};
use vrtm_testkit::Lab as _;

use vrtm_testkit::features::dense::dense;
use vrtm_testkit::features::{Feature, of_asset};
use vrtm_testkit::scenes::{analytic, creature};
use vrtm_testkit::{Model, assets, bits, long, options};

fn set(asset: &mut Asset, protect: f32) {
    for tile in 0..asset.tile_count() {
        let settings = TileSettings { protect, ..asset.settings(tile).unwrap() };
        asset.set_settings(tile, &settings).unwrap();
    }
}

fn protected(model: &Model, grid: u32, protect: f32) -> Asset {
    let mut asset = model.asset(0, grid);
    set(&mut asset, protect);
    asset
}

#[test]
fn it_is_a_number_from_0_to_1() {
    let mut asset = Model::from(analytic::bulge()).asset(1, 32);
    for bad in [-0.1, 1.01, f32::NAN, f32::INFINITY] {
        let settings = TileSettings { protect: bad, ..TileSettings::default() };
        let error = asset.set_settings(0, &settings).unwrap_err().to_string();
        assert!(error.contains("settings.protect"), "{error}");
    }
    set(&mut asset, 1.0);
    assert_eq!(asset.settings(0).unwrap().protect, 1.0);
}

#[test]
fn it_leaves_nothing_behind() {
    let model = Model::from(creature());
    let solved = |asset: &mut Asset, frame: usize| {
        asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
        bits(asset)
    };
    let plain = solved(&mut model.asset(1, 128), 4);
    let mut asset = protected(&model, 128, 1.0);
    let strongly = solved(&mut asset, 4);
    assert_ne!(strongly, plain);
    // A result depends on its own pose alone.
    solved(&mut asset, 2);
    assert_eq!(solved(&mut asset, 4), strongly);
    set(&mut asset, 0.0);
    assert_eq!(solved(&mut asset, 4), plain);
    // The paper's solver does not have it.
    let pbd = SolveOptions { solver: vrtm::Solver::Pbd, ..SolveOptions::default() };
    let [with, without] = [1.0, 0.0].map(|protect| {
        let mut asset = protected(&model, 64, protect);
        asset.solve(model.frame(4), &pbd).unwrap();
        bits(&asset)
    });
    assert_eq!(with, without);
}

/// Far from the crowds that crush cells, a small change of the pose is a small change of the warp.
#[test]
fn it_is_continuous_in_the_pose() {
    let model = Model::from(creature());
    let (rest, frame) = (&model.rest, &model.frames[3]);
    let warp = |protect: f32, t: f32| {
        let mut asset = protected(&model, 128, protect);
        let point = |(r, p): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|k| r[k] + t * (p[k] - r[k]));
        let pose: Vec<[f32; 3]> = rest.iter().zip(frame).map(point).collect();
        asset.solve(Strided::from_f32x3(&pose), &SolveOptions::default()).unwrap();
        let tiles = 0..asset.tile_count();
        tiles.flat_map(|tile| asset.displacements(tile).unwrap()).collect::<Vec<[f32; 2]>>()
    };
    let largest = |a: &[[f32; 2]], b: &[[f32; 2]]| {
        let apart = a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1]));
        apart.fold(0.0f32, f32::max)
    };
    for t in [0.3, 0.6, 0.9] {
        let change = largest(&warp(1.0, t), &warp(1.0, t + 1e-3));
        assert!(change < 0.1, "{change} cells at {t}");
    }
    // And so it is in the setting itself.
    let change = largest(&warp(0.5, 0.9), &warp(0.501, 0.9));
    assert!(change < 0.1, "{change} cells");
    let change = largest(&warp(0.0, 0.9), &warp(1e-4, 0.9));
    assert!(change < 0.1, "{change} cells");
}

/// Features whose error rises by more than 0.02, and the mean error, at a setting.
fn harmed(model: &Model, frame: usize, grid: u32, protect: f32) -> (usize, f64) {
    let mut asset = protected(model, grid, protect);
    asset.solve(model.frame(frame), &options(Quality::Normal)).unwrap();
    for tile in 0..asset.tile_count() {
        let report = asset.tile_report(tile).unwrap();
        assert!(report.folds == 0 && report.energy <= report.energy_before, "{}: {report:?}", model.name);
    }
    let features = of_asset(model, &model.frames[frame - 1], &asset);
    let rises = |feature: &&Feature| feature.after > feature.before + 0.02;
    let mean = features.iter().map(|feature| feature.after).sum::<f64>() / features.len() as f64;
    (features.iter().filter(rises).count(), mean)
}

/// In a crowd, the stronger it is, the fewer features come out worse; and on the whole they are not worse for it.
#[test]
fn fewer_features_come_out_worse() {
    let mut cases =
        vec![(dense(&Model { name: "squash to 40 %".into(), ..analytic::squash(0.4).into() }), 1)];
    cases.extend(assets().iter().filter(|m| m.name == "fox").map(|m| (dense(m), 3)));
    for (model, frame) in long::share(cases, 2, "scenes") {
        let [none, half, whole] = [0.0, 0.5, 1.0].map(|protect| harmed(&model, frame, 512, protect));
        println!("{}: {none:?}, {half:?}, {whole:?}", model.name);
        assert!(none.0 > 0 && half.0 < none.0 && whole.0 <= half.0, "{}", model.name);
        assert!(3 * whole.0 <= none.0, "{}: {none:?}, {whole:?}", model.name);
        assert!(whole.1 < 1.1 * none.1, "{}: {none:?}, {whole:?}", model.name);
    }
}
