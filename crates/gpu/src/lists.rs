//! Lists of the blocks that a solve works on, over which kernels are dispatched.

use vrtm_core::allocation::Vec;
use vrtm_core::grid::Level;

/// A list of a level's blocks: a range of the level's buffer of lists.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct List {
    pub first: u32,
    pub count: u32,
    /// Index of the list's length among the dispatch sizes.
    pub size_index: u32,
}

/// The lists of a level's blocks, for the charts of a solve.
#[derive(Clone, Debug, Default)]
pub struct Lists {
    /// Active blocks, by block colour.
    pub colours: [List; 4],
    /// Active blocks in storage order.
    pub active: List,
    /// All stored blocks: active ones, and inactive neighbours of movable nodes.
    pub stored: List,
}

/// Number of lists of a level.
const LISTS: u64 = 6;

/// Bytes of the lists of a level with `count` blocks: each block is in at most three of them.
pub fn list_bytes(count: u64) -> u64 {
    (3 * count * 4).max(16)
}

/// A level's active blocks of the given charts.
pub fn active_blocks<'a>(level: &'a Level, charts: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
    stored_blocks(level, charts).filter(|&b| level.blocks.list[b].active)
}

fn stored_blocks<'a>(level: &'a Level, charts: &'a [bool]) -> impl Iterator<Item = usize> + 'a {
    let list = &level.blocks.list;
    (0..list.len()).filter(|&b| charts[list[b].chart as usize])
}

/// Builds a level's lists and returns them with the blocks of all lists, one list after the other. Appends the lists'
/// lengths to `sizes`.
pub fn level_lists(level: &Level, charts: &[bool], sizes: &mut Vec<u32>) -> (Lists, Vec<u32>) {
    let list = &level.blocks.list;
    let mut lists = Lists::default();
    let mut all: Vec<u32> = Vec::new();
    let mut add = |blocks: &mut dyn Iterator<Item = usize>| {
        let first = all.len() as u32;
        all.extend(blocks.map(|b| b as u32));
        let count = all.len() as u32 - first;
        sizes.push(count);
        List { first, count, size_index: sizes.len() as u32 - 1 }
    };
    for (colour, range) in lists.colours.iter_mut().enumerate() {
        let of_colour = |&b: &usize| (list[b].y % 2 * 2 + list[b].x % 2) as usize == colour;
        *range = add(&mut active_blocks(level, charts).filter(of_colour));
    }
    lists.active = add(&mut active_blocks(level, charts));
    lists.stored = add(&mut stored_blocks(level, charts));
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

/// Bytes of all dispatch sizes: the lengths of each level's lists, and the number of charts.
pub fn dispatch_size_bytes(levels: usize) -> u64 {
    (LISTS * levels as u64 + 1) * 4
}
