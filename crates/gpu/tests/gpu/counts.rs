//! Work that a solve gives to a GPU, in counts that are the same on any driver: dispatches, empty dispatches,
//! submissions, bytes moved and bytes held. They stand here so that they cannot rise unseen; `benches/gpu.sh
//! --software` has them kernel by kernel.

use vrtm::{DeviceSettings, Quality};
use vrtm_testkit::{self, Model, assets, options, scenes};

/// The most that a solve may count.
struct Most {
    scene: &'static str,
    grid: u32,
    quality: Quality,
    /// Dispatches that do something, and those that turn out empty.
    dispatches: u64,
    empty: u64,
    /// Bytes per active node: moved at least, and held.
    moved: u64,
    held: u64,
}

const fn most(
    scene: &'static str,
    grid: u32,
    quality: Quality,
    [dispatches, empty, moved, held]: [u64; 4],
) -> Most {
    Most { scene, grid, quality, dispatches, empty, moved, held }
}

/// Counts, with room for a few more: another driver's rounding may make a chart take another trial. Empty ones are
/// mostly rounds of the step limit, of three dispatches each, which only crowded charts need.
const TABLE: [Most; 5] = [
    most("bulge", 256, Quality::Draft, [118, 125, 380, 262]),
    most("bulge", 512, Quality::Draft, [152, 142, 315, 231]),
    most("bulge", 512, Quality::Normal, [212, 213, 1320, 231]),
    most("mug_to_jug", 512, Quality::Normal, [230, 266, 2300, 273]),
    most("mh_face", 512, Quality::Normal, [326, 340, 5600, 351]),
];

#[test]
fn counts_do_not_rise() {
    let Some(device) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let real = assets();
    let mut risen = Vec::new();
    for most in &TABLE {
        let scene = scenes::by_name(most.scene).map(Model::from);
        let Some(model) = scene.or_else(|| real.iter().find(|model| model.name == most.scene).cloned())
        else {
            continue;
        };
        let asset = model.solved(&device, most.grid, 1, &options(most.quality));
        let (report, work) = (asset.tile(0).report().unwrap(), asset.tile(0).gpu_work().unwrap().unwrap());
        let per_node = |bytes: u64| bytes.div_ceil(report.nodes_active);
        let (moved, held) = (per_node(work.bytes()), per_node(report.bytes));
        let line = format!(
            "{} {}² {:?}: {} dispatches, {} empty ones, {} submissions, {moved} bytes moved and {held} held per active node",
            most.scene,
            most.grid,
            most.quality,
            work.dispatches(),
            work.skipped,
            work.submissions,
        );
        println!("{line}");
        let counts = [work.dispatches(), work.skipped, work.submissions, moved, held];
        let bounds = [most.dispatches, most.empty, 4, most.moved, most.held];
        if counts.iter().zip(bounds).any(|(count, bound)| *count > bound) {
            risen.push(format!("{line}: at most {bounds:?}"));
        }
        assert!(counts.iter().all(|&count| count > 0), "{line}");
    }
    assert!(risen.is_empty(), "\n{}", risen.join("\n"));
}
