//! Bands: the division of a level's blocks among buffers that are small enough to be bound. A band owns whole rows of
//! blocks and also holds copies of the rows next to them, so that a kernel reads only one band. After a kernel has
//! written, the copies are updated. A level that fits into one binding, as nearly all levels do, is one band without
//! copies.

use std::ops::Range;

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Level;
use vrtm_core::grid::blocks::Block;
use vrtm_core::mesh::NONE;

/// Consecutive rows of blocks of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Band {
    /// Blocks that the band owns.
    pub owned: Range<usize>,
    /// Blocks in the band's buffers: the owned ones and their neighbours.
    pub buffered: Range<usize>,
    /// The band of the next coarser level that owns the parents of the owned blocks.
    pub coarser: usize,
    /// The bands of the next finer level that own the children of the owned blocks.
    pub finer: Range<usize>,
}

impl Band {
    /// Index of block b in the band's buffers, or `NONE` if they do not contain it.
    pub fn place(&self, b: u32) -> u32 {
        if b != NONE && self.buffered.contains(&(b as usize)) { b - self.buffered.start as u32 } else { NONE }
    }
}

/// Key of a pair of rows of blocks of one chart with the same parent row.
fn row_pair(block: &Block) -> (u32, u32) {
    (block.chart, block.y / 2)
}

/// Divides all levels into bands that hold at most `capacity(level)` blocks each.
///
/// # Errors
/// `Unsupported` if a pair of rows with its neighbours does not fit.
pub fn bands(levels: &[Level], capacity: impl Fn(usize) -> usize) -> Result<Vec<Vec<Band>>> {
    let mut all: Vec<Vec<Band>> = vec![Vec::new(); levels.len()];
    for k in (0..levels.len()).rev() {
        let level = &levels[k];
        let count = level.blocks.list.len();
        if k + 1 == levels.len() {
            all[k] = split(level, 0..count, 0, capacity(k))?;
            continue;
        }
        // The children of each coarser band are divided separately, so that no finer band has parents in two bands.
        let coarser_blocks = &levels[k + 1].blocks.list;
        let mut bands = Vec::new();
        for coarser in 0..all[k + 1].len() {
            let first_child = |band: usize| match all[k + 1].get(band) {
                None => count,
                Some(_) if band == 0 => 0,
                Some(band) => {
                    let block = &coarser_blocks[band.owned.start];
                    level.blocks.list.partition_point(|b| row_pair(b) < (block.chart, block.y))
                }
            };
            let children = first_child(coarser)..first_child(coarser + 1);
            let first = bands.len();
            bands.extend(split(level, children, coarser, capacity(k))?);
            all[k + 1][coarser].finer = first..bands.len();
        }
        all[k] = bands;
    }
    Ok(all)
}

/// Divides a range of blocks into bands, between pairs of rows.
fn split(level: &Level, range: Range<usize>, coarser: usize, capacity: usize) -> Result<Vec<Band>> {
    let list = &level.blocks.list;
    let buffered = |owned: &Range<usize>| {
        let neighbours = || level.blocks.neighbours[owned.clone()].iter().flatten().filter(|&&b| b != NONE);
        let low = neighbours().min().map_or(owned.start, |&b| b as usize);
        let high = neighbours().max().map_or(owned.end, |&b| b as usize + 1);
        low..high
    };
    if buffered(&range).len() <= capacity {
        return Ok([Band { buffered: buffered(&range), owned: range, coarser, finer: 0..0 }]
            .into_iter()
            .collect());
    }
    let mut bands = Vec::new();
    let mut start = range.start;
    while start < range.end {
        let mut owned = start..start;
        loop {
            if owned.end == range.end {
                break;
            }
            let pair = row_pair(&list[owned.end]);
            let next = owned.end + list[owned.end..range.end].partition_point(|b| row_pair(b) == pair);
            if buffered(&(start..next)).len() > capacity {
                break;
            }
            owned.end = next;
        }
        if owned.is_empty() {
            return Err(Error::new(
                ErrorKind::Unsupported,
                format!("the GPU's bindings hold {capacity} blocks: too few for rows of {} cells", level.nx),
            ));
        }
        start = owned.end;
        bands.push(Band { buffered: buffered(&owned), owned, coarser, finer: 0..0 });
    }
    Ok(bands)
}
