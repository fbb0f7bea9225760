//! Which charts have a point of the surface: the one whose triangle it lies on, and those whose collars hold that
//! triangle.

use std::mem::replace;
use std::sync::Arc;

use glam::DVec2;

use vrtm_core::allocation::Vec;
use vrtm_core::mesh::triangle::{barycentrics, point};
use vrtm_core::mesh::{Source, TileMesh};
use vrtm_core::sets::grouped;

/// A point of the surface: a triangle of a chart, by its tile and its number there, and a UV within the tile; or the
/// mirror image of such a point beyond an open border.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub tile: u32,
    pub triangle: u32,
    pub uv: DVec2,
    pub image: bool,
}

/// The triangles of collars at each triangle of the mesh.
#[derive(Debug)]
pub struct Places {
    /// The tiles with collars, or without where charts do not go on.
    pub tiles: Vec<Arc<TileMesh>>,
    /// Per tile, the number of its first triangle among those of all tiles.
    first: Vec<u32>,
    /// Per triangle, the index of its first entry, followed by the number of all entries.
    starts: Vec<u32>,
    /// Tiles and triangles, in that order.
    entries: Vec<(u32, u32)>,
}

/// A point on the side of a triangle may be outside of it by this, in barycentric coordinates.
pub(super) const OUTSIDE: f64 = 1e-6;

/// A point of the surface as a chart has it: on the chart itself, or in its collar; there perhaps its mirror image.
pub(super) struct OnChart {
    pub tile: u32,
    pub triangle: u32,
    pub chart: u32,
    pub is_collar: bool,
    pub image: bool,
    /// The least barycentric coordinate on the triangle.
    pub depth: f64,
    /// In the chart's plane.
    pub uv: DVec2,
}

impl OnChart {
    pub fn sheet(&self) -> (u32, u32, bool, bool) {
        (self.tile, self.chart, self.is_collar, self.image)
    }
}

impl Places {
    pub fn new(tiles: Vec<Arc<TileMesh>>) -> Places {
        let next = |sum: &mut u32, tile: &Arc<TileMesh>| Some(replace(sum, *sum + tile.own() as u32));
        let first: Vec<u32> = tiles.iter().scan(0, next).collect();
        let count: usize = tiles.iter().map(|tile| tile.own()).sum();
        let number = |source: &Source| (first[source.tile as usize] + source.triangle) as usize;
        let collars = tiles
            .iter()
            .zip(0..)
            .flat_map(|(tile, k)| (tile.own() as u32..).map(move |t| (k, t)).zip(&tile.sources));
        let (starts, order) =
            grouped(count, collars.clone().zip(0..).map(|((_, source), n)| (number(source), n)));
        let collars: Vec<(u32, u32)> = collars.map(|(place, _)| place).collect();
        let entries = order.iter().map(|&n| collars[n as usize]).collect();
        Places { tiles, first, starts, entries }
    }

    /// Bytes held besides the tiles.
    pub fn bytes(&self) -> u64 {
        (size_of_val(&*self.starts) + size_of_val(&*self.entries)) as u64
    }

    /// The triangles of collars that are parts of a triangle.
    pub fn of(&self, tile: u32, triangle: u32) -> &[(u32, u32)] {
        let number = (self.first[tile as usize] + triangle) as usize;
        &self.entries[self.starts[number] as usize..self.starts[number + 1] as usize]
    }

    /// The place in a chart of `tile`, the mesh's tile `index`, of a point of the surface, nearest to `at`.
    /// `home` is a triangle that may contain it.
    pub(super) fn in_chart(
        &self,
        tile: &TileMesh,
        index: u32,
        chart: u32,
        home: u32,
        place: Place,
        at: DVec2,
    ) -> Option<DVec2> {
        let seen_by = |t: u32| seen_by(tile, index, t, place).filter(|_| tile.is_image(t) == place.image);
        if let Some((_, uv)) = seen_by(home).filter(|(depth, _)| *depth >= 0.0) {
            return Some(uv);
        }
        let of_chart = &tile.charts[chart as usize];
        let own = (place.tile == index && of_chart.triangles.contains(&(place.triangle as usize)))
            .then_some(place.triangle);
        let collars = self.of(place.tile, place.triangle).iter();
        let collars = collars.filter(|(k, t)| *k == index && of_chart.collar.contains(&(*t as usize)));
        let seen = own.into_iter().chain(collars.map(|(_, t)| *t)).filter_map(seen_by);
        let inside = seen.filter(|(depth, _)| *depth >= -OUTSIDE).map(|(_, uv)| uv);
        inside.min_by(|a, b| a.distance_squared(at).total_cmp(&b.distance_squared(at)))
    }
}

/// The least barycentric coordinate of a place on a triangle of a tile, and the UV there in the plane of the triangle's
/// chart; `None` if the triangle is no part of that triangle of the mesh. A place and its image are not told apart.
pub(super) fn seen_by(tile: &TileMesh, index: u32, t: u32, place: Place) -> Option<(f64, DVec2)> {
    let uv = tile.triangles[t as usize].uv;
    let surface = match tile.source(t as usize) {
        None if index == place.tile && t == place.triangle => uv,
        Some(source) if (source.tile, source.triangle) == (place.tile, place.triangle) => source.uv,
        _ => return None,
    };
    let [s, r] = barycentrics(surface, place.uv);
    Some((s.min(r).min(1.0 - s - r), point(uv, [s, r])))
}

/// The point of the surface at a UV on a triangle of a tile, the mesh's tile `index`.
pub(super) fn on_surface(tile: &TileMesh, index: u32, t: u32, uv: DVec2) -> Place {
    match tile.source(t as usize) {
        None => Place { tile: index, triangle: t, uv, image: false },
        Some(source) => {
            let there = point(source.uv, barycentrics(tile.triangles[t as usize].uv, uv));
            Place { tile: source.tile, triangle: source.triangle, uv: there, image: source.image }
        }
    }
}

/// The charts that have a place: the one on which it lies first, and those with a collar there, once each.
pub fn sheets(places: &Places, place: Place) -> Vec<OnChart> {
    let mut all: Vec<OnChart> = Vec::with_capacity(4);
    for &(k, t) in [(place.tile, place.triangle)].iter().chain(places.of(place.tile, place.triangle)) {
        let other = &places.tiles[k as usize];
        let Some((depth, uv)) = seen_by(other, k, t, place) else { continue };
        let is_collar = other.source(t as usize).is_some();
        let (chart, image) = (other.chart_of_triangle(t), other.is_image(t));
        let on = OnChart { tile: k, triangle: t, chart, is_collar, image, depth, uv };
        match all.iter_mut().find(|known| known.sheet() == on.sheet()) {
            Some(known) if known.depth >= depth => {}
            Some(known) => *known = on,
            None if depth >= -OUTSIDE || !is_collar => all.push(on),
            None => {}
        }
    }
    all
}

/// Part of the collar that is left around a place, 0 (where it ends) to 1 (on the chart itself), by distance.
pub fn depth_of(places: &Places, on: &OnChart) -> f32 {
    in_collar(places, on, |source| source.depth).map_or(1.0, |depth| depth.clamp(0.0, 1.0))
}

/// Cells from an open border within which a chart and its image are blended: the solve holds texture at the border,
/// so that only a rest is left.
const BESIDE_MIRROR: f64 = 2.0;

/// Nearness of a place to the open border beyond which a chart has its image there, 0 to 1 (at the border).
pub fn beside_mirror(places: &Places, on: &OnChart, cells: DVec2) -> f32 {
    in_collar(places, on, |source| source.distance).map_or(1.0, |distance| {
        let distance = f64::from(distance) * cells.min_element();
        (1.0 - distance / BESIDE_MIRROR).clamp(0.0, 1.0) as f32
    })
}

/// A value that the corners of collars have, at a place; `None` on the chart itself.
fn in_collar(places: &Places, on: &OnChart, of_corners: impl Fn(&Source) -> [f32; 3]) -> Option<f32> {
    let tile = &places.tiles[on.tile as usize];
    let [a, b, c] = of_corners(tile.source(on.triangle as usize)?);
    let [s, r] = barycentrics(tile.triangles[on.triangle as usize].uv, on.uv).map(|x| x as f32);
    Some(a + s * (b - a) + r * (c - a))
}
