//! The squares of 16 by 16 nodes of a tile's grid that triangles meet, and the triangles of each. Preparing a tile
//! visits only these squares.

use glam::DVec2;

use crate::allocation::{Vec, zeroed};
use crate::grid::planes::SIDE;
use crate::image::map::PAGE;
use crate::mesh::{Chart, Cut, TileMesh};

/// A square of 16 by 16 nodes of a layer.
///
/// A chart with a collar is a layer of its own, since its collar may lie over other charts; all other charts are layer
/// 0 together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Square {
    pub layer: u32,
    /// Position (x, y), in squares.
    pub at: [u32; 2],
}

impl Square {
    /// The sort key of squares.
    pub fn key(&self) -> (u32, u32, u32) {
        (self.layer, self.at[1], self.at[0])
    }
}

/// The squares that a triangle meets.
pub struct Squares {
    /// Sorted by layer, y, x.
    pub list: Vec<Square>,
    /// The layer of each chart.
    layers: Vec<u32>,
    /// Per square, the index of its first triangle, followed by the total count.
    starts: Vec<u32>,
    /// The triangles of all squares, square by square, ascending in each.
    triangles: Vec<u32>,
}

/// Triangles that miss a window by less than this, in cells, are still listed.
const SLACK: f64 = 1e-5;

/// The layer of each chart.
pub fn layers(tile: &TileMesh) -> Vec<u32> {
    let layer = |(c, chart): (usize, &Chart)| if chart.collar.is_empty() { 0 } else { c as u32 + 1 };
    tile.charts.iter().enumerate().map(layer).collect()
}

impl Squares {
    /// Finds the squares of a grid of nx by ny cells whose nodes, or a neighbour of one, may lie on a triangle.
    /// `charts` has the chart of each triangle.
    pub fn new(tile: &TileMesh, charts: &[u32], nx: usize, ny: usize) -> Squares {
        let cells = DVec2::new(nx as f64, ny as f64);
        let layers = layers(tile);
        let range = [[0, 0], [nx, ny].map(|n| (n / SIDE) as u32)];
        // The window of square x covers the nodes from 16 x - 1 to 16 x + 16.
        let window = [DVec2::ONE, DVec2::ZERO];
        let mut pairs: Vec<(u32, u32, u32, u32)> = Vec::new();
        for ((t, triangle), &chart) in tile.triangles.iter().enumerate().zip(charts) {
            let corners = triangle.uv.map(|uv| uv * cells);
            each_square(corners, range, window, |x, y| pairs.push((layers[chart as usize], y, x, t as u32)));
        }
        // The outline of a gap that welding closed may leave its triangle.
        for Cut { triangle, uv, .. } in &tile.cuts {
            let [a, b] = uv.map(|uv| uv * cells);
            let layer = layers[charts[*triangle as usize] as usize];
            each_square([a, b, b], range, window, |x, y| pairs.push((layer, y, x, *triangle)));
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut squares = Squares { list: Vec::new(), layers, starts: Vec::new(), triangles: Vec::new() };
        squares.triangles.reserve_exact(pairs.len());
        for of_square in pairs.chunk_by(|a, b| (a.0, a.1, a.2) == (b.0, b.1, b.2)) {
            let (layer, y, x, _) = of_square[0];
            squares.list.push(Square { layer, at: [x, y] });
            squares.starts.push(squares.triangles.len() as u32);
            squares.triangles.extend(of_square.iter().map(|pair| pair.3));
        }
        squares.starts.push(squares.triangles.len() as u32);
        squares
    }

    /// The index of the square at (x, y) in the layer of a chart.
    pub fn find(&self, chart: u32, x: u32, y: u32) -> Option<usize> {
        self.index(Square { layer: self.layers[chart as usize], at: [x, y] })
    }

    pub fn index(&self, square: Square) -> Option<usize> {
        self.list.binary_search_by_key(&square.key(), Square::key).ok()
    }

    /// The triangles that meet a square or the nodes next to it, ascending.
    pub fn triangles(&self, square: usize) -> &[u32] {
        &self.triangles[self.starts[square] as usize..self.starts[square + 1] as usize]
    }

    /// Upper bound of the bytes in use while the squares are found.
    pub fn bytes(&self) -> usize {
        self.list.len() * 16 + self.triangles.len() * 20
    }
}

/// The pages of a map of `size` texels that a grid of the tile, however coarse, may read under its charts, row by row.
pub fn pages_near(tile: &TileMesh, size: [usize; 2]) -> Vec<bool> {
    let size_in_cells = DVec2::from(size.map(|n| n as f64)) / PAGE as f64 * SIDE as f64;
    // Half a cell of the coarsest grid, plus the reach of the bilinear filter.
    let margin = size_in_cells * (0.5 / SIDE as f64) + 2.0 * SIDE as f64 / PAGE as f64;
    let [columns, rows] = size.map(|n| n.div_ceil(PAGE));
    let mut near = zeroed(columns * rows);
    for triangle in &tile.triangles {
        let corners = triangle.uv.map(|uv| uv * size_in_cells);
        let range = [[0, 0], [columns as u32 - 1, rows as u32 - 1]];
        each_square(corners, range, [margin, margin], |x, y| {
            near[y as usize * columns + x as usize] = true;
        });
    }
    near
}

/// Calls `f(x, y)` for the squares of 16 cells, from `first` to `last` along both axes, that a triangle meets. For the
/// test, a square is extended by `below` and `above`.
pub fn each_square(
    corners: [DVec2; 3],
    [first, last]: [[u32; 2]; 2],
    [below, above]: [DVec2; 2],
    mut f: impl FnMut(u32, u32),
) {
    let side = SIDE as f64;
    let low = corners[0].min(corners[1]).min(corners[2]);
    let high = corners[0].max(corners[1]).max(corners[2]);
    let range = |axis: usize| {
        let start = ((low[axis] - SLACK - above[axis] - side) / side).ceil().max(first[axis].into());
        let end = ((high[axis] + SLACK + below[axis]) / side).floor().min(last[axis].into());
        (end >= start).then_some((start as u32, end as u32))
    };
    let (Some((x0, x1)), Some((y0, y1))) = (range(0), range(1)) else { return };
    let is_small = x1 - x0 <= 1 && y1 - y0 <= 1;
    for y in y0..=y1 {
        for x in x0..=x1 {
            let square = DVec2::new(f64::from(x), f64::from(y)) * side;
            if is_small || meets(corners, square - below, square + side + above) {
                f(x, y);
            }
        }
    }
}

/// False if an edge of the triangle separates it from the box between two corners.
fn meets(corners: [DVec2; 3], low: DVec2, high: DVec2) -> bool {
    (0..3).all(|k| {
        let (a, b, c) = (corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]);
        let edge = b - a;
        let normal = if edge.perp_dot(c - a) < 0.0 { edge.perp() * -1.0 } else { edge.perp() };
        // The corner of the box that lies farthest towards the triangle's side.
        let far = DVec2::select(normal.cmpge(DVec2::ZERO), high, low);
        normal.dot(far - a) >= -SLACK * edge.length()
    })
}
