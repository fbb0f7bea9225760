//! Mug to jug, after figures 4 and 6 of the paper: a mug with studs and emblems is edited into a jug in five steps.

use super::Scene;
use super::build::{Builder, Point, TAU, bump, deform, rect, sin_cos, smooth};
use super::paint::Canvas;

const AROUND: usize = 96;
const UP: usize = 40;
const HEIGHT: f64 = 2.6;
/// The side's chart in UV; its scale is nearly the same in both directions.
const SIDE: [f64; 4] = [0.02, 0.55, 0.98, 0.95];
const HANDLE: [f64; 4] = [0.46, 0.12, 0.96, 0.40];
const BOTTOM: [f64; 3] = [0.22, 0.26, 0.153];

/// A mug of radius 1 with a bottom and a handle; the side's seam runs down under the handle.
pub fn mug_to_jug() -> Scene {
    let mut mesh = Builder::default();
    for j in 0..=UP {
        for i in 0..AROUND {
            let (sin, cos) = sin_cos(TAU * i as f64 / AROUND as f64);
            mesh.point([cos, HEIGHT * j as f64 / UP as f64, -sin]);
        }
    }
    let side = |i: usize, j: usize| (j * AROUND + i % AROUND) as u32;
    mesh.chart(AROUND, UP, side, |s, t| rect(SIDE, s, t));
    let ring: Vec<u32> = (0..AROUND).map(|i| side(i, 0)).collect();
    mesh.disc(&ring, 8, [0.0; 3], [BOTTOM[0], BOTTOM[1]], [BOTTOM[2]; 2]);
    handle(&mut mesh);

    let steps = [0.5, 1.0].map(|belly| pose(&mesh, belly, 0.0, 0.0, 0.0));
    let steps = steps.into_iter().chain([
        pose(&mesh, 1.0, 1.0, 0.0, 0.0),
        pose(&mesh, 1.0, 1.0, 1.0, 0.0),
        pose(&mesh, 1.0, 1.0, 1.0, 0.5),
    ]);
    let poses = steps.collect();
    Scene {
        notes: vec![
            "half-way to a belly",
            "a belly",
            "belly and neck",
            "jug: belly, neck and spout",
            "the jug, twisted",
        ],
        poses,
        tiles: vec![paint().finish(1001)],
        ..mesh.scene("mug_to_jug")
    }
}

/// Half a ring of tube on the +x side.
fn handle(mesh: &mut Builder) {
    let (along, around) = (32, 16);
    let first = mesh.points.len() as u32;
    for j in 0..=along {
        let (sin, cos) = sin_cos(TAU * (0.5 * j as f64 / along as f64 - 0.25));
        for i in 0..around {
            // The seam runs along the inside of the handle.
            let (s, c) = sin_cos(TAU * (i as f64 / around as f64 + 0.5));
            // The tube is wide across and flat along the handle.
            let bow = 0.82 + 0.11 * c;
            mesh.point([0.93 + 0.85 * bow * cos, 1.3 + bow * sin, 0.19 * s]);
        }
    }
    let vertex = |i: usize, j: usize| first + (i * around + j % around) as u32;
    mesh.chart(along, around, vertex, |s, t| rect(HANDLE, s, t));
}

/// One step of the edit; each parameter is a fraction from 0 to 1.
fn pose(mesh: &Builder, belly: f64, neck: f64, spout: f64, twist: f64) -> Vec<[f32; 3]> {
    deform(&mesh.points, |[x, y, z]: Point| {
        let h = y / HEIGHT;
        let scale = 1.0 + 0.42 * belly * bump(0.36, 0.62, h) - 0.36 * neck * bump(0.80, 0.34, h)
            + 0.10 * neck * smooth(0.88, 1.0, h)
            - 0.12 * belly * smooth(0.25, 0.0, h);
        let radius = (x * x + z * z).sqrt();
        // The handle moves with the mug's side instead of being scaled with it.
        let moved = if radius > 1.0 { radius + scale - 1.0 } else { radius * scale };
        let factor = if radius > 0.0 { moved / radius } else { 1.0 };
        let (mut x, mut z) = (x * factor, z * factor);
        let mut y = y * (1.0 + 0.16 * neck);
        // The spout is opposite to the handle.
        let narrow = smooth(0.25, 0.95, -x / moved.max(1e-9));
        let lip = spout * narrow * smooth(0.72, 1.0, h);
        x -= 0.42 * lip;
        z *= 1.0 - 0.30 * lip;
        y += 0.16 * lip;
        let (sin, cos) = sin_cos(twist * h);
        [cos * x + sin * z, y, cos * z - sin * x]
    })
}

fn paint() -> Canvas {
    let mut canvas = Canvas::new(512, 512);
    let soft = 1.5 / 512.0;
    let place = |s: f64, t: f64| rect(SIDE, s, t);
    // Two staggered rows of studs around the belly, small rivets above and below.
    let count = 22;
    for i in 0..count {
        let s = (f64::from(i) + 0.5) / f64::from(count);
        canvas.disc(place(s, 0.22), 0.0150, soft, 1.0);
        if i + 1 < count {
            canvas.disc(place(s + 0.5 / f64::from(count), 0.36), 0.0150, soft, 1.0);
        }
    }
    for i in 0..44 {
        let s = (f64::from(i) + 0.5) / 44.0;
        canvas.disc(place(s, 0.07), 0.0065, soft, 1.0);
        canvas.disc(place(s, 0.92), 0.0065, soft, 1.0);
    }
    // Emblems with soft edges where the belly turns into the neck; some are less rigid.
    for i in 0..10 {
        let centre = place((f64::from(i) + 0.5) / 10.0, 0.64);
        let peak = if i % 4 == 3 { 0.6 } else { 1.0 };
        if i % 2 == 0 {
            canvas.tile(centre, [0.028, 0.028], 0.006, TAU / 8.0, 5.0 / 512.0, peak);
        } else {
            canvas.oval(centre, [0.022, 0.034], 5.0 / 512.0, peak);
        }
    }
    for i in 0..14 {
        for (t, radius) in [(0.22, 0.0085), (0.5, 0.0115), (0.78, 0.0085)] {
            let [u, v] = rect(HANDLE, (f64::from(i) + 0.5) / 14.0, t);
            canvas.disc([u, v], radius, soft, 1.0);
        }
    }
    for i in 0..12 {
        let (sin, cos) = sin_cos(TAU * (f64::from(i) + 0.5) / 12.0);
        canvas.disc([BOTTOM[0] + 0.105 * cos, BOTTOM[1] + 0.105 * sin], 0.013, soft, 1.0);
    }
    canvas
}
