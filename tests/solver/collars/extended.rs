//! Charts of a flat sheet that is cut in the middle, extended.

use glam::{DMat2, DVec2};

use super::{Sheet, flat};
use vrtm_beyond::extended;
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::settings::Beyond;
use vrtm_core::team::Team;

const REACH: f64 = 0.06;
const SEAMS: Beyond = Beyond { seams: true, open_borders: false, reach: REACH };

fn cut(shift: DVec2) -> (Sheet, TileMesh) {
    let sheet = Sheet { n: 20, cut: 10, point: flat, turn: DMat2::IDENTITY, shift, closed: false };
    let mesh = sheet.mesh();
    let tile = Team::with(2, |team| extended(team, &mesh, 0, &SEAMS, &[]));
    (sheet, tile)
}

#[test]
fn both_charts_go_on_as_the_sheet_does() {
    let (sheet, tile) = cut(DVec2::new(0.25, 0.0));
    let mesh = sheet.mesh();
    let own = tile.own();
    assert_eq!(own, mesh.tiles[0].triangles.len());
    assert_eq!(tile.sources.len(), tile.charts.iter().map(|chart| chart.collar.len()).sum::<usize>());
    for (c, chart) in tile.charts.iter().enumerate() {
        let collar = chart.collar.clone();
        assert!(!collar.is_empty());
        for t in collar.clone() {
            assert_eq!(tile.chart_of_triangle(t as u32), c as u32);
            let (triangle, source) = (&tile.triangles[t], tile.source(t).unwrap());
            let (mut deepest, mut least) = (0.0f32, 1.0f32);
            for k in 0..3 {
                // The second chart lies a quarter farther to the right than the sheet does.
                let on_sheet = triangle.uv[k] - if c == 0 { DVec2::ZERO } else { sheet.shift };
                let [x, y, _] = chart.value(triangle.local[k], |v| mesh.rest[v as usize]);
                let expected = DVec2::splat(0.1) + 0.5 * DVec2::new(x, y);
                assert!(on_sheet.distance(expected) < 1e-6, "{on_sheet} {expected}");
                (deepest, least) = (deepest.max(source.depth[k]), least.min(source.depth[k]));
            }
            assert!((0.0..=1.0).contains(&least) && (0.0..=1.0).contains(&deepest));
            let begins = triangle.neighbours.iter().any(|&n| (n as usize) < own);
            let ends = triangle.neighbours.contains(&NONE);
            assert!(!begins || deepest == 1.0, "the collar's beginning has the depth {deepest}");
            assert!(!ends || least == 0.0, "the collar's end has the depth {least}");
            // A neighbour in the collar knows this triangle, and one of the chart goes on into the collar.
            for &n in triangle.neighbours.iter().filter(|&&n| n != NONE) {
                let back = tile.triangles[n as usize].neighbours;
                let known = if (n as usize) < own { collar.clone() } else { t..t + 1 };
                assert!(back.iter().any(|&b| b != NONE && known.contains(&(b as usize))));
            }
        }
        let borders = |tile: &TileMesh| {
            let sides = tile.triangles[chart.triangles.clone()].iter().flat_map(|t| t.neighbours);
            sides.filter(|&n| n == NONE).count()
        };
        // The sides along the cut, one for each of the rows.
        assert_eq!(borders(&mesh.tiles[0]) - borders(&tile), 20);
    }
}

/// Neither chart of a seam goes on where one of them has no collar, since only the other one could move there.
#[test]
fn one_sided_seams_are_shut() {
    // The second chart begins at the tile's border: what lies beyond its seam lies outside.
    let (turn, shift) = (DMat2::from_diagonal(DVec2::splat(0.6)), DVec2::new(-0.21, 0.62));
    let sheet = Sheet { n: 20, cut: 10, point: flat, turn, shift, closed: false };
    let mesh = sheet.mesh();
    let tile = Team::with(2, |team| extended(team, &mesh, 0, &SEAMS, &[]));
    assert!(tile.sources.is_empty() && tile.cuts.is_empty());
    let before = &mesh.tiles[0].triangles;
    assert!(before.iter().zip(&tile.triangles).all(|(a, b)| a.neighbours == b.neighbours));
    // The second chart in another tile, which goes on or does not.
    let sheet = Sheet { turn: DMat2::IDENTITY, shift: DVec2::new(1.0, 0.0), ..sheet };
    let mesh = sheet.mesh();
    let [goes_on, stays] =
        [&[][..], &[1]].map(|stay| Team::with(2, |team| extended(team, &mesh, 0, &SEAMS, stay)));
    assert!(!goes_on.sources.is_empty() && stays.sources.is_empty());
}

#[test]
fn charts_over_one_another_end_where_they_end() {
    let (sheet, tile) = cut(DVec2::new(-0.1, 0.0));
    assert!(tile.sources.is_empty() && tile.charts.iter().all(|chart| chart.points.is_empty()));
    let before = &sheet.mesh().tiles[0].triangles;
    assert!(before.iter().zip(&tile.triangles).all(|(a, b)| a.neighbours == b.neighbours && a.uv == b.uv));
}

#[test]
fn a_collar_ends_where_its_own_chart_lies() {
    fn tube(x: f64, y: f64) -> [f32; 3] {
        let (sin, cos) = (std::f64::consts::TAU * x).sin_cos();
        [sin as f32, (6.2 * y) as f32, cos as f32]
    }
    // A tube whose left and right border are one: its collar lies beyond both.
    let sheet =
        Sheet { n: 24, cut: 24, point: tube, turn: DMat2::IDENTITY, shift: DVec2::ZERO, closed: true };
    let mesh = sheet.mesh();
    let tile = Team::with(2, |team| extended(team, &mesh, 0, &SEAMS, &[]));
    let low_high = |range: std::ops::Range<usize>| {
        let xs = tile.triangles[range].iter().flat_map(|t| t.uv.map(|uv| uv.x));
        xs.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
    };
    let chart = &tile.charts[0];
    let [low, high] = low_high(chart.triangles.clone());
    assert!(!chart.collar.is_empty());
    for triangle in &tile.triangles[chart.collar.clone()] {
        let middle = (triangle.uv[0].x + triangle.uv[1].x + triangle.uv[2].x) / 3.0;
        assert!(!(low..high).contains(&middle), "{middle} is on the chart");
    }
}

/// Beyond the open borders of a flat sheet its mirror image lies where the plane of the sheet goes on.
#[test]
fn open_borders_go_on_as_their_mirror_image() {
    let sheet =
        Sheet { n: 20, cut: 20, point: flat, turn: DMat2::IDENTITY, shift: DVec2::ZERO, closed: false };
    let mesh = sheet.mesh();
    let borders = Beyond { open_borders: true, ..SEAMS };
    let tile = Team::with(2, |team| extended(team, &mesh, 0, &borders, &[]));
    let chart = &tile.charts[0];
    assert!(chart.collar.len() > 4 * 20);
    let [low, high] = [0.1, 0.6];
    let is_in = |x: f64| (low - 1e-9..=high + 1e-9).contains(&x);
    for t in chart.collar.clone() {
        let (triangle, source) = (&tile.triangles[t], tile.source(t).unwrap());
        assert!(source.image);
        for k in 0..3 {
            let at = |v: u32| mesh.rest[v as usize];
            let [x, y, z] = chart.position(triangle.local[k], at);
            let expected = DVec2::splat(0.1) + 0.5 * DVec2::new(x, y);
            assert!(triangle.uv[k].distance(expected) < 1e-6 && z.abs() < 1e-6, "{expected}");
            // It is the image of the point that lies as far inside.
            let mirrored = |x: f64| if x < low { 2.0 * low - x } else { 2.0 * high - x };
            let inside = triangle.uv[k].to_array().map(|x| if is_in(x) { x } else { mirrored(x) });
            assert!(source.uv[k].distance(inside.into()) < 1e-6);
            let [x, y, _] = chart.value(triangle.local[k], at);
            assert!(DVec2::from(inside).distance(DVec2::splat(0.1) + 0.5 * DVec2::new(x, y)) < 1e-6);
        }
        // Nothing lies beyond the corners, at which images end.
        let middle = (triangle.uv[0] + triangle.uv[1] + triangle.uv[2]) / 3.0;
        assert!(is_in(middle.x) || is_in(middle.y), "{middle}");
    }
    let open = tile.triangles[chart.triangles.clone()].iter().flat_map(|t| t.neighbours);
    assert_eq!(open.filter(|&n| n == NONE).count(), 0, "every side goes on");
    // Seams alone do not open borders.
    let shut = Team::with(2, |team| extended(team, &mesh, 0, &SEAMS, &[]));
    assert!(shut.charts[0].collar.is_empty());
}
