//! Random sheets, poses, maps and points against a checker that shares no code with the library: it reads the warp as
//! an image, looks triangles up one by one, and knows of features only that they are rigid.

use super::sheet::{All, Layout, P2, P3, Sheet, by_uv, disc, distance, fetch, solve, turned, uv};
use vrtm::{FetchKind, Fit, Seams, TileSettings};
use vrtm_testkit::random::Random;
use vrtm_testkit::{Warp, barycentric, texels};

/// Models drawn by a run of the suite; `VRTM_RANDOM_CASES` draws more.
const CASES: u64 = 300;

#[test]
fn random_models_agree_with_the_checker() {
    let cases = std::env::var("VRTM_RANDOM_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(CASES);
    let mut worst = [0.0f64; 4];
    for case in 0..cases {
        let of_case = check(case);
        worst = [0, 1, 2, 3].map(|k| worst[k].max(of_case[k]));
    }
    println!(
        "{cases} models: positions {:e}, UVs {:e}, rotations {:e}, edges {:e}",
        worst[0], worst[1], worst[2], worst[3]
    );
}

/// Draws a model and checks it; returns the largest errors.
fn check(case: u64) -> [f64; 4] {
    let mut draw = Random(case.wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678);
    (0..4).for_each(|_| _ = draw.part());
    let layout = if draw.part() < 0.3 { Layout::Cut } else { Layout::Whole };
    let side = 2 * draw.between(1.0, 9.0) as usize;
    let unit = [1.0, 1e-3, 100.0][draw.between(0.0, 3.0) as usize];
    let waves: Vec<[f64; 6]> = (0..4).map(|_| std::array::from_fn(|_| draw.between(-1.0, 1.0))).collect();
    let wave = move |[x, y]: P2, k: usize, size: f64| {
        let [a, b, c, d, e, f] = waves[k];
        size * ((3.0 * a * x + 3.0 * b * y + c).sin() + d * x * y + e * x * x + f * y * y)
    };
    let wave = &wave;
    let rest = |p: P2| -> P3 {
        [p[0] + wave(p, 0, 0.05), p[1] + wave(p, 1, 0.05), wave(p, 2, 0.2)].map(|x| unit * x)
    };
    let strength = draw.between(0.0, 0.3);
    let pose_of = |p: P2| -> P3 {
        let q = [p[0] + wave(p, 3, strength), p[1] + wave([p[1], p[0]], 1, strength), wave(p, 0, 0.3)];
        [q[2], q[0], q[1] + 1.0].map(|x| unit * x)
    };
    let sheet = Sheet::new(side, layout, rest);
    let centre = [draw.between(0.2, 0.8), draw.between(0.2, 0.8)];
    let radius = draw.between(0.05, 0.3);
    let rigid = disc(centre, radius);
    let grid = 16 * draw.between(1.0, 5.0) as u32;
    let mut asset = sheet.asset(1 + case as u32 % 2, grid, rigid, TileSettings::default());
    let points: Vec<P2> = (0..60).map(|_| [draw.part(), draw.part()]).collect();
    let uvs: Vec<P2> = points.iter().map(|p| uv(layout, *p, p[0] > 0.5)).collect();
    let heights: Vec<f64> = points.iter().map(|_| unit * draw.between(-0.1, 0.1)).collect();
    let surface = by_uv(&asset, &uvs, Some(&heights), Fit::Surface, 0);
    let on_surface = by_uv(&asset, &uvs, None, Fit::Surface, 0);
    let body = by_uv(&asset, &uvs, Some(&heights), Fit::Feature, 0);
    solve(&mut asset, &sheet.rest);
    let at_rest = fetch(&body);
    let pose = sheet.pose(pose_of);
    solve(&mut asset, &pose);
    let [surface, on_surface, body] = [surface, on_surface, body].each_ref().map(fetch);
    let mut worst = [0.0f64; 4];

    // The base is f_pose(W(p)), looked up by hand; UVs are W(p).
    let warp = warp(&asset, grid as usize);
    for (k, at) in uvs.iter().enumerate() {
        let to = warp.at(at.map(|x| x * f64::from(grid))).map(|x| x / f64::from(grid));
        let (base, depth) = under(&sheet, &pose, to, points[k][0] > 0.5);
        let errors = [
            distance(on_surface.positions[k], base) / unit,
            (on_surface.uvs[k][0] - to[0]).hypot(on_surface.uvs[k][1] - to[1]),
        ];
        (worst[0], worst[1]) = (worst[0].max(errors[0]), worst[1].max(errors[1]));
        // Nodes and the warp's image are f32, and the mesh's UVs are too.
        assert!(depth > -1e-5, "case {case}, {k}: the warp leads out of the chart by {depth}");
        assert!(errors[0] < 2e-5 && errors[1] < 1e-6, "case {case}, point {k}: {errors:?}");
        // In the shell: at its height along the third axis of the frame.
        let apart = distance(surface.positions[k], on_surface.positions[k]);
        assert!((apart - heights[k].abs()).abs() < 1e-6 * unit, "case {case}, point {k}");
    }
    for all in [&surface, &on_surface, &body, &at_rest] {
        worst[2] = worst[2].max(rotations(all, case));
    }
    // What is inside of a feature moves as a body: by the same rotation, and without a change of length.
    let cell = 1.0 / (0.85 * f64::from(grid));
    let inner: Vec<usize> = (0..points.len())
        .filter(|&k| (points[k][0] - centre[0]).hypot(points[k][1] - centre[1]) < radius - 2.5 * cell)
        .filter(|&k| (points[k][0] - 0.5).abs() > 2.0 * cell || layout == Layout::Whole)
        .collect();
    for &a in &inner {
        for &b in inner.iter().filter(|&&b| b < a) {
            let (rest, posed) = (
                distance(at_rest.positions[a], at_rest.positions[b]),
                distance(body.positions[a], body.positions[b]),
            );
            let error = (posed - rest).abs() / unit;
            worst[3] = worst[3].max(error);
            assert!(error < 1e-5, "case {case}, points {a} and {b}: {posed} at rest {rest}");
        }
    }
    worst
}

/// Largest distance of the matrices from rotations; never a reflection.
fn rotations(all: &All, case: u64) -> f64 {
    let mut worst: f64 = 0.0;
    for m in &all.rotations {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(|axis| turned(*m, axis));
        let [a, b, c] = axes;
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let dot = |p: P3, q: P3| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let error = distance(cross, c).max(dot(a, b).abs()).max((dot(a, a) - 1.0).abs());
        assert!(error < 1e-6, "case {case}: {m:?}");
        worst = worst.max(error);
    }
    for [large, small] in &all.stretch {
        assert!(large >= small && *small >= 0.0 && large.is_finite(), "case {case}");
    }
    worst
}

/// The warp, from an image with a texel for each node.
fn warp(asset: &vrtm::Asset, cells: usize) -> Warp {
    let nodes = texels(asset.results(), 0, FetchKind::Warp, [cells as u32 + 1; 2], [0.0f32; 2]);
    let displacement = |(k, uv): (usize, [f32; 2])| {
        let at = [k % (cells + 1), k / (cells + 1)];
        [0, 1].map(|c| (f64::from(uv[c]) * cells as f64 - at[c] as f64) as f32)
    };
    Warp { nx: cells, ny: cells, u: nodes.into_iter().enumerate().map(displacement).collect() }
}

/// The place of a UV of a chart in the pose, by the triangle of the sheet that contains it best, and how deep it lies
/// in it.
fn under(sheet: &Sheet, pose: &[P3], at: P2, right: bool) -> (P3, f64) {
    let mut best = ([0.0; 3], f64::NEG_INFINITY);
    for face in 0..sheet.indices.len() / 4 {
        if sheet.layout == Layout::Cut && (2 * (face % sheet.side) >= sheet.side) != right {
            continue;
        }
        for of in [[0, 1, 2], [0, 2, 3]] {
            let corners = of.map(|k| 4 * face + k);
            let l = barycentric(&corners.map(|k| sheet.uvs[k].map(f64::from)), at);
            let depth = l.iter().copied().fold(f64::INFINITY, f64::min);
            if depth > best.1 {
                let p = corners.map(|k| pose[sheet.indices[k] as usize]);
                best = (std::array::from_fn(|k| l[0] * p[0][k] + l[1] * p[1][k] + l[2] * p[2][k]), depth);
            }
        }
    }
    best
}

/// A pose that turns a chart's cells over, or collapses, gives finite numbers and rotations all the same.
#[test]
fn collapsed_poses_give_rotations() {
    let sheet = Sheet::new(8, Layout::Cut, |[x, y]| [x, y, 0.0]);
    let settings = TileSettings { seams: Seams::Continue, ..TileSettings::default() };
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), settings);
    let uvs: Vec<P2> = super::lattice(9).iter().map(|p| uv(Layout::Cut, *p, p[0] > 0.5)).collect();
    let heights = vec![0.1; uvs.len()];
    let carrier = by_uv(&asset, &uvs, Some(&heights), Fit::Feature, 0);
    let poses: [fn(P2) -> P3; 5] = [
        |_| [1.0, 2.0, 3.0],
        |[x, _]| [x, x, x],
        |[x, y]| [1e200 * x, 1e200 * y, 0.0],
        |[x, y]| [1e-200 * x, 1e-200 * y, 0.0],
        |[x, y]| [x, y * (1.0 - 2.0 * x), 0.0],
    ];
    for pose in poses {
        solve(&mut asset, &sheet.pose(pose));
        let all = fetch(&carrier);
        assert!(all.positions.iter().flatten().all(|x| x.is_finite()));
        for m in &all.rotations {
            assert!(m.iter().all(|x| x.abs() < 1.0 + 1e-6), "{m:?}");
        }
    }
}
