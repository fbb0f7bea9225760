//! The validation of a host's arrays, and the range of corners of each face.

use std::ops::Range;

use crate::error::{Error, Result, ensure};

use super::NONE;
use super::source::{MeshSource, UvSource};

/// The index that marks a missing UV.
const NO_UV: u32 = u32::MAX;

/// The corners of each face. The arrays have been checked.
#[expect(clippy::disallowed_methods, reason = "of constant size")]
pub(super) fn faces<'a>(source: &MeshSource<'a>) -> Box<dyn Iterator<Item = Range<usize>> + 'a> {
    match (source.face_counts, source.face_offsets) {
        (Some(counts), _) => {
            let mut end = 0;
            Box::new(counts.iter().map(move |&n| {
                end += n as usize;
                end - n as usize..end
            }))
        }
        (None, Some(offsets)) => Box::new(offsets.windows(2).map(|w| w[0] as usize..w[1] as usize)),
        (None, None) => Box::new((0..source.indices.len() / 3).map(|f| 3 * f..3 * f + 3)),
    }
}

/// Validates all arrays.
pub(super) fn check(source: &MeshSource) -> Result<()> {
    let MeshSource { positions, indices, .. } = *source;
    ensure!(positions.components() == 3, "positions: three components are needed");
    ensure!(!positions.is_empty() && !indices.is_empty(), "positions, indices: the mesh is empty");
    let most = positions.len().max(indices.len());
    ensure!(most < NONE as usize, "positions, indices: more than 2^32 - 2 elements");
    positions.check_finite("positions")?;
    let faces = check_faces(source)?;
    check_indices("indices", indices, "vertex", positions.len())?;
    check_uvs(source, &source.uvs, "uvs")?;
    for (k, uvs) in source.uv_sets.iter().enumerate() {
        check_uvs(source, uvs, &format!("uv_sets[{k}]"))?;
    }
    for (k, &[a, b]) in source.seams.iter().enumerate() {
        let vertices = positions.len();
        for v in [a, b] {
            let is_there = (v as usize) < vertices;
            ensure!(is_there, "seams[{k}]: vertex {v} is out of range, there are {vertices}");
        }
        ensure!(a != b, "seams[{k}]: both vertices are {a}");
    }
    if let Some(chosen) = source.textured_faces {
        check_indices("textured_faces", chosen, "face", faces)?;
    }
    source.weld.check()
}

/// Returns the number of faces.
fn check_faces(source: &MeshSource) -> Result<usize> {
    let corners = source.indices.len();
    match (source.face_counts, source.face_offsets) {
        (Some(_), Some(_)) => {
            Err(Error::argument("face_offsets: face_counts is given, so this one must be absent"))
        }
        (Some(counts), None) => {
            let sum: u64 = counts.iter().map(|&n| u64::from(n)).sum();
            let all = corners as u64;
            ensure!(sum == all, "face_counts: they add up to {sum} corners, but indices has {corners}");
            Ok(counts.len())
        }
        (None, Some(offsets)) => {
            ensure!(offsets.first() == Some(&0), "face_offsets[0]: the first face begins at corner 0");
            if let Some(k) = offsets.windows(2).position(|w| w[1] < w[0]) {
                let [before, now] = [offsets[k], offsets[k + 1]];
                return Err(Error::argument(format!("face_offsets[{}]: {now} after {before}", k + 1)));
            }
            let (last, end) = (offsets.len() - 1, offsets[offsets.len() - 1]);
            ensure!(
                end as usize == corners,
                "face_offsets[{last}]: the last one is {end}, but indices has {corners} corners"
            );
            Ok(last)
        }
        (None, None) => {
            ensure!(
                corners.is_multiple_of(3),
                "indices: {corners} corners are no whole number of triangles (face_counts is absent)"
            );
            Ok(corners / 3)
        }
    }
}

/// Checks a UV set, which messages call `name`.
fn check_uvs(source: &MeshSource, uvs: &UvSource, name: &str) -> Result<()> {
    let (corners, count) = (source.indices.len(), uvs.u.len());
    let (of_v, has_pairs) = (uvs.v.map_or(count, |v| v.len()), uvs.u.components() == 2);
    ensure!(of_v == count, "{name}.v: {of_v} values, but {name}.u has {count}");
    ensure!(uvs.v.is_some() || has_pairs, "{name}.u: two components are needed where {name}.v is absent");
    uvs.u.check_f32(&format!("{name}.u"))?;
    if let Some(v) = uvs.v {
        v.check_f32(&format!("{name}.v"))?;
    }
    let Some(indices) = uvs.indices else {
        ensure!(
            count == corners,
            "{name}.u: {count} values, but there are {corners} corners ({name}.indices is absent)"
        );
        return Ok(());
    };
    let given = indices.len();
    ensure!(given == corners, "{name}.indices: {given} corners, but indices has {corners}");
    for (at, &i) in indices.iter().enumerate() {
        let is_there = (i as usize) < count || i == NO_UV;
        ensure!(is_there, "{name}.indices[{at}]: uv {i} is out of range, there are {count}");
    }
    for face in faces(source).filter(|face| face.len() >= 3) {
        let absent = |&c: &usize| indices[c] == NO_UV;
        if let Some(at) = face.clone().find(absent) {
            ensure!(
                face.clone().all(|c| absent(&c)),
                "{name}.indices[{at}]: no UV (2^32 - 1), but other corners of the face have one"
            );
        }
    }
    Ok(())
}

/// Returns the function from a face corner to its UV, for a checked set.
pub(super) fn corner_uv<'a>(uvs: &UvSource<'a>) -> impl Fn(usize) -> Option<[f32; 2]> + use<'a> {
    let uvs = *uvs;
    move |corner: usize| {
        let i = uvs.indices.map_or(corner, |indices| indices[corner] as usize);
        if uvs.indices.is_some() && i == NO_UV as usize {
            return None;
        }
        let v = uvs.v.map_or_else(|| uvs.u.get(i, 1), |v| v.get(i, 0));
        Some([uvs.u.get(i, 0) as f32, v as f32])
    }
}

fn check_indices(name: &str, indices: &[u32], what: &str, count: usize) -> Result<()> {
    for (at, &i) in indices.iter().enumerate() {
        ensure!((i as usize) < count, "{name}[{at}]: {what} {i} is out of range, there are {count}");
    }
    Ok(())
}
