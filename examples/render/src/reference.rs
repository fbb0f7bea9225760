//! The result of a perfect lookup: a texture that is warped beforehand, to be drawn with the original UVs. It shares
//! only the nodes of the warp with vrtm, and inverts the warp in f64 by drawing its triangles.

use super::maps::Solved;
use super::mips::{self, LIGHT};
use super::texture::Levels;
use super::{Result, fill_rows};

/// A tile's texture, warped, with all its levels. It has twice as many texels on a side, so that the additional
/// sampling does not soften the painting.
pub fn warped(solved: &Solved, tile: usize, texture: &Levels) -> Result<Levels> {
    let (cells, nodes) = solved.warp(tile)?;
    let painted = texture[0].len().isqrt();
    let side = 2 * painted;
    let triangles = Triangles::new(cells, &nodes, side);
    let mut texels = vec![[0; 4]; side * side];
    fill_rows(&mut texels, side, |y, row| {
        let uvs = triangles.row((y as f64 + 0.5) / side as f64, side);
        for (texel, uv) in row.iter_mut().zip(uvs) {
            let [r, g, b] = bilinear(&texture[0], painted, uv).map(mips::encoded);
            *texel = [r, g, b, 255];
        }
    });
    Ok(mips::levels(texels, mips::mean_colour))
}

fn bilinear(texels: &[[u8; 4]], side: usize, uv: [f64; 2]) -> [f32; 3] {
    let at = uv.map(|x| (x * side as f64 - 0.5).clamp(0.0, side as f64 - 1.0));
    let low = at.map(|x| x as usize);
    let high = low.map(|k| (k + 1).min(side - 1));
    let [s, t] = [0, 1].map(|c| (at[c] - low[c] as f64) as f32);
    let [a, b, c, d] = [(low[0], low[1]), (high[0], low[1]), (low[0], high[1]), (high[0], high[1])]
        .map(|(x, y)| texels[y * side + x].map(|value| LIGHT[value as usize]));
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    [0, 1, 2].map(|k| mix(mix(a[k], b[k], s), mix(c[k], d[k], s), t))
}

/// The warp's triangles: two for each cell, split by the diagonal from its first node to the opposite one.
struct Triangles {
    /// Per triangle, the positions of its corners on the surface (warped), and in the texture (the nodes themselves).
    all: Vec<[[[f64; 2]; 2]; 3]>,
    /// Per band of v, the triangles that touch it.
    bands: Vec<Vec<u32>>,
}

impl Triangles {
    fn new([nx, ny]: [usize; 2], nodes: &[[f32; 2]], bands: usize) -> Triangles {
        let node = |i: usize, j: usize| {
            let own = [i as f64 / nx as f64, j as f64 / ny as f64];
            [nodes[j * (nx + 1) + i].map(f64::from), own]
        };
        let mut triangles = Triangles { all: Vec::new(), bands: vec![Vec::new(); bands] };
        for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
            for middle in [node(i + 1, j), node(i, j + 1)] {
                let triangle = [node(i, j), middle, node(i + 1, j + 1)];
                let v = triangle.map(|corner| corner[0][1] * bands as f64);
                let first = v.iter().fold(f64::MAX, |a, &b| a.min(b)).max(0.0) as usize;
                let last = v.iter().fold(0.0f64, |a, &b| a.max(b)) as usize;
                for band in &mut triangles.bands[first.min(bands - 1)..=last.min(bands - 1)] {
                    band.push(triangles.all.len() as u32);
                }
                triangles.all.push(triangle);
            }
        }
        triangles
    }

    /// The UVs at which the texture is sampled for `count` places along a row of the surface.
    fn row(&self, v: f64, count: usize) -> Vec<[f64; 2]> {
        let n = count as f64;
        let mut row: Vec<[f64; 2]> = (0..count).map(|k| [(k as f64 + 0.5) / n, v]).collect();
        let band = (v * self.bands.len() as f64) as usize;
        for &index in &self.bands[band.min(self.bands.len() - 1)] {
            let [a, b, c] = self.all[index as usize];
            // The weights of b and c at a point.
            let [p, q] = [b, c].map(|corner| [0, 1].map(|k| corner[0][k] - a[0][k]));
            let area = p[0] * q[1] - p[1] * q[0];
            // Certified warps flip no triangle. Of a cell's two triangles, only the one below the diagonal is
            // counterclockwise.
            if (area > 0.0) != (b[1][1] == a[1][1]) || area == 0.0 {
                continue;
            }
            let u = [a, b, c].map(|corner| corner[0][0]);
            let first = (u.iter().fold(f64::MAX, |a, &b| a.min(b)) * n - 0.5).ceil().max(0.0) as usize;
            let last = (u.iter().fold(f64::MIN, |a, &b| a.max(b)) * n - 0.5).floor();
            for (k, uv) in row.iter_mut().enumerate().take((last + 1.0).max(0.0) as usize).skip(first) {
                let d = [(k as f64 + 0.5) / n - a[0][0], v - a[0][1]];
                let (s, t) = ((d[0] * q[1] - d[1] * q[0]) / area, (p[0] * d[1] - p[1] * d[0]) / area);
                // On an edge both neighbours give the same point; the tolerance closes gaps that rounding would leave.
                if s >= -1e-9 && t >= -1e-9 && s + t <= 1.0 + 1e-9 {
                    *uv = [0, 1].map(|x| a[1][x] + s * (b[1][x] - a[1][x]) + t * (c[1][x] - a[1][x]));
                }
            }
        }
        row
    }
}
