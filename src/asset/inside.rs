//! An asset as tests and benches read it (crate `vrtm-testkit`).

use std::sync::Arc;

use super::Asset;
use super::given::Call;
use super::shape::torn_welds;
use crate::map::nodes;
use crate::solved::Solved;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::grid::maps::TileMaps;
use vrtm_core::grid::{Grid, planes::Plane};
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::view::Strided;

/// A tile in a pose.
#[derive(Debug)]
pub struct TileInside<'a> {
    pub mesh: &'a Mesh,
    /// The tile as it hangs together in the pose.
    pub tile: Arc<TileMesh>,
    /// The same, with collars if its charts go on beyond their borders.
    pub extended: Arc<TileMesh>,
    pub maps: &'a TileMaps,
    /// The maps of all tiles.
    pub all_maps: &'a [TileMaps],
}

#[derive(Debug)]
pub struct ResultInside(Arc<Solved>);

impl ResultInside {
    pub fn grid(&self) -> &Arc<Grid> {
        &self.0.grid
    }

    /// The tile with collars, if it was solved with them.
    pub fn extended(&self) -> Option<&Arc<TileMesh>> {
        self.0.extended.as_ref()
    }

    /// Displacements in cells, per block.
    pub fn displacements(&self) -> Result<&[[Plane; 2]]> {
        self.0.warp.host()
    }

    /// Displacements in cells, row by row from v = 0, (nx + 1) x (ny + 1).
    pub fn dense_displacements(&self) -> Result<Vec<[f32; 2]>> {
        nodes::dense(&self.0)
    }
}

impl Asset {
    /// A tile in a pose, as a solve sees it.
    #[doc(hidden)]
    pub fn tile_inside(&self, tile: usize, positions: &Strided) -> Result<TileInside<'_>> {
        self.check_tile(tile)?;
        Asset::check_vertices((&self.device, &self.mesh.info), "positions", positions, 3)?;
        let Asset { device, mesh, given, tiles, .. } = self;
        let welds = torn_welds(mesh, &mesh.tiles[tile], positions);
        let extended = device.team(|team| tiles[tile].mesh(&Call { team, device, mesh, given }, &welds));
        let whole = if welds.is_empty() { mesh.tiles[tile].clone() } else { extended.clone() };
        Ok(TileInside { mesh, tile: whole, extended, maps: &given.maps[tile], all_maps: &given.maps })
    }

    #[doc(hidden)]
    pub fn result_inside(&self, tile: usize) -> Result<ResultInside> {
        self.check_tile(tile)?;
        self.results.solved(tile).map(|result| ResultInside(result.solved))
    }
}
