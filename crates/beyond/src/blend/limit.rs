//! The part of the blend that each node takes: the whole of it, but less around cells that it would crush, falling off
//! smoothly.

use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::grid::window::{self, place};
use vrtm_core::mesh::NONE;
use vrtm_core::method::law::STEP_MIN_JACOBIAN;
use vrtm_core::team::Team;
use vrtm_cpu::certify::{Certificate, certify_block, corner_jacobians};

/// Rounds in which fractions are lowered around cells that are crushed; then the charts that still have one give the
/// blend up.
const ROUNDS: usize = 24;
/// Over-relaxation of the reduction, so that rounds come to an end: a cell that is just crushed still takes
/// nearly all of the change, so that fractions change with the pose in small steps alone.
const OVER_RELAXATION: f64 = 1.25;
/// The largest factor of a round; and from round `LATE` on, so that a chart rather takes less than give the blend up.
const LARGEST: f32 = 1.0 - 1.0 / 64.0;
const LARGEST_LATE: f32 = 0.5;
const LATE: usize = 12;
/// A fraction under this one becomes 0.
const SMALLEST: f32 = 1.0 / 32.0;
/// The greatest change of the fraction from node to node, and that of what it makes of a chart's largest change, in
/// cells: more would crush the next cells.
const SLOPE: f32 = 0.125;
const STEP: f32 = 0.25;
/// Passes of the falloff in a round.
const PASSES: usize = 8;

/// A blend as far as it was taken.
pub struct Limited {
    pub u: Vec<[Plane; 2]>,
    /// Per chart that has a change.
    pub certificates: Vec<Option<Certificate>>,
    /// The charts with a node that took less than the whole.
    pub charts: u32,
}

/// Adds changes to displacements. `blocks` are the changed blocks, ascending, with their changes.
pub(super) fn add(
    team: &Team,
    level: &Level,
    before: &[[Plane; 2]],
    blocks: &[u32],
    changes: &[[Plane; 2]],
) -> Limited {
    let count = level.blocks.list.len();
    let chart = |b: u32| level.blocks.list[b as usize].chart as usize;
    let mut index = vec![u32::MAX; count];
    blocks.iter().enumerate().for_each(|(k, &b)| index[b as usize] = k as u32);
    let charts = level.blocks.of_chart.len();
    let mut is_changed: Vec<bool> = zeroed(charts);
    blocks.iter().for_each(|&b| is_changed[chart(b)] = true);
    let active: Vec<u32> = (0..count as u32)
        .filter(|&b| level.blocks.list[b as usize].active)
        .filter(|&b| is_changed[chart(b)])
        .collect();
    let mut slopes: Vec<f32> = vec![SLOPE; charts];
    for (&b, change) in blocks.iter().zip(changes) {
        let largest = change.as_flattened().iter().fold(0.0f32, |most, x| most.max(x.abs()));
        let slope = &mut slopes[chart(b)];
        *slope = slope.min(STEP / largest.max(STEP));
    }
    let slope = |b: u32| slopes[chart(b)];
    let mut fractions: Vec<Plane> = vec![[1.0; NODES]; count];
    // The blocks with a fraction under 1: what is not next to one of them stays as it is.
    let mut is_less: Vec<bool> = zeroed(count);
    let near = |is_less: &[bool], open: &[u32]| -> Vec<u32> {
        let is_less = |b: &u32| *b != NONE && is_less[*b as usize];
        open.iter().copied().filter(|&b| level.blocks.neighbours[b as usize].iter().any(is_less)).collect()
    };
    let mut u: Vec<[Plane; 2]> = Vec::from(before);
    // Of the blocks as they are now.
    let mut certified: Vec<Certificate> = vec![Certificate::default(); count];
    let mut open: Vec<u32> = active.clone();
    let (mut with_change, mut beside): (Vec<u32>, Vec<u32>) = (Vec::from(blocks), active.clone());
    for round in 0..=ROUNDS {
        // Their displacements before, plus fractions of the changes.
        let now = team.map(with_change.len(), |k| {
            let b = with_change[k] as usize;
            let mut u = before[b];
            if let Some(change) = changes.get(index[b] as usize) {
                for (c, s) in (0..2 * NODES).map(|n| (n / NODES, n % NODES)) {
                    u[c][s] += fractions[b][s] * change[c][s];
                }
            }
            u
        });
        with_change.iter().zip(now).for_each(|(&b, now)| u[b as usize] = now);
        let factors = team.map(beside.len(), |k| factors(level, before, &u, beside[k] as usize));
        beside.iter().zip(&factors).for_each(|(&b, of)| certified[b as usize] = of.0);
        if factors.iter().all(|(_, factors)| factors.is_none()) {
            break;
        }
        let mut is_open: Vec<bool> = zeroed(charts);
        for (&b, (_, factors)) in beside.iter().zip(&factors) {
            let Some(factors) = factors else { continue };
            is_open[chart(b)] = true;
            is_less[b as usize] = true;
            for (fraction, &factor) in fractions[b as usize].iter_mut().zip(factors).filter(|of| *of.1 < 1.0)
            {
                let less = *fraction * if round < LATE { factor } else { factor.min(LARGEST_LATE) };
                *fraction = if less < SMALLEST || round == ROUNDS { 0.0 } else { less };
            }
        }
        open.retain(|&b| is_open[chart(b)]);
        for _ in 0..PASSES {
            let around = near(&is_less, &open);
            let next = team
                .map(around.len(), |k| fallen_off(level, &fractions, around[k] as usize, slope(around[k])));
            for (&b, next) in around.iter().zip(next) {
                is_less[b as usize] |= next.iter().any(|&fraction| fraction < 1.0);
                fractions[b as usize] = next;
            }
        }
        beside = near(&is_less, &open);
        with_change = beside.iter().copied().filter(|&b| is_less[b as usize]).collect();
        if round == ROUNDS {
            for &b in &open {
                (fractions[b as usize], u[b as usize]) = ([0.0; NODES], before[b as usize]);
            }
            let again = team.map(open.len(), |k| certify_block(level, &u, open[k] as usize));
            open.iter().zip(again).for_each(|(&b, certificate)| certified[b as usize] = certificate);
        }
    }
    let mut is_limited: Vec<bool> = zeroed(charts);
    for &b in blocks {
        let is_whole = fractions[b as usize].iter().all(|&f| f >= 1.0);
        is_limited[chart(b)] |= !is_whole;
    }
    let mut certificates: Vec<Option<Certificate>> = vec![None; charts];
    for &b in &active {
        certificates[chart(b)].get_or_insert_default().add(&certified[b as usize]);
    }
    let limited = is_limited.iter().filter(|limited| **limited).count() as u32;
    Limited { u, certificates, charts: limited }
}

/// Certificate of a block; and factors of its nodes' fractions, 0 to 1, if a cell at them is crushed.
fn factors(level: &Level, before: &[[Plane; 2]], u: &[[Plane; 2]], b: usize) -> (Certificate, Option<Plane>) {
    let certificate = certify_block(level, u, b);
    let load = |u: &[[Plane; 2]]| window::planes::<2>(&level.blocks.neighbours[b], |b, c| &u[b][c]);
    // Rounding may leave a corner a little under the bound before the blend, too.
    let bound = 0.99 * f64::from(STEP_MIN_JACOBIAN);
    if certificate.min_jacobian >= bound {
        return (certificate, None);
    }
    let now = load(u);
    let mut found = None;
    for j in 0..17 {
        for i in 0..17 {
            let after = corner_jacobians(&now, i, j);
            if after.iter().all(|&jacobian| jacobian >= bound) {
                continue;
            }
            let (start, half, factors) = found.get_or_insert_with(|| {
                let start = load(before);
                let mut half = now;
                half.as_flattened_mut()
                    .iter_mut()
                    .zip(start.as_flattened())
                    .for_each(|(x, y)| *x = 0.5 * (*x + y));
                (start, half, [1.0f32; NODES])
            });
            let (start, half) = (corner_jacobians(start, i, j), corner_jacobians(half, i, j));
            let part = (0..4).map(|k| part_of([start[k], half[k], after[k]], bound)).fold(1.0, f64::min);
            let factor = ((1.0 - OVER_RELAXATION * (1.0 - part)).max(0.0) as f32).min(LARGEST);
            for (x, y) in [(i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)] {
                if (1..=SIDE).contains(&x) && (1..=SIDE).contains(&y) {
                    let own = &mut factors[slot(x - 1, y - 1)];
                    *own = own.min(factor);
                }
            }
        }
    }
    (certificate, found.map(|(_, _, factors)| factors))
}

/// The largest part of a change, 0 to 1, up to which a corner's Jacobian is at least `bound`: it is quadratic in the
/// part, and is given without the change, with half and with the whole of it.
fn part_of([start, half, whole]: [f64; 3], bound: f64) -> f64 {
    if whole >= bound {
        return 1.0;
    }
    let c = start - bound;
    if c <= 0.0 {
        return 0.0;
    }
    let a = 2.0 * (start + whole - 2.0 * half);
    let b = whole - start - a;
    let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
    // Both solutions of a t^2 + b t + c = 0, neither of them a difference of large numbers.
    let q = -0.5 * (b + root.copysign(b));
    [q / a, c / q].into_iter().filter(|t| *t > 0.0 && *t <= 1.0).fold(1.0, f64::min)
}

/// A block's fractions, at most those of their neighbours plus `slope`.
fn fallen_off(level: &Level, fractions: &[Plane], b: usize, slope: f32) -> Plane {
    let window = window::of(&level.blocks.neighbours[b], 1.0, |b| &fractions[b]);
    let mut out = fractions[b];
    for j in 0..SIDE {
        for i in 0..SIDE {
            let around = (0..9).map(|k| window[place(i + k % 3, j + k / 3)]);
            let least = around.fold(f32::INFINITY, f32::min);
            let own = &mut out[slot(i, j)];
            *own = own.min(least + slope);
        }
    }
    out
}
