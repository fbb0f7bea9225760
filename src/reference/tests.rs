use super::*;
use crate::image::Map;
use crate::mesh::{MeshSource, UvSource};
use crate::settings::TileSettings;
use crate::tile::Rigidity;
use crate::view::{Scalar, Strided};

/// A sheet of n x n quads over the whole tile, on a rest surface.
pub(crate) fn sheet(n: u32, rest: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let (mut positions, mut uvs, mut indices) = (Vec::new(), Vec::<f32>::new(), Vec::new());
    for j in 0..=n {
        for i in 0..=n {
            let (u, v) = (i as f32 / n as f32, j as f32 / n as f32);
            let p = rest(f64::from(u), f64::from(v));
            positions.extend(p);
            uvs.extend([u, v]);
        }
    }
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            indices.extend([a, a + 1, a + n + 2, a, a + n + 2, a + n + 1]);
        }
    }
    let bytes: Vec<u8> = uvs.iter().flat_map(|x| x.to_ne_bytes()).collect();
    let uv = Strided::new("uv", &bytes, Scalar::F32, 2, uvs.len() / 2, 0).unwrap();
    let bytes: Vec<u8> = positions.iter().flat_map(|x: &f64| x.to_ne_bytes()).collect();
    let positions = Strided::new("positions", &bytes, Scalar::F64, 3, positions.len() / 3, 0).unwrap();
    let uvs = UvSource { u: uv, v: None, indices: Some(&indices) };
    Mesh::new(&MeshSource { positions, face_counts: None, indices: &indices, uvs }).unwrap()
}

/// The sheet's vertices under a map of its UVs.
pub(crate) fn posed(n: u32, pose: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let at = |i: u32| f64::from(i as f32 / n as f32);
    (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| pose(at(i), at(j))).collect()
}

/// A square rigidity map.
pub(crate) fn maps(size: usize, settings: TileSettings, rigidity: impl Fn(f64, f64) -> f64) -> TileMaps {
    let at = |k: usize| (k as f64 + 0.5) / size as f64;
    let values = (0..size * size).map(|k| rigidity(at(k % size), at(k / size)) as f32).collect();
    TileMaps { rigidity: Rigidity::Map(Map { width: size, height: size, values }), mask: None, settings }
}

/// Scales: discs in a square pattern.
pub(crate) fn discs(u: f64, v: f64) -> f64 {
    let d = |x: f64| (x * 6.0).fract() - 0.5;
    f64::from(u8::from(d(u).hypot(d(v)) < 0.33))
}

fn flat(u: f64, v: f64) -> [f64; 3] {
    [u, v, 0.0]
}

fn torus(u: f64, v: f64) -> [f64; 3] {
    let (a, b) = (u * std::f64::consts::TAU * 0.9, v * std::f64::consts::TAU * 0.9);
    [(1.0 + 0.5 * b.cos()) * a.cos(), (1.0 + 0.5 * b.cos()) * a.sin(), 0.5 * b.sin()]
}

#[test]
#[ignore]
fn bench() {
    let n: usize = std::env::var("N").ok().and_then(|n| n.parse().ok()).unwrap_or(128);
    let only = std::env::var("SCENE").ok();
    type Pose = fn(f64, f64) -> [f64; 3];
    let scenes: [(&str, Pose); 9] = [
        ("bulge", |u, v| {
            let r2 = (u - 0.5).powi(2) + (v - 0.5).powi(2);
            [u, v, 0.5 * (-r2 / 0.03).exp()]
        }),
        ("pinch", |u, v| {
            let (x, y) = (u - 0.5, v - 0.5);
            let s = 1.0 - 0.5 * (-(x * x + y * y) / 0.04).exp();
            [x * s, y * s, 0.0]
        }),
        ("shear", |u, v| [u + 0.5 * v, v, 0.0]),
        ("squash70", |u, v| [0.7 * u, v, 0.0]),
        ("squash40", |u, v| [0.4 * u, v, 0.0]),
        ("torus", torus),
        ("squash20", |u, v| [0.2 * u, v, 0.0]),
        ("squash10", |u, v| [0.1 * u, v, 0.0]),
        ("same", flat),
    ];
    for (name, pose) in scenes {
        if only.as_deref().is_some_and(|o| o != name) {
            continue;
        }
        let mesh = sheet(96, flat);
        let pose = posed(96, pose);
        let maps = maps(n, TileSettings::default(), discs);
        let problem = Problem::new(&mesh, 0, &maps, &pose).unwrap();
        let time = std::time::Instant::now();
        let zero = vec![[0.0; 2]; (n + 1) * (n + 1)];
        let e0 = problem.energy(&zero);
        for start in [None, Some(&zero[..])] {
            let m = problem.minimise(start, &Options::default());
            println!(
                "{name} E0 {e0:.6} E {:.8} g {:.2e} of {:.2e} corrections {} {} minJ {:.4} {:.2?}",
                m.energy,
                m.gradient_norm,
                m.initial_gradient_norm,
                m.corrections,
                m.converged,
                problem.min_jacobian(&m.u),
                time.elapsed()
            );
        }
    }
}
