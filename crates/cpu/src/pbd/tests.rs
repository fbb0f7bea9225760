use super::super::lanes::{LANES, Lanes, Portable as V};
use super::project::projected;
use super::*;
use crate::Memory;
use vrtm_core::allocation::vec;
use vrtm_core::fixtures::{Posed, maps};
use vrtm_core::grid::codes::{decode_rigidity, encode_rigidity};
use vrtm_core::grid::planes::{NODES, slot};
use vrtm_core::method::pbd::Set;
use vrtm_core::method::plan::Purpose;
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_core::settings::{Solver, TileSettings};
use vrtm_core::team::Team;

const FULL: Iteration = Iteration {
    first: true,
    regularise: true,
    last: true,
    momentum: 0.0,
    orientation: 0.0,
    smoothing: 0.0,
    correction: 1.0,
};

/// Calls `test` with a run on a sheet of 16 x 16 cells with the given rigidity and pose, at the identity on level 0.
/// Nodes 1 to 15 are movable.
fn with_sheet(
    rigidity: impl Fn(f64, f64) -> f64,
    pose: impl Fn(f64, f64) -> [f64; 3],
    test: impl FnOnce(&mut Run) + Send,
) {
    let sheet = Posed::new(1, maps(16, TileSettings::default(), rigidity), pose);
    let mut memory = Memory::new(&sheet.grid, Purpose::new(Solver::Pbd, &sheet.maps.settings));
    let mut result = vec![[[0.0; NODES]; 2]; sheet.grid.levels[0].blocks.list.len()];
    Team::with(1, |team| {
        let mut run = Run::new(team, &sheet.input(), &mut memory, &mut result, &[]);
        run.run(&Stage::Surface);
        run.run(&Stage::Start { level: 0, from: Start::Identity });
        run.begin_level(0);
        test(&mut run);
    });
}

/// Displacement of a node of the first block.
fn at(run: &Run, i: usize, j: usize) -> [f32; 2] {
    run.memory.levels[0].u[0].map(|plane| plane[slot(i, j)])
}

fn set(run: &mut Run, i: usize, j: usize, u: [f32; 2]) {
    for c in 0..2 {
        run.memory.levels[0].u[0][c][slot(i, j)] = u[c];
    }
}

fn project(run: &mut Run, edge: usize, parity: usize) {
    run.pass(0, Pass::Project(Project { set: Set { edge, parity }, iteration: FULL, density: 0.0 }));
}

#[track_caller]
fn close(a: [f32; 2], b: [f32; 2]) {
    // The rounding errors of a few operations on numbers near 1 are far smaller.
    assert!((0..2).all(|c| (a[c] - b[c]).abs() < 1e-5), "{a:?} {b:?}");
}

/// A map that is rigid everywhere.
fn rigid(_: f64, _: f64) -> f64 {
    1.0
}

/// A map whose left half is rigid.
fn left_rigid(u: f64, _: f64) -> f64 {
    if u < 0.5 { 1.0 } else { 0.0 }
}

/// A pose that is twice as long as at rest along u.
fn stretched(u: f64, v: f64) -> [f64; 3] {
    [2.0 * u, v, 0.0]
}

#[test]
fn a_rigid_edge_takes_its_rest_length_about_its_centre() {
    with_sheet(rigid, stretched, |run| {
        project(run, 0, 0);
        close(at(run, 2, 8), [0.25, 0.0]);
        close(at(run, 3, 8), [-0.25, 0.0]);
        // Node 0 is fixed, so its neighbour takes all of the change.
        assert_eq!(at(run, 0, 8), [0.0; 2]);
        close(at(run, 1, 8), [-0.5, 0.0]);
        // All nodes of row 0 are fixed.
        assert_eq!(at(run, 4, 0), [0.0; 2]);
    });
    with_sheet(rigid, stretched, |run| {
        project(run, 0, 1);
        close(at(run, 1, 8), [0.25, 0.0]);
        close(at(run, 2, 8), [-0.25, 0.0]);
        // The other end lies in the next block, and is fixed.
        close(at(run, 15, 8), [0.5, 0.0]);
    });
    // Edges to the north already have their rest lengths; diagonal ones are sqrt(5 / 2) times as long as at rest.
    with_sheet(rigid, stretched, |run| {
        project(run, 1, 0);
        assert_eq!(at(run, 4, 4), [0.0; 2]);
        project(run, 2, 0);
        let change = 0.5 * (1.0 - (2.0f32 / 5.0).sqrt());
        close(at(run, 4, 4), [change, change]);
        close(at(run, 5, 5), [-change, -change]);
    });
    with_sheet(rigid, stretched, |run| {
        project(run, 3, 0);
        let change = 0.5 * (1.0 - (2.0f32 / 5.0).sqrt());
        close(at(run, 5, 4), [-change, change]);
        close(at(run, 4, 5), [change, -change]);
    });
}

#[test]
fn the_larger_rigidity_is_the_stiffness_and_elastic_edges_are_not_projected() {
    let left = |u: f64, _: f64| if u < 0.5 { 0.5 } else { 0.0 };
    with_sheet(left, stretched, |run| {
        // The rigidities at the nodes are interpolated from the map; these are the stored ones.
        let rigidity = |i: usize| decode_rigidity(run.grid.levels[0].rigidity[0][slot(i, 8)]);
        let half = decode_rigidity(encode_rigidity(0.5));
        assert_eq!([rigidity(4), rigidity(7), rigidity(9), rigidity(10)], [half, half, 0.0, 0.0]);
        let border = rigidity(8);
        project(run, 0, 0);
        close(at(run, 4, 8), [0.125, 0.0]);
        assert_eq!(at(run, 10, 8), [0.0; 2]);
        // The edge's weight is the rigidity of node 8, which is interpolated across the step of the map.
        close(at(run, 9, 8), [-0.25 * border, 0.0]);
    });
}

#[test]
fn no_end_leaves_the_box_of_its_neighbours() {
    // The projection would make the edges ten cells long.
    let squashed = |u: f64, v: f64| [0.1 * u, v, 0.0];
    with_sheet(rigid, squashed, |run| {
        project(run, 0, 0);
        assert_eq!(at(run, 4, 8), [-1.0, 0.0]);
        assert_eq!(at(run, 5, 8), [1.0, 0.0]);
    });
}

#[test]
fn an_edge_turns_back_by_its_fraction() {
    let turn = |d: [f32; 2], d0, fraction: f32| {
        let [x, y] = projected(d.map(V::splat), d0, V::one(), V::zero(), V::splat(fraction));
        let (x, y) = (x.to_array(), y.to_array());
        assert!(x.iter().all(|&v| v == x[0]) && LANES == 8);
        [x[0], y[0]]
    };
    let half = std::f32::consts::FRAC_1_SQRT_2;
    // An edge to the north that points to the east at rest: half of the turn is 45 degrees. The length is unchanged.
    close(turn([0.0, 2.0], [1.0, 0.0], 0.5), [2.0 * half, 2.0 * half]);
    close(turn([0.0, 2.0], [1.0, 0.0], 1.0), [2.0, 0.0]);
    close(turn([0.0, 2.0], [1.0, 0.0], 0.0), [0.0, 2.0]);
    // A quarter of a small angle is turned back, up to an error of third order in the angle.
    let [x, y] = turn([0.1f32.cos(), 0.1f32.sin()], [1.0, 0.0], 0.25);
    assert!((y.atan2(x) - 0.075).abs() < 1e-4, "{}", y.atan2(x));
    // The blend of opposite unit vectors is 0 and has no direction, but the result must be finite.
    assert!(turn([-1.0, 0.0], [1.0, 0.0], 0.5).iter().all(|x| x.is_finite()));
}

#[test]
fn regularisation_blends_with_the_gaussian_by_rigidity() {
    with_sheet(left_rigid, stretched, |run| {
        set(run, 4, 8, [1.0, 0.0]);
        set(run, 12, 8, [1.0, -1.0]);
        run.regularise_level(0, 0.2);
        // A node moves to the Gaussian by the fraction s = 0.2 where R = 1, and all the way where R = 0.
        close(at(run, 4, 8), [1.0 - 0.2 * 0.75, 0.0]);
        close(at(run, 5, 8), [0.2 * 0.125, 0.0]);
        close(at(run, 5, 9), [0.2 * 0.0625, 0.0]);
        close(at(run, 12, 8), [0.25, -0.25]);
        close(at(run, 12, 9), [0.125, -0.125]);
        close(at(run, 13, 7), [0.0625, -0.0625]);
        assert_eq!(at(run, 4, 10), [0.0; 2]);
    });
}

#[test]
fn positions_are_integrated_and_predicted_from_their_velocity() {
    with_sheet(left_rigid, stretched, |run| {
        // Without smoothing, regularisation does not move a rigid node: its displacement is integrated unchanged.
        set(run, 4, 8, [0.5, 0.25]);
        let integrate = |last| {
            let iteration = Some(Iteration { last, momentum: 0.5, ..FULL });
            Pass::Regularise(Regularise { smoothing: 0.0, iteration })
        };
        run.pass(0, integrate(false));
        // The velocity is the change from 0 to (0.5, 0.25), and the prediction adds half of it.
        close(at(run, 4, 8), [0.75, 0.375]);
        // The predicted displacement is integrated in turn. No prediction follows the last iteration.
        run.pass(0, integrate(true));
        close(at(run, 4, 8), [0.75, 0.375]);
        run.pass(0, integrate(false));
        // The node has not moved since the last integration, so its velocity is 0.
        close(at(run, 4, 8), [0.75, 0.375]);
    });
}

#[test]
fn a_node_that_would_leave_its_chart_stays() {
    with_sheet(rigid, stretched, |run| {
        set(run, 4, 8, [-9.0, 0.0]);
        run.copy_inactive_blocks(0);
        // With a smoothing of 0.01 the rigid node would be far outside the chart, where the surface has no sample.
        let before = at(run, 4, 8);
        run.pass(0, Pass::Regularise(Regularise { smoothing: 0.01, iteration: None }));
        assert_eq!(at(run, 4, 8), before);
    });
}
