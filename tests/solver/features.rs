//! How well each painted feature keeps its shape: inside of charts, at open borders and at seams.

use vrtm::{Quality, SolveOptions, Strided};

use vrtm_testkit::features::dense::dense;
use vrtm_testkit::features::{CASES, Feature, Kind, STILL, of_asset, solve};
use vrtm_testkit::scenes::analytic;
use vrtm_testkit::table::{self, judge};
use vrtm_testkit::{Maps, Model, long, on_all_cores};

/// The features of a model in a pose, with the original UVs.
fn still(model: &Model, pose: &[[f32; 3]], grid: u32) -> Vec<Feature> {
    let mut asset = model.asset(1, grid);
    asset.solve(Strided::from_slice(&model.rest), &SolveOptions::default()).unwrap();
    of_asset(model, pose, &asset)
}

/// Two squares side by side, whose charts lie one above the other; on them a disc inside of the left one, a disc over
/// the seam and a disc at the open border on the right.
fn two_squares() -> Model {
    let rest =
        [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1]].map(|p: [i32; 2]| [p[0] as f32, p[1] as f32, 0.0]);
    // The right square is turned by 90 degrees in the UV plane.
    let (left, right) =
        ([[0.1, 0.1], [0.4, 0.1], [0.4, 0.4], [0.1, 0.4]], [[0.9, 0.5], [0.9, 0.8], [0.6, 0.8], [0.6, 0.5]]);
    let size = 256;
    let disc = |[x, y]: [f64; 2]| {
        [[0.4, 0.5], [1.0, 0.5], [2.0, 0.5]].iter().any(|c: &[f64; 2]| (x - c[0]).hypot(y - c[1]) < 0.2)
    };
    let mut rigidity = vec![0; size * size];
    for (k, texel) in rigidity.iter_mut().enumerate() {
        let u = ((k % size) as f64 + 0.5) / size as f64;
        let v = 1.0 - ((k / size) as f64 + 0.5) / size as f64;
        let on_left = [(u - 0.1) / 0.3, (v - 0.1) / 0.3];
        let on_right = [1.0 + (v - 0.5) / 0.3, (0.9 - u) / 0.3];
        let chart = if v < 0.45 { on_left } else { on_right };
        *texel = 255 * u8::from(disc(chart));
    }
    Model {
        name: "two squares".into(),
        rest: rest.into(),
        face_counts: vec![4, 4],
        indices: vec![0, 1, 4, 3, 1, 2, 5, 4],
        uvs: [left, right].concat(),
        uv_indices: (0..8).collect(),
        maps: vec![Maps { udim: 1001, width: size as u32, height: size as u32, rigidity, mask: None }],
        ..Model::default()
    }
}

#[test]
fn a_feature_over_a_seam_is_one_and_has_the_error_it_was_given() {
    let model = two_squares();
    let kinds = |features: &[Feature]| features.iter().map(|feature| feature.kind).collect::<Vec<_>>();
    let rest = still(&model, &model.rest, 128);
    let mut found = kinds(&rest);
    found.sort();
    assert_eq!(found, [Kind::Inner, Kind::Open, Kind::Seam]);
    assert!(rest.iter().all(|feature| feature.before < 1e-6 && feature.after < 1e-6), "{rest:?}");
    // One and a half times as long along x: the edges of a disc have the strains .5, 0 and, along diagonals,
    // sqrt(1.625) - 1, about as many of each direction.
    let pose: Vec<[f32; 3]> = model.rest.iter().map(|p| [1.5 * p[0], p[1], p[2]]).collect();
    let expected = ((0.25 + 2.0 * (1.625f64.sqrt() - 1.0).powi(2)) / 4.0).sqrt();
    for feature in still(&model, &pose, 128) {
        assert!((feature.before / expected - 1.0).abs() < 0.05, "{feature:?}, {expected}");
        assert_eq!(feature.before, feature.after);
    }
    let asset = solve(&model, &pose, 1, 128, STILL, &SolveOptions::default());
    let warped = of_asset(&model, &pose, &asset);
    let inner = warped.iter().find(|feature| feature.kind == Kind::Inner).unwrap();
    assert!(inner.after < 0.1 * inner.before, "{inner:?}");
}

#[test]
fn reports_count_features_as_the_measure_of_the_tests_does() {
    let options = SolveOptions { measure: true, quality: Quality::Draft, ..SolveOptions::default() };
    for scene in [analytic::bulge(), analytic::squash(0.4)] {
        let model = dense(&Model::from(scene));
        let pose = &model.frames[0];
        let asset = solve(&model, pose, 0, 512, STILL, &options);
        let strain = asset.tile(0).report().unwrap().strain.unwrap();
        let found = of_asset(&model, pose, &asset);
        // What a seam cuts in two would be two features here.
        assert!(found.iter().all(|feature| feature.kind != Kind::Seam));
        let over = |least: f64, of: &dyn Fn(&Feature) -> f64| {
            found.iter().filter(|feature| of(feature) > least).count() as u32
        };
        let rise = |feature: &Feature| feature.after - feature.before;
        let counts = [over(0.02, &rise), over(0.05, &|f| f.before), over(0.05, &|f| f.after)];
        println!("{}: {} features, {counts:?}, {:?}", model.name, found.len(), strain.worst().first());
        assert_eq!(strain.features as usize, found.len());
        let [before, after] = [strain.features_strained_before, strain.features_strained_after];
        assert_eq!([strain.features_worse, before, after], counts);
        let mut worse: Vec<&Feature> = found.iter().filter(|feature| rise(feature) > 0.02).collect();
        worse.sort_by(|a, b| rise(b).total_cmp(&rise(a)));
        worse.truncate(16);
        assert_eq!(strain.worst().len(), worse.len());
        for (worst, feature) in strain.worst().iter().zip(worse) {
            let [before, after] = [worst.before, worst.after].map(f64::from);
            assert!((before - feature.before).abs() < 1e-5 && (after - feature.after).abs() < 1e-5);
            assert_eq!(worst.at_border, feature.kind != Kind::Inner);
        }
    }
}

#[test]
fn grey_paint_is_measured() {
    let mut model = two_squares();
    let pose: Vec<[f32; 3]> = model.rest.iter().map(|p| [1.5 * p[0], p[1], p[2]]).collect();
    let mut measured = |value: u8| {
        model.maps[0].rigidity.iter_mut().filter(|texel| **texel > 0).for_each(|texel| *texel = value);
        let options = SolveOptions { measure: true, ..SolveOptions::default() };
        solve(&model, &pose, 1, 128, STILL, &options).tile(0).report().unwrap().strain.unwrap()
    };
    let [rigid, half, less] = [255, 127, 102].map(&mut measured);
    // The disc over the seam has a part in either chart.
    assert_eq!((rigid.features, rigid.features_strained_before), (4, 4));
    for grey in [half, less] {
        let found = (grey.features, grey.segments, grey.before);
        assert_eq!(found, (rigid.features, rigid.segments, rigid.before));
        assert!(grey.after.free_rms < 0.5 * grey.before.free_rms, "{grey:?}");
    }
}

/// A scene, and of its features inside of charts, at open borders and at seams: how many may have an error over 0.05,
/// how many may be worse by 0.02 than with the original UVs, and the largest mean error.
type Bars = (&'static str, [(usize, usize, f64); 3]);

const BARS: [Bars; 15] = [
    ("squash", [(0, 0, 0.0196), (0, 0, 0.0), (0, 0, 0.0)]),
    ("squash to 40 %", [(36, 0, 0.1712), (0, 0, 0.0), (0, 0, 0.0)]),
    ("bulge", [(0, 0, 0.0038), (0, 0, 0.0), (0, 0, 0.0)]),
    ("pinch", [(0, 0, 0.0029), (0, 0, 0.0), (0, 0, 0.0)]),
    ("shear", [(0, 0, 0.0144), (0, 0, 0.0), (0, 0, 0.0)]),
    ("torus", [(0, 0, 0.0071), (0, 0, 0.0), (0, 0, 0.0)]),
    ("strips", [(0, 0, 0.0), (0, 0, 0.035), (0, 0, 0.0)]),
    ("mug_to_jug", [(6, 0, 0.0182), (0, 0, 0.0), (0, 0, 0.0)]),
    ("creature", [(130, 0, 0.0278), (0, 0, 0.0), (0, 0, 0.0026)]),
    ("arm", [(19, 0, 0.0154), (0, 0, 0.0), (0, 0, 0.0)]),
    ("mh_face", [(9, 0, 0.0053), (9, 0, 0.0816), (5, 0, 0.0366)]),
    ("spot", [(6, 0, 0.0307), (0, 0, 0.0), (0, 0, 0.013)]),
    ("cesium_man", [(8, 0, 0.0067), (0, 0, 0.0), (12, 0, 0.0283)]),
    ("fox", [(16, 2, 0.0425), (0, 0, 0.0), (47, 4, 0.1032)]),
    ("ict_inner", [(17, 0, 0.0088), (29, 0, 0.023), (131, 0, 0.0636)]),
];

#[test]
fn features_keep_their_shape() {
    let cases: Vec<_> =
        CASES.into_iter().filter_map(|(name, frame)| Some((table::model(name)?, frame))).collect();
    let cases = long::share(cases, 4, "scenes");
    let rows = on_all_cores(&cases, |&(model, frame)| {
        let judged = judge(model, frame, STILL);
        let name = &*model.name;
        let bars = BARS.iter().find(|bars| bars.0 == name).map_or([(0, 0, 0.0); 3], |bars| bars.1);
        (name, frame, bars, [Kind::Inner, Kind::Open, Kind::Seam].map(|kind| judged.of(kind)))
    });
    println!("scene                 where   features  over 0.05 before, after  worse  mean before, after");
    let mut failed = Vec::new();
    for (name, frame, bars, summaries) in rows {
        for ((place, bar), s) in ["inside", "open", "seam"].into_iter().zip(bars).zip(summaries) {
            if s.count == 0 {
                continue;
            }
            let line = format!(
                "{:20} {place:6} {:9} {:9} {:14} {:7} {:12.4} {:.4}",
                format!("{name} {frame}"),
                s.count,
                s.bad[0],
                s.bad[1],
                s.worse,
                s.mean[0],
                s.mean[1]
            );
            println!("{line}");
            if s.bad[1] > bar.0 || s.worse > bar.1 || s.mean[1] > bar.2 {
                failed.push(format!("{line}; at most {bar:?}"));
            }
        }
    }
    assert!(failed.is_empty(), "\n{}", failed.join("\n"));
}
