//! The blend of results at seams, after all tiles are solved: it is part of what is published, never of what a later solve
//! starts from.

use std::sync::Arc;
use std::sync::atomic::AtomicU32;
use std::time::Instant;

use super::Asset;
use crate::solver::solved::Solved;
use crate::solver::tile_solve::Warp;
use vrtm_beyond::{Blends, Copies, Depths, Limited, Places, Side, blend};
use vrtm_core::allocation::{Collect, copied};
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::grid::gutter::LimitedTexels;
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::plan::ChartResult;
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
            return Ok(results.iter().map(|_| None).collected());
        }
        self.find_places(results);
        self.find_copies(team, results)?;
        let Some(places) = &self.places else { return Ok(Vec::new()) };
        let side = |tile: usize| -> Result<Option<Side>> {
            let Some(solved) = taking_part(places, results, tile) else { return Ok(None) };
            Ok(Some(Side { tile: &places.tiles[tile], grid: &solved.grid, u: solved.warp.host()? }))
        };
        let sides: Vec<Option<Side>> = (0..self.tiles.len()).map(side).try_collected()?;
        let published = |(tile, solved): &(usize, Arc<Solved>)| {
            let start = Instant::now();
            let state = &self.tiles[*tile];
            let copies = state.copies.as_ref().filter(|_| solved.extended.is_some())?;
            let farthest = f64::from(state.maps.settings.seam_reach);
            let blended = blend(team, places, copies, &sides, *tile, farthest)?;
            let mut published = with(solved, blended);
            published.report.times.blend = start.elapsed().as_secs_f32() * 1000.0;
            published.report.times.total += published.report.times.blend;
            Some(published)
        };
        Ok(results.iter().map(published).collected())
    }

    /// Finds what nodes are blended of, unless that is known.
    fn find_copies(&mut self, team: &Team, results: &[(usize, Arc<Solved>)]) -> Result<()> {
        let Some(places) = &self.places else { return Ok(()) };
        let extended = || results.iter().filter(|(_, solved)| solved.extended.is_some());
        let grid = |tile: usize| taking_part(places, results, tile).map(|solved| &*solved.grid);
        let tiles: Vec<usize> = (0..self.tiles.len()).filter(|&tile| grid(tile).is_some()).collected();
        if extended().all(|(tile, _)| self.tiles[*tile].copies.is_some()) && tiles == self.together {
            return Ok(());
        }
        // Those of all tiles depend on the grids of all tiles.
        self.tiles.iter_mut().for_each(|state| state.copies = None);
        self.together = tiles;
        let grids: Vec<Option<&Grid>> = (0..self.tiles.len()).map(grid).collected();
        let reaches: Vec<f64> =
            self.tiles.iter().map(|state| f64::from(state.maps.settings.seam_reach)).collected();
        let blends = Blends { places, depths: &Depths::new(places, &grids, &reaches) };
        let copies =
            |(tile, solved): &(usize, Arc<Solved>)| (*tile, Copies::new(team, &blends, &solved.grid, *tile));
        let found: Vec<(usize, Copies)> = extended().map(copies).collected();
        for (tile, copies) in found {
            let state = &mut self.tiles[tile];
            state.copies = Some(copies);
            if let Err(error) = state.book(&self.device, 0, &self.mesh.tiles[tile]) {
                self.tiles.iter_mut().for_each(|state| state.copies = None);
                return Err(error);
            }
        }
        Ok(())
    }

    /// The results of tiles that were asked for and need no solve, since nothing in them has moved, but whose neighbours may
    /// say something else at their seams.
    pub(super) fn beside(&self, asked: &[bool], wanted: &[bool]) -> Vec<(usize, Arc<Solved>)> {
        let tiles = (0..self.tiles.len()).filter(|&tile| asked[tile] && !wanted[tile]);
        tiles.filter_map(|tile| Some((tile, self.tiles[tile].solved.clone()?))).collected()
    }

    /// Finds where charts have what lies beyond their seams, unless that is known.
    fn find_places(&mut self, results: &[(usize, Arc<Solved>)]) {
        let tile = |tile: usize| {
            let found = results.iter().find(|(k, _)| *k == tile);
            let extended = found.and_then(|(_, solved)| solved.extended.as_ref());
            extended.unwrap_or(&self.mesh.tiles[tile]).clone()
        };
        let tiles: Vec<Arc<TileMesh>> = (0..self.tiles.len()).map(tile).collected();
        let is_known = |places: &Places| tiles.iter().zip(&places.tiles).all(|(a, b)| Arc::ptr_eq(a, b));
        if !self.places.as_ref().is_some_and(is_known) {
            self.places = Some(Places::new(tiles));
            self.tiles.iter_mut().for_each(|state| state.copies = None);
        }
    }
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
    let mut results: Vec<ChartResult> = copied(&solved.results);
    for (result, certificate) in results.iter_mut().zip(certificates) {
        if let Some(certificate) = certificate {
            result.min_jacobian = certificate.min_jacobian;
            result.folds = certificate.folds;
            result.max_displacement = certificate.max_displacement;
        }
    }
    let report = report!(solved.report, {
        min_jacobian: results.iter().map(|r| r.min_jacobian).fold(1.0, f64::min),
        max_displacement: results.iter().map(|r| r.max_displacement).fold(0.0, f32::max),
        folds: results.iter().map(|r| r.folds).sum(),
        charts_apart: charts,
    });
    Solved {
        mesh: solved.mesh.clone(),
        extended: solved.extended.clone(),
        grid: solved.grid.clone(),
        warp: Arc::new(Warp::Host(u)),
        inputs: Vec::new(),
        results,
        overlap: solved.overlap,
        report,
        invert_ms: AtomicU32::new(0),
        gutter: solved.gutter.clone(),
        limited: LimitedTexels::default(),
        work: solved.work.clone(),
    }
}
