//! A pose that is rest, or rest moved rigidly, gives the identity.

use vrtm::{Device, LogCode, SolveOptions, Strided};

use vrtm_testkit::log::listened;
use vrtm_testkit::{self, Model, Warp, bits, doubles};

fn models() -> Vec<Model> {
    use vrtm_testkit::scenes::{arm, creature, mug_to_jug};
    let mut models: Vec<Model> = [mug_to_jug(), creature(), arm()].map(Model::from).into();
    models.extend(vrtm_testkit::analytic());
    models.extend(vrtm_testkit::assets());
    vrtm_testkit::long::share(models, 4, "models")
}

/// A rotation about an oblique axis; no entry of its matrix is exact.
fn turn(p: [f64; 3]) -> [f64; 3] {
    let (s, c) = 0.83f64.sin_cos();
    let p = [c * p[0] - s * p[1], s * p[0] + c * p[1], p[2]];
    let (s, c) = 2.1f64.sin_cos();
    [p[0], c * p[1] - s * p[2], s * p[1] + c * p[2]]
}

vrtm_testkit::on_both! {
    rigid_motions_are_the_identity_even_far_away(256),
    rigid_motions_are_the_identity_even_far_away_on_a_gpu(64): rigid_motions_are_the_identity
}

fn rigid_motions_are_the_identity(device: &Device, grid: u32) {
    for model in models() {
        let rest = doubles(&model.rest);
        let mut asset = model.asset_on(device, grid);
        for distance in [0.0, 1.0, 1e6] {
            let moved: Vec<_> = rest.iter().map(|&p| turn(p).map(|x| x + distance)).collect();
            asset.solve(Strided::from_slice(&moved), &SolveOptions::default()).unwrap();
            for tile in 0..asset.tile_count() {
                let largest = Warp::of(&asset, tile).longest();
                assert!(largest <= 1e-3, "{} {distance} away: {largest} cells", model.name);
            }
        }
    }
}

vrtm_testkit::on_both! {
    rest_far_away_is_as_good_as_near(&models(), 256),
    rest_far_away_is_as_good_as_near_on_a_gpu(&models().into_iter().take(3).collect::<Vec<_>>(), 64):
        far_is_as_good_as_near
}

fn far_is_as_good_as_near(device: &Device, models: &[Model], grid: u32) {
    // The whole asset is 1e6 units from the origin: f64 keeps nine digits of a unit there, and the solver starts from
    // these.
    for model in models {
        let far = |points: &[[f32; 3]]| -> Vec<[f64; 3]> {
            doubles(points).into_iter().map(|p| [p[0] + 1e6, p[1] - 1e6, p[2]]).collect()
        };
        let (rest, pose) = (far(&model.rest), far(&model.frames[0]));
        let mut asset = model.bare_on(device, Strided::from_slice(&rest));
        model.maps.iter().for_each(|maps| vrtm_testkit::paint(&mut asset, maps));
        vrtm_testkit::set_grid(&mut asset, grid);
        asset.solve(Strided::from_slice(&rest), &SolveOptions::default()).unwrap();
        assert!(bits(&asset).iter().all(|u| *u == [0; 2]), "{}", model.name);
        asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
        let near = model.solved(device, grid, 1, &SolveOptions::default());
        for tile in 0..asset.tile_count() {
            let [a, b] = [&asset, &near].map(|asset| asset.tile(tile).report().unwrap());
            // Rounding may send a crowded chart to another minimum, whose energy is as low, to a per mille or so.
            let slack = 0.005 * a.energy_before.max(b.energy_before);
            assert!((a.energy - b.energy).abs() <= slack, "{}: {} {}", model.name, a.energy, b.energy);
        }
    }
}

#[test]
fn a_rest_mesh_of_one_point_is_the_identity_and_is_warned_of() {
    let (device, log) = listened();
    let model = Model::from(vrtm_testkit::scenes::mug_to_jug());
    model.bare_on(&device, model.frame(1));
    assert!(log.warnings().is_empty());
    let point = vec![[1.5f32, -2.0, 3.0]; model.rest.len()];
    let mut asset = model.bare_on(&device, Strided::from_slice(&point));
    assert_eq!(log.warnings(), [(LogCode::RestIsPoint, vec![])]);
    asset.set_vertex_rigidity(Some(Strided::from_slice(&vec![1.0; model.rest.len()]))).unwrap();
    vrtm_testkit::set_grid(&mut asset, 64);
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    assert!(bits(&asset).iter().all(|u| *u == [0; 2]));
}
