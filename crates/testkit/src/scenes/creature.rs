//! A scaled creature: a tapered body with a belly and a tail, four legs; scales dense on the back.
//! Its charts: back, belly, snout, tail end, and a leg each, those of the right side mirrored.

use super::Scene;
use super::build::{Builder, Point, TAU, bump, deform, rect, sin_cos, smooth};
use super::paint::Canvas;

const ALONG: usize = 72;
const AROUND: usize = 40;
const BACK: [f64; 4] = [0.02, 0.56, 0.98, 0.97];
const BELLY: [f64; 4] = [0.02, 0.29, 0.98, 0.52];

/// Half the height of the body along its axis: z runs from the tail (-3) to the snout (2.2).
fn girth(z: f64) -> f64 {
    0.07 + 0.72 * smooth(-3.2, -0.2, z) * (1.0 - 0.62 * smooth(0.4, 1.5, z)) + 0.20 * bump(1.55, 0.8, z)
        - 0.24 * smooth(1.7, 2.25, z)
}

pub fn creature() -> Scene {
    let mut mesh = Builder::default();
    for i in 0..=ALONG {
        let z = -3.0 + 5.2 * i as f64 / ALONG as f64;
        for j in 0..AROUND {
            let (sin, cos) = sin_cos(TAU * (j as f64 / AROUND as f64 - 0.25));
            let r = girth(z);
            mesh.point([1.05 * r * cos, 1.0 + 0.45 * girth(z) + r * sin, z]);
        }
    }
    let vertex = |i: usize, j: usize| (i * AROUND + j % AROUND) as u32;
    // The back covers five eighths of the circumference, the belly the rest.
    let (low, high) = (AROUND * 3 / 16, AROUND * 13 / 16);
    let span = high - low;
    mesh.chart(ALONG, span, |i, j| vertex(i, j + low), |s, t| rect(BACK, s, t));
    mesh.chart(ALONG, AROUND - span, |i, j| vertex(i, j + high), |s, t| rect(BELLY, s, t));
    let ring: Vec<u32> = (0..AROUND).map(|j| vertex(ALONG, j)).collect();
    let snout = [0.0, 1.0 + 0.45 * girth(2.2), 2.32];
    mesh.disc(&ring, 4, snout, [0.90, 0.13], [0.07, 0.07]);
    let ring: Vec<u32> = (0..AROUND).rev().map(|j| vertex(0, j)).collect();
    mesh.disc(&ring, 2, [0.0, 1.0 + 0.45 * girth(-3.0), -3.03], [0.90, 0.24], [0.02, 0.02]);
    for (k, (side, z)) in [(1.0, 0.75), (-1.0, 0.75), (1.0, -0.85), (-1.0, -0.85)].into_iter().enumerate() {
        leg(&mut mesh, k, side, z);
    }
    let poses = [(0.9, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.4), (0.0, 0.0, 0.9, 0.0), (0.8, -0.5, -0.4, 1.0)];
    let poses = poses.map(|(turn, arch, twist, breath)| pose(&mesh, turn, arch, twist, breath)).to_vec();
    Scene {
        notes: vec!["looks to its side", "arches its back", "rolls", "turns, sags and breathes in"],
        poses,
        tiles: vec![paint().finish(1001)],
        ..mesh.scene("creature")
    }
}

fn leg(mesh: &mut Builder, k: usize, side: f64, z: f64) {
    let (down, around) = (12, 16);
    let first = mesh.points.len() as u32;
    for j in 0..=down {
        let t = j as f64 / down as f64;
        let r = 0.30 - 0.12 * smooth(0.0, 0.8, t) + 0.06 * smooth(0.8, 1.0, t);
        for i in 0..around {
            let (sin, cos) = sin_cos(TAU * i as f64 / around as f64);
            mesh.point([side * (0.48 + 0.16 * t) + r * cos, 1.05 - 1.05 * t, z + r * sin + 0.1 * t]);
        }
    }
    let vertex = |i: usize, j: usize| first + (j * around + i % around) as u32;
    let left = 0.02 + 0.205 * k as f64;
    // The right leg is mirrored: its texture has the handedness of the left leg's, its faces the opposite winding.
    let turn = move |s: f64| if side < 0.0 { 1.0 - s } else { s };
    mesh.chart(around, down, vertex, move |s, t| [left + 0.185 * turn(s), 0.25 - 0.21 * t]);
}

/// Bends the body sideways and up, rolls it about its axis, and swells it.
fn pose(mesh: &Builder, turn: f64, arch: f64, twist: f64, breath: f64) -> Vec<[f32; 3]> {
    deform(&mesh.points, |[x, y, z]: Point| {
        let swell = 1.0 + 0.35 * breath * bump(-0.2, 1.6, z) * smooth(0.3, 0.9, y);
        let (ts, tc) = sin_cos(twist * smooth(-1.5, 2.0, z) * smooth(0.0, 0.9, y));
        let (x, y) = (swell * x, 1.35 + swell * (y - 1.35));
        let (x, y) = (tc * x - ts * (y - 1.35), 1.35 + ts * x + tc * (y - 1.35));
        // Each bend is an arc of length 5 about the middle of the body.
        let (x, z) = bend(x, z, turn);
        let (height, z) = bend(y - 1.2, z, -arch);
        [x, 1.2 + height, z]
    })
}

/// Bends the z axis toward x by `angle` over a length of 5; the axis itself keeps its length.
fn bend(x: f64, z: f64, angle: f64) -> (f64, f64) {
    if angle == 0.0 {
        return (x, z);
    }
    let radius = 5.0 / angle;
    let (sin, cos) = sin_cos(z / radius);
    (radius - (radius - x) * cos, (radius - x) * sin)
}

fn paint() -> Canvas {
    let mut canvas = Canvas::new(512, 512);
    let soft = 2.0 / 512.0;
    for row in 0..15 {
        for i in 0..32 {
            let offset = if row % 2 == 0 { 0.25 } else { 0.75 };
            let s = (f64::from(i) + offset) / 32.0;
            let t = (f64::from(row) + 0.5) / 15.0;
            // Scales become narrower with the body, so that they are round on the surface.
            let z = -3.0 + 5.2 * s;
            let shrink = (girth(z) / 0.80).clamp(0.35, 1.0);
            canvas.oval(rect(BACK, s, t), [0.0125 * shrink.max(0.7), 0.0115], soft, 1.0);
        }
    }
    for i in 0..18 {
        let s = (f64::from(i) + 0.5) / 18.0;
        canvas.tile(rect(BELLY, s, 0.5), [0.016, 0.055], 0.008, 0.0, 3.0 / 512.0, 0.8);
    }
    for k in 0..4 {
        for i in 0..6 {
            for j in 0..6 {
                let u = 0.02 + 0.205 * f64::from(k) + 0.185 * (f64::from(i) + 0.5) / 6.0;
                canvas.disc([u, 0.25 - 0.21 * (f64::from(j) + 0.5) / 6.0], 0.010, soft, 1.0);
            }
        }
    }
    canvas.disc([0.90, 0.13], 0.022, soft, 1.0);
    canvas
}
