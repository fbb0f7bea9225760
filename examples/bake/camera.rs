//! An orthographic camera whose direction shows where rigid features are strained.

use crate::args::Up;
use crate::mesh::Triangle;

#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Unit vectors as rows: right, up, toward the viewer.
    axes: [[f64; 3]; 3],
    centre: [f64; 2],
    half: [f64; 2],
}

/// Size of the view relative to that of the mesh.
const MARGIN: f64 = 1.06;

impl Camera {
    fn turned(yaw: f64, pitch: f64, up: Up) -> Camera {
        let (ys, yc) = yaw.to_radians().sin_cos();
        let (ps, pc) = pitch.to_radians().sin_cos();
        // At yaw 0 and pitch 0, y points up and z toward the viewer. Yaw turns the viewer around the mesh, pitch lifts
        // the viewer.
        let axes = [[yc, 0.0, -ys], [-ps * ys, pc, -ps * yc], [pc * ys, ps, pc * yc]];
        let axes = match up {
            Up::Y => axes,
            Up::Z => axes.map(|[x, y, z]| [x, -z, y]),
        };
        Camera { axes, centre: [0.0; 2], half: [1.0; 2] }
    }

    /// Coordinates along right, up and toward the viewer, without scaling.
    pub fn view(&self, p: [f32; 3]) -> [f64; 3] {
        self.axes.map(|axis| (0..3).map(|c| axis[c] * f64::from(p[c])).sum())
    }

    /// Pixel coordinates (y down) and depth (larger = nearer).
    pub fn project(&self, p: [f32; 3], width: f64, height: f64) -> [f64; 3] {
        let [x, y, z] = self.view(p);
        let scale = self.scale(width, height);
        [width / 2.0 + (x - self.centre[0]) * scale, height / 2.0 - (y - self.centre[1]) * scale, z]
    }

    /// Pixels per unit of length.
    pub fn scale(&self, width: f64, height: f64) -> f64 {
        (width / self.half[0]).min(height / self.half[1]) / 2.0
    }

    /// Height over width of the view.
    pub fn aspect(&self) -> f64 {
        self.half[1] / self.half[0]
    }

    fn frame<'a>(&mut self, poses: impl Iterator<Item = &'a [[f32; 3]]>) {
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &p in poses.flatten() {
            let seen = self.view(p);
            for c in 0..2 {
                low[c] = low[c].min(seen[c]);
                high[c] = high[c].max(seen[c]);
            }
        }
        let size: f64 = (0..2).map(|c| high[c] - low[c]).fold(1e-30, f64::max);
        for c in 0..2 {
            self.centre[c] = 0.5 * (low[c] + high[c]);
            // A mesh seen edge-on gets a height, too.
            self.half[c] = 0.5 * MARGIN * (high[c] - low[c]).max(0.05 * size);
        }
    }

    /// Chooses one camera for all poses. `rigid` holds each triangle's mean rigidity.
    pub fn choose(
        triangles: &[Triangle],
        rigid: &[f32],
        poses: &[&[[f32; 3]]],
        view: Option<(f64, f64)>,
        up: Option<Up>,
    ) -> Camera {
        let bounds = bounds(poses);
        let up = up.unwrap_or_else(|| guess_up(poses[0]));
        let size = (0..3).map(|c| bounds[1][c] - bounds[0][c]).collect::<Vec<_>>();
        let largest = size.iter().copied().fold(0.0, f64::max);
        let mut camera = if let Some((yaw, pitch)) = view {
            Camera::turned(yaw, pitch, up)
        } else if size[2] < 0.02 * largest {
            // A flat sheet is viewed from the front.
            Camera::turned(0.0, 0.0, Up::Y)
        } else {
            best(triangles, rigid, poses, up)
        };
        camera.frame(poses.iter().copied());
        camera
    }
}

fn bounds(poses: &[&[[f32; 3]]]) -> [[f64; 3]; 2] {
    let mut bounds = [[f64::MAX; 3], [f64::MIN; 3]];
    for p in poses.iter().copied().flatten() {
        for c in 0..3 {
            bounds[0][c] = bounds[0][c].min(f64::from(p[c]));
            bounds[1][c] = bounds[1][c].max(f64::from(p[c]));
        }
    }
    bounds
}

/// Guesses the up axis, which OBJ files do not state: z if the mesh stands on z = 0 and not on y = 0.
fn guess_up(rest: &[[f32; 3]]) -> Up {
    let [low, high] = bounds(&[rest]);
    let stands = |c: usize| low[c].abs() < 0.02 * (high[c] - low[c]);
    if stands(2) && !stands(1) { Up::Z } else { Up::Y }
}

/// Tries views around the mesh, and takes the one in which the most strained, rigid area faces the viewer. Views from
/// the front are preferred, because one looks at a character from there first.
fn best(triangles: &[Triangle], rigid: &[f32], poses: &[&[[f32; 3]]], up: Up) -> Camera {
    let (rest, posed) = (poses[0], &poses[1..]);
    let edge = |p: &[[f32; 3]], t: &Triangle, k: usize| -> [f64; 3] {
        let (a, b) = (p[t.vertices[0] as usize], p[t.vertices[k] as usize]);
        std::array::from_fn(|c| f64::from(b[c]) - f64::from(a[c]))
    };
    // Area vectors of the triangles in at most eight poses, weighted with rigidity and strain.
    let step = posed.len().div_ceil(8).max(1);
    let mut vectors = Vec::new();
    let mut volume = 0.0;
    for pose in posed.iter().step_by(step) {
        for (t, &r) in triangles.iter().zip(rigid) {
            let normal = cross(edge(pose, t, 1), edge(pose, t, 2));
            volume += dot(normal, pose[t.vertices[0] as usize].map(f64::from));
            let strain = (1..3).map(|k| {
                let l = dot(edge(rest, t, k), edge(rest, t, k)).sqrt();
                let length = dot(edge(pose, t, k), edge(pose, t, k)).sqrt();
                if l > 0.0 { (length / l - 1.0).abs().min(1.0) } else { 0.0 }
            });
            let weight = f64::from(r) * strain.sum::<f64>() + 0.002;
            vectors.push(normal.map(|x| x * weight));
        }
    }
    let outward = if volume < 0.0 { -1.0 } else { 1.0 };
    let score = |yaw: f64, pitch: f64, bonus: f64| {
        let camera = Camera::turned(yaw, pitch, up);
        let facing = vectors.iter().map(|&v| (outward * dot(v, camera.axes[2])).max(0.0));
        (bonus * facing.sum::<f64>(), camera)
    };
    let views =
        [(-25.0, 1.6), (25.0, 1.6), (-65.0, 1.2), (65.0, 1.2), (-120.0, 1.0), (120.0, 1.0), (180.0, 0.9)];
    let scored = views.into_iter().map(|(yaw, bonus)| score(yaw, 14.0, bonus));
    scored.reduce(|best, next| if next.0 > best.0 { next } else { best }).expect("a list of views").1
}

pub fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
