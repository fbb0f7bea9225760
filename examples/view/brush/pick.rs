//! The point of the surface under the mouse.

use crate::draw::camera::Camera;
use crate::model::{Model, cross, minus, unit};

/// A point of the surface.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    pub triangle: usize,
    pub position: [f32; 3],
    pub normal: [f32; 3],
    /// Distance from the viewer, along the direction of view.
    pub depth: f32,
}

/// The vertices of a pose on the picture: computed once per pose and camera, since the mouse moves more often.
pub struct Projected {
    points: Vec<[f32; 3]>,
}

/// Behind the viewer.
const BEHIND: [f32; 3] = [f32::NAN; 3];

impl Projected {
    pub fn new(camera: &Camera, positions: &[[f32; 3]]) -> Projected {
        Projected { points: positions.iter().map(|&p| camera.project(p).unwrap_or(BEHIND)).collect() }
    }

    /// True if nothing lies before a point of the surface.
    pub fn shows(&self, model: &Model, positions: &[[f32; 3]], camera: &Camera, hit: &Hit) -> bool {
        camera.project(hit.position).is_some_and(|[x, y, depth]| {
            let first = self.pick(model, positions, [x, y]);
            first.is_none_or(|first| first.depth > depth - 0.01 * model.radius)
        })
    }

    /// The nearest point of the surface at a place on the picture, in units of its width and height.
    pub fn pick(&self, model: &Model, positions: &[[f32; 3]], at: [f32; 2]) -> Option<Hit> {
        let mut best: Option<(usize, [f32; 3], f32)> = None;
        for (k, triangle) in model.triangles.iter().enumerate() {
            let [a, b, c] = triangle.vertices.map(|v| self.points[v as usize]);
            let outside = |c0: f32, c1: f32, c2: f32, x: f32| {
                (c0 < x && c1 < x && c2 < x) || (c0 > x && c1 > x && c2 > x)
            };
            if outside(a[0], b[0], c[0], at[0]) || outside(a[1], b[1], c[1], at[1]) {
                continue;
            }
            let side =
                |p: [f32; 3], q: [f32; 3]| (q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0]);
            let w = [side(b, c), side(c, a), side(a, b)];
            let sum: f32 = w.iter().sum();
            // With a vertex behind the viewer this is no number.
            if !(w.map(|w| w * sum).iter().all(|&w| w >= 0.0) && sum != 0.0) {
                continue;
            }
            // Weights on the picture become weights in space.
            let w = [w[0] / (sum * a[2]), w[1] / (sum * b[2]), w[2] / (sum * c[2])];
            let depth = 1.0 / w.iter().sum::<f32>();
            if best.is_none_or(|(_, _, nearest)| depth < nearest) {
                best = Some((k, w.map(|w| w * depth), depth));
            }
        }
        let (triangle, w, depth) = best?;
        let [a, b, c] = model.triangles[triangle].vertices.map(|v| positions[v as usize]);
        let position = [0, 1, 2].map(|k| w[0] * a[k] + w[1] * b[k] + w[2] * c[k]);
        Some(Hit { triangle, position, normal: unit(cross(minus(b, a), minus(c, a))), depth })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::draw::camera::Orbit;
    use crate::model::{dot, length, plus};

    #[test]
    fn the_nearest_of_two_sides_is_picked() {
        let model = Model::scene("mug_to_jug");
        let rest = &model.rest;
        let camera = Orbit::of(rest, model.centre, model.radius).camera(1.3);
        let projected = Projected::new(&camera, rest);
        let hit = projected.pick(&model, rest, [0.5, 0.55]).expect("the mug is in the middle");
        let [x, y, depth] = camera.project(hit.position).expect("before the viewer");
        assert!((x - 0.5).abs() < 1e-3 && (y - 0.55).abs() < 1e-3, "{x} {y}");
        assert!((depth - hit.depth).abs() < 1e-3 * depth);
        let other = |hit: Hit| Hit { position: plus(hit.position, camera.forward, model.radius), ..hit };
        let shows = |hit| projected.shows(&model, rest, &camera, &hit);
        assert!(shows(hit) && !shows(other(hit)), "a point behind the surface");
        // The other side of the mug lies farther away than its middle.
        let middle = dot(minus(model.centre, camera.eye), camera.forward);
        assert!(hit.depth < middle && length(minus(hit.position, model.centre)) < 1.1 * model.radius);
        assert!(projected.pick(&model, rest, [0.01, 0.01]).is_none(), "nothing is in the corner");
    }
}
