//! Builds a mesh from a host's arrays: the tiles of its UV sets, welded according to its settings.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::charts::{self, Seams, is_seam};
use super::gaps::Given;
use super::layers::layers;
use super::read::{self, UvSet};
use super::source::{MeshSource, UV_TOLERANCE, Weld, WeldBy};
use super::weld::{Corners, places, rooms};
use super::{Mesh, NONE, RawTriangle, TileMesh, check};
use crate::allocation::{Vec, vec, zeroed};
use crate::error::Result;
use crate::report::AssetInfo;

impl Mesh {
    /// # Errors
    /// `InvalidArgument` naming the array and the index of its first invalid element.
    pub fn new(source: &MeshSource) -> Result<Mesh> {
        check::check(source)?;
        let rest: Vec<[f64; 3]> = (0..source.positions.len()).map(|i| source.positions.get3(i)).collect();
        let mut info = AssetInfo {
            vertices: rest.len() as u64,
            corners: source.indices.len() as u64,
            uv_sets: 1 + source.uv_sets.len() as u32,
            ..AssetInfo::default()
        };
        let welding = Welding::new(source, &rest);
        let seams = read::seams(source, &mut info);
        let (mut corners, mut tiles, mut corners_of) = (Vec::new(), Vec::new(), Vec::new());
        for (uv_set, uvs) in (0..).zip(std::iter::once(&source.uvs).chain(source.uv_sets)) {
            let given = check::corner_uv(uvs);
            let mut set = welding.read(source, &given, uv_set, &mut info);
            welding.build(&mut set, &given, &seams, uv_set, &mut tiles);
            if info.uv_sets > 1 {
                let of = |raw: &Vec<RawTriangle>| raw.iter().map(|triangle| triangle.corners).collect();
                corners_of.extend(set.tiles.iter().map(|(_, raw)| of(raw)));
            }
            corners.push(set.corners);
        }
        info.tiles = tiles.len() as u32;
        info.charts = tiles.iter().map(|tile| tile.charts.len() as u32).sum();
        info.triangles = tiles.iter().map(|tile| tile.triangles.len() as u64).sum();
        info.border_edges = tiles.iter().map(TileMesh::border_edges).sum();
        info.welded_edges = tiles.iter().map(|tile| tile.welds.len() as u64).sum();
        info.edges_apart = tiles.iter().map(|tile| tile.edges_apart).sum();
        let torn = 10.0 * welding.tolerance;
        let place = welding.place;
        let tiles = tiles.into_iter().map(Arc::new).collect();
        let indices = Vec::from(source.indices);
        let mut faces = Vec::with_capacity(info.faces as usize + 1);
        faces.push(0);
        faces.extend(check::faces(source).map(|face| face.end as u32));
        Ok(Mesh { rest, indices, faces, place, corners, tiles, corners_of, torn, info })
    }
}

/// Rules by which a mesh is welded.
pub(super) struct Welding<'a> {
    weld: Weld,
    rest: &'a [[f64; 3]],
    /// Largest distance of welded vertices, in the mesh's unit.
    pub tolerance: f64,
    /// Each vertex's shortest edge of non-zero length.
    shortest: Vec<f64>,
    /// Per vertex, the first vertex at the same place; empty unless vertices are welded by position.
    pub place: Vec<u32>,
    /// `MeshSource::max_layers`.
    max_layers: u32,
}

impl<'a> Welding<'a> {
    pub fn new(source: &MeshSource, rest: &'a [[f64; 3]]) -> Welding<'a> {
        let mut shortest = vec![f64::INFINITY; rest.len()];
        for [a, b] in read::edges(source) {
            let length = DVec3::from(rest[a as usize]).distance(rest[b as usize].into());
            if length > 0.0 {
                for v in [a, b] {
                    shortest[v as usize] = shortest[v as usize].min(length);
                }
            }
        }
        let span = |c: usize| {
            let all = || rest.iter().map(|p| p[c]);
            all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let extent = [0, 1, 2].map(span).into_iter().fold(0.0, f64::max);
        let largest = rest.as_flattened().iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        // Far from the origin, a position that a host computes in two ways differs by the rounding of its coordinates.
        let rounding = if source.weld.of_positions() > 0.0 { source.positions.epsilon() } else { 0.0 };
        let tolerance = source.weld.of_positions() * extent + rounding * largest;
        let by_position = source.weld.by == WeldBy::Position;
        let place = if by_position { places(rest, &shortest, tolerance, |_| true) } else { Vec::new() };
        Welding { weld: source.weld, rest, tolerance, shortest, place, max_layers: source.max_layers }
    }

    /// Reads a UV set and welds it: corners that are one UV corner have the mean of their UVs, rounded to f32. What
    /// follows sees nothing of the UVs that the host gave, and so has the bits of a mesh with these means.
    pub fn read(&self, source: &MeshSource, given: &Given, uv_set: u32, info: &mut AssetInfo) -> UvSet {
        /// Means may come within reach of one another, and are welded in turn; but not for ever.
        const ROUNDS: usize = 4;
        let before = *info;
        let mut set = read::read(source, given, uv_set, info);
        for _ in 0..ROUNDS {
            let Some(welded) = self.means(&set) else { break };
            *info = before;
            set = read::read(source, &|corner| given(corner).map(|_| welded[corner]), uv_set, info);
            for (c, corner) in set.corners.iter_mut().enumerate() {
                corner.given = given(c).unwrap_or_default();
            }
        }
        set
    }

    /// The UVs of a set's corners, each UV corner with its mean; `None` if that changes none.
    fn means(&self, set: &UvSet) -> Option<Vec<[f32; 2]>> {
        let (tolerance, place) = (self.weld.of_uvs(), |v: u32| self.place(v));
        let room = rooms(set.tiles.iter().flat_map(|tile| &tile.1), self.rest.len());
        let mut welded: Option<Vec<[f32; 2]>> = None;
        let mut number_of = vec![NONE; if tolerance > 0.0 { set.corners.len() } else { 0 }];
        for (_, raw) in set.tiles.iter().filter(|_| tolerance > 0.0) {
            let mut corners = Corners::new(&place, &room, tolerance);
            // Per UV corner: the sum of its corners' UVs, their number, and the first one.
            let mut sums: Vec<(DVec2, u32, [f32; 2])> = Vec::new();
            let of_raw =
                || raw.iter().flat_map(|triangle| triangle.corners.into_iter().zip(triangle.vertices));
            let uv_of = |corner: u32| set.corners[corner as usize].uv;
            for (triangle, k) in raw.iter().flat_map(|triangle| (0..3).map(move |k| (triangle, k))) {
                let corner = triangle.corners[k];
                if number_of[corner as usize] == NONE {
                    let number = corners.number(triangle.vertices[k], triangle.uv[k]).0;
                    if number as usize == sums.len() {
                        sums.push((DVec2::ZERO, 0, uv_of(corner)));
                    }
                    let sum = &mut sums[number as usize];
                    (sum.0, sum.1) = (sum.0 + DVec2::from(uv_of(corner).map(f64::from)), sum.1 + 1);
                    number_of[corner as usize] = number;
                }
            }
            let mean =
                |&(sum, count, _): &(DVec2, u32, _)| (sum / f64::from(count)).to_array().map(|x| x as f32);
            // The first one of a UV corner is within reach of all others; the mean need not be.
            let mut target: Vec<[f32; 2]> = sums.iter().map(mean).collect();
            for (corner, vertex) in of_raw() {
                let number = number_of[corner as usize] as usize;
                let away = |c: usize| f64::from(target[number][c]) - f64::from(uv_of(corner)[c]);
                if away(0).abs().max(away(1).abs()) > room[vertex as usize] {
                    target[number] = sums[number].2;
                }
            }
            for (corner, _) in of_raw() {
                let uv = target[number_of[corner as usize] as usize];
                if uv != uv_of(corner) {
                    let welded =
                        welded.get_or_insert_with(|| set.corners.iter().map(|corner| corner.uv).collect());
                    welded[corner as usize] = uv;
                }
            }
        }
        welded
    }

    /// The first vertex at the place of a vertex.
    fn place(&self, vertex: u32) -> u32 {
        self.place.get(vertex as usize).copied().unwrap_or(vertex)
    }

    /// Builds the tiles of a UV set and appends them to `tiles`. Sets the tiles and triangles of its corners.
    pub fn build(
        &self,
        set: &mut UvSet,
        given: &Given,
        seams: &Seams,
        uv_set: u32,
        tiles: &mut Vec<TileMesh>,
    ) {
        let first = tiles.len();
        let room = rooms(set.tiles.iter().flat_map(|tile| &tile.1), self.rest.len());
        let place = |v: u32| self.place(v);
        let mut triangles = Vec::new();
        for (udim, mut raw) in std::mem::take(&mut set.tiles) {
            let numbers = number(&mut raw, Corners::new(&place, &room, self.weld.of_uvs()));
            let (tile, open) = charts::build(udim, &raw, &numbers, given, seams);
            let tile = TileMesh { uv_set, ..tile };
            // The sides of a gap keep what the host gave them.
            for (triangle, numbers) in raw.iter().zip(&numbers).filter(|_| !open.is_empty()) {
                for (&corner, number) in triangle.corners.iter().zip(numbers) {
                    if open.binary_search(number).is_ok() {
                        let corner = &mut set.corners[corner as usize];
                        corner.uv = corner.given;
                    }
                }
            }
            let layers =
                if self.max_layers > 1 { layers(&tile, &raw, self.max_layers) } else { zeroed(raw.len()) };
            let count = 1 + layers.iter().max().copied().unwrap_or(0);
            let of_first = tiles.len() as u32;
            let mut sizes: Vec<u32> = zeroed(count as usize);
            for (triangle, &layer) in raw.iter().zip(&layers) {
                for c in triangle.corners {
                    let corner = &mut set.corners[c as usize];
                    (corner.tile, corner.triangle) = (of_first + layer, sizes[layer as usize]);
                }
                sizes[layer as usize] += 1;
            }
            if count == 1 {
                tiles.push(tile);
                triangles.push((udim, raw));
                continue;
            }
            (0..count).for_each(|layer| tiles.push(tile.of_layer(&layers, layer)));
            let mut of_layers: Vec<Vec<RawTriangle>> =
                sizes.iter().map(|&size| Vec::with_capacity(size as usize)).collect();
            raw.into_iter()
                .zip(layers)
                .for_each(|(triangle, layer)| of_layers[layer as usize].push(triangle));
            triangles.extend(of_layers.into_iter().map(|raw| (udim, raw)));
        }
        // Corners without a triangle still have the UDIM numbers of their faces.
        for corner in set.corners.iter_mut().filter(|corner| corner.triangle == NONE) {
            let found = tiles[first..].iter().position(|tile| tile.udim == corner.tile);
            corner.tile = found.map_or(NONE, |k| (first + k) as u32);
        }
        set.tiles = triangles;
        self.count_apart(set, seams, room, &mut tiles[first..]);
    }

    /// Counts the edges that nearly coincide but are not connected, as if all vertices were welded by position, and
    /// UVs within several times the tolerance: noise that is too large to be welded is told.
    fn count_apart(&self, set: &UvSet, seams: &Seams, mut room: Vec<f64>, tiles: &mut [TileMesh]) {
        /// Farthest UVs that count, in tolerances of welding, as far as triangles have room.
        const FARTHER: f64 = 4.0;
        let tolerance = Weld { by: WeldBy::Position, ..self.weld }.of_uvs();
        let farthest = FARTHER * tolerance.max(UV_TOLERANCE);
        // This only counts and moves no UVs, so small triangles need no more room than for the tolerance.
        room.iter_mut().for_each(|room| *room = room.clamp(tolerance, farthest));
        let found = self.place.is_empty().then(|| {
            let mut at_border = zeroed(self.rest.len());
            for (tile, (_, raw)) in tiles.iter().zip(&set.tiles) {
                for (t, k) in tile.borders() {
                    let ends = [1, 2].map(|d| raw[t as usize].vertices[(k as usize + d) % 3]);
                    ends.into_iter().for_each(|v| at_border[v as usize] = true);
                }
            }
            places(self.rest, &self.shortest, self.tolerance, |v| at_border[v])
        });
        let place = found.as_ref().unwrap_or(&self.place);
        let place = |v: u32| place[v as usize];
        for (tile, (_, raw)) in tiles.iter_mut().zip(&set.tiles) {
            tile.edges_apart = edges_apart(tile, raw, seams, &place, &room, farthest);
        }
    }
}

/// Numbers the UV corners of triangles, and gives corners that are joined the same UV, so that no crack remains.
fn number(raw: &mut [RawTriangle], mut corners: Corners) -> Vec<[u32; 3]> {
    let number = |triangle: &mut RawTriangle| {
        [0, 1, 2].map(|k| {
            let (id, uv) = corners.number(triangle.vertices[k], triangle.uv[k]);
            triangle.uv[k] = uv;
            id
        })
    };
    raw.iter_mut().map(number).collect()
}

/// Counts edges that nearly coincide but are not connected: intended cuts; edges that a mesh from a game needs welded
/// by position; and edges whose UVs are too noisy for the size of their triangles.
///
/// Returns the number of pairs of border edges of a tile that have the same places (`place` maps a vertex to its place)
/// and nearly the same UVs, without a third edge there. Edges that the host marked as seams do not count.
fn edges_apart(
    tile: &TileMesh,
    raw: &[RawTriangle],
    seams: &Seams,
    place: &dyn Fn(u32) -> u32,
    room: &[f64],
    tolerance: f64,
) -> u64 {
    let mut corners = Corners::new(place, room, tolerance);
    let mut numbers = vec![[NONE; 3]; raw.len()];
    let mut sides = Vec::new();
    for (t, k) in tile.borders() {
        let triangle = &raw[t as usize];
        let ends = [1, 2].map(|d| (k as usize + d) % 3);
        if !is_seam(seams, ends.map(|c| triangle.vertices[c])) {
            let of_ends = ends.map(|c| corners.number(triangle.vertices[c], triangle.uv[c]).0);
            if of_ends[0] != of_ends[1] {
                (0..2).for_each(|end| numbers[t as usize][ends[end]] = of_ends[end]);
                sides.push((t, k));
            }
        }
    }
    charts::pairs(raw, &numbers, sides.into_iter()).len() as u64
}
