//! The triangles of a UV set on the surface: which of them lie beyond the borders of charts.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DVec2, DVec3};

use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::triangle::doubled_area;
use vrtm_core::mesh::{Mesh, Mirror, NONE, Source, TileMesh, Triangle};
use vrtm_core::settings::Beyond;

/// Most triangles of the mesh in a region.
const MOST_OF_MESH: usize = 1 << 18;

/// Mirrors that meet at an angle that is farther from half a turn end there: 50 degrees.
const CORNER: f64 = 50.0 / 180.0 * PI;

/// A side of a triangle: the triangle's number in the UV set, and the corner opposite to the side.
pub(super) type Side = (u32, u8);

/// The triangles of all tiles of a UV set, numbered tile by tile. The number of a triangle's mirror image, with which
/// the surface goes on beyond open borders, is greater by the number of all triangles. Surface and image together have
/// no border: this is the *double* of the surface.
pub struct Surface<'a> {
    mesh: &'a Mesh,
    /// The tiles of the UV set, and the first one's index in the mesh.
    tiles: &'a [Arc<TileMesh>],
    first_tile: u32,
    /// Per tile, the number of its first triangle.
    first: Vec<u32>,
    /// The chart of each triangle, numbered over all tiles, and per tile the number of its first chart.
    chart_of: Vec<u32>,
    first_chart: Vec<u32>,
    /// The tile whose charts get collars, as an index in `tiles`.
    home: usize,
    /// The side beyond each side that is a border of its chart, where exactly these two sides form an edge of the
    /// surface; the side itself at an open border that is a mirror.
    beyond: Table<Side, Side>,
    /// Places at which mirrors meet at an angle: images end there.
    corners: Table<u32, ()>,
}

/// The triangles beyond a chart's border, out to some distance.
pub(super) struct Region {
    /// Their numbers, ascending.
    pub triangles: Vec<u32>,
    /// The sides at the chart's border.
    pub rims: Vec<(Side, Rim)>,
}

/// A side of a triangle at the border of the chart.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rim {
    /// The chart's own UVs at the corners that follow the corner opposite to the side.
    pub uv: [DVec2; 2],
    /// The chart's own side there: its triangle, by its number in the tile.
    pub own: Side,
    /// Change of the chart's UVs per length on the surface, at right angles to the side and away from the
    /// chart.
    pub across: DVec2,
}

/// The side beyond a seam.
pub struct Twin {
    /// Its tile, an index in `Mesh::tiles`.
    pub tile: u32,
    /// Its triangle's number in that tile, and the corner opposite to it.
    pub side: Side,
    /// True if it begins where the side on this side of the seam ends.
    pub turns: bool,
}

impl<'a> Surface<'a> {
    pub fn new(mesh: &'a Mesh, tile: usize, beyond: &Beyond) -> Surface<'a> {
        let set = mesh.tiles[tile].uv_set;
        let first_tile = mesh.tiles.partition_point(|t| t.uv_set < set);
        let tiles = &mesh.tiles[first_tile..mesh.tiles.partition_point(|t| t.uv_set <= set)];
        let (mut first, mut first_chart) = (Vec::with_capacity(tiles.len()), Vec::with_capacity(tiles.len()));
        let (mut triangles, mut charts) = (0, 0);
        let mut chart_of = Vec::new();
        for tile in tiles {
            first.push(triangles);
            first_chart.push(charts);
            chart_of.extend(tile.chart_of_triangles().into_iter().map(|c| charts + c));
            triangles += tile.triangles.len() as u32;
            charts += tile.charts.len() as u32;
        }
        let mut surface = Surface {
            mesh,
            tiles,
            first_tile: first_tile as u32,
            first,
            chart_of,
            first_chart,
            home: tile - first_tile,
            beyond: Table::default(),
            corners: Table::default(),
        };
        surface.pair_borders(beyond);
        surface
    }

    /// Finds the sides beyond the borders.
    fn pair_borders(&mut self, wanted: &Beyond) {
        let mut at_border: Vec<bool> = zeroed(self.mesh.rest.len());
        let all = 0..self.chart_of.len() as u32;
        for side in all.clone().flat_map(sides) {
            if self.neighbour(side) == NONE {
                self.ends(side).into_iter().for_each(|v| at_border[v as usize] = true);
            }
        }
        // Sides of triangles inside of a chart count as well: three triangles at an edge have no order.
        let mut edges: Vec<([u32; 2], Side)> = Vec::new();
        for side in all.flat_map(sides) {
            let [a, b] = self.ends(side);
            if a != b && at_border[a as usize] && at_border[b as usize] {
                edges.push(([a.min(b), a.max(b)], side));
            }
        }
        edges.sort_unstable();
        let mut mirrors: Vec<[u32; 2]> = Vec::new();
        for at_edge in edges.chunk_by(|x, y| x.0 == y.0) {
            match *at_edge {
                [(_, s), (_, t)]
                    if wanted.seams && self.neighbour(s) == NONE && self.neighbour(t) == NONE =>
                {
                    enter(&mut self.beyond, s, t);
                    enter(&mut self.beyond, t, s);
                }
                [(ends, s)] if wanted.open_borders => {
                    enter(&mut self.beyond, s, s);
                    mirrors.push(ends);
                }
                _ => (),
            }
        }
        self.find_corners(&mirrors);
    }

    /// Finds the places at which the mirrors' edges meet at an angle on the surface: one that differs much from half a
    /// turn.
    fn find_corners(&mut self, mirrors: &[[u32; 2]]) {
        let mut angles: Table<u32, f64> = Table::default();
        mirrors.iter().flatten().for_each(|&place| _ = enter(&mut angles, place, 0.0));
        if mirrors.is_empty() {
            return;
        }
        for g in 0..self.chart_of.len() as u32 {
            let (places, points) = (self.places(g), self.corners(g));
            for k in 0..3 {
                if let Some(angle) = angles.get_mut(&places[k]) {
                    let [a, b] = [1, 2].map(|d| points[(k + d) % 3] - points[k]);
                    *angle += a.cross(b).length().atan2(a.dot(b));
                }
            }
        }
        let is_corner = |place: &u32| (angles[place] - PI).abs() > CORNER;
        let corners: Vec<u32> = mirrors.iter().flatten().copied().filter(is_corner).collect();
        corners.into_iter().for_each(|place| _ = enter(&mut self.corners, place, ()));
    }

    /// The number of a triangle, or of the one that it is the image of.
    fn base(&self, g: u32) -> u32 {
        g.checked_sub(self.chart_of.len() as u32).unwrap_or(g)
    }

    pub(super) fn is_image(&self, g: u32) -> bool {
        self.base(g) != g
    }

    /// The image of a side, or the side that it is the image of.
    fn image(&self, (g, k): Side) -> Side {
        let base = self.base(g);
        (if base == g { g + self.chart_of.len() as u32 } else { base }, k)
    }

    /// Place of a triangle, or of the one that it is the image of: its tile, the tile's index, and its number
    /// there.
    fn place(&self, g: u32) -> (&TileMesh, usize, usize) {
        let g = self.base(g);
        let tile = self.first.partition_point(|&first| first <= g) - 1;
        (&self.tiles[tile], tile, (g - self.first[tile]) as usize)
    }

    /// The neighbour in the chart, as a number in its tile, or `NONE`.
    fn neighbour(&self, (g, k): Side) -> u32 {
        let (tile, _, t) = self.place(g);
        tile.triangles[t].neighbours[k as usize]
    }

    /// The places of a triangle's vertices: vertices that are welded by position have one place.
    pub fn places(&self, g: u32) -> [u32; 3] {
        let (tile, index, t) = self.place(g);
        let chart = &tile.charts[(self.chart(g) - self.first_chart[index]) as usize];
        let place = |v: u32| self.mesh.place.get(v as usize).copied().unwrap_or(v);
        tile.triangles[t].local.map(|v| place(chart.vertices[v as usize]))
    }

    fn chart(&self, g: u32) -> u32 {
        self.chart_of[self.base(g) as usize]
    }

    pub fn point(&self, place: u32) -> DVec3 {
        DVec3::from(self.mesh.rest[place as usize])
    }

    fn corners(&self, g: u32) -> [DVec3; 3] {
        self.places(g).map(|v| self.point(v))
    }

    /// A triangle's tile, as an index in `Mesh::tiles`, its UVs within the tile, and its vertices.
    pub fn source(&self, g: u32) -> (Source, [u32; 3]) {
        let (tile, index, t) = self.place(g);
        let chart = &tile.charts[(self.chart(g) - self.first_chart[index]) as usize];
        let Triangle { local, uv, .. } = tile.triangles[t];
        let (tile, triangle, image) = (self.first_tile + index as u32, t as u32, self.is_image(g));
        let source = Source { tile, triangle, image, uv, distance: [0.0; 3], depth: [0.0; 3] };
        (source, local.map(|v| chart.vertices[v as usize]))
    }

    fn ends(&self, (g, k): Side) -> [u32; 2] {
        let places = self.places(g);
        [1, 2].map(|d| places[(k as usize + d) % 3])
    }

    /// The mirror at a side, as an edge of the mesh and the third vertex.
    pub fn mirror(&self, (g, k): Side) -> Option<Mirror> {
        let side = (self.base(g), k);
        let (_, [a, b, c]) = self.source(g);
        let [inner, from, to] = [[a, b, c], [b, c, a], [c, a, b]][k as usize];
        (self.beyond.get(&side) == Some(&side)).then_some(Mirror { edge: [from, to], inner })
    }

    /// The side that a side of the tile is joined to at a seam; `None` at other borders.
    pub fn twin(&self, (t, k): Side) -> Option<Twin> {
        let own = (self.first[self.home] + t, k);
        let other = self.beyond.get(&own).copied().filter(|other| *other != own)?;
        let (_, index, number) = self.place(other.0);
        let turns = self.ends(other)[0] != self.ends(own)[0];
        Some(Twin { tile: self.first_tile + index as u32, side: (number as u32, other.1), turns })
    }

    /// The side of another triangle at the same edge of the surface, or of its double.
    fn across(&self, side: Side) -> Option<Side> {
        let is_image = self.is_image(side.0);
        let base = (self.base(side.0), side.1);
        let ends_here = || self.ends(side).iter().any(|place| self.corners.contains_key(place));
        let other = self.across_own(base)?;
        match (other == base, is_image) {
            (true, _) => Some(self.image(side)),
            (false, true) => (!ends_here()).then(|| self.image(other)),
            (false, false) => Some(other),
        }
    }

    /// The side of another triangle at the same edge of the surface, or the side itself at a mirror.
    fn across_own(&self, side: Side) -> Option<Side> {
        let neighbour = self.neighbour(side);
        if neighbour == NONE {
            return self.beyond.get(&side).copied();
        }
        let (tile, index, t) = self.place(side.0);
        let back = tile.triangles[neighbour as usize].neighbours;
        let mut ends = self.ends(side);
        ends.sort_unstable();
        let other = self.first[index] + neighbour;
        let same = |&k: &u8| {
            let mut of_other = self.ends((other, k));
            of_other.sort_unstable();
            back[k as usize] == t as u32 && of_other == ends
        };
        (0..3u8).find(same).map(|k| (other, k))
    }

    /// Length in the UV plane over length on the surface, in the mean over a chart of the tile; and the chart's mean
    /// width on the surface: that of a strip of its area and border.
    pub fn size(&self, chart: usize) -> [f64; 2] {
        let tile = &self.tiles[self.home];
        let (mut plane, mut surface, mut border) = (0.0, 0.0, 0.0);
        for t in tile.charts[chart].triangles.clone() {
            plane += doubled_area(tile.triangles[t].uv).abs();
            let own = self.first[self.home] + t as u32;
            let corners = self.corners(own);
            let [a, b, c] = corners;
            surface += (b - a).cross(c - a).length();
            for k in (0..3).filter(|&k| self.neighbour((own, k as u8)) == NONE) {
                border += corners[(k + 1) % 3].distance(corners[(k + 2) % 3]);
            }
        }
        // A closed surface has none, and no collar.
        [(plane / surface).sqrt(), surface / border]
    }

    /// The triangles beyond the border of a chart of the tile with a vertex that is nearer than `reach` along the
    /// mesh's edges.
    pub(super) fn region(&self, chart: usize, reach: f64, check: &dyn Fn()) -> Region {
        let tile = &self.tiles[self.home];
        let number = self.first_chart[self.home] + chart as u32;
        let mut rims = Vec::new();
        // Sides across which triangles are reached, with the distances of both ends.
        let mut open: Vec<(Side, [f64; 2])> = Vec::new();
        for t in tile.charts[chart].triangles.clone() {
            let own = self.first[self.home] + t as u32;
            for k in 0..3u8 {
                if self.neighbour((own, k)) != NONE {
                    continue;
                }
                let Some(side) = self.across((own, k)) else { continue };
                if self.is_flat(own) || self.is_flat(side.0) {
                    continue;
                }
                let mut uv = [1, 2, 0].map(|d| tile.triangles[t].uv[(k as usize + d) % 3]);
                let points = self.corners(own);
                let mut at = [1, 2, 0].map(|d| points[(k as usize + d) % 3]);
                if self.ends(side)[0] != self.ends((own, k))[0] {
                    uv.swap(0, 1);
                    at.swap(0, 1);
                }
                let along = (at[1] - at[0]).normalize_or(DVec3::X);
                let inward = at[2] - at[0];
                let foot = uv[0].lerp(uv[1], inward.dot(along) / at[0].distance(at[1]));
                let across = (foot - uv[2]) / inward.cross(along).length();
                rims.push((side, Rim { uv: [uv[0], uv[1]], own: (t as u32, k), across }));
                open.push((side, [0.0; 2]));
            }
        }
        // The least distance at which each triangle was reached.
        let mut nearest: Table<u32, f64> = Table::default();
        let mut triangles = Vec::new();
        while !open.is_empty() {
            check();
            let mut round = std::mem::take(&mut open);
            let distance = |[a, b]: [f64; 2]| a.min(b);
            round.sort_unstable_by(|a, b| distance(a.1).total_cmp(&distance(b.1)).then(a.0.cmp(&b.0)));
            for (entry, ends) in round {
                let distance = distance(ends);
                let known = nearest.get(&entry.0).copied();
                if known.is_some_and(|known| known <= distance) {
                    continue;
                }
                if known.is_none() && triangles.len() == MOST_OF_MESH {
                    continue;
                }
                enter(&mut nearest, entry.0, distance);
                if known.is_none() {
                    triangles.push(entry.0);
                }
                let of_corners = self.of_corners(entry, ends);
                for side in sides(entry.0).filter(|&side| side != entry) {
                    let mut ends = [1, 2].map(|d| of_corners[(side.1 as usize + d) % 3]);
                    // The border of the chart itself is where collars begin, not where they go on.
                    let next = self.across(side).filter(|next| {
                        let is_rim = self.neighbour(side) == NONE && self.chart(next.0) == number;
                        ends[0].min(ends[1]) < reach && !is_rim && !self.is_flat(next.0)
                    });
                    if next.is_some_and(|next| self.ends(next)[0] != self.ends(side)[0]) {
                        ends.swap(0, 1);
                    }
                    open.extend(next.map(|next| (next, ends)));
                }
            }
        }
        triangles.sort_unstable();
        rims.sort_unstable_by_key(|(side, _)| *side);
        Region { triangles, rims }
    }

    /// The distances of a triangle's corners, from those of the ends of one of its sides.
    fn of_corners(&self, (g, k): Side, [a, b]: [f64; 2]) -> [f64; 3] {
        let (k, points) = (k as usize, self.corners(g));
        let [next, last] = [1, 2].map(|d| (k + d) % 3);
        let mut of_corners = [0.0; 3];
        (of_corners[next], of_corners[last]) = (a, b);
        of_corners[k] = (a + points[next].distance(points[k])).min(b + points[last].distance(points[k]));
        of_corners
    }

    /// True for a triangle whose shape on the surface is not that of a triangle.
    fn is_flat(&self, g: u32) -> bool {
        let [a, b, c] = self.corners(g);
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        (b - a).cross(c - a).length() <= 1e-6 * longest
    }

    /// The numbers of the triangles beyond the sides of a triangle, or `NONE`.
    pub fn neighbours(&self, g: u32) -> [u32; 3] {
        [0, 1, 2].map(|k| self.across((g, k)).map_or(NONE, |side| side.0))
    }

    /// The mean length of the sides of some triangles.
    pub fn mean_side(&self, triangles: &[u32]) -> f64 {
        let of = |[a, b, c]: [DVec3; 3]| (a.distance(b) + b.distance(c) + c.distance(a)) / 3.0;
        triangles.iter().map(|&g| of(self.corners(g))).sum::<f64>() / triangles.len().max(1) as f64
    }
}

pub(super) fn sides(g: u32) -> impl Iterator<Item = Side> {
    (0..3).map(move |k| (g, k))
}
