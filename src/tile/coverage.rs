//! Node -> triangle coverage of a tile's grid, and the cells that lie wholly inside one chart.

use crate::mesh::{NONE, TileMesh};
use crate::settings::Overlap;

/// What covers the nodes of an nx by ny grid. Node (i, j) lies at UV (i / nx, j / ny) and is entry
/// `j * (nx + 1) + i`.
#[derive(Clone, Debug)]
pub(crate) struct Coverage {
    pub nx: usize,
    pub ny: usize,
    /// The triangle under each node, or `NONE`.
    pub triangle: Vec<u32>,
    /// True for nodes all of whose four cells lie inside one chart (and in the tile).
    pub interior: Vec<bool>,
    /// Share of the covered nodes that more than one layer covers.
    pub overlap: f32,
}

/// A cell that borders of more than one chart cross.
const SEVERAL: u32 = NONE - 1;

impl Coverage {
    /// Covers the grid. Where layers overlap, the lowest triangle owns a node (triangles are sorted by chart, charts
    /// by first face); with `Overlap::Fixed` such nodes are not interior.
    pub fn new(mesh: &TileMesh, nx: usize, ny: usize, overlap: Overlap) -> Coverage {
        let width = nx + 1;
        let mut triangle = vec![NONE; width * (ny + 1)];
        let mut layered = vec![false; triangle.len()];
        // Nodes exactly on an edge that the fill rule gives to nobody: the chart's lower and right rim.
        let mut rim = Vec::new();
        for (t, source) in mesh.triangles.iter().enumerate() {
            let corners = source.uv.map(|uv| [uv[0] * nx as f64, uv[1] * ny as f64]);
            Fill::new(corners).visit(nx, ny, |i, j, inside| {
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
        let shared = layered.iter().filter(|&&l| l).count();
        Coverage { nx, ny, triangle, interior, overlap: shared as f32 / covered as f32 }
    }
}

/// Point-in-triangle over grid nodes with a top-left rule. An edge is always evaluated from its lower to its higher
/// end, so two triangles that share it see the same number and a node falls to exactly one of them.
struct Fill {
    corners: [[f64; 2]; 3],
    /// +1 or -1: the winding.
    sign: f64,
}

impl Fill {
    fn new(corners: [[f64; 2]; 3]) -> Fill {
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        Fill { corners, sign: if area < 0.0 { -1.0 } else { 1.0 } }
    }

    /// Calls `f(i, j, true)` for nodes inside by the rule, `f(i, j, false)` for other nodes of the closed triangle.
    fn visit(&self, nx: usize, ny: usize, mut f: impl FnMut(usize, usize, bool)) {
        let ys = self.corners.map(|c| c[1]);
        let low = ys.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
        let high = ys.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor().min(ny as f64);
        let mut y = low;
        while y <= high {
            let (left, right) = self.span(y);
            let first = (left - 1e-6).ceil().max(0.0);
            let last = (right + 1e-6).floor().min(nx as f64);
            let mut x = first;
            while x <= last {
                if let Some(inside) = self.contains(x, y) {
                    f(x as usize, y as usize, inside);
                }
                x += 1.0;
            }
            y += 1.0;
        }
    }

    /// The triangle's extent on a row.
    fn span(&self, y: f64) -> (f64, f64) {
        let mut span = (f64::INFINITY, f64::NEG_INFINITY);
        for k in 0..3 {
            let (a, b) = (self.corners[k], self.corners[(k + 1) % 3]);
            if (a[1] < y && b[1] < y) || (a[1] > y && b[1] > y) {
                continue;
            }
            let xs = if a[1] == b[1] {
                [a[0], b[0]]
            } else {
                let x = a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1]));
                [x, x]
            };
            span = (span.0.min(xs[0]).min(xs[1]), span.1.max(xs[0]).max(xs[1]));
        }
        span
    }

    /// `Some(true)` inside by the rule, `Some(false)` on an edge that is not ours, `None` outside.
    fn contains(&self, x: f64, y: f64) -> Option<bool> {
        let mut ours = true;
        for k in 0..3 {
            let (mut a, mut b) = (self.corners[k], self.corners[(k + 1) % 3]);
            let mut sign = self.sign;
            if (a[1], a[0]) > (b[1], b[0]) {
                (a, b) = (b, a);
                sign = -sign;
            }
            let side = sign * ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]));
            if side < 0.0 {
                return None;
            }
            if side == 0.0 {
                // From low to high with the inside on its left: a right edge, or (horizontal) a lower one.
                let first = if a[1] == b[1] { sign > 0.0 } else { sign < 0.0 };
                ours &= first;
            }
        }
        Some(ours)
    }
}

/// Per cell, the chart whose border crosses its open interior, `SEVERAL`, or `NONE`.
fn borders(mesh: &TileMesh, nx: usize, ny: usize) -> Vec<u32> {
    let mut cells = vec![NONE; nx * ny];
    for (c, chart) in mesh.charts.iter().enumerate() {
        for t in &mesh.triangles[chart.triangles.clone()] {
            for k in 0..3 {
                if t.neighbours[k] == NONE {
                    let [a, b] = [t.uv[(k + 1) % 3], t.uv[(k + 2) % 3]]
                        .map(|uv| [uv[0] * nx as f64, uv[1] * ny as f64]);
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

/// Calls `f` for each cell whose open interior the segment crosses.
fn cells_of_segment(a: [f64; 2], b: [f64; 2], nx: usize, ny: usize, mut f: impl FnMut(usize)) {
    let (a, b) = if a[1] <= b[1] { (a, b) } else { (b, a) };
    let first = a[1].floor().max(0.0);
    let last = (b[1].ceil() - 1.0).min(ny as f64 - 1.0);
    let mut row = first;
    while row <= last {
        let at = |y: f64| a[0] + (b[0] - a[0]) * ((y - a[1]) / (b[1] - a[1])).clamp(0.0, 1.0);
        let (x0, x1) = (at(row.max(a[1])), at((row + 1.0).min(b[1])));
        let mut x = x0.min(x1).floor().max(0.0);
        let end = (x0.max(x1).ceil() - 1.0).min(nx as f64 - 1.0);
        while x <= end {
            f(row as usize * nx + x as usize);
            x += 1.0;
        }
        row += 1.0;
    }
}
