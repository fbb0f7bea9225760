//! A tile's maps and settings, as set by the host.

use std::sync::Arc;

use crate::image::map::Map;
use crate::settings::{MAX_GRID, TileSettings};

use crate::grid::planes::SIDE;

/// The source of a tile's rigidity.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Rigidity {
    /// No rigidity anywhere.
    #[default]
    None,
    /// An image.
    Map(Arc<Map>),
    /// One value per vertex of the mesh.
    Vertices(Arc<Vec<f32>>),
}

/// The source of a tile's mask.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Mask {
    /// All nodes may move.
    #[default]
    None,
    /// An image.
    Map(Arc<Map>),
    /// One value per vertex of the mesh.
    Vertices(Arc<Vec<f32>>),
}

/// A tile's maps and settings, as set by the host.
#[derive(Clone, Debug, Default)]
pub struct TileMaps {
    pub rigidity: Rigidity,
    pub mask: Mask,
    pub settings: TileSettings,
}

/// The maps that a tile's grid depends on.
#[derive(Clone, Copy)]
pub struct MapsOfTile<'a> {
    pub own: &'a TileMaps,
    /// Those of all tiles of the mesh, for a tile with collars; otherwise they may be missing.
    pub all: &'a [TileMaps],
}

impl<'a> MapsOfTile<'a> {
    /// Those of a tile without collars.
    pub fn alone(own: &'a TileMaps) -> MapsOfTile<'a> {
        MapsOfTile { own, all: &[] }
    }

    /// Those of a tile, by its number in the mesh.
    pub fn of(&self, tile: u32) -> Option<&'a TileMaps> {
        self.all.get(tile as usize)
    }
}

/// Cells on a side of the grid of a tile with rigidity per vertex, unless the settings give a size.
const VERTEX_GRID: usize = 1024;

impl TileMaps {
    /// Cells of the grid: the size from the settings, or else the size of the rigidity map, rounded up to a multiple of
    /// 16.
    pub fn grid_size(&self) -> [usize; 2] {
        let default = match &self.rigidity {
            Rigidity::Map(map) => [map.width, map.height],
            Rigidity::Vertices(_) => [VERTEX_GRID; 2],
            // No node will be movable: the smallest grid is enough.
            Rigidity::None => [SIDE; 2],
        };
        std::array::from_fn(|axis| {
            let n = self.settings.grid[axis].map_or(default[axis], |n| n as usize);
            n.next_multiple_of(SIDE).min(MAX_GRID as usize)
        })
    }
}
