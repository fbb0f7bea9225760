//! The validated mesh: triangles, UV corners, tiles and charts (method §1), from a host's arrays.

mod build;
mod charts;
mod check;
pub mod gaps;
pub mod hash;
mod layers;
pub mod overlaps;
mod read;
pub mod source;
pub mod triangle;
pub mod weld;

use std::ops::Range;
use std::sync::Arc;

use glam::DVec2;

use crate::allocation::{Vec, vec};
use crate::error::{Result, ensure};
use crate::report::AssetInfo;
pub use source::{MeshSource, UvSource, Weld, WeldBy};
pub use source::{POSITION_TOLERANCE, UV_TOLERANCE};

/// The index that stands for no triangle, tile, chart or block.
pub const NONE: u32 = u32::MAX;

/// A triangle of a tile.
#[derive(Debug)]
pub struct Triangle {
    /// Its corners' vertices, as indices into `Chart::vertices`.
    pub local: [u32; 3],
    /// Its corners' UVs within the tile (0..1 inside it).
    pub uv: [DVec2; 3],
    /// The triangle across the edge opposite to each corner, or `NONE` on the chart's border.
    pub neighbours: [u32; 3],
}

/// A connected component of triangles in the UV plane (method §1).
#[derive(Debug, Default)]
pub struct Chart {
    /// Its triangles in `TileMesh::triangles`.
    pub triangles: Range<usize>,
    /// The triangles of its collar there.
    pub collar: Range<usize>,
    /// Largest distance of the collar's end from the chart, in UV; 0 without a collar.
    pub reach: f64,
    /// The mesh vertices that it uses: ascending, and then the further ones of its collar.
    pub vertices: Vec<u32>,
    /// The points of its collar that are no vertices; they are numbered after the vertices.
    pub points: Vec<FacePoint>,
}

/// A point of a triangle of the mesh, or the mirror image of one.
#[derive(Clone, Copy, Debug)]
pub struct FacePoint {
    pub vertices: [u32; 3],
    /// The weights of `vertices`, with the sum 1.
    pub weights: [f64; 3],
    pub mirror: Option<Mirror>,
}

impl FacePoint {
    /// The vertex of the mesh that the point is, if it is one.
    pub fn vertex(&self) -> Option<u32> {
        let k = (0..3).find(|&k| self.weights[k] == 1.0)?;
        self.mirror.is_none().then_some(self.vertices[k])
    }

    pub fn of_mesh(&self) -> impl Iterator<Item = u32> + use<> {
        let of_mirror = |mirror: Mirror| mirror.edge.into_iter().chain([mirror.inner]);
        self.vertices.into_iter().chain(self.mirror.into_iter().flat_map(of_mirror))
    }
}

/// The plane through an edge of the mesh at right angles to the triangle there: the surface ends at the edge, and goes
/// on with its mirror image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Mirror {
    pub edge: [u32; 2],
    /// The third vertex of the triangle.
    pub inner: u32,
}

impl Mirror {
    /// The mirror image of a point; a triangle without area has none but the point itself.
    fn image<const D: usize>(&self, point: [f64; D], position: impl Fn(u32) -> [f64; D]) -> [f64; D] {
        let dot = |a: &[f64; D], b: &[f64; D]| (0..D).map(|k| a[k] * b[k]).sum::<f64>();
        let [a, b] = self.edge.map(&position);
        let from_a = |p: [f64; D]| -> [f64; D] { std::array::from_fn(|k| p[k] - a[k]) };
        let (along, inward) = (from_a(b), from_a(position(self.inner)));
        let share = dot(&inward, &along) / dot(&along, &along);
        let normal: [f64; D] = std::array::from_fn(|k| inward[k] - share * along[k]);
        let twice = 2.0 * dot(&from_a(point), &normal) / dot(&normal, &normal);
        if !twice.is_finite() {
            return point;
        }
        std::array::from_fn(|k| point[k] - twice * normal[k])
    }
}

impl Chart {
    /// The vertices of the mesh on which its vertices and points depend.
    pub fn of_mesh(&self) -> impl Iterator<Item = u32> + '_ {
        self.vertices.iter().copied().chain(self.points.iter().flat_map(FacePoint::of_mesh))
    }

    /// Number of vertices and points.
    pub fn count(&self) -> usize {
        self.vertices.len() + self.points.len()
    }

    /// The position of a vertex or point, given those of the mesh's vertices.
    pub fn position<const D: usize>(&self, local: u32, of_vertex: impl Fn(u32) -> [f64; D]) -> [f64; D] {
        let position = self.value(local, &of_vertex);
        let point = (local as usize).checked_sub(self.vertices.len()).map(|k| &self.points[k]);
        match point.and_then(|point| point.mirror) {
            Some(mirror) => mirror.image(position, of_vertex),
            None => position,
        }
    }

    /// The positions of all vertices, then of all points, given those of the mesh's vertices.
    pub fn positions<'a, const D: usize>(
        &'a self,
        of_vertex: impl Fn(u32) -> [f64; D] + Copy + 'a,
    ) -> impl Iterator<Item = [f64; D]> + 'a {
        let vertices = self.vertices.iter().map(move |&v| of_vertex(v));
        let points = self.vertices.len() as u32..self.count() as u32;
        vertices.chain(points.map(move |local| self.position(local, of_vertex)))
    }

    /// The value at a vertex or point, given the values at the mesh's vertices; mirror images have those of what they
    /// are of.
    pub fn value<const D: usize>(&self, local: u32, of_vertex: impl Fn(u32) -> [f64; D]) -> [f64; D] {
        match self.vertices.get(local as usize) {
            Some(&v) => of_vertex(v),
            None => {
                let point = &self.points[local as usize - self.vertices.len()];
                let [a, b, c] = point.vertices.map(of_vertex);
                let [p, q, r] = point.weights;
                std::array::from_fn(|k| p * a[k] + q * b[k] + r * c[k])
            }
        }
    }
}

/// The triangle of the surface that a collar's triangle was copied from.
#[derive(Clone, Copy, Debug)]
pub struct Source {
    /// Its tile in `Mesh::tiles`, and the triangle there that it is a part of.
    pub tile: u32,
    pub triangle: u32,
    /// True for the mirror image of that part, beyond an open border.
    pub image: bool,
    /// UVs within that tile.
    pub uv: [DVec2; 3],
    /// Distances from the chart's border along the surface, as lengths in the chart's plane.
    pub distance: [f32; 3],
    /// Share of the collar that is left around each corner: 1 at the chart's border, 0 where the collar ends.
    pub depth: [f32; 3],
}

/// A segment near a triangle beside which no node may move: a part of its side at which the chart ends, or of the
/// outline of a gap that welding closed.
#[derive(Clone, Copy, Debug)]
pub struct Cut {
    pub triangle: u32,
    /// Its ends.
    pub uv: [DVec2; 2],
    /// True for the outline of a gap.
    pub is_gap: bool,
}

/// An edge of the UV plane whose two sides have different vertices and are joined by position alone.
#[derive(Debug)]
pub struct WeldedEdge {
    /// Both triangles, by their numbers in `TileMesh::chart_of`, and their corners opposite to the edge.
    pub sides: [(u32, u8); 2],
    /// The vertices on both sides, for each end of the edge.
    pub ends: [[u32; 2]; 2],
}

/// The triangles of the mesh that belong to one layer of one UDIM tile of one UV set.
#[derive(Debug, Default)]
pub struct TileMesh {
    pub udim: u32,
    pub uv_set: u32,
    /// Number of the layer, among the tiles of its UDIM number; see `MeshSource::max_layers`.
    pub layer: u32,
    /// Sorted by chart; charts are numbered by their first face. The triangles of the charts' collars follow, if the
    /// tile has been extended, sorted by chart, too.
    pub triangles: Vec<Triangle>,
    /// For the triangles of collars.
    pub sources: Vec<Source>,
    pub charts: Vec<Chart>,
    /// Parts of sides beyond which a chart ends although it goes on beyond the rest of the side, and the outlines of
    /// gaps that welding closed, sorted by triangle.
    pub cuts: Vec<Cut>,
    /// The chart of each triangle, in the order of the mesh's faces: the numbers that `Corner` and `WeldedEdge` use.
    pub chart_of: Vec<u32>,
    /// Edges joined by position alone.
    pub welds: Vec<WeldedEdge>,
    /// Number of edges that coincide but are not connected.
    pub edges_apart: u64,
}

impl TileMesh {
    /// The tile's lower corner (least u and v), in the UV plane of all tiles.
    pub fn origin(&self) -> DVec2 {
        let number = self.udim - 1001;
        DVec2::new(f64::from(number % 10), f64::from(number / 10))
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let of_chart = |chart: &Chart| size_of_val(&*chart.vertices) + size_of_val(&*chart.points);
        let of_charts: usize = self.charts.iter().map(of_chart).sum();
        let arrays = [size_of_val(&*self.triangles), size_of_val(&*self.sources), size_of_val(&*self.charts)];
        let further = [size_of_val(&*self.cuts), size_of_val(&*self.chart_of), size_of_val(&*self.welds)];
        (of_charts + arrays.into_iter().chain(further).sum::<usize>()) as u64
    }

    /// The tile's name in messages.
    pub fn name(&self) -> String {
        let layer = if self.layer > 0 { format!(" layer {}", self.layer) } else { String::new() };
        format!("tile {}{layer}", self.udim)
    }

    /// The chart of each triangle.
    pub fn chart_of_triangles(&self) -> Vec<u32> {
        let of = |range: fn(&Chart) -> &Range<usize>| {
            let each = move |(c, chart)| std::iter::repeat_n(c as u32, range(chart).len());
            self.charts.iter().enumerate().flat_map(each)
        };
        of(|chart| &chart.triangles).chain(of(|chart| &chart.collar)).collect()
    }

    pub fn chart_of_triangle(&self, triangle: u32) -> u32 {
        let t = triangle as usize;
        let end = |chart: &Chart| if t < self.own() { chart.triangles.end } else { chart.collar.end };
        self.charts.partition_point(|chart| end(chart) <= t) as u32
    }

    pub fn cuts_of(&self, triangle: u32) -> impl Iterator<Item = &Cut> {
        let first = self.cuts.partition_point(|cut| cut.triangle < triangle);
        self.cuts[first..].iter().take_while(move |cut| cut.triangle == triangle)
    }

    /// Number of triangles of charts; those of collars follow.
    pub fn own(&self) -> usize {
        self.triangles.len() - self.sources.len()
    }

    /// The origin of a collar's triangle on the surface; `None` for the tile's own.
    pub fn source(&self, triangle: usize) -> Option<&Source> {
        triangle.checked_sub(self.own()).map(|k| &self.sources[k])
    }

    /// True if a triangle is a mirror image of a part of the surface.
    pub fn is_image(&self, triangle: u32) -> bool {
        self.source(triangle as usize).is_some_and(|source| source.image)
    }

    /// True if any triangle is a mirror image.
    pub fn has_images(&self) -> bool {
        self.sources.iter().any(|source| source.image)
    }

    /// Number of triangle sides without a neighbour.
    pub fn border_edges(&self) -> u64 {
        self.triangles[..self.own()].iter().flat_map(|t| t.neighbours).filter(|&n| n == NONE).count() as u64
    }
}

/// A face corner's UV, with its tile and a triangle.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Its tile in `Mesh::tiles`, or `NONE`.
    pub tile: u32,
    /// A triangle at this corner, by its number in `TileMesh::chart_of`, or `NONE` if no triangle was kept.
    pub triangle: u32,
    /// Its UV, that of all corners that are welded to it; 0, 0 for a face without UVs.
    pub uv: [f32; 2],
    /// The UV that the host gave.
    pub given: [f32; 2],
}

/// A validated mesh.
#[derive(Debug)]
pub struct Mesh {
    pub rest: Vec<[f64; 3]>,
    /// The vertex of each face corner.
    pub indices: Vec<u32>,
    /// The first corner of each face, followed by the number of all corners.
    pub faces: Vec<u32>,
    /// Per vertex, the first vertex at the same place; empty unless vertices are welded by position.
    pub place: Vec<u32>,
    /// The corners of each UV set.
    pub corners: Vec<Vec<Corner>>,
    /// Ordered by UV set, then by UDIM number, then by layer.
    pub tiles: Vec<Arc<TileMesh>>,
    /// Per tile, the corners of each triangle, by its number in `TileMesh::chart_of`; empty unless there are several UV
    /// sets.
    pub corners_of: Vec<Vec<[u32; 3]>>,
    /// The distance in a pose beyond which welded vertices are torn apart, before the pose's rounding is added.
    pub torn: f64,
    pub info: AssetInfo,
}

/// A triangle before its tile is built.
pub struct RawTriangle {
    /// Face corners of the mesh.
    corners: [u32; 3],
    /// Vertices of the mesh.
    vertices: [u32; 3],
    /// UVs within the tile.
    uv: [DVec2; 3],
}

impl Mesh {
    /// Refuses an unknown UV set.
    pub fn check_uv_set(&self, uv_set: u32) -> Result<()> {
        let sets = self.corners.len();
        ensure!((uv_set as usize) < sets, "uv_set: {uv_set} is out of range, there are {sets}");
        Ok(())
    }

    /// The layers of a tile's UDIM number, as indices of tiles.
    pub fn layers(&self, tile: usize) -> Range<usize> {
        let first = tile - self.tiles[tile].layer as usize;
        let more = self.tiles[first + 1..].iter().take_while(|tile| tile.layer > 0).count();
        first..first + 1 + more
    }

    /// The other layers of a tile's UDIM number.
    pub fn other_layers(&self, tile: &TileMesh) -> impl Iterator<Item = &TileMesh> {
        let (of, layer) = ((tile.uv_set, tile.udim), tile.layer);
        let tiles = self.tiles.iter().map(|tile| &**tile);
        tiles.filter(move |other| (other.uv_set, other.udim) == of && other.layer != layer)
    }

    /// The layer of each face in a UV set; 0 for a face in no tile.
    pub fn face_layers(&self, uv_set: usize) -> impl ExactSizeIterator<Item = u32> + '_ {
        let corners = &self.corners[uv_set];
        (0..self.faces.len() - 1).map(move |f| {
            let of_face = &corners[self.face(f)];
            // A corner without a triangle says nothing of its face.
            let corner = of_face.iter().find(|corner| corner.tile != NONE && corner.triangle != NONE);
            corner.map_or(0, |corner| self.tiles[corner.tile as usize].layer)
        })
    }

    /// The corners of a face.
    pub fn face(&self, f: usize) -> Range<usize> {
        self.faces[f] as usize..self.faces[f + 1] as usize
    }
}

/// The place of each number in an order of all.
pub fn inverse(order: &[u32]) -> Vec<u32> {
    let mut new_index = vec![NONE; order.len()];
    for (new, &old) in order.iter().enumerate() {
        new_index[old as usize] = new as u32;
    }
    new_index
}
