//! Which way is out: parts of a mesh may be wound one way and others the other, as those of mirrored charts.

use std::collections::HashMap;

use crate::mesh::Triangle;
use crate::model::{cross, dot, length, minus, plus, unit};

/// The area vector of each triangle, out of what hangs together: triangles that share an edge look to the same side
/// of the surface, and that side is out whose volume is positive. An open sheet keeps the side of its first triangle.
fn areas(triangles: &[Triangle], positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let corners = |t: usize| triangles[t].vertices.map(|v| positions[v as usize]);
    let edges = |t: usize| {
        let [a, b, c] = triangles[t].vertices;
        [[a, b], [b, c], [c, a]]
    };
    // The triangles at an edge, and whether each goes along it from its lesser vertex.
    let mut at: HashMap<[u32; 2], Vec<(usize, bool)>> = HashMap::new();
    let key = |[a, b]: [u32; 2]| ([a.min(b), a.max(b)], a < b);
    for t in 0..triangles.len() {
        for (edge, along) in edges(t).map(key) {
            at.entry(edge).or_default().push((t, along));
        }
    }
    let mut sign: Vec<f32> = vec![0.0; triangles.len()];
    let area = |t: usize| {
        let [a, b, c] = corners(t);
        cross(minus(b, a), minus(c, a))
    };
    for first in 0..triangles.len() {
        if sign[first] != 0.0 {
            continue;
        }
        sign[first] = 1.0;
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&t) = part.get(next) {
            next += 1;
            for (edge, along) in edges(t).map(key) {
                // Where three sheets meet there is no side.
                let [a, b] = at[&edge][..] else { continue };
                let (other, with) = if a.0 == t { b } else { a };
                if sign[other] == 0.0 {
                    sign[other] = if with == along { -sign[t] } else { sign[t] };
                    part.push(other);
                }
            }
        }
        let weight = 1.0 / (3 * part.len()) as f32;
        let middle = part.iter().flat_map(|&t| corners(t)).fold([0.0; 3], |sum, p| plus(sum, p, weight));
        let (mut volume, mut bound) = (0.0, 0.0);
        for &t in &part {
            let way = minus(corners(t)[0], middle);
            volume += sign[t] * dot(area(t), way);
            bound += length(area(t)) * length(way);
        }
        if volume < -1e-3 * bound {
            part.iter().for_each(|&t| sign[t] = -sign[t]);
        }
    }
    (0..triangles.len()).map(|t| area(t).map(|x| x * sign[t])).collect()
}

/// The normals of vertices, outward.
pub fn normals(triangles: &[Triangle], positions: &[[f32; 3]]) -> Vec<[f32; 3]> {
    let mut normals = vec![[0.0f32; 3]; positions.len()];
    for (triangle, area) in triangles.iter().zip(areas(triangles, positions)) {
        for v in triangle.vertices {
            normals[v as usize] = plus(normals[v as usize], area, 1.0);
        }
    }
    normals.into_iter().map(unit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_point_out_whatever_the_winding() {
        let corners = [[1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, 1.0, -1.0], [1.0, -1.0, -1.0]];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        for turned in 0..16 {
            let triangle = |(k, [a, b, c]): (usize, [u32; 3])| {
                let vertices = if turned >> k & 1 == 1 { [a, c, b] } else { [a, b, c] };
                Triangle { vertices, uvs: [[0.0; 2]; 3], corners: vertices, udim: 1001 }
            };
            let all: Vec<Triangle> = faces.into_iter().enumerate().map(triangle).collect();
            for (normal, corner) in normals(&all, &corners).iter().zip(corners) {
                assert!(dot(*normal, corner) > 1.0, "{turned}: {normal:?} at {corner:?}");
            }
        }
    }
}
