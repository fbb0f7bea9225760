//! The size of a grid where none is set: that of the rigid features, whatever the size of the image.

use vrtm::{Asset, Backend, Device, DeviceSettings, LogCode, Quality, Strided, TileSettings};
use vrtm_testkit::features::at_texels;
use vrtm_testkit::log::{Line, listened};
use vrtm_testkit::sixteen::{sixteen_asset, sixteen_charts};
use vrtm_testkit::{Model, analytic, cpu, options, view};

/// Discs of a diameter in UV, eight by eight, in an image with so many texels on a side.
fn discs(side: usize, diameter: f64) -> Vec<u8> {
    let place = |k: usize| (k as f64 + 0.5) / side as f64;
    let away = |x: f64| (8.0 * x).fract() / 8.0 - 0.0625;
    let is_rigid = |n: usize| away(place(n % side)).hypot(away(place(n / side))) < 0.5 * diameter;
    (0..side * side).map(|n| 255 * u8::from(is_rigid(n))).collect()
}

/// A tile that one chart covers.
fn sheet(device: &Device) -> Asset {
    let model = analytic().into_iter().find(|model| model.name == "squash").expect("the scene");
    model.bare_on(device, Strided::from_slice(&model.rest))
}

fn cells_of(asset: &mut Asset, side: usize, diameter: f64) -> u32 {
    let image = discs(side, diameter);
    asset.tile_mut(0).set_rigidity(Some(view(&image, side as u32, side as u32))).unwrap();
    let [width, height] = asset.tile_mut(0).grid().unwrap();
    assert_eq!(width, height);
    width
}

#[test]
fn the_grid_follows_the_features_and_not_the_image() {
    let mut asset = sheet(&cpu(2));
    for (diameter, cells) in [(0.09, 256), (0.06, 384), (0.045, 512), (0.022, 1024)] {
        for side in [1024, 1536, 2048] {
            assert_eq!(cells_of(&mut asset, side, diameter), cells, "{diameter}, {side} texels");
        }
    }
    assert_eq!(cells_of(&mut asset, 4096, 0.006), 4096);
    // No finer than the image, or than 256.
    assert_eq!(cells_of(&mut asset, 700, 0.022), 768);
    assert_eq!(cells_of(&mut asset, 128, 0.022), 256);
    assert_eq!(asset.tile_mut(0).info().unwrap().grid, [256; 2]);
}

#[test]
fn a_few_narrow_features_do_not_decide() {
    let side = 1024;
    let mut image = discs(side, 0.09);
    let mut asset = sheet(&cpu(1));
    let cells = |asset: &mut Asset, image: &[u8]| {
        asset.tile_mut(0).set_rigidity(Some(view(image, side as u32, side as u32))).unwrap();
        asset.tile_mut(0).grid().unwrap()[0]
    };
    // A line of one texel is under a twentieth of the rigid texels, thirty are not.
    image[64 * side..][..side].fill(255);
    assert_eq!(cells(&mut asset, &image), 256);
    for k in 0..60 {
        image[(side / 60 * k) * side..][..side / 2].fill(255);
    }
    assert!(cells(&mut asset, &image) < 1024, "lines that join discs are parts of them");
    image.fill(0);
    for k in 0..60 {
        image[(side / 60 * k) * side..][..side].fill(255);
    }
    assert_eq!(cells(&mut asset, &image), 1024);
}

/// Rigid all over, a chart is a feature: one texel says as much as many, and as vertices do.
#[test]
fn charts_are_features_where_all_is_rigid() {
    let mut asset = sixteen_asset(&cpu(1), 0.81).unwrap();
    for side in [1, 64, 2048] {
        let map = vec![200; side * side];
        asset.tile_mut(0).set_rigidity(Some(view(&map, side as u32, side as u32))).unwrap();
        assert_eq!(asset.tile_mut(0).grid().unwrap(), [96; 2], "{side} texels");
    }
    asset.tile_mut(0).set_rigidity(None).unwrap();
    assert_eq!(asset.tile_mut(0).grid().unwrap(), [16; 2], "nothing can move");
    let values = vec![0.3; sixteen_charts(0.81).0.len()];
    asset.set_vertex_rigidity(Some(Strided::from_slice(&values))).unwrap();
    assert_eq!(asset.tile_mut(0).grid().unwrap(), [96; 2]);
}

#[test]
fn a_size_that_is_set_is_obeyed_and_compared() {
    let (device, log) = listened();
    let mut asset = sheet(&device);
    assert_eq!(cells_of(&mut asset, 1024, 0.045), 512);
    let mut said = |grid: [Option<u32>; 2]| {
        asset.tile_mut(0).set_settings(&TileSettings { grid, ..TileSettings::default() }).unwrap();
        log.take();
        let info = asset.tile_mut(0).info().unwrap();
        assert_eq!(info.grid, grid.map(|cells| cells.unwrap_or(512)));
        let of_size = |line: &Line| matches!(line.code, LogCode::GridTooCoarse | LogCode::GridTooFine);
        let lines = log.take().into_iter().filter(of_size);
        lines.map(|line| (line.code, line.values)).collect::<Vec<_>>()
    };
    for grid in [[None, None], [Some(256), None], [Some(144), Some(2032)]] {
        assert_eq!(said(grid), [], "{grid:?}");
    }
    assert_eq!(said([Some(128), None]), [(LogCode::GridTooCoarse, vec![128.0, 512.0, 512.0])]);
    assert_eq!(said([Some(512), Some(2048)]), [(LogCode::GridTooFine, vec![512.0, 2048.0, 512.0])]);
}

/// The grid of a tile fits into its share of the device's memory.
#[test]
fn a_memory_budget_bounds_the_grid() {
    let budget = 30 << 20;
    let settings =
        DeviceSettings { backend: Backend::Cpu, memory_budget: Some(budget), ..DeviceSettings::default() };
    let mut asset = sheet(&Device::new(&settings).unwrap());
    assert_eq!(cells_of(&mut asset, 1024, 0.022), 384);
    assert!(asset.tile_mut(0).estimate().unwrap().solving_bytes < budget);
    let model = analytic().into_iter().find(|model| model.name == "squash").unwrap();
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
}

/// Fewer cells cost at most a thirtieth of the strain, at the texels of the image.
#[test]
fn features_keep_their_shape_on_the_grid_that_is_chosen() {
    let scene = analytic().into_iter().find(|model| model.name == "squash").unwrap();
    let mut model: Model = scene;
    let side = 768;
    (model.maps[0].width, model.maps[0].height) = (side, side);
    model.maps[0].rigidity = discs(side as usize, 0.07);
    let strain = |grid: u32| {
        let asset = model.solved(&cpu(0), grid, 1, &options(Quality::Normal));
        let features = at_texels(&model, &model.frames[0], &asset);
        let mean = features.iter().map(|feature| feature.after).sum::<f64>() / features.len() as f64;
        (asset.tile(0).report().unwrap().grid[0], mean)
    };
    let ((chosen, of_chosen), (_, of_image)) = (strain(0), strain(side));
    assert_eq!(chosen, 384);
    assert!(of_chosen < 1.03 * of_image, "{of_chosen}, {of_image}");
}
