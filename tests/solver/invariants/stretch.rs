//! Poses that cannot be meant are told by the length of their edges.

use vrtm::{Asset, AssetReport, LogCode, Quality, Strided};

use vrtm_testkit::log::listened;
use vrtm_testkit::{self, Model, options, quads};

fn report(asset: &mut Asset, pose: &[[f32; 3]]) -> AssetReport {
    asset.solve(Strided::from_slice(pose), &options(Quality::Draft)).unwrap();
    asset.report().unwrap()
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
        assert!((0.7..1.5).contains(&report.median_stretch), "{}", report.median_stretch);
        assert!(report.stretched_share < 0.02, "{}", report.stretched_share);
    }
    // Of no pose.
    assert_eq!(log.warnings(), [(LogCode::NoRigidity, vec![])]);
    assert_eq!(report(&mut asset, &model.rest).median_stretch, 1.0);

    for factor in [100.0, 0.01] {
        let scaled: Vec<_> = model.rest.iter().map(|p| p.map(|x| x * factor)).collect();
        let stretch = report(&mut asset, &scaled).median_stretch;
        assert!((stretch / factor - 1.0).abs() < 1e-4, "{stretch} at {factor}");
        let said = log.warnings();
        assert!(said.len() == 1 && said[0].0 == LogCode::PoseScale, "{said:?}");
        assert_eq!(said[0].1[0] as f32, stretch);
    }

    // A tenth of the vertices in another order leaves the median as it is.
    let mut shuffled = model.rest.clone();
    let count = shuffled.len() / 10;
    shuffled[..count].sort_by_key(|p| p.map(|x| (x * 7919.0).sin().to_bits()));
    let mixed = report(&mut asset, &shuffled);
    assert!(mixed.median_stretch < 2.0 && mixed.stretched_share > 0.05, "{mixed:?}");
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
    let share = below(f64::from(found.median_stretch));
    assert!((share - 0.5).abs() < 0.02, "{} is over {share} of all", found.median_stretch);
}
