//! The other side of a mesh that is symmetric at rest.

use glam::Vec3;
use vrtm_paint::{closest, mixed};

use super::pick::Hit;
use crate::model::Model;

/// The plane across x at rest: that through the origin, unless the mesh lies beside it.
pub fn plane(model: &Model) -> f32 {
    let low = model.rest.iter().map(|p| p[0]).fold(f32::MAX, f32::min);
    let high = model.rest.iter().map(|p| p[0]).fold(f32::MIN, f32::max);
    let middle = 0.5 * (low + high);
    if middle.abs() <= 0.1 * (high - low) { 0.0 } else { middle }
}

/// The point of the surface opposite to another one, if it lies within `reach` of the mirrored place at rest.
pub fn opposite(model: &Model, positions: &[[f32; 3]], hit: &Hit, plane: f32, reach: f32) -> Option<Hit> {
    let [x, y, z] = mixed(model.surface.corners(hit.triangle, &model.rest), hit.weights);
    let place = [2.0 * plane - x, y, z];
    let (mut best, mut nearest) = (None, reach);
    for k in 0..model.triangles.len() {
        let at = model.surface.corners(k, &model.rest);
        // All of the triangle lies farther away.
        let beyond = |c: usize| {
            at.iter().all(|p| p[c] > place[c] + nearest) || at.iter().all(|p| p[c] < place[c] - nearest)
        };
        if (0..3).any(beyond) {
            continue;
        }
        let w = closest(place, at);
        let distance = Vec3::from(mixed(at, w)).distance(place.into());
        if distance <= nearest {
            (best, nearest) = (Some((k, w)), distance);
        }
    }
    Some(Hit::new(model, positions, best?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_opposite_point_is_that_of_the_mirrored_place_at_rest() {
        let model = Model::scene("squash");
        let x = plane(&model);
        // In another pose, in which everything lies elsewhere.
        let pose: Vec<_> = model.rest.iter().map(|p| [3.0 * p[0] + 7.0, p[1] + p[0], p[2]]).collect();
        let posed = |p: [f32; 3]| [3.0 * p[0] + 7.0, p[1] + p[0], p[2]];
        let triangle = 5;
        let corners = model.triangles[triangle].vertices.map(|v| model.rest[v as usize]);
        let at: [f32; 3] = [0, 1, 2].map(|c| corners.iter().map(|p| p[c]).sum::<f32>() / 3.0);
        let hit = Hit::new(&model, &pose, (triangle, [1.0 / 3.0; 3]));
        let found = opposite(&model, &pose, &hit, x, 0.1 * model.radius).expect("the sheet is symmetric");
        let expected = posed([2.0 * x - at[0], at[1], at[2]]);
        assert!(found.position.distance(expected.into()) < 1e-4 * model.radius, "{found:?} {expected:?}");
        assert!(opposite(&model, &pose, &hit, x + 9.0 * model.radius, 0.1 * model.radius).is_none());
    }
}
