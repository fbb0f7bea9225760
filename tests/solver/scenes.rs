//! The built-in scenes, on which tests and benches measure, are well-formed meshes, and moderate where they claim it.

use vrtm_testkit::faces;
use vrtm_testkit::scenes::{self, Scene};

fn all() -> Vec<Scene> {
    scenes::NAMES.iter().map(|name| scenes::by_name(name).expect("a scene of each name")).collect()
}

/// Twice the signed UV area of a face.
fn uv_area(scene: &Scene, face: std::ops::Range<usize>) -> f64 {
    let uv = |corner: usize| scene.uvs[scene.uv_indices[corner] as usize].map(f64::from);
    face.clone()
        .map(|k| {
            let (a, b) = (uv(k), uv(if k + 1 < face.end { k + 1 } else { face.start }));
            a[0] * b[1] - b[0] * a[1]
        })
        .sum()
}

#[test]
fn indices_counts_and_values_fit() {
    for scene in all() {
        let name = scene.name;
        assert_eq!(scene.indices.len(), scene.uv_indices.len(), "{name}");
        assert_eq!(scene.face_counts.iter().sum::<u32>() as usize, scene.indices.len(), "{name}");
        assert!(scene.indices.iter().all(|&i| (i as usize) < scene.rest.len()), "{name}");
        assert!(scene.uv_indices.iter().all(|&i| (i as usize) < scene.uvs.len()), "{name}");
        assert!(!scene.poses.is_empty() && scene.notes.len() == scene.poses.len(), "{name}");
        for positions in scene.poses.iter().chain([&scene.rest]) {
            assert_eq!(positions.len(), scene.rest.len(), "{name}");
            assert!(positions.iter().flatten().all(|x| x.is_finite()), "{name}");
        }
        for tile in &scene.tiles {
            assert_eq!(tile.rigidity.len(), (tile.width * tile.height) as usize, "{name}");
            let rigid = tile.rigidity.iter().filter(|&&r| r > 127).count() as f64;
            let fraction = rigid / tile.rigidity.len() as f64;
            assert!((0.01..0.6).contains(&fraction), "{name} {}: {fraction} of the tile is rigid", tile.udim);
        }
    }
}

#[test]
fn faces_lie_inside_their_tiles_and_do_not_overlap() {
    for scene in all() {
        let name = scene.name;
        const SIDE: usize = 256;
        for tile in &scene.tiles {
            let offset = [(tile.udim - 1001) % 10, (tile.udim - 1001) / 10].map(|x| x as f32);
            let mut owner = vec![None; SIDE * SIDE];
            for (index, face) in faces(&scene.face_counts).enumerate() {
                let uvs = face.clone().map(|k| scene.uvs[scene.uv_indices[k] as usize]);
                let uvs: Vec<[f32; 2]> = uvs.map(|uv| [uv[0] - offset[0], uv[1] - offset[1]]).collect();
                let inside = uvs.iter().flatten().filter(|&&x| (0.0..=1.0).contains(&x)).count();
                if inside < 2 * uvs.len() {
                    // A face that lies wholly in the neighbouring tile.
                    assert!(uvs.iter().any(|uv| uv[0] > 1.0 || uv[0] < 0.0), "{name}: face {index}");
                    continue;
                }
                assert!(uv_area(&scene, face).abs() > 1e-9, "{name}: face {index} has no area");
                for [x, y] in pixels(&uvs, SIDE) {
                    let p = [x, y].map(|k| (k as f32 + 0.503) / SIDE as f32);
                    if contains(&uvs, p) {
                        let before = owner[y * SIDE + x].replace(index);
                        assert_eq!(before, None, "{name}: face {index} over another at {p:?}");
                    }
                }
            }
        }
    }
}

/// The pixels of a polygon's bounding box.
fn pixels(polygon: &[[f32; 2]], side: usize) -> impl Iterator<Item = [usize; 2]> {
    let span = |c: usize| {
        let (low, high) = polygon.iter().fold((1.0f32, 0.0f32), |(l, h), q| (l.min(q[c]), h.max(q[c])));
        (low * side as f32) as usize..((high * side as f32).ceil() as usize).min(side)
    };
    let columns = span(0);
    span(1).flat_map(move |y| columns.clone().map(move |x| [x, y]))
}

/// True if a convex polygon of either winding contains the point.
fn contains(polygon: &[[f32; 2]], p: [f32; 2]) -> bool {
    let side = |k: usize| {
        let (a, b) = (polygon[k].map(f64::from), polygon[(k + 1) % polygon.len()].map(f64::from));
        (b[0] - a[0]) * (f64::from(p[1]) - a[1]) - (b[1] - a[1]) * (f64::from(p[0]) - a[0])
    };
    (0..polygon.len()).all(|k| side(k) > 0.0) || (0..polygon.len()).all(|k| side(k) < 0.0)
}

#[test]
fn scenes_are_the_same_every_time_and_made_of_quads_with_seams() {
    for (a, b) in all().into_iter().zip(all()) {
        assert_eq!(a.rest, b.rest);
        assert_eq!(a.poses, b.poses);
        assert_eq!(a.tiles[0].rigidity, b.tiles[0].rigidity);
    }
    let mug = scenes::mug_to_jug();
    assert!(mug.face_counts.len() > 4000 && mug.uvs.len() > mug.rest.len(), "seams split UVs, not vertices");
    assert_eq!(scenes::arm().tiles.len(), 2);
    assert!(scenes::creature().face_counts.iter().any(|&n| n > 4), "an n-gon closes the snout");
}

#[test]
fn poses_stretch_but_stay_within_reason() {
    for scene in all() {
        for (pose, note) in scene.poses.iter().zip(&scene.notes) {
            let (mut low, mut high) = (f32::MAX, 0.0f32);
            for face in faces(&scene.face_counts) {
                for k in face.start..face.end - 1 {
                    let [a, b] = [k, k + 1].map(|k| scene.indices[k] as usize);
                    let length =
                        |p: &[[f32; 3]]| (0..3).map(|c| (p[a][c] - p[b][c]).powi(2)).sum::<f32>().sqrt();
                    let ratio = length(pose) / length(&scene.rest);
                    (low, high) = (low.min(ratio), high.max(ratio));
                }
            }
            println!("{} ({note}): edges {low:.2} to {high:.2}", scene.name);
            assert!(low > 0.15 && high < 3.5, "{} ({note}): edges {low} to {high}", scene.name);
            assert!(high > 1.02 || low < 0.98, "{} ({note}) does nothing", scene.name);
        }
    }
}
