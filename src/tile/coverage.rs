//! Coverage of a tile's grid (method §1), from the UVs of its triangles: the triangle under each node, and the nodes
//! whose four cells lie inside one chart.

use glam::DVec2;

use crate::mesh::{NONE, TileMesh};
use crate::settings::Overlap;

use super::fill::Fill;

/// The triangles that cover the nodes of a grid of nx by ny cells. Node (i, j) lies at UV (i / nx, j / ny) and has the
/// index `j * (nx + 1) + i`.
#[derive(Clone, Debug)]
pub(crate) struct Coverage {
    pub nx: usize,
    pub ny: usize,
    /// The triangle under each node, or `NONE`.
    pub triangle: Vec<u32>,
    /// True for nodes whose four cells all lie in the tile and inside one chart.
    pub interior: Vec<bool>,
    /// Fraction of the covered nodes that more than one layer covers.
    pub overlap: f32,
}

/// Marks a cell that the borders of several charts cross.
const SEVERAL: u32 = NONE - 1;

impl Coverage {
    /// Computes the coverage. Where layers overlap, a node belongs to the first triangle (triangles are sorted by
    /// chart, charts by first face); with `Overlap::Fixed` such nodes are not interior.
    pub fn new(mesh: &TileMesh, nx: usize, ny: usize, overlap: Overlap) -> Coverage {
        let width = nx + 1;
        let cells = DVec2::new(nx as f64, ny as f64);
        let mut triangle = vec![NONE; width * (ny + 1)];
        let mut layered = vec![false; triangle.len()];
        // (node, triangle) for nodes on an edge that the fill rule does not give to this triangle. At the chart's upper
        // and right rim it gives them to no other triangle either.
        let mut rim = Vec::new();
        for (t, source) in mesh.triangles.iter().enumerate() {
            Fill::new(source.uv.map(|uv| uv * cells)).visit(width, ny + 1, |i, j, inside| {
                let node = j * width + i;
                match (inside, triangle[node]) {
                    (true, NONE) => triangle[node] = t as u32,
                    (true, _) => layered[node] = true,
                    (false, _) => rim.push((node, t as u32)),
                }
            });
        }
        for (node, t) in rim {
            if triangle[node] == NONE {
                triangle[node] = t;
            }
        }
        let Borders { cells: borders, nodes: cuts } = Borders::new(mesh, nx, ny);
        let charts = mesh.chart_of_triangles();
        let chart_of = |node: usize| {
            let t = triangle[node];
            if t == NONE { NONE } else { charts[t as usize] }
        };
        // Whether a border counts for a chart.
        let counts = |border: u32, chart: u32| match overlap {
            Overlap::Fixed => border != NONE,
            Overlap::FirstFace => border == chart || border == SEVERAL,
        };
        let inside = |i: usize, j: usize| {
            let corners = [j * width + i, j * width + i + 1, (j + 1) * width + i, (j + 1) * width + i + 1];
            let chart = chart_of(corners[0]);
            let crossed = counts(borders[j * nx + i], chart)
                || overlap == Overlap::Fixed && corners.iter().any(|&c| layered[c]);
            chart != NONE && !crossed && corners[1..].iter().all(|&c| chart_of(c) == chart)
        };
        let mut cells = vec![false; nx * ny];
        for j in 0..ny {
            for i in 0..nx {
                cells[j * nx + i] = inside(i, j);
            }
        }
        let mut interior = vec![false; triangle.len()];
        for j in 1..ny {
            for i in 1..nx {
                let cell = |di: usize, dj: usize| cells[(j - dj) * nx + i - di];
                let node = j * width + i;
                interior[node] = cell(0, 0)
                    && cell(1, 0)
                    && cell(0, 1)
                    && cell(1, 1)
                    && !counts(cuts[node], chart_of(node));
            }
        }
        let covered = triangle.iter().filter(|&&t| t != NONE).count().max(1);
        let overlapping = layered.iter().filter(|&&l| l).count();
        Coverage { nx, ny, triangle, interior, overlap: overlapping as f32 / covered as f32 }
    }
}

/// Where the borders of the charts are, cuts of no width among them. Each entry is a chart, `SEVERAL` for several, or
/// `NONE`.
struct Borders {
    /// Per cell, the chart whose border crosses its interior.
    cells: Vec<u32>,
    /// Per node, the chart whose border runs along an edge of the grid at the node.
    nodes: Vec<u32>,
}

impl Borders {
    fn new(mesh: &TileMesh, nx: usize, ny: usize) -> Borders {
        let size = DVec2::new(nx as f64, ny as f64);
        let mut borders = Borders { cells: vec![NONE; nx * ny], nodes: vec![NONE; (nx + 1) * (ny + 1)] };
        let mark = |owner: &mut u32, chart: u32| {
            *owner = if *owner == NONE || *owner == chart { chart } else { SEVERAL };
        };
        for (c, chart) in mesh.charts.iter().enumerate() {
            for t in &mesh.triangles[chart.triangles.clone()] {
                for k in (0..3).filter(|&k| t.neighbours[k] == NONE) {
                    let [a, b] = [t.uv[(k + 1) % 3], t.uv[(k + 2) % 3]].map(|uv| uv * size);
                    cells_of_segment(a, b, nx, ny, |cell| mark(&mut borders.cells[cell], c as u32));
                    nodes_of_segment(a, b, nx, ny, |node| mark(&mut borders.nodes[node], c as u32));
                }
            }
        }
        borders
    }
}

/// If the segment from `a` to `b` lies on a line of the grid, calls `f` for the nodes of each edge of the grid of which it
/// covers a part.
fn nodes_of_segment(a: DVec2, b: DVec2, nx: usize, ny: usize, mut f: impl FnMut(usize)) {
    for axis in 0..2 {
        let (along, line, counts) = (axis, 1 - axis, [nx, ny]);
        let at = a[line];
        let on_grid = at == b[line] && at.fract() == 0.0 && (0.0..=counts[line] as f64).contains(&at);
        if !on_grid || a[along] == b[along] {
            continue;
        }
        let first = a[along].min(b[along]).floor().max(0.0);
        let last = a[along].max(b[along]).ceil().min(counts[along] as f64);
        let mut k = first;
        while k <= last {
            let [i, j] = if along == 0 { [k, at] } else { [at, k] };
            f(j as usize * (nx + 1) + i as usize);
            k += 1.0;
        }
    }
}

/// Calls `f` for each cell whose open interior the segment from `a` to `b` crosses.
fn cells_of_segment(a: DVec2, b: DVec2, nx: usize, ny: usize, mut f: impl FnMut(usize)) {
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    let first = a.y.floor().max(0.0);
    let last = (b.y.ceil() - 1.0).min(ny as f64 - 1.0);
    let mut row = first;
    while row <= last {
        let at = |y: f64| a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0);
        let level = a.y == b.y;
        let (x0, x1) = if level { (a.x, b.x) } else { (at(row.max(a.y)), at((row + 1.0).min(b.y))) };
        let mut x = x0.min(x1).floor().max(0.0);
        let end = (x0.max(x1).ceil() - 1.0).min(nx as f64 - 1.0);
        while x <= end {
            f(row as usize * nx + x as usize);
            x += 1.0;
        }
        row += 1.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells(a: [f64; 2], b: [f64; 2]) -> Vec<usize> {
        let mut cells = Vec::new();
        cells_of_segment(a.into(), b.into(), 8, 8, |cell| cells.push(cell));
        cells
    }

    #[test]
    fn a_border_crosses_the_cells_that_it_passes_through_and_no_others() {
        assert_eq!(cells([1.5, 2.5], [4.5, 2.5]), [17, 18, 19, 20]);
        assert_eq!(cells([4.5, 2.5], [1.5, 2.5]), [17, 18, 19, 20]);
        // Along a line of nodes it is in no cell's interior.
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
            nodes_of_segment(a.into(), b.into(), 8, 8, |node| nodes.push(node));
            nodes
        };
        assert_eq!(nodes([1.0, 2.0], [3.0, 2.0]), [19, 20, 21]);
        assert_eq!(nodes([3.0, 2.0], [1.0, 2.0]), [19, 20, 21]);
        // It ends within an edge: both nodes of that edge.
        assert_eq!(nodes([1.5, 2.0], [3.25, 2.0]), [19, 20, 21, 22]);
        assert_eq!(nodes([4.0, 6.5], [4.0, 9.5]), [58, 67, 76]);
        assert_eq!(nodes([-2.0, 0.0], [0.5, 0.0]), [0, 1]);
        for (a, b) in [
            ([1.0, 2.5], [3.0, 2.5]),
            ([1.0, 1.0], [3.0, 3.0]),
            ([2.0, 2.0], [2.0, 2.0]),
            ([0.0, 9.0], [8.0, 9.0]),
        ] {
            assert_eq!(nodes(a, b), [0usize; 0]);
        }
    }
}
