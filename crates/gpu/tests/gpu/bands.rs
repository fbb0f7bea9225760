//! Solves under the smallest limits that WebGPU allows, with levels laid over several buffers (bands) because one
//! binding cannot hold them: the bits are the same as with a single buffer under these limits.

use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, PbdSettings, Quality, SolveOptions, Solver,
    TileSettings,
};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, bits, long, options};

/// A device with WebGPU's default limits, whose buffers hold at most `blocks` blocks.
fn limited(band: Option<usize>) -> Device {
    let settings = DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() };
    Device::with_variables(&settings, &[("VRTM_GPU_LIMITS", "webgpu")], band).unwrap()
}

fn solve(device: &Device, model: &Model, quality: Quality) -> Asset {
    let mut asset = model.asset_on(device, 128);
    for tile in 0..asset.tile_count() {
        // A further stage, which writes what other stages only read.
        let settings = TileSettings { protect: 0.5, ..asset.settings(tile).unwrap() };
        asset.set_settings(tile, &settings).unwrap();
    }
    asset.solve(model.frame(1), &options(quality)).unwrap();
    asset
}

fn dispatches(asset: &Asset) -> u64 {
    asset.gpu_work(0).unwrap().unwrap().dispatches()
}

/// Limits of the adapter above WebGPU's defaults are not needed. With more workgroup memory other kernels relax and
/// assemble, whose sums compilers may round otherwise.
#[test]
fn webgpu_s_limits_give_the_same_result() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let limited = limited(None);
    for scene in long::share(vec![vrtm_testkit::scenes::creature(), vrtm_testkit::scenes::arm()], 2, "scenes")
    {
        let model = Model::from(scene);
        let [a, b] = [&device, &limited].map(|device| solve(device, &model, Quality::Normal));
        for tile in 0..a.tile_count() {
            let [u, v] = [&a, &b].map(|asset| asset.displacements(tile).unwrap());
            let squares = u.iter().flatten().zip(v.iter().flatten()).map(|(u, v)| f64::from(u - v).powi(2));
            let rms = (squares.sum::<f64>() / u.len() as f64).sqrt();
            let [a, b] = [&a, &b].map(|asset| asset.tile_report(tile).unwrap());
            println!("{}: {rms:.1e} cells apart, E {} and {}", model.name, a.energy, b.energy);
            assert!(rms < 2e-3 && (a.energy - b.energy).abs() < 1e-4 * a.energy, "{}", model.name);
            assert!(b.folds == 0 && b.charts_fallback == a.charts_fallback, "{}", model.name);
        }
    }
}

/// A grid of 128 cells a side has rows of eight or nine blocks; a band needs four of them.
#[test]
fn bands_give_the_same_bits() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    use vrtm_testkit::scenes::{analytic::squash, arm, creature, mug_to_jug};
    let whole = limited(None);
    let cases = vec![
        (squash(0.4), 36, Quality::Normal),
        (mug_to_jug(), 30, Quality::Normal),
        (creature(), 30, Quality::Normal),
        (arm(), 45, Quality::Draft),
        (arm(), 36, Quality::Draft),
    ];
    for (scene, blocks, quality) in long::share(cases, 3, "scenes in bands") {
        let model = Model::from(scene);
        let (a, b) = (solve(&whole, &model, quality), solve(&limited(Some(blocks)), &model, quality));
        let [few, many] = [&a, &b].map(dispatches);
        println!("{:12} {few} dispatches, in bands of {blocks} blocks {many}", model.name);
        // Draft has few dispatches on level 0, the level that is divided into bands.
        assert!(many > few, "{}: {few} dispatches, {many} in bands", model.name);
        assert!(bits(&a) == bits(&b), "{}, bands of {blocks} blocks", model.name);
        let [a, b] = [&a, &b].map(|asset| asset.tile_report(0).unwrap());
        assert_eq!(
            (a.energy, a.min_jacobian, a.folds),
            (b.energy, b.min_jacobian, b.folds),
            "{}",
            model.name
        );
    }
}

/// With 320 cells a side the second level is divided, too: it has rows of ten or eleven blocks. What blocks contribute
/// to its right-hand side crosses bands.
#[test]
fn bands_of_two_levels_give_the_same_bits() {
    if !vrtm_testkit::has_gpu() || !long::only("bands of two levels") {
        return;
    }
    let model = Model::from(vrtm_testkit::scenes::analytic::squash(0.4));
    let [a, b] = [None, Some(86)].map(|band| {
        let mut asset = model.asset_on(&limited(band), 320);
        asset.solve(model.frame(1), &options(Quality::Normal)).unwrap();
        asset
    });
    assert!(dispatches(&b) > dispatches(&a));
    assert!(bits(&a) == bits(&b));
}

/// Reused charts and warm starts find the last result in bands.
#[test]
fn results_in_bands_are_gone_on_from() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let model = Model::from(vrtm_testkit::scenes::creature());
    let [mut a, mut b] = [None, Some(30)].map(|band| model.asset_on(&limited(band), 128));
    let draft = options(Quality::Draft);
    let warm = SolveOptions { warm: true, ..draft };
    let held = SolveOptions { quality: Quality::Normal, temporal_weight: 0.1, ..warm };
    for (frame, options) in [(1, &draft), (2, &warm), (2, &draft), (1, &warm), (2, &held)] {
        for asset in [&mut a, &mut b] {
            asset.solve(model.frame(frame), options).unwrap();
        }
        assert!(bits(&a) == bits(&b), "frame {frame}, warm {}", options.warm);
    }
}

/// The paper's solver, whose two copies of the state swap places with each pass, gives the same bits in bands.
#[test]
fn iterations_in_bands_give_the_same_bits() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let pbd = PbdSettings { iterations: 5, ..PbdSettings::default() };
    let options = SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() };
    for (scene, blocks) in [(vrtm_testkit::scenes::mug_to_jug(), 30), (vrtm_testkit::scenes::arm(), 36)] {
        let model = Model::from(scene);
        let [a, b] = [None, Some(blocks)].map(|band| {
            let mut asset = model.asset_on(&limited(band), 128);
            asset.solve(model.frame(1), &options).unwrap();
            asset
        });
        assert!(dispatches(&b) > dispatches(&a), "{}", model.name);
        assert!(bits(&a) == bits(&b), "{}, bands of {blocks} blocks", model.name);
    }
}

/// A band has copies of the adjacent rows of blocks. A node near a band's edge that moves beyond these, by more than 16
/// cells, does not find the metric at its position on a coarser level: its step is refused, as at a chart's border. The
/// result is certified, and its energy agrees to 5e-3. (Bindings of 128 MiB hold bands of 7000 blocks: few nodes are so
/// close to an edge of one.)
#[test]
fn far_steps_across_bands_are_refused() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    // The whole sheet is compressed toward its lower end; a rigid disc in the middle has to move by 40 cells.
    let mut model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    for (p, rest) in model.frames[0].iter_mut().zip(&model.rest) {
        *p = [rest[0], rest[1].powi(5), 0.0];
    }
    let n = model.maps[0].width as usize;
    for (k, rigidity) in model.maps[0].rigidity.iter_mut().enumerate() {
        let [x, y] = [k % n, k / n].map(|x| x as f64 / n as f64 - 0.5);
        *rigidity = if x.hypot(y) < 0.25 { 255 } else { 0 };
    }
    // There are rows of eight blocks on level 0 and of four on level 1: both levels have bands.
    let settings = TileSettings { grid: [Some(128), Some(512)], ..TileSettings::default() };
    let assets = [None, Some(32)].map(|band| {
        let mut asset = model.asset_on(&limited(band), 128);
        asset.set_settings(0, &settings).unwrap();
        asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
        asset
    });
    let [a, b] = assets.each_ref().map(|asset| asset.tile_report(0).unwrap());
    let [u, v] = assets.each_ref().map(|asset| asset.displacements(0).unwrap());
    let difference =
        u.iter().flatten().zip(v.iter().flatten()).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
    println!(
        "moved by {} cells; {difference} apart in bands; E {} and {}",
        a.max_displacement, a.energy, b.energy
    );
    assert!(a.max_displacement > 32.0, "{}", a.max_displacement);
    assert!(b.folds == 0 && b.min_jacobian > 0.0 && b.charts_fallback == 0);
    // The measured difference is 2e-3: refused steps of a coarse correction lead to another state. The next level makes
    // up for them.
    assert!((b.energy / a.energy - 1.0).abs() < 5e-3, "{} {}", a.energy, b.energy);
}

#[test]
fn bindings_that_hold_no_band_are_refused() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let mut asset = model.asset_on(&limited(Some(20)), 128);
    let error = asset.solve(model.frame(1), &SolveOptions::default()).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);
    assert_eq!(error.message, "the GPU's bindings hold 20 blocks: too few for rows of 128 cells");
    // The failed solve leaves the asset usable: with a smaller grid it solves.
    vrtm_testkit::set_grid(&mut asset, 64);
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    assert!(asset.tile_report(0).unwrap().min_jacobian > 0.0);
}
