//! Bound points in a pose.

use glam::{DQuat, DVec2, DVec3};

use vrtm_core::allocation::Vec;
use vrtm_core::mesh::{Mesh, NONE};
use vrtm_core::team::Team;

use crate::bind::{Binding, Pieces};
use crate::course::{Body, Course, Fit, absolute, from_rest, on_skin};
use crate::frame::{Frame, Motion, blended, normal, polar, quaternion, smooth};
use crate::surface::{Place, Posed, Spot, Surface, uv_of};
use crate::tile::Tile;

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
    uv: DVec2,
    /// Derivatives of the warp by u and v.
    derivatives: [DVec2; 2],
}

impl OnSkin {
    fn still(place: Place, uv: DVec2) -> OnSkin {
        OnSkin { place, uv, derivatives: [DVec2::X, DVec2::Y] }
    }

    /// The normal of the surface, which the warp does not turn over.
    #[inline(always)]
    fn normal(&self) -> DVec3 {
        let [a, b] = self.place.tangents;
        normal(a, b)
    }

    /// The frame, from the frame at rest. `inverse` is that of the stretch at rest.
    #[inline(always)]
    fn frame(&self, inverse: [f64; 3]) -> Frame {
        let [a, b] = self.place.tangents;
        let tangents = self.derivatives.map(|d| d.x * a + d.y * b);
        polar(self.normal(), from_rest(tangents, inverse))
    }
}

pub struct Carriage<'a> {
    parts: Parts<'a>,
    tiles: &'a [Tile<'a>],
    position: &'a (dyn Fn(u32) -> [f64; 3] + Sync),
    posed: Vec<Posed>,
    features: Vec<Option<Motion>>,
    of_pieces: Vec<Option<Motion>>,
    /// The largest distance of a node of a rim from the surface.
    pub rim: f64,
}

#[derive(Clone, Copy)]
pub struct Parts<'a> {
    pub mesh: &'a Mesh,
    pub binding: &'a Binding,
    pub course: &'a Course,
    pub pieces: Option<&'a Pieces>,
    pub fit: Fit,
    /// The height up to which points are blended from the surface to their feature's motion.
    pub skirt: f64,
    /// Rotations, stretch or UVs are asked for.
    pub on_surface: bool,
}

impl<'a> Carriage<'a> {
    /// Poses the surface, and finds the motions of features.
    pub fn new(
        team: &Team,
        parts: Parts<'a>,
        tiles: &'a [Tile<'a>],
        position: &'a (dyn Fn(u32) -> [f64; 3] + Sync),
    ) -> Carriage<'a> {
        let Parts { course, pieces, fit, on_surface, .. } = parts;
        let has_frames = on_surface || pieces.is_some() || course.is_above;
        let posed = |k: usize| match &course.surfaces[k] {
            Some(surface) => surface.posed(team, tiles[k].surface(), &course.charts[k], has_frames, position),
            None => Vec::new(),
        };
        let posed = (0..tiles.len()).map(posed).collect();
        let (features, of_pieces) = (Vec::new(), Vec::new());
        let mut carriage = Carriage { parts, tiles, position, posed, features, of_pieces, rim: 0.0 };
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
        let nodes = &self.parts.course.nodes[self.parts.course.nodes_of(feature)];
        let of_node = |k: usize| {
            let node = &nodes[k];
            let tile = &self.tiles[node.tile as usize];
            let to = node.uv + tile.displacement(node.node) / DVec2::from(tile.cells().map(|n| n as f64));
            let spot = self.spot(node.tile, node.triangle, to);
            self.surface(node.tile).at(&self.posed[node.tile as usize], &spot)
        };
        let posed: Vec<DVec3> = (0..nodes.len()).map(of_node).collect();
        let fitted = nodes.iter().zip(&posed).filter(|(node, _)| node.weight > 0.0);
        let motion = Motion::fit(fitted.map(|(node, at)| (node.weight, node.rest, *at)));
        let rim = nodes.iter().zip(&posed).filter(|(node, _)| node.is_rim);
        let apart = |motion: Motion| {
            let apart = rim.map(|(node, at)| motion.part * motion.at(node.rest).distance(*at));
            apart.fold(0.0, f64::max)
        };
        (motion, motion.map_or(0.0, apart))
    }

    /// The motion of a piece, by where its points stand on the surface.
    fn fit_piece(&self, pieces: &Pieces, piece: usize) -> Option<Motion> {
        let first = piece.checked_sub(1).map_or(0, |before| pieces.ends[before]) as usize;
        let points = &pieces.points[first..pieces.ends[piece] as usize];
        let of_point = |&k: &u32| {
            let n = self.parts.binding.place[k as usize] as usize;
            let (skin, point) = (self.skin(n), &self.parts.course.points[n]);
            let offset = DVec3::from(point.offset.map(f64::from));
            let body = &self.parts.course.bodies[point.body as usize];
            let axes = skin.frame(point.inverse.map(f64::from)).axes;
            (1.0, body.rest, skin.place.at + axes * offset)
        };
        let moved: Vec<(f64, DVec3, DVec3)> = points.iter().map(of_point).collect();
        Motion::fit(moved.iter().copied())
    }

    fn surface(&self, tile: u32) -> &'a Surface {
        self.parts.course.surfaces[tile as usize].as_ref().expect("its tile is used")
    }

    /// The spot under a UV of a tile, reached from a triangle.
    #[inline(always)]
    fn spot(&self, tile: u32, triangle: u32, uv: DVec2) -> Spot {
        let spot = self.surface(tile).walk(triangle, uv);
        if spot.is_inside { spot } else { self.spot_by_nodes(tile, triangle, uv).unwrap_or(spot) }
    }

    /// A border between may have stopped a walk: from the nodes around the UV there is none.
    #[cold]
    fn spot_by_nodes(&self, tile: u32, triangle: u32, uv: DVec2) -> Option<Spot> {
        let (of, surface) = (&self.tiles[tile as usize], self.surface(tile));
        let at = uv * DVec2::from(of.cells().map(|n| n as f64));
        let [i, j] = at.floor().to_array().map(|x| x as i64);
        [(0, 0), (1, 0), (0, 1), (1, 1)]
            .into_iter()
            .filter_map(|(di, dj)| of.under(surface.chart(triangle), i + di, j + dj))
            .map(|t| surface.walk(t, uv))
            .find(|near| near.is_inside)
    }

    /// The `n`-th point as the skin carries it.
    #[inline(always)]
    fn skin(&self, n: usize) -> OnSkin {
        let point = &self.parts.course.points[n];
        if point.tile == NONE {
            let place = on_skin(&self.parts.binding.skins[point.triangle as usize], self.position);
            return OnSkin::still(place, point.uv);
        }
        let k = point.tile as usize;
        let warp = point.mean.warp(&self.tiles[k]).filter(|_| self.parts.fit != Fit::None);
        let to = point.uv + warp.map_or(DVec2::ZERO, |(moved, _)| moved);
        let spot = self.spot(point.tile, point.triangle, to);
        let place = self.surface(point.tile).place(&self.posed[k], &spot);
        let Some((_, derivatives)) = warp else {
            return OnSkin::still(place, absolute(self.parts.mesh, point.tile, point.uv));
        };
        let origin = |tile: u32| self.parts.mesh.tiles[tile as usize].origin();
        OnSkin { place, uv: uv_of(self.tiles[k].surface(), &spot, to, origin), derivatives }
    }

    /// The position of the `n`-th point as the skin carries it, for a point at this height and not beside its foot.
    #[inline(always)]
    fn above_skin(&self, n: usize, height: f64) -> DVec3 {
        let point = &self.parts.course.points[n];
        if point.tile == NONE || height != 0.0 {
            let skin = self.skin(n);
            return skin.place.at + skin.normal() * height;
        }
        let k = point.tile as usize;
        let moved = point.mean.moved(&self.tiles[k]).filter(|_| self.parts.fit != Fit::None);
        let spot = self.spot(point.tile, point.triangle, point.uv + moved.unwrap_or_default());
        self.surface(point.tile).at(&self.posed[k], &spot)
    }

    /// True if the third axis of the `n`-th point's frame is that of its rotation turned over.
    pub fn is_mirrored(&self, n: usize) -> bool {
        self.parts.course.points[n].is_mirrored
    }

    /// The number of the `n`-th point in the order of the binding.
    #[inline]
    pub fn number(&self, n: usize) -> Option<usize> {
        self.parts.binding.order.get(n).map(|&k| k as usize)
    }

    /// The `n`-th point in the pose, in the order of the binding. Without `on_surface`, stretch and UV of a
    /// point that moves with its body alone are left out; without `rotates`, rotations.
    #[inline(always)]
    pub fn carry(&self, n: usize, rotates: bool, on_surface: bool) -> Carried {
        let point = &self.parts.course.points[n];
        let offset = DVec3::from(point.offset.map(f64::from));
        let body = self.body(n, offset.z);
        let turned = |motion: &Motion, body: &Body| match rotates {
            true => motion.rotation * DQuat::from_array(body.host.map(f64::from)),
            false => DQuat::IDENTITY,
        };
        if let Some((motion, body, 1.0)) = body.filter(|_| !on_surface) {
            let (position, rotation) = (motion.at(body.rest), turned(motion, body));
            return Carried { position, rotation, stretch: [0.0; 2], uv: DVec2::ZERO };
        }
        let (mut uv, mut stretch, mut rotation) = (DVec2::ZERO, [0.0; 2], DQuat::IDENTITY);
        // Of a position, most points need the normal at most.
        let is_above = offset.x == 0.0 && offset.y == 0.0;
        let position = if is_above && !rotates && !on_surface {
            self.above_skin(n, offset.z)
        } else {
            let skin = self.skin(n);
            let frame = skin.frame(point.inverse.map(f64::from));
            if rotates {
                let own = DQuat::from_array(point.own.map(f64::from));
                rotation = quaternion(&frame.axes) * own;
            }
            (uv, stretch) = (skin.uv, frame.stretch);
            skin.place.at + frame.axes * offset
        };
        let Some((motion, body, part)) = body else {
            return Carried { position, rotation, stretch, uv };
        };
        let (at, turned) = (motion.at(body.rest), turned(motion, body));
        let (position, rotation) = match part {
            1.0 => (at, turned),
            _ if rotates => (position + part * (at - position), blended(rotation, turned, part)),
            _ => (position + part * (at - position), rotation),
        };
        Carried { position, rotation, stretch, uv }
    }

    /// The motion of a point's body, the point as a part of it, and how far the point moves with it.
    #[inline(always)]
    fn body(&self, n: usize, height: f64) -> Option<(&Motion, &Body, f64)> {
        let body = self.parts.course.bodies.get(self.parts.course.points[n].body as usize)?;
        let number = |pieces: &Pieces| pieces.of_point[self.parts.binding.order[n] as usize];
        let piece =
            self.parts.pieces.and_then(|pieces| self.of_pieces.get(number(pieces) as usize)?.as_ref());
        let feature = || Some((self.features.get(body.feature as usize)?.as_ref()?, f64::from(body.part)));
        let (motion, part) = piece.map(|motion| (motion, 1.0)).or_else(feature)?;
        let part = part * motion.part;
        let part = if self.parts.skirt > 0.0 { part * smooth(height / self.parts.skirt) } else { part };
        Some((motion, body, part))
    }
}
