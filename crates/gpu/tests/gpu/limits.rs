//! Solves under the smallest limits that WebGPU allows, and grids that are too large for a GPU's buffers.

use vrtm::{Backend, Device, DeviceSettings, ErrorKind, Quality, TileSettings};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{self, Model, long, options};

/// A device with WebGPU's default limits, whose buffers hold at most so many blocks, if there is a GPU.
fn limited(most_blocks: Option<usize>) -> Option<Device> {
    let settings = DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() };
    let variables = [("VRTM_GPU_LIMITS", "webgpu")];
    vrtm_testkit::has_gpu().then(|| Device::with_variables(&settings, &variables, most_blocks).unwrap())
}

/// Limits of the adapter above WebGPU's defaults are not needed. With more workgroup memory other kernels relax and
/// assemble, whose sums compilers may round otherwise.
#[test]
fn webgpu_s_limits_give_the_same_result() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let Some(limited) = limited(None) else { return };
    for scene in long::share(vec![vrtm_testkit::scenes::creature(), vrtm_testkit::scenes::arm()], 2, "scenes")
    {
        let model = Model::from(scene);
        let [a, b] =
            [&device, &limited].map(|device| model.solved(device, 128, 1, &options(Quality::Normal)));
        for tile in 0..a.tile_count() {
            let [u, v] = [&a, &b].map(|asset| asset.displacements(tile).unwrap());
            let squares = u.iter().flatten().zip(v.iter().flatten()).map(|(u, v)| f64::from(u - v).powi(2));
            let rms = (squares.sum::<f64>() / u.len() as f64).sqrt();
            let [a, b] = [&a, &b].map(|asset| asset.tile(tile).report().unwrap());
            println!("{}: {rms:.1e} cells apart, E {} and {}", model.name, a.energy, b.energy);
            assert!(rms < 2e-3 && (a.energy - b.energy).abs() < 1e-4 * a.energy, "{}", model.name);
            assert!(b.folds == 0 && b.charts_fallback == a.charts_fallback, "{}", model.name);
        }
    }
}

/// The size that the error of a grid names.
fn named(message: &str) -> [u32; 2] {
    let size = message.split_once("at most ").unwrap().1.split_once(" cells fit").unwrap().0;
    let (width, height) = size.split_once(" x ").unwrap();
    [width, height].map(|n| n.parse().unwrap())
}

/// The error of a grid that is too large comes from the estimate, from preparing the tile and from a solve. It names a
/// size that works, and the next larger one does not.
#[test]
fn a_grid_that_is_too_large_names_one_that_fits() {
    let Some(device) = limited(Some(40)) else { return };
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let mut asset = model.asset_on(&device, 192);
    let error = asset.tile_mut(0).estimate().unwrap_err();
    let message = &error.message;
    let what = format!(
        " blocks of 16 x 16 nodes, but a buffer of the GPU {} holds 40: at most ",
        device.info().name
    );
    assert!(
        message.starts_with("grid: 192 x 192 cells of tile 1001 take ") && message.contains(&what),
        "{error}"
    );
    assert!(message.ends_with(" cells fit; on the CPU all do"), "{error}");
    let solved = asset.solve(model.frame(1), &options(Quality::Draft)).unwrap_err();
    for other in [asset.tile_mut(0).info().unwrap_err(), solved] {
        assert_eq!((other.kind, &other.message), (ErrorKind::Unsupported, message));
    }
    let [side, height] = named(message);
    assert_eq!(side, height);
    vrtm_testkit::set_grid(&mut asset, side + 16);
    assert_eq!(asset.tile_mut(0).estimate().unwrap_err().kind, ErrorKind::Unsupported);
    // The failed calls leave the asset usable.
    vrtm_testkit::set_grid(&mut asset, side);
    asset.tile_mut(0).estimate().unwrap();
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    assert!(asset.tile(0).report().unwrap().min_jacobian > 0.0);
}

/// A smaller grid has the shape of the larger one, and a tile that was prepared on the CPU is refused, too.
#[test]
fn a_long_grid_keeps_its_shape_and_a_loaded_one_is_refused() {
    let Some(gpu) = limited(Some(40)) else { return };
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let settings = |grid: [u32; 2]| TileSettings { grid: grid.map(Some), ..TileSettings::default() };
    let [mut on_cpu, mut on_gpu] = [vrtm_testkit::cpu(1), gpu].map(|device| {
        let mut asset = model.asset_on(&device, 64);
        asset.tile_mut(0).set_settings(&settings([64, 256])).unwrap();
        asset
    });
    let error = on_gpu.tile_mut(0).load(&on_cpu.tile_mut(0).save().unwrap()).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);
    assert!(error.message.starts_with("grid: 64 x 256 cells "), "{error}");
    assert_eq!(on_gpu.tile_mut(0).estimate().unwrap_err().message, error.message);
    let [width, height] = named(&error.message);
    assert!(width == height.div_ceil(4).next_multiple_of(16), "{error}");
    on_gpu.tile_mut(0).set_settings(&settings([width, height])).unwrap();
    on_gpu.tile_mut(0).estimate().unwrap();
}

/// WebGPU's bindings of 128 MiB hold a little under 12000 blocks.
#[test]
fn the_smallest_bindings_hold_a_grid_of_1024_cells_and_not_one_of_2048() {
    let Some(device) = limited(None) else { return };
    let mut asset = Model::from(vrtm_testkit::scenes::analytic::bulge()).asset_on(&device, 1024);
    asset.tile_mut(0).estimate().unwrap();
    vrtm_testkit::set_grid(&mut asset, 2048);
    let error = asset.tile_mut(0).estimate().unwrap_err();
    assert!(error.message.contains(" holds 11915: at most "), "{error}");
}
