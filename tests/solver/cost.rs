//! Work and memory follow what is active: the charts that move, and the blocks and nodes of them that can.

use vrtm::{Asset, Backend, Device, DeviceSettings, Quality, SolveOptions, Strided};
use vrtm_testkit::{self, Model, bits, cpu, long, scenes, view};

/// The CPU, and a GPU if there is one, each with the grid size (cells a side) that is solved on it: a software driver
/// takes seconds for 256.
fn devices() -> Vec<(Device, u32)> {
    let side = long::cases(256, 128, "cells a side on a GPU") as u32;
    let gpu = vrtm_testkit::gpu(&DeviceSettings::default()).map(|device| (device, side));
    [(cpu(0), 256)].into_iter().chain(gpu).collect()
}

/// The work of a tile's last solve, in counts that do not depend on the machine's load. A solve with no work (the
/// default, all 0) only compares positions: it took 0.008 to 0.07 % of the time of a full solve on the CPU at 512 by
/// 512 cells, where the design allows 2 %.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Work {
    charts: u32,
    blocks: u64,
    nodes: u64,
    sweeps: u32,
    corrections: u32,
    node_updates: u64,
    /// Dispatches and command submissions on the GPU; 0 on the CPU.
    dispatches: u64,
    submissions: u64,
}

impl Work {
    fn of(asset: &Asset, tile: usize) -> Work {
        let report = asset.tile(tile).report().unwrap();
        let gpu = asset.tile(tile).gpu_work().unwrap().unwrap_or_default();
        Work {
            charts: report.charts_active,
            blocks: report.blocks_active,
            nodes: report.nodes_active,
            sweeps: report.sweeps,
            corrections: report.corrections,
            node_updates: report.node_updates,
            dispatches: gpu.dispatches(),
            submissions: gpu.submissions,
        }
    }

    /// True if every count that the backend reports is more than 0.
    fn is_full(&self, backend: Backend) -> bool {
        let Work { charts, blocks, nodes, sweeps, corrections, node_updates, dispatches, submissions } =
            *self;
        let solved =
            charts > 0 && blocks > 0 && nodes > 0 && sweeps > 0 && corrections > 0 && node_updates > 0;
        solved && (backend == Backend::Cpu || (dispatches > 0 && submissions > 0))
    }
}

#[test]
fn rest_and_a_pose_again_take_no_work() {
    for (device, grid) in devices() {
        let backend = device.info().backend;
        for model in [scenes::mug_to_jug(), scenes::creature()].map(Model::from) {
            let mut asset = model.asset_on(&device, grid);
            let mut solve = |positions: Strided| {
                asset.solve(positions, &SolveOptions::default()).unwrap();
                let report = asset.tile(0).report().unwrap();
                (Work::of(&asset, 0), [report.charts_reused, report.charts_identity, report.charts])
            };
            let (pose, rest) = (model.frame(1), Strided::from_slice(&model.rest));
            // Three cases: rest, a pose, and the same pose again; the second round begins with rest after a pose.
            for _ in 0..2 {
                let (work, [_, identity, charts]) = solve(rest);
                assert_eq!((work, identity), (Work::default(), charts), "{backend:?} {}: rest", model.name);
                let (work, _) = solve(pose);
                println!("{backend:?} {} {grid}²: {work:?}", model.name);
                assert!(work.is_full(backend), "{backend:?} {}: {work:?}", model.name);
                let (work, [reused, identity, charts]) = solve(pose);
                let kept = reused + identity;
                assert_eq!(
                    (work, kept),
                    (Work::default(), charts),
                    "{backend:?} {}: the same pose again",
                    model.name
                );
            }
        }
    }
}

#[test]
fn a_tile_does_not_pay_for_another() {
    // The arm bends over two tiles; between the first and the last frame only its upper half, tile 0, moves.
    let mut model = Model::from(scenes::arm());
    let forearm = model.vertices(|uv| uv[0] >= 1.0);
    let mut next = model.frames[0].clone();
    next.iter_mut().zip(&forearm).filter(|(_, forearm)| !*forearm).for_each(|(p, _)| p[2] *= 1.2);
    model.frames.push(next);
    let last = model.frames.len();
    for (device, grid) in devices() {
        let backend = device.info().backend;
        let mut asset = model.asset_on(&device, grid);
        let mut solve = |frame: usize| {
            asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
            ([0, 1].map(|tile| Work::of(&asset, tile)), asset.tile(1).report().unwrap().charts_reused)
        };
        // The second frame moves both tiles.
        for frame in [1, 2, 1] {
            let (works, reused) = solve(frame);
            assert!(works.iter().all(|work| work.is_full(backend)) && reused == 0, "{backend:?}: {works:?}");
        }
        let ([upper, fore], reused) = solve(last);
        assert!(upper.is_full(backend), "{backend:?}: {upper:?}");
        assert_eq!((fore, reused), (Work::default(), 1), "{backend:?}");
    }
}

#[test]
fn nothing_active_takes_no_solver() {
    let model = Model::from(scenes::arm());
    let held = |asset: &Asset| asset.device().info().bytes_held;
    let both = model.solved(&cpu(0), 256, 2, &SolveOptions::default());
    let full = held(&both);
    let assert_idle = |asset: &Asset, name: &str| {
        let report = asset.report().unwrap();
        assert_eq!((report.charts_active, report.nodes_active), (0, 0), "{name}");
        assert!(bits(asset).iter().all(|u| *u == [0; 2]), "{name}");
        for tile in 0..asset.tile_count() {
            let report = asset.tile(tile).report().unwrap();
            assert_eq!((report.sweeps, report.corrections, report.node_updates), (0, 0, 0), "{name}");
        }
        // Maps and grid remain: about a fifth of the bytes that are held with the solver's memory.
        assert!(held(asset) < full * 3 / 10, "{name}: {} of {full} bytes", held(asset));
    };
    // The first pose is rest.
    let mut asset = model.asset(0, 256);
    asset.solve(Strided::from_slice(&model.rest), &SolveOptions::default()).unwrap();
    assert_idle(&asset, "rest");
    // Nothing rigid.
    let mut asset = model.bare(0, Strided::from_slice(&model.rest));
    vrtm_testkit::set_grid(&mut asset, 256);
    asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
    assert_idle(&asset, "nothing rigid");
    // All nodes are masked.
    let mut asset = model.asset(0, 256);
    for tile in 0..2 {
        asset.tile_mut(tile).set_mask(Some(view(&[0], 1, 1))).unwrap();
    }
    asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
    assert_idle(&asset, "all masked");
    // Only one of two tiles has rigidity.
    let mut asset = model.asset(0, 256);
    asset.tile_mut(1).set_rigidity(None).unwrap();
    asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
    let half = held(&asset);
    let report = asset.report().unwrap();
    assert_eq!((report.tiles_active, report.charts_active), (1, 1));
    // The charts of the two tiles have the same size.
    assert!(half > 0 && half < full * 6 / 10, "{half} of {full} bytes");
    // All memory is freed with the asset.
    let device = both.device().clone();
    assert!(device.info().bytes_held > 0);
    drop(both);
    assert_eq!(device.info().bytes_held, 0);
}

/// Bytes per movable node that a tile held when this was measured, with its result, its maps and its part of the mesh,
/// on the worse of two scenes, at 256 and at 512 cells a side. (The two scenes take 200 and 285 bytes on the CPU at
/// 256, 178 and 217 at 512; on the GPU 248 and 352, 217 and 264.)
///
/// The design's bar is 128, and is not met. A node of a stored block takes 153 bytes on the CPU, more than half of them
/// for the rows and vectors of corrections, and 152 on a GPU (method §12). In addition there are the fixed nodes of
/// stored blocks, the maps, the triangles, and with a GPU the host's copy of the constants. On small grids these are
/// divided among few movable nodes.
fn measured_bytes(backend: Backend) -> [(u32, f64); 2] {
    match backend {
        Backend::Gpu => [(256, 352.0), (512, 264.0)],
        _ => [(256, 285.0), (512, 217.0)],
    }
}

/// The bytes that a tile may hold, in multiples of `measured_bytes`.
const BYTES_MARGIN: f64 = 1.1;

#[test]
fn bytes_follow_the_active_nodes() {
    for (device, _) in devices() {
        let backend = device.info().backend;
        for (grid, measured) in measured_bytes(backend) {
            if backend == Backend::Gpu && grid > 256 && !long::long() {
                continue;
            }
            for model in [scenes::analytic::bulge(), scenes::creature()].map(Model::from) {
                let asset = model.solved(&device, grid, 1, &SolveOptions::default());
                let report = asset.tile(0).report().unwrap();
                let bytes = report.bytes as f64 / report.nodes_active as f64;
                println!(
                    "{backend:?} {:9} {grid}²: {} active nodes, {} of {} blocks, {:.1} MiB, {bytes:.0} bytes per node",
                    model.name,
                    report.nodes_active,
                    report.blocks_active,
                    report.blocks,
                    report.bytes as f64 / f64::from(1 << 20)
                );
                assert!(report.blocks_active <= report.blocks && report.nodes_active > 0);
                assert!(bytes < BYTES_MARGIN * measured, "{backend:?} {} {grid}: {bytes}", model.name);
            }
        }
    }
    // A mask that leaves a quarter of the sheet movable takes about a quarter of the bytes: blocks without a movable
    // node or a neighbour of one are not stored.
    let model = Model::from(scenes::analytic::bulge());
    let held = |mask: &[u8]| {
        let mut asset = model.asset(0, 512);
        asset.tile_mut(0).set_mask(Some(view(mask, 2, 2))).unwrap();
        asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
        let report = asset.tile(0).report().unwrap();
        (asset.device().info().bytes_held as f64, report.blocks_active as f64)
    };
    let (all, quarter) = (held(&[255; 4]), held(&[255, 0, 0, 0]));
    println!("a quarter: {:.3} of the bytes, {:.3} of the blocks", quarter.0 / all.0, quarter.1 / all.1);
    // The rim is twice as large a part of a quarter of the sheet.
    assert!(quarter.0 < 0.35 * all.0 && quarter.1 < 0.3 * all.1);
}

#[test]
fn work_is_bounded() {
    for model in [scenes::mug_to_jug(), scenes::creature()].map(Model::from) {
        let mut asset = model.asset(0, 256);
        // Sweeps per correction and corrections, on the finest level and on each of the others (method §5). A
        // draft with a number of corrections is `normal` with that number.
        // Coarser levels have no sweeps.
        for (quality, most, sweeps, corrections) in [
            (Quality::Draft, None, [0, 1], [0, 1]),
            (Quality::Normal, None, [2, 2], [4, 1]),
            (Quality::Normal, Some(1), [2, 2], [1, 1]),
            (Quality::Draft, Some(7), [5, 2], [7, 1]),
        ] {
            let options = SolveOptions { quality, max_corrections: most, ..SolveOptions::default() };
            asset.solve(model.frame(1), &options).unwrap();
            let report = asset.tile(0).report().unwrap();
            // The coarsest level has at most 256 movable nodes, 16 cells on a side.
            assert_eq!(report.levels, 5, "{quality:?}");
            // Corrections are counted by the schedule, even if some charts sit them out.
            assert_eq!(report.corrections, corrections[0] + 4 * corrections[1], "{quality:?}");
            // Sweeps follow each correction, or come alone on a level without corrections.
            let planned: u32 = [0, 1].map(|k| sweeps[k] * corrections[k].max(1)).iter().sum();
            assert_eq!(report.sweeps, planned, "{quality:?}");
            // Sweeps follow each of the three trials of a correction, and come alone if no trial is accepted. Level 1
            // has at most a quarter of the movable nodes of level 0.
            let nodes = report.nodes_active;
            let updates = [0, 1].map(|k| u64::from(sweeps[k] * (4 * corrections[k]).max(1)) * nodes);
            let most = updates[0] + updates[1] / 4;
            println!(
                "{} {quality:?}: {} levels, {} sweeps, {} corrections, {:.2} updates per node (at most {:.2})",
                model.name,
                report.levels,
                report.sweeps,
                report.corrections,
                report.node_updates as f64 / nodes as f64,
                most as f64 / nodes as f64
            );
            assert!(report.node_updates <= most && report.node_updates > 0, "{quality:?}");
        }
        // A budget that is exceeded at once: the result is valid, and is not reused.
        let hurried = SolveOptions {
            time_budget: Some(std::time::Duration::from_micros(1)),
            ..SolveOptions::default()
        };
        asset.solve(model.frame(2), &hurried).unwrap();
        let report = asset.tile(0).report().unwrap();
        assert!(report.truncated && report.folds == 0 && report.energy <= report.energy_before);
        let cut = bits(&asset);
        asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
        let report = asset.tile(0).report().unwrap();
        assert!(!report.truncated && report.charts_reused == 0);
        assert!(bits(&asset) != cut);
    }
}
