//! Lists of the blocks that a solve works on: what kernels are dispatched over.

use super::bands::Band;
use crate::tile::Level;

/// A list of a band's blocks (places in its buffers): a range of one buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct List {
    pub first: u32,
    pub count: u32,
    /// Its place among the sizes of gated dispatches.
    pub gate: u32,
}

/// A band's lists.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    /// Blocks with movable nodes, by block colour.
    pub colours: [List; 4],
    /// The same in storage order.
    pub active: List,
    /// These and the ones that are stored for their neighbours' sake.
    pub stored: List,
    /// The parts of `active` and of `stored` whose children are in each band of the next finer level.
    pub active_over: Vec<List>,
    pub stored_over: Vec<List>,
    /// Place of the first active block's sum among the level's.
    pub partial: u32,
}

/// Bytes of the lists of a band of `count` blocks.
pub fn list_bytes(count: u64) -> u64 {
    (3 * count * 4).max(16)
}

/// The active blocks that a band owns, of some charts.
pub fn active<'a>(level: &'a Level, band: &Band, charts: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
    stored(level, band, charts).filter(|&b| level.blocks.list[b].active)
}

pub fn stored<'a>(level: &'a Level, band: &Band, charts: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
    band.own.clone().filter(|&b| charts[level.blocks.list[b].chart as usize])
}

/// A band's lists, and all of them one after the other.
pub fn band_lists(
    level: &Level,
    band: &Band,
    finer: Option<(&Level, &[Band])>,
    charts: &[bool],
    sizes: &mut Vec<u32>,
    partial: u32,
) -> (Lists, Vec<u32>) {
    let list = &level.blocks.list;
    let mut lists = Lists { partial, ..Lists::default() };
    let mut all: Vec<u32> = Vec::new();
    let mut new_list = |first: usize, count: usize| {
        sizes.push(count as u32);
        List { first: first as u32, count: count as u32, gate: sizes.len() as u32 - 1 }
    };
    let mut add = |blocks: &mut dyn Iterator<Item = usize>| {
        let first = all.len();
        all.extend(blocks.map(|b| band.place(b as u32)));
        new_list(first, all.len() - first)
    };
    for (colour, range) in lists.colours.iter_mut().enumerate() {
        let of_colour = |&b: &usize| (list[b].y % 2 * 2 + list[b].x % 2) as usize == colour;
        *range = add(&mut active(level, band, charts).filter(of_colour));
    }
    lists.active = add(&mut active(level, band, charts));
    lists.stored = add(&mut stored(level, band, charts));
    if let Some((finer, below)) = finer {
        // A finer band has the children of whole rows.
        let starts: Vec<_> = below.iter().map(|band| &finer.blocks.list[band.own.start]).collect();
        let of = |b: usize| {
            let key = (list[b].chart, list[b].y);
            starts.partition_point(|first| (first.chart, first.y / 2) <= key).max(1) - 1
        };
        let mut over = |blocks: &mut dyn Iterator<Item = usize>, first: u32| {
            let mut counts = vec![0usize; below.len()];
            blocks.for_each(|b| counts[of(b)] += 1);
            let mut at = first as usize;
            let of_band = |count: usize| {
                at += count;
                new_list(at - count, count)
            };
            counts.into_iter().map(of_band).collect()
        };
        lists.active_over = over(&mut active(level, band, charts), lists.active.first);
        lists.stored_over = over(&mut stored(level, band, charts), lists.stored.first);
    }
    (lists, all)
}

/// Sets of gates that are in use at the same time.
pub const GATES: usize = 3;
/// Most gates of a solve whose opening is told; more share the last place.
pub const MOST_GATES: u32 = 4096;

/// Bytes of the sizes of all lists: six a band, two for each band below it, and one for the charts.
pub fn size_bytes(bands: &[Vec<Band>]) -> u64 {
    bands.iter().flatten().map(|band| 6 + 2 * band.below.len().max(1) as u64).sum::<u64>() * 4 + 4
}
