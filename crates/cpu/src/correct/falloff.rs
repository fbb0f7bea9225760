//! The falloff of step fractions (method §7.6): lowers them until those of neighbouring nodes differ by at most a
//! chart's
//! *slope*. It reaches as far as it has to: it goes along the rows of nodes, forth and back, and then along the columns,
//! through all blocks that lie side by side.

use super::super::run::Run;
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{Plane, SIDE, slot};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::{FRACTION_FALLOFF, STEP_FALLOFF};
use vrtm_core::team::SharedSlice;

/// Each chart's slope: less where its longest step is long, because nodes that take different fractions of a step come
/// closer by the difference times the step. `blocks` are those of the charts that are limited.
pub fn slopes(run: &Run, level: &Level, blocks: &[u32], step: &[[Plane; 2]]) -> Vec<f32> {
    let mut longest = zeroed(blocks.len());
    run.team.fill(&mut longest, |k, longest: &mut f32| {
        let step = step[blocks[k] as usize].as_flattened();
        *longest = step.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    });
    let mut slopes: Vec<f32> = vec![FRACTION_FALLOFF; run.charts.len()];
    for (&b, longest) in blocks.iter().zip(&longest) {
        let slope = &mut slopes[level.blocks.list[b as usize].chart as usize];
        *slope = slope.min(STEP_FALLOFF / longest.max(STEP_FALLOFF));
    }
    slopes
}

/// Lowers the fractions of the charts that have `blocks`.
pub fn fall_off(run: &Run, level: &Level, blocks: &[u32], fraction: SharedSlice<[Plane; 2]>, slopes: &[f32]) {
    for axis in [Axis::Row, Axis::Column] {
        let (before, after) = axis.neighbours();
        let neighbour = |b: usize, k: usize| {
            let b = level.blocks.neighbours[b][k];
            (b != NONE && level.blocks.list[b as usize].active).then_some(b as usize)
        };
        let firsts: Vec<u32> =
            blocks.iter().copied().filter(|&b| neighbour(b as usize, before).is_none()).collect();
        run.team.run(firsts.len(), |k| {
            let mut b = firsts[k] as usize;
            let slope = slopes[level.blocks.list[b].chart as usize];
            let mut low = [1.0; SIDE];
            // SAFETY: each item has its own run of blocks.
            let forth =
                |b: usize, low: &mut _| axis.forth(unsafe { &mut fraction.get_mut(b)[0] }, slope, low);
            let back = |b: usize, low: &mut _| axis.back(unsafe { &mut fraction.get_mut(b)[0] }, slope, low);
            forth(b, &mut low);
            while let Some(next) = neighbour(b, after) {
                b = next;
                forth(b, &mut low);
            }
            low = [1.0; SIDE];
            back(b, &mut low);
            while let Some(next) = neighbour(b, before) {
                b = next;
                back(b, &mut low);
            }
        });
    }
}

/// The lines of nodes along which a pass goes.
#[derive(Clone, Copy)]
enum Axis {
    Row,
    Column,
}

impl Axis {
    /// The neighbours of a block before and after it along its lines, in the order of `Blocks::neighbours`.
    fn neighbours(self) -> (usize, usize) {
        match self {
            Axis::Row => (3, 5),
            Axis::Column => (1, 7),
        }
    }

    fn forth(self, plane: &mut Plane, slope: f32, low: &mut [f32; SIDE]) {
        (0..SIDE).for_each(|place| self.step(plane, place, slope, low));
    }

    fn back(self, plane: &mut Plane, slope: f32, low: &mut [f32; SIDE]) {
        (0..SIDE).rev().for_each(|place| self.step(plane, place, slope, low));
    }

    /// The node at `place` of each line. `low` has the fractions of the nodes that come before them.
    #[inline(always)]
    fn step(self, plane: &mut Plane, place: usize, slope: f32, low: &mut [f32; SIDE]) {
        for (line, low) in low.iter_mut().enumerate() {
            let s = match self {
                Axis::Row => slot(place, line),
                Axis::Column => slot(line, place),
            };
            *low = plane[s].min(*low + slope);
            plane[s] = *low;
        }
    }
}
