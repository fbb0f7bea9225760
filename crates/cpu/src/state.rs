//! Reads the state of a run in the layout of `gpu_state.rs`, for comparing the two backends. A module of `cpu`, so that
//! it can access private state.

use vrtm_core::allocation::Vec;
use vrtm_core::grid::planes::{NODES, Plane};
use vrtm_core::mesh::NONE;

use super::run::Run;
use super::sampling::record::TriangleRecord;

/// The planes of one quantity in one block, as bits.
fn bits<const N: usize>(planes: &[Plane; N]) -> impl Iterator<Item = u32> {
    planes.as_flattened().iter().map(|x| x.to_bits())
}

/// The planes of one quantity in all blocks, as bits.
pub(super) fn flat<const N: usize>(blocks: &[[Plane; N]]) -> Vec<u32> {
    blocks.iter().flat_map(bits).collect()
}

impl Run<'_> {
    /// Per triangle: position of the first corner in the pose, ∂f/∂x, ∂f/∂y.
    pub fn triangles(&self) -> Vec<[f32; 9]> {
        let triangle = |t: &TriangleRecord| {
            let [[.., a, b], [c, d, e, f, g, h, i, _]] = t.halves;
            [a, b, c, d, e, f, g, h, i]
        };
        self.memory.triangles.iter().map(triangle).collect()
    }

    /// The pose metrics on a coarser level: three planes per block.
    pub fn metric(&self, level: usize) -> Vec<u32> {
        flat(&self.memory.levels[level].metric)
    }

    /// A level's state. Planes per block: displacements (2), values (3) and triangles (1).
    pub fn state(&self, level: usize) -> Vec<u32> {
        let buffers = &self.memory.levels[level];
        let mut all = Vec::with_capacity(buffers.u.len() * 6 * NODES);
        for b in 0..buffers.u.len() {
            all.extend(bits(&buffers.u[b]).chain(bits(&buffers.value[b])));
            // Coarser levels have no triangles.
            all.extend(buffers.triangle.get(b).unwrap_or(&[NONE; NODES]));
        }
        all
    }

    /// The step fraction of the next correction per chart; 0 if the chart skips the level's further corrections.
    pub fn next_fraction(&self) -> &[f32] {
        &self.memory.workspace.next_fraction
    }
}
