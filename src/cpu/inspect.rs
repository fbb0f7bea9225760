//! A run's state, read and set from outside, in the layout of the GPU's buffers (`gpu/layout.rs`): for the comparison
//! with the other backend, and for the switch to it.

use crate::mesh::NONE;
use crate::tile::blocks::{NODES, Plane};
use crate::tile::pose::PoseTriangle;

use super::Run;
use super::sampling::TriangleRecord;

/// Planes of one quantity, per block, as bits.
fn bits<const N: usize>(planes: &[Plane; N]) -> impl Iterator<Item = u32> {
    planes.as_flattened().iter().map(|x| x.to_bits())
}

fn set<const N: usize>(planes: &mut [Plane; N], bits: &[u32]) {
    planes.as_flattened_mut().iter_mut().zip(bits).for_each(|(x, &bits)| *x = f32::from_bits(bits));
}

/// All of a quantity's planes.
pub(super) fn flat<const N: usize>(blocks: &[[Plane; N]]) -> Vec<u32> {
    blocks.iter().flat_map(bits).collect()
}

impl Run<'_> {
    /// Per pose triangle: position at the first corner, df/dx, df/dy.
    pub fn triangles(&self) -> Vec<[f32; 9]> {
        let triangle = |t: &TriangleRecord| {
            let t = t.pose();
            let ([a, b, c], [d, e, f], [g, h, i]) = (t.origin, t.tangent[0], t.tangent[1]);
            [a, b, c, d, e, f, g, h, i]
        };
        self.memory.triangles.iter().map(triangle).collect()
    }

    pub fn set_triangles(&mut self, triangles: &[[f32; 9]]) {
        for (t, &[a, b, c, d, e, f, g, h, i]) in triangles.iter().enumerate() {
            let triangle = PoseTriangle { origin: [a, b, c], tangent: [[d, e, f], [g, h, i]] };
            self.memory.metrics[t] = triangle.metric();
            self.memory.triangles[t] = TriangleRecord::new(&self.grid.triangles[t], &triangle);
        }
    }

    /// The pose's metric on a coarser level: three planes per block.
    pub fn metric(&self, level: usize) -> Vec<u32> {
        flat(&self.memory.levels[level].metric)
    }

    pub fn set_metric(&mut self, level: usize, bits: &[u32]) {
        let metric = &mut self.memory.levels[level].metric;
        metric.iter_mut().zip(bits.chunks(3 * NODES)).for_each(|(planes, bits)| set(planes, bits));
    }

    /// A level's displacements (2), values (3) and triangles (1) per block.
    pub fn state(&self, level: usize) -> Vec<u32> {
        let buffers = &self.memory.levels[level];
        let mut all = Vec::with_capacity(buffers.u.len() * 6 * NODES);
        for b in 0..buffers.u.len() {
            all.extend(bits(&buffers.u[b]).chain(bits(&buffers.value[b])));
            // Coarser levels have none.
            all.extend_from_slice(buffers.triangle.get(b).unwrap_or(&[NONE; NODES]));
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

    /// Per chart, the energy of a level's present state.
    pub fn energies_of(&mut self, level: usize) -> Vec<f64> {
        self.energies(level)
    }

    /// The result, once it is certified.
    pub fn result(&self) -> &[[Plane; 2]] {
        self.result
    }
}
