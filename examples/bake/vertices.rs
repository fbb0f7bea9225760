//! One value per vertex, from a text file or from an OBJ's vertex colours.

use std::path::Path;

use crate::failure::{Failure, Result, read};
use crate::image_file::luminance;
use crate::maps::Map;
use crate::mesh::Triangle;

/// Reads `count` values.
pub fn load(path: &Path, count: usize) -> Result<Vec<f32>> {
    let bytes = read(path)?;
    let text = String::from_utf8_lossy(&bytes);
    let is_obj = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("obj"));
    let values = if is_obj { colours(&text) } else { numbers(&text) };
    let values = values.map_err(|reason| Failure::file(path, reason))?;
    if values.len() != count {
        let reason = format!("{} values, but the rest mesh has {count} vertices", values.len());
        return Err(Failure::file(path, reason));
    }
    Ok(values)
}

/// One number per line; what follows a '#' is a comment.
fn numbers(text: &str) -> std::result::Result<Vec<f32>, String> {
    let mut values = Vec::new();
    for (line, text) in text.lines().enumerate() {
        let text = text.split('#').next().unwrap_or_default().trim();
        if !text.is_empty() {
            values.push(finite(text).ok_or_else(|| format!("line {}: '{text}' is not a number", line + 1))?);
        }
    }
    Ok(values)
}

/// The luminance of each vertex's colour. The crate that reads the mesh skips colours, and those that keep them change the
/// vertices' order, so that these lines, six numbers after a `v`, are read here.
fn colours(text: &str) -> std::result::Result<Vec<f32>, String> {
    let mut values = Vec::new();
    for (line, text) in text.lines().enumerate() {
        let mut words = text.split_whitespace();
        if words.next() != Some("v") {
            continue;
        }
        let colour: Option<Vec<f32>> = words.skip(3).map_while(|word| Some(finite(word))).collect();
        match colour.as_deref() {
            Some(&[r, g, b]) => values.push(luminance([r, g, b])),
            _ => return Err(format!("line {}: the vertex has no colour (v x y z r g b)", line + 1)),
        }
    }
    Ok(values)
}

fn finite(word: &str) -> Option<f32> {
    word.parse().ok().filter(|x: &f32| x.is_finite())
}

/// Texels on a side of a map that shows values per vertex.
const SIZE: u32 = 1024;
/// Texels by which charts are continued on it.
const MARGIN: usize = 6;

/// A map of a tile that shows values per vertex, for the sheet.
pub fn rasterised(values: &[f32], triangles: &[Triangle], udim: u32) -> Map {
    let side = SIZE as usize;
    let mut texels = vec![None; side * side];
    for t in triangles.iter().filter(|t| t.udim == udim) {
        // In texels, the first row at the top.
        let corners = t.uvs.map(|[u, v]| [u * side as f64 - 0.5, (1.0 - v) * side as f64 - 0.5]);
        let [a, b, c] = corners;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            continue;
        }
        let range = |axis: usize| {
            let of = corners.map(|corner| corner[axis]);
            let low = of.iter().copied().fold(f64::INFINITY, f64::min).ceil().max(0.0);
            let high = of.iter().copied().fold(f64::NEG_INFINITY, f64::max).floor().min(side as f64 - 1.0);
            low as usize..(high + 1.0).max(0.0) as usize
        };
        for y in range(1) {
            for x in range(0) {
                let (x, y) = (x as f64, y as f64);
                let wb = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area;
                let wc = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area;
                let weights = [1.0 - wb - wc, wb, wc];
                if weights.iter().all(|&w| w >= -1e-9) {
                    let value: f64 =
                        (0..3).map(|k| weights[k] * f64::from(values[t.vertices[k] as usize])).sum();
                    let byte = (value.clamp(0.0, 1.0) * 255.0).round() as u8;
                    texels[y as usize * side + x as usize] = Some(byte);
                }
            }
        }
    }
    // Charts go on beyond their borders, so that lookups there see no gap.
    for _ in 0..MARGIN {
        let inside = texels.clone();
        for k in (0..side * side).filter(|&k| inside[k].is_none()) {
            let (x, y) = (k % side, k / side);
            let beside = [
                (x > 0).then(|| k - 1),
                (x + 1 < side).then(|| k + 1),
                (y > 0).then(|| k - side),
                (y + 1 < side).then(|| k + side),
            ];
            texels[k] = beside.into_iter().flatten().find_map(|k| inside[k]);
        }
    }
    let bytes = texels.into_iter().map(Option::unwrap_or_default).collect();
    Map::from_bytes(SIZE, SIZE, bytes, "vertices")
}
