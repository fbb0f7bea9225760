//! The validated mesh: triangles, UV corners, tiles and charts (method §1), from a host's arrays.

mod charts;
pub(crate) mod triangle;
mod triangulate;

use std::collections::{BTreeMap, HashMap};
use std::ops::Range;

use glam::DVec2;

use crate::error::{Error, Result};
use crate::report::AssetInfo;
use crate::view::Strided;

/// A host's face-varying UVs.
#[derive(Clone, Copy, Debug)]
pub struct UvSource<'a> {
    /// u of each UV; for interleaved pairs the view has two components and `v` is `None`.
    pub u: Strided<'a>,
    /// v of each UV, where it comes as an array of its own (same length as `u`).
    pub v: Option<Strided<'a>>,
    /// Index of each face corner's UV; `None` = one UV per corner, in corner order.
    pub indices: Option<&'a [u32]>,
}

/// A host's mesh at rest.
#[derive(Clone, Copy, Debug)]
pub struct MeshSource<'a> {
    /// Rest positions, three components, f32 or f64.
    pub positions: Strided<'a>,
    /// Corners per face, each >= 3; `None` = all triangles.
    pub face_counts: Option<&'a [u32]>,
    /// Index of each face corner's vertex.
    pub indices: &'a [u32],
    /// UVs of the face corners. v points up; UDIM tile = 1001 + floor(u) + 10 floor(v).
    pub uvs: UvSource<'a>,
}

/// The index of no triangle, tile, chart or block.
pub(crate) const NONE: u32 = u32::MAX;

/// A triangle of a tile.
#[derive(Clone, Debug)]
pub(crate) struct Triangle {
    /// Its corners' vertices, as indices into `Chart::vertices`.
    pub local: [u32; 3],
    /// Its corners' UVs within the tile (0..1 inside it).
    pub uv: [DVec2; 3],
    /// The triangle across the edge opposite to each corner, or `NONE` on the chart's border.
    pub neighbours: [u32; 3],
}

/// A connected component of triangles in the UV plane (method §1).
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    /// Its triangles in `TileMesh::triangles`.
    pub triangles: Range<usize>,
    /// The mesh vertices that it uses, ascending.
    pub vertices: Vec<u32>,
}

/// The triangles of the mesh that belong to one UDIM tile.
#[derive(Clone, Debug)]
pub(crate) struct TileMesh {
    pub udim: u32,
    /// Sorted by chart; charts are numbered by their first face.
    pub triangles: Vec<Triangle>,
    pub charts: Vec<Chart>,
}

impl TileMesh {
    /// The chart of each triangle.
    pub fn chart_of_triangles(&self) -> Vec<u32> {
        let count = |c: usize| self.charts[c].triangles.len();
        (0..self.charts.len()).flat_map(|c| std::iter::repeat_n(c as u32, count(c))).collect()
    }
}

/// A face corner's UV, with its tile and chart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Corner {
    /// Its tile in `Mesh::tiles`, or `NONE`.
    pub tile: u32,
    /// Its chart in that tile, or `NONE` where no triangle was kept.
    pub chart: u32,
    /// The host's UV.
    pub uv: [f32; 2],
}

/// A validated mesh.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    pub rest: Vec<[f64; 3]>,
    pub corners: Vec<Corner>,
    /// Ascending UDIM numbers.
    pub tiles: Vec<TileMesh>,
    pub info: AssetInfo,
}

/// A triangle before its tile is built.
struct RawTriangle {
    /// Face corners of the mesh.
    corners: [u32; 3],
    /// Vertices of the mesh.
    vertices: [u32; 3],
    /// Numbers of its UV corners; see `Weld`.
    welded: [u32; 3],
    /// UVs within the tile.
    uv: [DVec2; 3],
}

impl Mesh {
    /// # Errors
    /// `InvalidArgument` naming the array and the index of its first invalid element.
    pub fn new(source: &MeshSource) -> Result<Mesh> {
        let uvs = check(source)?;
        let rest: Vec<[f64; 3]> = (0..source.positions.len()).map(|i| source.positions.get3(i)).collect();
        let mut info = AssetInfo {
            vertices: rest.len() as u64,
            corners: source.indices.len() as u64,
            ..AssetInfo::default()
        };
        let mut weld = Weld::default();
        let mut corners = Vec::with_capacity(source.indices.len());
        let mut raw: BTreeMap<u32, Vec<RawTriangle>> = BTreeMap::new();
        let mut udims = Vec::with_capacity(source.indices.len());
        let mut first = 0;
        for count in face_counts(source) {
            let face = first..first + count;
            first += count;
            info.faces += 1;
            let polygon: Vec<[f32; 2]> = face.clone().map(&uvs).collect();
            let Some((udim, origin)) = tile_of(&polygon) else {
                info.faces_outside += 1;
                corners.extend(polygon.iter().map(|&uv| Corner { tile: NONE, chart: NONE, uv }));
                udims.extend(face.map(|_| NONE));
                continue;
            };
            let local: Vec<DVec2> =
                polygon.iter().map(|uv| DVec2::from(uv.map(f64::from)) - origin).collect();
            if local.iter().any(|uv| uv.to_array().iter().any(|x| !(0.0..=1.0).contains(x))) {
                info.clipped_faces += 1;
            }
            corners.extend(polygon.iter().map(|&uv| Corner { tile: NONE, chart: NONE, uv }));
            udims.extend(face.clone().map(|_| udim));
            let welded: Vec<u32> =
                face.clone().map(|c| weld.id(&rest[source.indices[c] as usize], &uvs(c))).collect();
            let triangles = raw.entry(udim).or_default();
            for [a, b, c] in triangulate::polygon(&local) {
                if triangulate::is_degenerate([local[a], local[b], local[c]]) {
                    info.degenerate_triangles += 1;
                    continue;
                }
                triangles.push(RawTriangle {
                    corners: [a, b, c].map(|k| (face.start + k) as u32),
                    vertices: [a, b, c].map(|k| source.indices[face.start + k]),
                    welded: [a, b, c].map(|k| welded[k]),
                    uv: [a, b, c].map(|k| local[k]),
                });
            }
        }
        let mut tiles: Vec<TileMesh> = Vec::new();
        for (udim, triangles) in raw.into_iter().filter(|(_, triangles)| !triangles.is_empty()) {
            let (tile, chart_of) = charts::build(udim, &triangles);
            for (triangle, chart) in triangles.iter().zip(chart_of) {
                for corner in triangle.corners {
                    corners[corner as usize].chart = chart;
                }
            }
            tiles.push(tile);
        }
        let index: HashMap<u32, u32> =
            tiles.iter().enumerate().map(|(i, tile)| (tile.udim, i as u32)).collect();
        for (corner, udim) in corners.iter_mut().zip(udims) {
            corner.tile = index.get(&udim).copied().unwrap_or(NONE);
        }
        info.tiles = tiles.len() as u32;
        info.charts = tiles.iter().map(|tile| tile.charts.len() as u32).sum();
        info.triangles = tiles.iter().map(|tile| tile.triangles.len() as u64).sum();
        Ok(Mesh { rest, corners, tiles, info })
    }
}

/// Number of corners of each face.
fn face_counts<'a>(source: &MeshSource<'a>) -> Box<dyn Iterator<Item = usize> + 'a> {
    match source.face_counts {
        Some(counts) => Box::new(counts.iter().map(|&n| n as usize)),
        None => Box::new(std::iter::repeat_n(3, source.indices.len() / 3)),
    }
}

/// Validates all arrays. Returns the function from a face corner to its UV.
fn check<'a>(source: &MeshSource<'a>) -> Result<impl Fn(usize) -> [f32; 2] + use<'a>> {
    let MeshSource { positions, face_counts, indices, uvs } = *source;
    if positions.components() != 3 {
        return Err(Error::argument("positions: three components are needed"));
    }
    if positions.is_empty() || indices.is_empty() {
        return Err(Error::argument("positions, indices: the mesh is empty"));
    }
    if positions.len() >= NONE as usize || indices.len() >= NONE as usize {
        return Err(Error::argument("positions, indices: more than 2^32 - 2 elements"));
    }
    positions.check_finite("positions")?;
    match face_counts {
        Some(counts) => {
            if let Some(face) = counts.iter().position(|&n| n < 3) {
                let message = format!("face_counts[{face}]: {} corners, at least 3 are needed", counts[face]);
                return Err(Error::argument(message));
            }
            let sum: u64 = counts.iter().map(|&n| u64::from(n)).sum();
            if sum != indices.len() as u64 {
                return Err(Error::argument(format!(
                    "face_counts: they add up to {sum} corners, but indices has {}",
                    indices.len()
                )));
            }
        }
        None if indices.len() % 3 != 0 => {
            return Err(Error::argument(format!(
                "indices: {} corners are no whole number of triangles (face_counts is absent)",
                indices.len()
            )));
        }
        None => {}
    }
    check_indices("indices", indices, "vertex", positions.len())?;
    match uvs.v {
        Some(v) if v.len() != uvs.u.len() => {
            return Err(Error::argument(format!("uvs.v: {} values, but uvs.u has {}", v.len(), uvs.u.len())));
        }
        None if uvs.u.components() != 2 => {
            return Err(Error::argument("uvs.u: two components are needed where uvs.v is absent"));
        }
        _ => {}
    }
    uvs.u.check_f32("uvs.u")?;
    if let Some(v) = uvs.v {
        v.check_f32("uvs.v")?;
    }
    match uvs.indices {
        Some(uv_indices) => {
            if uv_indices.len() != indices.len() {
                return Err(Error::argument(format!(
                    "uvs.indices: {} corners, but indices has {}",
                    uv_indices.len(),
                    indices.len()
                )));
            }
            check_indices("uvs.indices", uv_indices, "uv", uvs.u.len())?;
        }
        None if uvs.u.len() != indices.len() => {
            return Err(Error::argument(format!(
                "uvs.u: {} values, but there are {} corners (uvs.indices is absent)",
                uvs.u.len(),
                indices.len()
            )));
        }
        None => {}
    }
    Ok(move |corner: usize| {
        let i = uvs.indices.map_or(corner, |indices| indices[corner] as usize);
        let v = uvs.v.map_or_else(|| uvs.u.get(i, 1), |v| v.get(i, 0));
        [uvs.u.get(i, 0) as f32, v as f32]
    })
}

fn check_indices(name: &str, indices: &[u32], what: &str, count: usize) -> Result<()> {
    match indices.iter().position(|&i| i as usize >= count) {
        Some(at) => Err(Error::argument(format!(
            "{name}[{at}]: {what} {} is out of range, there are {count}",
            indices[at]
        ))),
        None => Ok(()),
    }
}

/// The UDIM tile that holds a face's UV centroid, and that tile's lower corner.
fn tile_of(polygon: &[[f32; 2]]) -> Option<(u32, DVec2)> {
    let centre =
        |axis: usize| polygon.iter().map(|uv| f64::from(uv[axis])).sum::<f64>() / polygon.len() as f64;
    let (u, v) = (centre(0).floor(), centre(1).floor());
    // UDIM tiles have ten columns; 900 rows are more than any pipeline uses.
    ((0.0..10.0).contains(&u) && (0.0..900.0).contains(&v))
        .then(|| (1001 + u as u32 + 10 * v as u32, DVec2::new(u, v)))
}

/// Numbers UV corners: the same rest position with the same UV is the same corner, whatever indices a host uses.
/// (Game meshes split vertices along hard edges: that must not cut a chart.)
#[derive(Default)]
struct Weld(HashMap<([u64; 3], [u32; 2]), u32>);

impl Weld {
    fn id(&mut self, position: &[f64; 3], uv: &[f32; 2]) -> u32 {
        // + 0.0 makes -0.0 and 0.0 the same.
        let key = (position.map(|x| (x + 0.0).to_bits()), uv.map(|x| (x + 0.0).to_bits()));
        let next = self.0.len() as u32;
        *self.0.entry(key).or_insert(next)
    }
}

#[cfg(test)]
mod tests;
