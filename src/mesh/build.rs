//! Builds a mesh from a host's arrays: the tiles of its UV sets, welded according to its settings.

use std::sync::Arc;

use super::charts::{self, Seams, is_seam};
use super::gaps::Moved;
use super::layers::layers;
use super::read::{self, UvSet};
use super::source::{MeshSource, Weld, WeldBy};
use super::weld::{Corners, places, reaches};
use super::{Mesh, NONE, RawTriangle, TileMesh, check};
use crate::allocation::{Collect, Grow, copied, filled, with_capacity, zeroed};
use crate::error::Result;
use crate::report::AssetInfo;

impl Mesh {
    /// # Errors
    /// `InvalidArgument` naming the array and the index of its first invalid element.
    pub fn new(source: &MeshSource) -> Result<Mesh> {
        check::check(source)?;
        let rest: Vec<[f64; 3]> = (0..source.positions.len()).map(|i| source.positions.get3(i)).collected();
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
            let mut set = read::read(source, uvs, uv_set, &mut info);
            welding.build(&mut set, &seams, uv_set, &mut tiles);
            if info.uv_sets > 1 {
                let of = |raw: &Vec<RawTriangle>| raw.iter().map(|triangle| triangle.corners).collected();
                corners_of.put_all(set.tiles.iter().map(|(_, raw)| of(raw)));
            }
            corners.put(set.corners);
        }
        info.tiles = tiles.len() as u32;
        info.charts = tiles.iter().map(|tile| tile.charts.len() as u32).sum();
        info.triangles = tiles.iter().map(|tile| tile.triangles.len() as u64).sum();
        info.border_edges = tiles.iter().map(TileMesh::border_edges).sum();
        info.welded_edges = tiles.iter().map(|tile| tile.welds.len() as u64).sum();
        info.edges_apart = tiles.iter().map(|tile| tile.edges_apart).sum();
        let torn = 10.0 * welding.tolerance;
        let place = welding.place;
        let tiles = tiles.into_iter().map(Arc::new).collected();
        let indices = copied(source.indices);
        let mut faces = with_capacity(info.faces as usize + 1);
        faces.put(0);
        faces.put_all(check::faces(source).map(|face| face.end as u32));
        Ok(Mesh { rest, indices, faces, place, corners, tiles, corners_of, torn, info })
    }
}

/// How a mesh is welded.
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
        let mut shortest = filled(f64::INFINITY, rest.len());
        for [a, b] in read::edges(source) {
            let [p, q] = [a, b].map(|v| rest[v as usize]);
            let length = [0, 1, 2].map(|c| (p[c] - q[c]).powi(2)).iter().sum::<f64>().sqrt();
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

    /// Builds the tiles of a UV set and appends them to `tiles`. Sets the tiles and triangles of its corners.
    pub fn build(&self, set: &mut UvSet, seams: &Seams, uv_set: u32, tiles: &mut Vec<TileMesh>) {
        let first = tiles.len();
        let tolerance = self.weld.of_uvs();
        let reach = reaches(set.tiles.iter().flat_map(|tile| &tile.1), self.rest.len(), tolerance);
        let place = |v: u32| self.place.get(v as usize).copied().unwrap_or(v);
        let mut triangles = Vec::new();
        for (udim, mut raw) in std::mem::take(&mut set.tiles) {
            let (numbers, moved) = number(&mut raw, Corners::new(&place, &reach, tolerance));
            let tile = TileMesh { udim, uv_set, ..charts::build(&raw, &numbers, &moved, seams) };
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
                tiles.put(tile);
                triangles.put((udim, raw));
                continue;
            }
            (0..count).for_each(|layer| tiles.put(tile.of_layer(&layers, layer)));
            let mut of_layers: Vec<Vec<RawTriangle>> =
                sizes.iter().map(|&size| with_capacity(size as usize)).collected();
            raw.into_iter().zip(layers).for_each(|(triangle, layer)| of_layers[layer as usize].put(triangle));
            triangles.put_all(of_layers.into_iter().map(|raw| (udim, raw)));
        }
        // Corners without a triangle still have the UDIM numbers of their faces.
        for corner in set.corners.iter_mut().filter(|corner| corner.triangle == NONE) {
            let found = tiles[first..].iter().position(|tile| tile.udim == corner.tile);
            corner.tile = found.map_or(NONE, |k| (first + k) as u32);
        }
        set.tiles = triangles;
        self.count_apart(set, seams, &mut tiles[first..]);
    }

    /// Counts the edges that coincide but are not connected, as if all vertices were welded by position.
    fn count_apart(&self, set: &UvSet, seams: &Seams, tiles: &mut [TileMesh]) {
        let tolerance = Weld { by: WeldBy::Position, ..self.weld }.of_uvs();
        // This only counts and moves no UVs, so small triangles need no smaller tolerance.
        let reach = filled(tolerance, self.rest.len());
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
            tile.edges_apart = edges_apart(tile, raw, seams, &place, &reach, tolerance);
        }
    }
}

/// Numbers the UV corners of triangles, and gives corners that are joined the same UV, so that no crack remains. Also returns
/// the triangles whose UVs this changed.
fn number(raw: &mut [RawTriangle], mut corners: Corners) -> (Vec<[u32; 3]>, Moved) {
    let mut moved = Moved::new();
    let number = |(t, triangle): (usize, &mut RawTriangle)| {
        let given = triangle.uv;
        let numbers = [0, 1, 2].map(|k| {
            let (id, uv) = corners.number(triangle.vertices[k], given[k]);
            triangle.uv[k] = uv;
            id
        });
        if triangle.uv != given {
            moved.put((t as u32, given));
        }
        numbers
    };
    let numbers = raw.iter_mut().enumerate().map(number).collected();
    (numbers, moved)
}

/// Counts edges that coincide but are not connected: intended cuts; edges that a mesh from a game needs welded by
/// position; and edges whose UVs are too noisy for the size of their triangles.
///
/// Returns the number of pairs of border edges of a tile that have the same places (`place` maps a vertex to its place)
/// and UVs, without a third edge there. Edges that the host marked as seams do not count.
fn edges_apart(
    tile: &TileMesh,
    raw: &[RawTriangle],
    seams: &Seams,
    place: &dyn Fn(u32) -> u32,
    reach: &[f64],
    tolerance: f64,
) -> u64 {
    let mut corners = Corners::new(place, reach, tolerance);
    let mut numbers = filled([NONE; 3], raw.len());
    let mut sides = Vec::new();
    for (t, k) in tile.borders() {
        let triangle = &raw[t as usize];
        let ends = [1, 2].map(|d| (k as usize + d) % 3);
        if !is_seam(seams, ends.map(|c| triangle.vertices[c])) {
            let of_ends = ends.map(|c| corners.number(triangle.vertices[c], triangle.uv[c]).0);
            if of_ends[0] != of_ends[1] {
                (0..2).for_each(|end| numbers[t as usize][ends[end]] = of_ends[end]);
                sides.put((t, k));
            }
        }
    }
    charts::pairs(raw, &numbers, sides.into_iter()).len() as u64
}
