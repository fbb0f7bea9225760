//! The passes of a refinement: finds the triangles whose error exceeds the tolerance in the present result, until none
//! does.

use glam::DVec2;

use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::error::Result;
use vrtm_core::mesh::{Mesh, NONE};
use vrtm_core::team::Team;

use crate::base::{Base, UvPoint};
use crate::error::Warped;
use crate::redirection::Redirection;
use crate::split::{Piece, Pieces, Splitter};

/// Number of elements per item of work.
const CHUNK: usize = 64;
/// A triangle whose sides are shorter than this, in cells, is not split: where charts that share texels meet, the
/// redirection may jump, and splitting does not help. Elsewhere it is steep at most: thirty cells per cell in a
/// squashed region.
const SHORT: f64 = 1.0 / 1024.0;
/// Splitting a triangle into four divides its error by four where the redirection is smooth: if that does not suffice,
/// all of its edges are split at once.
const FOURFOLD: f64 = 4.0;

/// The result of a tile, prepared.
struct Prepared<'a> {
    tile: &'a dyn Redirection,
    origin: DVec2,
    cells: DVec2,
    warped: Option<Warped>,
}

/// The results that redirect a UV set.
pub struct Redirections<'a>(Vec<Option<Prepared<'a>>>);

impl<'a> Redirections<'a> {
    /// `with_edges`: also prepare what computing errors needs.
    pub fn new(
        team: &Team,
        tiles: &'a [Option<impl Redirection>],
        with_edges: bool,
    ) -> Result<Redirections<'a>> {
        let of = |tile: &'a dyn Redirection| -> Result<Prepared<'a>> {
            let cells = DVec2::from(tile.cells().map(|n| n as f64));
            let warped = if with_edges { Warped::new(team, tile)? } else { None };
            Ok(Prepared { tile, origin: tile.origin(), cells, warped })
        };
        let of_tiles = tiles.iter().map(|tile| tile.as_ref().map(|tile| of(tile)).transpose());
        of_tiles.collect::<Result<Vec<_>>>().map(Redirections)
    }

    /// The redirected UVs of points, computed like corner UVs: by a chart's own warp.
    pub fn redirect(&self, team: &Team, points: &[UvPoint], out: &mut [[f64; 2]]) {
        let mut chunks: Vec<_> = points.chunks(CHUNK).zip(out.chunks_mut(CHUNK)).collect();
        team.fill(&mut chunks, |_, (points, out)| {
            points.iter().zip(out.iter_mut()).for_each(|(point, uv)| *uv = self.place(point));
        });
    }

    fn tile(&self, tile: u32) -> Option<&Prepared<'a>> {
        self.0.get(tile as usize)?.as_ref()
    }

    fn place(&self, point: &UvPoint) -> [f64; 2] {
        let Some(tile) = self.tile(point.tile).filter(|_| point.triangle != NONE) else { return point.uv };
        tile.tile.redirected(point.triangle, point.uv).unwrap_or(point.uv)
    }

    /// The error of a triangle with these UV points, and whether it is too small to be split.
    fn error(&self, corners: [u32; 3], points: &[UvPoint], uvs: &[[f64; 2]]) -> (f64, bool) {
        let tile = self.tile(points[corners[0] as usize].tile);
        let Some((tile, warped)) = tile.and_then(|tile| Some((tile, tile.warped.as_ref()?))) else {
            return (0.0, false);
        };
        let at = corners.map(|q| (DVec2::from(points[q as usize].uv) - tile.origin) * tile.cells);
        let added =
            corners.map(|q| (DVec2::from(uvs[q as usize]) - DVec2::from(points[q as usize].uv)) * tile.cells);
        let is_short = (0..3).all(|k| at[k].distance(at[(k + 1) % 3]) < SHORT);
        (warped.error(at, added), is_short)
    }
}

/// An error that is not known yet.
const UNKNOWN: f64 = f64::NAN;

/// Splits pieces until no error is above the tolerance, or there would be more than `most` pieces. The largest errors
/// come first, so that the limit affects only the smallest. Returns the largest error left, in UV, and whether it is
/// within the tolerance; `uvs` receives the redirected UVs.
pub fn split(
    team: &Team,
    splitter: &mut Splitter,
    results: &Redirections,
    tolerance: f64,
    most: usize,
    uvs: &mut Vec<[f64; 2]>,
) -> (f64, bool) {
    let mut errors = vec![UNKNOWN; splitter.pieces.list.len()];
    loop {
        measure(team, splitter, results, uvs, &mut errors);
        // Pieces that cannot be split are skipped here; their errors are reported at the end.
        let helpless = |k: usize| errors[k].is_sign_negative();
        let largest = |all: bool| {
            (0..errors.len()).filter(|&k| all || !helpless(k)).fold(0.0, |m: f64, k| m.max(errors[k].abs()))
        };
        let worst = largest(false);
        if worst <= tolerance {
            return (largest(true), largest(true) <= tolerance);
        }
        let threshold = tolerance.max(0.5 * worst);
        let mut wanted: Vec<u32> = (0..errors.len() as u32)
            .filter(|&k| !helpless(k as usize) && errors[k as usize] > threshold)
            .collect();
        let marked = |wanted: &[u32]| {
            splitter.marked(wanted.iter().map(|&k| (k, errors[k as usize] > FOURFOLD * tolerance)))
        };
        let (mut marks, mut count) = marked(&wanted);
        let mut last = false;
        if count > most {
            last = true;
            wanted
                .sort_unstable_by(|&a, &b| errors[b as usize].total_cmp(&errors[a as usize]).then(a.cmp(&b)));
            // As many of the worst as fit.
            let (mut fits, mut fails) = (0, wanted.len());
            while fails - fits > 1 {
                let half = usize::midpoint(fits, fails);
                if marked(&wanted[..half]).1 <= most { fits = half } else { fails = half }
            }
            (marks, count) = marked(&wanted[..fits]);
            if fits == 0 || count > most {
                return (largest(true), false);
            }
        }
        assert!(count > errors.len());
        splitter.split(&marks, &mut errors, UNKNOWN);
        if last {
            measure(team, splitter, results, uvs, &mut errors);
            let error = errors.iter().fold(0.0, |m: f64, e| m.max(e.abs()));
            return (error, error <= tolerance);
        }
    }
}

/// Computes the unknown errors. The error of a piece that cannot be split is negated.
fn measure(
    team: &Team,
    splitter: &Splitter,
    results: &Redirections,
    uvs: &mut Vec<[f64; 2]>,
    errors: &mut [f64],
) {
    let pieces = &splitter.pieces;
    let known = uvs.len();
    uvs.resize(pieces.uv_points.len(), [0.0; 2]);
    results.redirect(team, &pieces.uv_points[known..], &mut uvs[known..]);
    let uvs = &*uvs;
    let mut unknown: Vec<(&Piece, &mut f64)> = Vec::with_capacity(errors.len());
    unknown.extend(pieces.list.iter().zip(errors).filter(|(_, error)| error.is_nan()));
    let mut chunks: Vec<_> = unknown.chunks_mut(CHUNK).collect();
    team.fill(&mut chunks, |_, chunk| {
        for (piece, error) in chunk.iter_mut() {
            let corners = piece.corners.map(|corner| corner.uv_point);
            let (found, is_short) = results.error(corners, &pieces.uv_points, uvs);
            let helpless = is_short || !splitter.can_split(piece);
            **error = if helpless { -found } else { found };
        }
    });
}

/// The faces that stay polygons: none of their triangles is split, and no other triangulation of them has an error
/// above the tolerance.
pub fn whole(
    team: &Team,
    mesh: &Mesh,
    base: &Base,
    pieces: &Pieces,
    results: &Redirections,
    tolerance: f64,
    uvs: &[[f64; 2]],
) -> Vec<bool> {
    let points = &pieces.uv_points;
    let mut parts: Vec<u32> = zeroed(pieces.whole.len());
    pieces.list.iter().for_each(|piece| parts[base.triangles[piece.base as usize].face as usize] += 1);
    let stays = |f: usize| {
        let face = mesh.face(f);
        if parts[f] as usize != face.len().saturating_sub(2) {
            return false;
        }
        let point = |k: usize| base.uv_point[face.start + k];
        match face.len() {
            0..=3 => true,
            4 => [[0, 1, 2], [0, 2, 3], [0, 1, 3], [1, 2, 3]]
                .into_iter()
                .all(|triangle| results.error(triangle.map(point), points, uvs).0 <= tolerance),
            // Its triangles are within the tolerance. If no corner moves, so is every other triangulation.
            n => (0..n).map(point).all(|q| uvs[q as usize] == points[q as usize].uv),
        }
    };
    let mut whole = pieces.whole.clone();
    let mut chunks: Vec<_> = whole.chunks_mut(CHUNK).collect();
    team.fill(&mut chunks, |c, chunk| {
        for (k, whole) in chunk.iter_mut().enumerate() {
            *whole = *whole && stays(c * CHUNK + k);
        }
    });
    whole
}
