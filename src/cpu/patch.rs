//! One block's problem, gathered for work: the energy of DESIGN 5 seen from one row of eight nodes of one colour.

use crate::mesh::NONE;
use crate::settings::TileSettings;
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE};
use crate::tile::halo::{self, WINDOW_NODES, Window, place};

use super::lanes::{LANES, Mask, V, each};
use super::surface::{Sample, Slopes, Surface};
use super::team::Shared;

/// The eight neighbours of a node: offset, which owned edge leads there, and whether the neighbour owns it.
pub const NEIGHBOURS: [(i64, i64, usize, bool); 8] = [
    (1, 0, 0, false),
    (0, 1, 1, false),
    (1, 1, 2, false),
    (-1, 1, 3, false),
    (-1, 0, 0, true),
    (0, -1, 1, true),
    (-1, -1, 2, true),
    (1, -1, 3, true),
];

/// The four cells around a node, as the signs of their directions.
pub const QUADRANTS: [(i64, i64); 4] = [(1, 1), (-1, 1), (1, -1), (-1, -1)];

/// The energy's weights.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    pub smoothness: f32,
    pub smoothness_floor: f32,
    pub orientation: f32,
    pub orientation_density: f32,
    pub room: f32,
    pub room_threshold: f32,
}

impl Weights {
    /// True if any edge has an orientation to keep.
    #[inline(always)]
    pub fn orients(&self) -> bool {
        self.orientation > 0.0 || self.orientation_density > 0.0
    }

    pub fn new(settings: &TileSettings) -> Weights {
        Weights {
            smoothness: settings.smoothness,
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
            orientation_density: settings.orientation_density,
            room: settings.room,
            room_threshold: settings.room_threshold,
        }
    }
}

/// Per block, the state of a level that a sweep changes.
#[derive(Clone, Copy)]
pub struct State {
    pub u: Shared<[Plane; 2]>,
    /// Positions on the finest level, metrics on coarser ones, at W(p).
    pub value: Shared<[Plane; 3]>,
    /// The triangle under W(p): finest level only, empty elsewhere.
    pub triangle: Shared<Plane<u32>>,
}

/// A block with its ring.
#[derive(Debug)]
pub struct Patch {
    pub block: usize,
    /// The block's first node.
    pub x: i64,
    pub y: i64,
    pub u: [Window; 2],
    pub value: [Window; 3],
    pub triangle: Window<u32>,
    pub rigidity: Window,
    pub length: [Window; 4],
    pub movable: Window<u8>,
    /// All 0 unless a setting asks for it.
    pub density: Window,
    dense: bool,
    /// Of the block's own nodes.
    pub slope: [Plane; 6],
    pub floor: f32,
}

/// Eight nodes of one colour, in one row of a block.
#[derive(Clone, Copy)]
pub struct Row {
    /// Colour.
    pub ci: usize,
    /// Row of nodes, 0..16.
    pub j: usize,
}

impl Row {
    /// All rows of a colour.
    pub fn of_colour(colour: usize) -> impl Iterator<Item = Row> {
        (0..SIDE / 2).map(move |r| Row { ci: colour & 1, j: 2 * r + (colour >> 1) })
    }

    /// Place of the first lane's neighbour at (di, dj) in a window; the other lanes follow.
    #[inline(always)]
    pub fn at(self, di: i64, dj: i64) -> usize {
        place((self.ci as i64 + 1 + di) as usize, (self.j as i64 + 1 + dj) as usize)
    }

    /// Slot of the first lane in a plane; the other lanes follow.
    #[inline(always)]
    pub fn slot(self) -> usize {
        crate::tile::blocks::slot(self.ci, self.j)
    }

    /// Column of a lane's node.
    #[inline(always)]
    pub fn column(self, lane: usize) -> usize {
        2 * lane + self.ci
    }
}

/// What a row's nodes are at: displacement and sample.
#[derive(Clone, Copy)]
pub struct Place {
    pub u: [V; 2],
    pub value: [V; 3],
    pub slope: Slopes,
    pub triangle: [u32; LANES],
}

/// Gradient and Gauss-Newton matrix (halves of the derivatives), energy, and the corner Jacobians touched.
pub struct Local {
    pub energy: V,
    pub gradient: [V; 2],
    /// (xx, xy, yy).
    pub matrix: [V; 3],
    /// J and its gradient, three corners for each of four cells.
    pub corners: [(V, [V; 2]); 12],
}

impl Patch {
    pub fn zeroed() -> Box<Patch> {
        Box::new(Patch {
            block: 0,
            x: 0,
            y: 0,
            u: [[0.0; WINDOW_NODES]; 2],
            value: [[0.0; WINDOW_NODES]; 3],
            triangle: [NONE; WINDOW_NODES],
            rigidity: [0.0; WINDOW_NODES],
            length: [[0.0; WINDOW_NODES]; 4],
            movable: [0; WINDOW_NODES],
            density: [0.0; WINDOW_NODES],
            dense: false,
            slope: [[0.0; NODES]; 6],
            floor: 0.0,
        })
    }

    /// Gathers block `b` of a level.
    ///
    /// # Safety
    /// No other item writes this block or one around it now.
    #[inline(always)]
    pub unsafe fn load<S: Surface>(&mut self, level: &Level, state: State, surface: S, b: usize) {
        let around = &level.blocks.around[b];
        let block = &level.blocks.list[b];
        self.block = b;
        self.x = i64::from(block.x) * SIDE as i64;
        self.y = i64::from(block.y) * SIDE as i64;
        self.floor = level.floor[block.chart as usize];
        // SAFETY: the caller's promise.
        unsafe {
            for c in 0..2 {
                halo::load(around, 0.0, |b| &state.u.get(b)[c], &mut self.u[c]);
            }
            for c in 0..3 {
                halo::load(around, 0.0, |b| &state.value.get(b)[c], &mut self.value[c]);
            }
            if S::CHORDS {
                halo::load(around, NONE, |b| state.triangle.get(b), &mut self.triangle);
            }
        }
        halo::load(around, 0.0, |b| &level.rigidity[b], &mut self.rigidity);
        halo::load(around, 0, |b| &level.movable[b], &mut self.movable);
        if !level.density.is_empty() {
            halo::load(around, 0.0, |b| &level.density[b], &mut self.density);
        } else if self.dense {
            self.density = [0.0; WINDOW_NODES];
        }
        self.dense = !level.density.is_empty();
        for e in 0..4 {
            halo::load(around, 0.0, |b| &level.rest_length[b][e], &mut self.length[e]);
        }
        for s in 0..NODES {
            let (i, j) = crate::tile::blocks::node_at(s);
            let at = place(i + 1, j + 1);
            if self.movable[at] != 0 {
                let slope = self.slope_at_window(surface, at, i + 1, j + 1);
                for (plane, x) in self.slope.iter_mut().zip(slope) {
                    plane[s] = x;
                }
            }
        }
    }

    /// The slope of the surface at place `at` = (i, j) of the window, where W(p) is now.
    #[inline(always)]
    pub fn slope_at_window<S: Surface>(&self, surface: S, at: usize, i: usize, j: usize) -> [f32; 6] {
        let u = [self.u[0][at], self.u[1][at]];
        let (i, j) = (self.x + i as i64 - 1, self.y + j as i64 - 1);
        surface.slope(self.block, i, j, u, self.triangle[at])
    }

    /// Where a row's nodes are now.
    #[inline(always)]
    pub fn here(&self, row: Row) -> Place {
        let at = row.at(0, 0);
        let s = row.slot();
        let mut triangle = [NONE; LANES];
        triangle.copy_from_slice(&self.triangle[at..at + LANES]);
        Place {
            u: each!([0, 1], |c| V::load(&self.u[c], at)),
            value: each!([0, 1, 2], |c| V::load(&self.value[c], at)),
            slope: each!([0, 1, 2, 3, 4, 5], |c| V::load(&self.slope[c], s)),
            triangle,
        }
    }

    /// Samples the surface for a row at displacements `u`; lanes that do not move keep what they have. The mask says
    /// where there is a sample.
    #[inline(always)]
    pub fn sample<S: Surface>(
        &self,
        surface: S,
        row: Row,
        here: &Place,
        u: &[V; 2],
        lanes: &Mask,
    ) -> (Place, Mask) {
        let mut there = Place { u: *u, ..*here };
        let mut found = *lanes;
        for k in 0..LANES {
            if lanes.0[k] == 0 {
                continue;
            }
            let (i, j) = (self.x + row.column(k) as i64, self.y + row.j as i64);
            match surface.sample(self.block, i, j, [u[0].0[k], u[1].0[k]], here.triangle[k]) {
                Some(Sample { value, slope, triangle }) => {
                    for (v, x) in there.value.iter_mut().zip(value) {
                        v.0[k] = x;
                    }
                    for (v, x) in there.slope.iter_mut().zip(slope) {
                        v.0[k] = x;
                    }
                    there.triangle[k] = triangle;
                }
                None => found.0[k] = 0,
            }
        }
        (there, found)
    }

    /// An edge's ends and constants: neighbour's value, both on one triangle, offset d, l, 1 / max(l, floor), w.
    #[inline(always)]
    pub fn edge(&self, row: Row, p: &Place, k: usize) -> Edge {
        let (di, dj, e, theirs) = NEIGHBOURS[k];
        let n = row.at(di, dj);
        let owner = if theirs { n } else { row.at(0, 0) };
        let length = V::load(&self.length[e], owner);
        let weight = V::load(&self.rigidity, row.at(0, 0)).max(V::load(&self.rigidity, n));
        Edge {
            at: n,
            value: each!([0, 1, 2], |c| V::load(&self.value[c], n)),
            same: Mask::equal(&self.triangle, n, &p.triangle),
            d: [(V::load(&self.u[0], n) - p.u[0]) + di as f32, (V::load(&self.u[1], n) - p.u[1]) + dj as f32],
            length,
            inverse: V::ONE / length.max(V::splat(self.floor)),
            weight,
            density: if self.dense {
                (V::load(&self.density, row.at(0, 0)) + V::load(&self.density, n)) * 0.5
            } else {
                V::ZERO
            },
            shorter: 1.0 / (di * di + dj * dj) as f32,
            normal: [-dj as f32, di as f32],
        }
    }

    /// Energy of the edges and corners of a row's nodes, each node's own in its lane.
    #[inline(always)]
    pub fn energy<S: Surface>(&self, row: Row, p: &Place, weights: &Weights) -> V {
        let mut energy = V::ZERO;
        for k in 0..8 {
            let edge = self.edge(row, p, k);
            let length = S::length(&p.value, &p.slope, &edge.value, edge.same, &edge.d);
            energy += edge.energy(k, length, weights);
        }
        for corner in &self.corners(row, p) {
            energy += room(corner.0, weights);
        }
        energy
    }

    /// Everything a node's own Gauss-Newton step needs.
    #[inline(always)]
    pub fn local<S: Surface>(&self, row: Row, p: &Place, weights: &Weights) -> Local {
        let mut energy = V::ZERO;
        let mut gradient = [V::ZERO; 2];
        let mut matrix = [V::ZERO; 3];
        for k in 0..8 {
            let edge = self.edge(row, p, k);
            let (length, near, _) = S::gradient(&p.value, &p.slope, &edge.value, edge.same, &edge.d);
            energy += edge.energy(k, length, weights);
            let scaled = edge.weight * edge.inverse;
            let pull = scaled * ((length - edge.length) * edge.inverse);
            let square = scaled * edge.inverse;
            let smooth = edge.smoothness(weights);
            let rest = edge.stretch(k);
            for c in 0..2 {
                gradient[c] += pull * near[c] - smooth * rest[c];
            }
            matrix[0] += square * near[0] * near[0] + smooth;
            matrix[1] += square * near[0] * near[1];
            matrix[2] += square * near[1] * near[1] + smooth;
            if weights.orients() {
                let [nx, ny] = edge.normal;
                let kappa = edge.orientation(weights);
                let off = edge.off_axis() * kappa;
                gradient[0] -= off * nx;
                gradient[1] -= off * ny;
                matrix[0] += kappa * (nx * nx);
                matrix[1] += kappa * (nx * ny);
                matrix[2] += kappa * (ny * ny);
            }
        }
        let corners = self.corners(row, p);
        for (jacobian, slope) in &corners {
            energy += room(*jacobian, weights);
            let lack = (V::splat(weights.room_threshold) - *jacobian).max(V::ZERO);
            let active = jacobian.lt(V::splat(weights.room_threshold));
            let beta = active.select(V::splat(weights.room), V::ZERO);
            let pull = lack * weights.room;
            gradient[0] -= pull * slope[0];
            gradient[1] -= pull * slope[1];
            matrix[0] += beta * slope[0] * slope[0];
            matrix[1] += beta * slope[0] * slope[1];
            matrix[2] += beta * slope[1] * slope[1];
        }
        Local { energy, gradient, matrix, corners }
    }

    /// Corner Jacobians that a row's nodes touch, each affine in the node, with their gradients: per cell that of the
    /// node's own corner, of its x-neighbour's, of its y-neighbour's.
    #[inline(always)]
    pub fn corners(&self, row: Row, p: &Place) -> [(V, [V; 2]); 12] {
        let mut corners = [(V::ZERO, [V::ZERO; 2]); 12];
        for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
            let to = |di: i64, dj: i64| {
                let n = row.at(di, dj);
                [(V::load(&self.u[0], n) - p.u[0]) + di as f32, (V::load(&self.u[1], n) - p.u[1]) + dj as f32]
            };
            let (a, b, c) = (to(sx, 0), to(0, sy), to(sx, sy));
            let sign = (sx * sy) as f32;
            let corner = |a: &[V; 2], b: &[V; 2]| {
                let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
                (jacobian, [(a[1] - b[1]) * sign, (b[0] - a[0]) * sign])
            };
            corners[3 * q] = corner(&a, &b);
            corners[3 * q + 1] = corner(&a, &c);
            corners[3 * q + 2] = corner(&c, &b);
        }
        corners
    }
}

/// β max(0, τ - J)².
#[inline(always)]
pub fn room(jacobian: V, weights: &Weights) -> V {
    let lack = (V::splat(weights.room_threshold) - jacobian).max(V::ZERO);
    lack * lack * weights.room
}

/// One edge of each of a row's nodes.
pub struct Edge {
    /// Place of the neighbours in the windows.
    pub at: usize,
    pub value: [V; 3],
    pub same: Mask,
    pub d: [V; 2],
    pub length: V,
    pub inverse: V,
    pub weight: V,
    /// Mean of both ends.
    pub density: V,
    /// 1 / |d0|².
    pub shorter: f32,
    /// d0 turned by 90 degrees (not unit: its length is |d0|).
    pub normal: [f32; 2],
}

impl Edge {
    /// (λ (1-w) + λ0) / |d0|².
    #[inline(always)]
    pub fn smoothness(&self, weights: &Weights) -> V {
        ((V::ONE - self.weight) * weights.smoothness + weights.smoothness_floor) * self.shorter
    }

    /// κ / |d0|⁴: κ is the mean of both ends', and `normal` and `off_axis` have a length of |d0| each.
    #[inline(always)]
    pub fn orientation(&self, weights: &Weights) -> V {
        (self.density * weights.orientation_density + V::splat(weights.orientation))
            * (self.shorter * self.shorter)
    }

    /// d - d0.
    #[inline(always)]
    fn stretch(&self, k: usize) -> [V; 2] {
        [self.d[0] - NEIGHBOURS[k].0 as f32, self.d[1] - NEIGHBOURS[k].1 as f32]
    }

    /// |d0| n0·d.
    #[inline(always)]
    fn off_axis(&self) -> V {
        self.d[0] * self.normal[0] + self.d[1] * self.normal[1]
    }

    /// The edge's terms of the energy.
    #[inline(always)]
    pub fn energy(&self, k: usize, length: V, weights: &Weights) -> V {
        let strain = (length - self.length) * self.inverse;
        let rest = self.stretch(k);
        let mut energy = self.weight * strain * strain
            + self.smoothness(weights) * (rest[0] * rest[0] + rest[1] * rest[1]);
        if weights.orients() {
            let off = self.off_axis();
            energy += off * off * self.orientation(weights);
        }
        energy
    }
}
