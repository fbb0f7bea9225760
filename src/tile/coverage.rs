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
        let borders = borders(mesh, nx, ny);
        let charts = mesh.chart_of_triangles();
        let chart_of = |node: usize| {
            let t = triangle[node];
            if t == NONE { NONE } else { charts[t as usize] }
        };
        let inside = |i: usize, j: usize| {
            let corners = [j * width + i, j * width + i + 1, (j + 1) * width + i, (j + 1) * width + i + 1];
            let chart = chart_of(corners[0]);
            let border = borders[j * nx + i];
            let crossed = match overlap {
                Overlap::Fixed => border != NONE || corners.iter().any(|&c| layered[c]),
                Overlap::FirstFace => border == chart || border == SEVERAL,
            };
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
                interior[j * width + i] = cell(0, 0) && cell(1, 0) && cell(0, 1) && cell(1, 1);
            }
        }
        let covered = triangle.iter().filter(|&&t| t != NONE).count().max(1);
        let overlapping = layered.iter().filter(|&&l| l).count();
        Coverage { nx, ny, triangle, interior, overlap: overlapping as f32 / covered as f32 }
    }
}

/// Per cell, the chart whose border crosses its interior, `SEVERAL` for several charts, or `NONE`.
fn borders(mesh: &TileMesh, nx: usize, ny: usize) -> Vec<u32> {
    let size = DVec2::new(nx as f64, ny as f64);
    let mut cells = vec![NONE; nx * ny];
    for (c, chart) in mesh.charts.iter().enumerate() {
        for t in &mesh.triangles[chart.triangles.clone()] {
            for k in 0..3 {
                if t.neighbours[k] == NONE {
                    let [a, b] = [t.uv[(k + 1) % 3], t.uv[(k + 2) % 3]].map(|uv| uv * size);
                    cells_of_segment(a, b, nx, ny, |cell| {
                        let owner = &mut cells[cell];
                        *owner = if *owner == NONE || *owner == c as u32 { c as u32 } else { SEVERAL };
                    });
                }
            }
        }
    }
    cells
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
}
