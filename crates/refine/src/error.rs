//! The largest distance between linear interpolation of redirected corner UVs and the redirection itself (method §14).
//!
//! The redirection is affine on each warped triangle of the grid, and the interpolation on each triangle of the mesh.
//! The length of their difference is therefore convex on each common piece of both, and greatest at a corner of one:
//! at a warped node inside of the triangle, or where an edge of the triangle crosses a warped edge of the grid. All of
//! these are visited, so that the figure is the maximum over the whole triangle and no sample of it.

use glam::DVec2;

use super::redirection::Redirection;
use super::sparse::Sparse;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::Result;
use vrtm_core::mesh::triangle::{barycentrics, point};
use vrtm_core::team::Team;

/// Barycentric coordinates and places on edges of at least minus this count as inside.
const SLACK: f64 = 1e-9;

/// The warped edges of a tile's grid, indexed by location. Lengths are in cells.
#[derive(Debug)]
pub struct Warped {
    nx: usize,
    ny: usize,
    /// Displacements of the nodes.
    u: Sparse<[f32; 2]>,
    /// Per unit square, the range of its entries in `cells`.
    ranges: Sparse<[u32; 2]>,
    /// The cells whose warped images may meet a square, for all squares. Those cells are left out whose first node has
    /// unmoved cells around it only: on these the redirection is the identity, and what lies between them and the
    /// others belongs to the others.
    cells: Vec<[u32; 2]>,
}

impl Warped {
    /// `None` if nothing moves.
    pub fn new(team: &Team, tile: &dyn Redirection) -> Result<Option<Warped>> {
        let [nx, ny] = tile.cells();
        let size = [nx + 1, ny + 1];
        let mut u = Sparse::new(size, [0.0; 2]);
        tile.visit_moved(&mut |[i, j], moved| *u.at(i, j) = moved)?;
        if u.is_empty() {
            return Ok(None);
        }
        let mut warped = Warped { nx, ny, u, ranges: Sparse::new(size, [0; 2]), cells: Vec::new() };
        // Cells beyond the last column and row consist of the tile's border only.
        let around = warped.u.around();
        let three = |x: usize, last: usize| x.saturating_sub(1)..=(x + 1).min(last);
        // One of the four cells around a node is moved.
        let is_near_moved =
            |i, j| three(j, ny).any(|y| three(i, nx).any(|x| *warped.u.get(x, y) != [0.0; 2]));
        let near = |k: usize| -> Vec<[u32; 2]> {
            let nodes = warped.u.nodes_of(around[k]).filter(|&[i, j]| is_near_moved(i, j));
            nodes.map(|node| node.map(|x| x as u32)).collect()
        };
        let near = team.map(around.len(), near);
        let mut ranges = Sparse::new(size, [0; 2]);
        warped.visit(&near, |[x, y], _| ranges.at(x, y)[1] += 1);
        let mut count = 0;
        for range in ranges.values() {
            let here = range[1];
            *range = [count; 2];
            count += here;
        }
        let mut cells = vec![[0; 2]; count as usize];
        warped.visit(&near, |[x, y], cell| {
            let next = &mut ranges.at(x, y)[1];
            cells[*next as usize] = cell;
            *next += 1;
        });
        (warped.ranges, warped.cells) = (ranges, cells);
        Ok(Some(warped))
    }

    /// Calls `f(square, cell)` for the squares that the box around a warped cell meets.
    fn visit(&self, near: &[Vec<[u32; 2]>], mut f: impl FnMut([usize; 2], [u32; 2])) {
        for &cell in near.iter().flatten() {
            let [i, j] = cell.map(|x| x as usize);
            let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(di, dj)| self.node(i + di, j + dj).at);
            let low = corners.into_iter().fold(corners[0], DVec2::min);
            let high = corners.into_iter().fold(corners[0], DVec2::max);
            let (xs, ys) = (square(low.x, high.x, self.nx), square(low.y, high.y, self.ny));
            for y in ys {
                xs.clone().for_each(|x| f([x, y], cell));
            }
        }
    }

    /// A warped node; beyond the last column and row nothing moves.
    fn node(&self, i: usize, j: usize) -> Node {
        let is_inside = i <= self.nx && j <= self.ny;
        let u = if is_inside { DVec2::from(self.u.get(i, j).map(f64::from)) } else { DVec2::ZERO };
        Node { at: DVec2::new(i as f64, j as f64) + u, u }
    }

    /// The greatest error on a triangle, in UV. `corners` are its UVs, in cells, and `redirected` the redirection's
    /// offsets at them.
    pub fn error(&self, corners: [DVec2; 3], redirected: [DVec2; 3]) -> f64 {
        let low = corners.into_iter().fold(corners[0], DVec2::min);
        let high = corners.into_iter().fold(corners[0], DVec2::max);
        let triangle = Interpolated { corners, added: redirected };
        let cells = DVec2::new(self.nx as f64, self.ny as f64);
        let mut worst = 0.0f64;
        let mut meet = |error: DVec2| worst = worst.max((error / cells).length_squared());
        for y in square(low.y, high.y, self.ny) {
            let sides = [0, 1, 2].map(|k| across(corners[k], corners[(k + 1) % 3], y as f64));
            let Some(whole) = sides.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
            else {
                continue;
            };
            for x in square(whole[0], whole[1], self.nx) {
                let [first, end] = *self.ranges.get(x, y);
                let here =
                    sides.map(|side| side.is_some_and(|side| square(side[0], side[1], self.nx).contains(&x)));
                for cell in &self.cells[first as usize..end as usize] {
                    let [i, j] = cell.map(|x| x as usize);
                    let first = self.node(i, j);
                    // Each node is handled in only one of the squares that its cell is entered in.
                    if first.at.floor() == DVec2::new(x as f64, y as f64)
                        && let Some(added) = triangle.at(first.at)
                    {
                        meet(added + first.u);
                    }
                    for (di, dj) in [(1, 0), (0, 1), (1, 1)] {
                        let second = self.node(i + di, j + dj);
                        let (least, most) = (first.at.min(second.at), first.at.max(second.at));
                        if least.cmpgt(high + SLACK).any() || most.cmplt(low - SLACK).any() {
                            continue;
                        }
                        for k in (0..3).filter(|&k| here[k]) {
                            if let Some(error) = triangle.crossing(k, &first, &second) {
                                meet(error);
                            }
                        }
                    }
                }
            }
        }
        worst.sqrt()
    }
}

/// A warped node: where it is, and by how much it moved.
struct Node {
    at: DVec2,
    u: DVec2,
}

/// Linear interpolation of the values at a triangle's corners.
struct Interpolated {
    corners: [DVec2; 3],
    added: [DVec2; 3],
}

impl Interpolated {
    /// The error where side `k` crosses a warped edge of the grid.
    fn crossing(&self, k: usize, first: &Node, second: &Node) -> Option<DVec2> {
        let a = self.corners[k];
        let side = self.corners[(k + 1) % 3] - a;
        let edge = second.at - first.at;
        let det = side.perp_dot(edge);
        if det == 0.0 {
            // If both lie on one line, the edge's nodes are visited instead.
            return None;
        }
        let between = first.at - a;
        let (t, s) = (between.perp_dot(edge) / det, between.perp_dot(side) / det);
        let is_inside = |x: f64| (-SLACK..=1.0 + SLACK).contains(&x);
        if !is_inside(t) || !is_inside(s) {
            return None;
        }
        let (from, to) = (self.added[k], self.added[(k + 1) % 3]);
        let moved = first.u + s.clamp(0.0, 1.0) * (second.u - first.u);
        Some(from + t.clamp(0.0, 1.0) * (to - from) + moved)
    }

    /// The value at a point inside.
    fn at(&self, p: DVec2) -> Option<DVec2> {
        let [l1, l2] = barycentrics(self.corners, p);
        // Also false for a triangle without area.
        let inside = l1 >= -SLACK && l2 >= -SLACK && l1 + l2 <= 1.0 + SLACK;
        inside.then(|| point(self.added, [l1, l2]))
    }
}

/// The squares from `low` to `high` along an axis, out of 0 to `last`.
fn square(low: f64, high: f64, last: usize) -> std::ops::RangeInclusive<usize> {
    // Rounding must not lose a point between two squares.
    let (low, high) = ((low - SLACK).floor(), (high + SLACK).floor());
    if high < 0.0 || low > last as f64 {
        #[expect(clippy::reversed_empty_ranges, reason = "an empty range is intended")]
        return 1..=0;
    }
    low.max(0.0) as usize..=high.min(last as f64) as usize
}

/// The extent along x of the part of a segment from the height y to y + 1.
fn across(a: DVec2, b: DVec2, y: f64) -> Option<[f64; 2]> {
    let (a, b) = if a.y <= b.y { (a, b) } else { (b, a) };
    if b.y < y - SLACK || a.y > y + 1.0 + SLACK {
        return None;
    }
    let x = |y: f64| {
        if y <= a.y {
            a.x
        } else if y >= b.y {
            b.x
        } else {
            a.x + (b.x - a.x) * ((y - a.y) / (b.y - a.y))
        }
    };
    let ends = [x(y - SLACK), x(y + 1.0 + SLACK)];
    Some([ends[0].min(ends[1]), ends[0].max(ends[1])])
}
