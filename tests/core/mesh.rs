mod gaps;
mod overlaps;

use glam::DVec2;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::Result;
use vrtm_core::mesh::*;
use vrtm_core::view::Strided;

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
    Strided::from_slice(uvs.as_chunks::<2>().0)
}

/// A mesh with one UV per vertex.
fn source<'a>(
    positions: &'a [[f32; 3]],
    face_counts: Option<&'a [u32]>,
    indices: &'a [u32],
    uvs: &'a [f32],
) -> MeshSource<'a> {
    let uvs = UvSource { u: pairs(uvs), v: None, indices: Some(indices) };
    let positions = Strided::from_slice(positions);
    MeshSource { positions, face_counts, indices, uvs, ..MeshSource::default() }
}

fn build(positions: &[[f32; 3]], counts: Option<&[u32]>, indices: &[u32], uvs: &[f32]) -> Result<Mesh> {
    Mesh::new(&source(positions, counts, indices, uvs))
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
    // Two triangles with a common edge, both on its left in UV.
    let positions = [[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]];
    let uvs = [0.5, 0.2, 0.5, 0.8, 0.2, 0.4, 0.25, 0.5];
    let mesh = build(&positions, None, &[0, 1, 2, 1, 0, 3], &uvs).unwrap();
    assert_eq!(mesh.info.charts, 2);
}

#[test]
fn vertices_split_along_a_hard_edge_cut_a_chart_unless_welded_by_position() {
    let positions = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];
    let uvs = [0.1, 0.1, 0.9, 0.1, 0.9, 0.9, 0.1, 0.1, 0.9, 0.9, 0.1, 0.9];
    let corners = [0, 1, 2, 3, 4, 5];
    let mesh = build(&positions, None, &corners, &uvs).unwrap();
    assert_eq!((mesh.info.charts, mesh.info.edges_apart, mesh.info.border_edges), (2, 1, 6));
    let weld = Weld { by: WeldBy::Position, ..Weld::default() };
    let mesh = Mesh::new(&MeshSource { weld, ..source(&positions, None, &corners, &uvs) }).unwrap();
    assert_eq!((mesh.info.charts, mesh.info.edges_apart, mesh.info.border_edges), (1, 0, 4));
    assert_eq!(mesh.info.welded_edges, 1);
}

#[test]
fn faces_go_to_the_tile_of_their_centroid() {
    let (positions, indices, uvs) = strip(2, [0.9, 1.2], 0.15);
    let mesh = build(&positions, Some(&[4, 4]), &indices, &uvs).unwrap();
    // The first face's centroid is at u = 0.975, the second one's at 1.125.
    assert_eq!(mesh.tiles.iter().map(|t| t.udim).collect::<Vec<_>>(), [1011, 1012]);
    assert_eq!(mesh.info.clipped_faces, 1);
    assert_eq!(mesh.corners[0][0].tile, 0);
    assert_eq!(mesh.corners[0][4].tile, 1);
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
    let triangles = triangle::triangulate(&uv);
    assert_eq!(triangles.len(), 2);
    let area = |t: &[usize; 3]| triangle::doubled_area(t.map(|k| uv[k]));
    assert!(triangles.iter().all(|t| area(t) > 0.0), "{triangles:?}");
    let sum: f64 = triangles.iter().map(area).sum();
    assert!((sum - 0.6).abs() < 1e-12);
}

#[test]
fn charts_end_at_seams() {
    let (positions, indices, uvs) = strip(4, [0.1, 0.1], 0.2);
    // The edge between the first two quads, in both directions. The last pair is a diagonal.
    let seams = &[[2, 3], [3, 2], [0, 3]];
    let source = source(&positions, Some(&[4; 4]), &indices, &uvs);
    let mesh = Mesh::new(&MeshSource { seams, ..source }).unwrap();
    assert_eq!((mesh.info.charts, mesh.info.seams_unused, mesh.info.border_edges), (2, 1, 12));
    assert_eq!(mesh.tiles[0].charts[0].triangles, 0..2);
}

/// Found by fuzzing: the first corner of a last, empty face would be past the last corner.
#[test]
fn the_last_face_may_have_no_corners() {
    let (positions, indices, uvs) = strip(2, [0.1, 0.1], 0.1);
    for counts in [&[4, 4, 0][..], &[0, 4, 4, 0, 0]] {
        let info = build(&positions, Some(counts), &indices, &uvs).unwrap().info;
        assert_eq!((info.faces, info.faces_skipped), (counts.len() as u64, counts.len() as u64 - 2));
    }
}

#[test]
fn faces_without_texture_and_short_ones_keep_their_corners() {
    const NO: u32 = u32::MAX;
    // Quads 0 and 2 have UVs; a line and a point lie between them.
    let indices = [0, 1, 4, 3, 0, 1, 4, 1, 2, 5, 4, 0, 1, 4, 3];
    let positions: Vec<[f32; 3]> = (0..6).map(|k| [(k % 3) as f32, (k / 3) as f32, 0.0]).collect();
    let uvs = [0.1, 0.1, 0.5, 0.1, 0.9, 0.1, 0.1, 0.9, 0.5, 0.9, 0.9, 0.9];
    let build = |uv_indices: &[u32], textured_faces: Option<&[u32]>| {
        let source = source(&positions, Some(&[4, 2, 1, 4, 0, 4]), &indices, &uvs);
        let uvs = UvSource { indices: Some(uv_indices), ..source.uvs };
        Mesh::new(&MeshSource { uvs, textured_faces, ..source })
    };
    let mut without = indices;
    without[7..11].fill(NO);
    for (uv_indices, textured) in [(without, None), (indices, Some(&[5, 0, 5][..]))] {
        let info = build(&uv_indices, textured).unwrap().info;
        assert_eq!((info.faces, info.faces_skipped, info.faces_untextured), (6, 3, 1));
        assert_eq!((info.corners, info.triangles), (15, 4));
    }
    let mesh = build(&without, None).unwrap();
    let with_triangle = |c: &&Corner| c.tile == 0 && c.triangle != NONE;
    assert_eq!(mesh.corners[0].iter().filter(with_triangle).count(), 8);
    assert_eq!((mesh.corners[0][8].tile, mesh.corners[0][8].uv), (NONE, [0.0; 2]));
    // A face may not have UVs at some corners only, even if it is not textured.
    without[9] = 2;
    let partly = build(&without, Some(&[0])).unwrap_err().message;
    assert!(partly.starts_with("uvs.indices[7]: no UV"), "{partly}");
}

#[test]
fn uv_sets_have_tiles_of_their_own_one_set_after_the_other() {
    let (_, indices, uvs) = strip(3, [1.1, 0.1], 0.2);
    let per_corner: Vec<f32> = indices.iter().flat_map(|&k| [uvs[2 * k as usize] - 1.0, 2.5]).collect();
    let second = UvSource { u: pairs(&uvs), v: None, indices: Some(&indices) };
    let flat = UvSource { u: pairs(&per_corner), v: None, indices: None };
    let (positions, _, first) = strip(3, [0.1, 0.1], 0.2);
    let uv_sets = &[second, flat, second];
    let source = source(&positions, Some(&[4; 3]), &indices, &first);
    let mesh = Mesh::new(&MeshSource { uv_sets, ..source }).unwrap();
    let tiles: Vec<_> = mesh.tiles.iter().map(|t| (t.uv_set, t.udim, t.charts.len())).collect();
    assert_eq!(tiles, [(0, 1001, 1), (1, 1002, 1), (3, 1002, 1)]);
    assert_eq!((mesh.info.uv_sets, mesh.info.degenerate_triangles, mesh.info.charts), (4, 6, 3));
    assert_eq!(mesh.corners.iter().map(|c| c[0].tile).collect::<Vec<_>>(), [0, 1, NONE, 2]);
}

#[test]
fn a_vertex_is_at_the_place_of_the_first_one_within_reach() {
    let place = |x: &[f64], shortest: f64| {
        let rest: Vec<[f64; 3]> = x.iter().map(|&x| [x, 0.0, -0.0]).collect();
        weld::places(&rest, &vec![shortest; x.len()], 1.0, |_| true)
    };
    assert_eq!(place(&[0.0, 0.9, 1.8, 2.7, 0.0, -0.9], 100.0), [0, 0, 2, 2, 0, 0]);
    // The tolerance is a quarter of the shortest edge, and 0 where edges are shorter than half of the tolerance.
    assert_eq!(place(&[0.0, 0.4, 0.6], 2.0), [0, 0, 2]);
    assert_eq!(place(&[0.0, 0.1, 0.0, -0.0], 0.4), [0, 1, 0, 0]);
    // Coordinates and cells near the limits of their types.
    assert_eq!(place(&[1e300, -1e300, 1e300], f64::INFINITY), [0, 1, 0]);
}
