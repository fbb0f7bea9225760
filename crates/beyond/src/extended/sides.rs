//! Sides of charts, in parts: at which of them a collar begins, and beyond which the chart goes on.

use std::ops::Range;

use glam::DVec2;

use crate::collar::{Across, Collar};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::mesh::TileMesh;
use vrtm_core::mesh::hash::{Table, enter};

/// A run of parts of a seam at which only one of two charts goes on is shut if it is longer than this part of the
/// reach, nearly two of a collar's bands.
const SHORTEST: f64 = 0.3;

/// A side of a chart's triangle: the triangle, and the corner opposite to the side.
pub(super) type Side = (u32, u8);

/// A side of a chart beyond a part of which the chart goes on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Open {
    pub side: Side,
    /// These of its equal parts, counted from the corner that follows the opposite one.
    pub parts: Range<usize>,
}

/// A triangle of a collar at a part of a chart's side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct AtSide {
    pub side: Side,
    pub part: usize,
    pub triangle: u32,
}

impl AtSide {
    /// The ends of the part: neighbouring parts have exactly one of them in common.
    fn ends(&self, tile: &TileMesh, collar: &Collar) -> [DVec2; 2] {
        let [from, to] = ends(tile, self.side);
        [self.part, self.part + 1].map(|part| match part == collar.parts {
            true => to,
            false => from + (part as f64 / collar.parts as f64) * (to - from),
        })
    }
}

/// The triangles at the sides of the chart, ascending.
pub(super) fn rims(tile: &TileMesh, collar: &Collar) -> Vec<AtSide> {
    let mut rims = Vec::new();
    for (k, triangle) in collar.triangles.iter().enumerate() {
        for (corner, across) in triangle.across.into_iter().enumerate() {
            if let Across::Chart(side) = across {
                let part = part_of(tile, collar, side, triangle.uv, corner);
                rims.push(AtSide { side, part, triangle: k as u32 });
            }
        }
    }
    rims.sort_unstable();
    rims
}

/// At which of the parts of a chart's side a triangle of its collar lies.
pub(super) fn part_of(tile: &TileMesh, collar: &Collar, side: Side, uv: [DVec2; 3], corner: usize) -> usize {
    let middle = 0.5 * (uv[(corner + 1) % 3] + uv[(corner + 2) % 3]);
    let [from, to] = ends(tile, side);
    let along = (middle - from).dot(to - from) / (to - from).length_squared();
    (along * collar.parts as f64) as usize
}

/// The ends of a side.
pub(super) fn ends(tile: &TileMesh, (t, k): Side) -> [DVec2; 2] {
    let uv = &tile.triangles[t as usize].uv;
    [1, 2].map(|d| uv[(k as usize + d) % 3])
}

/// The sides of the chart at which triangles are used, ascending: of each side the longest run of parts, since whoever
/// crosses the side goes on from one of its parts.
pub(super) fn open_sides(rims: &[AtSide], used: &[bool]) -> Vec<Open> {
    let list: Vec<AtSide> = rims.iter().copied().filter(|rim| used[rim.triangle as usize]).collect();
    let of_side = |rims: &[AtSide]| {
        let runs = rims.chunk_by(|a, b| a.part + 1 == b.part);
        let run = runs.reduce(|longest, run| if run.len() > longest.len() { run } else { longest })?;
        Some(Open { side: run[0].side, parts: run[0].part..run[run.len() - 1].part + 1 })
    };
    list.chunk_by(|a, b| a.side == b.side).filter_map(of_side).collect()
}

/// The run of a side's parts beyond which the chart goes on.
pub(super) fn run_of(open: &[Open], side: Side) -> Option<&Open> {
    open.binary_search_by_key(&side, |open| open.side).ok().map(|k| &open[k])
}

/// Drops those of some parts of a chart's sides beyond which the chart does not go on, in runs longer than `SHORTEST`.
pub(super) fn drop_runs(
    source: &TileMesh,
    collar: &Collar,
    rims: &mut Vec<AtSide>,
    goes_on: impl Fn(&AtSide) -> bool,
) {
    let stays: Vec<u32> = (0..rims.len() as u32).filter(|&k| !goes_on(&rims[k as usize])).collect();
    // Parts with an end in common are one run: a tree of parts.
    let mut run: Vec<u32> = (0..rims.len() as u32).collect();
    let mut lengths: Vec<f64> = zeroed(rims.len());
    let mut at_end: Table<[u64; 2], u32> = Table::default();
    for &k in &stays {
        let ends = rims[k as usize].ends(source, collar);
        lengths[k as usize] = ends[0].distance(ends[1]);
        for end in ends.map(|end| end.to_array().map(f64::to_bits)) {
            let other = *at_end.get(&end).unwrap_or(&k);
            enter(&mut at_end, end, k);
            let (a, b) = (root(&run, k), root(&run, other));
            run[a as usize] = b;
        }
    }
    let mut whole: Vec<f64> = zeroed(rims.len());
    stays.iter().for_each(|&k| whole[root(&run, k) as usize] += lengths[k as usize]);
    let mut is_shut: Vec<bool> = zeroed(rims.len());
    for k in stays {
        is_shut[k as usize] = whole[root(&run, k) as usize] > SHORTEST * collar.reach;
    }
    let mut is_shut = is_shut.into_iter();
    rims.retain(|_| is_shut.next() != Some(true));
}

fn root(parents: &[u32], mut a: u32) -> u32 {
    while parents[a as usize] != a {
        a = parents[a as usize];
    }
    a
}
