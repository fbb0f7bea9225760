//! Tests of the model and of its weights.

use vrtm_core::allocation::Vec;
use vrtm_core::allocation::zeroed_box;
use vrtm_core::grid::interpolation::*;
use vrtm_core::grid::planes::EDGES;
use vrtm_core::settings::TileSettings;

/// A model with a stiffness of the edges of each node (column, row) of a patch.
fn model(stiffness: impl Fn(usize, usize, usize) -> f32) -> Box<Model> {
    let mut model = zeroed_box::<Model>();
    for n in 0..PATCH * PATCH {
        let (i, j) = (n % PATCH, n / PATCH);
        for e in 0..4 {
            model.edges[i % 2][e][j][i / 2] = stiffness(i, j, e);
        }
    }
    model.collapse();
    model
}

/// A model of nodes with some rigidity, all of which may move.
fn of_rigidity(rigidity: impl Fn(usize, usize) -> f32) -> Box<Model> {
    let mut model = zeroed_box::<Model>();
    for n in 0..PATCH * PATCH {
        let (i, j) = (n % PATCH, n / PATCH);
        model.rigidity[i % 2][j][i / 2] = rigidity(i, j);
        model.movable[i % 2][j][i / 2] = 1.0;
    }
    model.at_rest(&TileSettings::default());
    model.collapse();
    model
}

fn random(seed: &mut u32) -> f32 {
    *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*seed >> 8) as f32 / (1 << 24) as f32
}

/// Σ s (u_a - u_b)² over the edges of nodes in `nodes`, row by row.
fn energy(
    [columns, rows]: [usize; 2],
    stiffness: impl Fn(usize, usize, usize) -> f32,
    u: impl Fn(usize, usize) -> f32,
) -> f64 {
    let mut sum = 0.0;
    for (i, j) in (0..columns * rows).map(|n| (n % columns, n / columns)) {
        for (e, (di, dj)) in EDGES.into_iter().enumerate() {
            let s = stiffness(i, j, e);
            if s != 0.0 {
                let d = u(i, j) - u((i as i64 + di) as usize, (j as i64 + dj) as usize);
                sum += f64::from(s) * f64::from(d * d);
            }
        }
    }
    sum
}

/// Interpolates the values at even columns and rows to a node, with the model's weights.
fn interpolated(model: &Model, coarse: &impl Fn(usize, usize) -> f32, i: usize, j: usize) -> f32 {
    let in_y = |i: usize| match j % 2 {
        0 => coarse(i, j / 2),
        _ => {
            let weight = model.south[j][i];
            coarse(i, j / 2) * weight + coarse(i, j / 2 + 1) * (1.0 - weight)
        }
    };
    match i % 2 {
        0 => in_y(i / 2),
        _ => {
            let weight = model.west[j][i / 2];
            in_y(i / 2) * weight + in_y(i / 2 + 1) * (1.0 - weight)
        }
    }
}

#[test]
fn the_coarser_level_is_the_galerkin_product() {
    let mut seed = 7;
    // Edges between nodes of columns and rows 12 to 36: the coarser ones are all in the block.
    let inside = |i: usize, j: usize, e: usize| {
        let far = [i as i64 + EDGES[e].0, j as i64 + EDGES[e].1];
        [i as i64, j as i64].into_iter().chain(far).all(|x| (12..=36).contains(&x))
    };
    let values: Vec<f32> = (0..4 * PATCH * PATCH).map(|_| random(&mut seed).powi(8)).collect();
    let mut stiffness: Vec<f32> = (0..4 * PATCH * PATCH)
        .map(|n| if inside(n / 4 % PATCH, n / 4 / PATCH, n % 4) { values[n] } else { 0.0 })
        .collect();
    for _ in 0..3 {
        let fine = |i: usize, j: usize, e: usize| stiffness[4 * (j * PATCH + i) + e];
        let model = model(fine);
        let coarse: Vec<f32> = (0..COLUMNS * COLUMNS).map(|_| random(&mut seed)).collect();
        let coarse_u = |i: usize, j: usize| coarse[j * COLUMNS + i];
        let coarser = |i: usize, j: usize, e: usize| match [i, j].iter().all(|x| OWN.contains(x)) {
            true => model.coarser[e][j][i],
            false => 0.0,
        };
        let a = energy([PATCH; 2], fine, |i, j| interpolated(&model, &coarse_u, i, j));
        let b = energy([COLUMNS; 2], coarser, coarse_u);
        assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
        // The coarser level, in the middle of a patch again.
        let moved = |n: usize| {
            let at = [n / 4 % PATCH, n / 4 / PATCH].map(|x| x.wrapping_sub(12));
            if at.iter().all(|&x| x < COLUMNS) { coarser(at[0], at[1], n % 4) } else { 0.0 }
        };
        stiffness = (0..4 * PATCH * PATCH).map(moved).collect();
    }
}

#[test]
fn one_material_is_halved() {
    for rigidity in [0.0, 0.3, 1.0] {
        let model = of_rigidity(|_, _| rigidity);
        let half = |weight: f32| (weight - 0.5).abs() < 1e-6;
        assert!((MARGIN..MARGIN + 32).all(|j| OWN.clone().all(|i| half(model.west[j][i]))), "{rigidity}");
        let rows = (MARGIN + 1..MARGIN + 32).step_by(2);
        assert!(rows.clone().all(|j| OWN.clone().all(|i| half(model.south[j][i]))), "{rigidity}");
    }
}

#[test]
fn the_stiffer_side_weighs_more() {
    // Rigid to the west of column 20, including the edges up to it. Column 19 lies in rigid material, column 21 in
    // elastic material.
    let model = of_rigidity(|i, _| if i < 20 { 1.0 } else { 0.0 });
    let at = |i: usize| model.west[20][i / 2];
    assert!((at(19) - 0.5).abs() < 1e-6 && (at(21) - 0.5).abs() < 1e-6, "{} {}", at(19), at(21));
    // Rigid up to column 18: the stiffness to the west of column 19 is 0.5 + λ0 times the stiffness to its east.
    let model = of_rigidity(|i, _| if i < 19 { 1.0 } else { 0.0 });
    let settings = TileSettings::default();
    let (rigid, elastic) = (0.5 + settings.smoothness_floor, settings.smoothness + settings.smoothness_floor);
    assert!((model.west[20][9] - rigid / (rigid + elastic)).abs() < 1e-6);
    // The same test along y.
    let model = of_rigidity(|_, j| if j < 19 { 1.0 } else { 0.0 });
    assert!((model.south[19][10] - rigid / (rigid + elastic)).abs() < 1e-6);
}
