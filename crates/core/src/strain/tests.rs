use super::*;
use crate::fixtures::{discs, maps, posed, sheet};
use crate::grid::coverage::node_maps;
use crate::settings::TileSettings;

fn flat(u: f64, v: f64) -> [f64; 3] {
    [u, v, 0.0]
}

#[test]
fn a_stretched_sheet_has_the_strain_it_was_given() {
    // Stretched by s along x: horizontal edges have strain s - 1, vertical ones 0, diagonal ones sqrt((1 + s²)/2) - 1.
    let mesh = sheet(8, flat);
    let pose = posed(8, |u, v| [1.5 * u, v, 0.0]);
    let maps = maps(64, TileSettings::default(), |_, _| 1.0);
    let nodes = node_maps(&mesh.tiles[0], &maps, [64, 64]);
    let report = measure(&mesh, &mesh.tiles[0], &nodes, &pose, &|_, _| [0.0; 2]);
    let diagonal = (3.25f64 / 2.0).sqrt() - 1.0;
    // 63 x 63 nodes move: 64 x 63 edges along each axis, and 64 x 64 cells with two diagonals, except one diagonal in
    // each of the four corner cells.
    let (axis, slanted) = (64.0 * 63.0, 2.0 * 64.0 * 64.0 - 4.0);
    assert_eq!(report.segments, (2.0 * axis + slanted) as u64);
    let rms = ((axis * 0.25 + slanted * diagonal * diagonal) / (2.0 * axis + slanted)).sqrt();
    // The results are f32.
    assert!((f64::from(report.before.rms) - rms).abs() < 1e-6, "{} {rms}", report.before.rms);
    assert!((f64::from(report.before.max) - 0.5).abs() < 1e-6);
    assert!((f64::from(report.before.median) - diagonal).abs() < 1e-6);
    assert_eq!(report.before, report.after);
    assert_eq!((report.harm, report.help), (0.0, 0.0));
    // Both ends are fixed for the edges of the tile's rim, and for one diagonal in each of its corners.
    assert_eq!(report.segments_fixed, 4 * 64 + 4);
    let rms = ((128.0 * 0.25 + 4.0 * diagonal * diagonal) / 260.0f64).sqrt();
    assert!((f64::from(report.fixed) - rms).abs() < 1e-6, "{} {rms}", report.fixed);
}

#[test]
fn a_warp_that_undoes_the_stretch_is_help_and_its_reverse_is_harm() {
    let mesh = sheet(1, flat);
    let maps = maps(64, TileSettings::default(), |u, _| f64::from(u8::from((0.25..0.75).contains(&u))));
    let nodes = node_maps(&mesh.tiles[0], &maps, [64, 64]);
    // The whole sheet twice as long; features shrink to half their UV length about the middle.
    let pose = posed(1, |u, v| [2.0 * u, v, 0.0]);
    let shrink = |i: usize, _: usize| [-0.5 * (i as f32 - 32.0), 0.0];
    let moving = |i: usize, j: usize| if (1..64).contains(&j) { shrink(i, j) } else { [0.0; 2] };
    let report = measure(&mesh, &mesh.tiles[0], &nodes, &pose, &moving);
    assert!(report.before.rms > 0.5);
    // Away from the fixed rows at the tile's rim, no strain remains.
    assert!(report.after.interior_rms < 1e-6, "{}", report.after.interior_rms);
    assert!(report.after.border_rms > 0.1);
    assert!(report.help > 0.5);
    let mirror = posed(1, flat);
    let report = measure(&mesh, &mesh.tiles[0], &nodes, &mirror, &moving);
    assert!(report.before.max < 1e-6 && report.harm > 0.2 && report.help == 0.0);
}

#[test]
fn borders_are_ten_cells_wide() {
    let mesh = sheet(2, flat);
    let maps = maps(64, TileSettings::default(), discs);
    let near = near_border(&node_maps(&mesh.tiles[0], &maps, [64, 64]));
    let within = |i: usize, j: usize| i.min(j).min(64 - i).min(64 - j) <= BORDER;
    for j in 0..=64 {
        for i in 0..=64 {
            assert_eq!(near[j * 65 + i], within(i, j), "{i} {j}");
        }
    }
}
