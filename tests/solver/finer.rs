//! Where features are crowded, a finer grid is not worse than a coarser one, and more effort not worse than less: steps
//! that are many cells long are limited without being refused (method §7.6).

use vrtm::{Quality, SolveOptions, Strided};
use vrtm_testkit::scenes::analytic::{squash, torus};
use vrtm_testkit::{Model, cpu, long, set_grid};

/// Tolerated ratio of strain.
const TOLERANCE: f32 = 1.05;

/// A sheet with small discs, squashed to half of its width.
fn small_discs() -> Model {
    let mut model = Model::from(torus());
    model.frames = vec![model.rest.iter().map(|&[x, y, z]| [0.25 + 0.5 * x, y, z]).collect()];
    model
}

#[test]
fn a_finer_grid_is_not_worse() {
    let device = cpu(0);
    for (name, model) in
        [("squash to 40 %", Model::from(squash(0.4))), ("small discs, squashed to 50 %", small_discs())]
    {
        let mut asset = model.asset_on(&device, 256);
        let mut strain = |grid: u32, quality: Quality| {
            set_grid(&mut asset, grid);
            let options = SolveOptions { quality, measure: true, ..SolveOptions::default() };
            asset.solve(Strided::from_slice(&model.frames[0]), &options).unwrap();
            let rms = asset.tile(0).report().unwrap().strain.unwrap().after.rms;
            println!("{name}, {grid} cells a side, {quality:?}: {rms:.4}");
            rms
        };
        let mut coarser = f32::INFINITY;
        let grids: &[u32] = if long::only("1024 cells a side") { &[256, 512, 1024] } else { &[256, 512] };
        for &grid in grids {
            let [draft, normal] = [Quality::Draft, Quality::Normal].map(|quality| strain(grid, quality));
            assert!(normal < draft, "{name}, {grid}: {normal} with `normal`, {draft} as a draft");
            assert!(normal < TOLERANCE * coarser, "{name}, {grid}: {normal}, {coarser} on a coarser grid");
            coarser = normal;
        }
    }
}
