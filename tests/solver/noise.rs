//! Noise of UVs: the corners of one vertex differ by less than the tolerance, as in polygon soups, or where a program
//! has written each face by itself. What is welded is one UV, the mean, and nothing else changes but by the noise.

use std::collections::BTreeMap;

use vrtm::{Quality, RefinementSettings};
use vrtm_testkit::{Maps, Model, Warp, bits, long, options, quads};

/// A sheet of 64 by 32 quads whose UVs lie in low..high, with rigid discs, in a pose that squashes a part of it.
pub fn sheet([low, high]: [f64; 2]) -> Model {
    let size = [64, 32];
    let places = (0..=size[1]).flat_map(|j| (0..=size[0]).map(move |i| [i as f64 / 64.0, j as f64 / 32.0]));
    let places: Vec<[f64; 2]> = places.collect();
    let indices = quads(size, 0);
    let pose = |[x, y]: [f64; 2]| {
        let middle = (-12.0 * ((x - 0.5).powi(2) + (y - 0.5).powi(2))).exp();
        [x - 0.12 * (std::f64::consts::TAU * x).sin(), y, 0.25 * middle].map(|x| x as f32)
    };
    let rigid = |k: usize| {
        let [x, y] = [k % 128, k / 128].map(|x| (x as f64 / 16.0).fract() - 0.5);
        if x * x + y * y < 0.09 { 255 } else { 0 }
    };
    let rigidity = (0..128 * 128).map(rigid).collect();
    Model {
        rest: places.iter().map(|&[x, y]| [x as f32, y as f32, 0.0]).collect(),
        frames: vec![places.iter().map(|&p| pose(p)).collect()],
        face_counts: vec![4; size[0] * size[1]],
        uv_indices: indices.clone(),
        indices,
        uvs: places.iter().map(|p| p.map(|x| (low + (high - low) * x) as f32)).collect(),
        maps: vec![Maps { udim: 1001, width: 128, height: 128, rigidity, mask: None }],
        ..Model::default()
    }
}

/// The model with a UV for each corner, moved by noise of up to `most` in u and in v; that of the corners of a face is
/// the same if it is `by_face`.
pub fn noisy(model: &Model, most: f64, by_face: bool) -> Model {
    let noise = |k: u64| {
        let mixed = (k + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mixed = (mixed ^ mixed >> 31).wrapping_mul(0xd6e8_feb8_6659_fd93);
        ((mixed >> 40) as f64 / (1u64 << 23) as f64 - 1.0) * most
    };
    let uv = |(c, &k): (usize, &u32)| {
        let of = if by_face { c / 4 } else { c } as u64;
        let [u, v] = model.uvs[k as usize].map(f64::from);
        [(u + noise(2 * of)) as f32, (v + noise(2 * of + 1)) as f32]
    };
    let uvs: Vec<[f32; 2]> = model.uv_indices.iter().enumerate().map(uv).collect();
    Model { uv_indices: (0..uvs.len() as u32).collect(), uvs, ..model.clone() }
}

/// The model with one UV per vertex: the mean of those of its corners.
fn averaged(model: &Model) -> Model {
    let mut of_vertices: BTreeMap<u32, Vec<[f32; 2]>> = BTreeMap::new();
    for (&vertex, &uv) in model.indices.iter().zip(&model.uv_indices) {
        of_vertices.entry(vertex).or_default().push(model.uvs[uv as usize]);
    }
    let mean = |uvs: &Vec<[f32; 2]>| {
        [0, 1].map(|k| (uvs.iter().map(|uv| f64::from(uv[k])).sum::<f64>() / uvs.len() as f64) as f32)
    };
    Model {
        uvs: of_vertices.values().map(mean).collect(),
        uv_indices: model.indices.clone(),
        ..model.clone()
    }
}

#[test]
fn noisy_uvs_have_the_bits_of_their_means() {
    let noises =
        vec![(1e-6, false), (1e-5, false), (1e-5, true), (5e-5, false), (1.5e-4, true), (2e-4, false)];
    for (most, by_face) in long::share(noises, 3, "noises") {
        let noisy = noisy(&sheet([0.1, 0.9]), most, by_face);
        let mean = averaged(&noisy);
        let [found, expected] = [&noisy, &mean].map(|model| {
            let mut asset = model.solved(&vrtm_testkit::cpu(1), 128, 1, &options(Quality::Normal));
            let info = asset.tile_mut(0).info().unwrap();
            assert_eq!((info.charts, info.edges_apart, info.gap_nodes), (1, 0, 0), "{most} {by_face}");
            let mut uvs = vec![[0.0; 2]; model.indices.len()];
            asset.results().corner_uvs(0, &mut uvs).unwrap();
            let refined = asset.refine(&RefinementSettings::default()).unwrap().info();
            let refined = (refined.vertices, refined.corners, refined.triangles, refined.error.to_bits());
            (info, bits(&asset), uvs, refined)
        });
        assert_eq!(found.0, expected.0, "{most} {by_face}");
        assert!(found.1 == expected.1, "other warp: {most} {by_face}");
        // Each corner keeps its own UV, so that a chart that does not move has those that the host gave.
        let away = |(a, b): (&[f32; 2], &[f32; 2])| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        let away = found.2.iter().zip(&expected.2).map(away).fold(0.0, f32::max);
        assert!(away < 8.0 * most as f32 + 1e-6, "UVs of corners: {most} {by_face}: {away}");
        assert_eq!(found.3, expected.3, "{most} {by_face}");
    }
}

#[test]
fn noise_changes_a_warp_by_little_more_than_itself() {
    for range in [[0.1, 0.9], [0.0, 1.0], [0.125, 0.875]] {
        let clean = sheet(range);
        let warp = |model: &Model| {
            let mut asset = model.solved(&vrtm_testkit::cpu(1), 128, 1, &options(Quality::Normal));
            let info = asset.tile_mut(0).info().unwrap();
            (Warp::of(&asset, 0), info.movable_nodes)
        };
        let (expected, movable) = warp(&clean);
        // A border on a line of the grid is on it up to 0.001 cell. (By more noise, part of a row of nodes is fixed
        // beside it.)
        let noises: &[f64] = if range == [0.1, 0.9] { &[1e-6, 1e-5, 5e-5] } else { &[1e-6, 5e-6] };
        for &most in noises {
            let (found, of_noisy) = warp(&noisy(&clean, most, false));
            let away = |(a, b): (&[f32; 2], &[f32; 2])| (a[0] - b[0]).hypot(a[1] - b[1]);
            let away = found.u.iter().zip(&expected.u).map(away).fold(0.0, f32::max);
            println!("{range:?} {most}: {away} cells, {movable} and {of_noisy} nodes move");
            // Cells of noise, of which a warp may make some more, and the rounding of f32 where a solve is cut short.
            let allowed = 0.01 + 4.0 * 128.0 * most as f32;
            assert!(
                of_noisy == movable && away < allowed,
                "{range:?} {most}: {away}, {of_noisy} of {movable}"
            );
        }
    }
}

/// A corner in the middle of a side makes a sliver that is as thin as the noise.
#[test]
fn corners_in_the_middle_of_a_side_fall_apart_by_no_noise() {
    // Hexagons: quads of two by one with corners in the middles of their long sides.
    let size = [32usize, 16];
    let vertex = |i: usize, j: usize| (j * (size[0] + 1) + i) as u32;
    let hexagon = |(i, j): (usize, usize)| {
        [(0, 0), (1, 0), (2, 0), (2, 1), (1, 1), (0, 1)].map(|(di, dj)| vertex(2 * i + di, j + dj))
    };
    let places = (0..=size[1]).flat_map(|j| (0..=size[0]).map(move |i| [i as f64 / 32.0, j as f64 / 16.0]));
    let places: Vec<[f64; 2]> = places.collect();
    let faces = (0..size[1]).flat_map(|j| (0..size[0] / 2).map(move |i| (i, j)));
    let indices: Vec<u32> = faces.flat_map(hexagon).collect();
    let (sin, cos) = 0.3f64.sin_cos();
    let uv = |&[x, y]: &[f64; 2]| {
        let [x, y] = [0.6 * (x - 0.5), 0.6 * (y - 0.5)];
        [0.5 + x * cos - y * sin, 0.5 + x * sin + y * cos].map(|x| x as f32)
    };
    let clean = Model {
        rest: places.iter().map(|&[x, y]| [x as f32, y as f32, 0.0]).collect(),
        face_counts: vec![6; size[0] * size[1] / 2],
        uv_indices: indices.clone(),
        indices,
        uvs: places.iter().map(uv).collect(),
        maps: sheet([0.1, 0.9]).maps,
        ..Model::default()
    };
    for most in [3e-8, 1e-7, 1e-6, 1e-5, 1e-4] {
        let info = noisy(&clean, most, false).asset(1, 128).tile_mut(0).info().unwrap();
        assert_eq!((info.charts, info.gap_nodes), (1, 0), "{most}");
    }
}

/// Noise in a part of a chart is no slit; only the outline of that part may be taken for one.
#[test]
fn noise_in_a_part_of_a_chart_holds_little() {
    let clean = sheet([0.1, 0.9]);
    let all = noisy(&clean, 2e-4, false);
    for share in [0.05, 0.15, 0.3] {
        let corners = (all.uvs.len() as f64 * share) as usize;
        let of_clean = clean.uv_indices.iter().map(|&k| clean.uvs[k as usize]);
        let part = all.uvs.iter().zip(of_clean).enumerate();
        let uvs = part.map(|(c, (noisy, clean))| if c < corners { *noisy } else { clean }).collect();
        let info = Model { uvs, ..all.clone() }.asset(1, 128).tile_mut(0).info().unwrap();
        println!("{share}: {} nodes at gaps, {} fixed", info.gap_nodes, info.fixed);
        // By the share alone it were thousands.
        assert!(info.gap_nodes < 800, "{share}: {}", info.gap_nodes);
    }
}
