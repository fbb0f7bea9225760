//! Refined meshes: no cracks, a pattern that adds up, and corner UVs that keep the tolerance everywhere, checked
//! against the redirection maps by code that shares nothing with the library.

use vrtm::{Asset, ErrorKind, RefinementPattern, RefinementSettings, SolveOptions, Strided};
use vrtm_testkit::Model;
use vrtm_testkit::refined::{Refined, truth};

/// Room for the rounding of maps and corner UVs, f32 both, in UV.
const ROUNDING: f64 = 1e-6;

fn scene(name: &str) -> Model {
    vrtm_testkit::scenes::by_name(name).unwrap().into()
}

fn solve(model: &Model, asset: &mut Asset, frame: usize) {
    asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
}

/// A solved asset.
fn solved(model: &Model, grid: u32, frame: usize) -> Asset {
    model.solved(&vrtm_testkit::cpu(0), grid, frame, &SolveOptions::default())
}

fn with(tolerance: f64) -> RefinementSettings {
    RefinementSettings { tolerance, ..RefinementSettings::default() }
}

/// Refines a frame and checks everything.
fn check(model: &Model, grid: u32, frame: usize, tolerance: f64) {
    let mut asset = solved(model, grid, frame);
    let refinement = asset.refine(&with(tolerance)).unwrap();
    let info = refinement.info();
    let refined = Refined::of(&refinement);
    refined.check_pattern(model);
    refined.check_conforming(model, |v| v);
    refined.check_corners(model, &asset);
    let (error, texels) = truth::largest_error(&mut asset, &refined, 4 * grid as usize);
    let faces = model.face_counts.len();
    println!(
        "{} {frame}: tolerance {tolerance:.1e}, {faces} faces to {} triangles in {:.1} ms; error {:.2e}, in the map {error:.2e} at {texels} texels",
        model.name, info.triangles, info.ms, info.error
    );
    assert!(info.reached && info.error <= tolerance, "{}: {info:?}", model.name);
    assert!(texels > 10_000, "{}: {texels}", model.name);
    // The tolerance holds at each texel, and the error told is the largest one and no loose bound: a texel comes near
    // it.
    assert!(error <= tolerance + ROUNDING, "{}: {error}", model.name);
    assert!(error >= 0.7 * info.error, "{}: {error} of {}", model.name, info.error);
    assert!(
        info.triangles > model.faces().map(|f| f.len() as u64 - 2).sum(),
        "{}: nothing is split",
        model.name
    );
}

#[test]
fn a_tile() {
    check(&scene("mug_to_jug"), 256, 5, 1.0 / 2048.0);
}

#[test]
fn two_tiles() {
    check(&scene("arm"), 256, 3, 1.0 / 1024.0);
}

#[test]
fn real_meshes() {
    for model in vrtm_testkit::assets() {
        let frame = match &*model.name {
            "mh_face" => 1,
            "fox" => 3,
            "ict_inner" => 4,
            _ => continue,
        };
        check(&model, 256, frame, 1.0 / 2048.0);
    }
}

#[test]
fn a_shot_has_one_topology() {
    for model in vrtm_testkit::assets().into_iter().filter(|model| model.name == "mh_face") {
        let mut asset = solved(&model, 256, 1);
        let mut refinement = asset.refine(&RefinementSettings::default()).unwrap();
        let first = Refined::of(&refinement);
        for frame in 2..=model.frames.len() {
            let before = refinement.info();
            solve(&model, &mut asset, frame);
            refinement.extend().unwrap();
            let info = refinement.info();
            assert!(info.reached && info.triangles >= before.triangles, "{info:?}");
        }
        let all = Refined::of(&refinement);
        all.check_pattern(&model);
        all.check_conforming(&model, |v| v);
        assert!(all.face_counts.len() > first.face_counts.len());
        let n = first.vertex_sources.len();
        assert_eq!(all.vertex_sources[..n], first.vertex_sources);
        assert_eq!(all.vertex_weights[..n], first.vertex_weights);
        let info = refinement.info();
        println!(
            "{} frames: {} triangles, {} of the first",
            model.frames.len(),
            info.triangles,
            first.face_counts.len()
        );
        // A triangle that is split for one frame may err by a little more in another one: a second round ends that.
        let mut added = vec![info.triangles];
        while added.len() < 5 {
            for frame in 1..=model.frames.len() {
                solve(&model, &mut asset, frame);
                refinement.extend().unwrap();
                assert!(refinement.info().reached, "{frame}");
            }
            added.push(refinement.info().triangles);
            if added[added.len() - 2] == added[added.len() - 1] {
                break;
            }
        }
        println!("after each round: {added:?}");
        assert!(added.len() <= 4 && added[added.len() - 1] < added[0] + added[0] / 100, "{added:?}");
        for frame in 1..=model.frames.len() {
            solve(&model, &mut asset, frame);
            let (error, _) = truth::largest_error(&mut asset, &Refined::of(&refinement), 512);
            assert!(error <= info.tolerance + ROUNDING, "{frame}: {error}");
        }
    }
}

#[test]
fn nothing_moves() {
    for name in ["mug_to_jug", "arm"] {
        let model = scene(name);
        let mut asset = model.asset(0, 64);
        asset.solve(Strided::from_slice(&model.rest), &SolveOptions::default()).unwrap();
        let refinement = asset.refine(&RefinementSettings::default()).unwrap();
        let info = refinement.info();
        assert!(info.reached && info.error == 0.0, "{info:?}");
        let refined = Refined::of(&refinement);
        assert_eq!(refined.face_counts, model.face_counts);
        assert_eq!(refined.corner_vertices, model.indices);
        assert_eq!(refined.vertex_sources.len(), model.rest.len());
        assert_eq!(refined.uvs, refined.redirected);
        refined.check_pattern(&model);
        refined.check_conforming(&model, |v| v);
    }
}

#[test]
fn a_limit_goes_to_the_largest_errors() {
    let model = scene("mug_to_jug");
    let [asset, mut shown] = [(); 2].map(|()| solved(&model, 128, 5));
    let base: u64 = model.faces().map(|face| face.len() as u64 - 2).sum();
    let refine = |max_triangles| {
        let settings = RefinementSettings { max_triangles, ..with(1e-4) };
        asset.refine(&settings).unwrap()
    };
    let all = refine(None).info();
    assert!(all.reached, "{all:?}");
    let mut last = f64::INFINITY;
    for limit in [1, base, base + base / 4, 2 * base, 3 * base, all.triangles] {
        let refinement = refine(Some(limit));
        let info = refinement.info();
        println!("at most {limit}: {} triangles, error {:.2e}", info.triangles, info.error);
        assert!(info.triangles <= limit.max(base), "{info:?}");
        // The room is used, and what is left gets smaller with it.
        assert!(limit <= base || info.triangles * 10 > limit * 9, "{info:?}");
        assert_eq!(info.reached, limit == all.triangles, "{info:?}");
        assert!(info.error < last || limit == base, "{info:?}");
        last = info.error;
        let refined = Refined::of(&refinement);
        refined.check_conforming(&model, |v| v);
        let (error, _) = truth::largest_error(&mut shown, &refined, 512);
        assert!(error <= info.error + ROUNDING && error >= 0.5 * info.error, "{error} of {}", info.error);
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    let model = scene("arm");
    let of = |threads| {
        let mut asset = model.asset(threads, 128);
        solve(&model, &mut asset, 3);
        let mut refinement = asset.refine(&with(2e-3)).unwrap();
        solve(&model, &mut asset, 4);
        refinement.extend().unwrap();
        (Refined::of(&refinement), refinement.info().error.to_bits())
    };
    let one = of(1);
    assert!(one.0.face_counts.len() > model.face_counts.len());
    for threads in [2, 3, 5] {
        assert!(of(threads) == one, "{threads} threads");
    }
}

/// A sheet bent along an edge that five faces share, a pentagon, faces without texture, a point: `doubled` gives each
/// face vertices of its own.
fn odd_sheet(doubled: bool) -> (Model, Vec<u32>) {
    let mut model = Model { name: "odd".into(), ..Model::default() };
    let n = 6;
    for k in 0..=n {
        for i in 0..=2 * n {
            model.rest.push([i as f32 / n as f32, k as f32 / n as f32, 0.0]);
            model.uvs.push([0.05 + 0.9 * i as f32 / (2 * n) as f32, 0.05 + 0.9 * k as f32 / n as f32]);
        }
    }
    let at = |i: usize, k: usize| (k * (2 * n + 1) + i) as u32;
    let mut face = |corners: &[u32], textured: bool| {
        model.face_counts.push(corners.len() as u32);
        model.indices.extend_from_slice(corners);
        model.uv_indices.extend(corners.iter().map(|&c| if textured { c } else { u32::MAX }));
    };
    for k in 0..n {
        for i in 0..2 * n {
            match (i, k) {
                // A pentagon and a triangle in the place of two quads.
                (2, 1) => face(&[at(2, 1), at(3, 1), at(4, 2), at(3, 2), at(2, 2)], true),
                (3, 1) => face(&[at(3, 1), at(4, 1), at(4, 2)], true),
                _ => face(&[at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1)], true),
            }
        }
    }
    face(&[at(0, 0)], true);
    // Three wings without texture on one edge within the sheet, one of them not convex.
    let wing = model.rest.len() as u32;
    for (y, z) in [(0.3, 0.5), (0.5, 0.6), (0.7, 0.5)] {
        model.rest.push([1.0, y, z]);
        model.rest.push([1.1, y, 0.2]);
        model.uvs.push([0.0; 2]);
        model.uvs.push([0.0; 2]);
    }
    let (a, b) = (at(n, 3), at(n, 4));
    let mut face = |corners: &[u32]| {
        model.face_counts.push(corners.len() as u32);
        model.indices.extend_from_slice(corners);
        model.uv_indices.extend(corners.iter().map(|_| u32::MAX));
    };
    face(&[a, b, wing]);
    face(&[b, a, wing + 2, wing + 3]);
    face(&[a, b, wing + 5, wing + 4]);
    let mut places: Vec<u32> = (0..model.rest.len() as u32).collect();
    if doubled {
        places = model.indices.clone();
        model.rest = places.iter().map(|&v| model.rest[v as usize]).collect();
        model.indices = (0..model.rest.len() as u32).collect();
        model.weld.by = vrtm::WeldBy::Position;
    }
    let bend = |p: &[f32; 3]| [p[0] + 0.2 * (p[0] * 3.0).sin(), p[1], p[2] + 0.3 * (p[0] * p[1] * 2.0).cos()];
    model.frames = vec![model.rest.iter().map(bend).collect()];
    let dots = |k: usize| if (k % 64 % 16) / 8 + (k / 64 % 16) / 8 == 1 { 255 } else { 0 };
    let rigidity = (0..64 * 64).map(dots).collect();
    model.maps = vec![vrtm_testkit::Maps { udim: 1001, width: 64, height: 64, rigidity, mask: None }];
    (model, places)
}

#[test]
fn odd_meshes_have_no_cracks() {
    for doubled in [false, true] {
        let (model, places) = odd_sheet(doubled);
        let mut asset = solved(&model, 128, 1);
        let refinement = asset.refine(&with(1e-3)).unwrap();
        let refined = Refined::of(&refinement);
        let info = refinement.info();
        println!("doubled: {doubled}: {} of {} faces", info.faces, model.face_counts.len());
        assert!(info.reached && info.faces > 2 * model.face_counts.len() as u64, "{info:?}");
        // Corners without UVs have 0, 0, and so have the wings' parts.
        let mut plain = model.clone();
        plain.uvs.push([0.0; 2]);
        let none = plain.uvs.len() as u32 - 1;
        plain.uv_indices.iter_mut().filter(|c| **c == u32::MAX).for_each(|c| *c = none);
        refined.check_pattern(&plain);
        refined.check_corners(&plain, &asset);
        refined.check_conforming(&plain, |v| places[v as usize]);
        let wings = model.face_counts.len() as u32 - 3;
        for wing in wings..wings + 3 {
            // The edge that they share with the sheet is split.
            assert!(refined.face_sources.iter().filter(|&&f| f == wing).count() > 1, "wing {wing}");
        }
        let (error, texels) = truth::largest_error(&mut asset, &refined, 512);
        assert!(error <= 1e-3 + ROUNDING && texels > 10_000, "{error}");
    }
}

#[test]
fn wrong_arguments_are_named() {
    let model = scene("bulge");
    let mut asset = model.asset(0, 64);
    let error = asset.refine(&RefinementSettings::default()).unwrap_err();
    assert_eq!(error.kind, ErrorKind::NotSolved);
    solve(&model, &mut asset, 1);
    for tolerance in [0.0, -1.0, 1.5, f64::NAN, f64::INFINITY] {
        let error = asset.refine(&with(tolerance)).unwrap_err();
        assert!(error.message.starts_with("tolerance: "), "{error}");
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
    }
    let error = asset.refine(&RefinementSettings { uv_set: 1, ..RefinementSettings::default() }).unwrap_err();
    assert!(error.message.starts_with("uv_set: 1"), "{error}");
    let refinement = asset.refine(&RefinementSettings::default()).unwrap();
    let corners = refinement.info().corners as usize;
    let error = refinement.corner_uvs(&mut vec![[0.0; 2]; corners - 1]).unwrap_err();
    assert!(error.message.starts_with("uvs: "), "{error}");
    let mut weights = vec![[0.0; 3]; corners + 1];
    let mut faces = vec![7; refinement.info().faces as usize];
    let mut pattern = RefinementPattern {
        corner_weights: Some(&mut weights),
        face_sources: Some(&mut faces),
        ..RefinementPattern::default()
    };
    let error = refinement.pattern(&mut pattern).unwrap_err();
    assert!(error.message.starts_with("corner_weights: "), "{error}");
    assert!(faces.iter().all(|&f| f == 7), "something was written");
}

#[test]
fn it_outlives_the_asset() {
    let model = scene("bulge");
    let mut asset = solved(&model, 64, 1);
    let mut refinement = asset.refine(&with(1e-3)).unwrap();
    let before = Refined::of(&refinement);
    assert!(before.face_counts.len() > model.face_counts.len());
    // A later result replaces the one that it reads, and a failed one does not.
    let mut bad = model.rest.clone();
    bad[0][0] = f32::NAN;
    asset.solve(Strided::from_slice(&bad), &SolveOptions::default()).unwrap_err();
    assert!(Refined::of(&refinement) == before);
    drop(asset);
    assert!(Refined::of(&refinement) == before);
    refinement.extend().unwrap();
    assert!(Refined::of(&refinement) == before);
}
