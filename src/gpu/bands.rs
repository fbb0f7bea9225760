//! Bands: how a level's blocks are laid over buffers that one binding can hold. A band owns whole rows of blocks and
//! also holds copies of the rows around them, so that a kernel only ever looks into one band; after a kernel has
//! written, copies are renewed. A level that fits into one binding, as nearly all do, is one band without copies.

use std::ops::Range;

use crate::error::{Error, ErrorKind, Result};
use crate::mesh::NONE;
use crate::tile::Level;
use crate::tile::blocks::Block;

/// Some rows of blocks of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Band {
    /// Blocks that it owns.
    pub own: Range<usize>,
    /// These and their neighbours.
    pub held: Range<usize>,
    /// The band of the next coarser level with the parents of its blocks.
    pub above: usize,
    /// The bands of the next finer level with the children of its blocks.
    pub below: Range<usize>,
}

impl Band {
    /// Place of a block in the band's buffers, `NONE` if it is not there.
    pub fn place(&self, b: u32) -> u32 {
        if b != NONE && self.held.contains(&(b as usize)) { b - self.held.start as u32 } else { NONE }
    }
}

/// A row of blocks of one chart, and the one it shares a parent row with.
fn row_pair(block: &Block) -> (u32, u32) {
    (block.chart, block.y / 2)
}

/// The bands of all levels, each of at most `capacity` blocks.
pub fn bands(levels: &[Level], capacity: usize) -> Result<Vec<Vec<Band>>> {
    let mut all: Vec<Vec<Band>> = vec![Vec::new(); levels.len()];
    for k in (0..levels.len()).rev() {
        let level = &levels[k];
        let count = level.blocks.list.len();
        if k + 1 == levels.len() {
            all[k] = split(level, 0..count, 0, capacity)?;
            continue;
        }
        // A coarser band's children: no finer band has parents in two bands.
        let coarser = &levels[k + 1].blocks.list;
        let mut bands = Vec::new();
        for above in 0..all[k + 1].len() {
            let first_child = |band: usize| match all[k + 1].get(band) {
                None => count,
                Some(_) if band == 0 => 0,
                Some(band) => {
                    let block = &coarser[band.own.start];
                    level.blocks.list.partition_point(|b| row_pair(b) < (block.chart, block.y))
                }
            };
            let children = first_child(above)..first_child(above + 1);
            let first = bands.len();
            bands.extend(split(level, children, above, capacity)?);
            all[k + 1][above].below = first..bands.len();
        }
        all[k] = bands;
    }
    Ok(all)
}

/// Cuts a range of blocks into bands, between pairs of rows.
fn split(level: &Level, range: Range<usize>, above: usize, capacity: usize) -> Result<Vec<Band>> {
    let list = &level.blocks.list;
    let held = |own: &Range<usize>| {
        let around = || level.blocks.neighbours[own.clone()].iter().flatten().filter(|&&b| b != NONE);
        let low = around().min().map_or(own.start, |&b| b as usize);
        let high = around().max().map_or(own.end, |&b| b as usize + 1);
        low..high
    };
    if held(&range).len() <= capacity {
        return Ok(vec![Band { held: held(&range), own: range, above, below: 0..0 }]);
    }
    let mut bands = Vec::new();
    let mut start = range.start;
    while start < range.end {
        let mut own = start..start;
        loop {
            if own.end == range.end {
                break;
            }
            let pair = row_pair(&list[own.end]);
            let next = own.end + list[own.end..range.end].partition_point(|b| row_pair(b) == pair);
            if held(&(start..next)).len() > capacity {
                break;
            }
            own.end = next;
        }
        if own.is_empty() {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("the GPU's bindings hold {capacity} blocks: too few for rows of {} cells", level.nx),
            ));
        }
        start = own.end;
        bands.push(Band { held: held(&own), own, above, below: 0..0 });
    }
    Ok(bands)
}
