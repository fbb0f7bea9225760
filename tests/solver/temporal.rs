//! A warm solve that is held to the last result (method §5, Warm start): what the temporal weight does to jitter, what
//! it costs in lag and strain, and that it does the same on grids of different sizes and on both backends. `cargo test
//! --test solver temporal:: -- --show-output` shows the tables.

use vrtm::{Asset, DeviceSettings, SolveOptions, Strided};
use vrtm_testkit::Lab as _;
use vrtm_testkit::roughness::{self, Spread};
use vrtm_testkit::scenes::{analytic, arm, creature};
use vrtm_testkit::{self, Model, bits, gpu, long, on_all_cores};

type Warp = Vec<[f32; 2]>;

fn held(weight: f32) -> SolveOptions {
    SolveOptions { warm: true, temporal_weight: weight, ..SolveOptions::default() }
}

fn solved(asset: &mut Asset, pose: &[[f64; 3]], options: &SolveOptions) -> Warp {
    asset.solve(Strided::from_slice(pose), options).unwrap();
    (0..asset.tile_count()).flat_map(|tile| asset.displacements(tile).unwrap()).collect()
}

/// The sum over all nodes of the products of `a - b` and `c - d`.
fn product(a: &Warp, b: &Warp, c: &Warp, d: &Warp) -> f64 {
    let component = |n: usize, k: usize| {
        (f64::from(a[n][k]) - f64::from(b[n][k])) * (f64::from(c[n][k]) - f64::from(d[n][k]))
    };
    (0..a.len()).map(|n| component(n, 0) + component(n, 1)).sum()
}

fn distance(a: &Warp, b: &Warp) -> f64 {
    (product(a, b, a, b) / a.len() as f64).sqrt()
}

/// A steady motion that stops: the pose goes from 80 % to 90 % of the way to the frame in `MOVING` frames, a tenth of
/// the speed of a motion that takes a second, and stays there for `RESTING` frames.
const MOVING: usize = 24;
const RESTING: usize = 48;

/// Effect of a temporal weight on one scene.
struct Figures {
    /// RMS of the second difference of W over the frames of the motion, in cells.
    jitter: f64,
    /// By how many frames W is behind the stateless results, along their motion.
    lag: f64,
    /// Number of frames after the end of the motion in which W still changes by more than a tenth of what it changed by
    /// in the motion's last frame.
    settling: usize,
    /// RMS strain of rigid features in the motion's last frame.
    strain: f64,
    ms: f32,
}

fn play(model: &Model, options: &SolveOptions, grid: u32, resting: usize) -> (Vec<Warp>, f64, f32) {
    let mut asset = model.asset(1, grid);
    let mut ms = 0.0;
    let (mut strain, mut warps) = (0.0, Vec::new());
    for frame in 0..=MOVING + resting {
        let t = 0.8 + 0.1 * frame.min(MOVING) as f64 / MOVING as f64;
        let options = SolveOptions { measure: frame == MOVING, ..*options };
        warps.push(solved(&mut asset, &roughness::way(model, 1, t), &options));
        if (1..MOVING).contains(&frame) {
            ms += asset.report().unwrap().total_ms / (MOVING - 1) as f32;
        }
        if frame == MOVING {
            strain = f64::from(asset.tile(0).report().unwrap().strain.unwrap().after.rms);
        }
    }
    (warps, strain, ms)
}

fn figures(stateless: &[Warp], (warps, strain, ms): (Vec<Warp>, f64, f32)) -> Figures {
    // The first frames, in which a motion begins, are left out.
    let moving = &warps[8..=MOVING];
    let second = moving.windows(3).map(|w| {
        let at = |n: usize| {
            [0, 1].map(|c| f64::from(w[2][n][c]) - 2.0 * f64::from(w[1][n][c]) + f64::from(w[0][n][c]))
        };
        Spread::of((0..w[0].len()).map(|n| at(n)[0].hypot(at(n)[1]))).rms.powi(2)
    });
    let jitter = (second.sum::<f64>() / (moving.len() - 2) as f64).sqrt();
    // The mean speed of the stateless results over the last eight frames of the motion.
    let (end, before) = (&stateless[MOVING], &stateless[MOVING - 8]);
    let lag = 8.0 * product(end, &warps[MOVING], end, before) / product(end, before, end, before);
    let change = |k: usize| distance(&warps[k], &warps[k - 1]);
    let settling =
        (MOVING + 1..warps.len()).rfind(|&k| change(k) > 0.1 * change(MOVING)).map_or(0, |k| k - MOVING);
    Figures { jitter, lag, settling, strain, ms }
}

/// The weights of the table, and the one whose effect is tested.
const WEIGHTS: [f32; 6] = [0.0, 0.01, 0.03, WEIGHT, 0.3, 1.0];
const WEIGHT: f32 = 0.1;

/// Second differences of this size are those of the motion itself.
const SMOOTH: f64 = 2e-4;

#[test]
fn jitter_falls_and_lag_grows_with_the_weight() {
    let mut models: Vec<Model> = [analytic::bulge(), arm(), creature()].map(Model::from).into();
    models.push(Model { name: "squash to 40 %".into(), ..Model::from(analytic::squash(0.4)) });
    let held_ones = ["mh_face", "cesium_man", "fox"];
    models
        .extend(vrtm_testkit::assets().into_iter().filter(|model| held_ones.contains(&model.name.as_str())));
    let weights: Vec<f32> =
        WEIGHTS.into_iter().filter(|&weight| long::long() || weight == 0.0 || weight == WEIGHT).collect();
    let models = long::share(models, 7, "models");
    println!("{} of {} weights; VRTM_LONG_TESTS=1 shows all", weights.len(), WEIGHTS.len());
    let rows = on_all_cores(&models, |model| {
        let stateless = play(model, &SolveOptions::default(), 128, RESTING);
        let of = |weight: f32| figures(&stateless.0, play(model, &held(weight), 128, RESTING));
        (
            figures(&stateless.0, stateless.clone()),
            weights.iter().map(|&weight| of(weight)).collect::<Vec<_>>(),
        )
    });
    println!("scene           weight      jitter (cells)  lag (frames)  settling  strain      ms");
    let mut failed = Vec::new();
    for (model, (stateless, rows)) in models.iter().zip(&rows) {
        let names = std::iter::once("stateless".to_owned()).chain(weights.iter().map(f32::to_string));
        for (name, f) in names.zip(std::iter::once(stateless).chain(rows)) {
            println!(
                "{:15} {name:10} {:12.5} {:13.2} {:12} {:10.4} {:7.1}",
                model.name, f.jitter, f.lag, f.settling, f.strain, f.ms
            );
        }
        let (free, held) = (&rows[0], &rows[weights.iter().position(|&weight| weight == WEIGHT).unwrap()]);
        // Warm solves keep the bar of `roughness`, or are about as rough as stateless ones. Of held ones, at most 0.73,
        // 1.7 frames, and less than 5 % were measured.
        let good = free.jitter <= (1.5 * stateless.jitter).max(0.01)
            && held.jitter <= (0.85 * free.jitter).max(SMOOTH)
            && held.lag - free.lag <= 2.5
            && held.strain <= 1.05 * free.strain;
        if !good {
            failed.push(&model.name);
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

/// Offsets between nodes do not depend on the size of the cells, and neither does what they are held to.
#[test]
fn the_lag_is_that_of_any_grid() {
    let model = Model::from(arm());
    let late = |grid: u32| {
        let stateless = play(&model, &SolveOptions::default(), grid, 0).0;
        let [free, held] =
            [0.0, 0.3].map(|weight| figures(&stateless, play(&model, &held(weight), grid, 0)).lag);
        held - free
    };
    let grids = if long::only("the grid of 192 cells") { vec![96, 192, 64] } else { vec![96, 64] };
    let lags: Vec<f64> = grids.into_iter().map(late).collect();
    println!("{lags:?}");
    for lag in &lags {
        assert!((lag / lags[0] - 1.0).abs() < 0.2, "{lags:?}");
    }
}

#[test]
fn a_weight_alone_changes_nothing() {
    let model = Model::from(creature());
    let [mut plain, mut weighted] = [(); 2].map(|()| model.asset(0, 64));
    let normal = SolveOptions::default();
    for frame in [1, 2, 2] {
        plain.solve(model.frame(frame), &normal).unwrap();
        weighted.solve(model.frame(frame), &SolveOptions { temporal_weight: 0.1, ..normal }).unwrap();
        assert!(bits(&plain) == bits(&weighted), "frame {frame}");
    }
    // It does not keep charts from being reused either.
    assert!(weighted.tile(0).report().unwrap().charts_reused > 0);
}

#[test]
fn the_first_frame_is_held_to_nothing() {
    let model = Model::from(creature());
    let [mut plain, mut first] = [(); 2].map(|()| model.asset(0, 64));
    let before = solved(&mut plain, &roughness::way(&model, 1, 0.9), &SolveOptions::default());
    assert!(solved(&mut first, &roughness::way(&model, 1, 0.9), &held(1e6)) == before);
    // The further frames are held the faster, the higher the weight.
    let way = |weight: f32| {
        let mut asset = model.asset(0, 64);
        solved(&mut asset, &roughness::way(&model, 1, 0.9), &held(weight));
        distance(&solved(&mut asset, &roughness::way(&model, 1, 0.92), &held(weight)), &before)
    };
    let ways = [0.0, 1.0, 10.0, 100.0, 1e4].map(way);
    assert!(ways.windows(2).all(|way| way[1] < 0.25 * way[0]), "{ways:?}");
    assert!(way(1e6) < 1e-6);
}

/// Both backends hold alike: on a scene with room their warps differ by no more than without a weight.
#[test]
fn a_gpu_holds_as_the_cpu_does() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    let model = Model::from(analytic::bulge());
    let (mut a, mut b) = (model.asset(0, 64), model.asset_on(&device, 64));
    // The pose at rest is solved without a GPU, and what comes next is held to it.
    let frames = [(0.6, 0.0), (0.7, 0.0), (0.8, 0.1), (0.9, 1.0), (1.0, 10.0), (0.0, 1.0), (0.6, 1.0)];
    for (t, weight) in frames {
        let pose = roughness::way(&model, 1, t);
        let [x, y] = [&mut a, &mut b].map(|asset| solved(asset, &pose, &held(weight)));
        let apart = x
            .iter()
            .zip(&y)
            .flat_map(|(x, y)| [x[0] - y[0], x[1] - y[1]])
            .fold(0.0, |m: f32, d| m.max(d.abs()));
        println!("weight {weight}: {apart:.1e} cells apart");
        assert!(apart < 2e-3, "weight {weight}: {apart}");
        let [x, y] = [&a, &b].map(|asset| asset.tile(0).report().unwrap().energy);
        assert!((x - y).abs() <= 1e-4 * y, "weight {weight}: {x} {y}");
    }
}
