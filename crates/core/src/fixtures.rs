//! Small meshes and maps for the unit tests and examples of all crates.

use std::sync::Arc;

use crate::allocation::Vec;
use crate::grid::Grid;
use crate::grid::maps::{TileMaps, Values};
use crate::grid::pose::Pose;
use crate::image::map::Map;
use crate::mesh::{Mesh, MeshSource, TileMesh, UvSource};
use crate::method::plan::Input;
use crate::settings::TileSettings;
use crate::view::Strided;

/// A square that fills its tile, for examples of the documentation: its vertices, and the source of its mesh.
pub fn square() -> ([[f32; 3]; 4], MeshSource<'static>) {
    static UVS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    static REST: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let uvs = UvSource { u: Strided::from_slice(&UVS), ..UvSource::default() };
    let positions = Strided::from_slice(&REST);
    (
        REST,
        MeshSource {
            positions,
            face_counts: Some(&[4]),
            indices: &[0, 1, 2, 3],
            uvs,
            ..MeshSource::default()
        },
    )
}

/// A sheet of n x n quads over the whole tile, on a rest surface.
pub fn sheet(n: u32, rest: impl Fn(f64, f64) -> [f64; 3]) -> Mesh {
    let at = |k: u32| k as f32 / n as f32;
    let uvs: Vec<[f32; 2]> = (0..=n).flat_map(|j| (0..=n).map(move |i| [at(i), at(j)])).collect();
    let positions = posed(n, rest);
    let mut indices = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let a = j * (n + 1) + i;
            indices.extend([a, a + 1, a + n + 2, a, a + n + 2, a + n + 1]);
        }
    }
    let positions = Strided::from_slice(&positions);
    let uvs = UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&indices) };
    Mesh::new(&MeshSource { positions, indices: &indices, uvs, ..MeshSource::default() }).unwrap()
}

/// The sheet's vertices under a map of its UVs.
pub fn posed(n: u32, pose: impl Fn(f64, f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let at = |i: u32| f64::from(i as f32 / n as f32);
    (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))).map(|(i, j)| pose(at(i), at(j))).collect()
}

/// A flat sheet on the grid of its maps, in a pose.
pub struct Posed {
    mesh: Mesh,
    pub maps: TileMaps,
    pub grid: Arc<Grid>,
    pose: Pose,
}

impl Posed {
    /// A sheet of n x n quads, whose vertices `pose` maps from their UVs.
    pub fn new(n: u32, maps: TileMaps, pose: impl Fn(f64, f64) -> [f64; 3]) -> Posed {
        let mesh = sheet(n, |u, v| [u, v, 0.0]);
        let grid = Arc::new(Grid::new(&mesh, &mesh.tiles[0], &maps));
        let positions = posed(n, pose);
        let pose = Pose::new(&mesh.tiles[0], |v| positions[v as usize], Some(&grid.rest));
        Posed { mesh, maps, grid, pose }
    }

    pub fn tile(&self) -> &TileMesh {
        &self.mesh.tiles[0]
    }

    /// The input of a solve of its one chart.
    pub fn input(&self) -> Input<'_> {
        Input {
            grid: &self.grid,
            mesh: self.tile(),
            pose: &self.pose,
            settings: &self.maps.settings,
            harm: 0.0,
            multipliers: &[],
            charts: &[true],
            continuation: 1.0,
            pull: 0.0,
        }
    }
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
