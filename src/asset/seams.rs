//! The blend of results at seams, after all tiles are solved: it is part of what is published, never of what a later solve
//! starts from.

use std::sync::Arc;
use std::time::Instant;

use super::Asset;
use super::derived::{Derived, Same};
use super::tile::{CopiesKey, TileState};
use crate::device::Device;
use crate::solved::Solved;
use vrtm_beyond::{Blends, Copies, Depths, Limited, Places, Side, blend};
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Warp;
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::report::report;
use vrtm_core::team::Team;

impl Asset {
    /// Blends the results of a call with one another; returns what is to be published instead of them, where that is something
    /// else. Tiles without a result of this call take no part: their results may be those of another pose.
    pub(super) fn blend(
        &mut self,
        team: &Team,
        results: &[(usize, Arc<Solved>)],
    ) -> Result<Vec<Option<Solved>>> {
        if results.iter().all(|(_, solved)| solved.extended.is_none()) {
            return Ok(results.iter().map(|_| None).collect());
        }
        let Asset { device, mesh, given, tiles, places, .. } = self;
        let places = &*find_places(device, mesh, places, results)?;
        let solved: Vec<Option<&Arc<Solved>>> =
            (0..tiles.len()).map(|tile| taking_part(places, results, tile)).collect();
        let reaches = given.maps.iter().map(|maps| f64::from(maps.settings.seam_reach)).collect();
        find_copies(team, device, places, &solved, reaches, tiles)?;
        let side = |tile: usize| -> Result<Option<Side>> {
            let Some(solved) = solved[tile] else { return Ok(None) };
            Ok(Some(Side { tile: &places.tiles[tile], grid: &solved.grid, u: solved.warp.host()? }))
        };
        let sides: Vec<Option<Side>> = (0..tiles.len()).map(side).collect::<Result<Vec<_>>>()?;
        let published = |(tile, solved): &(usize, Arc<Solved>)| {
            let start = Instant::now();
            let (_, copies) = tiles[*tile].copies.last().filter(|_| solved.extended.is_some())?;
            let farthest = f64::from(given.maps[*tile].settings.seam_reach);
            let blended = blend(team, places, copies, &sides, *tile, farthest)?;
            let mut published = with(solved, blended);
            published.report.times.blend = start.elapsed().as_secs_f32() * 1000.0;
            published.report.times.total += published.report.times.blend;
            Some(published)
        };
        Ok(results.iter().map(published).collect())
    }

    /// The results of tiles that were asked for and need no solve, since nothing in them has moved, but whose neighbours may
    /// say something else at their seams.
    pub(super) fn beside(&self, asked: &[bool], wanted: &[bool]) -> Vec<(usize, Arc<Solved>)> {
        let tiles = (0..self.tiles.len()).filter(|&tile| asked[tile] && !wanted[tile]);
        tiles.filter_map(|tile| Some((tile, self.tiles[tile].last.as_ref()?.solved.clone()))).collect()
    }
}

/// Where charts have what lies beyond their seams.
fn find_places<'a>(
    device: &Device,
    mesh: &Mesh,
    places: &'a mut Derived<Vec<Same<TileMesh>>, Places>,
    results: &[(usize, Arc<Solved>)],
) -> Result<&'a mut Places> {
    let tile = |tile: usize| {
        let found = results.iter().find(|(k, _)| *k == tile);
        let extended = found.and_then(|(_, solved)| solved.extended.as_ref());
        extended.unwrap_or(&mesh.tiles[tile]).clone()
    };
    let tiles: Vec<Arc<TileMesh>> = (0..mesh.tiles.len()).map(tile).collect();
    places.get(device, tiles.iter().map(Same::of).collect(), |_, _| Ok(Places::new(tiles)))
}

/// Finds what the nodes of tiles with collars are blended of: it depends on the grids of all tiles.
fn find_copies(
    team: &Team,
    device: &Device,
    places: &Places,
    solved: &[Option<&Arc<Solved>>],
    reaches: Vec<f64>,
    tiles: &mut [TileState],
) -> Result<()> {
    let same = |solved: &Option<&Arc<Solved>>| solved.map(|solved| Same::of(&solved.grid));
    let key = Arc::new(CopiesKey { grids: solved.iter().map(same).collect(), reaches });
    let grids: Vec<Option<&Grid>> = solved.iter().map(|solved| solved.map(|solved| &*solved.grid)).collect();
    let mut depths = None;
    let of_tiles = tiles.iter_mut().zip(solved).enumerate();
    for (tile, (state, solved)) in of_tiles {
        let Some(solved) = solved.filter(|solved| solved.extended.is_some()) else { continue };
        state.copies.get(device, key.clone(), |key, booked| {
            let depths = depths.get_or_insert_with(|| Depths::new(places, &grids, &key.reaches));
            let copies = Copies::new(team, &Blends { places, depths }, &solved.grid, tile);
            // The blend is a result of its own.
            booked.set(copies.bytes() as u64 + Solved::bytes_for(&solved.grid), &solved.mesh.name())?;
            Ok(copies)
        })?;
    }
    Ok(())
}

/// The result of a tile, if it is one of the mesh that the places are of: not of a tile that the pose tears.
fn taking_part<'a>(
    places: &Places,
    results: &'a [(usize, Arc<Solved>)],
    tile: usize,
) -> Option<&'a Arc<Solved>> {
    let (_, solved) = results.iter().find(|(k, _)| *k == tile)?;
    let mesh = solved.extended.as_ref().unwrap_or(&solved.mesh);
    Arc::ptr_eq(mesh, &places.tiles[tile]).then_some(solved)
}

/// A result with the warp of a blend.
fn with(solved: &Solved, blended: Limited) -> Solved {
    let Limited { u, certificates, charts } = blended;
    let mut solved = solved.with_warp(Arc::new(Warp::Host(u)));
    for (result, certificate) in solved.results.iter_mut().zip(certificates) {
        if let Some(certificate) = certificate {
            result.min_jacobian = certificate.min_jacobian;
            result.folds = certificate.folds;
            result.max_displacement = certificate.max_displacement;
        }
    }
    let results = &solved.results;
    solved.report = report!(solved.report, {
        min_jacobian: results.iter().map(|r| r.min_jacobian).fold(1.0, f64::min),
        max_displacement: results.iter().map(|r| r.max_displacement).fold(0.0, f32::max),
        folds: results.iter().map(|r| r.folds).sum(),
        charts_apart: charts,
    });
    solved
}
