//! The mesh as refinements see it: its faces as triangles, and its corners by their UVs.

use glam::DVec2;

use vrtm_core::allocation::Vec;
use vrtm_core::mesh::hash::{Table, enter};
use vrtm_core::mesh::triangle::triangulate;
use vrtm_core::mesh::{Corner, Mesh, NONE, TileMesh};

/// A UV shared by corners of one vertex and one chart, which are redirected alike.
#[derive(Clone, Copy, Debug)]
pub struct UvPoint {
    /// The set's UV, with the tile's offset.
    pub uv: [f64; 2],
    /// Its tile in `Mesh::tiles`, or `NONE`.
    pub tile: u32,
    /// A triangle of its chart, by its number in `TileMesh::chart_of`, or `NONE`.
    pub triangle: u32,
}

/// A triangle of a face of the mesh.
#[derive(Clone, Copy, Debug)]
pub struct BaseTriangle {
    pub face: u32,
    /// Corners of the mesh.
    pub corners: [u32; 3],
}

/// The common starting point of all refinements of one UV set.
#[derive(Debug)]
pub struct Base {
    /// Ordered by face.
    pub triangles: Vec<BaseTriangle>,
    pub uv_points: Vec<UvPoint>,
    /// The UV point of each corner of the mesh.
    pub uv_point: Vec<u32>,
}

impl Base {
    pub fn new(mesh: &Mesh, uv_set: usize) -> Base {
        let corners = &mesh.corners[uv_set];
        let (uv_points, uv_point) = uv_points(mesh, corners);
        let mut triangles = Vec::with_capacity(mesh.indices.len());
        for f in 0..mesh.faces.len() - 1 {
            let face = mesh.face(f);
            if face.len() < 3 {
                continue;
            }
            let flat = if corners[face.start].tile == NONE {
                flattened(face.clone().map(|c| mesh.rest[mesh.indices[c] as usize]).collect())
            } else {
                let origin = mesh.tiles[corners[face.start].tile as usize].origin();
                face.clone().map(|c| DVec2::from(corners[c].uv.map(f64::from)) - origin).collect()
            };
            triangles.extend(triangulate(&flat).into_iter().map(|triangle| BaseTriangle {
                face: f as u32,
                corners: triangle.map(|k| (face.start + k) as u32),
            }));
        }
        triangles.shrink_to_fit();
        Base { triangles, uv_points, uv_point }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.triangles) + size_of_val(&*self.uv_points) + size_of_val(&*self.uv_point)
    }
}

/// The distinct UVs of a set's corners, and the index of each corner's UV.
fn uv_points(mesh: &Mesh, corners: &[Corner]) -> (Vec<UvPoint>, Vec<u32>) {
    // A pose may tear welds; corners belong together if they are in one chart even when all welds are torn.
    let charts = |tile: &TileMesh| match tile.welds.len() {
        0 => tile.chart_of.iter().copied().collect(),
        welds => tile.cut(&(0..welds as u32).collect::<Vec<_>>()).chart_of,
    };
    let charts: Vec<Vec<u32>> = mesh.tiles.iter().map(|tile| charts(tile)).collect();
    let mut known: Table<[u32; 5], u32> = Table::default();
    let mut points = Vec::new();
    let mut of_corner = Vec::with_capacity(corners.len());
    for (corner, &vertex) in corners.iter().zip(&mesh.indices) {
        let Corner { tile, triangle, uv, .. } = *corner;
        let in_chart = tile != NONE && triangle != NONE;
        let chart = if in_chart { charts[tile as usize][triangle as usize] } else { NONE };
        let key = [vertex, uv[0].to_bits(), uv[1].to_bits(), tile, chart];
        let point = known.get(&key).copied().unwrap_or_else(|| {
            points.push(UvPoint { uv: uv.map(f64::from), tile, triangle });
            let point = points.len() as u32 - 1;
            enter(&mut known, key, point);
            point
        });
        of_corner.push(point);
    }
    (points, of_corner)
}

/// A polygon in space, seen along the axis that its normal is closest to.
fn flattened(polygon: Vec<[f64; 3]>) -> Vec<DVec2> {
    let mut normal = [0.0; 3];
    for (k, p) in polygon.iter().enumerate() {
        let q = polygon[(k + 1) % polygon.len()];
        for (axis, sum) in normal.iter_mut().enumerate() {
            let (i, j) = ((axis + 1) % 3, (axis + 2) % 3);
            *sum += (p[i] - q[i]) * (p[j] + q[j]);
        }
    }
    let longest =
        |best: usize, axis: usize| if normal[axis].abs() > normal[best].abs() { axis } else { best };
    let axis = [1, 2].into_iter().fold(0, longest);
    polygon.into_iter().map(|p| DVec2::new(p[(axis + 1) % 3], p[(axis + 2) % 3])).collect()
}
