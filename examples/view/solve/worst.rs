//! The features that a result has left worse than without the warp, as rings on the surface.

use std::ops::Range;

use glam::Vec3;

use super::answer::{Answer, Maps};
use crate::brush::pick::Hit;

use crate::mesh::Triangle;
use crate::model::Model;

/// Radius of a ring, in radii of a disc with the feature's area.
const WIDE: f32 = 1.8;

/// Centres and radii of the rings where the features are seen by the original UVs, and where they are through the
/// redirection.
pub fn rings(model: &Model, answer: &Answer) -> [Vec<(Hit, f32)>; 2] {
    let original = Maps::identity();
    let of = |redirected: bool| {
        let tiles = model.tiles.iter().zip(&answer.tiles);
        let rings = tiles.flat_map(|(tile, solved)| {
            let maps = if redirected { &solved.maps } else { &original };
            let worst = solved.report.strain.as_ref().map_or(&[][..], |strain| strain.worst());
            worst.iter().filter_map(|feature| {
                let uv = maps.warped(feature.uv.map(|x| x - x.floor()));
                ring(&model.triangles, tile.range.clone(), &answer.positions, uv, feature.area)
            })
        });
        rings.collect()
    };
    [of(false), of(true)]
}

/// The ring around a part of this area of the UV plane, at the UV's place on one of these triangles.
fn ring(
    triangles: &[Triangle],
    mut these: Range<usize>,
    positions: &[[f32; 3]],
    uv: [f32; 2],
    area: f32,
) -> Option<(Hit, f32)> {
    these.find_map(|triangle| {
        let Triangle { uvs, vertices, .. } = triangles[triangle];
        let [a, b, c] = uvs.map(|of| [0, 1].map(|k| of[k] as f32 - uv[k]));
        let side = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let weights = [side(b, c), side(c, a), side(a, b)];
        let sum: f32 = weights.iter().sum();
        if sum == 0.0 || weights.iter().any(|weight| weight * sum < 0.0) {
            return None;
        }
        let corners = vertices.map(|v| positions[v as usize]);
        let [a, b, c] = corners.map(Vec3::from);
        let weights = weights.map(|weight| weight / sum);
        let position = vrtm_paint::mixed(corners, weights).into();
        let normal = (b - a).cross(c - a);
        let radius = WIDE * (area * normal.length() / sum.abs() / std::f32::consts::PI).sqrt();
        Some((Hit { triangle, weights, position, normal: normal.normalize_or(Vec3::Z) }, radius))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ring_lies_around_its_feature_in_the_pose() {
        let triangle = |vertices: [u32; 3], uvs| Triangle { vertices, uvs, corners: [0; 3], udim: 1001 };
        let (low, high) = ([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]], [[0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]);
        let triangles = [triangle([0, 1, 2], low), triangle([1, 3, 2], high)];
        // Eight times as long as in the plane along u, twice along v.
        let positions = [[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 1.0, 1.0], [4.0, 1.0, 1.0]];
        let find = |uv| ring(&triangles, 0..2, &positions, uv, 0.01);
        let (hit, radius) = find([0.4, 0.4]).expect("it is inside");
        assert_eq!((hit.triangle, hit.normal), (1, Vec3::Z));
        assert!(hit.position.distance(Vec3::new(3.2, 0.8, 1.0)) < 1e-5, "{:?}", hit.position);
        let disc = std::f32::consts::PI * (radius / WIDE).powi(2);
        assert!((disc - 0.16).abs() < 1e-5, "{disc}");
        assert!(find([0.6, 0.4]).is_none());
    }
}
