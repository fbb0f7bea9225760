//! An orthographic camera that sees all poses.

use vrtm_examples::mesh::{dot, minus};

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
    /// A camera for each of `count` pictures in which the mesh turns once around its upright axis; a flat sheet, whose
    /// back shows nothing else, swings to both sides instead. The mesh is at one place and of one size in all of them.
    /// `poses` begin with rest. Without a given view, the first camera looks at the mesh from the front at an angle and
    /// from above, or at a flat sheet straight from the front.
    pub fn turning(poses: &[Vec<[f32; 3]>], view: Option<[f64; 2]>, count: usize) -> Vec<Camera> {
        let is_flat = is_flat(poses);
        let [yaw, pitch] = view.unwrap_or(if is_flat { [0.0; 2] } else { [25.0, 14.0] });
        let angle = |k: usize| {
            let turn = k as f64 / count as f64;
            if is_flat { SWING * (turn * std::f64::consts::TAU).sin() } else { 360.0 * turn }
        };
        let [low, high] = bounds(poses);
        let middle = [0, 1, 2].map(|c| 0.5 * (low[c] + high[c]));
        let all: Vec<_> = (0..count).map(|k| axes(poses, [yaw + angle(k), pitch])).collect();
        // The box around all that is seen, relative to the middle.
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for (axes, &p) in all.iter().flat_map(|axes| poses.iter().flatten().map(move |p| (axes, p))) {
            let away = minus(p.map(f64::from), middle);
            let seen = [dot(axes[0], away), dot(axes[1], away)];
            low = [0, 1].map(|c| low[c].min(seen[c]));
            high = [0, 1].map(|c| high[c].max(seen[c]));
        }
        let size = (high[0] - low[0]).max(high[1] - low[1]).max(1e-30);
        let camera = |axes: [[f64; 3]; 3]| Camera {
            axes,
            centre: [0, 1].map(|c| dot(axes[c], middle) + 0.5 * (low[c] + high[c])),
            // A mesh seen edge-on must have a height, too.
            half: [0, 1].map(|c| 0.5 * MARGIN * (high[c] - low[c]).max(0.05 * size)),
        };
        all.into_iter().map(camera).collect()
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
