//! Solves under the smallest limits that WebGPU allows, and grids that are too large for a GPU's buffers.

use vrtm::{Backend, Device, DeviceSettings, ErrorKind, Quality, TileSettings};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, long, options};

/// A device with WebGPU's default limits, whose buffers hold at most so many blocks.
fn limited(most_blocks: Option<usize>) -> Device {
    let settings = DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() };
    Device::with_variables(&settings, &[("VRTM_GPU_LIMITS", "webgpu")], most_blocks).unwrap()
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
        let [a, b] = [&device, &limited].map(|device| {
            let mut asset = model.asset_on(device, 128);
            asset.solve(model.frame(1), &options(Quality::Normal)).unwrap();
            asset
        });
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

/// The error of a grid that is too large comes from the estimate, from a prepared tile and from a solve. It names a
/// size that works, and the next larger one does not.
#[test]
fn a_grid_that_is_too_large_names_one_that_fits() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let device = limited(Some(40));
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let mut asset = model.asset_on(&device, 192);
    let error = asset.tile_estimate(0).unwrap_err();
    let gpu = device.info().name;
    let start = "grid: 192 x 192 cells of tile 1001 take ";
    let end = format!(
        " blocks of 16 x 16 nodes, but a buffer of the GPU {gpu} holds 40: at most 96 x 96 cells fit; on the CPU all do"
    );
    assert!(error.message.starts_with(start) && error.message.ends_with(&end), "{error}");
    for other in
        [asset.tile_info(0).unwrap_err(), asset.solve(model.frame(1), &options(Quality::Draft)).unwrap_err()]
    {
        assert_eq!((other.kind, &other.message), (ErrorKind::Unsupported, &error.message));
    }
    vrtm_testkit::set_grid(&mut asset, 112);
    assert_eq!(asset.tile_estimate(0).unwrap_err().kind, ErrorKind::Unsupported);
    // The failed calls leave the asset usable.
    vrtm_testkit::set_grid(&mut asset, 96);
    asset.tile_estimate(0).unwrap();
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    assert!(asset.tile_report(0).unwrap().min_jacobian > 0.0);
}

/// The shape of a grid stays; a tile that was saved on the CPU is refused when it is loaded.
#[test]
fn a_long_grid_keeps_its_shape_and_a_loaded_one_is_refused() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let settings = TileSettings { grid: [Some(64), Some(256)], ..TileSettings::default() };
    let [mut on_cpu, mut on_gpu] = [vrtm_testkit::cpu(1), limited(Some(40))].map(|device| {
        let mut asset = model.asset_on(&device, 64);
        asset.set_settings(0, &settings).unwrap();
        asset
    });
    let saved = on_cpu.save_tile(0).unwrap();
    let error = on_gpu.load_tile(0, &saved).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);
    assert!(error.message.starts_with("grid: 64 x 256 cells "), "{error}");
    assert_eq!(on_gpu.tile_estimate(0).unwrap_err().message, error.message);
    let named: Vec<u32> =
        error.message.split_once("at most ").unwrap().1.split(' ').flat_map(str::parse).collect();
    assert!(named.len() == 2 && 4 * named[0] <= named[1] + 48, "{error}");
    let settings = TileSettings { grid: [Some(named[0]), Some(named[1])], ..settings };
    on_gpu.set_settings(0, &settings).unwrap();
    on_gpu.tile_estimate(0).unwrap();
}

/// WebGPU's bindings of 128 MiB hold a little under 12000 blocks.
#[test]
fn the_smallest_bindings_hold_a_grid_of_1024_cells_and_not_one_of_2048() {
    if !vrtm_testkit::has_gpu() {
        return;
    }
    let mut asset = Model::from(vrtm_testkit::scenes::analytic::bulge()).asset_on(&limited(None), 1024);
    asset.tile_estimate(0).unwrap();
    vrtm_testkit::set_grid(&mut asset, 2048);
    let error = asset.tile_estimate(0).unwrap_err();
    assert!(error.message.contains(" holds 11915: at most "), "{error}");
}
