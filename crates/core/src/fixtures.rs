//! Small meshes and maps for the unit tests of all crates.

use std::sync::Arc;

use crate::allocation::Vec;
use crate::grid::maps::{TileMaps, Values};
use crate::image::map::Map;
use crate::mesh::{Mesh, MeshSource, UvSource};
use crate::settings::TileSettings;
use crate::view::{Scalar, Strided};

/// A sheet of n x n quads over the whole tile, on a rest surface.
pub fn sheet(n: u32, rest: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
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
    Mesh::new(&MeshSource { positions, indices: &indices, uvs, ..MeshSource::default() }).unwrap()
}

/// The sheet's vertices under a map of its UVs.
pub fn posed(n: u32, pose: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let at = |i: u32| f64::from(i as f32 / n as f32);
    (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| pose(at(i), at(j))).collect()
}

/// A square rigidity map.
pub fn maps(size: usize, settings: TileSettings, rigidity: impl Fn(f64, f64) -> f64) -> TileMaps {
    let at = |k: usize| (k as f64 + 0.5) / size as f64;
    let values: Vec<f32> = (0..size * size).map(|k| rigidity(at(k % size), at(k / size)) as f32).collect();
    let rigidity = Values::Map(Arc::new(Map::from_values(size, size, &values)));
    TileMaps { rigidity, settings, ..TileMaps::default() }
}

/// Scales: discs in a square pattern.
pub fn discs(u: f64, v: f64) -> f64 {
    let d = |x: f64| (x * 6.0).fract() - 0.5;
    f64::from(u8::from(d(u).hypot(d(v)) < 0.33))
}
