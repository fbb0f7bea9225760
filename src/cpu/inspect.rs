//! Reads and sets the state of a run in the layout that the GPU's inspection has (`gpu/inspect.rs`), for comparing the
//! two backends and for switching between them.

use crate::memory::{Collect, Grow, with_capacity};
use crate::mesh::NONE;
use crate::tile::blocks::{NODES, Plane};
use crate::tile::pose::PoseTriangle;

use super::Run;
use super::sampling::TriangleRecord;

/// The planes of one quantity in one block, as bits.
fn bits<const N: usize>(planes: &[Plane; N]) -> impl Iterator<Item = u32> {
    planes.as_flattened().iter().map(|x| x.to_bits())
}

/// Sets the planes of one quantity in one block from bits.
fn set<const N: usize>(planes: &mut [Plane; N], bits: &[u32]) {
    planes.as_flattened_mut().iter_mut().zip(bits).for_each(|(x, &bits)| *x = f32::from_bits(bits));
}

/// The planes of one quantity in all blocks, as bits.
pub(super) fn flat<const N: usize>(blocks: &[[Plane; N]]) -> Vec<u32> {
    blocks.iter().flat_map(bits).collected()
}

impl Run<'_> {
    /// Per triangle: position of the first corner in the pose, ∂f/∂x, ∂f/∂y.
    pub fn triangles(&self) -> Vec<[f32; 9]> {
        let triangle = |t: &TriangleRecord| {
            let t = t.pose();
            let ([a, b, c], [d, e, f], [g, h, i]) = (t.origin, t.tangent[0], t.tangent[1]);
            [a, b, c, d, e, f, g, h, i]
        };
        self.memory.triangles.iter().map(triangle).collected()
    }

    pub fn set_triangles(&mut self, triangles: &[[f32; 9]]) {
        for (t, &[a, b, c, d, e, f, g, h, i]) in triangles.iter().enumerate() {
            let triangle = PoseTriangle { origin: [a, b, c], tangent: [[d, e, f], [g, h, i]] };
            self.memory.metrics[t] = triangle.metric();
            self.memory.triangles[t] = TriangleRecord::new(&self.grid.triangles[t], &triangle);
        }
    }

    /// The pose metrics on a coarser level: three planes per block.
    pub fn metric(&self, level: usize) -> Vec<u32> {
        flat(&self.memory.levels[level].metric)
    }

    pub fn set_metric(&mut self, level: usize, bits: &[u32]) {
        let metric = &mut self.memory.levels[level].metric;
        metric.iter_mut().zip(bits.chunks(3 * NODES)).for_each(|(planes, bits)| set(planes, bits));
    }

    /// A level's state. Planes per block: displacements (2), values (3) and triangles (1).
    pub fn state(&self, level: usize) -> Vec<u32> {
        let buffers = &self.memory.levels[level];
        let mut all = with_capacity(buffers.u.len() * 6 * NODES);
        for b in 0..buffers.u.len() {
            all.put_all(bits(&buffers.u[b]).chain(bits(&buffers.value[b])));
            // Coarser levels have no triangles.
            all.put_all(buffers.triangle.get(b).unwrap_or(&[NONE; NODES]).iter().copied());
        }
        all
    }

    pub fn set_state(&mut self, level: usize, bits: &[u32]) {
        self.known_energies.fill(None);
        let buffers = &mut self.memory.levels[level];
        for (b, bits) in bits.chunks(6 * NODES).enumerate() {
            set(&mut buffers.u[b], bits);
            set(&mut buffers.value[b], &bits[2 * NODES..]);
            if let Some(triangle) = buffers.triangle.get_mut(b) {
                triangle.copy_from_slice(&bits[5 * NODES..]);
            }
        }
    }

    /// The energy of a level's present state per chart.
    #[cfg(feature = "oracle")]
    pub fn energies_of(&mut self, level: usize) -> Vec<f64> {
        self.energies(level)
    }

    /// The step fraction of the next correction per chart; 0 if the chart sits out the level's further corrections.
    pub fn next_fraction(&self) -> &[f32] {
        &self.memory.workspace.next_fraction
    }

    pub fn set_next_fraction(&mut self, next: &[f32]) {
        self.memory.workspace.next_fraction.copy_from_slice(next);
    }

    /// The displacements of the result, after certification.
    pub fn result(&self) -> &[[Plane; 2]] {
        self.result
    }
}
