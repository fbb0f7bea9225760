//! Masked nodes stay fixed, maps may change between frames, and rigidity per vertex gives the same as a map.

use vrtm::{Device, ImageView, Quality, SolveOptions, Strided, TileSettings};

use vrtm_testkit::{self, Model, Warp, bits, options, view};

const N: u32 = 256;

/// A mask that fixes the texels for which `f` is true.
fn mask(f: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    (0..N * N).map(|k| if f(k % N, k / N) { 0 } else { 255 }).collect()
}

/// Masks; none of them tests the order of the rows.
fn masks() -> Vec<(&'static str, Vec<u8>)> {
    let hole = |x: u32, y: u32, cx: f64, cy: f64, r: f64| (f64::from(x) - cx).hypot(f64::from(y) - cy) < r;
    vec![
        ("holes", mask(|x, y| hole(x, y, 90.0, 120.0, 25.0) || hole(x, y, 180.0, 60.0, 3.0))),
        ("a line of one texel", mask(|x, _| x == 131)),
        ("a curve", mask(|x, y| (f64::from(x) - 128.0 - 30.0 * (f64::from(y) / 25.0).sin()).abs() < 0.8)),
        ("checkerboard of 16", mask(|x, y| (x / 16 + y / 16) % 2 == 0)),
        ("checkerboard of 1", mask(|x, y| (x + y) % 2 == 0)),
        ("everything", mask(|_, _| true)),
    ]
}

vrtm_testkit::on_both! {
    masks_hold_their_nodes(Quality::Normal),
    masks_hold_their_nodes_on_a_gpu(Quality::Draft): masks_hold
}

fn masks_hold(device: &Device, quality: Quality) {
    let model = Model::from(vrtm_testkit::scenes::analytic::shear(0.5));
    for (name, mask) in masks() {
        let mut asset = model.asset_on(device, N);
        asset.tile_mut(0).set_mask(Some(view(&mask, N, N))).unwrap();
        asset.solve(model.frame(1), &options(quality)).unwrap();
        let warp = Warp::of(&asset, 0);
        let width = N as usize + 1;
        let mut moved = 0;
        for (k, u) in warp.u.iter().enumerate() {
            let (i, j) = (k % width, k / width);
            // A node lies at the corner of four texels; the first row is at v = 1.
            let texels = [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)];
            let held = texels.iter().any(|&(x, y)| {
                let inside = (1..width).contains(&x) && (1..width).contains(&y);
                !inside || mask[(N as usize - y) * N as usize + x - 1] == 0
            });
            assert!(!held || *u == [0.0; 2], "{name}: node ({i}, {j})");
            moved += usize::from(*u != [0.0; 2]);
        }
        assert!(warp.min_jacobian() > 0.0, "{name}");
        let is_identity = matches!(name, "checkerboard of 1" | "everything");
        assert_eq!(moved == 0, is_identity, "{name}: {moved} nodes moved");
        let report = asset.tile(0).report().unwrap();
        assert!(is_identity || report.energy < report.energy_before, "{name}");
    }
}

vrtm_testkit::on_both! {
    maps_and_settings_change_between_frames(&options(Quality::Normal)),
    maps_and_settings_change_between_frames_on_a_gpu(&options(Quality::Draft)): maps_and_settings_change
}

fn maps_and_settings_change(device: &Device, options: &SolveOptions) {
    let model = Model::from(vrtm_testkit::scenes::mug_to_jug());
    let (w, h) = (model.maps[0].width, model.maps[0].height);
    let other: Vec<u8> = model.maps[0].rigidity.iter().map(|r| 255 - r).collect();
    let (line, holes) = (masks()[1].1.clone(), masks()[0].1.clone());
    let mut asset = model.asset_on(device, N);
    let mut seen = vec![];
    type Change<'a> = Box<dyn Fn(&mut vrtm::Asset) + 'a>;
    let settings =
        |asset: &mut vrtm::Asset, settings: TileSettings| asset.tile_mut(0).set_settings(&settings).unwrap();
    let grid = TileSettings { grid: [Some(N); 2], ..TileSettings::default() };
    // Each change sets all inputs that it depends on, so that it can be applied to a fresh asset, too.
    let changes: Vec<(&str, Change)> = vec![
        ("as it was", Box::new(|_| {})),
        ("mask", Box::new(|a| a.tile_mut(0).set_mask(Some(view(&line, N, N))).unwrap())),
        ("another mask", Box::new(|a| a.tile_mut(0).set_mask(Some(view(&holes, N, N))).unwrap())),
        ("no mask", Box::new(|a| a.tile_mut(0).set_mask(None).unwrap())),
        ("rigidity", Box::new(|a| a.tile_mut(0).set_rigidity(Some(view(&other, w, h))).unwrap())),
        (
            "finer",
            Box::new(|a| {
                a.tile_mut(0).set_rigidity(Some(view(&other, w, h))).unwrap();
                settings(a, TileSettings { grid: [Some(320), Some(272)], ..grid });
            }),
        ),
        (
            "smoother",
            Box::new(|a| {
                a.tile_mut(0).set_rigidity(Some(view(&other, w, h))).unwrap();
                settings(a, TileSettings { smoothness: 0.2, room: 0.1, ..grid });
            }),
        ),
        ("nothing rigid", Box::new(|a| a.tile_mut(0).set_rigidity(None).unwrap())),
        (
            "as at first",
            Box::new(|a| {
                settings(a, grid);
                a.tile_mut(0).set_rigidity(Some(view(&model.maps[0].rigidity, w, h))).unwrap();
            }),
        ),
    ];
    for (name, change) in &changes {
        let mut fresh = model.asset_on(device, N);
        change(&mut fresh);
        fresh.solve(model.frame(1), options).unwrap();
        change(&mut asset);
        asset.solve(model.frame(1), options).unwrap();
        // The case before "nothing rigid" has another grid.
        let [now, expected] = [&asset, &fresh].map(bits);
        let is_identity = *name == "nothing rigid";
        assert!(now == expected || (is_identity && now.iter().all(|u| *u == [0; 2])), "{name}");
        assert_eq!(is_identity, expected.iter().all(|u| *u == [0; 2]), "{name}");
        seen.push(expected);
    }
    assert!(seen[0] == seen[3] && seen[0] == seen[8], "the way back leads back");
    let distinct: std::collections::HashSet<_> = seen.iter().collect();
    assert_eq!(distinct.len(), seen.len() - 2, "each change shows");
}

#[test]
fn vertex_rigidity_is_the_same_map_painted() {
    // x on the sheet equals u. A ramp is linear over triangles and between texels, so that both give the nodes the same
    // values.
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let values: Vec<f32> = model.rest.iter().map(|p| p[0]).collect();
    let ramp: Vec<f32> = (0..512 * 512).map(|k| ((k % 512) as f32 + 0.5) / 512.0).collect();
    let mut asset = model.asset(0, N);
    asset.tile_mut(0).set_rigidity(Some(ImageView::from_texels("map", &ramp, [512; 2]).unwrap())).unwrap();
    let options = SolveOptions { max_corrections: Some(7), ..SolveOptions::default() };
    asset.solve(model.frame(1), &options).unwrap();
    let painted = Warp::of(&asset, 0);
    asset.set_vertex_rigidity(Some(Strided::from_slice(&values))).unwrap();
    asset.solve(model.frame(1), &options).unwrap();
    let vertices = Warp::of(&asset, 0);
    assert!(painted.longest() > 1.0);
    // Rigidity at the nodes differs by rounding, 1e-7. On coarse levels the map continues beyond the sheet's border,
    // where rigidity per vertex is 0, so that the solver takes another way to the minimum. It ends 4e-5 of the
    // energy above it, which is about 4e-3 of the displacement.
    let difference = painted.u.iter().zip(&vertices.u).flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
    let largest = difference.fold(0.0f32, |m, x| m.max(x.abs()));
    println!("vertices against map: {largest:e} cells of {}", painted.longest());
    assert!(largest < 8e-3 * painted.longest(), "{largest}");
}

#[test]
fn a_mask_per_vertex_is_the_same_mask_painted() {
    // x on the sheet equals u: its right half may move, from the first node on that is half a cell away from the left.
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    let right = mask(|x, _| x < N / 2);
    let mut painted = model.asset(0, N);
    painted.tile_mut(0).set_mask(Some(view(&right, N, N))).unwrap();
    painted.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    let values: Vec<f32> = model.rest.iter().map(|p| p[0]).collect();
    let mut asset = model.asset(0, N);
    asset.set_vertex_mask(Some(Strided::from_slice(&values))).unwrap();
    let [all, some] =
        [&mut model.asset(0, N), &mut asset].map(|a| a.tile_mut(0).estimate().unwrap().movable_nodes);
    assert!(0 < some && some < all, "{some} of {all}");
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    assert!(bits(&asset) == bits(&painted));
    assert!(Warp::of(&asset, 0).longest() > 1.0);
    // What was prepared with this mask belongs to no other one.
    let saved = asset.tile_mut(0).save().unwrap();
    assert!(asset.tile_mut(0).load(&saved).is_ok());
    asset.set_vertex_mask(Some(Strided::from_slice(&vec![0.75; values.len()]))).unwrap();
    assert!(asset.tile_mut(0).load(&saved).is_err());
    // A mask that holds nothing, and no mask, are the same.
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    let held_nothing = bits(&asset);
    asset.set_vertex_mask(None).unwrap();
    asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
    assert!(held_nothing == bits(&asset));
}

#[test]
fn one_line_of_vertices_in_a_mask_is_a_barrier_on_a_coarse_grid() {
    let model = Model::from(vrtm_testkit::scenes::analytic::bulge());
    // The column of vertices that is next to u = 0.4.
    let line =
        model.rest.iter().map(|p| p[0]).min_by(|a, b| (a - 0.4).abs().total_cmp(&(b - 0.4).abs())).unwrap();
    let values: Vec<f32> = model.rest.iter().map(|p| f32::from(p[0] != line)).collect();
    for grid in [32, 128, 256] {
        let mut asset = model.asset(0, grid);
        asset.set_vertex_mask(Some(Strided::from_slice(&values))).unwrap();
        asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
        let warp = Warp::of(&asset, 0);
        let width = grid as usize + 1;
        let near = |i: usize| (i as f32 - line * grid as f32).abs() <= 0.5;
        assert!((0..width).any(near), "{grid}");
        for (k, u) in warp.u.iter().enumerate() {
            assert!(!near(k % width) || *u == [0.0; 2], "{grid}: node {k}");
        }
        assert!(warp.longest() > 0.05, "{grid}: {}", warp.longest());
    }
}
