//! Sides of charts, in parts: the contacts of a collar with them, and the open runs. See `extended` for the words.

use std::ops::Range;

use glam::DVec2;

use crate::collar::{Across, Collar};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::mesh::TileMesh;
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::sets::root;

/// A run of a seam at which only one of two charts continues is shut if it is longer than this fraction of the reach,
/// nearly two of a collar's bands.
const SHORTEST: f64 = 0.3;

/// A side of a chart's triangle: the triangle, and the corner opposite to the side.
pub(super) type Side = (u32, u8);

/// A side with open parts.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Open {
    pub side: Side,
    /// The open parts, counted from the corner that follows the opposite one.
    pub run: Range<usize>,
}

/// A triangle of a collar that touches its chart at a part of a side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Contact {
    pub side: Side,
    pub part: usize,
    pub triangle: u32,
}

impl Contact {
    /// The ends of the part: neighbouring parts have exactly one of them in common.
    fn ends(&self, tile: &TileMesh, collar: &Collar) -> [DVec2; 2] {
        let [from, to] = ends(tile, self.side);
        [self.part, self.part + 1].map(|part| match part == collar.parts {
            true => to,
            false => from + (part as f64 / collar.parts as f64) * (to - from),
        })
    }
}

/// The contacts of a collar, ascending.
pub(super) fn contacts(tile: &TileMesh, collar: &Collar) -> Vec<Contact> {
    let mut contacts = Vec::new();
    for (k, triangle) in collar.triangles.iter().enumerate() {
        for (corner, across) in triangle.across.into_iter().enumerate() {
            if let Across::Chart(side) = across {
                let part = part_of(tile, collar, side, triangle.uv, corner);
                contacts.push(Contact { side, part, triangle: k as u32 });
            }
        }
    }
    contacts.sort_unstable();
    contacts
}

/// The part of a side that a triangle of the collar touches.
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

/// The sides at which triangles are kept, ascending: of each side the longest run, since walks that cross the side
/// continue from one of its parts.
pub(super) fn open_sides(contacts: &[Contact], kept: &[bool]) -> Vec<Open> {
    let list: Vec<Contact> = contacts.iter().copied().filter(|of| kept[of.triangle as usize]).collect();
    let of_side = |contacts: &[Contact]| {
        let runs = contacts.chunk_by(|a, b| a.part + 1 == b.part);
        let run = runs.reduce(|longest, run| if run.len() > longest.len() { run } else { longest })?;
        Some(Open { side: run[0].side, run: run[0].part..run[run.len() - 1].part + 1 })
    };
    list.chunk_by(|a, b| a.side == b.side).filter_map(of_side).collect()
}

/// The open run of a side.
pub(super) fn run_of(open: &[Open], side: Side) -> Option<&Range<usize>> {
    open.binary_search_by_key(&side, |open| open.side).ok().map(|k| &open[k].run)
}

pub(super) fn is_open(open: &[Open], side: Side, part: usize) -> bool {
    run_of(open, side).is_some_and(|run| run.contains(&part))
}

/// Drops the contacts for which `continues` is false, in runs longer than `SHORTEST`.
pub(super) fn drop_runs(
    source: &TileMesh,
    collar: &Collar,
    contacts: &mut Vec<Contact>,
    continues: impl Fn(&Contact) -> bool,
) {
    let one_sided: Vec<u32> =
        (0..contacts.len() as u32).filter(|&k| !continues(&contacts[k as usize])).collect();
    // Parts with an end in common are one run: a tree of parts.
    let mut run: Vec<u32> = (0..contacts.len() as u32).collect();
    let mut lengths: Vec<f64> = zeroed(contacts.len());
    let mut at_end: Table<[u64; 2], u32> = Table::default();
    for &k in &one_sided {
        let ends = contacts[k as usize].ends(source, collar);
        lengths[k as usize] = ends[0].distance(ends[1]);
        for end in ends.map(|end| end.to_array().map(f64::to_bits)) {
            let other = *at_end.get(&end).unwrap_or(&k);
            enter(&mut at_end, end, k);
            let (a, b) = (root(&mut run, k), root(&mut run, other));
            run[a as usize] = b;
        }
    }
    let mut whole: Vec<f64> = zeroed(contacts.len());
    one_sided.iter().for_each(|&k| whole[root(&mut run, k) as usize] += lengths[k as usize]);
    let mut is_shut: Vec<bool> = zeroed(contacts.len());
    for k in one_sided {
        is_shut[k as usize] = whole[root(&mut run, k) as usize] > SHORTEST * collar.reach;
    }
    let mut is_shut = is_shut.into_iter();
    contacts.retain(|_| is_shut.next() != Some(true));
}
