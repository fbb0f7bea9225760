//! The faces of one UV set: their tiles, and their triangles.

use glam::DVec2;

use super::charts::Seams;
use super::source::MeshSource;
use super::triangle::{is_degenerate, triangulate};
use super::{Corner, NONE, RawTriangle, check};
use crate::allocation::{Vec, zeroed};
use crate::report::AssetInfo;

/// One UV set.
pub(super) struct UvSet {
    /// Their tiles are UDIM numbers until the tiles are built.
    pub corners: Vec<Corner>,
    /// The UDIM tiles that have triangles, in the order of their numbers.
    pub tiles: Vec<(u32, Vec<RawTriangle>)>,
}

/// Reads a UV set of a checked mesh, whose corners have the UVs `uv_of`. Faces are counted for the first set only,
/// properties of UVs for every set.
pub(super) fn read(
    source: &MeshSource,
    uv_of: &dyn Fn(usize) -> Option<[f32; 2]>,
    uv_set: u32,
    info: &mut AssetInfo,
) -> UvSet {
    let textured = source.textured_faces.map(|chosen| {
        let mut textured = zeroed(check::faces(source).count());
        chosen.iter().for_each(|&face| textured[face as usize] = true);
        textured
    });
    let mut corners = Vec::with_capacity(source.indices.len());
    let mut tiles: Vec<(u32, Vec<RawTriangle>)> = Vec::new();
    for (f, face) in check::faces(source).enumerate() {
        let uv = |c: usize| uv_of(c).unwrap_or_default();
        let corner = |tile: u32| move |c: usize| Corner { tile, triangle: NONE, uv: uv(c), given: uv(c) };
        let is_face = face.len() >= 3;
        if uv_set == 0 {
            info.faces += 1;
            info.faces_skipped += u64::from(!is_face);
        }
        // Faces without corners must not be looked up: at the end of the mesh, their first corner would be out of
        // range.
        let has_texture = is_face && textured.as_ref().is_none_or(|t| t[f]) && uv_of(face.start).is_some();
        if !has_texture {
            info.faces_untextured += u64::from(is_face);
            corners.extend(face.map(corner(NONE)));
            continue;
        }
        let polygon: Vec<[f32; 2]> = face.clone().map(uv).collect();
        let Some((udim, origin)) = tile_of(&polygon) else {
            info.faces_outside += 1;
            corners.extend(face.map(corner(NONE)));
            continue;
        };
        let local: Vec<DVec2> = polygon.iter().map(|uv| DVec2::from(uv.map(f64::from)) - origin).collect();
        if local.iter().any(|uv| uv.to_array().iter().any(|x| !(0.0..=1.0).contains(x))) {
            info.clipped_faces += 1;
        }
        corners.extend(face.clone().map(corner(udim)));
        let at = tiles.binary_search_by_key(&udim, |tile| tile.0).unwrap_or_else(|at| {
            tiles.insert(at, (udim, Vec::new()));
            at
        });
        let triangles = &mut tiles[at].1;
        for [a, b, c] in triangulate(&local) {
            if is_degenerate([local[a], local[b], local[c]]) {
                info.degenerate_triangles += 1;
                continue;
            }
            triangles.push(RawTriangle {
                corners: [a, b, c].map(|k| (face.start + k) as u32),
                vertices: [a, b, c].map(|k| source.indices[face.start + k]),
                uv: [a, b, c].map(|k| local[k]),
            });
        }
    }
    tiles.retain(|(_, triangles)| !triangles.is_empty());
    UvSet { corners, tiles }
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

/// The edges of a checked mesh, as its faces have them.
pub(super) fn edges(source: &MeshSource) -> impl Iterator<Item = [u32; 2]> {
    let indices = source.indices;
    check::faces(source).filter(|face| face.len() >= 3).flat_map(move |face| {
        let next = move |c: usize| if c + 1 == face.end { face.start } else { c + 1 };
        (face.start..face.end).map(move |c| [indices[c], indices[next(c)]])
    })
}

/// The host's seams, as sorted pairs. Pairs that are not an edge of any face are left out and counted: a host that
/// reads seams from a file, or from before an edit, loses only these.
pub(super) fn seams(source: &MeshSource, info: &mut AssetInfo) -> Seams {
    let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
    let mut seams: Seams = source.seams.iter().copied().map(sorted).collect();
    if seams.is_empty() {
        return seams;
    }
    seams.sort_unstable();
    seams.dedup();
    let mut used = zeroed(seams.len());
    for edge in edges(source) {
        if let Ok(at) = seams.binary_search(&sorted(edge)) {
            used[at] = true;
        }
    }
    info.seams_unused = used.iter().filter(|used| !**used).count() as u64;
    let mut used = used.into_iter();
    seams.retain(|_| used.next() == Some(true));
    seams
}
