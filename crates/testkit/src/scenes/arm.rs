//! An arm that bends at the elbow, over two tiles: scales on the upper arm, rivets of three sizes on the forearm.

use super::Scene;
use super::build::{Builder, Point, TAU, bump, deform, sin_cos, smooth};
use super::paint::Canvas;

const AROUND: usize = 40;
const HALF: usize = 44;
/// Half of the arm's length; the elbow is at x = 0.
const REACH: f64 = 3.0;

/// The arm lies along x; u runs along it (tile 1001 up to the elbow, 1002 from there), the seam underneath.
pub fn arm() -> Scene {
    let mut mesh = Builder::default();
    for i in 0..=2 * HALF {
        let x = REACH * (i as f64 / HALF as f64 - 1.0);
        let radius = 0.46 - 0.045 * x + 0.06 * bump(-1.5, 1.3, x) + 0.06 * bump(0.9, 1.1, x);
        for j in 0..AROUND {
            let (sin, cos) = sin_cos(TAU * (j as f64 / AROUND as f64));
            mesh.point([x, -radius * cos, radius * sin]);
        }
    }
    let vertex = |i: usize, j: usize| (i * AROUND + j % AROUND) as u32;
    mesh.chart(HALF, AROUND, vertex, |s, t| [0.03 + 0.94 * s, 0.05 + 0.90 * t]);
    mesh.chart(HALF, AROUND, |i, j| vertex(i + HALF, j), |s, t| [1.03 + 0.94 * s, 0.05 + 0.90 * t]);

    let poses = [(0.8, 0.3, 0.0), (1.5, 0.6, 0.0), (2.2, 1.0, 0.0), (1.5, 0.6, 0.9)];
    let poses = poses.map(|(angle, muscle, twist)| pose(&mesh, angle, muscle, twist)).to_vec();
    Scene {
        notes: vec!["bent a little", "bent", "bent far, muscle up", "bent, forearm turned"],
        poses,
        tiles: vec![scales().finish(1001), rivets().finish(1002)],
        ..mesh.scene("arm")
    }
}

/// Bends about z along an arc of length 1.8 around the elbow.
fn pose(mesh: &Builder, angle: f64, muscle: f64, twist: f64) -> Vec<[f32; 3]> {
    let arc = 0.9;
    deform(&mesh.points, |[x, y, z]: Point| {
        let swell = 1.0 + 0.28 * muscle * bump(-1.5, 1.2, x);
        let (ts, tc) = sin_cos(twist * smooth(0.2, 2.6, x));
        let (y, z) = (swell * (tc * y - ts * z), swell * (ts * y + tc * z));
        let turned = angle * ((x + arc) / (2.0 * arc)).clamp(0.0, 1.0);
        let (sin, cos) = sin_cos(turned);
        // A circular arc about a point above the arm, straight before and after it.
        let radius = 2.0 * arc / angle;
        let beyond = (x - arc).max(0.0);
        let before = (x + arc).min(0.0);
        let px = before + radius * sin + beyond * cos - sin * y;
        let py = radius * (1.0 - cos) + beyond * sin + cos * y;
        [px, py, z]
    })
}

fn scales() -> Canvas {
    let mut canvas = Canvas::new(512, 512);
    for row in 0..17 {
        for i in 0..15 {
            let offset = if row % 2 == 0 { 0.25 } else { 0.75 };
            let u = 0.05 + 0.90 * (f64::from(i) + offset) / 15.0;
            let v = 0.08 + 0.84 * (f64::from(row) + 0.5) / 17.0;
            canvas.oval([u, v], [0.0235, 0.0195], 2.0 / 512.0, 1.0);
        }
    }
    canvas
}

fn rivets() -> Canvas {
    let mut canvas = Canvas::new(512, 512);
    for row in 0..9 {
        for i in 0..9 {
            let u = 0.05 + 0.90 * (f64::from(i) + if row % 2 == 0 { 0.3 } else { 0.7 }) / 9.0;
            let v = 0.08 + 0.84 * (f64::from(row) + 0.5) / 9.0;
            let radius = [0.030, 0.014, 0.021][((i + 2 * row) % 3) as usize];
            canvas.disc([u, v], radius, 1.5 / 512.0, 1.0);
        }
    }
    canvas
}
