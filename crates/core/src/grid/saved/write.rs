//! Writes a grid as bytes, or counts them.

use crate::grid::Grid;
use crate::grid::rigid_nodes::RigidNodes;

/// Writes numbers in sequence, or counts their bytes.
pub struct Writer<'a> {
    pub out: Option<&'a mut [u8]>,
    pub at: usize,
}

impl Writer<'_> {
    pub fn bytes(&mut self, bytes: &[u8]) {
        if let Some(out) = &mut self.out {
            out[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        }
        self.at += bytes.len();
    }

    pub fn u32(&mut self, x: u32) {
        self.bytes(&x.to_le_bytes());
    }

    fn u16s(&mut self, numbers: &[u16]) {
        self.all(numbers, |x| x.to_le_bytes());
    }

    fn u32s(&mut self, numbers: &[u32]) {
        self.all(numbers, |x| x.to_le_bytes());
    }

    fn f32s(&mut self, numbers: &[f32]) {
        self.all(numbers, |x| x.to_le_bytes());
    }

    /// Writes numbers; counting them takes no time.
    fn all<T: Copy, const SIZE: usize>(&mut self, numbers: &[T], bytes: impl Fn(T) -> [u8; SIZE]) {
        match &self.out {
            Some(_) => numbers.iter().for_each(|&x| self.bytes(&bytes(x))),
            None => self.at += numbers.len() * SIZE,
        }
    }
}

/// Writes everything but the header.
pub fn write(grid: &Grid, to: &mut Writer) {
    let sizes = [
        grid.levels[0].nx,
        grid.levels[0].ny,
        grid.movable.len(),
        grid.levels.len(),
        grid.parts.len(),
        grid.rigid_nodes.len(),
    ];
    sizes.iter().for_each(|&n| to.u32(n as u32));
    to.f32s(&[grid.overlap]);
    to.bytes(&grid.at_gaps.to_le_bytes());
    for (part, rigid) in grid.parts.iter().zip(&grid.rigid) {
        to.u32s(&[part.chart, part.x, part.y, u32::from(*rigid)]);
        to.u16s(&part.nodes.0);
    }
    for RigidNodes { square, rigid, frozen, overlapped } in &grid.rigid_nodes {
        to.u32s(square);
        to.u16s(&[*rigid, *frozen, *overlapped]);
    }
    for level in &grid.levels {
        to.u16s(level.rigidity.as_flattened());
        to.u16s(level.rest_length.as_flattened().as_flattened());
        level.lengths.iter().flatten().for_each(|l| to.u32s(&[l.base, l.shift]));
        to.f32s(&level.floor);
        to.bytes(level.interpolation.as_flattened());
        to.f32s(level.stiffness.as_flattened().as_flattened());
        to.f32s(level.coverage.as_flattened());
        to.u32(level.density.len() as u32);
        to.f32s(level.density.as_flattened());
    }
    to.u32s(grid.triangle.as_flattened());
    let (starts, entries) = grid.gather.parts();
    to.u32s(starts);
    for (t, fraction) in entries {
        to.u32(*t);
        to.f32s(&[*fraction]);
    }
}
