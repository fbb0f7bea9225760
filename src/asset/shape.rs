//! A tile as it hangs together in a pose, and its grid: what they are made from, and how.

use std::sync::Arc;

use crate::device::{Booked, Device};
use vrtm_beyond::extended;
use vrtm_beyond::gutter::Gutter;
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::grid::repaint::{Repainted, repaint};
use vrtm_core::grid::survey::Survey;
use vrtm_core::grid::{Grid, build};
use vrtm_core::image::map::TexelRect;
use vrtm_core::log::LogCode;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::settings::Beyond;

use vrtm_core::view::Strided;

use super::derived::Derived;
use super::given::{Call, Change, GridKey};
use super::room;
use crate::solved::Solved;

/// The key of a tile's triangles: the borders beyond which its charts go on, with the tiles whose charts do not go on
/// beyond seams, and the welds that are torn.
pub(super) type ShapeKey = (Option<(Beyond, Vec<u32>)>, Vec<u32>);

/// A tile as it hangs together, and what is made for that.
#[derive(Debug)]
pub(super) struct Shape {
    /// With collars, if charts go on beyond their borders.
    pub mesh: Arc<TileMesh>,
    /// The tiles that the collars lie in.
    pub beyond: Vec<u32>,
    pub grid: Derived<GridKey, Built>,
    /// The room for redirections beside charts with collars.
    gutter: Derived<(), Arc<Gutter>>,
}

/// A grid as it was built.
#[derive(Debug)]
pub(super) struct Built {
    pub grid: Arc<Grid>,
    /// Per chart, the generation of the maps from which on its rigidity is this.
    pub since: Vec<u64>,
    /// Milliseconds of building that were not yet reported.
    pub ms: f32,
}

/// The tile with the connectivity of a pose, and its grid.
pub(crate) struct Prepared {
    /// With collars, if charts go on beyond their borders.
    pub mesh: Arc<TileMesh>,
    pub grid: Arc<Grid>,
    /// The key of the grid.
    pub key: GridKey,
    /// Per chart, the generation of the maps from which on its rigidity is this.
    pub since: Vec<u64>,
}

impl Shape {
    pub fn new(mesh: Arc<TileMesh>, tiles: usize) -> Shape {
        let mut is_there: Vec<bool> = zeroed(tiles);
        mesh.sources.iter().for_each(|source| is_there[source.tile as usize] = true);
        let beyond = (0..tiles as u32).filter(|&tile| is_there[tile as usize]).collect();
        Shape { mesh, beyond, grid: Derived::default(), gutter: Derived::default() }
    }

    pub fn bytes(&self) -> u64 {
        self.grid.bytes() + self.gutter.bytes()
    }

    /// The room for redirections beside the charts, if the tile has collars.
    pub fn gutter(&mut self, call: &Call) -> Result<Option<Arc<Gutter>>> {
        let mesh = &self.mesh;
        if mesh.sources.is_empty() {
            return Ok(None);
        }
        let gutter = self.gutter.get(call.device, (), |(), booked| {
            booked.set(Gutter::BYTES, &mesh.name())?;
            Ok(Arc::new(Gutter::new(call.team, mesh, call.mesh.other_layers(mesh))))
        })?;
        Ok(Some(gutter.clone()))
    }

    /// Updates a grid of another rigidity, if that leaves its blocks as they are. True if all of it may be another one.
    pub fn repaint(&mut self, call: &Call) -> bool {
        let Some((key, built)) = self.grid.last() else { return false };
        let texels = match call.given.change_since(key) {
            Change::Strokes(strokes) => strokes.iter().map(|stroke| stroke.texels).reduce(TexelRect::with),
            Change::Rigidity => None,
            Change::Nothing | Change::Other => return false,
        };
        let key = call.given.grid_key(key.tile, self.beyond.iter().copied());
        let Some(repainted) = built.repainted(call, &key, &self.mesh, texels) else { return false };
        self.grid.follow(key, repainted);
        texels.is_none()
    }
}

impl Built {
    fn repainted(
        &self,
        call: &Call,
        key: &GridKey,
        mesh: &TileMesh,
        texels: Option<TexelRect>,
    ) -> Option<Built> {
        let (start, maps) = (Instant::now(), call.given.of(key.tile));
        let Repainted { grid, charts } = repaint(call.team, &self.grid, mesh, maps, texels)?;
        let mut since = self.since.clone();
        let changed = since.iter_mut().zip(charts).filter(|(_, changed)| *changed);
        changed.for_each(|(since, _)| *since = key.changes());
        tell_if_stuck(call.device, mesh, &grid);
        Some(Built { grid: Arc::new(grid), since, ms: self.ms + milliseconds(start) })
    }

    /// Builds a grid. Its memory is booked before it is allocated.
    pub fn new(call: &Call, key: &GridKey, mesh: &TileMesh, booked: &mut Booked) -> Result<Built> {
        let (start, name) = (Instant::now(), mesh.name());
        let (maps, size) = (call.given.of(key.tile), call.given.maps[key.tile].grid_size());
        let survey = Survey::new(call.team, mesh, maps, size);
        room::of_survey(call, key.tile, &survey)?;
        booked.set(survey.grid_bytes(), &name)?;
        let grid = build::grid(call.team, call.mesh, maps, survey);
        tell_if_stuck(call.device, mesh, &grid);
        let built = Built::of(grid, key.changes(), milliseconds(start));
        built.book(booked, &name)?;
        Ok(built)
    }

    pub fn of(grid: Grid, generation: u64, ms: f32) -> Built {
        let since = vec![generation; grid.movable.len()];
        Built { grid: Arc::new(grid), since, ms }
    }

    /// Books the bytes of the grid, and of a result on it.
    pub fn book(&self, booked: &mut Booked, name: &str) -> Result<()> {
        booked.set(self.grid.bytes() + Solved::bytes_for(&self.grid), name)
    }
}

fn tell_if_stuck(device: &Device, tile: &TileMesh, grid: &Grid) {
    if grid.rigid_sum(|square| square.rigid) > 0 && grid.movable.iter().all(|&count| count == 0) {
        let message = "it has rigid texels, but nothing that may move";
        device.log(LogCode::NothingMoves, Some(tile), &[], message);
    }
}

fn milliseconds(start: Instant) -> f32 {
    start.elapsed().as_secs_f32() * 1000.0
}

/// A tile's triangles.
pub(super) fn new_mesh(call: &Call, tile: usize, (beyond, welds): &ShapeKey) -> Arc<TileMesh> {
    let own = &call.mesh.tiles[tile];
    match beyond {
        _ if !welds.is_empty() => Arc::new(own.cut(welds)),
        Some((beyond, stay)) => Arc::new(extended(call.team, call.mesh, tile, beyond, stay)),
        None => own.clone(),
    }
}

/// The welds that a pose tears, ascending, as indices into the tile's welds: edges joined by position alone
/// (`WeldBy::Position`), where at one of the ends the vertices of both sides are farther apart than `Mesh::torn` plus
/// the rounding of their coordinates. Charts end there in this pose. It depends on the pose alone, never on earlier
/// frames.
pub(super) fn torn_welds(mesh: &Mesh, tile: &TileMesh, positions: &Strided) -> Vec<u32> {
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
    (0..tile.welds.len() as u32).filter(torn).collect()
}
