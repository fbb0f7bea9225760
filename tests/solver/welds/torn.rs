//! Cuts that are closed at rest, and welds that a pose tears.

use vrtm::{Asset, Quality, SolveOptions, Strided, WeldBy};
use vrtm_testkit::Lab as _;

use super::{GRID, QUADS, by, sheet, slit, solved};
use vrtm_testkit::{Model, bits, change, corner_uvs, devices, options, view};

/// The number of nodes that move; panics if one lies on the slit and moves, or crosses it.
fn moving_beside_the_slit(asset: &Asset) -> usize {
    let (middle, ends) = (GRID as f64 / 2.0, [GRID as f64 / 4.0, 3.0 * GRID as f64 / 4.0]);
    let mut moved = 0;
    for (n, u) in asset.displacements(0).unwrap().iter().enumerate().filter(|(_, u)| **u != [0.0; 2]) {
        let p = [n % (GRID + 1), n / (GRID + 1)].map(|x| x as f64);
        let q = [0, 1].map(|c| p[c] + f64::from(u[c]));
        let [below, above] = [p, q].map(|p| p[1] - middle);
        let on_it = below == 0.0 && (ends[0]..=ends[1]).contains(&p[0]);
        assert!(!on_it, "node {p:?} lies on the slit and moves to {q:?}");
        if below * above < 0.0 {
            let meeting = p[0] + (q[0] - p[0]) * below / (below - above);
            assert!(!(ends[0]..=ends[1]).contains(&meeting), "node {p:?} crosses the slit to {q:?}");
        }
        moved += 1;
    }
    moved
}

#[test]
fn no_node_crosses_a_slit_that_is_closed_at_rest_and_opened_by_the_pose() {
    for device in devices() {
        for two_vt in [false, true] {
            for weld in [WeldBy::Index, WeldBy::Position, WeldBy::Off] {
                let model = Model { weld: by(weld), ..slit(two_vt).0 };
                let asset = solved(&model, &device);
                let (info, report) = (asset.info(), asset.tile(0).report().unwrap());
                assert_eq!(info.charts, 1);
                let torn = if weld == WeldBy::Position { QUADS as u32 / 2 } else { 0 };
                assert_eq!((info.welded_edges, report.welds_torn), (torn.into(), torn), "{weld:?}");
                assert_eq!(info.edges_apart, if torn > 0 { 0 } else { QUADS as u64 / 2 }, "{weld:?}");
                let moved = moving_beside_the_slit(&asset);
                println!("{weld:?}, two vt {two_vt}: {moved} nodes move");
                assert!(moved > 20_000, "{moved}");
            }
        }
    }
}

#[test]
fn a_torn_weld_is_the_cut_mesh_in_that_pose_alone() {
    for device in devices() {
        let (model, doubled) = slit(false);
        let welded = Model { weld: by(WeldBy::Position), ..model.clone() };
        let by_index = solved(&model, &device);
        let mut torn = solved(&welded, &device);
        assert!(bits(&by_index) == bits(&torn), "all torn is not what the vertices say");
        assert!(corner_uvs(&by_index) == corner_uvs(&torn));
        // Closed again: as if nothing had been doubled.
        let mut closed = model.frames[0].clone();
        for [old, new] in &doubled {
            closed[*old as usize] = closed[*new as usize];
        }
        torn.solve(Strided::from_slice(&closed), &options(Quality::Normal)).unwrap();
        assert_eq!(torn.tile(0).report().unwrap().welds_torn, 0);
        let seamless = sheet(QUADS);
        let count = seamless.rest.len();
        let mut whole = seamless.asset_on(&device, GRID as u32);
        whole.solve(Strided::from_slice(&closed[..count]), &options(Quality::Normal)).unwrap();
        assert!(bits(&whole) == bits(&torn), "what is not torn is not the whole mesh");
        // Half of it: as a mesh with seams at the torn edges.
        let half: Vec<[u32; 2]> = doubled[..doubled.len() / 2].to_vec();
        let mut pose = closed.clone();
        for [old, new] in &half {
            pose[*old as usize] = model.frames[0][*old as usize];
            pose[*new as usize] = model.frames[0][*new as usize];
        }
        torn.solve(Strided::from_slice(&pose), &options(Quality::Normal)).unwrap();
        let first = half[0][0] - 1;
        let seams: Vec<[u32; 2]> = (0..=half.len() as u32).map(|k| [first + k, first + k + 1]).collect();
        assert_eq!(torn.tile(0).report().unwrap().welds_torn as usize, seams.len());
        let cut = Model { seams, ..welded.clone() };
        let mut cut = cut.asset_on(&device, GRID as u32);
        cut.solve(Strided::from_slice(&pose), &options(Quality::Normal)).unwrap();
        assert_eq!(cut.tile(0).report().unwrap().welds_torn, 0);
        assert!(bits(&cut) == bits(&torn), "a torn weld is not a seam");
        assert!(corner_uvs(&cut) == corner_uvs(&torn));
        // Poses that tear nothing build nothing anew, whatever was torn before.
        torn.solve(Strided::from_slice(&closed), &options(Quality::Normal)).unwrap();
        assert_eq!(torn.tile(0).report().unwrap().times.maps, 0.0);
        assert!(bits(&whole) == bits(&torn));
        // And the first pose again, after the others: the result is the pose's alone.
        torn.solve(model.frame(1), &options(Quality::Normal)).unwrap();
        assert!(bits(&by_index) == bits(&torn), "the result depends on earlier frames");
    }
}

#[test]
fn maps_and_settings_may_change_while_a_weld_is_torn() {
    for device in devices() {
        let model = Model { weld: by(WeldBy::Position), ..slit(true).0 };
        let grown: Vec<u8> = model.maps[0].rigidity.iter().map(|r| 255 - r).collect();
        let size = GRID as u32;
        let change = |asset: &mut Asset| {
            asset.tile_mut(0).set_rigidity(Some(view(&grown, size, size))).unwrap();
            change(asset, 0, |settings| settings.room = 0.5);
        };
        let mut fresh = model.asset_on(&device, size);
        change(&mut fresh);
        let options = SolveOptions { measure: true, ..options(Quality::Normal) };
        fresh.solve(model.frame(1), &options).unwrap();
        let mut changed = solved(&model, &device);
        let before = bits(&changed);
        change(&mut changed);
        changed.solve(model.frame(1), &options).unwrap();
        let report = changed.tile(0).report().unwrap();
        assert!(report.welds_torn > 0 && before != bits(&changed) && bits(&fresh) == bits(&changed));
        assert_eq!(report.strain, fresh.tile(0).report().unwrap().strain);
        let by_index = Model { weld: by(WeldBy::Index), ..model.clone() };
        let mut by_index = by_index.asset_on(&device, size);
        change(&mut by_index);
        by_index.solve(model.frame(1), &options).unwrap();
        // What judges a result sees the torn mesh, too.
        assert_eq!(report.strain, by_index.tile(0).report().unwrap().strain);
        let u: Vec<[f64; 2]> = changed.displacements(0).unwrap().iter().map(|u| u.map(f64::from)).collect();
        let energy = |asset: &Asset| asset.reference_energy(0, model.frame(1), &u).unwrap();
        assert_eq!(energy(&changed), energy(&by_index));
    }
}

/// The rule of the header, at VRTM_WELD_POSITION and weld_position_tolerance: far from the origin most of the bound is
/// rounding, of the rest and of the pose.
#[test]
fn a_pose_tears_a_weld_just_over_the_bound_of_the_header() {
    let (sheet, doubled) = slit(false);
    let [below, above] = doubled[0].map(|v| v as usize);
    let by_position = Model { weld: by(WeldBy::Position), ..sheet };
    for (epsilon, far) in [(2f64.powi(-23), [0.0f64, 3000.0]), (2f64.powi(-52), [0.0, 3e12])] {
        for (far, axis) in far.into_iter().flat_map(|far| [0, 2].map(|axis| (far, axis))) {
            // The sheet from `far` to `far` + 1 in x; the pose is as far away along all axes, and twice as large.
            let rest: Vec<[f64; 3]> =
                by_position.rest.iter().map(|p| [f64::from(p[0]) + far, p[1].into(), p[2].into()]).collect();
            let whole: Vec<[f64; 3]> = rest.iter().map(|p| [2.0 * p[0], 2.0 * p[1], far]).collect();
            let tolerance = 1e-5 + epsilon * (far + 1.0);
            let torn = |factor: f64| {
                let mut pose = whole.clone();
                pose[above] = pose[below];
                // The moved coordinate may be the largest one itself.
                let bound = |largest: f64| 10.0 * tolerance + 8.0 * epsilon * largest;
                let largest = pose[below].iter().fold(0.0f64, |m, x| m.max(x.abs()));
                let first = bound(largest);
                let largest = largest.max((pose[below][axis] + factor * first).abs());
                pose[above][axis] += factor * bound(largest);
                if epsilon < 1e-10 {
                    solve(&by_position, Strided::from_slice(&rest), Strided::from_slice(&pose))
                } else {
                    let [rest, pose] =
                        [&rest, &pose].map(|p| p.iter().map(|p| p.map(|x| x as f32)).collect::<Vec<_>>());
                    solve(&by_position, Strided::from_slice(&rest), Strided::from_slice(&pose))
                }
            };
            // The coordinates themselves are rounded: by up to a step in 8 of them.
            assert_eq!(torn(0.9), 0, "{epsilon:e} {far} {axis}");
            assert_eq!(torn(1.1), 2, "{epsilon:e} {far} {axis}: the edges at both sides of the vertex");
        }
    }
}

fn solve(model: &Model, rest: Strided, pose: Strided) -> u32 {
    let mut asset = model.bare(0, rest);
    vrtm_testkit::set_grid(&mut asset, 64);
    asset.solve(pose, &SolveOptions::default()).unwrap();
    asset.tile(0).report().unwrap().welds_torn
}
