//! A solver's memory follows its grid to another rigidity: what is uploaded again are the blocks that have another one.

use std::ops::Range;
use std::sync::Arc;

use super::layout::{BlockRecord, PLANE, node_planes};
use super::memory::Memory;
use super::records::{block_nodes, block_records};
use super::upload::Uploader;
use vrtm_core::error::Result;
use vrtm_core::grid::{Grid, Level};

/// The maximum number of blocks whose records are made at once.
const AT_ONCE: usize = 4096;

impl Memory {
    /// Uploads what a grid with the same blocks has other than the grid before.
    pub fn follow(&mut self, grid: &Arc<Grid>) -> Result<()> {
        let before = self.grid.upgrade();
        if before.as_ref().is_some_and(|before| Arc::ptr_eq(before, grid)) {
            return Ok(());
        }
        let uploader = Uploader::new(&self.context);
        for (k, level) in grid.levels.iter().enumerate() {
            let before = before.as_ref().map(|before| &before.levels[k]);
            let (count, buffers) = (level.blocks.list.len(), &self.levels[k]);
            let mut next = 0;
            while let Some(run) = changed(before, level, next..count) {
                let first = run.start as u64;
                let nodes = block_nodes(grid, level, k, run.clone());
                let at = first * node_planes(grid) as u64 * PLANE;
                uploader.write(&buffers.nodes, at, bytemuck::cast_slice(&nodes))?;
                let records = block_records(grid, k, run.clone());
                let at = first * size_of::<BlockRecord>() as u64;
                uploader.write(&buffers.blocks, at, bytemuck::cast_slice(&records))?;
                next = run.end;
            }
        }
        self.follow_features(grid)?;
        self.context.check()?;
        self.grid = Arc::downgrade(grid);
        Ok(())
    }
}

/// The first run of blocks among some that have another rigidity, or other weights of interpolation, than before; if
/// that is not known, all have.
fn changed(before: Option<&Level>, level: &Level, among: Range<usize>) -> Option<Range<usize>> {
    let is_changed = |&b: &usize| {
        before.is_none_or(|before| {
            before.rigidity[b] != level.rigidity[b]
                || before.interpolation.get(b) != level.interpolation.get(b)
        })
    };
    let first = among.clone().find(is_changed)?;
    let end = (first..among.end).take(AT_ONCE).find(|b| !is_changed(b));
    Some(first..end.unwrap_or(among.end.min(first + AT_ONCE)))
}
