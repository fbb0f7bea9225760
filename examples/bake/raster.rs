//! Rasterises triangles to samples: the tile and the UV that each sample of a picture shows, and the surface normal
//! there.
//!
//! Shading comes later, so that a rasterised pose serves several pictures.

use crate::camera::{Camera, cross, dot};
use crate::mesh::Triangle;

/// Samples per pixel along each axis.
pub const SUPER: usize = 2;

/// The surface at one sample.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Index into the triangles, or [`Hit::NOTHING`].
    pub triangle: u32,
    /// UV within the triangle's tile.
    pub uv: [f32; 2],
    /// Unit normal toward the viewer, in view space (right, up, toward).
    pub normal: [f32; 3],
    /// True if the surface is seen from inside.
    pub inside: bool,
}

impl Hit {
    pub const NOTHING: u32 = u32::MAX;
}

/// A rasterised pose, `SUPER` times as large as its picture.
pub struct Samples {
    pub width: usize,
    pub hits: Vec<Hit>,
}

/// Draws all triangles from both sides with a depth buffer.
pub fn rasterise(
    triangles: &[Triangle],
    positions: &[[f32; 3]],
    camera: &Camera,
    width: usize,
    height: usize,
) -> Samples {
    let (width, height) = (width * SUPER, height * SUPER);
    let empty = Hit { triangle: Hit::NOTHING, uv: [0.0; 2], normal: [0.0, 0.0, 1.0], inside: false };
    let mut hits = vec![empty; width * height];
    let mut depths = vec![f64::MIN; width * height];
    let screen: Vec<[f64; 3]> =
        positions.iter().map(|&p| camera.project(p, width as f64, height as f64)).collect();
    let (normals, outward) = normals(triangles, positions, camera);

    for (index, t) in triangles.iter().enumerate() {
        let [a, b, c] = t.vertices.map(|v| screen[v as usize]);
        let corner_normals = t.vertices.map(|v| normals[v as usize]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if area == 0.0 || !area.is_finite() {
            continue;
        }
        // y points down on the screen, so that a front face has a negative area.
        let inside = (area > 0.0) == (outward > 0.0);
        let span = |k: usize, size: usize| {
            let low = a[k].min(b[k]).min(c[k]).floor().clamp(0.0, size as f64) as usize;
            let high = a[k].max(b[k]).max(c[k]).ceil().clamp(0.0, size as f64) as usize;
            low..high
        };
        for y in span(1, height) {
            for x in span(0, width) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let side = |p0: [f64; 3], p1: [f64; 3]| {
                    ((p1[0] - p0[0]) * (p[1] - p0[1]) - (p1[1] - p0[1]) * (p[0] - p0[0])) / area
                };
                let w = [side(b, c), side(c, a), side(a, b)];
                // Triangles contain their edges: no sample between two of them is missed.
                if w.iter().any(|&w| w < -1e-9) {
                    continue;
                }
                let depth = w[0] * a[2] + w[1] * b[2] + w[2] * c[2];
                let at = y * width + x;
                if depth > depths[at] {
                    depths[at] = depth;
                    let mix =
                        |k: usize, values: [[f64; 3]; 3]| (0..3).map(|i| w[i] * values[i][k]).sum::<f64>();
                    let normal: [f64; 3] = std::array::from_fn(|k| mix(k, corner_normals));
                    let flip = if normal[2] < 0.0 { -1.0 } else { 1.0 };
                    let length = dot(normal, normal).sqrt().max(1e-30) * flip;
                    let uv = [0, 1].map(|k| (0..3).map(|i| w[i] * t.uvs[i][k]).sum::<f64>() as f32);
                    hits[at] = Hit {
                        triangle: index as u32,
                        uv,
                        normal: normal.map(|x| (x / length) as f32),
                        inside,
                    };
                }
            }
        }
    }
    Samples { width, hits }
}

/// Smooth vertex normals in view space, weighted by area, and the sign of the enclosed volume: it tells whether the
/// winding of the faces points outward.
fn normals(triangles: &[Triangle], positions: &[[f32; 3]], camera: &Camera) -> (Vec<[f64; 3]>, f64) {
    let seen: Vec<[f64; 3]> = positions.iter().map(|&p| camera.view(p)).collect();
    let mut normals = vec![[0.0; 3]; positions.len()];
    let mut volume = 0.0;
    // Positions are relative to a point of the mesh: far from the origin the sum would be lost in rounding.
    let origin = seen.first().copied().unwrap_or_default();
    for t in triangles {
        let [a, b, c] = t.vertices.map(|v| seen[v as usize]);
        let minus = |p: [f64; 3], q: [f64; 3]| [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let normal = cross(minus(b, a), minus(c, a));
        volume += dot(normal, minus(a, origin));
        for v in t.vertices {
            for k in 0..3 {
                normals[v as usize][k] += normal[k];
            }
        }
    }
    (normals, if volume < 0.0 { -1.0 } else { 1.0 })
}
