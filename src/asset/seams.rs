//! The blend of results at seams, after all tiles are solved: it is part of what is published, never of what a later
//! solve starts from.

use std::sync::Arc;

use super::Asset;
use super::blended::{BlendKey, Blended, CopiesKey};
use super::derived::{Derived, Same};
use super::results::not_solved;
use super::tile::TileState;
use crate::device::Device;
use crate::solved::Solved;
use vrtm_beyond::{Copies, Depths, Limited, Places, Side, blend};
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Warp;
use vrtm_core::clock::Instant;
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::mesh::{Mesh, TileMesh};
use vrtm_core::report::report;
use vrtm_core::team::Team;

/// The share of a call's progress for the blend, if charts continue beyond their borders.
pub(super) const SHARE: f32 = 0.2;

impl Asset {
    /// Blends the results of a call with one another; returns what is to be published instead of them, where that is
    /// something else. Tiles that were not asked for take no part: their results may be those of another pose.
    pub(super) fn blend(
        &mut self,
        team: &Team,
        results: &[(usize, Arc<Solved>)],
    ) -> Result<Vec<Option<Solved>>> {
        let moves = |solved: &Solved| solved.results.iter().any(|result| result.max_displacement > 0.0);
        let has_seams = results.iter().any(|(_, solved)| solved.extended.is_some());
        if !results.iter().any(|(_, solved)| moves(solved)) {
            // A tile's published result may have been blended with another tile's last one.
            let plain =
                |(_, solved): &(usize, Arc<Solved>)| has_seams.then(|| solved.with_warp(solved.warp.clone()));
            return Ok(results.iter().map(plain).collect());
        }
        if !has_seams {
            return Ok(results.iter().map(|_| None).collect());
        }
        let Asset { device, mesh, given, tiles, places, .. } = self;
        let places = &*find_places(device, mesh, places, results)?;
        let solved: Vec<Option<&Arc<Solved>>> =
            (0..tiles.len()).map(|tile| taking_part(places, results, tile)).collect();
        let copies = find_copies(team, device, places, &solved, tiles)?;
        let advance = |fraction: f32| {
            if let Some(control) = team.control() {
                control.advance(fraction);
            }
        };
        advance(0.5 * SHARE);
        let warp = |solved: &Option<&Arc<Solved>>| solved.map(|solved| Same::of(&solved.warp));
        let key = Arc::new(BlendKey { warps: solved.iter().map(warp).collect(), copies });
        // The displacements of all tiles, which a GPU's results are read for.
        let mut sides: Option<Vec<Option<Side>>> = None;
        let mut published = Vec::with_capacity(results.len());
        for (tile, own) in results {
            let start = Instant::now();
            let state = &mut tiles[*tile];
            let Some((_, copies)) = state.copies.last().filter(|_| own.extended.is_some()) else {
                published.push(None);
                continue;
            };
            let is_new = state.blended.known(&key).is_none();
            if sides.is_none() && is_new {
                let side = |tile: usize| -> Result<Option<Side>> {
                    let Some(solved) = solved[tile] else { return Ok(None) };
                    Ok(Some(Side { tile: &places.tiles[tile], grid: &solved.grid, u: solved.warp.host()? }))
                };
                sides = Some((0..solved.len()).map(side).collect::<Result<Vec<_>>>()?);
            }
            let farthest = f64::from(given.maps[*tile].settings.seam_reach);
            // Its memory is booked with the copies.
            let blended = state.blended.get(device, key.clone(), |_, _| {
                let sides = sides.as_deref().unwrap_or_default();
                let Limited { u, certificates, charts } =
                    blend(team, places, copies, sides, *tile, farthest).ok_or_else(not_solved)?;
                Ok(Blended { warp: Arc::new(Warp::Host(u)), certificates, charts_apart: charts })
            })?;
            let mut solved = with(own, blended);
            if is_new {
                solved.report.times.blend = start.elapsed().as_secs_f32() * 1000.0;
                solved.report.times.total += solved.report.times.blend;
            }
            published.push(Some(solved));
            advance(0.5 * SHARE / results.len() as f32);
        }
        Ok(published)
    }
}

/// Finds the places of the surface beyond seams in the charts that have collars.
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
    places.get(device, tiles.iter().map(Same::of).collect(), |_, booked| {
        let places = Places::new(tiles);
        booked.set(places.bytes(), "the places at seams")?;
        Ok(places)
    })
}

/// Finds what the nodes of tiles with collars are blended of: it depends on the grids of all tiles.
fn find_copies(
    team: &Team,
    device: &Device,
    places: &Places,
    solved: &[Option<&Arc<Solved>>],
    tiles: &mut [TileState],
) -> Result<Arc<CopiesKey>> {
    let same = |solved: &Option<&Arc<Solved>>| solved.map(|solved| Same::of(&solved.grid));
    let key: Arc<CopiesKey> = Arc::new(solved.iter().map(same).collect());
    let grids: Vec<Option<&Grid>> = solved.iter().map(|solved| solved.map(|solved| &*solved.grid)).collect();
    let mut depths = None;
    let of_tiles = tiles.iter_mut().zip(solved).enumerate();
    for (tile, (state, solved)) in of_tiles {
        let Some(solved) = solved.filter(|solved| solved.extended.is_some()) else { continue };
        state.copies.get(device, key.clone(), |_, booked| {
            let depths = depths.get_or_insert_with(|| Depths::new(team, places, &grids));
            let copies = Copies::new(team, places, depths, &solved.grid, tile);
            // The blend is a result of its own.
            booked.set(copies.bytes() as u64 + Solved::bytes_for(&solved.grid), &solved.mesh.name())?;
            Ok(copies)
        })?;
    }
    Ok(key)
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
fn with(solved: &Solved, blended: &Blended) -> Solved {
    let mut solved = solved.with_warp(blended.warp.clone());
    for (result, certificate) in solved.results.iter_mut().zip(&blended.certificates) {
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
        charts_apart: blended.charts_apart,
    });
    solved
}
