//! What is carried coincides with what is painted, found by inverting the map: also beside seams, in layers, in a
//! second UV set.

use super::sheet::{
    Layout, P2, P3, Sheet, by_uv, disc, distance, fetch, lattice, map, on_chart, parameter, solve, uv,
};
use super::warped;
use vrtm::{Fit, Seams, TileSettings};

const GRID: u32 = 64;

/// Stretched most beside the middle, where the seam of a cut sheet is, so that texture moves over it.
fn pulled([x, y]: P2) -> P3 {
    let s = x - 0.1 * (std::f64::consts::TAU * (x - 0.08)).sin();
    [s.sin(), y * (1.0 + 0.2 * x), 1.0 - s.cos()]
}

/// Binds points at what the map shows at the centres of texels, and compares where they are carried with the places of
/// these texels on the sheet in the pose. Returns the number of points, and the errors in cells, ascending.
fn rims(layout: Layout, seams: Seams, tile: usize, copy: usize) -> Vec<f64> {
    let sheet = Sheet::new(24, layout, |[x, y]| [x, y, 0.0]);
    let settings = TileSettings { seams, seam_reach: 0.125, ..TileSettings::default() };
    let rigid =
        |p: P2| disc([0.47, 0.5], 0.12)(p).max(disc([0.2, 0.25], 0.1)(p)).max(disc([0.8, 0.7], 0.1)(p));
    let mut asset = sheet.asset(2, GRID, rigid, settings);
    let pose = sheet.pose(pulled);
    // Carriers follow the solves that come after they are made; a first one shows what the map is.
    solve(&mut asset, &pose);
    let size = 2 * GRID as usize;
    let texels = map(&asset, tile, size);
    let (mut points, mut expected, mut crossings) = (Vec::new(), Vec::new(), 0);
    for (k, shown) in texels.iter().enumerate() {
        let centre = [k % size, k / size].map(|n| (n as f64 + 0.5) / size as f64);
        let Some((right, place)) = on_chart(layout, centre) else { continue };
        // Beyond a seam the plane of the chart goes on.
        let p = parameter(layout, *shown, right);
        if !p.iter().all(|x| (0.0..=1.0).contains(x)) {
            continue;
        }
        let natural = if layout == Layout::Cut { p[0] > 0.5 } else { right };
        crossings += usize::from(natural != right);
        points.push(uv(layout, p, natural));
        expected.push(sheet.at(&pose, place, copy));
    }
    let set = u32::from(layout == Layout::SecondSet);
    let carrier = if copy == 0 {
        by_uv(&asset, &points, None, Fit::Surface, set)
    } else {
        let pairs: Vec<[f32; 2]> = points.iter().map(|uv| uv.map(|x| x as f32)).collect();
        let layers = vec![copy as u32; points.len()];
        let by = vrtm::Bind::Uv { uvs: vrtm::Strided::from_slice(&pairs), layers: Some(&layers) };
        asset.carrier(&vrtm::CarrierSettings { fit: Fit::Surface, ..vrtm::CarrierSettings::new(by) }).unwrap()
    };
    solve(&mut asset, &pose);
    let all = fetch(&carrier);
    let cell = 1.0 / (0.9 * f64::from(GRID));
    let mut errors: Vec<f64> =
        all.positions.iter().zip(&expected).map(|(a, b)| distance(*a, *b) / cell).collect();
    errors.sort_by(f64::total_cmp);
    let most = errors.len() - 1;
    println!(
        "{layout:?} {seams:?} {copy}: {most} points, median {:e}, 99 % {:e}, most {:e}",
        errors[most / 2],
        errors[most * 99 / 100],
        errors[most]
    );
    assert!(errors.len() > 5000);
    assert!(
        (crossings > 10) == (seams == Seams::Continue),
        "{crossings} texels show what lies beyond the seam"
    );
    errors
}

#[test]
fn painted_rims_coincide() {
    for (layout, tile, copy) in [
        (Layout::Whole, 0, 0),
        (Layout::Cut, 0, 0),
        (Layout::Stacked, 0, 0),
        (Layout::Stacked, 1, 1),
        (Layout::SecondSet, 0, 0),
    ] {
        let errors = rims(layout, Seams::Shut, tile, copy);
        assert!(errors[errors.len() - 1] < 0.05, "{layout:?}: {}", errors[errors.len() - 1]);
    }
}

#[test]
fn painted_rims_coincide_beyond_seams() {
    let errors = rims(Layout::Cut, Seams::Continue, 0, 0);
    // Where the gutter is too narrow for a redirection, and where the blend had to stop, the two charts' maps
    // themselves differ.
    let apart = errors.iter().filter(|error| **error > 0.05).count();
    assert!(1000 * apart < 5 * errors.len() && errors[errors.len() - 1] < 0.5, "{apart}");
}

/// A feature over a seam is one body, with both sides' points.
#[test]
fn a_feature_over_a_seam_is_one_body() {
    for seams in [Seams::Continue, Seams::Shut] {
        let sheet = Sheet::new(24, Layout::Cut, |[x, y]| [x, y, 0.0]);
        let settings = TileSettings { seams, ..TileSettings::default() };
        let mut asset = sheet.asset(1, 128, disc([0.5, 0.5], 0.12), settings);
        let points: Vec<P2> = lattice(8).iter().map(|p| p.map(|x| 0.43 + 0.14 * x)).collect();
        let uvs: Vec<P2> = points.iter().map(|p| uv(Layout::Cut, *p, p[0] > 0.5)).collect();
        let carrier = by_uv(&asset, &uvs, None, Fit::Feature, 0);
        solve(&mut asset, &sheet.pose(warped));
        let all = fetch(&carrier);
        assert_eq!(carrier.info().features, 1, "{seams:?}");
        let rest = |k: usize| -> P3 { [points[k][0], points[k][1], 0.0] };
        for a in 0..points.len() {
            for b in 0..a {
                let change = distance(all.positions[a], all.positions[b]) / distance(rest(a), rest(b)) - 1.0;
                assert!(change.abs() < 1e-5, "{seams:?} {a} {b}: {change}");
            }
        }
    }
}

#[test]
fn frames_do_not_jump_at_seams() {
    let sheet = Sheet::new(24, Layout::Cut, |[x, y]| [x, y, 0.0]);
    let settings = TileSettings { seams: Seams::Continue, ..TileSettings::default() };
    let mut asset = sheet.asset(1, 64, disc([0.47, 0.5], 0.12), settings);
    let points: Vec<P2> = (0..60)
        .flat_map(|k| [[0.5 - 1e-6, f64::from(k) / 60.0 + 0.01], [0.5 + 1e-6, f64::from(k) / 60.0 + 0.01]])
        .collect();
    let uvs: Vec<P2> = points.iter().map(|p| uv(Layout::Cut, *p, p[0] > 0.5)).collect();
    let carrier = by_uv(&asset, &uvs, None, Fit::Surface, 0);
    solve(&mut asset, &sheet.pose(warped));
    let all = fetch(&carrier);
    let cell = 1.0 / (0.85 * 64.0);
    for k in (0..points.len()).step_by(2) {
        let apart = distance(all.positions[k], all.positions[k + 1]) / cell;
        assert!(apart < 0.1, "both sides of the seam are apart by {apart} cells at {k}");
        let turned =
            (0..9).map(|c| (all.rotations[k][c] - all.rotations[k + 1][c]).abs()).fold(0.0, f64::max);
        assert!(turned < 0.1, "{k}: {turned}");
    }
}
