use vrtm_core::fixtures::{discs, maps, posed, sheet};
use vrtm_core::grid::coverage::node_maps;
use vrtm_core::report::StrainReport;
use vrtm_core::settings::TileSettings;
use vrtm_core::strain::*;

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

/// Five by five squares of 9 x 9 nodes of grey paint, at rest. The warp makes the k-th one narrower by k times `step`.
fn narrowed(step: f32) -> StrainReport {
    let mesh = sheet(4, flat);
    let mut nodes = node_maps(&mesh.tiles[0], &maps(64, TileSettings::default(), |_, _| 1.0), [64, 64]);
    // Nodes 2..=10, 14..=22, ... along both axes; at the tile's border six nodes, which have too few edges.
    let within = |i: usize| i / 12 < 5 && (2..=10).contains(&(i % 12));
    let small = |i: usize, j: usize| i <= 1 && (62..=64).contains(&j);
    let place = |n: usize| (n % 65, n / 65);
    let paint = |(i, j): (usize, usize)| if within(i) && within(j) || small(i, j) { 0.4 } else { 0.2 };
    nodes.rigidity = (0..65 * 65).map(|n| paint(place(n))).collect();
    let narrower = |i: usize, j: usize| {
        let number = 5 * (j / 12) + i / 12;
        let x = step * number as f32 * (6.0 - (i % 12) as f32);
        [if within(i) && within(j) { x } else { 0.0 }, 0.0]
    };
    measure(&mesh, &mesh.tiles[0], &nodes, &posed(4, flat), &narrower)
}

#[test]
fn features_that_are_worse_are_counted_and_the_worst_are_listed() {
    // 72 edges along each axis and 128 diagonals: narrower by s, they have s, 0 and 1 - sqrt((1 + (1 - s)²) / 2).
    let error = |number: f64| {
        let strain = 0.01 * number;
        let slanted = 1.0 - ((1.0 + (1.0 - strain).powi(2)) / 2.0).sqrt();
        ((72.0 * strain * strain + 128.0 * slanted * slanted) / 272.0).sqrt()
    };
    let over = |least: f64| (0..25).filter(|&number| error(f64::from(number)) > least).count() as u32;
    let report = narrowed(0.01);
    assert_eq!((report.features, report.features_worse), (25, over(0.02)));
    assert!(over(0.02) > 16 && over(0.05) > 0);
    assert_eq!((report.features_strained_before, report.features_strained_after), (0, over(0.05)));
    assert_eq!(report.worst().len(), 16);
    for (worst, number) in report.worst().iter().zip((9..25).rev()) {
        let centre = [number % 5, number / 5].map(|k| (12 * k + 6) as f32 / 64.0);
        // Displacements are f32.
        assert!((f64::from(worst.after) - error(f64::from(number))).abs() < 1e-6, "{worst:?} {number}");
        assert_eq!((worst.uv, worst.area, worst.at_border), (centre, 81.0 / 4096.0, false));
        assert!(worst.before < 1e-6);
    }
    let few = narrowed(0.002);
    assert_eq!((few.features, few.features_worse as usize), (25, few.worst().len()));
    assert!(few.worst().is_sorted_by(|a, b| a.after - a.before >= b.after - b.before));
    let none = narrowed(0.0);
    assert_eq!((none.features, none.features_worse, none.worst()), (25, 0, [].as_slice()));
}
