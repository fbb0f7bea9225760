//! The maps and settings that the host has set for the tiles of an asset. The functions that set them know nothing of
//! the values that are derived from them: those store a key (`derived`) in which each state of a tile's maps has a
//! number, its generation.

use std::ops::Range;
use std::sync::Arc;

use crate::device::Device;
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::maps::{MapsOfTile, TileMaps, Values};
use vrtm_core::grid::pieces::{BYTES, Covered, SIZES, resolving};
use vrtm_core::grid::planes::NODES;
use vrtm_core::image::map::{Map, TexelRect};
use vrtm_core::mesh::Mesh;
use vrtm_core::settings::{Overlap, Seams};
use vrtm_core::team::Team;

/// Maps and settings of the host.
#[derive(Debug)]
pub(crate) struct Given {
    /// Per tile. The layers of a UDIM number share theirs.
    pub maps: Vec<TileMaps>,
    /// Per tile, what is kept for the choice of its grid.
    covered: Vec<Option<Covered>>,
    /// Per tile, true if solves skip it.
    pub frozen: Vec<bool>,
    /// Per tile, the states that its rigidity and mask have had.
    history: Vec<History>,
    /// The rigidity and the mask of the vertices.
    of_vertices: TileMaps,
}

/// A call on tiles of an asset, and all that what is made for them follows from.
#[derive(Clone, Copy)]
pub(crate) struct Call<'a> {
    pub team: &'a Team,
    pub device: &'a Device,
    pub mesh: &'a Mesh,
    pub given: &'a Given,
}

/// A tile's rigidity or its mask.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Which {
    Rigidity,
    Mask,
}

impl Which {
    fn of(self, maps: &mut TileMaps) -> &mut Values {
        match self {
            Which::Rigidity => &mut maps.rigidity,
            Which::Mask => &mut maps.mask,
        }
    }
}

/// The states of a tile's rigidity and mask.
#[derive(Debug, Default)]
struct History {
    /// The number of the present one.
    generation: u64,
    /// The number of the first one with the present mask.
    masked: u64,
    /// The number of the first one that strokes lead from to the present one.
    start: u64,
    /// These strokes, each with a generation of its own.
    strokes: Vec<Stroke>,
}

/// A change of some texels of a rigidity map.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stroke {
    /// The generation that it led to.
    pub generation: u64,
    pub texels: TexelRect,
}

/// Most strokes that are kept: a grid from before takes no longer to build than to follow as many.
const MOST_STROKES: usize = 256;

/// The inputs of a tile's grid, but for the mesh.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct GridKey {
    pub tile: usize,
    /// Generation of the tile's rigidity and mask.
    pub generation: u64,
    /// First generation with the present mask.
    masked: u64,
    /// Of the settings, what a grid depends on.
    size: [usize; 2],
    overlap: Overlap,
    keeps: bool,
    smoothness: [f32; 2],
    has_density: bool,
    /// The tiles that its collars lie in.
    beyond: Vec<There>,
    /// The tiles to which its charts do not go on.
    stay: Vec<u32>,
}

impl GridKey {
    /// The number of the changes of all maps that the grid shows: higher after each.
    pub fn changes(&self) -> u64 {
        self.generation + self.beyond.iter().map(|there| there.generation).sum::<u64>()
    }
}

/// A tile in which a collar of another one lies: the generation of its maps, that of its mask, and the size of its
/// grid, at which they are read.
#[derive(Clone, Debug, PartialEq)]
struct There {
    tile: u32,
    generation: u64,
    masked: u64,
    size: [usize; 2],
}

/// Change of a grid's inputs.
#[derive(Debug)]
pub(crate) enum Change<'a> {
    Nothing,
    /// The rigidity in these texels.
    Strokes(&'a [Stroke]),
    /// The rigidity.
    Rigidity,
    /// Settings, masks, or which tiles collars lie in.
    Other,
}

impl Given {
    pub fn new(tiles: usize) -> Given {
        Given {
            maps: (0..tiles).map(|_| TileMaps::default()).collect(),
            covered: (0..tiles).map(|_| None).collect(),
            frozen: vec![false; tiles],
            history: (0..tiles).map(|_| History::default()).collect(),
            of_vertices: TileMaps::default(),
        }
    }

    /// The maps that a tile's grid depends on.
    pub fn of(&self, tile: usize) -> MapsOfTile<'_> {
        MapsOfTile { own: &self.maps[tile], all: &self.maps }
    }

    /// Bytes of a tile's maps, and of what the choice of its grid keeps. Maps that layers share count for the first
    /// layer.
    pub fn bytes(&self, mesh: &Mesh, tile: usize) -> u64 {
        let covered = self.covered[tile].as_ref().map_or(0, Covered::bytes);
        let TileMaps { rigidity, mask, .. } = &self.maps[tile];
        covered + if mesh.tiles[tile].layer > 0 { 0 } else { rigidity.bytes() + mask.bytes() }
    }

    /// Sets the rigidity or the mask of tiles; without a map it is that of the vertices.
    pub fn set(&mut self, tiles: Range<usize>, which: Which, map: Option<Arc<Map>>) {
        let values = map.map_or_else(|| which.of(&mut self.of_vertices).clone(), Values::Map);
        tiles.for_each(|tile| self.replace(tile, which, &values));
    }

    /// Sets the rigidity or the mask of the vertices, for tiles that have no map of their own.
    pub fn set_of_vertices(&mut self, which: Which, values: Values) {
        for tile in 0..self.maps.len() {
            if !matches!(which.of(&mut self.maps[tile]), Values::Map(_)) {
                self.replace(tile, which, &values);
            }
        }
        *which.of(&mut self.of_vertices) = values;
    }

    fn replace(&mut self, tile: usize, which: Which, by: &Values) {
        let values = which.of(&mut self.maps[tile]);
        if values != by {
            *values = by.clone();
            self.history[tile].begin(which);
            self.maps[tile].resolving = None;
        }
    }

    /// Changes texels of the rigidity map that some tiles share.
    pub fn stroke(&mut self, tiles: Range<usize>, texels: TexelRect, change: impl FnOnce(&mut Map)) {
        tiles.clone().for_each(|tile| self.history[tile].add(texels));
        let mut shared = Values::None;
        for tile in tiles.clone() {
            shared = std::mem::take(&mut self.maps[tile].rigidity);
        }
        if let Values::Map(map) = &mut shared {
            // Nobody else has it: nothing is copied.
            change(Arc::make_mut(map));
        }
        tiles.for_each(|tile| {
            self.maps[tile].rigidity = shared.clone();
            self.maps[tile].resolving = None;
        });
    }

    /// Looks for the grids of some tiles that resolve their rigidity, if the settings leave their sizes open. They take
    /// no more than an equal share of a memory budget, and fit into a GPU's buffers.
    pub fn find_sizes(
        &mut self,
        team: &Team,
        mesh: &Mesh,
        tiles: impl Iterator<Item = usize>,
        device: &Device,
    ) {
        let of_budget = device.memory_budget().map(|budget| budget / self.maps.len().max(1) as u64);
        // Half of the blocks are left for those at borders, of which the area of the charts says nothing.
        let of_gpu = device.gpu().map(|gpu| (gpu.most_blocks() / 2 * NODES) as u64 * BYTES);
        let share = of_budget.into_iter().chain(of_gpu).min();
        for tile in tiles {
            let maps = &mut self.maps[tile];
            if maps.settings.grid.contains(&None) && maps.resolving.is_none() {
                let covered = &mut self.covered[tile];
                let cells = resolving(team, &mesh.tiles[tile], &maps.rigidity, share, covered);
                maps.resolving = Some(cells.unwrap_or(SIZES[0]));
            }
        }
    }

    /// The present key of a tile's grid. `beyond` are the tiles that its collars lie in.
    pub fn grid_key(&self, tile: usize, beyond: impl Iterator<Item = u32>) -> GridKey {
        let (maps, history) = (&self.maps, &self.history);
        let settings = &maps[tile].settings;
        let there = |tile: u32| {
            let (maps, history) = (&maps[tile as usize], &history[tile as usize]);
            There { tile, generation: history.generation, masked: history.masked, size: maps.grid_size() }
        };
        GridKey {
            tile,
            generation: history[tile].generation,
            masked: history[tile].masked,
            size: maps[tile].grid_size(),
            overlap: settings.overlap,
            keeps: settings.seams == Seams::Keep,
            smoothness: [settings.smoothness, settings.smoothness_floor],
            has_density: settings.orientation_density > 0.0,
            beyond: beyond.map(there).collect(),
            stay: self.stay(tile),
        }
    }

    /// If charts of a tile go on beyond their seams, the tiles whose charts do not.
    pub fn stay(&self, tile: usize) -> Vec<u32> {
        let goes_on = |maps: &TileMaps| maps.settings.beyond().is_some_and(|beyond| beyond.seams);
        let stays = |other: &usize| goes_on(&self.maps[tile]) && !goes_on(&self.maps[*other]);
        (0..self.maps.len()).filter(stays).map(|other| other as u32).collect()
    }

    /// The change of a grid's inputs since it had this key.
    pub fn change_since(&self, key: &GridKey) -> Change<'_> {
        let now = self.grid_key(key.tile, key.beyond.iter().map(|there| there.tile));
        let mut like_then = now.clone();
        like_then.generation = key.generation;
        let is_own = like_then == *key;
        for (there, then) in like_then.beyond.iter_mut().zip(&key.beyond) {
            there.generation = then.generation;
        }
        let History { start, strokes, .. } = &self.history[key.tile];
        if like_then != *key {
            Change::Other
        } else if now == *key {
            Change::Nothing
        } else if !is_own || key.generation < *start {
            Change::Rigidity
        } else {
            let first = strokes.partition_point(|stroke| stroke.generation <= key.generation);
            Change::Strokes(&strokes[first..])
        }
    }
}

impl History {
    /// Begins anew, with another map.
    fn begin(&mut self, which: Which) {
        self.generation += 1;
        if which == Which::Mask {
            self.masked = self.generation;
        }
        self.start = self.generation;
        self.strokes.clear();
    }

    /// Goes on by a stroke.
    fn add(&mut self, texels: TexelRect) {
        if self.strokes.len() == MOST_STROKES {
            self.start = self.strokes.remove(0).generation;
        }
        self.strokes.push(Stroke { generation: self.generation + 1, texels });
        self.generation += 1;
    }
}
