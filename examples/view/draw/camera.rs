//! A camera that orbits around a point of the mesh.

use bytemuck::{Pod, Zeroable};
use glam::camera::rh::proj::directx::perspective;
use glam::camera::rh::view::look_to_mat4;
use glam::{Mat4, Vec3};

/// Half of the angle of view from the bottom to the top of the picture.
const HALF: f32 = 14.0 * std::f32::consts::PI / 180.0;

/// The viewer's place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Degrees around the mesh, and upward.
    pub yaw: f32,
    pub pitch: f32,
    /// Distance in units in which the mesh just fits.
    pub zoom: f32,
    /// The point in the middle of the picture.
    pub target: Vec3,
    /// Radius of the mesh.
    pub radius: f32,
    /// True if z points up instead of y.
    pub z_up: bool,
}

/// A direction to look from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    Front,
    /// From the right of the picture that the front shows.
    Right,
    Top,
}

/// The part of a pane that the mesh fills.
const FILLED: f32 = 0.92;

/// The camera as numbers: what projects a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    pub eye: Vec3,
    pub right: Vec3,
    pub up: Vec3,
    pub forward: Vec3,
    /// To clip coordinates.
    pub clip: Mat4,
    near: f32,
    /// Width of the picture over its height.
    aspect: f32,
    /// Tangent of half of the angle from bottom to top.
    tangent: f32,
}

/// Uniforms of a draw call, in the layout of `surface.wgsl`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct View {
    pub clip: [[f32; 4]; 4],
    pub eye: [f32; 4],
    pub right: [f32; 4],
    pub up: [f32; 4],
    pub redirect: f32,
    pub shown: f32,
    pub lines: f32,
    pub line_width: f32,
    pub range: f32,
    pub overlay: f32,
    pub rest: [f32; 2],
}

impl Orbit {
    /// A flat sheet is viewed from the front, any other mesh from the front, left and above.
    pub fn of(positions: &[[f32; 3]], centre: Vec3, radius: f32) -> Orbit {
        let extent = |c: usize| {
            let values = positions.iter().map(|p| p[c]);
            values.clone().fold(f32::MIN, f32::max) - values.fold(f32::MAX, f32::min)
        };
        let flat = extent(2) < 0.02 * extent(0).max(extent(1));
        let (yaw, pitch) = if flat { (0.0, 0.0) } else { (-25.0, 14.0) };
        Orbit { yaw, pitch, zoom: 1.0, target: centre, radius, z_up: false }
    }

    /// Looks from a side.
    pub fn look_from(&mut self, side: Side) {
        (self.yaw, self.pitch) = match side {
            Side::Front => (0.0, 0.0),
            Side::Right => (90.0, 0.0),
            Side::Top => (0.0, 90.0),
        };
    }

    /// Comes as close as all of these points allow in a picture of this shape, with their outline in its middle.
    pub fn frame<'a>(&mut self, points: impl Iterator<Item = &'a [f32; 3]> + Clone, aspect: f32) {
        // The middle of the outline depends on the distance: several steps lead there.
        for _ in 0..16 {
            let camera = self.camera(aspect);
            // How far a point wants the viewer to be from the target.
            let wants = |&point: &[f32; 3]| {
                let way = Vec3::from(point) - self.target;
                let [x, y] = [way.dot(camera.right) / aspect, way.dot(camera.up)].map(f32::abs);
                let clear = (x.max(y) / (FILLED * camera.tangent)).max(0.05 * self.radius);
                clear - way.dot(camera.forward)
            };
            let distance = points.clone().map(wants).fold(0.0, f32::max);
            self.zoom = (self.zoom * distance / self.distance()).clamp(0.02, 8.0);
            let camera = self.camera(aspect);
            let (mut low, mut high) = ([f32::MAX; 2], [f32::MIN; 2]);
            for at in points.clone().filter_map(|&point| camera.project(point.into())) {
                low = [0, 1].map(|c| low[c].min(at[c]));
                high = [0, 1].map(|c| high[c].max(at[c]));
            }
            // What is near moves most: a step that is right for it overshoots nowhere.
            let depth = |point: &[f32; 3]| (Vec3::from(*point) - camera.eye).dot(camera.forward);
            let part = points.clone().map(depth).fold(distance, f32::min) / distance;
            let off = [0, 1].map(|c| part * (0.5 * (low[c] + high[c]) - 0.5));
            if off.iter().any(|x| !x.is_finite()) {
                return;
            }
            self.pan(&camera, [-off[0] * aspect, -off[1]]);
        }
    }

    /// Turns by a way of the mouse, in points.
    pub fn turn(&mut self, [x, y]: [f32; 2]) {
        self.yaw = (self.yaw - 0.4 * x) % 360.0;
        self.pitch = (self.pitch + 0.4 * y).clamp(-89.0, 89.0);
    }

    /// Comes closer, or goes away.
    pub fn dolly(&mut self, factor: f32) {
        self.zoom = (self.zoom / factor).clamp(0.02, 8.0);
    }

    /// Moves sideways by a part of the picture's height.
    pub fn pan(&mut self, camera: &Camera, [x, y]: [f32; 2]) {
        let height = 2.0 * camera.tangent * self.distance();
        self.target += height * (y * camera.up - x * camera.right);
    }

    fn distance(&self) -> f32 {
        1.06 * self.zoom * self.radius / HALF.sin()
    }

    /// The camera for a picture of this shape: the mesh fits in its narrower side.
    pub fn camera(&self, aspect: f32) -> Camera {
        let (ys, yc) = self.yaw.to_radians().sin_cos();
        let (ps, pc) = self.pitch.to_radians().sin_cos();
        let turned = |[x, y, z]: [f32; 3]| if self.z_up { [x, -z, y] } else { [x, y, z] }.into();
        let [right, up, toward]: [Vec3; 3] =
            [[yc, 0.0, -ys], [-ps * ys, pc, -ps * yc], [pc * ys, ps, pc * yc]].map(turned);
        let distance = self.distance();
        let tangent = HALF.tan() / aspect.min(1.0);
        let (eye, forward) = (self.target + distance * toward, -toward);
        let near = (distance - 2.5 * self.radius).max(0.01 * self.radius * self.zoom.min(1.0));
        let far = distance + 4.0 * self.radius;
        let clip = perspective(2.0 * tangent.atan(), aspect, near, far) * look_to_mat4(eye, forward, up);
        Camera { eye, right, up, forward, clip, near, aspect, tangent }
    }
}

impl Camera {
    /// A point on the picture, from its upper left corner in units of its width and height, and its depth; `None`
    /// behind the viewer.
    pub fn project(&self, point: Vec3) -> Option<[f32; 3]> {
        let at = self.clip * point.extend(1.0);
        (at.w > self.near).then(|| [0.5 + 0.5 * at.x / at.w, 0.5 - 0.5 * at.y / at.w, at.w])
    }

    /// The ray through a place on the picture, from where the picture begins.
    pub fn ray(&self, [x, y]: [f32; 2]) -> ([f32; 3], [f32; 3]) {
        let [x, y] = [(2.0 * x - 1.0) * self.tangent * self.aspect, (1.0 - 2.0 * y) * self.tangent];
        let way = self.forward + x * self.right + y * self.up;
        ((self.eye + self.near * way).into(), way.into())
    }

    /// The length of one height of the picture at a point.
    pub fn height(&self, point: Vec3) -> f32 {
        2.0 * self.tangent * (point - self.eye).dot(self.forward)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mesh_fills_the_pane_whatever_its_shape() {
        // Long in x, beside the point that is looked at.
        let points = [[0.0, 0.0, 0.0], [4.0, 0.5, 0.3], [4.0, -0.5, -0.3], [2.0, 0.2, 1.0]];
        for (aspect, side) in [(0.5, Side::Front), (1.3, Side::Front), (2.6, Side::Right), (1.0, Side::Top)] {
            let mut orbit = Orbit {
                yaw: 0.0,
                pitch: 0.0,
                zoom: 1.0,
                target: Vec3::new(1.0, 1.0, 0.0),
                radius: 4.0,
                z_up: false,
            };
            orbit.look_from(side);
            orbit.frame(points.iter(), aspect);
            let camera = orbit.camera(aspect);
            let at = points.map(|point| camera.project(point.into()).expect("before the viewer"));
            let end =
                |c: usize, pick: fn(f32, f32) -> f32| at.iter().map(|p| p[c]).reduce(pick).expect("points");
            let [low, high] = [[end(0, f32::min), end(1, f32::min)], [end(0, f32::max), end(1, f32::max)]];
            let size = (high[0] - low[0]).max(high[1] - low[1]);
            assert!((size - FILLED).abs() < 0.01, "{aspect} {side:?}: {size}");
            assert!(
                (0..2).all(|c| (low[c] + high[c] - 1.0).abs() < 0.01),
                "{aspect} {side:?}: {low:?} {high:?}"
            );
        }
    }
}
