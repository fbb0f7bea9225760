//! The preview, `draft`: what it reports without working on level 0.

use vrtm::Quality;
use vrtm_testkit::Lab as _;
use vrtm_testkit::{Model, devices, options, scenes};

/// The energies that a draft reports are those of level 1. Their ratio is near the one on level 0, the warp lowers the
/// energy there, too, and it has no folds.
#[test]
fn its_energies_tell_what_it_gains_on_level_0() {
    for (device, grid) in devices().into_iter().zip([256, 128]) {
        for name in scenes::NAMES {
            let model = Model::from(scenes::by_name(name).unwrap());
            let frame = model.frames.len().min(5);
            let asset = model.solved(&device, grid, frame, &options(Quality::Draft));
            let report = asset.tile(0).report().unwrap();
            let u: Vec<_> = asset.displacements(0).unwrap().iter().map(|u| u.map(f64::from)).collect();
            let rest = vec![[0.0; 2]; u.len()];
            let [identity, result] =
                [&rest, &u].map(|u| asset.reference_energy(0, model.frame(frame), u).unwrap());
            let (reported, exact) = (report.energy / report.energy_before, result / identity);
            println!(
                "{:?} {name} {grid}: {reported:.4} reported, {exact:.4} on level 0",
                device.info().backend
            );
            assert!(exact < 1.0 && report.folds == 0, "{name}: {exact}");
            // On level 0 details show that level 1 does not have.
            assert!(reported > 0.5 * exact && reported < 1.5 * exact, "{name}: {reported} {exact}");
        }
    }
}
