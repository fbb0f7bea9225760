//! Resampling: computes the samples of all nodes of some blocks after their displacements were changed other than by
//! relaxation (method §2 and §3).

use vrtm_core::grid::planes::Plane;
use vrtm_core::mesh::NONE;

use super::super::buffers::State;
use super::super::lanes::{LANES, Lanes, Mask, Vectorised, dispatch, each};
use super::super::row::Row;
use super::super::run::Run;
use super::chords::Chords;
use super::metrics::Metrics;
use super::{GridRow, Samples, Surface};

/// Start of the walk to the triangle under W(p).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// No walk: W is the identity, and each node has its triangle at rest. Fixed nodes are sampled, too.
    Identity,
    /// At the rest triangle of the node nearest to W(p). This suits any W.
    Nearest,
    /// At the node's present triangle. This suits a W(p) that has moved little.
    Present,
}

impl Run<'_> {
    /// Resamples the given blocks of a level, whose state is `state`.
    pub fn resample(&self, level: usize, state: State, blocks: &[u32], start: Start) {
        self.move_and_resample(level, state, blocks, start, |_, _| {});
    }

    /// Sets the displacements of the given blocks of a level by `set(block, displacements)`, and resamples the blocks.
    /// `state` is the level's.
    pub fn move_and_resample(
        &self,
        level: usize,
        state: State,
        blocks: &[u32],
        start: Start,
        set: impl Fn(usize, &mut [Plane; 2]) + Sync,
    ) {
        let grid = self.grid;
        let chords = Chords { grid, triangles: &self.memory.triangles };
        let metrics = Metrics { level: &grid.levels[level], metric: &self.memory.levels[level].metric };
        self.each_of(
            blocks,
            |b| state.prefetch(b),
            |_, _, b| {
                // SAFETY: each item has its own block.
                set(b, unsafe { state.u.get_mut(b) });
                if level == 0 {
                    dispatch(ResampleChords { surface: chords, state, b, start });
                } else {
                    dispatch(ResampleMetrics { surface: metrics, state, b, start });
                }
            },
        );
    }
}

/// Resamples a block of the finest level. No other item may access it meanwhile.
struct ResampleChords<'a> {
    surface: Chords<'a>,
    state: State,
    b: usize,
    start: Start,
}

impl Vectorised for ResampleChords<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let ResampleChords { surface, state, b, start } = self;
        let level = &surface.grid.levels[0];
        let rest_triangles = &surface.grid.triangle[b];
        // SAFETY: no other item accesses the block.
        let (u, value, triangle) =
            unsafe { (state.u.get(b), state.value.get_mut(b), state.triangle.get_mut(b)) };
        for row in Row::all() {
            let s = row.slot();
            let nodes = GridRow::new(level, b, row);
            let lanes = V::zero().lt(V::load_u8(&level.movable[b], s));
            // Fixed nodes are sampled, too: a correction has overwritten the memory of the samples.
            if start == Start::Identity || start == Start::Present && lanes.bits() != u8::MAX {
                let at_rest = V::load_index(rest_triangles, s);
                let samples = surface.sample_row_on::<V>(&nodes, &[V::zero(); 2], at_rest);
                for c in 0..3 {
                    samples.value[c].store(&mut value[c], s);
                }
            }
            if start == Start::Identity {
                V::store_index(V::load_index(rest_triangles, s), triangle, s);
                continue;
            }
            if !lanes.any() {
                continue;
            }
            let displacement = each!([0, 1], |c| V::load(&u[c], s));
            let start_triangles = match start {
                Start::Nearest => surface.nearest_row(&nodes, s, &displacement),
                _ => V::index_to_array(V::load_index(triangle, s)),
            };
            let mut samples = Samples {
                value: [V::zero(); 3],
                tangents: [V::zero(); 6],
                triangle: V::index_from_array(start_triangles),
            };
            let found = surface.sample_row(&nodes, &displacement, lanes, &mut samples);
            if lanes.and_not(found).any() {
                // Where W leaves the chart, the surface is continued affinely from the triangle at which the walk
                // began.
                samples.triangle =
                    V::select_index(found, samples.triangle, V::index_from_array(start_triangles));
                samples.value = surface.sample_row_on::<V>(&nodes, &displacement, samples.triangle).value;
            }
            for c in 0..3 {
                lanes.select(samples.value[c], V::load(&value[c], s)).store(&mut value[c], s);
            }
            V::store_index(V::select_index(lanes, samples.triangle, V::load_index(triangle, s)), triangle, s);
        }
    }
}

/// Resamples a block of a coarser level. No other item may access it meanwhile.
struct ResampleMetrics<'a> {
    surface: Metrics<'a>,
    state: State,
    b: usize,
    start: Start,
}

impl Vectorised for ResampleMetrics<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let ResampleMetrics { surface, state, b, start } = self;
        let metric = &surface.metric[b];
        // SAFETY: no other item accesses the block.
        let (u, value) = unsafe { (state.u.get(b), state.value.get_mut(b)) };
        if start == Start::Identity {
            *value = *metric;
            return;
        }
        for row in Row::all() {
            let s = row.slot();
            let lanes = V::zero().lt(V::load_u8(&surface.level.movable[b], s));
            let displacement = each!([0, 1], |c| V::load(&u[c], s));
            let no_triangle = V::index_from_array([NONE; LANES]);
            let mut samples =
                Samples { value: [V::zero(); 3], tangents: [V::zero(); 6], triangle: no_triangle };
            let found =
                surface.sample_row(&GridRow::new(surface.level, b, row), &displacement, lanes, &mut samples);
            for c in 0..3 {
                lanes.and(found).select(samples.value[c], V::load(&metric[c], s)).store(&mut value[c], s);
            }
        }
    }
}
