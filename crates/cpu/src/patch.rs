//! A block's patch: all quantities that relaxation, assembly and the energy need, gathered in windows of 18x18 nodes
//! (method §1).

use vrtm_core::allocation::{Plain, zeroed_box};
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::grid::{Level, mirrors};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::HOLD;
use vrtm_core::method::plan::Input;

use super::buffers::State;
use super::decode::{self, window_vectors};
use super::lanes::{LANES, Lanes, Mask, each};
use super::prefetch::prefetch;
use super::row::{NEIGHBOURS, ROWS, Row};
use super::sampling::{Samples, Surface};

/// The weights of the energy on one level (method §4).
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    pub smoothness: f32,
    pub smoothness_floor: f32,
    pub orientation: f32,
    pub orientation_density: f32,
    pub room: f32,
    pub room_threshold: f32,
    /// Weight of the pull towards the previous result (method §5); 0 without a pull.
    pub pull: f32,
}

impl Weights {
    /// True if the energy has an orientation term.
    #[inline(always)]
    pub fn orients(&self) -> bool {
        self.orientation > 0.0 || self.orientation_density > 0.0
    }

    pub fn new(input: &Input, level: usize) -> Weights {
        let settings = input.settings;
        Weights {
            smoothness: input.smoothness(level),
            smoothness_floor: settings.smoothness_floor,
            orientation: settings.orientation,
            orientation_density: settings.orientation_density,
            room: settings.room,
            room_threshold: settings.room_threshold,
            pull: if level == 0 { input.pull } else { 0.0 },
        }
    }

    /// These weights without the pull, for the energy of the state alone.
    pub fn without_pull(self) -> Weights {
        Weights { pull: 0.0, ..self }
    }
}

/// A block `b` of a level, and what its patch is gathered from.
#[derive(Clone, Copy)]
pub struct Source<'a, S> {
    pub level: &'a Level,
    pub state: State,
    pub surface: S,
    pub weights: &'a Weights,
    /// The previous result.
    pub anchor: &'a [[Plane; 2]],
    pub b: usize,
}

/// All quantities of a block, in windows.
#[derive(Debug)]
pub struct Patch {
    pub u: [Window; 2],
    pub value: [Window; 3],
    pub triangle: Window<u32>,
    /// Rigidity, times 1 plus the multiplier (method §4, Harm).
    pub rigidity: Window,
    /// True if a rigidity is above 0. Otherwise lengths and tangents are not loaded.
    pub is_stiff: bool,
    /// Per row, whether an edge at one of its nodes has a weight above 0.
    pub stiff: [bool; ROWS],
    /// Rest lengths l of the owned edges.
    pub length: [Window; 4],
    /// 1 / max(l, floor).
    pub inverse_length: [Window; 4],
    /// 1 where the node is movable, 0 elsewhere.
    pub movable: Window,
    /// Density ρ of rigid material; 0 if the level stores none, because no setting needs it.
    pub density: Window,
    /// √`HOLD` times what holds the nodes of the block, without the halo, and whether anything does.
    pub hold: [Plane; 2],
    pub has_hold: bool,
    /// True if the level stores densities.
    pub has_density: bool,
    /// Displacements of the previous result; loaded only if there is a pull.
    pub anchor: [Window; 2],
    /// Tangents (see `Samples`) at the nodes of the block, without the halo; finest level only.
    pub tangents: [Plane; 6],
    /// The chart's floor of rest lengths.
    pub floor: f32,
}

/// Displacements of a row's nodes, and the samples of the surface at their warped positions.
#[derive(Clone, Copy)]
pub struct NodeState<V: Lanes> {
    pub u: [V; 2],
    pub samples: Samples<V>,
}

// SAFETY: all fields are numbers or a truth value.
unsafe impl Plain for Patch {}

impl Patch {
    pub fn zeroed() -> Box<Patch> {
        let mut patch: Box<Patch> = zeroed_box();
        patch.triangle = [NONE; WINDOW_NODES];
        patch
    }

    /// Prefetches what `load` reads of the next block.
    #[inline(always)]
    pub fn prefetch(level: &Level, state: State, b: usize) {
        state.prefetch(b);
        prefetch(&level.rigidity[b]);
        prefetch(&level.movable[b]);
        prefetch(&level.rest_length[b]);
    }

    /// Gathers a block with its halo. Where nothing is rigid, values and triangles are gathered only if the nodes are
    /// to be `moved`, and not those of the halo.
    ///
    /// # Safety
    /// No other item writes this block or its neighbour blocks meanwhile.
    #[inline(always)]
    pub unsafe fn load<V: Lanes, S: Surface>(&mut self, source: &Source<S>, moved: bool) {
        let Source { level, state, surface, weights, anchor, b } = *source;
        let neighbours = &level.blocks.neighbours[b];
        self.floor = level.floor[level.blocks.list[b].chart as usize];
        self.load_rigidity::<V, S>(source);
        let mut sampled = *neighbours;
        if !self.is_stiff {
            sampled = [NONE; 9];
            sampled[4] = b as u32;
        }
        // SAFETY: promised by the caller.
        unsafe {
            for c in 0..2 {
                window::load(neighbours, 0.0, |b| &state.u.get(b)[c], &mut self.u[c]);
            }
            if self.is_stiff || moved {
                for c in 0..3 {
                    window::load(&sampled, 0.0, |b| &state.value.get(b)[c], &mut self.value[c]);
                }
                if S::CHORDS {
                    window::load(&sampled, NONE, |b| state.triangle.get(b), &mut self.triangle);
                }
            }
        }
        decode::movable::<V>(level, b, &mut self.movable);
        let floor = V::splat(self.floor);
        if !level.density.is_empty() {
            window::load(neighbours, 0.0, |b| &level.density[b], &mut self.density);
        } else if self.has_density {
            self.density = [0.0; WINDOW_NODES];
        }
        self.has_density = !level.density.is_empty();
        self.load_held(level, b);
        self.stiff = [false; ROWS];
        if self.is_stiff {
            for row in Row::all() {
                self.stiff[row.index()] = self.has_stiff_edges::<V>(row);
            }
            for e in 0..4 {
                decode::rest_length::<V>(level, b, e, &mut self.length[e]);
                for at in window_vectors() {
                    (V::one() / V::load(&self.length[e], at).max(floor))
                        .store(&mut self.inverse_length[e], at);
                }
            }
            if S::CHORDS {
                self.load_tangents::<V, S>(surface);
            }
        }
        if weights.pull > 0.0 {
            self.anchor = window::planes(neighbours, |b, c| &anchor[b][c]);
        }
    }

    /// Gathers the rigidities of a block and its halo.
    #[inline(always)]
    pub fn load_rigidity<V: Lanes, S: Surface>(&mut self, source: &Source<S>) {
        let Source { level, state, b, .. } = *source;
        self.is_stiff = decode::rigidity::<V>(level, b, &mut self.rigidity);
        if self.is_stiff && !state.multiplier.is_empty() {
            // SAFETY: no stage that loads patches writes it.
            decode::stiffen::<V>(level, |b| unsafe { state.multiplier.get(b) }, b, &mut self.rigidity);
        }
    }

    /// Replaces a block's displacements and values by those of the identity.
    #[inline(always)]
    pub fn load_identity<S: Surface>(&mut self, source: &Source<S>) {
        self.u = [[0.0; WINDOW_NODES]; 2];
        if let Some(values) = source.surface.at_nodes() {
            self.value = window::planes(&source.level.blocks.neighbours[source.b], |b, c| &values[b][c]);
        }
    }

    /// Gathers what holds the nodes of block `b`.
    fn load_held(&mut self, level: &Level, b: usize) {
        self.has_hold = level.hold.get(b).is_some_and(|plane| plane.iter().any(|&hold| hold != 0));
        if self.has_hold {
            for (s, &hold) in level.hold[b].iter().enumerate() {
                [self.hold[0][s], self.hold[1][s]] = mirrors::decode(hold).map(|x| x * HOLD.sqrt());
            }
        }
    }

    /// Gathers the tangents at W(p) for the movable nodes of a block of the finest level with stiff edges.
    #[inline(always)]
    fn load_tangents<V: Lanes, S: Surface>(&mut self, surface: S) {
        for row in Row::all() {
            let at = row.at(0, 0);
            if !self.stiff[row.index()] || !self.movable_lanes::<V>(row).any() {
                continue;
            }
            let mut triangle = [NONE; LANES];
            triangle.copy_from_slice(&self.triangle[at..at + LANES]);
            let tangents = surface.tangents_row::<V>(&triangle);
            for (plane, x) in self.tangents.iter_mut().zip(tangents) {
                x.store(plane, row.slot());
            }
        }
    }

    /// Mobility of the neighbours `k` of a row's nodes: 1 or 0.
    #[inline(always)]
    pub fn movable_near<V: Lanes>(&self, row: Row, k: usize) -> V {
        row.near(&self.movable, NEIGHBOURS[k].0, NEIGHBOURS[k].1)
    }

    /// The lanes of a row whose nodes are movable.
    #[inline(always)]
    pub fn movable_lanes<V: Lanes>(&self, row: Row) -> V::Mask {
        V::zero().lt(row.near(&self.movable, 0, 0))
    }

    /// The present state of a row's nodes.
    #[inline(always)]
    pub fn node_state<V: Lanes>(&self, row: Row) -> NodeState<V> {
        NodeState {
            u: each!([0, 1], |c| row.near(&self.u[c], 0, 0)),
            samples: Samples {
                value: each!([0, 1, 2], |c| row.near(&self.value[c], 0, 0)),
                tangents: each!([0, 1, 2, 3, 4, 5], |c| row.load(&self.tangents[c])),
                triangle: row.near_index::<V>(&self.triangle, 0, 0),
            },
        }
    }

    /// Stores the trial state of a row's nodes in the given lanes. The tangents are needed only of nodes with stiff
    /// edges.
    #[inline(always)]
    pub fn accept<V: Lanes, S: Surface>(
        &mut self,
        row: Row,
        lanes: V::Mask,
        trial: &NodeState<V>,
        stiff: bool,
    ) {
        for (window, new) in
            self.u.iter_mut().zip(trial.u).chain(self.value.iter_mut().zip(trial.samples.value))
        {
            row.store_in_window(window, lanes.select(new, row.near(window, 0, 0)));
        }
        if S::CHORDS {
            if stiff {
                for (plane, new) in self.tangents.iter_mut().zip(trial.samples.tangents) {
                    row.store(plane, lanes.select(new, row.load(plane)));
                }
            }
            let old = row.near_index::<V>(&self.triangle, 0, 0);
            let new = V::select_index(lanes, trial.samples.triangle, old);
            V::store_index(new, &mut self.triangle, row.at(0, 0));
        }
    }
}
