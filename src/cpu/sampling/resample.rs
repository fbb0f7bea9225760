//! Samples the surface anew under all nodes of some blocks, after their displacements were set from outside.

use crate::mesh::NONE;
use crate::tile::blocks::{Plane, SIDE, slot};

use super::super::Run;
use super::super::lanes::{Kernel, LANES, Lanes, Truth, each, wide};
use super::super::patch::State;
use super::super::row::Row;
use super::{Chords, GridRow, Metrics, Samples, Surface};

/// Where the walk to the triangle under W(p) begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// W is the identity: each node lies on its own triangle, and none walks. Fixed nodes are sampled here alone.
    Identity,
    /// At the triangle of the node nearest to W(p): W may be anything.
    Nearest,
    /// At the triangle that the state has: W(p) was there and has moved a little.
    Present,
}

impl Run<'_> {
    /// Samples the surface anew under all nodes of the blocks, from their displacements.
    pub(in crate::cpu) fn resample(&mut self, level: usize, blocks: &[u32], start: Start) {
        self.move_and_resample(level, blocks, start, |_, _| {});
    }

    /// The same after `set(block, displacements)` has set those of each block.
    pub(in crate::cpu) fn move_and_resample(
        &mut self,
        level: usize,
        blocks: &[u32],
        start: Start,
        set: impl Fn(usize, &mut [Plane; 2]) + Sync,
    ) {
        let grid = self.grid;
        let (finest, coarser) = self.memory.levels.split_at_mut(1);
        let buffers = if level == 0 { &mut finest[0] } else { &mut coarser[level - 1] };
        let metric = std::mem::take(&mut buffers.metric);
        let state = buffers.state();
        let chords = Chords { grid, triangles: &self.memory.triangles };
        let metrics = Metrics { level: &grid.levels[level], metric: &metric };
        self.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: each item has its own block.
            set(b, unsafe { state.u.get_mut(b) });
            if level == 0 {
                wide(ResampleChords { surface: chords, state, b, start });
            } else {
                wide(ResampleMetrics { surface: metrics, state, b, start });
            }
        });
        self.memory.levels[level].metric = metric;
    }
}

/// Samples a finest block anew. No other item may touch it meanwhile.
struct ResampleChords<'a> {
    surface: Chords<'a>,
    state: State,
    b: usize,
    start: Start,
}

impl Kernel for ResampleChords<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let ResampleChords { surface, state, b, start } = self;
        let level = &surface.grid.levels[0];
        let rest = &surface.grid.triangle[b];
        // SAFETY: no other item touches the block.
        let (u, value, triangle) =
            unsafe { (state.u.get(b), state.value.get_mut(b), state.triangle.get_mut(b)) };
        for row in Row::all() {
            let s = row.slot();
            let nodes = GridRow::new(level, b, row);
            if start == Start::Identity {
                let on = surface.on_row::<V>(&nodes, &[V::zero(); 2], V::load_index(rest, s));
                V::store_index(V::load_index(rest, s), triangle, s);
                for c in 0..3 {
                    on.value[c].store(&mut value[c], s);
                }
                continue;
            }
            let lanes = V::zero().lt(V::load_u8(&level.movable[b], s));
            if start == Start::Present && lanes.bits() != u8::MAX {
                // A correction has used the samples' memory.
                let on = surface.on_row::<V>(&nodes, &[V::zero(); 2], V::load_index(rest, s));
                for c in 0..3 {
                    on.value[c].store(&mut value[c], s);
                }
            }
            if !lanes.any() {
                continue;
            }
            let d = each!([0, 1], |c| V::load(&u[c], s));
            let mut from = [NONE; LANES];
            from.copy_from_slice(&triangle[s..s + LANES]);
            if start == Start::Nearest {
                let (x, y) = (d[0].to_array(), d[1].to_array());
                for k in 0..LANES {
                    from[k] = surface.nearest(&nodes, k, [x[k], y[k]]).unwrap_or(rest[s + k]);
                }
            }
            let mut on =
                Samples { value: [V::zero(); 3], slope: [V::zero(); 6], triangle: V::index_from(from) };
            let found = surface.sample_row(&nodes, &d, lanes, &mut on);
            if lanes.and_not(found).any() {
                // W leaves the chart: what lies around the start is extended.
                on.triangle = V::select_index(found, on.triangle, V::index_from(from));
                on.value = surface.on_row::<V>(&nodes, &d, on.triangle).value;
            }
            for c in 0..3 {
                lanes.select(on.value[c], V::load(&value[c], s)).store(&mut value[c], s);
            }
            V::store_index(V::select_index(lanes, on.triangle, V::load_index(triangle, s)), triangle, s);
        }
    }
}

impl Chords<'_> {
    /// The triangle of the node nearest to W(p), if that lies in the same chart.
    #[inline(always)]
    fn nearest(&self, nodes: &GridRow, lane: usize, u: [f32; 2]) -> Option<u32> {
        let level = &self.grid.levels[0];
        let (x, y) = (nodes.column(lane) + u[0].round() as i64, nodes.j + u[1].round() as i64);
        let triangle = match level.blocks.holding(nodes.block, x, y) {
            NONE => NONE,
            near => self.grid.triangle[near as usize][slot(x as usize % SIDE, y as usize % SIDE)],
        };
        let chart = level.blocks.list[nodes.block].chart;
        (triangle != NONE && self.grid.chart_of[triangle as usize] == chart).then_some(triangle)
    }
}

/// Samples a coarser block anew. No other item may touch it meanwhile.
struct ResampleMetrics<'a> {
    surface: Metrics<'a>,
    state: State,
    b: usize,
    start: Start,
}

impl Kernel for ResampleMetrics<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let ResampleMetrics { surface, state, b, start } = self;
        let metric = &surface.metric[b];
        // SAFETY: no other item touches the block.
        let (u, value) = unsafe { (state.u.get(b), state.value.get_mut(b)) };
        if start == Start::Identity {
            *value = *metric;
            return;
        }
        for row in Row::all() {
            let s = row.slot();
            let lanes = V::zero().lt(V::load_u8(&surface.level.movable[b], s));
            let d = each!([0, 1], |c| V::load(&u[c], s));
            let nowhere = V::index_from([NONE; LANES]);
            let mut on = Samples { value: [V::zero(); 3], slope: [V::zero(); 6], triangle: nowhere };
            let found = surface.sample_row(&GridRow::new(surface.level, b, row), &d, lanes, &mut on);
            for c in 0..3 {
                lanes.and(found).select(on.value[c], V::load(&metric[c], s)).store(&mut value[c], s);
            }
        }
    }
}
