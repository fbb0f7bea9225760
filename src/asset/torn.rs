//! Welds that a pose tears: edges joined by position alone (`WeldBy::Position`) whose two sides the pose pulls apart.
//! Charts end there in this pose. Which welds are torn depends on the pose alone, never on earlier frames.

use std::sync::Arc;

use vrtm_core::allocation::{Collect, copied};
use vrtm_core::grid::Grid;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::view::Strided;

/// A tile torn by a pose.
#[derive(Debug)]
pub(crate) struct Torn {
    /// The torn welds, as indices into the whole tile's welds.
    welds: Vec<u32>,
    pub mesh: Arc<TileMesh>,
    /// Its grid, once built.
    pub grid: Option<Arc<Grid>>,
}

/// The welds that a pose tears, ascending, as indices into the tile's welds: the vertices at one of the ends are farther
/// apart than `Mesh::torn` plus the rounding of their coordinates.
pub(super) fn welds(mesh: &Mesh, tile: &TileMesh, positions: &Strided) -> Vec<u32> {
    let is_torn = |[a, b]: [u32; 2]| {
        if a == b {
            return false;
        }
        let [p, q] = [a, b].map(|v| positions.get3(v as usize));
        let largest = p.iter().chain(&q).fold(0.0, |m: f64, x| m.max(x.abs()));
        let apart = [0, 1, 2].map(|c| (p[c] - q[c]).abs()).into_iter().fold(0.0, f64::max);
        // Vertices that a host moves alike differ by a few rounding errors of their coordinates.
        apart > mesh.torn + 8.0 * positions.epsilon() * largest
    };
    let torn = |weld: &u32| tile.welds[*weld as usize].ends.into_iter().any(is_torn);
    (0..tile.welds.len() as u32).filter(torn).collected()
}

/// The tile with the connectivity of a pose.
pub(crate) fn in_pose(mesh: &Mesh, tile: usize, positions: &Strided) -> Arc<TileMesh> {
    let whole = &mesh.tiles[tile];
    match welds(mesh, whole, positions) {
        torn if torn.is_empty() => whole.clone(),
        torn => Arc::new(whole.cut(&torn)),
    }
}

impl Torn {
    pub fn new(whole: &TileMesh, welds: &[u32]) -> Torn {
        Torn { welds: copied(welds), mesh: Arc::new(whole.cut(welds)), grid: None }
    }

    /// True if these are the torn welds.
    pub fn is(&self, welds: &[u32]) -> bool {
        self.welds == welds
    }

    /// Drops the grid, because maps or settings have changed.
    pub fn forget_grid(&mut self) {
        self.grid = None;
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.grid.as_ref().map_or(0, |grid| grid.bytes())
    }
}
