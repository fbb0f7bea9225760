//! Where bound points stand on the tiles of a result: all that does not depend on the pose.

use glam::{DMat3, DQuat, DVec2, DVec3};

use vrtm_core::allocation::Vec;
use vrtm_core::mesh::{Mesh, NONE, inverse};
use vrtm_core::team::Team;
use vrtm_core::view::Strided;

use crate::bind::{Binding, Pieces, Skin};
use crate::features::{FeatureNode, Features};
use crate::frame::{normal, normalised, polar, power_of_two, quaternion};
use crate::nearest::weighed;
use crate::surface::{Place, Posed, Surface};
use crate::tile::{Mean, Tile};

/// A share of a position's coordinates that is rounding: points that close to the surface are on it.
const ROUNDING: f64 = 1e-14;

/// Points that one item of work finds.
const CHUNK: usize = 1024;

/// Motion of points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Fit {
    /// Points of rigid features as one body each, all others with the surface under the warp.
    #[default]
    Feature,
    /// All points with the surface under the warp.
    Surface,
    /// All points with the surface alone, as if nothing were redirected.
    None,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Point {
    /// As those of `Bound`.
    pub tile: u32,
    pub uv: DVec2,
    /// The triangle under the point in the surface of its tile, or its index in `Binding::skins`.
    pub triangle: u32,
    pub mean: Mean,
    /// The rest position, in the frame at rest.
    pub offset: [f32; 3],
    /// The inverse of the symmetric stretch of the tangents at rest: its diagonal, and what is beside it.
    pub inverse: [f32; 3],
    /// The host's frame in the frame at rest.
    pub own: [f32; 4],
    /// Its index among the bodies; `NONE` for a point that moves with the surface alone.
    pub body: u32,
    /// The third axis of the host's frame is turned over.
    pub is_mirrored: bool,
}

/// A point of a rigid body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub rest: DVec3,
    /// The host's frame at rest.
    pub host: [f32; 4],
    /// `NONE` if it belongs to a piece alone.
    pub feature: u32,
    /// Share of its feature's motion in the point's, 0..1.
    pub part: f32,
}

#[derive(Debug)]
pub struct Course {
    /// In the binding's order.
    pub(crate) points: Vec<Point>,
    pub(crate) bodies: Vec<Body>,
    /// Some points are not on the surface itself.
    pub(crate) is_above: bool,
    /// Per tile; `None` where there are no points and no features of theirs.
    pub(crate) surfaces: Vec<Option<Surface>>,
    /// Per tile, the charts whose vertices are needed.
    pub(crate) charts: Vec<Vec<bool>>,
    pub(crate) nodes: Vec<FeatureNode>,
    /// The end of each feature's nodes.
    pub(crate) ends: Vec<u32>,
}

/// The frame that the tangents at a point have, the inverse of their stretch, and the frame's coordinates of a vector.
pub(crate) fn rest_frame(place: &Place) -> (DMat3, [f64; 3]) {
    let [a, b] = place.tangents;
    let axes = polar(normal(a, b), place.tangents).axes;
    // The stretch is symmetric: its inverse, too.
    let (x, y, z) = (axes.x_axis.dot(a), axes.x_axis.dot(b), axes.y_axis.dot(b));
    let det = x * z - y * y;
    let inverse = [z / det, x / det, -y / det];
    let is_whole = inverse.iter().all(|x| x.is_finite() && (*x as f32).is_finite());
    (axes, if is_whole { inverse } else { [1.0, 1.0, 0.0] })
}

/// The tangents of a map from the frame at rest.
pub(crate) fn from_rest([a, b]: [DVec3; 2], [x, z, y]: [f64; 3]) -> [DVec3; 2] {
    [a * x + b * y, a * y + b * z]
}

/// The place of a point of the skin, with the sides of its triangle as tangents.
pub(crate) fn on_skin(skin: &Skin, position: impl Fn(u32) -> [f64; 3]) -> Place {
    let [p, q, r] = skin.vertices.map(|v| DVec3::from(position(v)));
    Place { at: weighed([p, q, r], skin.weights), tangents: [q - p, r - p] }
}

impl Course {
    /// The courses of bound points on the tiles of a result. `frames` are the host's own at rest.
    pub fn new(
        team: &Team,
        mesh: &Mesh,
        tiles: &[Tile],
        binding: &Binding,
        frames: Option<&Strided>,
        pieces: Option<&Pieces>,
        fit: Fit,
    ) -> Course {
        let mut is_used: Vec<bool> = tiles.iter().map(|_| false).collect();
        let on_tiles = || binding.points.iter().filter(|point| point.tile != NONE);
        on_tiles().for_each(|point| is_used[point.tile as usize] = true);
        let set = tiles.iter().zip(&is_used).find(|(_, used)| **used).map(|(tile, _)| tile.mesh.uv_set);
        // Features reach over all tiles of the set.
        let needed = |k: usize| {
            is_used[k]
                || (fit == Fit::Feature && set == Some(tiles[k].mesh.uv_set) && tiles[k].grid.is_some())
        };
        let surfaces: Vec<Option<Surface>> =
            team.map(tiles.len(), |k| needed(k).then(|| Surface::new(tiles[k].surface())));
        let sorted: Vec<Vec<u32>> = tiles.iter().map(|tile| inverse(&tile.mesh.numbers())).collect();
        let rest: Vec<Posed> = tiles
            .iter()
            .zip(&surfaces)
            .map(|(tile, surface)| {
                let Some(surface) = surface else { return Vec::new() };
                let all: Vec<bool> = tile.surface().charts.iter().map(|_| true).collect();
                surface.posed(team, tile.surface(), &all, true, |v| mesh.rest[v as usize])
            })
            .collect();
        let features = (fit == Fit::Feature).then(|| Features::new(team, mesh, tiles, &surfaces));
        let of_point = |n: usize| {
            let k = binding.order[n] as usize;
            let bound = &binding.points[k];
            let (triangle, mean, place) = match tiles.get(bound.tile as usize) {
                None => {
                    let skin = &binding.skins[bound.triangle as usize];
                    let place = on_skin(skin, |v| mesh.rest[v as usize]);
                    (bound.triangle, None, place)
                }
                Some(tile) => {
                    let number = sorted[bound.tile as usize][bound.triangle as usize];
                    let surface = surfaces[bound.tile as usize].as_ref().expect("its tile is used");
                    let spot = surface.walk(number, bound.uv);
                    let place = surface.place(&rest[bound.tile as usize], &spot);
                    (number, Some(tile.mean(surface.chart(number), bound.uv)), place)
                }
            };
            let (axes, inverse) = rest_frame(&place);
            let beside = bound.foot - place.at;
            let is_rounding = beside.abs().max_element() <= ROUNDING * bound.foot.abs().max_element();
            let beside = if is_rounding { DVec3::ZERO } else { beside };
            let offset = axes.transpose() * beside + DVec3::new(0.0, 0.0, bound.height);
            let (host, is_mirrored) = host_frame(frames, k).unwrap_or_default();
            let own = quaternion(&axes).conjugate() * host;
            let found = features.as_ref().filter(|_| bound.tile != NONE);
            let found = found.and_then(|features| features.at(bound.tile, triangle, bound.uv));
            let (feature, part) = found.unwrap_or((NONE, 0.0));
            let point = Point {
                tile: bound.tile,
                uv: bound.uv,
                triangle,
                mean: mean.unwrap_or(Mean::STILL),
                offset: offset.to_array().map(|x| x as f32),
                inverse: inverse.map(|x| x as f32),
                own: own.to_array().map(|x| x as f32),
                body: NONE,
                is_mirrored,
            };
            let host = host.to_array().map(|x| x as f32);
            (point, Body { rest: place.at + axes * offset, host, feature, part })
        };
        let count = binding.points.len();
        let chunks = team.map(count.div_ceil(CHUNK), |chunk| {
            let (mut points, mut bodies) = (Vec::with_capacity(CHUNK), Vec::new());
            for n in chunk * CHUNK..((chunk + 1) * CHUNK).min(count) {
                let (mut point, body) = of_point(n);
                let k = binding.order[n] as usize;
                let has_piece = pieces.is_some_and(|pieces| pieces.of_point[k] != NONE);
                if body.feature != NONE || has_piece {
                    point.body = bodies.len() as u32;
                    bodies.push(body);
                }
                points.push(point);
            }
            (points, bodies)
        });
        let (mut points, mut bodies) = (Vec::with_capacity(count), Vec::new());
        for (of_chunk, its_bodies) in chunks {
            let first = bodies.len() as u32;
            let body = |point: &Point| if point.body == NONE { NONE } else { first + point.body };
            points.extend(of_chunk.into_iter().map(|point| Point { body: body(&point), ..point }));
            bodies.extend(its_bodies);
        }
        let is_above = points.iter().any(|point: &Point| point.offset != [0.0; 3]);
        let (mut nodes, mut ends) = (Vec::new(), Vec::new());
        if let Some(features) = features {
            let mut used: Vec<u32> = bodies.iter().map(|body: &Body| body.feature).collect();
            (nodes, ends) = features.of_use(tiles, &rest, &mut used);
            bodies.iter_mut().zip(&used).for_each(|(body, &feature)| body.feature = feature);
        }
        let charts = (0..tiles.len())
            .map(|k| {
                let Some(surface) = &surfaces[k] else { return Vec::new() };
                let on_tile = points.iter().filter(|point: &&Point| point.tile as usize == k);
                let own = on_tile.map(|point| point.triangle);
                let of_nodes = nodes.iter().filter(|node| node.tile as usize == k).map(|node| node.triangle);
                surface.charts(own.chain(of_nodes))
            })
            .collect();
        Course { points, bodies, is_above, surfaces, charts, nodes, ends }
    }

    /// Bytes of a course of bound points at most, but for collars and nodes of features: with a body for each point.
    pub fn estimate(mesh: &Mesh, uv_set: usize, binding: &Binding, fit: Fit, has_pieces: bool) -> usize {
        let of_set = mesh.tiles.iter().filter(|tile| tile.uv_set as usize == uv_set);
        let surfaces: usize = of_set.map(|tile| Surface::bytes_of(tile)).sum();
        let has_bodies = fit == Fit::Feature || has_pieces;
        let body = if has_bodies { size_of::<Body>() } else { 0 };
        surfaces + binding.points.len() * (size_of::<Point>() + body)
    }

    pub fn features(&self) -> usize {
        self.ends.len()
    }

    pub fn bytes(&self) -> usize {
        let surfaces: usize = self.surfaces.iter().flatten().map(Surface::bytes).sum();
        surfaces
            + size_of_val(&*self.points)
            + size_of_val(&*self.bodies)
            + size_of_val(&*self.nodes)
            + size_of_val(&*self.ends)
    }

    pub(crate) fn nodes_of(&self, feature: usize) -> std::ops::Range<usize> {
        let first = feature.checked_sub(1).map_or(0, |before| self.ends[before]);
        first as usize..self.ends[feature] as usize
    }
}

/// The host's frame of a point, by a quaternion or the rows of a matrix, and true for one that is mirrored: its third
/// axis is that of the rotation turned over. `None` for a quaternion of zeros, and a matrix whose axes lie in a plane.
pub fn host_frame(frames: Option<&Strided>, k: usize) -> Option<(DQuat, bool)> {
    /// The least volume of axes of length 1.
    const FLAT: f64 = 1e-6;
    let Some(frames) = frames else { return Some((DQuat::IDENTITY, false)) };
    let largest = (0..frames.components()).fold(0.0, |most: f64, c| most.max(frames.get(k, c).abs()));
    let get = |c: usize| frames.get(k, c) / power_of_two(largest);
    if frames.components() == 4 {
        return (largest > 0.0).then(|| (normalised([0, 1, 2, 3].map(get)), false));
    }
    let [a, b, c] = [0, 1, 2].map(|c| DVec3::new(get(c), get(3 + c), get(6 + c)));
    let (normal_of, volume) = (normal(a, b), a.cross(b).dot(c));
    let is_whole = volume.abs() > FLAT * a.length() * b.length() * c.length();
    is_whole.then(|| (quaternion(&polar(normal_of, [a, b]).axes), volume < 0.0))
}

/// A UV of a tile among all tiles.
pub(crate) fn absolute(mesh: &Mesh, tile: u32, uv: DVec2) -> DVec2 {
    mesh.tiles.get(tile as usize).map_or(uv, |tile| uv + tile.origin())
}
