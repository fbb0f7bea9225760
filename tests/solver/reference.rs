//! The reference solver itself: its gradient, its linear solver, its minima.

use vrtm_core::fixtures::{discs, maps, posed, sheet};
use vrtm_core::settings::TileSettings;
use vrtm_testkit::random::Random;
use vrtm_testkit::reference::energy::Shape;
use vrtm_testkit::reference::minimise::Options;
use vrtm_testkit::reference::*;

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
