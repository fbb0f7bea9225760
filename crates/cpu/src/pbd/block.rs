//! A pass of the paper's solver over one block: the state that it reads, and the copy of it that it writes.

use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::grid::window::{self, Window};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

use super::super::buffers::State;
use super::super::lanes::{Lanes, Mask};
use super::super::row::Row;
use super::super::sampling::{GridRow, Samples, Surface};

/// A pass over the nodes of block `b`. No item writes `state`, and no other item accesses this block of `next` and of
/// `previous` meanwhile.
pub struct PassBlock<'a, P, S> {
    pub pass: P,
    pub level: &'a Level,
    pub state: State,
    pub next: State,
    pub previous: SharedSlice<[Plane; 2]>,
    pub surface: S,
    pub b: usize,
}

impl<'a, P, S: Surface> PassBlock<'a, P, S> {
    /// The displacements of the block and its halo.
    #[inline(always)]
    pub fn displacements(&self) -> [Window; 2] {
        // SAFETY: nothing writes the state.
        let plane = |b: usize, c: usize| unsafe { &self.state.u.get(b)[c] };
        window::planes(&self.level.blocks.neighbours[self.b], plane)
    }

    /// Copies the block's state to the next one, and returns the displacements and values there.
    #[inline(always)]
    pub fn copied(&self) -> (&'a mut [Plane; 2], &'a mut [Plane; 3]) {
        let (state, next, b) = (self.state, self.next, self.b);
        // SAFETY: nothing writes the state, and nothing else accesses the block of the next one.
        unsafe {
            if S::CHORDS {
                *next.triangle.get_mut(b) = *state.triangle.get(b);
            }
            let (u, value) = (next.u.get_mut(b), next.value.get_mut(b));
            *u = *state.u.get(b);
            *value = *state.value.get(b);
            (u, value)
        }
    }

    /// Samples the surface at a row's nodes displaced by `moved`, and writes the given lanes whose nodes move and have
    /// a sample to the next state. A node that would leave its chart stays.
    #[inline(always)]
    pub fn store_moved<V: Lanes>(
        &self,
        moved: &[V; 2],
        here: &[V; 2],
        lanes: V::Mask,
        row: Row,
        (next_u, next_value): (&mut [Plane; 2], &mut [Plane; 3]),
    ) {
        let slot = row.slot();
        let unmoved = moved[0]
            .le(here[0])
            .and(here[0].le(moved[0]))
            .and(moved[1].le(here[1]))
            .and(here[1].le(moved[1]));
        let lanes = lanes.and_not(unmoved);
        if !lanes.any() {
            return;
        }
        let mut no_triangles: Plane<u32> = [NONE; NODES];
        // SAFETY: nothing else accesses the block.
        let triangle =
            if S::CHORDS { unsafe { self.next.triangle.get_mut(self.b) } } else { &mut no_triangles };
        let start = V::load_index(triangle, slot);
        let mut samples = Samples { value: [V::zero(); 3], tangents: [V::zero(); 6], triangle: start };
        let nodes = GridRow::new(self.level, self.b, row);
        let found = self.surface.sample_row(&nodes, moved, lanes, &mut samples);
        for c in 0..2 {
            found.select(moved[c], row.load(&next_u[c])).store(&mut next_u[c], slot);
        }
        for c in 0..3 {
            found.select(samples.value[c], row.load(&next_value[c])).store(&mut next_value[c], slot);
        }
        if S::CHORDS {
            V::store_index(V::select_index(found, samples.triangle, start), triangle, slot);
        }
    }
}
