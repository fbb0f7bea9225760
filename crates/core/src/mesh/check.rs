//! The validation of a host's arrays, and the range of corners of each face.

use std::ops::Range;

use crate::error::{Error, Result};

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
    let faces = check_faces(source)?;
    check_indices("indices", indices, "vertex", positions.len())?;
    check_uvs(source, &source.uvs, "uvs")?;
    for (k, uvs) in source.uv_sets.iter().enumerate() {
        check_uvs(source, uvs, &format!("uv_sets[{k}]"))?;
    }
    for (k, &[a, b]) in source.seams.iter().enumerate() {
        let vertices = positions.len();
        if let Some(v) = [a, b].into_iter().find(|&v| v as usize >= vertices) {
            let message = format!("seams[{k}]: vertex {v} is out of range, there are {vertices}");
            return Err(Error::argument(message));
        }
        if a == b {
            return Err(Error::argument(format!("seams[{k}]: both vertices are {a}")));
        }
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
            if sum != corners as u64 {
                return Err(Error::argument(format!(
                    "face_counts: they add up to {sum} corners, but indices has {corners}"
                )));
            }
            Ok(counts.len())
        }
        (None, Some(offsets)) => {
            if offsets.first() != Some(&0) {
                return Err(Error::argument("face_offsets[0]: the first face begins at corner 0"));
            }
            if let Some(k) = offsets.windows(2).position(|w| w[1] < w[0]) {
                let [before, now] = [offsets[k], offsets[k + 1]];
                return Err(Error::argument(format!("face_offsets[{}]: {now} after {before}", k + 1)));
            }
            let last = offsets.len() - 1;
            if offsets[last] as usize != corners {
                return Err(Error::argument(format!(
                    "face_offsets[{last}]: the last one is {}, but indices has {corners} corners",
                    offsets[last]
                )));
            }
            Ok(last)
        }
        (None, None) if !corners.is_multiple_of(3) => Err(Error::argument(format!(
            "indices: {corners} corners are no whole number of triangles (face_counts is absent)"
        ))),
        (None, None) => Ok(corners / 3),
    }
}

/// Checks a UV set, which messages call `name`.
fn check_uvs(source: &MeshSource, uvs: &UvSource, name: &str) -> Result<()> {
    let corners = source.indices.len();
    match uvs.v {
        Some(v) if v.len() != uvs.u.len() => {
            return Err(Error::argument(format!(
                "{name}.v: {} values, but {name}.u has {}",
                v.len(),
                uvs.u.len()
            )));
        }
        None if uvs.u.components() != 2 => {
            return Err(Error::argument(format!(
                "{name}.u: two components are needed where {name}.v is absent"
            )));
        }
        _ => {}
    }
    uvs.u.check_f32(&format!("{name}.u"))?;
    if let Some(v) = uvs.v {
        v.check_f32(&format!("{name}.v"))?;
    }
    let Some(indices) = uvs.indices else {
        if uvs.u.len() != corners {
            return Err(Error::argument(format!(
                "{name}.u: {} values, but there are {corners} corners ({name}.indices is absent)",
                uvs.u.len()
            )));
        }
        return Ok(());
    };
    if indices.len() != corners {
        return Err(Error::argument(format!(
            "{name}.indices: {} corners, but indices has {corners}",
            indices.len()
        )));
    }
    let count = uvs.u.len();
    if let Some(at) = indices.iter().position(|&i| i as usize >= count && i != NO_UV) {
        return Err(Error::argument(format!(
            "{name}.indices[{at}]: uv {} is out of range, there are {count}",
            indices[at]
        )));
    }
    for face in faces(source).filter(|face| face.len() >= 3) {
        let absent = |&c: &usize| indices[c] == NO_UV;
        if let Some(at) = face.clone().find(absent)
            && !face.clone().all(|c| absent(&c))
        {
            return Err(Error::argument(format!(
                "{name}.indices[{at}]: no UV (2^32 - 1), but other corners of the face have one"
            )));
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
    match indices.iter().position(|&i| i as usize >= count) {
        Some(at) => Err(Error::argument(format!(
            "{name}[{at}]: {what} {} is out of range, there are {count}",
            indices[at]
        ))),
        None => Ok(()),
    }
}
