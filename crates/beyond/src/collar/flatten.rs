//! Lays a region of the surface out in the plane of a chart, from the chart's border outwards.
//!
//! The small triangles are taken in the order of their distance from the border, each across a side of one that was
//! taken before. The chart's own triangle at that place of the border says by which matrix lengths on the surface
//! become lengths in the plane, so that UVs go on across the border as they came to it. Band by band, the corners of a
//! band are then placed so that the triangles differ from that by as little more than a rotation as possible (Liu et
//! al., "A Local/Global Approach to Mesh Parameterization", 2008), with all that was placed before held in its place.
//! Triangles that come out mirrored or of another size are left out, and with them all that was reached across them.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::{DMat2, DVec2, DVec3};

use super::patch::{Patch, PatchTriangle};
use super::surface::{Side, Surface};
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::mesh::triangle::doubled_area;
use vrtm_core::mesh::{FacePoint, Mirror, NONE, Source};
use vrtm_core::sets::root;

/// The collar of a chart has this many bands of equal width, each laid out after the ones nearer to the border: what is
/// far away must not bend what is near.
pub(super) const BANDS: usize = 6;

#[derive(Clone, Copy, Debug)]
pub struct CollarTriangle {
    /// Its corners in the chart's plane, as UVs within the chart's tile.
    pub uv: [DVec2; 3],
    /// The same points of the surface where the mesh has them.
    pub source: Source,
    pub points: [FacePoint; 3],
    /// Their distances from the chart's border, along the surface, as lengths in the chart's plane.
    pub distance: [f64; 3],
    /// Neighbours across the sides opposite to the corners.
    pub across: [Across; 3],
}

/// The neighbour across a side of a collar's triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Across {
    Nothing,
    /// A triangle of the collar, by its place in the list.
    Collar(u32),
    /// The chart itself: a side of a triangle, by its number in the tile. Several triangles of the collar may lie at
    /// it.
    Chart(Side),
}

#[derive(Debug, Default)]
pub struct Collar {
    pub triangles: Vec<CollarTriangle>,
    /// The number of triangles that lie at each side of the chart, if none is missing.
    pub parts: usize,
    /// Largest distance from the chart, in UV of the chart's plane, over 0.
    pub reach: f64,
}

/// Rounds of fitting rotations and placing corners, and the steps of conjugate gradients in each.
const ROUNDS: usize = 6;
const STEPS: usize = 60;
/// A squared residual under this part of the first one ends the steps.
const SMALL: f64 = 1e-20;

/// The areas that triangles may come out with, over those that they should have.
const AREAS: std::ops::RangeInclusive<f64> = 0.25..=4.0;

/// Corners whose places are expected farther apart than this part of the reach are not joined: there the surface comes
/// back to itself around something.
const APART: f64 = 0.25;

/// A triangle that is taken.
struct Piece {
    triangle: u32,
    /// The corner opposite to the side that it was reached across.
    entry: usize,
    /// The piece across whose side it was reached, or `NONE` at the border.
    parent: u32,
    distance: f64,
    /// The mirror, if the triangle is an image.
    mirror: Option<Mirror>,
    /// Its corners in the plane of the first triangle on the way here, if all triangles on the way are turned into that
    /// plane, and the sign of its doubled area there. The side at the border lies on the x axis, the first triangle
    /// above.
    flat: [DVec2; 3],
    sign: f64,
    /// The point (x, y) there is expected at `origin` + `map` (x, y) in the chart's plane.
    origin: DVec2,
    map: DMat2,
}

impl Piece {
    fn expected(&self, k: usize) -> DVec2 {
        self.origin + self.map * self.flat[k]
    }
}

/// Lays a patch out. `reach` is a length on the surface, and `scale` that of the chart.
pub(super) fn flatten(surface: &Surface, patch: &Patch, reach: f64, scale: f64, check: &dyn Fn()) -> Collar {
    let pieces = pieces(surface, patch, reach);
    let corners = Corners::join(patch, &pieces, APART * reach * scale);
    let mirrors = corners.mirrors(&pieces);
    let distances = distances(patch, &pieces, &corners);
    let mut places: Vec<Option<DVec2>> = corners.fixed.clone();
    let mut good: Vec<bool> = zeroed(pieces.len());
    let mut slots = vec![NONE; places.len()];
    let band = |piece: &Piece| (piece.distance / reach * BANDS as f64) as usize;
    let mut start = 0;
    for of_band in pieces.chunk_by(|a, b| band(a) == band(b)) {
        let range = start..start + of_band.len();
        start = range.end;
        // A parent comes before its children, if it lies in the same band, too.
        for p in range.clone() {
            good[p] = pieces[p].parent == NONE || good[pieces[p].parent as usize];
        }
        check();
        let present: Vec<usize> = range.filter(|&p| good[p]).collect();
        place(&pieces, &present, &corners.of, &mut places, &mut slots);
        for &p in &present {
            let piece = &pieces[p];
            let of_parent = piece.parent == NONE || good[piece.parent as usize];
            good[p] = of_parent && is_good(piece, uv_of(&corners.of[p], &places));
        }
    }
    let mut numbers = vec![NONE; patch.triangles.len()];
    let list: Vec<usize> = (0..pieces.len()).filter(|&p| good[p]).collect();
    for (number, &p) in list.iter().enumerate() {
        numbers[pieces[p].triangle as usize] = number as u32;
    }
    let rim_of = patch.rim_of_sides();
    let triangle = |&p: &usize| {
        let triangle = &patch.triangles[pieces[p].triangle as usize];
        let uv = uv_of(&corners.of[p], &places);
        let (source, vertices) = surface.source(triangle.of);
        let at = |[a, b, c]: [f64; 3]| a * source.uv[0] + b * source.uv[1] + c * source.uv[2];
        let across = [0, 1, 2].map(|k| {
            let rim = rim_of[pieces[p].triangle as usize][k];
            if rim != NONE {
                let rim = &patch.rims[rim as usize].1;
                let is_there = [1, 2].map(|d| uv[(k + d) % 3]) == rim.uv;
                return if is_there { Across::Chart(rim.own) } else { Across::Nothing };
            }
            let (other, j) = triangle.across[k];
            let number = if other == NONE { NONE } else { numbers[other as usize] };
            let ends = |p: usize, k: usize| [1, 2].map(|d| corners.of[p][(k + d) % 3]);
            let is_joined = |q: usize| {
                let [a, b] = ends(q, j as usize);
                [[a, b], [b, a]].contains(&ends(p, k))
            };
            if number != NONE && is_joined(list[number as usize]) {
                Across::Collar(number)
            } else {
                Across::Nothing
            }
        });
        CollarTriangle {
            uv,
            source: Source { uv: triangle.weights.map(at), ..source },
            points: [0, 1, 2].map(|k| FacePoint {
                vertices,
                weights: triangle.weights[k],
                mirror: mirrors[corners.of[p][k] as usize],
            }),
            distance: corners.of[p].map(|c| distances[c as usize] * scale),
            across,
        }
    };
    Collar { triangles: list.iter().map(triangle).collect(), parts: patch.parts, reach: reach * scale }
}

fn uv_of(corners: &[u32; 3], places: &[Option<DVec2>]) -> [DVec2; 3] {
    corners.map(|c| places[c as usize].unwrap_or_default())
}

fn is_good(piece: &Piece, uv: [DVec2; 3]) -> bool {
    AREAS.contains(&(doubled_area(uv) / (piece.map.determinant() * doubled_area(piece.flat))))
}

/// The distance of each corner from the border, on the surface.
fn distances(patch: &Patch, pieces: &[Piece], corners: &Corners) -> Vec<f64> {
    let mut distances: Vec<f64> =
        corners.fixed.iter().map(|place| if place.is_some() { 0.0 } else { f64::INFINITY }).collect();
    for (piece, of) in pieces.iter().zip(&corners.of) {
        let at = &patch.triangles[piece.triangle as usize].corners;
        let known = of.map(|c| distances[c as usize]);
        for k in 0..3 {
            let over = |j: usize| known[j] + at[j].distance(at[k]);
            // Along a side, or straight from the side that the piece was reached across.
            let along = over((k + 1) % 3).min(over((k + 2) % 3));
            let across = piece.distance + height(at, k);
            let way = if k == piece.entry { along.min(across) } else { along };
            let least = &mut distances[of[k] as usize];
            *least = least.min(way);
        }
    }
    distances
}

/// The distance of a corner from the opposite side.
fn height(corners: &[DVec3; 3], k: usize) -> f64 {
    let along = side(corners, k);
    (corners[k] - corners[(k + 1) % 3]).cross(along).length() / along.length()
}

/// Takes the triangles of a patch in the order of their distance from the border.
fn pieces(surface: &Surface, patch: &Patch, reach: f64) -> Vec<Piece> {
    let rim_of = patch.rim_of_sides();
    let mut taken: Vec<bool> = zeroed(patch.triangles.len());
    let mut pieces: Vec<Piece> = Vec::new();
    // (distance, triangle, its entry, the piece that it is reached from). Distances are not negative, so that their
    // bits have their order. Each triangle that is taken adds two entries at most: there is room for all.
    let room = Vec::with_capacity(patch.rims.len() + 2 * patch.triangles.len());
    let mut open: BinaryHeap<Reverse<(u64, u32, u8, u32)>> = BinaryHeap::from(room);
    patch.rims.iter().for_each(|((t, k), _)| open.push(Reverse((0, *t, *k, NONE))));
    while let Some(Reverse((distance, t, k, parent))) = open.pop() {
        if std::mem::replace(&mut taken[t as usize], true) {
            continue;
        }
        let triangle = &patch.triangles[t as usize];
        let k = k as usize;
        let (base, sign, origin, map) = if parent == NONE {
            let (_, rim) = &patch.rims[rim_of[t as usize][k] as usize];
            let length = side(&triangle.corners, k).length();
            let map = DMat2::from_cols((rim.uv[1] - rim.uv[0]) / length, rim.across);
            ([DVec2::ZERO, DVec2::new(length, 0.0)], 1.0, rim.uv[0], map)
        } else {
            let from = &pieces[parent as usize];
            let (_, j) = triangle.across[k];
            let [a, b] = [1, 2].map(|d| from.flat[(j as usize + d) % 3]);
            let turns = triangle.turns[k];
            let sign = if turns { from.sign } else { -from.sign };
            (if turns { [b, a] } else { [a, b] }, sign, from.origin, from.map)
        };
        let flat = turned(&triangle.corners, k, base, sign);
        let distance = f64::from_bits(distance);
        let index = pieces.len() as u32;
        let mirror = mirror(surface, patch, t, k, pieces.get(parent as usize));
        pieces.push(Piece { triangle: t, entry: k, parent, distance, mirror, flat, sign, origin, map });
        let middle = |k: usize| 0.5 * (triangle.corners[(k + 1) % 3] + triangle.corners[(k + 2) % 3]);
        for other in [(k + 1) % 3, (k + 2) % 3] {
            let (next, entry) = triangle.across[other];
            let way = distance + middle(k).distance(middle(other));
            if next != NONE && !taken[next as usize] && way < reach {
                open.push(Reverse((way.to_bits(), next, entry, index)));
            }
        }
    }
    pieces
}

/// The mirror of a small triangle that is reached across its side opposite to corner `k`: the one there, or
/// that of the image from which it is reached.
fn mirror(
    surface: &Surface,
    patch: &Patch,
    triangle: u32,
    k: usize,
    parent: Option<&Piece>,
) -> Option<Mirror> {
    let PatchTriangle { of, weights, .. } = &patch.triangles[triangle as usize];
    if !surface.is_image(*of) {
        return None;
    }
    let on_side = |c: &u8| [1, 2].iter().all(|d| weights[(k + d) % 3][*c as usize] == 0.0);
    let here = || surface.mirror((*of, (0..3).find(on_side)?));
    parent.and_then(|parent| parent.mirror).or_else(here)
}

/// The side opposite to a corner.
fn side(corners: &[DVec3; 3], k: usize) -> DVec3 {
    corners[(k + 2) % 3] - corners[(k + 1) % 3]
}

/// Positions of a triangle's corners with its side opposite to corner `k` laid on `base`. `sign` is that of the
/// doubled area of the ends of the base and the corner.
fn turned(corners: &[DVec3; 3], k: usize, base: [DVec2; 2], sign: f64) -> [DVec2; 3] {
    let along = side(corners, k);
    let to_corner = corners[k] - corners[(k + 1) % 3];
    let length = along.length();
    let (x, y) = (to_corner.dot(along) / length, to_corner.cross(along).length() / length);
    let direction = (base[1] - base[0]).normalize_or(DVec2::X);
    let mut placed = [base[0] + x * direction + sign * y * direction.perp(); 3];
    placed[(k + 1) % 3] = base[0];
    placed[(k + 2) % 3] = base[1];
    placed
}

/// The corners of the pieces in the plane: corners of neighbours are joined.
struct Corners {
    /// Per piece.
    of: Vec<[u32; 3]>,
    /// The places of the corners at the chart's border.
    fixed: Vec<Option<DVec2>>,
}

impl Corners {
    fn join(patch: &Patch, pieces: &[Piece], apart: f64) -> Corners {
        let mut sets =
            Sets { parents: (0..3 * pieces.len() as u32).collect(), fixed: vec![None; 3 * pieces.len()] };
        let mut piece_of = vec![NONE; patch.triangles.len()];
        for (p, piece) in pieces.iter().enumerate() {
            piece_of[piece.triangle as usize] = p as u32;
        }
        for (side, rim) in &patch.rims {
            let p = piece_of[side.0 as usize];
            let ends = [1, 2].map(|d| (side.1 as usize + d) % 3);
            let is_near = |end: usize| pieces[p as usize].expected(ends[end]).distance(rim.uv[end]) <= apart;
            if p != NONE && is_near(0) && is_near(1) {
                (0..2).for_each(|end| sets.fix(3 * p + ends[end] as u32, rim.uv[end]));
            }
        }
        // First across the sides over which pieces were reached, then across the others where both ends fit.
        for of_tree in [true, false] {
            for (p, piece) in pieces.iter().enumerate() {
                let triangle = &patch.triangles[piece.triangle as usize];
                for k in 0..3 {
                    let (other, j) = triangle.across[k];
                    let q = if other == NONE { NONE } else { piece_of[other as usize] };
                    if q == NONE || (piece.parent == q) != of_tree {
                        continue;
                    }
                    let here = [1, 2].map(|d| (k + d) % 3);
                    let mut there = [1, 2].map(|d| (j as usize + d) % 3);
                    if triangle.turns[k] {
                        there.swap(0, 1);
                    }
                    let mut fits = |end: usize| {
                        let nodes = [3 * p as u32 + here[end] as u32, 3 * q + there[end] as u32];
                        piece.expected(here[end]).distance(pieces[q as usize].expected(there[end])) <= apart
                            && sets.may_join(nodes)
                    };
                    if of_tree || (fits(0) && fits(1)) {
                        for end in 0..2 {
                            sets.join([3 * p as u32 + here[end] as u32, 3 * q + there[end] as u32]);
                        }
                    }
                }
            }
        }
        sets.numbered(pieces.len())
    }

    /// The mirror of each corner: that of the first piece there. Corners at the chart's border, and of pieces
    /// that are no images, lie on the mirror.
    fn mirrors(&self, pieces: &[Piece]) -> Vec<Option<Mirror>> {
        let mut mirrors = vec![None; self.fixed.len()];
        for (piece, of) in pieces.iter().zip(&self.of).rev() {
            of.iter().for_each(|&c| mirrors[c as usize] = piece.mirror);
        }
        for (piece, of) in pieces.iter().zip(&self.of).filter(|(piece, _)| piece.mirror.is_none()) {
            of.iter().for_each(|&c| mirrors[c as usize] = piece.mirror);
        }
        let at_border = |c: &usize| self.fixed[*c].is_some();
        (0..mirrors.len()).filter(at_border).for_each(|c| mirrors[c] = None);
        mirrors
    }
}

/// Disjoint sets of corners; the corners of some sets have a place.
struct Sets {
    parents: Vec<u32>,
    /// By the root of a set.
    fixed: Vec<Option<DVec2>>,
}

impl Sets {
    fn fix(&mut self, a: u32, place: DVec2) {
        let root = root(&mut self.parents, a);
        self.fixed[root as usize].get_or_insert(place);
    }

    fn may_join(&mut self, nodes: [u32; 2]) -> bool {
        let [a, b] = nodes.map(|n| self.fixed[root(&mut self.parents, n) as usize]);
        a.zip(b).is_none_or(|(a, b)| a == b)
    }

    fn join(&mut self, nodes: [u32; 2]) {
        let [a, b] = nodes.map(|n| root(&mut self.parents, n));
        let (root, other) = (a.min(b), a.max(b));
        self.parents[other as usize] = root;
        if let Some(place) = self.fixed[other as usize] {
            self.fixed[root as usize].get_or_insert(place);
        }
    }

    fn numbered(mut self, pieces: usize) -> Corners {
        let mut numbers = vec![NONE; self.parents.len()];
        let mut fixed = Vec::new();
        let mut number = |n: u32| {
            let root = root(&mut self.parents, n) as usize;
            if numbers[root] == NONE {
                numbers[root] = fixed.len() as u32;
                fixed.push(self.fixed[root]);
            }
            numbers[root]
        };
        let of = (0..pieces as u32).map(|p| [0, 1, 2].map(|k| number(3 * p + k))).collect();
        Corners { of, fixed }
    }
}

/// A piece of the band that is placed.
struct Element {
    corners: [u32; 3],
    /// Gradients of the corners' hat functions on the flat triangle, times the square root of its area.
    gradients: [DVec2; 3],
    /// The matrix that the triangle should be laid out by, times the square root of the area.
    wanted: DMat2,
}

impl Element {
    /// The square root of the area times the matrix of the map from the flat triangle to the plane.
    fn map(&self, uv: impl Fn(u32) -> DVec2) -> DMat2 {
        let terms = [0, 1, 2].map(|k| {
            let (place, gradient) = (uv(self.corners[k]), self.gradients[k]);
            DMat2::from_cols(place * gradient.x, place * gradient.y)
        });
        terms[0] + terms[1] + terms[2]
    }
}

/// Places the corners of some pieces that have no place yet.
fn place(
    pieces: &[Piece],
    present: &[usize],
    corners: &[[u32; 3]],
    places: &mut [Option<DVec2>],
    slots: &mut [u32],
) {
    let mut free: Vec<u32> = Vec::new();
    let mut at: Vec<DVec2> = Vec::new();
    let mut elements: Vec<Element> = Vec::with_capacity(present.len());
    for &p in present {
        let piece = &pieces[p];
        let of = corners[p];
        for k in 0..3 {
            let c = of[k] as usize;
            if places[c].is_none() && slots[c] == NONE {
                // As far from where it is expected as the other corners are, which have a place or a guess: the piece
                // was reached across the side between them.
                let off = [1, 2].map(|d| {
                    let c = of[(k + d) % 3] as usize;
                    let guess = (slots[c] != NONE).then(|| at[slots[c] as usize]);
                    places[c].or(guess).map_or(DVec2::ZERO, |at| at - piece.expected((k + d) % 3))
                });
                slots[c] = free.len() as u32;
                free.push(c as u32);
                at.push(piece.expected(k) + 0.5 * (off[0] + off[1]));
            }
        }
        let flat = piece.flat;
        let doubled = doubled_area(flat);
        let root = (0.5 * doubled.abs()).sqrt();
        let gradient = |k: usize| root / doubled * (flat[(k + 2) % 3] - flat[(k + 1) % 3]).perp();
        let gradients = [0, 1, 2].map(gradient);
        elements.push(Element { corners: of, gradients, wanted: root * piece.map });
    }
    if !free.is_empty() {
        solve(&elements, places, slots, &mut at);
    }
    for (c, at) in free.into_iter().zip(at) {
        places[c as usize] = Some(at);
        slots[c as usize] = NONE;
    }
}

/// Moves the points `at` so that the maps of the elements come as near as possible to the wanted maps, each turned by
/// the rotation that fits best, in the sum of squares. Rotations and places are found in turn, places by conjugate
/// gradients.
fn solve(elements: &[Element], places: &[Option<DVec2>], slots: &[u32], at: &mut [DVec2]) {
    let n = at.len();
    let [mut residual, mut direction, mut product]: [Vec<DVec2>; 3] =
        std::array::from_fn(|_| vec![DVec2::ZERO; n]);
    let mut diagonal = vec![0.0; n];
    for element in elements {
        for k in 0..3 {
            let slot = slots[element.corners[k] as usize];
            if slot != NONE {
                diagonal[slot as usize] += element.gradients[k].length_squared();
            }
        }
    }
    // Sums `f` of each element's map, times the gradients, at the element's corners.
    let gather = |out: &mut [DVec2], value: &dyn Fn(u32) -> DVec2, f: &dyn Fn(&Element, DMat2) -> DMat2| {
        out.fill(DVec2::ZERO);
        for element in elements {
            let map = f(element, element.map(value));
            for k in 0..3 {
                let slot = slots[element.corners[k] as usize];
                if slot != NONE {
                    out[slot as usize] += map * element.gradients[k];
                }
            }
        }
    };
    for _ in 0..ROUNDS {
        let value = |c: u32| places[c as usize].unwrap_or_else(|| at[slots[c as usize] as usize]);
        gather(&mut residual, &value, &|element, map| {
            rotation(map * element.wanted.transpose()) * element.wanted - map
        });
        let preconditioned = |r: &[DVec2], k: usize| r[k] / diagonal[k];
        (0..n).for_each(|k| direction[k] = preconditioned(&residual, k));
        let mut norm: f64 = (0..n).map(|k| residual[k].dot(preconditioned(&residual, k))).sum();
        let enough = SMALL * norm;
        for _ in 0..STEPS {
            if norm <= enough {
                break;
            }
            let moved = |c: u32| match places[c as usize] {
                Some(_) => DVec2::ZERO,
                None => direction[slots[c as usize] as usize],
            };
            gather(&mut product, &moved, &|_, map| map);
            let curvature: f64 = direction.iter().zip(&product).map(|(d, p)| d.dot(*p)).sum();
            if curvature <= 0.0 {
                break;
            }
            let step = norm / curvature;
            for k in 0..n {
                at[k] += step * direction[k];
                residual[k] -= step * product[k];
            }
            let next: f64 = (0..n).map(|k| residual[k].dot(preconditioned(&residual, k))).sum();
            (0..n).for_each(|k| direction[k] = preconditioned(&residual, k) + next / norm * direction[k]);
            norm = next;
        }
    }
}

/// The rotation that is nearest to a matrix.
fn rotation(map: DMat2) -> DMat2 {
    let turn = DVec2::new(map.x_axis.x + map.y_axis.y, map.x_axis.y - map.y_axis.x).normalize_or(DVec2::X);
    DMat2::from_cols(turn, turn.perp())
}
