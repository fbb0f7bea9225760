//! invert: computes W⁻¹ at texel centres or at single points from the displacements of the finest level (the paper's
//! eq. 9, method §9). Each warped cell is split into two triangles by its diagonal from (0,0) to (1,1). A texel centre
//! inside a triangle is assigned the barycentric interpolation of the triangle's corners at rest. The fill rule assigns
//! each centre to exactly one triangle, because the two triangles at an edge evaluate it on the same coordinates.

use glam::DVec2;

use crate::grid::fill::Fill;
use crate::grid::planes::{NODES, Plane, SIDE};
use crate::grid::window::{self, WINDOW_NODES, Window, place};
use crate::grid::{Grid, Level};
use crate::image::ImagePart;
use crate::mesh::triangle::barycentrics;

use crate::team::Team;

/// W⁻¹ at a texel centre.
pub(crate) struct Inverse<'a> {
    /// The point, in cells.
    pub p: [f64; 2],
    /// The chart whose warp it is.
    pub chart: u32,
    /// True if the point's cell is not wholly in the chart itself.
    pub is_beyond: bool,
    /// The triangle that contains the point.
    piece: &'a Piece,
}

impl Inverse<'_> {
    /// The derivatives of W⁻¹ in its triangle, in cells per texel: a row for each component of W⁻¹.
    pub fn jacobian(&self) -> [[f64; 2]; 2] {
        let Piece { rest, edges: [e1, e2], inverse } = self.piece;
        let (r1, r2) = (rest[1] - rest[0], rest[2] - rest[0]);
        [(r1.x, r2.x), (r1.y, r2.y)]
            .map(|(r1, r2)| [(r1 * e2.y - r2 * e1.y) * inverse, (r2 * e1.x - r1 * e2.x) * inverse])
    }
}

/// A triangle on which W is affine.
struct Piece {
    /// Corners at rest, in cells.
    rest: [DVec2; 3],
    /// Edges in the warp from the first corner to the other two, in texels.
    edges: [DVec2; 2],
    /// 1 divided by twice the area in the warp.
    inverse: f64,
}

/// Calls `put(x, y, inverse)` for each texel of a part of an image whose centre lies in a moved cell, with its position
/// in the whole image and W⁻¹ at the centre. W⁻¹ is the identity at all other texels. No texel is visited twice if the
/// warp is free of folds. `reach` must be at least the largest component of any displacement; the triangles of charts are the
/// first `own` ones.
pub(crate) fn texels(
    team: &Team,
    grid: &Grid,
    own: u32,
    u: &[[Plane; 2]],
    part: &ImagePart,
    reach: f32,
    put: impl Fn(usize, usize, Inverse) + Sync,
) {
    let size = part.size;
    let level = &grid.levels[0];
    let scale = DVec2::new(size[0] as f64 / level.nx as f64, size[1] as f64 / level.ny as f64);
    team.run(level.blocks.list.len(), |b| {
        let mut windows = [[0.0f32; WINDOW_NODES]; 2];
        let block = &level.blocks.list[b];
        let (x, y) = (block.x as usize * SIDE, block.y as usize * SIDE);
        // Skip blocks whose cells all lie outside the part.
        let misses = |axis: usize, at: usize| {
            let reach = f64::from(reach) + 1.0;
            let (low, high) = (at as f64 - reach, (at + SIDE) as f64 + reach);
            high * scale[axis] < part.first[axis] as f64 || low * scale[axis] > part.end[axis] as f64 + 1.0
        };
        if misses(0, x) || misses(1, y) || !load(level, u, b, &mut windows) {
            return;
        }
        let mut triangles: Window<u32> = [0; WINDOW_NODES];
        window::load(&level.blocks.neighbours[b], own, |b| &grid.triangle[b], &mut triangles);
        for j in 0..SIDE {
            for i in 0..SIDE {
                let corners = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| {
                    let at = place(i + 1 + di, j + 1 + dj);
                    let node = DVec2::new((x + i + di) as f64, (y + j + dj) as f64);
                    (node, DVec2::new(windows[0][at].into(), windows[1][at].into()))
                });
                if corners.iter().all(|c| c.1 == DVec2::ZERO) {
                    continue;
                }
                let is_beyond = |(di, dj)| triangles[place(i + 1 + di, j + 1 + dj)] >= own;
                let is_beyond = [(0, 0), (1, 0), (1, 1), (0, 1)].into_iter().any(is_beyond);
                for [a, b, c] in [[0, 1, 2], [0, 2, 3]] {
                    let rest = [a, b, c].map(|k| corners[k].0);
                    // All cells at this node compute the same texel coordinates.
                    let warped = [a, b, c].map(|k| (corners[k].0 + corners[k].1) * scale - 0.5);
                    triangle(block.chart, rest, warped, is_beyond, part, &put);
                }
            }
        }
    });
}

/// Gathers the displacements of block `b` with its halo. Returns whether any of them is not 0.
fn load(level: &Level, u: &[[Plane; 2]], b: usize, windows: &mut [Window; 2]) -> bool {
    for (c, window) in windows.iter_mut().enumerate() {
        window::load(&level.blocks.neighbours[b], 0.0, |b| &u[b][c], window);
    }
    windows.iter().flatten().any(|&x| x != 0.0)
}

/// Calls `put` for the texels whose centre lies in a warped triangle, given its corners at rest in cells and warped in
/// texels. A triangle without area, which only the paper's solver produces, covers no texel. In a sliver the rounded
/// coordinates are clamped to the triangle.
fn triangle(
    chart: u32,
    rest: [DVec2; 3],
    warped: [DVec2; 3],
    is_beyond: bool,
    part: &ImagePart,
    put: &impl Fn(usize, usize, Inverse),
) {
    let [a, b, c] = warped;
    let (e1, e2) = (b - a, c - a);
    let area = e1.perp_dot(e2);
    if area == 0.0 {
        return;
    }
    let piece = Piece { rest, edges: [e1, e2], inverse: 1.0 / area };
    Fill::new(warped).visit_in(part.first, part.end, |x, y, inside| {
        if !inside {
            return;
        }
        let d = DVec2::new(x as f64, y as f64) - a;
        let l1 = (d.perp_dot(e2) * piece.inverse).clamp(0.0, 1.0);
        let l2 = (e1.perp_dot(d) * piece.inverse).clamp(0.0, 1.0 - l1);
        let p = rest[0] + l1 * (rest[1] - rest[0]) + l2 * (rest[2] - rest[0]);
        put(x, y, Inverse { p: p.into(), chart, is_beyond, piece: &piece });
    });
}

/// Displacement of a node of a chart; 0 where no block is stored.
fn displacement(level: &Level, u: &[[Plane; 2]], chart: u32, i: i64, j: i64) -> DVec2 {
    let b = level.blocks.find(chart, i >> 4, j >> 4);
    if b == crate::mesh::NONE {
        return DVec2::ZERO;
    }
    let s = crate::grid::planes::slot(i as usize % SIDE, j as usize % SIDE);
    debug_assert!(s < NODES);
    u[b as usize].each_ref().map(|plane| f64::from(plane[s])).into()
}

/// The maximum number of rounds of Newton's method, and its longest step in cells: from a squeezed triangle a step may
/// lead far beyond the region where the triangle's map applies.
const ROUNDS: usize = 24;
const LONGEST_STEP: f64 = 8.0;

/// W⁻¹ at the point `c` of a chart, in cells; `None` if the four nodes around `c` have no displacement, or if the
/// search finds no triangle.
///
/// `reach` must be at least the largest component of the chart's displacements.
pub(crate) fn point(
    level: &Level,
    u: &[[Plane; 2]],
    chart: u32,
    c: [f64; 2],
    reach: f32,
) -> Option<[f64; 2]> {
    let c = DVec2::from(c);
    let cell = |p: DVec2| p.to_array().map(|x| x.floor() as i64);
    let at = |i: i64, j: i64| displacement(level, u, chart, i, j);
    let rest_cell = cell(c);
    let unmoved = [(0, 0), (1, 0), (0, 1), (1, 1)]
        .iter()
        .all(|&(di, dj)| at(rest_cell[0] + di, rest_cell[1] + dj) == DVec2::ZERO);
    if unmoved {
        return None;
    }
    // Newton's method: W is affine on each triangle, so the inverse of the present triangle's map usually leads into
    // the triangle of c. If it does not, the cells around its last point are searched in growing rings.
    let mut guess = c;
    for _ in 0..ROUNDS {
        let [i, j] = cell(guess);
        if let Some(p) = in_cell(&at, i, j, c) {
            return Some(p.into());
        }
        let part = guess - DVec2::new(i as f64, j as f64);
        let (u00, u11) = (at(i, j), at(i + 1, j + 1));
        // The columns of the derivative of u.
        let (du, dv) = if part.x >= part.y {
            let u10 = at(i + 1, j);
            (u10 - u00, u11 - u10)
        } else {
            let u01 = at(i, j + 1);
            (u11 - u01, u01 - u00)
        };
        let left = c - (guess + u00 + part.x * du + part.y * dv);
        let (a, b) = (DVec2::X + du, DVec2::Y + dv);
        let area = a.perp_dot(b);
        // In a triangle without area, which only the paper's solver leaves, use a step of the fixed-point iteration on
        // the displacement.
        let step = if area > 0.0 { DVec2::new(left.perp_dot(b), a.perp_dot(left)) / area } else { left };
        guess += step.clamp_length_max(LONGEST_STEP);
    }
    let [gi, gj] = cell(guess);
    // The right cell is no farther from c than the largest displacement; its distance from the guess may be greater by
    // the distance between the guess and c.
    let reach = f64::from(reach).ceil() as i64 + 2;
    let guess_distance = (gi - rest_cell[0]).abs().max((gj - rest_cell[1]).abs());
    for ring in 0..=reach + guess_distance {
        for j in gj - ring..=gj + ring {
            let step = if (j - gj).abs() == ring { 1 } else { 2 * ring.max(1) };
            let mut i = gi - ring;
            while i <= gi + ring {
                if let Some(p) = in_cell(&at, i, j, c) {
                    return Some(p.into());
                }
                i += step;
            }
        }
    }
    None
}

/// W⁻¹ at `c` if it lies in cell (i, j).
fn in_cell(at: &impl Fn(i64, i64) -> DVec2, i: i64, j: i64, c: DVec2) -> Option<DVec2> {
    let corner = |di: i64, dj: i64| {
        let rest = DVec2::new((i + di) as f64, (j + dj) as f64);
        (rest, rest + at(i + di, j + dj))
    };
    let corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
    [[0, 1, 2], [0, 2, 3]].into_iter().find_map(|k| {
        let [(ra, a), (rb, b), (rc, cc)] = k.map(|k| corners[k]);
        let [l1, l2] = barycentrics([a, b, cc], c);
        let inside = l1 >= -1e-9 && l2 >= -1e-9 && l1 + l2 <= 1.0 + 1e-9;
        inside.then(|| ra + l1 * (rb - ra) + l2 * (rc - ra))
    })
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;

    /// W⁻¹ at the texel centres that a warped triangle covers.
    fn covered(warped: [[f64; 2]; 3]) -> Vec<[f64; 2]> {
        let rest = [[3.0, 5.0], [4.0, 5.0], [4.0, 6.0]].map(DVec2::from);
        let found = RefCell::new(Vec::new());
        let part = ImagePart { size: [8, 8], first: [0, 0], end: [8, 8] };
        triangle(0, rest, warped.map(DVec2::from), false, &part, &|_, _, inverse: Inverse| {
            found.borrow_mut().push(inverse.p)
        });
        found.into_inner()
    }

    #[test]
    fn a_triangle_without_area_covers_nothing() {
        assert_eq!(covered([[2.0, 2.0]; 3]), [[0.0; 2]; 0]);
        assert_eq!(covered([[1.0, 1.0], [3.0, 3.0], [2.0, 2.0]]), [[0.0; 2]; 0]);
        assert_eq!(covered([[1.5, 1.5], [2.5, 1.5], [2.5, 2.5]]).len(), 1);
    }

    /// Slivers through a texel centre have coordinates with few significant digits.
    #[test]
    fn a_sliver_keeps_its_texels_within_the_cell() {
        let mut count = 0;
        for k in 0..2000 {
            let tiny = 4.5e-16 * f64::from(k % 50);
            let along = f64::from(k) * 1e-3;
            let warped =
                [[2.0 - along, 2.0 - along], [3.0 + along, 3.0 + along + tiny], [2.0, 2.0 - 3.0 * tiny]];
            for p in covered(warped) {
                count += 1;
                assert!((3.0..=4.0).contains(&p[0]) && (5.0..=6.0).contains(&p[1]), "{warped:?} {p:?}");
            }
        }
        assert!(count > 100, "{count}");
    }
}
