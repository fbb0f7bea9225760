use glam::DVec2;
use vrtm_core::grid::cover::*;
use vrtm_core::grid::planes::SIDE;

fn cells(a: [f64; 2], b: [f64; 2]) -> Vec<usize> {
    let mut cells = Vec::new();
    cells_of_segment(a.into(), b.into(), [0, 0], 8, |i, j| cells.push(j * 8 + i));
    cells
}

#[test]
fn a_border_crosses_the_cells_that_it_passes_through_and_no_others() {
    assert_eq!(cells([1.5, 2.5], [4.5, 2.5]), [17, 18, 19, 20]);
    assert_eq!(cells([4.5, 2.5], [1.5, 2.5]), [17, 18, 19, 20]);
    // A segment along a line of nodes crosses no cell's interior.
    assert_eq!(cells([1.5, 2.0], [4.5, 2.0]), [0usize; 0]);
    assert_eq!(cells([3.0, 1.0], [3.0, 6.0]), [0usize; 0]);
    assert_eq!(cells([3.5, 1.5], [3.5, 3.5]), [11, 19, 27]);
    assert_eq!(cells([0.5, 0.5], [2.5, 2.5]), [0, 9, 18]);
    assert_eq!(cells([-3.0, 0.5], [1.5, 0.5]), [0, 1]);
}

#[test]
fn a_border_on_a_line_of_the_grid_meets_the_nodes_of_its_edges() {
    let nodes = |a: [f64; 2], b: [f64; 2]| {
        let mut nodes = Vec::new();
        nodes_of_segment(a.into(), b.into(), [16, 32], SIDE, |i, j| nodes.push([i + 16, j + 32]));
        nodes
    };
    assert_eq!(nodes([17.0, 34.0], [19.0, 34.0]), [[17, 34], [18, 34], [19, 34]]);
    assert_eq!(nodes([19.0, 34.0], [17.0, 34.0]), [[17, 34], [18, 34], [19, 34]]);
    // A segment that ends inside an edge meets both nodes of that edge.
    assert_eq!(nodes([17.5, 34.0], [19.25, 34.0]), [[17, 34], [18, 34], [19, 34], [20, 34]]);
    // These segments continue beyond the square.
    assert_eq!(nodes([20.0, 45.5], [20.0, 63.5]), [[20, 45], [20, 46], [20, 47]]);
    assert_eq!(nodes([3.0, 32.0], [16.5, 32.0]), [[16, 32], [17, 32]]);
    for (a, b) in [
        ([17.0, 34.5], [19.0, 34.5]),
        ([17.0, 33.0], [19.0, 35.0]),
        ([18.0, 34.0], [18.0, 34.0]),
        ([16.0, 48.0], [24.0, 48.0]),
    ] {
        assert_eq!(nodes(a, b), [[0usize; 2]; 0]);
    }
}

#[test]
fn a_border_beside_a_line_of_the_grid_by_noise_is_on_it() {
    let of = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| on_line([a, b, c].map(DVec2::from));
    let moved = |a, b| of(a, b, [5.0, 5.0]).map(|ends| ends.map(|p| p.to_array()));
    assert_eq!(of([3.0, 2.5], [3.0, 7.5], [3.05, 5.0]), None);
    assert_eq!(moved([3.0008, 2.5], [2.9991, 7.9992]), Some([[3.0, 2.5], [3.0, 8.0]]));
    assert_eq!(moved([3.0008, 2.5], [2.998, 7.9992]), None);
    // Ends that are both near lines, but not near the same one.
    assert_eq!(moved([3.0008, 2.5], [4.0, 7.5]), None);
}
