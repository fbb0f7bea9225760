//! The falloff of step fractions (method §7.6): lowers them until those of neighbouring nodes differ by at most a
//! chart's *slope*. It reaches as far as it has to: it goes along the rows of nodes, forth and back, and then along the
//! columns, through all blocks that lie side by side.

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
    // With the neighbours of a block before and after it along its lines, in the order of `Blocks::neighbours`.
    for (along_rows, before, after) in [(true, 3, 5), (false, 1, 7)] {
        let neighbour = |b: usize, k: usize| {
            let b = level.blocks.neighbours[b][k];
            (b != NONE && level.blocks.list[b as usize].active).then_some(b as usize)
        };
        let firsts: Vec<u32> =
            blocks.iter().copied().filter(|&b| neighbour(b as usize, before).is_none()).collect();
        run.team.run(firsts.len(), |k| {
            let mut b = firsts[k] as usize;
            let slope = slopes[level.blocks.list[b].chart as usize];
            for (forth, next) in [(true, after), (false, before)] {
                // Of each line, the fraction of the node before.
                let mut low = [1.0; SIDE];
                loop {
                    // SAFETY: each item has its own run of blocks.
                    let plane = unsafe { &mut fraction.get_mut(b)[0] };
                    for k in 0..SIDE {
                        let place = if forth { k } else { SIDE - 1 - k };
                        for (line, low) in low.iter_mut().enumerate() {
                            let s = if along_rows { slot(place, line) } else { slot(line, place) };
                            *low = plane[s].min(*low + slope);
                            plane[s] = *low;
                        }
                    }
                    let Some(next) = neighbour(b, next) else { break };
                    b = next;
                }
            }
        });
    }
}
