//! An orthographic camera whose picture the mesh fills.

use bytemuck::{Pod, Zeroable};

/// The direction from which the mesh is viewed.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Degrees of the viewer around the mesh, and upward.
    pub yaw: f64,
    pub pitch: f64,
    /// True if z points up instead of y.
    pub z_up: bool,
}

/// The camera in the layout of `view.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Camera {
    clip: [[f32; 4]; 4],
    right: [f32; 4],
    down: [f32; 4],
    toward: [f32; 4],
}

impl View {
    /// A flat sheet is viewed from the front, any other mesh from the front, left and above.
    pub fn of(positions: &[[f32; 3]]) -> View {
        let bounds = [0, 1, 2].map(|c| bounds(positions.iter().map(|p| f64::from(p[c]))));
        let [x, y, z] = bounds.map(|[low, high]| high - low);
        let (yaw, pitch) = if z < 0.02 * x.max(y) { (0.0, 0.0) } else { (-25.0, 14.0) };
        View { yaw, pitch, z_up: false }
    }

    /// Fits these positions into a picture of this size.
    pub fn camera(&self, positions: &[[f32; 3]], [width, height]: [u32; 2]) -> Camera {
        let (ys, yc) = self.yaw.to_radians().sin_cos();
        let (ps, pc) = self.pitch.to_radians().sin_cos();
        // Rows: right, up and toward the viewer.
        let mut axes = [[yc, 0.0, -ys], [-ps * ys, pc, -ps * yc], [pc * ys, ps, pc * yc]];
        if self.z_up {
            axes = axes.map(|[x, y, z]| [x, -z, y]);
        }
        let along = |p: &[f32; 3], axis: usize| (0..3).map(|c| axes[axis][c] * f64::from(p[c])).sum::<f64>();
        let bounds = [0, 1, 2].map(|axis| bounds(positions.iter().map(|p| along(p, axis))));
        let aspect = f64::from(width) / f64::from(height);
        let size = bounds.map(|[low, high]| (high - low).max(1e-20));
        // Half of the picture's height in units of the mesh, with a margin.
        let half = 0.53 * size[1].max(size[0] / aspect);
        // Depth has room for poses that reach farther than these positions.
        let scale = [1.0 / (half * aspect), 1.0 / half, -0.3 / size[2]];
        let centre = bounds.map(|[low, high]| 0.5 * (low + high));
        let mut clip = [[0.0; 4]; 4];
        for axis in 0..3 {
            for (column, part) in clip.iter_mut().zip(axes[axis]) {
                column[axis] = (scale[axis] * part) as f32;
            }
            let middle = if axis == 2 { 0.5 } else { 0.0 };
            clip[3][axis] = (middle - scale[axis] * centre[axis]) as f32;
        }
        clip[3][3] = 1.0;
        let vector = |axis: [f64; 3], sign: f64| {
            let [x, y, z] = axis.map(|part| (sign * part) as f32);
            [x, y, z, 0.0]
        };
        Camera {
            clip,
            right: vector(axes[0], 1.0),
            down: vector(axes[1], -1.0),
            toward: vector(axes[2], 1.0),
        }
    }
}

fn bounds(values: impl Iterator<Item = f64>) -> [f64; 2] {
    values.fold([f64::MAX, f64::MIN], |[low, high], x| [low.min(x), high.max(x)])
}
