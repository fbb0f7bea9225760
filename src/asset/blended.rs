//! The last blend of a tile at seams (`seams`), kept with its key.

use std::sync::Arc;

use super::derived::Same;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Warp;
use vrtm_core::grid::Grid;
use vrtm_cpu::certify::Certificate;

/// The key of the copies of all tiles: the grids of those that are blended together. A grid is of one mesh alone, and
/// those of the others are always the same.
pub(super) type CopiesKey = Vec<Option<Same<Grid>>>;

#[derive(Debug)]
pub(super) struct Blended {
    pub warp: Arc<Warp>,
    /// Per chart that has a change.
    pub certificates: Vec<Option<Certificate>>,
    /// The charts with a node that took less than the whole.
    pub charts_apart: u32,
}

/// The key of a blended tile: the warps of all tiles, and the copies.
#[derive(Debug, PartialEq)]
pub(super) struct BlendKey {
    pub warps: Vec<Option<Same<Warp>>>,
    pub copies: Arc<CopiesKey>,
}
