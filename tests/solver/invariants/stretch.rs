//! Poses that cannot be meant are told by the length of their edges.

use vrtm::{
    Asset, AssetReport, Bind, Carried, CarrierSettings, Device, LogCode, Quality, Scale, SolveOptions,
    SolveRequest, Strided, StridedMut,
};

use vrtm_testkit::log::listened;
use vrtm_testkit::{self, Model, bits, on_both, options, quads};

fn report(asset: &mut Asset, pose: &[[f32; 3]]) -> AssetReport {
    asset.solve(Strided::from_slice(pose), &options(Quality::Draft)).unwrap();
    asset.report().unwrap()
}

fn scaled(pose: &[[f32; 3]], factor: f32) -> Vec<[f32; 3]> {
    pose.iter().map(|p| p.map(|x| x * factor)).collect()
}

on_both!(features_follow_the_size_of_a_pose(32), features_follow_the_size_of_a_pose_on_a_gpu(32): follows);

fn follows(device: &Device, cells: u32) {
    let model = Model::from(vrtm_testkit::scenes::by_name("arm").unwrap());
    let follow = SolveOptions { scale: Scale::Follow, measure: true, ..SolveOptions::default() };
    // Of a new asset: the warp, its strain, and a point above the surface.
    let solved = |pose: &[[f32; 3]], options: &SolveOptions| {
        let mut asset = model.asset_on(device, cells);
        let weights = Strided::from_slice(&[[1.0f32, 2.0, 1.0]]);
        let by = Bind::Corners { corners: &[[0, 1, 2]], weights };
        let heights = Some(Strided::from_slice(&[0.25]));
        let carrier = asset.carrier(&CarrierSettings { heights, ..CarrierSettings::new(by) }).unwrap();
        asset.solve(Strided::from_slice(pose), options).unwrap();
        let mut point = [[0.0f64; 3]];
        let positions = Some(StridedMut::from_slice(&mut point));
        carrier.fetch(&Carried { positions, ..Carried::default() }).unwrap();
        let farthest =
            (0..2).map(|tile| asset.tile(tile).report().unwrap().max_displacement).fold(0.0, f32::max);
        let strain = asset.tile(0).report().unwrap().strain.unwrap().after.rms;
        (bits(&asset), strain, farthest, point[0])
    };
    let pose = &model.frames[1];
    let (warp, strain, farthest, point) = solved(pose, &follow);
    assert!(farthest > 0.0 && strain > 0.0);
    for factor in [4.0, 0.125, 1.3] {
        let (scaled_warp, scaled_strain, moved, scaled_point) = solved(&scaled(pose, factor), &follow);
        let is_exact = factor != 1.3;
        assert!(scaled_warp == warp && scaled_strain == strain || !is_exact, "{factor}");
        // Factors that are no power of two round the positions of f32.
        assert!(
            (moved / farthest - 1.0).abs() < 1e-3 && (scaled_strain / strain - 1.0).abs() < 1e-3,
            "{factor}"
        );
        for axis in 0..3 {
            let off = scaled_point[axis] - f64::from(factor) * point[axis];
            assert!(off.abs() <= if is_exact { 0.0 } else { 1e-3 }, "{off} at {factor}");
        }
        // Nothing but the option keeps rest at another size from being warped.
        let rest = scaled(&model.rest, factor);
        assert_eq!(solved(&rest, &follow).2, 0.0, "{factor}");
        assert!(
            solved(&rest, &SolveOptions { measure: true, ..SolveOptions::default() }).2 > 0.0,
            "{factor}"
        );
    }
}

/// A vertex that moves may change the size of the pose, and with it all tiles.
#[test]
fn tiles_without_a_moved_vertex_follow_the_size() {
    let model = Model::from(vrtm_testkit::scenes::by_name("arm").unwrap());
    let mut asset = model.asset(1, 32);
    let options = SolveOptions { scale: Scale::Follow, ..SolveOptions::default() };
    asset.solve(model.frame(1), &options).unwrap();
    // All but tile 0 grow; the bits of the other order of frames are those of a new asset.
    let corners = model.indices.iter().zip(&model.uv_indices);
    let own: Vec<u32> =
        corners.filter(|(_, uv)| model.uvs[**uv as usize][0] < 1.0).map(|(v, _)| *v).collect();
    let mut pose = model.frames[1].clone();
    let moved: Vec<u32> = (0..pose.len() as u32).filter(|v| !own.contains(v)).collect();
    assert!(asset.find_tile(1001) == Some(0) && !moved.is_empty());
    moved.iter().for_each(|&v| pose[v as usize] = pose[v as usize].map(|x| 2.0 * x));
    let positions = Strided::from_slice(&pose);
    let mut fresh = model.asset(1, 32);
    fresh.solve(positions, &options).unwrap();
    for _ in 0..2 {
        let request =
            SolveRequest { positions, options, dirty_vertices: Some(&moved), ..SolveRequest::default() };
        asset.run(&request, &mut []).unwrap();
        assert!(bits(&asset) == bits(&fresh));
    }
    assert!(asset.tile(0).report().unwrap().kept, "nothing has changed since");
}

#[test]
fn other_units_and_other_orders_are_noticed() {
    let model = Model::from(vrtm_testkit::scenes::creature());
    let (device, log) = listened();
    // It has no maps.
    let mut asset = model.bare_on(&device, Strided::from_slice(&model.rest));
    let mut poses = vec![model.rest.clone()];
    poses.extend(model.frames.iter().cloned());
    for pose in &poses {
        let report = report(&mut asset, pose);
        assert!((0.7..1.5).contains(&report.scale), "{}", report.scale);
        assert!(report.stretched_share < 0.02, "{}", report.stretched_share);
    }
    // Of no pose.
    assert_eq!(log.warnings(), [(LogCode::NoRigidity, vec![])]);
    let mut counts = Vec::new();

    // Poses in other units, and poses that are only scaled, of which the first is told.
    for (pose, factor) in [(1, 100.0), (2, 0.01), (0, 1.3), (0, 1.01), (0, 0.5)] {
        let (base, scaled) = (&poses[pose], scaled(&poses[pose], factor));
        let before = report(&mut asset, base);
        assert_eq!(before.scale_spread == 0.0, pose == 0, "{before:?}");
        for _ in 0..2 {
            let now = report(&mut asset, &scaled);
            assert!((now.scale / before.scale / factor - 1.0).abs() < 1e-4, "{now:?} at {factor}");
            assert!((now.scale_spread - before.scale_spread).abs() < 1e-4, "{now:?} at {factor}");
            let said = log.warnings();
            assert!(said.iter().all(|line| *line == (LogCode::PoseScale, said[0].1.clone())), "{said:?}");
            assert!(said.iter().all(|line| line.1[0] as f32 == now.scale), "{said:?}");
            counts.push(said.len());
        }
        let options = SolveOptions { scale: Scale::Follow, ..options(Quality::Draft) };
        asset.solve(Strided::from_slice(&scaled), &options).unwrap();
        assert_eq!(log.warnings(), []);
    }
    assert_eq!(counts, [1, 1, 1, 1, 1, 0, 1, 0, 1, 0]);

    // A tenth of the vertices in another order leaves the median as it is.
    let mut shuffled = model.rest.clone();
    let count = shuffled.len() / 10;
    shuffled[..count].sort_by_key(|p| p.map(|x| (x * 7919.0).sin().to_bits()));
    let mixed = report(&mut asset, &shuffled);
    assert!(mixed.scale < 2.0 && mixed.stretched_share > 0.05, "{mixed:?}");
    let said = log.warnings();
    assert!(said.len() == 1 && said[0].0 == LogCode::PoseOrder, "{said:?}");
    assert_eq!(said[0].1[0] as f32, mixed.stretched_share);
}

#[test]
fn the_edges_of_a_large_mesh_are_sampled_evenly() {
    // A grid of squares, stretched along x alone, to lengths from 1 at x = 0 to 5 at x = 1: half of the edges along x
    // are over 3 times as long, the edges along y are as at rest, and the diagonals lie between.
    const N: u32 = 64;
    let rest: Vec<[f32; 3]> =
        (0..=N).flat_map(|j| (0..=N).map(move |i| [i as f32 / N as f32, j as f32 / N as f32, 0.0])).collect();
    let corners = quads([N as usize; 2], 0);
    let model = Model {
        uvs: rest.iter().map(|&[x, y, _]| [x, y]).collect(),
        face_counts: vec![4; (N * N) as usize],
        uv_indices: corners.clone(),
        indices: corners,
        ..Model::default()
    };
    let mut asset = model.bare(1, Strided::from_slice(&rest));
    let pose: Vec<_> = rest.iter().map(|&[x, y, z]| [x + 2.0 * x * x, y, z]).collect();
    let found = report(&mut asset, &pose);
    // Of each triangle's three edges one lies along x, of which half are over 3, and one is a diagonal, of length
    // √((1 + s²) / 2), which is over 3 from s = √17 on, where s runs from 1 to 5.
    let expected = (0.5 + (5.0 - 17.0f64.sqrt()) / 4.0) / 3.0;
    assert!(
        (f64::from(found.stretched_share) - expected).abs() < 0.02,
        "{} {expected}",
        found.stretched_share
    );
    // A third of all stretches is 1, and those of the diagonals, √((1 + s²) / 2), lie under those along x, s. So below
    // a stretch m there are 1/3, and (m - 1) / 4 / 3 of those along x and (√(2 m² - 1) - 1) / 4 / 3 of the diagonals:
    // 1/2 for m = √33 - 4 = 1.74.
    let below = |m: f64| (1.0 + (m - 1.0) / 4.0 + ((2.0 * m * m - 1.0).sqrt() - 1.0) / 4.0) / 3.0;
    let share = below(f64::from(found.scale));
    assert!((share - 0.5).abs() < 0.02, "{} is over {share} of all", found.scale);
}
