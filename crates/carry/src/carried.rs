//! Bound points in a pose.

use glam::{DMat3, DQuat, DVec2, DVec3};

use vrtm_core::allocation::Vec;
use vrtm_core::mesh::{Mesh, NONE};
use vrtm_core::team::Team;

use crate::bind::{Binding, Pieces};
use crate::course::{Course, Fit, absolute, from_rest, on_skin};
use crate::features::smooth;
use crate::frame::{Frame, Motion, blended, polar, product, quaternion};
use crate::surface::{Place, Posed, uv_of};
use crate::tile::Tile;

/// A carried point in the pose.
#[derive(Clone, Copy, Debug)]
pub struct Carried {
    pub position: DVec3,
    /// From the host's frame at rest, or from rest.
    pub rotation: DQuat,
    /// Stretch of the surface that is left: the larger singular value first.
    pub stretch: [f64; 2],
    /// Redirected UV of the point, among all tiles.
    pub uv: DVec2,
}

/// A point as the skin carries it.
struct OnSkin {
    place: Place,
    axes: DMat3,
    stretch: [f64; 2],
    uv: DVec2,
}

impl OnSkin {
    /// `inverse` is that of the stretch at rest.
    fn new(place: Place, tangents: [DVec3; 2], inverse: [f64; 3], uv: DVec2) -> OnSkin {
        let [a, b] = from_rest(tangents, inverse);
        let Frame { axes, stretch } = polar(a, b);
        OnSkin { place, axes, stretch, uv }
    }
}

/// Carries points into a pose.
pub struct Carriage<'a> {
    mesh: &'a Mesh,
    tiles: &'a [Tile<'a>],
    binding: &'a Binding,
    course: &'a Course,
    pieces: Option<&'a Pieces>,
    fit: Fit,
    /// The height up to which points are blended from the surface to their feature's motion.
    skirt: f64,
    position: &'a (dyn Fn(u32) -> [f64; 3] + Sync),
    posed: Vec<Posed>,
    features: Vec<Option<Motion>>,
    of_pieces: Vec<Option<Motion>>,
    /// The largest distance of a node of a rim from the surface.
    pub rim: f64,
}

/// The parts of a carrier.
#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub mesh: &'a Mesh,
    pub binding: &'a Binding,
    pub course: &'a Course,
    pub pieces: Option<&'a Pieces>,
    pub fit: Fit,
    pub skirt: f64,
}

impl<'a> Carriage<'a> {
    /// Poses the surface, and finds the motions of features.
    pub fn new(
        team: &Team,
        parts: &Parts<'a>,
        tiles: &'a [Tile<'a>],
        position: &'a (dyn Fn(u32) -> [f64; 3] + Sync),
    ) -> Carriage<'a> {
        let Parts { mesh, binding, course, pieces, fit, skirt } = *parts;
        let posed = |k: usize| match &course.surfaces[k] {
            Some(surface) => surface.posed(team, tiles[k].surface(), &course.charts[k], position),
            None => Vec::new(),
        };
        let posed = (0..tiles.len()).map(posed).collect();
        let (features, of_pieces) = (Vec::new(), Vec::new());
        let mut carriage = Carriage {
            mesh,
            tiles,
            binding,
            course,
            pieces,
            fit,
            skirt,
            position,
            posed,
            features,
            of_pieces,
            rim: 0.0,
        };
        let fits = team.map(course.features(), |feature| carriage.fit_feature(feature));
        carriage.rim = fits.iter().fold(0.0, |most: f64, (_, rim)| most.max(*rim));
        carriage.features = fits.into_iter().map(|(motion, _)| motion).collect();
        let pieces = pieces.filter(|_| fit == Fit::Feature);
        carriage.of_pieces = pieces
            .map_or_else(Vec::new, |pieces| team.map(pieces.ends.len(), |k| carriage.fit_piece(pieces, k)));
        carriage
    }

    /// The motion of a feature, and how far its rim is from the surface then.
    fn fit_feature(&self, feature: usize) -> (Option<Motion>, f64) {
        let nodes = &self.course.nodes[self.course.nodes_of(feature)];
        let of_node = |k: usize| {
            let node = &nodes[k];
            let tile = &self.tiles[node.tile as usize];
            let to = node.uv + tile.displacement(node.node) / DVec2::from(tile.cells().map(|n| n as f64));
            self.on_surface(node.tile, node.triangle, to).0.at
        };
        let posed: Vec<DVec3> = (0..nodes.len()).map(of_node).collect();
        let fitted = nodes.iter().zip(&posed).filter(|(node, _)| node.weight > 0.0);
        let motion = Motion::fit(fitted.map(|(node, at)| (node.weight, node.rest, *at)));
        let rim = nodes.iter().zip(&posed).filter(|(node, _)| node.is_rim);
        let apart = |motion: Motion| {
            rim.fold(0.0, |most: f64, (node, at)| most.max(motion.at(node.rest).distance(*at)))
        };
        (motion, motion.map_or(0.0, apart))
    }

    /// The motion of a piece, by where its points stand on the surface.
    fn fit_piece(&self, pieces: &Pieces, piece: usize) -> Option<Motion> {
        let first = piece.checked_sub(1).map_or(0, |before| pieces.ends[before]) as usize;
        let points = &pieces.points[first..pieces.ends[piece] as usize];
        let of_point = |&k: &u32| {
            let n = self.binding.place[k as usize] as usize;
            let (skin, point) = (self.skin(n), &self.course.points[n]);
            let offset = DVec3::from(point.offset.map(f64::from));
            let body = &self.course.bodies[point.body as usize];
            (1.0, body.rest, skin.place.at + skin.axes * offset)
        };
        let moved: Vec<(f64, DVec3, DVec3)> = points.iter().map(of_point).collect();
        Motion::fit(moved.iter().copied())
    }

    /// The surface under a UV of a tile, reached from a triangle, and the UV there among all tiles.
    fn on_surface(&self, tile: u32, triangle: u32, uv: DVec2) -> (Place, DVec2) {
        let (k, of) = (tile as usize, &self.tiles[tile as usize]);
        let surface = self.course.surfaces[k].as_ref().expect("its tile is used");
        let mut spot = surface.walk(triangle, uv);
        if !spot.is_inside {
            // A border between may have stopped the walk: from the nodes around the UV there is none.
            let at = uv * DVec2::from(of.cells().map(|n| n as f64));
            let [i, j] = at.floor().to_array().map(|x| x as i64);
            for (di, dj) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let near = of.under(surface.chart(triangle), i + di, j + dj).map(|t| surface.walk(t, uv));
                if let Some(near) = near.filter(|near| near.is_inside) {
                    spot = near;
                    break;
                }
            }
        }
        let origin = |tile: u32| self.mesh.tiles[tile as usize].origin();
        (surface.place(&self.posed[k], &spot), uv_of(of.surface(), &spot, uv, origin))
    }

    /// The `n`-th point as the skin carries it.
    fn skin(&self, n: usize) -> OnSkin {
        let point = &self.course.points[n];
        let inverse = point.inverse.map(f64::from);
        if point.tile == NONE {
            let place = on_skin(&self.binding.skins[point.triangle as usize], self.position);
            return OnSkin::new(place, place.tangents, inverse, point.uv);
        }
        let warp = point.mean.warp(&self.tiles[point.tile as usize]).filter(|_| self.fit != Fit::None);
        let Some((moved, [du, dv])) = warp else {
            let place = self.on_surface(point.tile, point.triangle, point.uv).0;
            let uv = absolute(self.mesh, point.tile, point.uv);
            return OnSkin::new(place, place.tangents, inverse, uv);
        };
        let (place, uv) = self.on_surface(point.tile, point.triangle, point.uv + moved);
        let [a, b] = place.tangents;
        OnSkin::new(place, [du.x * a + du.y * b, dv.x * a + dv.y * b], inverse, uv)
    }

    /// The `n`-th point in the pose, in the order of the binding, and its number. Without `on_surface`, stretch and UV of a
    /// point that moves with its body alone are left out; without `rotates`, rotations.
    pub fn carry(&self, n: usize, rotates: bool, on_surface: bool) -> (usize, Carried) {
        (self.binding.order[n] as usize, self.carried(n, rotates, on_surface))
    }

    fn carried(&self, n: usize, rotates: bool, on_surface: bool) -> Carried {
        let point = &self.course.points[n];
        let offset = DVec3::from(point.offset.map(f64::from));
        let body = self.body(n, offset.z);
        if let Some((motion, host, rest, 1.0)) = body.filter(|_| !on_surface) {
            let (position, rotation) = (motion.at(rest), product(motion.rotation, host));
            return Carried { position, rotation, stretch: [0.0; 2], uv: DVec2::ZERO };
        }
        let OnSkin { place, axes, stretch, uv } = self.skin(n);
        let position = place.at + axes * offset;
        let own = |own: [f32; 4]| product(quaternion(&axes), DQuat::from_array(own.map(f64::from)));
        let rotation = if rotates { own(point.own) } else { DQuat::IDENTITY };
        let Some((motion, host, rest, part)) = body else {
            return Carried { position, rotation, stretch, uv };
        };
        let (at, turned) = (motion.at(rest), product(motion.rotation, host));
        let (position, rotation) = match part {
            1.0 => (at, turned),
            _ => (position + part * (at - position), blended(rotation, turned, part)),
        };
        Carried { position, rotation, stretch, uv }
    }

    /// The motion of a point's body, the host's frame and the position at rest, and how far the point moves with it.
    fn body(&self, n: usize, height: f64) -> Option<(Motion, DQuat, DVec3, f64)> {
        let body = self.course.bodies.get(self.course.points[n].body as usize)?;
        let number = |pieces: &Pieces| pieces.of_point[self.binding.order[n] as usize];
        let piece = self.pieces.and_then(|pieces| *self.of_pieces.get(number(pieces) as usize)?);
        let feature =
            || Some((self.features.get(body.feature as usize).copied().flatten()?, f64::from(body.part)));
        let (motion, part) = piece.map(|motion| (motion, 1.0)).or_else(feature)?;
        let part = if self.skirt > 0.0 { part * smooth(height / self.skirt) } else { part };
        Some((motion, DQuat::from_array(body.host.map(f64::from)), body.rest, part))
    }
}
