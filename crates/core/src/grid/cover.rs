//! Computes the coverage of a square of a tile's grid (method §1) from the UVs of the triangles that meet it: the
//! triangle under each node, and the nodes whose four cells lie inside one chart.

use std::borrow::Cow;

use glam::DVec2;

use super::fill::Fill;
use super::node_set::NodeSet;
use super::squares::Squares;
use crate::grid::planes::SIDE;
use crate::mesh::{NONE, TileMesh};
use crate::settings::Overlap;

/// Nodes on a side of a square's window: the square and one node around it.
pub const WIDE: usize = SIDE + 2;
/// Cells on a side of the window.
const CELLS: usize = WIDE - 1;

/// The triangles of a tile on a grid of nx by ny cells. Node (i, j) lies at UV (i / nx, j / ny).
pub struct Coverer<'a> {
    pub tile: &'a TileMesh,
    pub nx: usize,
    pub ny: usize,
    pub overlap: Overlap,
    /// The chart of each triangle.
    pub charts: Cow<'a, [u32]>,
    pub squares: Squares,
}

/// The coverage of a square's nodes.
pub struct Cover {
    /// The triangle under each node of the window, or `NONE`; node (i, j) of the square at `at(i + 1, j + 1)`.
    pub triangle: [u32; WIDE * WIDE],
    /// The square's nodes whose four cells all lie in the tile and inside one chart, and on no border.
    pub interior: NodeSet,
    /// The square's nodes that a triangle of a chart covers, not only one of a collar.
    pub covered: NodeSet,
    /// The square's nodes that more than one layer covers.
    pub layered: NodeSet,
    /// The square's nodes that would be interior without the gaps in the UVs that welding closed.
    pub at_gaps: NodeSet,
}

impl Cover {
    /// The triangle under the nth of the square's nodes, row by row.
    pub fn triangle_at(&self, n: usize) -> u32 {
        self.triangle[at(n % SIDE + 1, n / SIDE + 1)]
    }
}

/// Index of the node (i - 1, j - 1) of a square in its window; i and j run from 0 to 17.
pub const fn at(i: usize, j: usize) -> usize {
    j * WIDE + i
}

/// Marks a cell that the borders of several charts cross.
const SEVERAL: u32 = NONE - 1;

impl<'a> Coverer<'a> {
    pub fn new(tile: &'a TileMesh, nx: usize, ny: usize, overlap: Overlap) -> Coverer<'a> {
        let charts = tile.chart_of_triangles();
        let squares = Squares::new(tile, &charts, nx, ny);
        Coverer { tile, nx, ny, overlap, charts: Cow::Owned(charts.into()), squares }
    }

    /// Covers a square. Where layers overlap, a node belongs to the first triangle (triangles are sorted by chart,
    /// charts by first face); with `Overlap::Fixed` such nodes are not interior.
    pub fn cover(&self, square: usize) -> Cover {
        let [x, y] = self.squares.list[square].at.map(|x| x as usize * SIDE);
        let triangles = self.squares.triangles(square);
        let (triangle, layered) = self.fill(x, y, triangles);
        let empty = NodeSet::EMPTY;
        let mut cover = Cover { triangle, interior: empty, covered: empty, layered: empty, at_gaps: empty };
        for j in 0..SIDE {
            for i in 0..SIDE {
                if triangle[at(i + 1, j + 1)] < self.tile.own() as u32 {
                    cover.covered.insert(i, j);
                }
                if layered[at(i + 1, j + 1)] {
                    cover.layered.insert(i, j);
                }
            }
        }
        if triangle.iter().any(|&t| t != NONE) {
            let interior = |with_gaps: bool| {
                let borders = self.borders(x, y, triangles, with_gaps);
                self.interior(&borders, &triangle, &layered)
            };
            cover.interior = interior(true);
            if triangles.iter().any(|&t| self.tile.cuts_of(t).any(|cut| cut.is_gap)) {
                cover.at_gaps = interior(false).without(cover.interior);
            }
        }
        cover
    }

    /// The triangles under the nodes of a window, and whether more than one layer covers them. (x, y) is the square's
    /// first node.
    fn fill(&self, x: usize, y: usize, triangles: &[u32]) -> ([u32; WIDE * WIDE], [bool; WIDE * WIDE]) {
        let cells = DVec2::new(self.nx as f64, self.ny as f64);
        let mut triangle = [NONE; WIDE * WIDE];
        let mut layered = [false; WIDE * WIDE];
        // The triangle at nodes on an edge that the fill rule does not give to this triangle. At the upper and right
        // rim of the chart the rule gives them to no other triangle either.
        let mut rim = [NONE; WIDE * WIDE];
        let first = [x, y].map(|x| x.max(1) - 1);
        let end = [(x + SIDE).min(self.nx) + 1, (y + SIDE).min(self.ny) + 1];
        let [low, high] = [first, end.map(|x| x - 1)].map(|p| DVec2::from(p.map(|x| x as f64)));
        for &t in triangles {
            let fill = Fill::new(self.tile.triangles[t as usize].uv.map(|uv| uv * cells));
            let mut put = |i: usize, j: usize, inside: bool| {
                let node = at(i + 1 - x, j + 1 - y);
                match (inside, triangle[node]) {
                    (true, NONE) => triangle[node] = t,
                    // Triangles of collars lie over no others of their chart.
                    (true, first) => layered[node] |= t.max(first) < self.tile.own() as u32,
                    (false, _) if rim[node] == NONE => rim[node] = t,
                    (false, _) => {}
                }
            };
            if fill.holds(low, high) {
                for j in first[1]..end[1] {
                    (first[0]..end[0]).for_each(|i| put(i, j, true));
                }
            } else {
                fill.visit_in(first, end, put);
            }
        }
        // Borders that lie on a line of the grid but for noise have the nodes of that line.
        for &t in triangles {
            for side in self.sides(t).map(|side| side.map(|uv| uv * cells)) {
                let Some([a, b]) = on_line(side) else { continue };
                let (low, high) = (a.min(b), a.max(b));
                nodes_of_segment(a, b, first, WIDE, |i, j| {
                    let [i, j] = [first[0] + i, first[1] + j];
                    // Not those beyond its ends.
                    let place = DVec2::new(i as f64, j as f64);
                    let is_on_it = place.cmpge(low).all() && place.cmple(high).all();
                    let node = at(i + 1 - x, j + 1 - y);
                    if is_on_it && i < end[0] && j < end[1] && rim[node] == NONE {
                        rim[node] = t;
                    }
                });
            }
        }
        for (triangle, rim) in triangle.iter_mut().zip(rim) {
            if *triangle == NONE {
                *triangle = rim;
            }
        }
        (triangle, layered)
    }

    /// The square's interior nodes.
    fn interior(
        &self,
        borders: &Borders,
        triangle: &[u32; WIDE * WIDE],
        layered: &[bool; WIDE * WIDE],
    ) -> NodeSet {
        let chart_of = |node: usize| match triangle[node] {
            NONE => NONE,
            t => self.charts[t as usize],
        };
        // True if a border matters to a chart.
        let counts = |border: u32, chart: u32| match self.overlap {
            Overlap::Fixed => border != NONE,
            Overlap::FirstFace => border == chart || border == SEVERAL,
        };
        let mut inside = [false; CELLS * CELLS];
        for j in 0..CELLS {
            for i in 0..CELLS {
                let corners = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
                let chart = chart_of(corners[0]);
                let crossed = counts(borders.cells[j * CELLS + i], chart)
                    || self.overlap == Overlap::Fixed && corners.iter().any(|&c| layered[c]);
                inside[j * CELLS + i] =
                    chart != NONE && !crossed && corners[1..].iter().all(|&c| chart_of(c) == chart);
            }
        }
        let mut interior = NodeSet::EMPTY;
        for j in 0..SIDE {
            for i in 0..SIDE {
                let cell = |di: usize, dj: usize| inside[(j + dj) * CELLS + i + di];
                let border = borders.nodes[j * SIDE + i];
                if cell(0, 0)
                    && cell(1, 0)
                    && cell(0, 1)
                    && cell(1, 1)
                    && !counts(border, chart_of(at(i + 1, j + 1)))
                {
                    interior.insert(i, j);
                }
            }
        }
        interior
    }

    /// The sides of a triangle at which its chart ends: each side's ends, and the corner opposite to it.
    fn sides(&self, t: u32) -> impl Iterator<Item = [DVec2; 3]> + use<'_> {
        let triangle = &self.tile.triangles[t as usize];
        let side = |k: usize| [1, 2, 0].map(|d| triangle.uv[(k + d) % 3]);
        (0..3).filter(|&k| triangle.neighbours[k] == NONE).map(side)
    }

    /// The borders of charts in a window, among them the outlines of gaps if that is asked for.
    fn borders(&self, x: usize, y: usize, triangles: &[u32], with_gaps: bool) -> Borders {
        let size = DVec2::new(self.nx as f64, self.ny as f64);
        let mut borders = Borders { cells: [NONE; CELLS * CELLS], nodes: [NONE; SIDE * SIDE] };
        let mark = |owner: &mut u32, chart: u32| {
            *owner = if *owner == NONE || *owner == chart { chart } else { SEVERAL };
        };
        let first_cell = [x as i64 - 1, y as i64 - 1];
        for &t in triangles {
            let chart = self.charts[t as usize];
            let cuts = self.tile.cuts_of(t).filter(|cut| with_gaps || !cut.is_gap).map(|cut| cut.uv);
            let sides = self.sides(t).map(|side| side.map(|uv| uv * size));
            let sides = sides.map(|side| on_line(side).unwrap_or([side[0], side[1]]));
            for [a, b] in sides.chain(cuts.map(|ends| ends.map(|uv| uv * size))) {
                cells_of_segment(a, b, first_cell, CELLS, |i, j| {
                    mark(&mut borders.cells[j * CELLS + i], chart)
                });
                nodes_of_segment(a, b, [x, y], SIDE, |i, j| mark(&mut borders.nodes[j * SIDE + i], chart));
            }
        }
        borders
    }
}

/// The borders of charts, including cuts of zero width. Each entry is a chart, `SEVERAL` for several charts, or
/// `NONE`.
struct Borders {
    /// Per cell of the window, the chart whose border crosses its interior.
    cells: [u32; CELLS * CELLS],
    /// Per node of the square, the chart whose border runs along an edge of the grid at the node.
    nodes: [u32; SIDE * SIDE],
}

/// Cells by which a border may be off a line of the grid and counts as on it: otherwise rounding of its UVs would
/// decide on whole rows of nodes.
const OFF_LINE: f64 = 1e-3;

/// A triangle's side that lies on a grid line but for noise, moved there; its ends are moved to nodes if they are as
/// near. `None` for other sides, and for those of slivers beside the line.
pub fn on_line([a, b, opposite]: [DVec2; 3]) -> Option<[DVec2; 2]> {
    let near = |x: f64| (x - x.round()).abs() <= OFF_LINE;
    let is_along = |line: usize| {
        let at = a[line].round();
        near(a[line])
            && near(b[line])
            && at == b[line].round()
            && (opposite[line] - at).abs() > 100.0 * OFF_LINE
    };
    let moved = |p: DVec2| DVec2::from([0, 1].map(|c| if near(p[c]) { p[c].round() } else { p[c] }));
    (is_along(0) || is_along(1)).then(|| [moved(a), moved(b)])
}

/// If the segment from `a` to `b` lies on a grid line, calls `f` for the nodes of each grid edge that it covers at
/// least partly. Only nodes of the square that begins at the node `first`, with `count` nodes on a side, count; `f`
/// receives their position in it.
pub fn nodes_of_segment(
    a: DVec2,
    b: DVec2,
    first: [usize; 2],
    count: usize,
    mut f: impl FnMut(usize, usize),
) {
    let first = first.map(|x| x as f64);
    for axis in 0..2 {
        let (along, line) = (axis, 1 - axis);
        let at = a[line];
        let on_grid = at == b[line] && at.fract() == 0.0;
        let inside = (first[line]..first[line] + count as f64).contains(&at);
        if !on_grid || !inside || a[along] == b[along] {
            continue;
        }
        let mut k = a[along].min(b[along]).floor().max(first[along]);
        let last = a[along].max(b[along]).ceil().min(first[along] + count as f64 - 1.0);
        while k <= last {
            let [along_place, line_place] = [k - first[along], at - first[line]].map(|x| x as usize);
            if along == 0 {
                f(along_place, line_place)
            } else {
                f(line_place, along_place)
            }
            k += 1.0;
        }
    }
}

/// Calls `f` for each cell whose open interior the segment from `a` to `b` crosses. Only cells of the square that
/// begins at the cell `first`, with `count` cells on a side, count; `f` receives their position in it.
pub fn cells_of_segment(a: DVec2, b: DVec2, first: [i64; 2], count: usize, mut f: impl FnMut(usize, usize)) {
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    let first = first.map(|x| x as f64);
    let end = first.map(|x| x + count as f64 - 1.0);
    let mut row = a.y.floor().max(first[1]);
    let last = (b.y.ceil() - 1.0).min(end[1]);
    while row <= last {
        let at = |y: f64| a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y)).clamp(0.0, 1.0);
        let level = a.y == b.y;
        let (x0, x1) = if level { (a.x, b.x) } else { (at(row.max(a.y)), at((row + 1.0).min(b.y))) };
        let mut x = x0.min(x1).floor().max(first[0]);
        let last = (x0.max(x1).ceil() - 1.0).min(end[0]);
        while x <= last {
            f((x - first[0]) as usize, (row - first[1]) as usize);
            x += 1.0;
        }
        row += 1.0;
    }
}
