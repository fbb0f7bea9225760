//! A tile's maps and settings, as set by the host.

use std::sync::Arc;

use crate::allocation::Vec;
use crate::image::map::Map;
use crate::settings::{MAX_GRID, TileSettings};

use crate::grid::planes::SIDE;

/// A tile's rigidity or mask, 0 to 1.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Values {
    #[default]
    None,
    /// An image.
    Map(Arc<Map>),
    /// One value per vertex of the mesh.
    Vertices(Arc<Vec<f32>>),
}

impl Values {
    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        match self {
            Values::None => 0,
            Values::Map(map) => map.bytes(),
            Values::Vertices(values) => values.len() as u64 * 4,
        }
    }
}

/// A tile's maps and settings, as set by the host.
#[derive(Clone, Debug, Default)]
pub struct TileMaps {
    /// Without values there is none anywhere.
    pub rigidity: Values,
    /// Without values all nodes may move.
    pub mask: Values,
    pub settings: TileSettings,
    /// Cells on a side of the grid that resolves the rigidity (`pieces`), if that was looked for.
    pub resolving: Option<u32>,
}

/// The maps that a tile's grid depends on.
#[derive(Clone, Copy)]
pub struct MapsOfTile<'a> {
    pub own: &'a TileMaps,
    /// Maps of all tiles of the mesh, for a tile with collars; otherwise they may be missing.
    pub all: &'a [TileMaps],
}

impl<'a> MapsOfTile<'a> {
    /// Maps of a tile without collars.
    pub fn alone(own: &'a TileMaps) -> MapsOfTile<'a> {
        MapsOfTile { own, all: &[] }
    }

    /// Maps of a tile, by its number in the mesh.
    pub fn of(&self, tile: u32) -> Option<&'a TileMaps> {
        self.all.get(tile as usize)
    }
}

/// Cells on a side of the grid of a tile with rigidity per vertex, where none was looked for.
const VERTEX_GRID: usize = 1024;

impl TileMaps {
    /// Cells of the grid, a multiple of 16: the size from the settings, or the one that resolves the rigidity. Where
    /// that was not looked for, it is the map's.
    pub fn grid_size(&self) -> [usize; 2] {
        let default = match (&self.rigidity, self.resolving) {
            // No node will be movable: the smallest grid is enough.
            (Values::None, _) => [SIDE; 2],
            (_, Some(cells)) => [cells as usize; 2],
            (Values::Map(map), None) => [map.width, map.height],
            (Values::Vertices(_), None) => [VERTEX_GRID; 2],
        };
        std::array::from_fn(|axis| {
            let n = self.settings.grid[axis].map_or(default[axis], |n| n as usize);
            n.next_multiple_of(SIDE).min(MAX_GRID as usize)
        })
    }
}
