//! A host's request for a solve.

use std::num::NonZeroU32;
use std::sync::Arc;

use super::Asset;
use crate::device::Device;
use vrtm_core::control::Control;
use vrtm_core::error::{Error, Result};
use vrtm_core::report::AssetInfo;
use vrtm_core::settings::{MAX_THREADS, SolveOptions};
use vrtm_core::view::Strided;

/// The request for a solve: pose, options and threads. The default solves every tile, on the device's threads.
#[derive(Clone, Debug, Default)]
pub struct SolveRequest<'a> {
    /// The pose: the positions of all vertices.
    pub positions: Strided<'a>,
    /// Quality, limits and solver of this solve.
    pub options: SolveOptions,
    /// CPU threads, at most 1024; `None` = the device's. The result is bit-identical for any number.
    pub threads: Option<NonZeroU32>,
    /// The tiles to solve, in any order; `None` = all. The others keep their results.
    pub tiles: Option<&'a [usize]>,
    /// The vertices that have moved since the last solve, in any order; `None` = any may have. Tiles without a moved
    /// vertex keep their results, unless their maps, settings or the options have changed since, or they have no
    /// result.
    pub dirty_vertices: Option<&'a [u32]>,
    /// Drop the results of the tiles to be solved before solving them, which saves their memory, 8 bytes per node of
    /// the blocks in use. They cannot be read until the solve succeeds, and no part of them can be reused.
    pub release_last: bool,
    /// Free the memory of each tile's solver once the tile is solved, about 110 bytes per node of the blocks in use:
    /// tiles are then solved one after the other, also on a GPU, and need that of one. The next solve has to allocate
    /// it again.
    pub release_solvers: bool,
    /// Cancels the call and reports its progress.
    pub control: Option<Arc<Control>>,
}

impl SolveRequest<'_> {
    /// Checks the request, which is for an asset on a device, without side effects.
    #[doc(hidden)]
    pub fn check(&self, device: &Device, of: &AssetInfo) -> Result<()> {
        Asset::check_vertices((device, of), "positions", &self.positions, 3)?;
        self.options.check()?;
        if let Some(threads) = self.threads.filter(|threads| threads.get() > MAX_THREADS) {
            return Err(Error::argument(format!("options.threads: {threads} is over {MAX_THREADS}")));
        }
        let (tiles, vertices) = (of.tiles as usize, of.vertices as usize);
        for (k, &tile) in self.tiles.unwrap_or_default().iter().enumerate() {
            ensure!(tile < tiles, "options.tiles[{k}]: {tile} is out of range, there are {tiles}");
        }
        for (k, &vertex) in self.dirty_vertices.unwrap_or_default().iter().enumerate() {
            ensure!(
                (vertex as usize) < vertices,
                "options.dirty_vertices[{k}]: {vertex} is out of range, the mesh has {vertices} vertices"
            );
        }
        Ok(())
    }
}
