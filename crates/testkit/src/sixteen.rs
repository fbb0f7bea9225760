//! Sixteen square charts that cover a share of a tile: a mesh for any grid's size and any active share.

use vrtm::{Asset, Device, MeshSource, Strided, UvSource};

/// Charts on a side of the tile.
const CHARTS: usize = 4;
/// Quads on a side of a chart.
const QUADS: usize = 32;

/// Positions, UVs and the corners of quads. Charts are flat and lie in a row; vertices and UVs have the same indices.
pub fn sixteen_charts(share: f64) -> (Vec<[f32; 3]>, Vec<[f32; 2]>, Vec<u32>) {
    let side = share.sqrt() / CHARTS as f64;
    let margin = 0.5 * (1.0 / CHARTS as f64 - side);
    let (mut positions, mut uvs, mut indices) = (Vec::new(), Vec::new(), Vec::new());
    for chart in 0..CHARTS * CHARTS {
        let origin = [chart % CHARTS, chart / CHARTS].map(|k| k as f64 / CHARTS as f64 + margin);
        let first = positions.len() as u32;
        let row = QUADS as u32 + 1;
        for n in 0..row * row {
            let (i, j) = (n % row, n / row);
            let [s, t] = [i, j].map(|k| f64::from(k) / QUADS as f64);
            positions.push([(s + 2.0 * chart as f64) as f32, t as f32, 0.0]);
            uvs.push([(origin[0] + side * s) as f32, (origin[1] + side * t) as f32]);
            if i + 1 < row && j + 1 < row {
                let at = first + n;
                indices.extend([at, at + 1, at + row + 1, at + row]);
            }
        }
    }
    (positions, uvs, indices)
}

/// The asset of `sixteen_charts`, without maps.
pub fn sixteen_asset(device: &Device, share: f64) -> vrtm::Result<Asset> {
    let (positions, uvs, indices) = sixteen_charts(share);
    let source = MeshSource {
        positions: Strided::from_slice(&positions),
        face_counts: Some(&vec![4; indices.len() / 4]),
        indices: &indices,
        uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&indices) },
        ..MeshSource::default()
    };
    Asset::new(device, &source)
}

/// Each chart is stretched in its middle.
pub fn bulged(rest: &[[f32; 3]], strength: f32) -> Vec<[f32; 3]> {
    rest.iter()
        .map(|&[x, y, z]| {
            let s = x.rem_euclid(2.0);
            let push = |a: f32| a + strength * 0.16 * (std::f32::consts::TAU * a).sin();
            [x - s + push(s), push(y), z]
        })
        .collect()
}

/// Texels of discs, `pitch` texels apart, on a map of n by n.
pub fn discs(n: usize, pitch: usize) -> Vec<u8> {
    let is_in = |x: usize, y: usize| {
        let d = [x, y].map(|k| (k % pitch) as f64 + 0.5 - 0.5 * pitch as f64);
        d[0].hypot(d[1]) < 0.3 * pitch as f64
    };
    (0..n * n).map(|k| if is_in(k % n, k / n) { 255 } else { 0 }).collect()
}
