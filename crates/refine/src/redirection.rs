//! The door between a refinement and a tile's result.

use glam::DVec2;

use vrtm_core::error::Result;

/// The result of a tile.
pub trait Redirection: Sync {
    /// Cells of its grid.
    fn cells(&self) -> [usize; 2];
    /// The tile's lower corner in the UV plane of all tiles.
    fn origin(&self) -> DVec2;
    /// Calls `f` for each node that moves, with its displacement in cells.
    fn visit_moved(&self, f: &mut dyn FnMut([usize; 2], [f32; 2])) -> Result<()>;
    /// The redirected UV of a point of a triangle, computed like a corner UV, by its chart's own warp; input and output
    /// include the tile's offset. `None` where nothing moves. `triangle` is a number in `TileMesh::chart_of`.
    fn redirected(&self, triangle: u32, uv: [f64; 2]) -> Option<[f64; 2]>;
}
