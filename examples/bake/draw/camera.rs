//! An orthographic camera that sees all poses.

use crate::mesh::{dot, minus};

#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// Unit vectors as rows: right, up, toward the viewer.
    axes: [[f64; 3]; 3],
    centre: [f64; 2],
    half: [f64; 2],
}

/// Size of the view relative to that of the mesh.
const MARGIN: f64 = 1.06;
/// Degrees to which a flat sheet turns to either side.
const SWING: f64 = 50.0;

impl Camera {
    /// A camera for all poses, of which the first is the rest. Without a given view, it looks at the mesh from the
    /// front at an angle and from above, or at a flat sheet straight from the front.
    pub fn new(poses: &[Vec<[f32; 3]>], view: Option<[f64; 2]>) -> Camera {
        let axes = axes(poses, view.unwrap_or_else(|| usual(poses)));
        let mut camera = Camera { axes, centre: [0.0; 2], half: [1.0; 2] };
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for &p in poses.iter().flatten() {
            let seen = camera.view(p);
            low = [0, 1].map(|c| low[c].min(seen[c]));
            high = [0, 1].map(|c| high[c].max(seen[c]));
        }
        camera.fit(low, high);
        camera
    }

    /// A camera for each of `count` pictures in which the mesh turns once around its upright axis; a flat sheet, whose
    /// back shows nothing else, swings to both sides instead. The mesh is at one place and of one size in all of them.
    pub fn turning(poses: &[Vec<[f32; 3]>], view: Option<[f64; 2]>, count: usize) -> Vec<Camera> {
        let [yaw, pitch] = view.unwrap_or_else(|| usual(poses));
        let middle = {
            let [low, high] = bounds(poses);
            [0, 1, 2].map(|c| 0.5 * (low[c] + high[c]))
        };
        // Without pitch, of any yaw: up is along the axis, and a turn keeps the distance from it.
        let upright = Camera { axes: axes(poses, [0.0; 2]), centre: [0.0; 2], half: [1.0; 2] };
        let (ps, pc) = pitch.to_radians().sin_cos();
        let (mut low, mut high) = ([0.0f64; 2], [0.0f64; 2]);
        for &p in poses.iter().flatten() {
            let away = minus(p.map(f64::from), middle);
            let [x, y, z] = upright.axes.map(|axis| dot(axis, away));
            let (radius, up) = (x.hypot(z), pc * y);
            low = [low[0].min(-radius), low[1].min(up - ps.abs() * radius)];
            high = [high[0].max(radius), high[1].max(up + ps.abs() * radius)];
        }
        let angle = |k: usize| {
            let turn = k as f64 / count as f64;
            if is_flat(poses) { SWING * (turn * std::f64::consts::TAU).sin() } else { 360.0 * turn }
        };
        let camera = |k: usize| {
            let axes = axes(poses, [yaw + angle(k), pitch]);
            let mut camera = Camera { axes, centre: [0.0; 2], half: [1.0; 2] };
            let centre = [dot(axes[0], middle), dot(axes[1], middle)];
            camera.fit([0, 1].map(|c| centre[c] + low[c]), [0, 1].map(|c| centre[c] + high[c]));
            camera
        };
        (0..count).map(camera).collect()
    }

    /// Shows a rectangle of the plane along right and up.
    fn fit(&mut self, low: [f64; 2], high: [f64; 2]) {
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(1e-30);
        self.centre = [0, 1].map(|c| 0.5 * (low[c] + high[c]));
        // A mesh seen edge-on must have a height, too.
        self.half = [0, 1].map(|c| 0.5 * MARGIN * (high[c] - low[c]).max(0.05 * size));
    }

    /// Coordinates along right, up and toward the viewer, without scaling.
    pub fn view(&self, p: [f32; 3]) -> [f64; 3] {
        self.axes.map(|axis| dot(axis, p.map(f64::from)))
    }

    /// Pixel coordinates (y down) and depth (larger = nearer).
    pub fn project(&self, p: [f32; 3], [width, height]: [usize; 2]) -> [f64; 3] {
        let [x, y, z] = self.view(p);
        let scale = self.scale([width, height]);
        let centre = [width as f64 / 2.0, height as f64 / 2.0];
        [centre[0] + (x - self.centre[0]) * scale, centre[1] - (y - self.centre[1]) * scale, z]
    }

    /// Pixels per unit of length.
    pub fn scale(&self, [width, height]: [usize; 2]) -> f64 {
        (width as f64 / self.half[0]).min(height as f64 / self.half[1]) / 2.0
    }

    /// Height over width of the view.
    pub fn aspect(&self) -> f64 {
        self.half[1] / self.half[0]
    }
}

/// Degrees around the mesh and upward.
fn usual(poses: &[Vec<[f32; 3]>]) -> [f64; 2] {
    if is_flat(poses) { [0.0; 2] } else { [25.0, 14.0] }
}

fn is_flat(poses: &[Vec<[f32; 3]>]) -> bool {
    let [low, high] = bounds(poses);
    let size = [0, 1, 2].map(|c| high[c] - low[c]);
    size[2] < 0.02 * size[0].max(size[1])
}

/// Right, up and toward the viewer. At yaw 0 and pitch 0, y points up and z toward the viewer. Yaw moves the viewer
/// around the mesh, pitch moves the viewer up.
fn axes(poses: &[Vec<[f32; 3]>], [yaw, pitch]: [f64; 2]) -> [[f64; 3]; 3] {
    let (ys, yc) = yaw.to_radians().sin_cos();
    let (ps, pc) = pitch.to_radians().sin_cos();
    let axes = [[yc, 0.0, -ys], [-ps * ys, pc, -ps * yc], [pc * ys, ps, pc * yc]];
    if !is_flat(poses) && z_up(&poses[0]) { axes.map(|[x, y, z]| [x, -z, y]) } else { axes }
}

fn bounds(poses: &[Vec<[f32; 3]>]) -> [[f64; 3]; 2] {
    poses.iter().flatten().fold([[f64::MAX; 3], [f64::MIN; 3]], |[low, high], p| {
        let p = p.map(f64::from);
        [[0, 1, 2].map(|c| low[c].min(p[c])), [0, 1, 2].map(|c| high[c].max(p[c]))]
    })
}

/// Guesses the up axis, which OBJ files do not state: z if the mesh stands on z = 0 but not on y = 0.
fn z_up(rest: &Vec<[f32; 3]>) -> bool {
    let [low, high] = bounds(std::slice::from_ref(rest));
    let stands = |c: usize| low[c].abs() < 0.02 * (high[c] - low[c]);
    stands(2) && !stands(1)
}
