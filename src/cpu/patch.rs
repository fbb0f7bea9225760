//! One block's problem, gathered for work: the energy of DESIGN 5 seen from one row of eight nodes of one colour.

use crate::mesh::NONE;
use crate::settings::TileSettings;
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE};
use crate::tile::halo::{self, WINDOW_NODES, Window, place};

use super::lanes::{LANES, Lanes, Truth, each};
use super::surface::{Samples, Site, Surface};
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
    pub room: f32,
    pub room_threshold: f32,
}

impl Weights {
    pub fn new(settings: &TileSettings) -> Weights {
        Weights {
            smoothness: settings.smoothness,
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
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
    /// 1 / max(l, floor).
    pub inverse: [Window; 4],
    pub movable: Window<u8>,
    /// Of the block's own nodes.
    pub slope: [Plane; 6],
    pub floor: f32,
}

/// Eight nodes of one colour, in one row of a block.
#[derive(Clone, Copy)]
pub struct Row {
    /// Column of the first lane's node: 0 or 1.
    ci: usize,
    /// Row of nodes, 0..16.
    j: usize,
}

impl Row {
    /// All rows of a colour.
    #[inline(always)]
    pub fn of_colour(colour: usize) -> impl Iterator<Item = Row> {
        (0..SIDE / 2).map(move |r| Row { ci: colour & 1, j: 2 * r + (colour >> 1 & 1) })
    }

    /// All rows of a block.
    #[inline(always)]
    pub fn all() -> impl Iterator<Item = Row> {
        (0..4).flat_map(Row::of_colour)
    }

    /// Column of the first lane's node.
    #[inline(always)]
    pub fn column(self) -> usize {
        self.ci
    }

    /// Row of nodes, 0..16.
    #[inline(always)]
    pub fn line(self) -> usize {
        self.j
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

    /// A window's numbers at the neighbours at (di, dj), each -1, 0 or 1.
    #[inline(always)]
    pub fn near<V: Lanes>(self, window: &Window, di: i64, dj: i64) -> V {
        assert!(di.unsigned_abs() <= 1 && dj.unsigned_abs() <= 1);
        let at = self.at(di, dj);
        // SAFETY: ci < 2 and j < 16, so the eight places end at column 17 and row 17 of the window at most.
        V::load(unsafe { window.get_unchecked(at..at + LANES) }, 0)
    }

    /// A plane's numbers at the row.
    #[inline(always)]
    pub fn of<V: Lanes>(self, plane: &Plane) -> V {
        let s = self.slot();
        // SAFETY: ci < 2 and j < 16, so the slot is that of a row of one of the four colours.
        V::load(unsafe { plane.get_unchecked(s..s + LANES) }, 0)
    }

    /// Sets a plane's numbers at the row.
    #[inline(always)]
    pub fn set<V: Lanes>(self, plane: &mut Plane, x: V) {
        let s = self.slot();
        // SAFETY: as in `of`.
        x.store(unsafe { plane.get_unchecked_mut(s..s + LANES) }, 0);
    }

    /// Offsets from the row's nodes, displaced by `own`, to their neighbours at (di, dj), in cells.
    #[inline(always)]
    pub fn offset<V: Lanes>(self, u: &[Window; 2], own: &[V; 2], di: i64, dj: i64) -> [V; 2] {
        let (x, y) = (self.near::<V>(&u[0], di, dj), self.near::<V>(&u[1], di, dj));
        [(x - own[0]) + di as f32, (y - own[1]) + dj as f32]
    }

    /// Sets a window's numbers at the row.
    #[inline(always)]
    pub fn set_own<V: Lanes>(self, window: &mut Window, x: V) {
        let at = self.at(0, 0);
        // SAFETY: as in `near`.
        x.store(unsafe { window.get_unchecked_mut(at..at + LANES) }, 0);
    }
}

/// What a row's nodes are at: displacement and sample.
#[derive(Clone, Copy)]
pub struct Place<V: Lanes> {
    pub u: [V; 2],
    pub on: Samples<V>,
}

/// The energy of what a row's nodes touch.
pub struct Terms<V> {
    /// The sum, each node's own in its lane.
    pub energy: V,
    /// Of the edges to each of the neighbours.
    pub edges: [V; 8],
    /// J and its gradient, three corners for each of four cells.
    pub corners: [(V, [V; 2]); 12],
}

/// The energy, and its gradient and Gauss-Newton matrix (halves of the derivatives).
pub struct Local<V> {
    pub terms: Terms<V>,
    pub gradient: [V; 2],
    /// (xx, xy, yy).
    pub matrix: [V; 3],
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
            inverse: [[0.0; WINDOW_NODES]; 4],
            movable: [0; WINDOW_NODES],
            slope: [[0.0; NODES]; 6],
            floor: 0.0,
        })
    }

    /// Gathers block `b` of a level.
    ///
    /// # Safety
    /// No other item writes this block or one around it now.
    #[inline(always)]
    pub unsafe fn load<V: Lanes, S: Surface>(&mut self, level: &Level, state: State, b: usize) {
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
        let floor = V::splat(self.floor);
        for e in 0..4 {
            halo::load(around, 0.0, |b| &level.rest_length[b][e], &mut self.length[e]);
            // The last step overlaps the one before it.
            for at in (0..WINDOW_NODES - LANES).step_by(LANES).chain([WINDOW_NODES - LANES]) {
                (V::one() / V::load(&self.length[e], at).max(floor)).store(&mut self.inverse[e], at);
            }
        }
    }

    /// Gathers the slopes at the block's own nodes, where W(p) is now.
    #[inline(always)]
    pub fn load_slopes<V: Lanes, S: Surface>(&mut self, surface: S) {
        for row in (0..4).flat_map(Row::of_colour) {
            let at = row.at(0, 0);
            let lanes = self.movable_lanes::<V>(row);
            if !lanes.any() {
                continue;
            }
            let mut triangle = [NONE; LANES];
            triangle.copy_from_slice(&self.triangle[at..at + LANES]);
            let u = each!([0, 1], |c| V::load(&self.u[c], at));
            let slope = surface.slope_row(&self.site(row), &u, &triangle, lanes);
            for (plane, x) in self.slope.iter_mut().zip(slope) {
                x.store(plane, row.slot());
            }
        }
    }

    /// 1 where the neighbours at (di, dj) of a row's nodes may move, 0 elsewhere.
    #[inline(always)]
    pub fn movable_near<V: Lanes>(&self, row: Row, di: i64, dj: i64) -> V {
        V::load_u8(&self.movable, row.at(di, dj))
    }

    /// The lanes of a row that may move.
    #[inline(always)]
    pub fn movable_lanes<V: Lanes>(&self, row: Row) -> V::Mask {
        V::zero().lt(V::load_u8(&self.movable, row.at(0, 0)))
    }

    /// Where a row's nodes are in the level.
    #[inline(always)]
    pub fn site(&self, row: Row) -> Site {
        Site { block: self.block, i: self.x + row.ci as i64, j: self.y + row.j as i64 }
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
    pub fn here<V: Lanes>(&self, row: Row) -> Place<V> {
        let at = row.at(0, 0);
        let s = row.slot();
        Place {
            u: each!([0, 1], |c| V::load(&self.u[c], at)),
            on: Samples {
                value: each!([0, 1, 2], |c| V::load(&self.value[c], at)),
                slope: each!([0, 1, 2, 3, 4, 5], |c| V::load(&self.slope[c], s)),
                triangle: V::load_index(&self.triangle, at),
            },
        }
    }

    /// Takes over where the lanes of a row moved to.
    #[inline(always)]
    pub fn keep<V: Lanes, S: Surface>(&mut self, row: Row, lanes: V::Mask, there: &Place<V>) {
        let (at, s) = (row.at(0, 0), row.slot());
        for c in 0..2 {
            blend(lanes, &mut self.u[c], at, there.u[c]);
        }
        for c in 0..3 {
            blend(lanes, &mut self.value[c], at, there.on.value[c]);
        }
        for c in 0..6 {
            blend(lanes, &mut self.slope[c], s, there.on.slope[c]);
        }
        if S::CHORDS {
            let old = V::load_index(&self.triangle, at);
            V::store_index(V::select_index(lanes, there.on.triangle, old), &mut self.triangle, at);
        }
    }

    /// An edge's ends and constants: neighbour's value, both on one triangle, offset d, l, 1 / max(l, floor), w.
    #[inline(always)]
    pub fn edge<V: Lanes>(&self, row: Row, p: &Place<V>, k: usize) -> Edge<V> {
        let (di, dj, e, theirs) = NEIGHBOURS[k];
        // Where the owner is.
        let (oi, oj) = if theirs { (di, dj) } else { (0, 0) };
        let weight = row.near::<V>(&self.rigidity, 0, 0).max(row.near(&self.rigidity, di, dj));
        Edge {
            value: each!([0, 1, 2], |c| row.near(&self.value[c], di, dj)),
            same: V::same(V::load_index(&self.triangle, row.at(di, dj)), p.on.triangle),
            d: row.offset(&self.u, &p.u, di, dj),
            length: row.near(&self.length[e], oi, oj),
            inverse: row.near(&self.inverse[e], oi, oj),
            weight,
            shorter: 1.0 / (di * di + dj * dj) as f32,
            normal: [-dj as f32, di as f32],
        }
    }

    /// Energy of the edges and corners of a row's nodes.
    #[inline(always)]
    pub fn terms<V: Lanes, S: Surface>(&self, row: Row, p: &Place<V>, weights: &Weights) -> Terms<V> {
        let edges = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let length = S::length(&p.on.value, &p.on.slope, &edge.value, edge.same, &edge.d);
            edge.energy(k, length, weights)
        });
        self.with_corners(row, p, edges, weights)
    }

    /// Adds the corners' energy to that of the edges.
    #[inline(always)]
    fn with_corners<V: Lanes>(&self, row: Row, p: &Place<V>, edges: [V; 8], weights: &Weights) -> Terms<V> {
        let mut energy = V::zero();
        for edge in edges {
            energy += edge;
        }
        let corners = self.corners(row, p);
        if lowest(&corners).lt(V::splat(weights.room_threshold)).any() {
            for corner in &corners {
                energy += room(corner.0, weights);
            }
        }
        Terms { energy, edges, corners }
    }

    /// Everything a node's own Gauss-Newton step needs.
    #[inline(always)]
    pub fn local<V: Lanes, S: Surface>(&self, row: Row, p: &Place<V>, weights: &Weights) -> Local<V> {
        let mut edges = [V::zero(); 8];
        let mut gradient = [V::zero(); 2];
        let mut matrix = [V::zero(); 3];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
            let edge = self.edge(row, p, k);
            let (length, near, _) = S::gradient(&p.on.value, &p.on.slope, &edge.value, edge.same, &edge.d);
            edges[k] = edge.energy(k, length, weights);
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
            if weights.orientation > 0.0 {
                let [nx, ny] = edge.normal;
                let kappa = weights.orientation * edge.shorter * edge.shorter;
                let off = edge.off_axis() * kappa;
                gradient[0] -= off * nx;
                gradient[1] -= off * ny;
                matrix[0] += V::splat(kappa * nx * nx);
                matrix[1] += V::splat(kappa * nx * ny);
                matrix[2] += V::splat(kappa * ny * ny);
            }
        });
        let terms = self.with_corners(row, p, edges, weights);
        if lowest(&terms.corners).lt(V::splat(weights.room_threshold)).any() {
            for (jacobian, slope) in &terms.corners {
                let lack = (V::splat(weights.room_threshold) - *jacobian).max(V::zero());
                let active = jacobian.lt(V::splat(weights.room_threshold));
                let beta = active.select(V::splat(weights.room), V::zero());
                let pull = lack * weights.room;
                gradient[0] -= pull * slope[0];
                gradient[1] -= pull * slope[1];
                matrix[0] += beta * slope[0] * slope[0];
                matrix[1] += beta * slope[0] * slope[1];
                matrix[2] += beta * slope[1] * slope[1];
            }
        }
        Local { terms, gradient, matrix }
    }

    /// Corner Jacobians that a row's nodes touch, each affine in the node, with their gradients: per cell that of the
    /// node's own corner, of its x-neighbour's, of its y-neighbour's.
    #[inline(always)]
    pub fn corners<V: Lanes>(&self, row: Row, p: &Place<V>) -> [(V, [V; 2]); 12] {
        let mut corners = [(V::zero(), [V::zero(); 2]); 12];
        for (q, &(sx, sy)) in QUADRANTS.iter().enumerate() {
            let (a, b) = (row.offset(&self.u, &p.u, sx, 0), row.offset(&self.u, &p.u, 0, sy));
            let c = row.offset(&self.u, &p.u, sx, sy);
            let sign = (sx * sy) as f32;
            corners[3 * q] = corner(&a, &b, sign);
            corners[3 * q + 1] = corner(&a, &c, sign);
            corners[3 * q + 2] = corner(&c, &b, sign);
        }
        corners
    }
}

/// Sets the lanes that the mask names.
#[inline(always)]
fn blend<V: Lanes>(lanes: V::Mask, values: &mut [f32], at: usize, new: V) {
    lanes.select(new, V::load(values, at)).store(values, at);
}

/// J of a corner from the offsets to its neighbours a and b, and its gradient in the corner.
#[inline(always)]
fn corner<V: Lanes>(a: &[V; 2], b: &[V; 2], sign: f32) -> (V, [V; 2]) {
    let jacobian = (a[0] * b[1] - a[1] * b[0]) * sign;
    (jacobian, [(a[1] - b[1]) * sign, (b[0] - a[0]) * sign])
}

/// The smallest of a row's corner Jacobians, lane by lane, at most 1.
#[inline(always)]
pub fn lowest<V: Lanes>(corners: &[(V, [V; 2]); 12]) -> V {
    let mut low = V::one();
    for corner in corners {
        low = corner.0.min(low);
    }
    low
}

/// β max(0, τ - J)².
#[inline(always)]
pub fn room<V: Lanes>(jacobian: V, weights: &Weights) -> V {
    let lack = (V::splat(weights.room_threshold) - jacobian).max(V::zero());
    lack * lack * weights.room
}

/// One edge of each of a row's nodes.
pub struct Edge<V: Lanes> {
    pub value: [V; 3],
    pub same: V::Mask,
    pub d: [V; 2],
    pub length: V,
    pub inverse: V,
    pub weight: V,
    /// 1 / |d0|².
    pub shorter: f32,
    /// d0 turned by 90 degrees (not unit: its length is |d0|).
    pub normal: [f32; 2],
}

impl<V: Lanes> Edge<V> {
    /// (λ (1-w) + λ0) / |d0|².
    #[inline(always)]
    pub fn smoothness(&self, weights: &Weights) -> V {
        ((V::one() - self.weight) * weights.smoothness + weights.smoothness_floor) * self.shorter
    }

    /// d - d0.
    #[inline(always)]
    fn stretch(&self, k: usize) -> [V; 2] {
        each!([0, 1], |c| {
            let rest = if c == 0 { NEIGHBOURS[k].0 } else { NEIGHBOURS[k].1 };
            self.d[c] - V::splat(rest as f32)
        })
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
        if weights.orientation > 0.0 {
            let off = self.off_axis();
            energy += off * off * (weights.orientation * self.shorter * self.shorter);
        }
        energy
    }
}
