//! The paper's solver (method §10) through the public API, on both backends: which invariants it keeps, how it reports
//! folds, and the behaviour of the paper's figure 5. `cargo test --test solver pbd:: -- --show-output` shows its
//! figures.

use vrtm::{
    Asset, DeviceSettings, FetchKind, PbdSettings, Quality, SolveOptions, Solver, Strided, TileReport,
    TileSettings,
};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, Warp, bits, cpu, devices, fetch, gpu, scenes, view};

fn pbd(iterations: u32) -> SolveOptions {
    let pbd = PbdSettings { iterations, ..PbdSettings::default() };
    SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() }
}

fn report(asset: &Asset) -> TileReport {
    asset.tile(0).report().unwrap()
}

#[test]
fn it_brings_the_energy_down_and_more_iterations_bring_it_lower() {
    for model in [Model::from(scenes::analytic::bulge()), Model::from(scenes::mug_to_jug())] {
        let energies: Vec<f64> = [2, 4, 16]
            .map(|n| {
                let report = report(&model.solved(&cpu(0), 128, 1, &pbd(n)));
                let sweeps = n * report.levels;
                assert_eq!((report.sweeps, report.corrections, report.charts_fallback), (sweeps, 0, 0));
                assert!(report.node_updates > u64::from(n) * report.nodes_active);
                assert!(report.times.pbd > 0.0 && report.times.relax == 0.0);
                report.energy / report.energy_before
            })
            .into();
        println!("{}: {energies:.3?}", model.name);
        assert!(energies.is_sorted_by(|a, b| a > b) && energies[2] < 0.6, "{}", model.name);
    }
}

#[test]
fn rest_is_the_identity_and_what_is_fixed_stays() {
    for device in devices() {
        let mut model = Model::from(scenes::analytic::bulge());
        let mut asset = model.asset_on(&device, 64);
        asset.solve(Strided::from_slice(&model.rest), &pbd(4)).unwrap();
        assert!(Warp::of(&asset, 0).is_identity());
        // A cross of fixed texels, 8 of 64 wide: there is one on either side of each node that is checked.
        let inside = |k: usize| (28..36).contains(&(k % 64)) || (28..36).contains(&(k / 64));
        model.maps[0].mask =
            Some((0..512 * 512).map(|k| if inside(k % 512 / 8 + k / 4096 * 64) { 0 } else { 255 }).collect());
        let warp = Warp::of(&model.solved(&device, 64, 1, &pbd(4)), 0);
        assert!(warp.longest() > 0.1);
        for (k, u) in warp.u.iter().enumerate() {
            let (i, j) = (k % 65, k / 65);
            let rim = i == 0 || j == 0 || i == 64 || j == 64;
            if rim || (29..36).contains(&i) || (29..36).contains(&j) {
                assert_eq!(*u, [0.0; 2], "({i}, {j})");
            }
        }
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    // The last scene folds: its texels have to be the same as well.
    let squash = Model::from(scenes::analytic::squash(0.25));
    for model in [Model::from(scenes::mug_to_jug()), squash] {
        let solve = |threads: u32| {
            let mut asset = model.solved(&cpu(threads), 96, 1, &pbd(4));
            let redirection = fetch(&mut asset, 0, FetchKind::Redirection, [100, 100]);
            let redirection: Vec<_> = redirection.iter().map(|uv| uv.map(f32::to_bits)).collect();
            (bits(&asset), redirection, report(&asset).energy.to_bits())
        };
        let one = solve(1);
        for threads in [2, 5] {
            assert!(one == solve(threads), "{}: {threads} threads", model.name);
        }
    }
}

/// Both backends do the same arithmetic in the same order, except that a GPU may contract operations and rounds
/// divisions and roots in its own way. Iterations pass the differences on without amplifying them: a tenth of the bound
/// is measured.
#[test]
fn both_backends_give_the_same_warp() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    for (model, frame) in
        [(Model::from(scenes::analytic::torus()), 1), (Model::from(scenes::mug_to_jug()), 3)]
    {
        for options in [pbd(1), pbd(6), SolveOptions { warm: true, ..pbd(4) }] {
            let [mut a, mut b] = [cpu(0), device.clone()].map(|device| model.asset_on(&device, 96));
            for asset in [&mut a, &mut b] {
                if options.warm {
                    asset.solve(model.frame(frame), &pbd(2)).unwrap();
                }
                asset.solve(model.frame(frame), &options).unwrap();
            }
            let [u, v] = [&a, &b].map(|asset| asset.displacements(0).unwrap());
            let pairs = u.iter().flatten().zip(v.iter().flatten());
            let most = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            let [a, b] = [&a, &b].map(report);
            println!("{}, {:?}: {most:.1e} cells", model.name, options.pbd.iterations);
            assert!(most < 2e-5, "{}: {most} cells", model.name);
            assert!((a.energy / b.energy - 1.0).abs() < 1e-5, "{} {}", a.energy, b.energy);
            assert_eq!((a.sweeps, a.folds, a.charts_fallback), (b.sweeps, b.folds, b.charts_fallback));
        }
    }
}

/// Folded and collapsed cells cover some texels several times and others by triangles with hardly any area: each texel
/// still gets a place in the tile.
#[test]
fn redirections_of_folds_stay_in_the_tile() {
    let models = [0.4, 0.1, 0.01].map(|fraction| Model::from(scenes::analytic::squash(fraction)));
    let mut folds = 0;
    for device in devices() {
        for model in &models {
            let mut asset = model.solved(&device, 64, 1, &pbd(16));
            folds += report(&asset).folds;
            for size in [[64, 64], [128, 32], [301, 77]] {
                let uvs = fetch(&mut asset, 0, FetchKind::Redirection, size);
                let bad = uvs.iter().flatten().find(|x| !(-1e-6..=1.0 + 1e-6).contains(*x));
                assert_eq!(bad, None, "{} at {size:?}", model.name);
            }
        }
    }
    assert!(folds > 1000, "{folds}");
}

/// Its nodes may leave the tile, as the header says at VRTM_SOLVER_PBD; nodes of `descent` never do.
#[test]
fn nodes_leave_the_tile_by_no_more_than_the_header_says() {
    // The sheet covers all of the tile, and shrinks to a tenth, so that discs want to grow over the border.
    let mut model = Model::from(scenes::analytic::squash(0.1));
    model.frames[0].iter_mut().for_each(|p| p[1] *= 0.1);
    model.uvs.iter_mut().flatten().for_each(|x| *x = ((*x - 0.02) / 0.96).clamp(0.0, 1.0));
    let outside = |grid: u32, options: &SolveOptions| {
        let mut asset = model.solved(&cpu(0), grid, 1, options);
        let nodes = fetch(&mut asset, 0, FetchKind::Warp, [grid + 1; 2]);
        nodes.as_flattened().iter().fold(0.0f32, |most, x| most.max(-x).max(x - 1.0))
    };
    let worst = outside(128, &pbd(64)).max(outside(64, &pbd(64)));
    println!("{worst} of the tile's side");
    assert!(worst > 0.01 && worst < 0.08, "{worst}");
    assert!(outside(64, &SolveOptions::default()) <= 0.0);
}

/// Compares the backends stage by stage from the same state.
#[cfg(feature = "gpu")]
#[test]
fn backends_can_be_compared() {
    use vrtm_testkit::parity::compare_backends;

    if !vrtm_testkit::has_gpu() {
        return;
    }
    let model = Model::from(scenes::analytic::torus());
    let settings = DeviceSettings { backend: vrtm::Backend::Gpu, ..DeviceSettings::default() };
    let asset = model.asset_on(&vrtm::Device::new(&settings).unwrap(), 64);
    let differences = compare_backends(&asset, 0, model.frame(1), &pbd(5), true).unwrap();
    assert!(differences.iter().filter(|d| d.stage.starts_with("relax@")).count() >= 5);
    for d in differences.iter().filter(|d| d.quantity == "displacement (cells)") {
        // The rounding of displacements of a few cells, in one stage.
        assert!(d.max < 1e-5, "{d:?}");
    }
}

#[test]
fn a_folded_result_is_reported_and_returned() {
    let model = Model::from(scenes::analytic::squash(0.1));
    // Neither turning back nor smoothing hinders folds.
    let settings = PbdSettings {
        iterations: 1,
        orientation_preservation: 0.0,
        smoothing: 0.0,
        ..PbdSettings::default()
    };
    let options = SolveOptions { solver: Solver::Pbd, pbd: settings, ..SolveOptions::default() };
    for device in devices() {
        let mut asset = model.solved(&device, 64, 1, &options);
        let reported = report(&asset);
        println!(
            "{} folds, J {:.2}, E {:.0} -> {:.0}",
            reported.folds, reported.min_jacobian, reported.energy_before, reported.energy
        );
        assert!(reported.folds > 0 && reported.min_jacobian <= 0.0);
        assert!(reported.energy.is_finite() && reported.energy < 1e30);
        assert_eq!(reported.charts_fallback, 0);
        assert!(!Warp::of(&asset, 0).is_identity());
        // Its texels get a redirection all the same.
        let redirection = fetch(&mut asset, 0, FetchKind::Redirection, [64, 64]);
        assert!(redirection.iter().flatten().all(|x| (-0.01..=1.01).contains(x)));
        let uvs = vrtm_testkit::corner_uvs(&asset);
        assert!(uvs.iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn a_budget_ends_it_early_and_a_warm_start_goes_on() {
    let model = Model::from(scenes::analytic::bulge());
    for device in devices() {
        let mut asset = model.solved(
            &device,
            64,
            1,
            &SolveOptions { time_budget: Some(std::time::Duration::from_micros(1)), ..pbd(64) },
        );
        let cut = report(&asset);
        // One iteration, and a last one, on each small level.
        assert!(cut.truncated && cut.sweeps <= 2 * cut.levels, "{} iterations", cut.sweeps);
        // A warm start continues from its own result on the finest level alone.
        asset.solve(model.frame(1), &pbd(4)).unwrap();
        let cold = report(&asset);
        asset.solve(model.frame(1), &SolveOptions { warm: true, ..pbd(4) }).unwrap();
        let warm = report(&asset);
        assert_eq!((cold.sweeps, warm.sweeps), (4 * cold.levels, 4));
        assert!(warm.energy < 1.05 * cold.energy, "{} {}", warm.energy, cold.energy);
    }
}

#[test]
fn solvers_take_turns_on_one_asset() {
    let model = Model::from(scenes::analytic::pinch());
    for device in devices() {
        let mut asset = model.asset_on(&device, 64);
        let mut solve = |options: &SolveOptions| {
            asset.solve(model.frame(1), options).unwrap();
            (bits(&asset), report(&asset))
        };
        let (first, of_descent) = solve(&SolveOptions::default());
        let (other, of_pbd) = solve(&pbd(2));
        assert!(first != other && of_pbd.energy > of_descent.energy);
        // Settings of the solver that is not used do not count as a change: the result is kept.
        let (same, kept) = solve(&SolveOptions { quality: Quality::Draft, tolerance: Some(0.5), ..pbd(2) });
        assert!(other == same && kept.charts_reused == kept.charts && kept.charts_active == 0);
        assert!(first == solve(&SolveOptions::default()).0);
    }
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let model = Model::from(scenes::analytic::bulge());
    let mut asset = model.asset(1, 32);
    let half = PbdSettings { damping: 0.5, ..PbdSettings::default() };
    for (pbd, culprit) in [
        (PbdSettings { iterations: 1025, ..half }, "options.pbd.iterations: 1025 is not between 1 and 1024"),
        (PbdSettings { damping: 1.5, ..half }, "options.pbd.damping: 1.5 is not between 0 and 1"),
        (
            PbdSettings { orientation_preservation: -0.5, ..half },
            "options.pbd.orientation_preservation: -0.5",
        ),
        (PbdSettings { smoothing: f32::NAN, ..half }, "options.pbd.smoothing: NaN"),
        (PbdSettings { coarse_correction: f32::INFINITY, ..half }, "options.pbd.coarse_correction: inf"),
    ] {
        let options = SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() };
        let error = asset.solve(model.frame(1), &options).unwrap_err();
        assert!(error.message.starts_with(culprit), "{}", error.message);
    }
    assert!(asset.tile(0).report().is_err(), "nothing was solved");
}

/// A sheet with features of 8 x 8 texels of 64, compressed in u to 60 %; the map is the caller's.
fn compressed(rigidity: &[u8], options: &SolveOptions, settings: impl FnOnce(&mut TileSettings)) -> Warp {
    let mut scene = scenes::analytic::squash(0.6);
    scene.tiles.clear();
    let model = Model::from(scene);
    let mut asset = model.bare(0, Strided::from_slice(&model.rest));
    asset.tile_mut(0).set_rigidity(Some(view(rigidity, 64, 64))).unwrap();
    vrtm_testkit::set_grid(&mut asset, 64);
    vrtm_testkit::change(&mut asset, 0, settings);
    asset.solve(model.frame(1), options).unwrap();
    Warp::of(&asset, 0)
}

/// Width on the mesh of the nodes from (i, j) to (i + n, j), relative to that at rest.
fn width(warp: &Warp, i: usize, j: usize, n: usize) -> f64 {
    0.6 * (warp.node(i + n, j)[0] - warp.node(i, j)[0]) / n as f64
}

/// RMS strain on the mesh of the segments of a feature of 8 x 8 texels whose first node is (i, j).
fn strain(warp: &Warp, i: usize, j: usize) -> f64 {
    let mut squares = Vec::new();
    for (x, y) in (1..7).flat_map(|y| (1..7).map(move |x| (i + x, j + y))) {
        for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
            let (a, b) = (warp.node(x, y), warp.node(x + di, y + dj));
            let length = (0.6 * (b[0] - a[0])).hypot(b[1] - a[1]);
            squares.push((length / ((di + dj) as f64).sqrt() - 1.0).powi(2));
        }
    }
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

/// The heuristic of figure 5: sparse features keep their shape better than if all features had the κ that dense ones
/// get.
#[test]
fn sparse_features_keep_their_shape_if_dense_ones_keep_their_orientation() {
    // Features of 8 texels: 12 apart in the upper half, 24 in the lower.
    let feature = |x: usize, every: usize| x % every >= 4 && x % every < 12 && x < 60;
    let texel = |x: usize, y: usize| {
        let every = if y < 32 { 12 } else { 24 };
        if feature(x, every) && feature(y % 32, every) { 255u8 } else { 0 }
    };
    let map: Vec<u8> = (0..64 * 64).map(|k| texel(k % 64, k / 64)).collect();
    for solver in [Solver::Pbd, Solver::Descent] {
        // Mean strain of the sparse features and of the dense ones; the rows of the map count from v = 1.
        let strains = |orientation: f32, density: f32| {
            let pbd = PbdSettings { orientation_preservation: orientation, ..PbdSettings::default() };
            let options = SolveOptions { solver, pbd, ..SolveOptions::default() };
            let warp = compressed(&map, &options, |settings| {
                (settings.orientation, settings.orientation_density) = (orientation, density);
            });
            let mean = |every: usize, rows: &[usize]| {
                let starts: Vec<usize> = (0..5).map(|n| 4 + n * every).filter(|x| x + 8 <= 60).collect();
                let all = starts.iter().flat_map(|&i| rows.iter().map(move |&j| (i, j)));
                let all: Vec<f64> = all.map(|(i, j)| strain(&warp, i, 64 - j - 8)).collect();
                all.iter().sum::<f64>() / all.len() as f64
            };
            [mean(24, &[36]), mean(12, &[4, 16])]
        };
        // Densities are about 0.45 in the upper half and 0.2 in the lower.
        let settings = [(0.0, 0.0), (0.2, 0.0), (0.0, 0.5)];
        let [free, evenly, by_density] = settings.map(|(kappa, density)| strains(kappa, density));
        println!("{solver:?}: sparse, dense {free:.3?}, evenly {evenly:.3?}, by density {by_density:.3?}");
        // The dense features keep their directions as before; the sparse ones are held less, and keep more of their
        // shape.
        assert!((by_density[1] - evenly[1]).abs() < 0.01 && by_density[1] > free[1] + 0.02, "{solver:?}");
        assert!(by_density[0] < 0.9 * evenly[0] && by_density[0] < 0.75 * by_density[1], "{solver:?}");
    }
}

/// The energy that a solve reports is that of the reference, with all of its terms active.
#[test]
fn the_energy_is_the_reference_s() {
    let model = Model::from(scenes::analytic::torus());
    for device in devices() {
        let mut asset = model.asset_on(&device, 64);
        let settings = TileSettings {
            orientation: 0.1,
            orientation_density: 0.7,
            harm: 0.0,
            ..asset.tile_mut(0).settings().unwrap()
        };
        let mut energies = Vec::new();
        for density in [0.0, settings.orientation_density] {
            let settings = TileSettings { orientation_density: density, ..settings };
            asset.tile_mut(0).set_settings(&settings).unwrap();
            for options in [SolveOptions::default(), pbd(8)] {
                asset.solve(model.frame(1), &options).unwrap();
                let u: Vec<[f64; 2]> =
                    asset.displacements(0).unwrap().iter().map(|u| u.map(f64::from)).collect();
                let exact = asset.reference_energy(0, model.frame(1), &u).unwrap();
                let reported = report(&asset).energy;
                // f32 against f64, with positions of fractions of a cell: six digits of each term.
                assert!((reported / exact - 1.0).abs() < 1e-4, "{reported} {exact}");
                energies.push(reported);
            }
        }
        println!("{energies:.3?}");
        // A larger κ costs energy.
        assert!(energies[2] > 1.01 * energies[0], "{energies:?}");
    }
}

/// Figure 5: under a strong compression, rigid features keep more of their size than those of rigidity one half, and
/// these more than those of a quarter.
#[test]
fn features_keep_their_size_in_the_order_of_their_rigidity() {
    for solver in [Solver::Pbd, Solver::Descent] {
        let kept = [1.0, 0.5, 0.25].map(|rigidity| {
            // Three rows of three features of 12 texels.
            let feature = |k: usize| k % 21 >= 5 && k % 21 < 17 && k < 63;
            let texel =
                |k: usize| if feature(k % 64) && feature(k / 64) { (255.0 * rigidity) as u8 } else { 0 };
            let map: Vec<u8> = (0..64 * 64).map(texel).collect();
            let warp = compressed(&map, &SolveOptions { solver, ..SolveOptions::default() }, |_| ());
            let at = [7, 28, 49];
            at.iter().flat_map(|&i| at.map(|j| width(&warp, i, j + 4, 8))).sum::<f64>() / 9.0
        });
        println!("{solver:?}: {kept:.3?} of their width, in a square of 0.6");
        assert!(
            kept[0] > kept[1] + 0.01 && kept[1] > kept[2] + 0.01 && kept[2] > 0.61,
            "{solver:?} {kept:?}"
        );
    }
}
