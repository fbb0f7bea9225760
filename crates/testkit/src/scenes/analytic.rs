//! A unit sheet under deformations given by formulas, with discs or stripes as rigidity.

use super::Scene;
use super::build::{Builder, Point, bump, deform, sin_cos};
use super::paint::Canvas;

const CELLS: usize = 64;
const MAP: usize = 512;
/// The sheet covers the UVs from this value to 1 minus this value; its chart's border is then well inside the tile.
const MARGIN: f64 = 0.02;

/// A sheet compressed in x to a fraction of its width.
pub fn squash(fraction: f64) -> Scene {
    sheet("squash", "squashed in x", discs(6), |[x, y, z]| [0.5 + (x - 0.5) * fraction, y, z])
}

/// A sheet that bulges in the middle.
pub fn bulge() -> Scene {
    sheet("bulge", "blown up in the middle", discs(6), |[x, y, _]| [x, y, 0.30 * around_centre(x, y, 0.45)])
}

/// A sheet compressed toward its centre, in the plane.
pub fn pinch() -> Scene {
    sheet("pinch", "drawn toward the centre", discs(6), |[x, y, z]| {
        let factor = 1.0 - 0.40 * around_centre(x, y, 0.48);
        [0.5 + (x - 0.5) * factor, 0.5 + (y - 0.5) * factor, z]
    })
}

/// A sheet sheared in x by `k` per unit of y.
pub fn shear(k: f64) -> Scene {
    sheet("shear", "sheared in x", discs(6), move |[x, y, z]| [x + k * (y - 0.5), y, z])
}

/// A sheet rolled to a part of a torus: crowded with discs, compressed on the inside, stretched on the outside.
pub fn torus() -> Scene {
    sheet("torus", "rolled to a part of a torus", discs(9), |[x, y, _]| {
        let (large, small) = (0.42, 0.22);
        let (sin_a, cos_a) = sin_cos((x - 0.5) * 2.2);
        let (sin_b, cos_b) = sin_cos((y - 0.5) * 4.4);
        let radius = large + small * cos_b;
        [0.5 + radius * sin_a, 0.5 + small * sin_b, radius * cos_a - large]
    })
}

/// Stripes along y on a sheet compressed in x: a problem in one dimension with a minimum in closed form.
pub fn strips(fraction: f64) -> Scene {
    let mut canvas = Canvas::new(MAP, MAP);
    for i in 0..4 {
        canvas.tile([0.125 + 0.25 * f64::from(i), 0.5], [0.0625, 0.6], 0.0, 0.0, 0.0, 1.0);
    }
    sheet("strips", "squashed across the stripes", canvas, move |[x, y, z]| {
        [0.5 + (x - 0.5) * fraction, y, z]
    })
}

/// One scene of each kind.
pub fn all() -> Vec<Scene> {
    vec![squash(0.7), bulge(), pinch(), shear(0.5), torus(), strips(0.7)]
}

fn around_centre(x: f64, y: f64, width: f64) -> f64 {
    bump(0.0, width, ((x - 0.5).powi(2) + (y - 0.5).powi(2)).sqrt())
}

/// `n` by `n` discs of alternating size.
fn discs(n: u32) -> Canvas {
    let mut canvas = Canvas::new(MAP, MAP);
    for j in 0..n {
        for i in 0..n {
            let centre = [i, j].map(|k| (f64::from(k) + 0.5) / f64::from(n) * 0.92 + 0.04);
            let radius = if (i + j) % 2 == 0 { 0.30 } else { 0.22 } / f64::from(n);
            canvas.disc(centre, radius, 1.5 / MAP as f64, 1.0);
        }
    }
    canvas
}

fn sheet(name: &'static str, note: &'static str, canvas: Canvas, pose: impl Fn(Point) -> Point) -> Scene {
    let mut mesh = Builder::default();
    let at = |fraction: f64| MARGIN + (1.0 - 2.0 * MARGIN) * fraction;
    for j in 0..=CELLS {
        for i in 0..=CELLS {
            mesh.point([at(i as f64 / CELLS as f64), at(j as f64 / CELLS as f64), 0.0]);
        }
    }
    mesh.chart(CELLS, CELLS, |i, j| (j * (CELLS + 1) + i) as u32, |s, t| [at(s), at(t)]);
    let poses = vec![deform(&mesh.points, pose)];
    Scene { notes: vec![note], poses, tiles: vec![canvas.finish(1001)], ..mesh.scene(name) }
}
