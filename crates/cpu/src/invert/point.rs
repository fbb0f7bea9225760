//! W⁻¹ at single points, such as the corners of faces (method §9).

use std::cell::Cell;

use glam::DVec2;

use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::mesh::NONE;
use vrtm_core::mesh::triangle::barycentrics;

/// The displacements of a chart's nodes; 0 where no block is stored.
struct Displacements<'a> {
    level: &'a Level,
    u: &'a [[Plane; 2]],
    chart: u32,
    /// The place of the block that was found last, and the block: most nodes that are asked for lie in the same one.
    last: Cell<([i64; 2], u32)>,
}

impl Displacements<'_> {
    fn at(&self, i: i64, j: i64) -> DVec2 {
        let place = [i >> 4, j >> 4];
        let (mut last, mut block) = self.last.get();
        if last != place {
            (last, block) = (place, self.level.blocks.find(self.chart, place[0], place[1]));
            self.last.set((last, block));
        }
        if block == NONE {
            return DVec2::ZERO;
        }
        let s = slot(i as usize % SIDE, j as usize % SIDE);
        let [x, y] = &self.u[block as usize];
        DVec2::new(x[s].into(), y[s].into())
    }
}

/// The maximum number of rounds of Newton's method, and its longest step in cells: from a squeezed triangle a step may
/// lead far beyond the region where the triangle's map applies.
const ROUNDS: usize = 24;
const LONGEST_STEP: f64 = 8.0;

/// W⁻¹ at the point `c` of a chart, in cells; `None` if the four nodes around `c` have no displacement, or if the
/// search finds no triangle.
///
/// `reach` must be at least the largest component of the chart's displacements.
pub fn point(level: &Level, u: &[[Plane; 2]], chart: u32, c: [f64; 2], reach: f32) -> Option<[f64; 2]> {
    let c = DVec2::from(c);
    let cell = |p: DVec2| p.to_array().map(|x| x.floor() as i64);
    let displacements = Displacements { level, u, chart, last: Cell::new(([i64::MIN; 2], NONE)) };
    let at = |i: i64, j: i64| displacements.at(i, j);
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
