//! The point of the surface under the mouse.

use glam::Vec3;

use crate::draw::camera::Camera;
use crate::model::Model;

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub triangle: usize,
    /// Weights of the triangle's corners.
    pub weights: [f32; 3],
    pub position: Vec3,
    pub normal: Vec3,
}

impl Hit {
    /// A point in a pose.
    pub fn new(model: &Model, positions: &[[f32; 3]], (triangle, weights): (usize, [f32; 3])) -> Hit {
        let corners = model.surface.corners(triangle, positions);
        let [a, b, c] = corners.map(Vec3::from);
        let normal = (b - a).cross(c - a).normalize_or(Vec3::Z);
        Hit { triangle, weights, position: vrtm_paint::mixed(corners, weights).into(), normal }
    }

    /// The nearest point of the surface at a place on the picture, in units of its width and height.
    pub fn pick(model: &Model, positions: &[[f32; 3]], camera: &Camera, at: [f32; 2]) -> Option<Hit> {
        let found = model.surface.hit(positions, camera.ray(at))?;
        Some(Hit::new(model, positions, found))
    }

    /// True if nothing lies before it.
    pub fn shows(&self, model: &Model, positions: &[[f32; 3]], camera: &Camera) -> bool {
        camera.project(self.position).is_some_and(|[x, y, _]| {
            let away = |hit: &Hit| hit.position.distance(camera.eye);
            let first = Hit::pick(model, positions, camera, [x, y]);
            first.is_none_or(|first| away(&first) > away(self) - 0.01 * model.radius)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::camera::Orbit;

    #[test]
    fn the_nearest_of_two_sides_is_picked() {
        let model = Model::scene("mug_to_jug");
        let rest = &model.rest;
        let camera = Orbit::of(rest, model.centre, model.radius).camera(1.3);
        let pick = |at| Hit::pick(&model, rest, &camera, at);
        let hit = pick([0.5, 0.55]).expect("the mug is in the middle");
        let [x, y, depth] = camera.project(hit.position).expect("before the viewer");
        assert!((x - 0.5).abs() < 1e-3 && (y - 0.55).abs() < 1e-3, "{x} {y}");
        let behind = Hit { position: hit.position + model.radius * camera.forward, ..hit };
        assert!(hit.shows(&model, rest, &camera) && !behind.shows(&model, rest, &camera));
        // The other side of the mug lies farther away than its middle.
        let middle = (model.centre - camera.eye).dot(camera.forward);
        assert!(depth < middle && hit.position.distance(model.centre) < 1.1 * model.radius);
        assert!(pick([0.01, 0.01]).is_none(), "nothing is in the corner");
    }
}
