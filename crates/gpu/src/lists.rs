//! Lists of the blocks that a solve works on, over which kernels are dispatched.

use super::bands::Band;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::grid::Level;

/// A list of a band's blocks (indices in its buffers): a range of the band's buffer of lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct List {
    pub first: u32,
    pub count: u32,
    /// Index of the list's length among the dispatch sizes.
    pub size_index: u32,
}

/// The lists of a band's owned blocks, for the charts of a solve.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    /// Active blocks, by block colour.
    pub colours: [List; 4],
    /// Active blocks in storage order.
    pub active: List,
    /// All stored blocks: active ones, and inactive neighbours of movable nodes.
    pub stored: List,
    /// The sublists of `active` and of `stored` whose blocks have their children in each band of the next finer level.
    pub active_by_finer_band: Vec<List>,
    pub stored_by_finer_band: Vec<List>,
    /// Index of the first active block's partial sum among those of the level.
    pub partial: u32,
}

/// Bytes of the lists of a band with `count` blocks: each block is in at most three lists with memory of their own.
pub fn list_bytes(count: u64) -> u64 {
    (3 * count * 4).max(16)
}

/// The active blocks of the given charts that a band owns.
pub fn active_blocks<'a>(
    level: &'a Level,
    band: &Band,
    charts: &'a [bool],
) -> impl Iterator<Item = usize> + 'a {
    stored_blocks(level, band, charts).filter(|&b| level.blocks.list[b].active)
}

pub fn stored_blocks<'a>(
    level: &'a Level,
    band: &Band,
    charts: &'a [bool],
) -> impl Iterator<Item = usize> + 'a {
    band.owned.clone().filter(|&b| charts[level.blocks.list[b].chart as usize])
}

/// Builds a band's lists and returns them with the blocks of all lists, one list after the other. Appends the lists'
/// lengths to `sizes`.
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
        List { first: first as u32, count: count as u32, size_index: sizes.len() as u32 - 1 }
    };
    let mut add = |blocks: &mut dyn Iterator<Item = usize>| {
        let first = all.len();
        all.extend(blocks.map(|b| band.place(b as u32)));
        new_list(first, all.len() - first)
    };
    for (colour, range) in lists.colours.iter_mut().enumerate() {
        let of_colour = |&b: &usize| (list[b].y % 2 * 2 + list[b].x % 2) as usize == colour;
        *range = add(&mut active_blocks(level, band, charts).filter(of_colour));
    }
    lists.active = add(&mut active_blocks(level, band, charts));
    lists.stored = add(&mut stored_blocks(level, band, charts));
    if let Some((finer, finer_bands)) = finer {
        // A finer band owns the children of complete rows.
        let starts: Vec<_> = finer_bands.iter().map(|band| &finer.blocks.list[band.owned.start]).collect();
        let finer_band_of = |b: usize| {
            let key = (list[b].chart, list[b].y);
            starts.partition_point(|first| (first.chart, first.y / 2) <= key).max(1) - 1
        };
        let mut by_finer_band = |blocks: &mut dyn Iterator<Item = usize>, first: u32| {
            let mut counts = zeroed::<usize>(finer_bands.len());
            blocks.for_each(|b| counts[finer_band_of(b)] += 1);
            let mut at = first as usize;
            let sublist = |count: usize| {
                at += count;
                new_list(at - count, count)
            };
            counts.into_iter().map(sublist).collect()
        };
        lists.active_by_finer_band =
            by_finer_band(&mut active_blocks(level, band, charts), lists.active.first);
        lists.stored_by_finer_band =
            by_finer_band(&mut stored_blocks(level, band, charts), lists.stored.first);
    }
    (lists, all)
}

/// A condition under which dispatches run: when the kernel `gate` ran, some chart was at work and limited often enough
/// (`open_gate`).
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    pub set: GateSet,
    /// The gate's index in the solve.
    pub number: u32,
}

/// Gates in use at the same time; each has its own indirect arguments.
#[derive(Clone, Copy, Debug)]
pub enum GateSet {
    StepLimit,
    Trial,
}

/// Number of gates in use at the same time.
pub const GATE_SETS: usize = 2;
/// The maximum number of gates of a solve whose state is recorded; further ones share the last entry.
pub const MAX_GATES: u32 = 4096;

/// Bytes of all dispatch sizes: six lists per band, two lists per finer band, and one size for the charts.
pub fn dispatch_size_bytes(bands: &[Vec<Band>]) -> u64 {
    bands.iter().flatten().map(|band| 6 + 2 * band.finer.len().max(1) as u64).sum::<u64>() * 4 + 4
}
