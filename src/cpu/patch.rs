//! One block's problem with its ring, gathered for work.

use crate::mesh::NONE;
use crate::method::schedule::Input;
use crate::tile::Level;
use crate::tile::blocks::{NODES, Plane, SIDE};
use crate::tile::window::{self, WINDOW_NODES, Window};

use super::constants::{self, window_vectors};
use super::lanes::{LANES, Lanes, Truth, each};
use super::row::Row;
use super::sampling::{Samples, Site, Surface};
use super::team::SharedSlice;

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

    /// Of a level.
    pub fn new(input: &Input, level: usize) -> Weights {
        let settings = input.settings;
        Weights {
            smoothness: input.smoothness(level),
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
    pub u: SharedSlice<[Plane; 2]>,
    /// Positions on the finest level, metrics on coarser ones, at W(p).
    pub value: SharedSlice<[Plane; 3]>,
    /// The triangle under W(p): finest level only, empty elsewhere.
    pub triangle: SharedSlice<Plane<u32>>,
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
    /// All 0 unless a setting asks for it.
    pub density: Window,
    pub dense: bool,
    /// Of the block's own nodes.
    pub slope: [Plane; 6],
    pub floor: f32,
}

/// What a row's nodes are at: displacement and sample.
#[derive(Clone, Copy)]
pub struct Place<V: Lanes> {
    pub u: [V; 2],
    pub on: Samples<V>,
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
    pub unsafe fn load<V: Lanes, S: Surface>(&mut self, level: &Level, state: State, b: usize) {
        let around = &level.blocks.neighbours[b];
        let block = &level.blocks.list[b];
        self.block = b;
        self.x = i64::from(block.x) * SIDE as i64;
        self.y = i64::from(block.y) * SIDE as i64;
        self.floor = level.floor[block.chart as usize];
        // SAFETY: the caller's promise.
        unsafe {
            for c in 0..2 {
                window::load(around, 0.0, |b| &state.u.get(b)[c], &mut self.u[c]);
            }
            for c in 0..3 {
                window::load(around, 0.0, |b| &state.value.get(b)[c], &mut self.value[c]);
            }
            if S::CHORDS {
                window::load(around, NONE, |b| state.triangle.get(b), &mut self.triangle);
            }
        }
        constants::rigidity::<V>(level, b, &mut self.rigidity);
        window::load(around, 0, |b| &level.movable[b], &mut self.movable);
        let floor = V::splat(self.floor);
        if !level.density.is_empty() {
            window::load(around, 0.0, |b| &level.density[b], &mut self.density);
        } else if self.dense {
            self.density = [0.0; WINDOW_NODES];
        }
        self.dense = !level.density.is_empty();
        for e in 0..4 {
            constants::rest_length::<V>(level, b, e, &mut self.length[e]);
            for at in window_vectors() {
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
        Site { block: self.block, i: self.x + row.column() as i64, j: self.y + row.line() as i64 }
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
}

/// Sets the lanes that the mask names.
#[inline(always)]
fn blend<V: Lanes>(lanes: V::Mask, values: &mut [f32], at: usize, new: V) {
    lanes.select(new, V::load(values, at)).store(values, at);
}
