//! Each line of the log has a code, a tile and values. Words are for people: no test looks for them. `set_maps`,
//! `grid`, `prepare` and the stretch of poses in tests/solver test the codes of maps, settings and poses.

use vrtm::{Asset, Device, LogCode, LogLevel, MeshSource, Strided, UvSource};
use vrtm_testkit::log::{Line, Lines, listened};

/// Code, UDIM number and values of the lines; those that tell facts alone are no warnings.
fn said(lines: &Lines) -> Vec<(LogCode, Option<u32>, Vec<f64>)> {
    let line = |Line { level, code, udim, values }| {
        let facts = [LogCode::Device, LogCode::Mesh, LogCode::Tile, LogCode::Grid];
        assert_eq!(level == LogLevel::Info, facts.contains(&code), "{code:?}");
        (code, udim, values)
    };
    lines.take().into_iter().map(line).collect()
}

#[test]
fn lines_about_a_mesh_have_its_numbers() {
    let uvs: [[f32; 2]; 15] = [
        // Two triangles with a common edge, but no common vertices.
        [[0.1, 0.1], [0.4, 0.1], [0.1, 0.4]],
        [[0.4, 0.1], [0.4, 0.4], [0.1, 0.4]],
        // One that reaches out of its tile, one in no tile, and one without area.
        [[0.6, 0.1], [1.1, 0.1], [0.6, 0.4]],
        [[-0.9, 0.1], [-0.6, 0.1], [-0.9, 0.4]],
        [[0.7, 0.7]; 3],
    ]
    .concat()
    .try_into()
    .unwrap();
    let mut rest = uvs.map(|[u, v]| [10.0 * u, 10.0 * v, 0.0]);
    rest[14][2] = 1.0;
    let indices: Vec<u32> = (0..15).collect();
    let make = |device: &Device, rest: &[[f32; 3]]| {
        let uvs = UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&indices) };
        let positions = Strided::from_slice(rest);
        let seams = &[[0, 3]];
        Asset::new(device, &MeshSource { positions, indices: &indices, uvs, seams, ..MeshSource::default() })
            .unwrap()
    };
    let (device, lines) = listened();
    let mut asset = make(&device, &rest);
    let (info, tile) = (asset.info(), asset.tile_mut(0).info().unwrap());
    let said_of_it = said(&lines);
    let mesh = [
        info.vertices,
        info.faces,
        info.faces_skipped,
        info.faces_untextured,
        info.triangles,
        info.tiles.into(),
    ];
    let of_tile =
        [tile.triangles, tile.charts.into(), tile.border_edges, tile.welded_edges, tile.edges_apart];
    let numbers = |numbers: &[u64]| numbers.iter().map(|&n| n as f64).collect::<Vec<_>>();
    let grid = [tile.movable_nodes, tile.grid[0].into(), tile.grid[1].into(), 0, 0];
    assert_eq!(
        said_of_it,
        [
            (LogCode::Device, None, vec![1.0]),
            (LogCode::Mesh, None, numbers(&mesh)),
            (LogCode::Tile, Some(1001), numbers(&of_tile)),
            (LogCode::FacesClipped, None, vec![1.0]),
            (LogCode::FacesOutside, None, vec![1.0]),
            (LogCode::TrianglesDegenerate, None, vec![1.0]),
            (LogCode::EdgesApart, None, vec![1.0]),
            (LogCode::SeamsUnused, None, vec![1.0]),
            (LogCode::Grid, Some(1001), numbers(&grid)),
        ]
    );
    assert_eq!(mesh[..2], [15, 5]);

    make(&device, &[[1.0; 3]; 15]);
    assert_eq!(said(&lines).last(), Some(&(LogCode::RestIsPoint, None, vec![])));
}

/// A sheet whose UVs are folded in half: all of it overlaps.
#[test]
fn overlaps_have_their_share() {
    let rest = [
        [0.0f32, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
        [2.0, 0.0, 0.0],
        [2.0, 1.0, 0.0],
    ];
    let uvs = [[0.1f32, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9], [0.1, 0.1], [0.1, 0.9]];
    let indices = [0, 1, 2, 3, 1, 4, 5, 2];
    let (device, lines) = listened();
    let mut asset = Asset::new(
        &device,
        &MeshSource {
            positions: Strided::from_slice(&rest),
            face_counts: Some(&[4, 4]),
            indices: &indices,
            uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&indices) },
            ..MeshSource::default()
        },
    )
    .unwrap();
    asset.set_vertex_rigidity(Some(Strided::from_slice(&[1.0; 6]))).unwrap();
    let info = asset.tile_mut(0).info().unwrap();
    let lines = said(&lines);
    let values =
        |code| lines.iter().find(|line| line.0 == code).map(|(_, udim, values)| (*udim, values.clone()));
    assert_eq!(values(LogCode::Overlap), Some((Some(1001), vec![info.overlap.into()])));
    let (_, grid) = values(LogCode::Grid).unwrap();
    let overlapped = info.rigid_overlapped as f32 / info.rigid_nodes as f32;
    assert_eq!(grid[3..], [info.fixed, overlapped].map(f64::from));
    assert!(info.overlap > 0.9 && overlapped > 0.9, "{info:?}");
}
