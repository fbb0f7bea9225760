//! The step limit (method §7.6): computes the fraction of the step that each node takes, from the displacements and
//! the step. Every corner Jacobian keeps a tenth of its margin over the bound (`MARGIN_LEFT`, `STEP_MIN_JACOBIAN`);
//! fractions fall off smoothly around corners that would lose more. The nodes of one corner may have different
//! fractions; if a corner still loses too much, they are multiplied by the fraction that the corner allows. The
//! fractions depend continuously on the step, so that a warp does not jump when a corner starts to be limited.

use std::hint::black_box;

use super::super::lanes::{Lanes, Mask, Vectorised, dispatch, each};
use super::super::prefetch::prefetch;
use super::super::row::{NEIGHBOURS, Offsets, Row};
use super::super::run::Run;
use super::super::terms::{CORNERS, cross, least_jacobian};
use super::falloff::{fall_off, slopes};
use super::transfer::active_neighbours;
use super::workspace::{Limiting, Stepping};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::{self, WINDOW_NODES, Window};
use vrtm_core::method::law::{MARGIN_LEFT, STEP_MIN_JACOBIAN, limit_rounds, margin_left};
use vrtm_core::team::SharedSlice;

/// Sets the fractions so that u + fraction x step has no corner Jacobian below the bound, and continues with the last
/// phase. A chart for which `limit_rounds` rounds do not suffice is refused later because of its energy.
pub fn limit<'a>(run: &Run, level: usize, limiting: Limiting<'a>) -> Stepping<'a> {
    let grid = &run.grid.levels[level];
    let u = &run.memory.levels[level].u;
    let step = limiting.step;
    // The step is 0 in blocks without movable nodes.
    let step_window = |b: usize| window::planes::<2>(&active_neighbours(grid, b), |b, c| &step[b][c]);
    // Only active blocks are written: in inactive blocks the memory of the marks has to stay 0 for the next V-cycle.
    let (fraction, mark) = (SharedSlice::new(limiting.fraction), SharedSlice::new(limiting.mark));
    let mut blocks = run.work[level].active.clone();
    let mut least = zeroed(blocks.len());
    let least_of_block = SharedSlice::new(&mut least);
    let next = |b: usize| {
        prefetch(&u[b]);
        prefetch(&step[b]);
    };
    run.each_of(&blocks, next, |_, k, b| {
        let (u, step) = (&window::planes(&grid.blocks.neighbours[b], |b, c| &u[b][c]), &step_window(b));
        // SAFETY: each item has its own block and least fraction.
        unsafe {
            let fraction = &mut fraction.get_mut(b)[0];
            *least_of_block.get_mut(k) = dispatch(AllowedFraction { u, step, left: MARGIN_LEFT, fraction });
        };
    });
    // Charts in which no node is limited are done, and are skipped in later rounds.
    let chart_of = |b: u32| grid.blocks.list[b as usize].chart as usize;
    let keep_open = |blocks: &mut Vec<u32>, flags: &[bool]| {
        let mut open = zeroed(run.charts.len());
        for (&b, _) in blocks.iter().zip(flags).filter(|(_, flag)| **flag) {
            open[chart_of(b)] = true;
        }
        blocks.retain(|&b| open[chart_of(b)]);
    };
    let mut cut: Vec<f32> = zeroed(run.charts.len());
    for (&b, least) in blocks.iter().zip(&least) {
        let cut = &mut cut[chart_of(b)];
        *cut = cut.max(1.0 - least);
    }
    blocks.retain(|&b| cut[chart_of(b)] > 0.0);
    let slopes = slopes(run, grid, &blocks, step);
    fall_off(run, grid, &blocks, fraction, &slopes);
    for round in 0..limit_rounds(level) {
        let mut marked: Vec<bool> = zeroed(blocks.len());
        let left = margin_left(round);
        run.team.fill(&mut marked, |k, marked| {
            let b = blocks[k] as usize;
            let mut u: [Window; 2] = window::planes(&grid.blocks.neighbours[b], |b, c| &u[b][c]);
            let mut step = step_window(b);
            // SAFETY: fractions are only read, and each item has its own marks.
            let (fractions, mark) = unsafe {
                let fractions = window::of(&active_neighbours(grid, b), 1.0, |b| &fraction.get(b)[0]);
                (fractions, &mut mark.get_mut(b)[0])
            };
            for c in 0..2 {
                for n in 0..WINDOW_NODES {
                    step[c][n] *= fractions[n];
                    if left.is_none() {
                        u[c][n] += step[c][n];
                    }
                }
            }
            *marked = match left {
                Some(left) => dispatch(AllowedFraction { u: &u, step: &step, left, fraction: mark }) < 1.0,
                None => dispatch(Marks { u: &u, mark }),
            };
        });
        keep_open(&mut blocks, &marked);
        if blocks.is_empty() {
            break;
        }
        run.team.run(blocks.len(), |k| {
            let b = blocks[k] as usize;
            // SAFETY: marks are only read, and each item has its own fractions.
            let (marks, fraction) = unsafe {
                let marks = window::of(&active_neighbours(grid, b), 1.0, |b| &mark.get(b)[0]);
                (marks, &mut fraction.get_mut(b)[0])
            };
            dispatch(Shrink { marks: &marks, fraction });
        });
        fall_off(run, grid, &blocks, fraction, &slopes);
    }
    limiting.stepping(cut)
}

/// Computes the fraction of the step that each node of a block may take if all nodes of its corners take the same
/// fraction, and each corner keeps the fraction `left` of its margin. Returns the least of the fractions.
struct AllowedFraction<'a> {
    u: &'a [Window; 2],
    step: &'a [Window; 2],
    left: f32,
    fraction: &'a mut Plane,
}

impl Vectorised for AllowedFraction<'_> {
    type Output = f32;

    #[inline(always)]
    fn run<V: Lanes>(self) -> f32 {
        let mut least = V::one();
        for row in Row::all() {
            let (u, step, row) = black_box((self.u, self.step, row));
            let fraction = allowed_fraction::<V>(u, step, self.left, row);
            least = least.min(fraction);
            row.store(self.fraction, fraction);
        }
        least.to_array().into_iter().fold(1.0, f32::min)
    }
}

/// The least fraction that the twelve corners at each node of a row allow.
#[inline(always)]
fn allowed_fraction<V: Lanes>(u: &[Window; 2], step: &[Window; 2], left: f32, row: Row) -> V {
    let [p, dp] = [u, step].map(|w| each!([0, 1], |c| row.near::<V>(&w[c], 0, 0)));
    let d = row.offsets(u, &p);
    // The changes of these offsets over a whole step.
    let changes: Offsets<V> = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
        each!([0, 1], |c| row.near::<V>(&step[c], NEIGHBOURS[k].0, NEIGHBOURS[k].1) - dp[c])
    });
    let moved = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| each!([0, 1], |c| d[k][c] + changes[k][c]));
    let mut least = V::zero();
    each!([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11], |k| {
        let (a, b) = CORNERS[k];
        let jacobian = cross(&d[a], &d[b]);
        let rest = (cross(&moved[a], &moved[b]) - jacobian) + may_lose(jacobian, left);
        least = rest.min(least);
    });
    let mut fraction = V::one();
    // Only a few corners limit the step.
    if least.lt(V::zero()).any() {
        for (a, b) in CORNERS {
            let (a, b, da, db) = (&d[a], &d[b], &changes[a], &changes[b]);
            // q(s) = q0 + q1 s + q2 s² is J at the fraction s of the step, minus the bound and the margin to be
            // left. q(0) >= 0; if q(1) < 0, there is one root in between, computed in a form without cancellation.
            let (q0, q1, q2) = (may_lose(cross(a, b), left), cross(da, b) + cross(a, db), cross(da, db));
            let limits = (q0 + q1 + q2).lt(V::zero());
            let denominator = (q1 * q1 - q0 * q2 * 4.0).max(V::zero()).sqrt() - q1;
            let root = (q0 + q0) / denominator.max(V::splat(f32::MIN_POSITIVE));
            fraction = limits.select(root.min(fraction), fraction);
        }
    }
    fraction
}

/// The most that a corner with this Jacobian may lose.
#[inline(always)]
fn may_lose<V: Lanes>(jacobian: V, left: f32) -> V {
    (jacobian - V::splat(STEP_MIN_JACOBIAN)).max(V::zero()) * (1.0 - left)
}

/// Multiplies the fractions of a block by the least mark of each node and its eight neighbours.
struct Shrink<'a> {
    marks: &'a Window,
    fraction: &'a mut Plane,
}

impl Vectorised for Shrink<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        for row in Row::all() {
            let mut least = row.near::<V>(self.marks, 0, 0);
            for (di, dj, ..) in NEIGHBOURS {
                least = least.min(row.near(self.marks, di, dj));
            }
            row.store(self.fraction, row.load::<V>(self.fraction) * least);
        }
    }
}

/// Sets the marks of a block's nodes: 0 if one of the node's twelve corner Jacobians is below the bound, otherwise 1.
/// Returns whether any mark is 0.
struct Marks<'a> {
    u: &'a [Window; 2],
    mark: &'a mut Plane,
}

impl Vectorised for Marks<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<V: Lanes>(self) -> bool {
        let mut any = false;
        for row in Row::all() {
            // Any comparison with NaN is false, so a least Jacobian of NaN counts as below ε.
            let here = each!([0, 1], |c| row.near::<V>(&self.u[c], 0, 0));
            let good = V::splat(STEP_MIN_JACOBIAN).le(least_jacobian(&row.offsets(self.u, &here)));
            any |= good.bits() != u8::MAX;
            row.store(self.mark, good.select(V::one(), V::zero()));
        }
        any
    }
}
