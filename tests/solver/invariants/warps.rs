//! Checks every warp: no folds, energy not above the identity's, one-to-one and onto, and inverted by its redirection.

use vrtm::{Asset, Backend, Device, DeviceSettings, FetchKind, Quality};

use vrtm_testkit::{self, Model, Warp, fetch, long, on_all_cores, options};

/// A model that is solved and checked.
struct Case<'a> {
    model: &'a Model,
    grid: u32,
    frames: Vec<usize>,
    quality: Quality,
}

fn all_frames(model: &Model, grid: u32) -> Case<'_> {
    Case { model, grid, frames: (1..=model.frames.len()).collect(), quality: Quality::Normal }
}

fn check(cases: &[Case]) {
    let cpu = vrtm_testkit::cpu(1);
    let cases = long::share(cases.iter().collect(), 4, "models on a grid");
    on_all_cores(&cases, |case| check_case(case, &cpu)).iter().for_each(|line| println!("{line}"));
}

/// Solves run one after the other, because a GPU does not run them faster side by side.
fn check_on_gpu(cases: &[Case]) {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    cases.iter().for_each(|case| println!("{}", check_case(case, &device)));
}

fn check_case(case: &Case, device: &Device) -> String {
    let mut asset = case.model.asset_on(device, case.grid);
    let mut worst = Worst::default();
    for &frame in &case.frames {
        asset.solve(case.model.frame(frame), &options(case.quality)).unwrap();
        for tile in 0..asset.tile_count() {
            let name = format!("{} {frame}, tile {tile}, {}²", case.model.name, case.grid);
            check_tile(&mut asset, tile, &name, &mut worst);
        }
    }
    format!(
        "{:12} {:5}²: {} frames, least J {:.4}, round trip {:.1e} texel",
        case.model.name,
        case.grid,
        case.frames.len(),
        worst.jacobian,
        worst.round_trip
    )
}

struct Worst {
    jacobian: f64,
    round_trip: f64,
}

impl Default for Worst {
    fn default() -> Worst {
        Worst { jacobian: 1.0, round_trip: 0.0 }
    }
}

fn check_tile(asset: &mut Asset, tile: usize, name: &str, worst: &mut Worst) {
    let warp = Warp::of(asset, tile);
    let report = asset.tile(tile).report().unwrap();
    // No folds, and the reported least Jacobian is that of the same displacements, evaluated here.
    let least = warp.min_jacobian();
    assert!(least > 0.0 && report.folds == 0, "{name}: least J {least}, {} folds", report.folds);
    // On a GPU the report has a lower bound. It is smaller by the rounding of f32, which grows with the size of the
    // cells.
    let gpu = asset.device().info().backend == Backend::Gpu;
    let slack = if gpu { 1e-4 } else { 1e-9 };
    let (low, high) = (least.min(1.0) - slack, least.min(1.0) + 1e-9);
    assert!((low..=high).contains(&report.min_jacobian), "{name}: {least} {}", report.min_jacobian);
    worst.jacobian = worst.jacobian.min(least);
    // The energy is not above that of the identity, by the report: it cannot be computed from outside.
    assert!(report.energy <= report.energy_before, "{name}: {} {}", report.energy_before, report.energy);
    // The fetched image of the warp equals the displacements.
    let nodes = fetch(asset, tile, FetchKind::Warp, [warp.nx as u32 + 1, warp.ny as u32 + 1]);
    for (k, uv) in nodes.iter().enumerate() {
        let p = warp.node(k % (warp.nx + 1), k / (warp.nx + 1));
        let q = [f64::from(uv[0]) * warp.nx as f64, f64::from(uv[1]) * warp.ny as f64];
        // UVs are rounded to f32: half a unit in the last place of 1, in cells.
        let slack = f64::from(f32::EPSILON) / 4.0 * 1.001 * warp.nx as f64;
        assert!((p[0] - q[0]).abs() <= slack && (p[1] - q[1]).abs() <= slack, "{name}: {p:?} {q:?}");
    }
    // W covers each texel centre once, and the redirection inverts it: at the grid's size, at half of it, at a size
    // that divides neither, and of few texels.
    let (nx, ny) = (warp.nx as u32, warp.ny as u32);
    for size in [[nx, ny], [nx / 2, ny / 2], [nx * 3 / 4 + 5, ny * 5 / 4 + 3], [5, 1], [1, 1]] {
        let redirection = fetch(asset, tile, FetchKind::Redirection, size);
        let size = size.map(|n| n as usize);
        let count = warp.count(size);
        let twice = count.iter().position(|&n| n != 1);
        assert_eq!(twice, None, "{name}: texel of {size:?} not covered once");
        for (k, uv) in redirection.iter().enumerate() {
            let texel = [k % size[0], k / size[0]];
            let p = [f64::from(uv[0]) * warp.nx as f64, f64::from(uv[1]) * warp.ny as f64];
            assert!(p.iter().all(|x| x.is_finite()), "{name}: texel {texel:?} of {size:?} is not written");
            let back = warp.at(p);
            let cells = [warp.nx, warp.ny];
            let off = [0, 1].map(|c| back[c] * size[c] as f64 / cells[c] as f64 - (texel[c] as f64 + 0.5));
            let off = off[0].hypot(off[1]);
            assert!(off <= 1e-3, "{name}: texel {texel:?} of {size:?} comes back {off} texels off");
            worst.round_trip = worst.round_trip.max(off);
        }
    }
}

#[test]
fn analytic_scenes() {
    let models = vrtm_testkit::analytic();
    let sizes = [256, 512];
    let mut cases: Vec<Case> =
        models.iter().flat_map(|model| sizes.map(|grid| all_frames(model, grid))).collect();
    let quality = Quality::Draft;
    cases.extend(models.iter().map(|model| Case { quality, ..all_frames(model, 256) }));
    check(&cases);
}

#[test]
fn crushed_sheets() {
    let models =
        [0.4, 0.1, 0.01].map(|fraction| Model::from(vrtm_testkit::scenes::analytic::squash(fraction)));
    check(&models.iter().map(|model| all_frames(model, 256)).collect::<Vec<_>>());
}

#[test]
fn built_in_scenes() {
    use vrtm_testkit::scenes::{arm, creature, mug_to_jug};
    let models = [mug_to_jug(), creature(), arm()].map(Model::from);
    let sizes = long::share(vec![256, 512], 2, "sizes of grids");
    let cases: Vec<Case> =
        models.iter().flat_map(|model| sizes.iter().map(|&grid| all_frames(model, grid))).collect();
    check(&cases);
}

#[test]
fn assets_at_256_all_frames() {
    let models = vrtm_testkit::assets();
    check(&models.iter().map(|model| all_frames(model, 256)).collect::<Vec<_>>());
}

#[test]
fn assets_at_512_two_frames() {
    let models = vrtm_testkit::assets();
    check(
        &models.iter().map(|model| Case { frames: vec![1, 4], ..all_frames(model, 512) }).collect::<Vec<_>>(),
    );
}

#[test]
fn assets_at_1024() {
    let models = vrtm_testkit::assets();
    let chosen = [("mh_face", 1), ("mh_face", 6), ("spot", 2)];
    let cases: Vec<Case> = chosen
        .iter()
        .filter_map(|&(name, frame)| {
            let model = models.iter().find(|model| model.name == name)?;
            Some(Case { frames: vec![frame], ..all_frames(model, 1024) })
        })
        .collect();
    assert!(models.is_empty() || cases.len() == 3);
    check(&cases);
}

#[test]
fn on_a_gpu() {
    use vrtm_testkit::scenes::{arm, creature, mug_to_jug};
    let mut models = vrtm_testkit::analytic();
    models.extend([mug_to_jug(), creature(), arm()].map(Model::from));
    models.extend(vrtm_testkit::assets());
    let first = |model| Case { model, grid: 128, frames: vec![1], quality: Quality::Normal };
    let mut cases: Vec<Case> = models.iter().map(first).collect();
    // A draft runs other stages, and later frames start from memory that earlier ones have used.
    let mug = models.iter().find(|model| model.name == "mug_to_jug").unwrap();
    cases.push(Case { model: mug, grid: 128, frames: vec![5, 2], quality: Quality::Draft });
    check_on_gpu(&cases);
}
