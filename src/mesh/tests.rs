use super::*;

/// A row of `n` unit quads of UV size `size`, beginning at `origin`.
fn strip(n: u32, origin: [f32; 2], size: f32) -> (Vec<[f32; 3]>, Vec<u32>, Vec<f32>) {
    let mut positions = Vec::new();
    let mut uvs = Vec::new();
    for i in 0..=n {
        for j in 0..2 {
            positions.push([i as f32, j as f32, 0.0]);
            uvs.extend([origin[0] + i as f32 * size, origin[1] + j as f32 * size]);
        }
    }
    let indices = (0..n).flat_map(|i| [2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1]).collect();
    (positions, indices, uvs)
}

fn pairs(uvs: &[f32]) -> Strided<'_> {
    // SAFETY: any byte of an f32 may be read.
    let bytes = unsafe { std::slice::from_raw_parts(uvs.as_ptr().cast::<u8>(), uvs.len() * 4) };
    Strided::new("uvs.u", bytes, crate::view::Scalar::F32, 2, uvs.len() / 2, 0).unwrap()
}

fn build(positions: &[[f32; 3]], counts: Option<&[u32]>, indices: &[u32], uvs: &[f32]) -> Result<Mesh> {
    let uvs = UvSource { u: pairs(uvs), v: None, indices: Some(indices) };
    let positions = Strided::from_f32x3(positions);
    Mesh::new(&MeshSource { positions, face_counts: counts, indices, uvs })
}

#[test]
fn a_strip_is_one_chart_with_neighbours_on_both_sides() {
    let (positions, indices, uvs) = strip(3, [0.1, 0.1], 0.1);
    let mesh = build(&positions, Some(&[4, 4, 4]), &indices, &uvs).unwrap();
    assert_eq!((mesh.info.triangles, mesh.info.charts, mesh.info.tiles), (6, 1, 1));
    let tile = &mesh.tiles[0];
    assert_eq!(tile.udim, 1001);
    let links = tile.triangles.iter().flat_map(|t| t.neighbours).filter(|&n| n != NONE).count();
    // Five inner edges, seen from both sides.
    assert_eq!(links, 10);
    for (t, triangle) in tile.triangles.iter().enumerate() {
        for &n in triangle.neighbours.iter().filter(|&&n| n != NONE) {
            assert!(tile.triangles[n as usize].neighbours.contains(&(t as u32)));
        }
    }
}

#[test]
fn a_half_folded_onto_the_other_is_a_chart_of_its_own() {
    // Two triangles with a common edge, both to its left in UV.
    let positions = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]];
    let uvs = [0.5, 0.2, 0.5, 0.8, 0.2, 0.4, 0.25, 0.5];
    let mesh = build(&positions, None, &[0, 1, 2, 1, 0, 3], &uvs).unwrap();
    assert_eq!(mesh.info.charts, 2);
}

#[test]
fn vertices_split_along_a_hard_edge_do_not_cut_a_chart() {
    let positions = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let uvs = [0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.1, 0.9, 0.9, 0.1, 0.9];
    let mesh = build(&positions, None, &[0, 1, 2, 3, 4, 5], &uvs).unwrap();
    assert_eq!(mesh.info.charts, 1);
}

#[test]
fn faces_go_to_the_tile_of_their_centroid() {
    let (positions, indices, uvs) = strip(2, [0.9, 1.2], 0.15);
    let mesh = build(&positions, Some(&[4, 4]), &indices, &uvs).unwrap();
    // The first face's centroid is at u = 0.975, the second one's at 1.125.
    assert_eq!(mesh.tiles.iter().map(|t| t.udim).collect::<Vec<_>>(), [1011, 1012]);
    assert_eq!(mesh.info.clipped_faces, 1);
    assert_eq!(mesh.corners[0].tile, 0);
    assert_eq!(mesh.corners[4].tile, 1);
    let (positions, indices, uvs) = strip(1, [-0.9, 0.2], 0.15);
    let mesh = build(&positions, Some(&[4]), &indices, &uvs).unwrap();
    assert_eq!((mesh.info.faces_outside, mesh.info.tiles), (1, 0));
}

#[test]
fn triangles_without_uv_area_are_dropped_and_counted() {
    let positions = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];
    let uvs = [0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.9, 0.5];
    let mesh = build(&positions, None, &[0, 1, 2, 1, 3, 2], &uvs).unwrap();
    assert_eq!((mesh.info.triangles, mesh.info.degenerate_triangles), (1, 1));
}

#[test]
fn a_concave_polygon_is_cut_into_triangles_of_one_sign() {
    // An arrow head: the fan around its first corner would flip.
    let uv = [[0.0, 0.0], [0.5, 0.4], [1.0, 0.0], [0.5, 1.0]].map(DVec2::from);
    let triangles = triangulate::polygon(&uv);
    assert_eq!(triangles.len(), 2);
    let area = |t: &[usize; 3]| triangle::doubled_area(t.map(|k| uv[k]));
    assert!(triangles.iter().all(|t| area(t) > 0.0), "{triangles:?}");
    let sum: f64 = triangles.iter().map(area).sum();
    assert!((sum - 0.6).abs() < 1e-12);
}

#[test]
fn bad_arrays_are_named_with_the_index() {
    let (mut positions, mut indices, uvs) = strip(2, [0.1, 0.1], 0.1);
    let message = |r: Result<Mesh>| r.unwrap_err().message;
    assert!(message(build(&positions, Some(&[4, 3]), &indices, &uvs)).starts_with("face_counts"));
    assert!(message(build(&positions, Some(&[4, 2, 2]), &indices, &uvs)).starts_with("face_counts[1]"));
    assert!(message(build(&positions, None, &indices, &uvs)).starts_with("indices: 8"));
    indices[5] = 6;
    let out_of_range = message(build(&positions, Some(&[4, 4]), &indices, &uvs));
    assert!(out_of_range.starts_with("indices[5]: vertex 6"), "{out_of_range}");
    indices[5] = 4;
    positions[3][1] = f32::NAN;
    let nan = message(build(&positions, Some(&[4, 4]), &indices, &uvs));
    assert!(nan.starts_with("positions[3]: component 1"), "{nan}");
    assert!(build(&[], None, &[], &[]).is_err());
}
