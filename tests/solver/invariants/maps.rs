//! Rigidity and masks per vertex give the same as maps.

use vrtm::{ImageView, Quality, SolveOptions, Strided};

use vrtm_testkit::{self, Model, Warp, bits, options, view};

const N: u32 = 256;

/// A mask that fixes the texels for which `f` is true.
fn mask(f: impl Fn(u32, u32) -> bool) -> Vec<u8> {
    (0..N * N).map(|k| if f(k % N, k / N) { 0 } else { 255 }).collect()
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
