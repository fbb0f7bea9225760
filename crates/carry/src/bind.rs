//! Binds points to the rest surface: by UV, by corners of faces, or to the nearest point.

use glam::{DVec2, DVec3};

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::error::{Result, ensure};
use vrtm_core::mesh::overlaps::Overlaps;
use vrtm_core::mesh::triangle::doubled_area;
use vrtm_core::mesh::{Mesh, NONE, TileMesh};
use vrtm_core::sets::grouped;
use vrtm_core::team::Team;
use vrtm_core::view::Strided;

use crate::frame::power_of_two;
use crate::nearest::{Found, Nearest, weighed};
use crate::surface::{clamped, weights as barycentric};

/// A UV this far beside a chart still lies on its border: a quarter of a texel of 16384, and more than the rounding of
/// f32.
const BESIDE: f64 = 1.5e-5;

/// Kind of place by which points are given.
#[derive(Clone, Copy, Debug)]
pub enum Bind<'a> {
    /// UVs among all tiles of the set, and each point's layer; without layers, the first layer that has a chart there.
    Uv { uvs: Strided<'a>, layers: Option<&'a [u32]> },
    /// Three corners of one face for each point, and their weights, of which only the ratio matters.
    Corners { corners: &'a [[u32; 3]], weights: Strided<'a> },
    /// The nearest point of the surface at rest, and the largest distance from it.
    Nearest { positions: Strided<'a>, farthest: Option<f64> },
}

/// Binding of a point.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u32)]
pub enum PointState {
    /// It stands on a chart.
    #[default]
    Bound = 0,
    /// No chart is there.
    Outside = 1,
    /// The UVs of the triangle there are turned over within their chart.
    Folded = 2,
    /// The surface is farther than the largest distance.
    Far = 3,
}

#[derive(Clone, Copy, Debug)]
pub struct Bound {
    /// Its tile in `Mesh::tiles`; `NONE` for a point that moves with the surface alone.
    pub tile: u32,
    /// Its triangle, by its number in `TileMesh::chart_of`, or its index in `Binding::skins`.
    pub triangle: u32,
    /// Within the tile; among all tiles for a point without one.
    pub uv: DVec2,
    /// The given position at rest, without the height.
    pub foot: DVec3,
    pub height: f64,
}

/// A point of a triangle of vertices.
#[derive(Clone, Copy, Debug)]
pub struct Skin {
    pub vertices: [u32; 3],
    pub weights: [f64; 3],
}

#[derive(Debug)]
pub struct Binding {
    pub points: Vec<Bound>,
    pub states: Vec<PointState>,
    pub skins: Vec<Skin>,
    /// The points in the order of their triangles, in which they are carried: neighbours share what is read.
    pub(crate) order: Vec<u32>,
    /// Per point, its place in that order.
    pub(crate) place: Vec<u32>,
}

/// Points that the host says move as one body, by the numbers that it gives them.
#[derive(Debug)]
pub struct Pieces {
    /// Per point, the index of its piece; `NONE` for a point of no piece.
    pub(crate) of_point: Vec<u32>,
    /// Per piece, its points in a row, and where each row ends.
    pub(crate) points: Vec<u32>,
    pub(crate) ends: Vec<u32>,
}

impl Pieces {
    pub fn new(ids: &[u32]) -> Pieces {
        let mut sorted: Vec<(u32, u32)> =
            (0..).zip(ids).filter(|(_, id)| **id != NONE).map(|(k, id)| (*id, k)).collect();
        sorted.sort_unstable();
        let mut of_point = vec![NONE; ids.len()];
        let mut ends = Vec::new();
        let mut end = 0;
        for piece in sorted.chunk_by(|a, b| a.0 == b.0) {
            piece.iter().for_each(|(_, k)| of_point[*k as usize] = ends.len() as u32);
            end += piece.len() as u32;
            ends.push(end);
        }
        Pieces { of_point, points: sorted.iter().map(|(_, k)| *k).collect(), ends }
    }

    pub fn bytes(&self) -> usize {
        size_of_val(&*self.of_point) + size_of_val(&*self.points) + size_of_val(&*self.ends)
    }
}

/// The triangles of a UV set, in the order of tiles, then of faces with no triangle in a tile.
struct Triangles<'a> {
    mesh: &'a Mesh,
    uv_set: usize,
    /// Tile and triangle, or `NONE` and the first vertex's corner.
    all: Vec<(u32, u32)>,
    vertices: Vec<[u32; 3]>,
    /// Number of those with UVs.
    textured: usize,
}

impl<'a> Triangles<'a> {
    fn new(mesh: &'a Mesh, uv_set: usize) -> Triangles<'a> {
        let (mut all, mut vertices) = (Vec::new(), Vec::new());
        let of_set = |(_, tile): &(usize, &std::sync::Arc<TileMesh>)| tile.uv_set as usize == uv_set;
        for (k, tile) in mesh.tiles.iter().enumerate().filter(of_set) {
            for chart in &tile.charts {
                for t in chart.triangles.clone() {
                    all.push((k as u32, t as u32));
                    vertices.push(tile.triangles[t].local.map(|v| chart.vertices[v as usize]));
                }
            }
        }
        let textured = all.len();
        for f in 0..mesh.faces.len() - 1 {
            let face = mesh.face(f);
            if mesh.corners[uv_set][face.clone()].iter().all(|corner| corner.triangle == NONE) {
                for k in 1..face.len().saturating_sub(1) {
                    all.push((NONE, face.start as u32));
                    vertices.push([0, k, k + 1].map(|k| mesh.indices[face.start + k]));
                }
            }
        }
        Triangles { mesh, uv_set, all, vertices, textured }
    }

    fn uv(&self, k: usize) -> ([DVec2; 3], &TileMesh) {
        let (tile, t) = self.all[k];
        let tile = &self.mesh.tiles[tile as usize];
        (tile.triangles[t as usize].uv, tile)
    }

    fn rest(&self, k: usize) -> [DVec3; 3] {
        self.vertices[k].map(|v| self.mesh.rest[v as usize].into())
    }

    /// For the triangles with UVs, their UVs among all tiles, each layer in a plane of its own.
    fn by_uv(&self) -> ByUv {
        let of = |k: usize| {
            let (uv, tile) = self.uv(k);
            uv.map(|uv| uv + tile.origin())
        };
        let of_layer = |k: usize| of(k).map(|uv| uv.extend(self.uv(k).1.layer.into()));
        let search = Nearest::new((0..self.textured).map(of_layer).collect());
        ByUv { search, bins: Overlaps::of((0..self.textured).map(of).collect()) }
    }

    /// Per triangle with UVs, whether they are turned over within their chart.
    fn folded(&self) -> Vec<bool> {
        let mut folded = vec![false; self.textured];
        let mut first = 0;
        while first < self.textured {
            let (tile, t) = self.all[first];
            let chart = &self.mesh.tiles[tile as usize];
            let count = chart.charts[chart.chart_of_triangle(t) as usize].triangles.len();
            let area = |k: usize| doubled_area(self.uv(k).0);
            let whole: f64 = (first..first + count).map(area).sum();
            (first..first + count).for_each(|k| folded[k] = area(k) * whole < 0.0);
            first += count;
        }
        folded
    }

    /// Per vertex, the triangles with UVs there.
    fn by_vertex(&self) -> (Vec<u32>, Vec<u32>) {
        let corners = self.vertices[..self.textured].iter().zip(0..);
        let of_triangle = |(vertices, k): (&[u32; 3], u32)| vertices.map(|v| (v as usize, k));
        grouped(self.mesh.rest.len(), corners.flat_map(of_triangle))
    }
}

/// Triangles by their UVs.
struct ByUv {
    search: Nearest,
    bins: Overlaps,
}

impl ByUv {
    /// The point of a layer's triangles that is nearest to a UV. Most UVs lie on triangles, few of which are in a bin.
    fn find(&self, uv: DVec2, layer: u32) -> Option<Found> {
        const WITHIN: f64 = 1e-9;
        const MOST: usize = 64;
        let (to, step) = (uv.extend(layer.into()), DVec2::splat(WITHIN));
        let mut near = self.bins.near([uv - step, uv, uv + step]);
        let found = self.search.find_among(near.by_ref().take(MOST), to, WITHIN);
        if found.is_some() && near.next().is_none() { found } else { self.search.find(to) }
    }
}

struct Hit {
    /// A triangle of `Triangles`.
    triangle: Option<usize>,
    uv: DVec2,
    foot: DVec3,
    skin: Skin,
    state: PointState,
}

impl Binding {
    /// Binds points to the rest surface of a UV set; `heights` are above it.
    ///
    /// # Errors
    /// `InvalidArgument` with the index of a point whose corners are not three of one face, or whose weights add up to
    /// nothing.
    pub fn new(
        team: &Team,
        mesh: &Mesh,
        uv_set: usize,
        by: &Bind,
        heights: Option<&Strided>,
    ) -> Result<Binding> {
        let triangles = Triangles::new(mesh, uv_set);
        let folded = triangles.folded();
        let hits: Vec<Hit> = match by {
            Bind::Uv { uvs, layers } => {
                let search = triangles.by_uv();
                let most = mesh.tiles.iter().map(|tile| tile.layer).max().unwrap_or_default();
                team.map(uvs.len(), |k| {
                    let uv = DVec2::new(uvs.get(k, 0), uvs.get(k, 1));
                    let layers = layers.map_or(0..=most, |layers| layers[k]..=layers[k]);
                    of_uv(&triangles, &search, uv, layers)
                })
            }
            Bind::Corners { corners, weights } => {
                let of_faces = check_corners(mesh, corners, weights)?;
                let (search, by_vertex) = (triangles.by_uv(), triangles.by_vertex());
                team.map(corners.len(), |k| {
                    let face = mesh.face(of_faces[k] as usize);
                    of_corners(&triangles, &search, &by_vertex, face, corners[k], scaled(weights, k))
                })
            }
            Bind::Nearest { positions, farthest } => {
                let all = (0..triangles.all.len()).map(|k| triangles.rest(k)).collect();
                let search = Nearest::new(all);
                team.map(positions.len(), |k| {
                    nearest(&triangles, &search, positions.get3(k).into(), *farthest)
                })
            }
        };
        let numbers: Vec<Vec<u32>> = mesh.tiles.iter().map(|tile| tile.numbers()).collect();
        let mut binding = Binding {
            points: Vec::with_capacity(hits.len()),
            states: Vec::with_capacity(hits.len()),
            skins: Vec::new(),
            order: Vec::with_capacity(hits.len()),
            place: vec![0; hits.len()],
        };
        for (k, hit) in hits.into_iter().enumerate() {
            let height = heights.map_or(0.0, |heights| heights.get(k, 0));
            let is_folded = hit.triangle.is_some_and(|triangle| folded[triangle]);
            let state =
                if is_folded && hit.state == PointState::Bound { PointState::Folded } else { hit.state };
            let found = hit.triangle.filter(|_| state == PointState::Bound).map(|k| triangles.all[k]);
            let (tile, triangle) = match found {
                Some((tile, t)) => (tile, numbers[tile as usize][t as usize]),
                None => {
                    binding.skins.push(hit.skin);
                    (NONE, binding.skins.len() as u32 - 1)
                }
            };
            let origin = found.map_or(DVec2::ZERO, |(tile, _)| mesh.tiles[tile as usize].origin());
            binding.points.push(Bound { tile, triangle, uv: hit.uv - origin, foot: hit.foot, height });
            binding.states.push(state);
        }
        let keys = (0..).zip(&binding.points).map(|(k, point)| (point.tile, point.triangle, k));
        let mut sorted: Vec<(u32, u32, u32)> = keys.collect();
        sorted.sort_unstable();
        for (n, (_, _, k)) in (0..).zip(sorted) {
            binding.place[k as usize] = n;
            binding.order.push(k);
        }
        Ok(binding)
    }

    pub fn bytes(&self) -> usize {
        let order = size_of_val(&*self.order) + size_of_val(&*self.place);
        size_of_val(&*self.points) + size_of_val(&*self.states) + size_of_val(&*self.skins) + order
    }
}

/// The face of each point's corners.
fn check_corners(mesh: &Mesh, corners: &[[u32; 3]], weights: &Strided) -> Result<Vec<u32>> {
    let mut faces = Vec::with_capacity(corners.len());
    for (k, &[a, b, c]) in corners.iter().enumerate() {
        let face = mesh.faces.partition_point(|&first| first <= a) - 1;
        let is_of = |corner: u32| face + 1 < mesh.faces.len() && mesh.face(face).contains(&(corner as usize));
        let are_of_face = is_of(a) && is_of(b) && is_of(c);
        ensure!(are_of_face, "corners[{k}]: {a}, {b}, {c} are not three corners of one face");
        let sum: f64 = scaled(weights, k).iter().sum();
        ensure!(sum.abs() > 1e-6, "weights[{k}]: their sum is 0");
        faces.push(face as u32);
    }
    Ok(faces)
}

/// The weights of a point, of which the largest is from 1 to 2: their sum neither overflows nor vanishes.
fn scaled(weights: &Strided, k: usize) -> [f64; 3] {
    let given = [0, 1, 2].map(|c| weights.get(k, c));
    let scale = power_of_two(given.iter().fold(0.0, |most: f64, weight| most.max(weight.abs())));
    given.map(|weight| weight / scale)
}

fn of_uv(triangles: &Triangles, search: &ByUv, uv: DVec2, layers: std::ops::RangeInclusive<u32>) -> Hit {
    let mut best: Option<Found> = None;
    for layer in layers {
        let least = best.map_or(f64::INFINITY, |best| best.distance);
        if least <= BESIDE {
            break;
        }
        best = search.find(uv, layer).filter(|next| next.distance < least).or(best);
    }
    let Some(found) = best else {
        let skin = Skin { vertices: [0; 3], weights: [1.0, 0.0, 0.0] };
        let foot = DVec3::from(triangles.mesh.rest[0]);
        return Hit { triangle: None, uv, foot, skin, state: PointState::Outside };
    };
    let triangle = found.triangle as usize;
    let state = if found.distance <= BESIDE { PointState::Bound } else { PointState::Outside };
    let skin = Skin { vertices: triangles.vertices[triangle], weights: found.weights };
    let foot = weighed(triangles.rest(triangle), found.weights);
    // A point beside the border is put on it.
    let (corners, tile) = triangles.uv(triangle);
    let on_border = weighed(corners, found.weights) + tile.origin();
    let uv = if state == PointState::Bound && found.distance > 0.0 { on_border } else { uv };
    Hit { triangle: Some(triangle), uv, foot, skin, state }
}

fn of_corners(
    triangles: &Triangles,
    search: &ByUv,
    (starts, list): &(Vec<u32>, Vec<u32>),
    face: std::ops::Range<usize>,
    corners: [u32; 3],
    weights: [f64; 3],
) -> Hit {
    let Triangles { mesh, uv_set, .. } = triangles;
    let sum: f64 = weights.iter().sum();
    let weights_given = weights.map(|weight| weight / sum);
    let skin = Skin { vertices: corners.map(|c| mesh.indices[c as usize]), weights: weights_given };
    let rest = skin.vertices.map(|v| DVec3::from(mesh.rest[v as usize]));
    let foot = weighed(rest, weights_given);
    let of_set = &mesh.corners[*uv_set];
    let uvs = corners.map(|c| DVec2::from(of_set[c as usize].uv.map(f64::from)));
    let uv = weighed(uvs, weights_given);
    let hit = |triangle, uv, state| Hit { triangle, uv, foot, skin, state };
    let Some(corner) = of_set[face.clone()].iter().find(|corner| corner.triangle != NONE) else {
        return hit(None, uv, PointState::Outside);
    };
    let is_of_face = |v: u32| face.clone().any(|c| mesh.indices[c] == v);
    let mut best: Option<(f64, usize)> = None;
    for v in face.clone().map(|c| mesh.indices[c] as usize) {
        for &k in &list[starts[v] as usize..starts[v + 1] as usize] {
            let k = k as usize;
            if triangles.all[k].0 != corner.tile || !triangles.vertices[k].iter().all(|&v| is_of_face(v)) {
                continue;
            }
            let (of, tile) = triangles.uv(k);
            let depth = barycentric(of, uv - tile.origin()).into_iter().fold(f64::INFINITY, f64::min);
            if best.is_none_or(|(most, first)| depth > most || (depth == most && k < first)) {
                best = Some((depth, k));
            }
        }
    }
    if let Some((_, k)) = best.filter(|(depth, _)| *depth >= -1e-6) {
        return hit(Some(k), uv, PointState::Bound);
    }
    // Beside the face, as by corners of a concave one.
    let layer = mesh.tiles[corner.tile as usize].layer;
    let beside = of_uv(triangles, search, uv, layer..=layer);
    hit(beside.triangle, beside.uv, beside.state)
}

fn nearest(triangles: &Triangles, search: &Nearest, at: DVec3, farthest: Option<f64>) -> Hit {
    let Some(found) = search.find(at) else {
        let skin = Skin { vertices: [0; 3], weights: [1.0, 0.0, 0.0] };
        return Hit { triangle: None, uv: DVec2::ZERO, foot: at, skin, state: PointState::Outside };
    };
    let k = found.triangle as usize;
    let weights = clamped(found.weights);
    let skin = Skin { vertices: triangles.vertices[k], weights };
    let textured = (k < triangles.textured).then_some(k);
    let state = match textured {
        _ if farthest.is_some_and(|farthest| found.distance > farthest) => PointState::Far,
        Some(_) => PointState::Bound,
        None => PointState::Outside,
    };
    let uv = textured.map_or(DVec2::ZERO, |k| {
        let (corners, tile) = triangles.uv(k);
        weighed(corners, weights) + tile.origin()
    });
    Hit { triangle: textured, uv, foot: at, skin, state }
}
