//! The reference solver itself: its gradient, its linear solver, its minima.

use vrtm_core::fixtures::{discs, maps, posed, sheet};
use vrtm_core::grid::coverage::node_maps;
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::mesh::{Mesh, MeshSource, UvSource};
use vrtm_core::settings::TileSettings;
use vrtm_core::view::Strided;
use vrtm_testkit::random::Random;
use vrtm_testkit::reference::energy::Shape;
use vrtm_testkit::reference::minimise::Options;
use vrtm_testkit::reference::*;

/// Two sheets of 8 x 8 quads in one tile, with a gap between them.
fn two_sheets() -> Mesh {
    let (mut positions, mut uvs, mut indices) = (Vec::new(), Vec::<f32>::new(), Vec::new());
    for (s, left) in [0.0f32, 0.5].into_iter().enumerate() {
        for k in 0..81u32 {
            let (u, v) = (left + 0.03 + 0.42 * (k % 9) as f32 / 8.0, 0.05 + 0.9 * (k / 9) as f32 / 8.0);
            positions.push([u, v, s as f32]);
            uvs.extend([u, v]);
        }
        for k in (0..72).filter(|k| k % 9 < 8) {
            let a = 81 * s as u32 + k;
            indices.extend([a, a + 1, a + 10, a, a + 10, a + 9]);
        }
    }
    let uvs = UvSource { u: Strided::from_slice(uvs.as_chunks::<2>().0), v: None, indices: Some(&indices) };
    let positions = Strided::from_slice(&positions);
    Mesh::new(&MeshSource { positions, indices: &indices, uvs, ..MeshSource::default() }).unwrap()
}

fn flat(u: f64, v: f64) -> [f64; 3] {
    [u, v, 0.0]
}

fn torus(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (u * std::f64::consts::TAU * 0.9, v * std::f64::consts::TAU * 0.9);
    [(1.0 + 0.5 * b.cos()) * a.cos(), (1.0 + 0.5 * b.cos()) * a.sin(), 0.5 * b.sin()]
}

/// Pseudorandom numbers in -1..1.
fn noise(seed: u64) -> impl FnMut() -> f64 {
    let mut random = Random(seed);
    move || random.between(-1.0, 1.0)
}

fn zero(problem: &Problem) -> Vec<[f64; 2]> {
    vec![[0.0; 2]; (problem.nx + 1) * (problem.ny + 1)]
}

/// A warp of the movable nodes by up to `size` cells along each axis.
fn shaken(problem: &Problem, size: f64, seed: u64) -> Vec<[f64; 2]> {
    let mut random = noise(seed);
    let mut u = zero(problem);
    for chart in problem.charts.iter().flatten() {
        for &n in &chart.nodes {
            let [i, j] = chart.node(n as usize);
            u[j * (problem.nx + 1) + i] = [size * random(), size * random()];
        }
    }
    u
}

fn bulge(u: f64, v: f64) -> [f64; 3] {
    let r2 = (u - 0.5).powi(2) + (v - 0.5).powi(2);
    [u, v, 0.3 * (-r2 / 0.03).exp()]
}

#[test]
fn the_gradient_is_that_of_the_energy() {
    // Every term at work: chords across triangles, room lost, orientation kept.
    let settings = TileSettings { orientation: 0.2, orientation_density: 0.3, ..TileSettings::default() };
    let mesh = sheet(5, flat);
    let pose = posed(5, torus);
    let problem = Problem::new(&mesh, &mesh.tiles[0], &maps(16, settings, discs), &pose).unwrap();
    let u = shaken(&problem, 0.4, 7);
    assert!(problem.min_jacobian(&u) < 0.1);
    let chart = problem.charts[0].as_ref().unwrap();
    let surface = problem.surface(1.0);
    let shape = Shape { locator: &problem.locator, surface: &surface };
    let window = problem.window(chart, &u);
    let state = chart.state(&shape, window.clone());
    let gradient = chart.gradient(&shape, &state.u, &state.samples, None);
    let largest = gradient.iter().fold(0.0f64, |m, g| m.max(g.abs().max_element()));
    for &n in &chart.nodes {
        for axis in 0..2 {
            let at = |h: f64| {
                let mut u = window.clone();
                u[n as usize][axis] += h;
                chart.state(&shape, u).energy
            };
            // Rounding of E over h, and h²: both about 1e-9 of the largest slope.
            let h = 1e-5;
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let difference = (slope - gradient[n as usize][axis]).abs();
            assert!(difference < 1e-7 * largest, "node {n}: {slope} {}", gradient[n as usize][axis]);
        }
    }
    // A node's own system has the same gradient and the same diagonal block as the whole.
    let mut matrix = vec![[[0.0; 4]; 9]; window.len()];
    chart.gradient(&shape, &state.u, &state.samples, Some(&mut matrix));
    for &n in &chart.nodes {
        let n = n as usize;
        let (g, h) = chart.node_system(&shape, &state.samples, &state.u, n);
        (0..2).for_each(|k| assert!((g[k] - gradient[n][k]).abs() < 1e-12 * largest));
        (0..4).for_each(|k| assert!((h[k] - matrix[n][4][k]).abs() < 1e-12 * h[0].max(h[3])));
    }
}

#[test]
fn rest_has_no_energy_wherever_it_is_and_whatever_its_unit() {
    let mesh = sheet(12, bulge);
    let maps = maps(32, TileSettings::default(), discs);
    let same = mesh.rest.clone();
    let problem = Problem::new(&mesh, &mesh.tiles[0], &maps, &same).unwrap();
    assert_eq!(problem.energy(&zero(&problem)), 0.0);
    let (s, c) = 0.7f64.sin_cos();
    let rigid = |p: &[f64; 3]| [c * p[0] - s * p[2] + 5.0, p[1] - 3.0, s * p[0] + c * p[2]];
    let moved: Vec<_> = mesh.rest.iter().map(rigid).collect();
    let mut problem = Problem::new(&mesh, &mesh.tiles[0], &maps, &moved).unwrap();
    // About 4000 edges; each strain has the rounding of positions of size 5 over an edge of 1/32: (200 eps)².
    let energy = problem.energy(&zero(&problem));
    assert!(energy < 4000.0 * (200.0 * f64::EPSILON).powi(2), "{energy}");
    let minimum = problem.minimise(None, &Options::default());
    assert!(minimum.converged && minimum.u.iter().all(|u| *u == [0.0; 2]));
}

#[test]
fn energy_has_no_unit() {
    let maps = maps(32, TileSettings::default(), discs);
    let scaled = |s: f64| {
        let mesh = sheet(12, |u, v| bulge(u, v).map(|x| s * x));
        let pose: Vec<_> = posed(12, torus).iter().map(|p| p.map(|x| s * x)).collect();
        let problem = Problem::new(&mesh, &mesh.tiles[0], &maps, &pose).unwrap();
        let u = shaken(&problem, 0.2, 3);
        problem.energy(&u)
    };
    let one = scaled(1.0);
    // A power of two changes no digit; a power of ten changes the last few.
    assert_eq!(one, scaled(1024.0));
    assert!((scaled(1e-6) / one - 1.0).abs() < 1e-12);
}

#[test]
fn the_linear_system_is_solved() {
    let mesh = sheet(9, flat);
    let pose = posed(9, bulge);
    let problem =
        Problem::new(&mesh, &mesh.tiles[0], &maps(48, TileSettings::default(), discs), &pose).unwrap();
    let chart = problem.charts[0].as_ref().unwrap();
    let surface = problem.surface(1.0);
    let shape = Shape { locator: &problem.locator, surface: &surface };
    let state = chart.state(&shape, problem.window(chart, &zero(&problem)));
    let mut grid = linear::Multigrid::new(chart.nx, chart.ny, &chart.movable);
    let b = chart.gradient(&shape, &state.u, &state.samples, Some(grid.matrix()));
    let matrix = grid.matrix().clone();
    grid.prepare();
    let x = grid.solve(&b, 1e-10, 60);
    let (mut residual, mut whole) = (0.0, 0.0);
    for &n in &chart.nodes {
        let mut r = b[n as usize];
        for (k, block) in matrix[n as usize].iter().enumerate() {
            r -= linear::times(block, x[linear::neighbour(n as usize, k, chart.width())]);
        }
        residual += r.length_squared();
        whole += b[n as usize].length_squared();
    }
    assert!(residual.sqrt() < 1e-9 * whole.sqrt(), "{residual} {whole}");
}

/// A strip in one dimension, with a minimum in closed form.
///
/// The strip runs along x; at rest each cell is 1 wide and H = 1000 high, in the pose x -> g(x). Vertical and diagonal
/// edges are so long that a shift of a few cells between rows strains them by 1e-5 at most: rows do not feel each
/// other, nor the fixed rows at the tile's rim, and each is a chain of its own. With λ = β = 0, and λ0 as good as 0,
/// its energy is Σ w_e (y_e - 1)², y_e being an edge's length in the pose. However the stretch g' varies along x, the
/// y_e need only add up to the length T = g(n): by Lagrange, w_e (y_e - 1) is the same for all edges, and so
///   E* = (T - n)² / Σ 1/w_e .
/// In the continuum, with w(x) = R(x) piecewise constant, the sum is ∫ dx / w. On the grid w_e = max(R_a, R_b) takes an
/// edge at each interface from the softer side, and R at a node on an interface is a mean: E* is met to first order
/// in the cell size, and to rounding (of λ0) if the sum runs over the grid's own edges.
#[test]
fn strips_meet_their_closed_form() {
    let soft = |u: f64, _: f64| if (0.25..0.625).contains(&u) { 1.0 } else { 0.25 };
    let settings = TileSettings { smoothness: 0.0, smoothness_floor: 1e-7, room: 0.0, ..Default::default() };
    // Stretched by 1.3 up to 3/8, by 0.9 up to 3/4, by 1.2 from there: 1.125 of the rest length.
    let g =
        |u: f64| 1.006 * u.min(0.375) + 0.998 * (u - 0.375).clamp(0.0, 0.375) + 1.004 * (u - 0.75).max(0.0);
    let (total, compliance) = (g(1.0), 0.375 / 1.0 + 0.625 / 0.25);
    let mut errors = Vec::new();
    for n in [16usize, 32, 64] {
        let size = n as f64;
        let mesh = sheet(8, |u, v| [size * u, 18.0 * 64.0 * v, 0.0]);
        let pose = posed(8, |u, v| [size * g(u), 18.0 * 64.0 * v, 0.0]);
        let maps = TileMaps {
            settings: TileSettings { grid: [Some(n as u32), Some(64)], ..settings },
            ..maps(n, settings, soft)
        };
        let mut problem = Problem::new(&mesh, &mesh.tiles[0], &maps, &pose).unwrap();
        let nodes = node_maps(&mesh.tiles[0], &maps, [n, 64]);
        let rigidity = |i: usize| f64::from(nodes.rigidity[32 * (n + 1) + i]);
        let minimum = problem.minimise(None, &Options::default());
        // Edges of the 63 rows that move; what the vertical and diagonal edges add is far below.
        let sum: f64 = (0..n).map(|i| 1.0 / rigidity(i).max(rigidity(i + 1))).sum();
        let discrete = 63.0 * (size * total - size).powi(2) / sum;
        let continuum = 63.0 * size * (total - 1.0).powi(2) / compliance;
        let (gap, error) = (minimum.energy / discrete - 1.0, minimum.energy / continuum - 1.0);
        assert!(minimum.converged);
        assert!(gap.abs() < 1e-3, "{n}: {} {discrete}", minimum.energy);
        // The place of each material point: y is the sum of the lengths up to it.
        let mut y = 0.0;
        for i in 1..n {
            let w = rigidity(i - 1).max(rigidity(i));
            y += 1.0 + (size * total - size) / sum / w;
            let place = i as f64 + minimum.u[32 * (n + 1) + i][0];
            assert!((size * g(place / size) - y).abs() < 0.02, "{n} {i}: {} {y}", size * g(place / size));
        }
        errors.push(error.abs());
    }
    assert!(errors[1] < 0.6 * errors[0] && errors[2] < 0.6 * errors[1], "{errors:?}");
}

#[test]
fn a_minimum_is_one() {
    let mesh = sheet(24, flat);
    for pose in [posed(24, bulge), posed(24, |u, v| [u + 0.5 * v, v, 0.0])] {
        let mut problem =
            Problem::new(&mesh, &mesh.tiles[0], &maps(48, TileSettings::default(), discs), &pose).unwrap();
        let before = problem.energy(&zero(&problem));
        let found = problem.minimise(None, &Options::default());
        assert!(found.converged && found.energy < 0.5 * before, "{before} {}", found.energy);
        assert!((problem.energy(&found.u) / found.energy - 1.0).abs() < 1e-12);
        // The same minimum from another start, except for the kinks at triangle edges: on the bulge each end has its
        // own, and their energies spread by 4e-4 of what there is to gain.
        let again = problem.minimise(Some(&shaken(&problem, 0.2, 5)), &Options::default());
        assert!(
            (again.energy - found.energy).abs() < 1e-3 * (before - found.energy),
            "{} {}",
            again.energy,
            found.energy
        );
        // No small change is better by more than what stopping early leaves.
        for seed in 0..20 {
            let change = shaken(&problem, 10f64.powi(-(seed as i32) % 5), seed);
            let u: Vec<_> = found.u.iter().zip(&change).map(|(u, c)| [u[0] + c[0], u[1] + c[1]]).collect();
            assert!(problem.energy(&u) > found.energy * (1.0 - 1e-6));
        }
    }
}

#[test]
fn the_bound_holds_where_nothing_else_does() {
    // With next to no room term, a squashed sheet crushes its elastic cells down to the bound.
    let settings = TileSettings { room: 0.02, smoothness: 0.05, ..TileSettings::default() };
    let mesh = sheet(24, flat);
    let pose = posed(24, |u, v| [0.5 * u, v, 0.0]);
    let mut problem = Problem::new(&mesh, &mesh.tiles[0], &maps(48, settings, discs), &pose).unwrap();
    let found = problem.minimise(None, &Options::default());
    let least = problem.min_jacobian(&found.u);
    assert!((0.02..0.021).contains(&least), "{least}");
    assert!(found.converged);
}

#[test]
fn charts_do_not_know_of_each_other() {
    // Two sheets side by side in one tile, the second one crushed or not: the first has the same minimum.
    let mesh = two_sheets();
    let maps = maps(64, TileSettings::default(), discs);
    let half = mesh.rest.len() / 2;
    let solve = |crush: f64| {
        let pose: Vec<_> = mesh
            .rest
            .iter()
            .enumerate()
            .map(|(v, p)| if v < half { [0.8 * p[0], p[1], 0.0] } else { [crush * p[0], p[1], 0.0] })
            .collect();
        let mut problem = Problem::new(&mesh, &mesh.tiles[0], &maps, &pose).unwrap();
        let found = problem.minimise(None, &Options::default());
        assert!((problem.energy_of_chart(1, &found.u) / found.per_chart[1] - 1.0).abs() < 1e-12);
        assert_eq!(found.energy, found.per_chart.iter().sum::<f64>());
        found
    };
    let (one, other) = (solve(0.7), solve(0.4));
    assert_eq!(one.per_chart.len(), 2);
    assert_eq!(one.per_chart[0], other.per_chart[0]);
    assert!(one.per_chart[1] < other.per_chart[1]);
    let left =
        |u: &[[f64; 2]]| -> Vec<[f64; 2]> { (0..65 * 65).filter(|n| n % 65 < 32).map(|n| u[n]).collect() };
    assert_eq!(left(&one.u), left(&other.u));
}

#[test]
fn all_starts_together_are_no_worse_than_any() {
    let mesh = sheet(24, flat);
    let pose = posed(24, |u, v| [0.35 * u, v, 0.0]);
    let mut problem =
        Problem::new(&mesh, &mesh.tiles[0], &maps(48, TileSettings::default(), discs), &pose).unwrap();
    let start = zero(&problem);
    let eased = problem.minimise(None, &Options::default());
    let direct = problem.minimise(Some(&start), &Options::default());
    let all = problem.minimise(Some(&start), &Options { thorough: true, ..Options::default() });
    assert!(all.energy <= eased.energy && all.energy <= direct.energy);
    assert!(problem.min_jacobian(&all.u) > 0.02);
}
