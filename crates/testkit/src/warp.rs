//! A warp evaluated in f64 from its definition alone: two triangles per cell, with the diagonal from (0,0) to (1,1)
//! (method §9).

use crate::asset::Lab as _;
use vrtm::Asset;

/// The warp of one tile.
#[derive(Clone, Debug)]
pub struct Warp {
    pub nx: usize,
    pub ny: usize,
    /// Displacements in cells, row by row from v = 0.
    pub u: Vec<[f32; 2]>,
}

impl Warp {
    /// The last result of a tile.
    pub fn of(asset: &Asset, tile: usize) -> Warp {
        let [nx, ny] = asset.tile(tile).report().unwrap().grid.map(|n| n as usize);
        let u = asset.displacements(tile).unwrap();
        assert_eq!(u.len(), (nx + 1) * (ny + 1));
        Warp { nx, ny, u }
    }

    pub fn is_identity(&self) -> bool {
        self.u.iter().all(|u| *u == [0.0; 2])
    }

    /// The length of the longest displacement, in cells.
    pub fn longest(&self) -> f32 {
        self.u.iter().map(|u| f64::from(u[0]).hypot(f64::from(u[1])) as f32).fold(0.0, f32::max)
    }

    /// Warped position of node (i, j), in cells.
    pub fn node(&self, i: usize, j: usize) -> [f64; 2] {
        let u = self.u[j * (self.nx + 1) + i];
        [i as f64 + f64::from(u[0]), j as f64 + f64::from(u[1])]
    }

    /// W at a point of the tile, both in cells.
    pub fn at(&self, p: [f64; 2]) -> [f64; 2] {
        let cell = [(p[0], self.nx), (p[1], self.ny)].map(|(x, n)| x.floor().clamp(0.0, n as f64 - 1.0));
        let (s, t) = (p[0] - cell[0], p[1] - cell[1]);
        let (i, j) = (cell[0] as usize, cell[1] as usize);
        let [a, c] = [self.node(i, j), self.node(i + 1, j + 1)];
        // From corner a along the longer one of s and t to the corner b, then to the corner c.
        let (b, first, second) =
            if s >= t { (self.node(i + 1, j), s, t) } else { (self.node(i, j + 1), t, s) };
        [0, 1].map(|k| a[k] + first * (b[k] - a[k]) + second * (c[k] - b[k]))
    }

    /// The same map on another grid, at whose nodes it is interpolated.
    pub fn on_grid(&self, [nx, ny]: [usize; 2]) -> Warp {
        let scale = [self.nx as f64 / nx as f64, self.ny as f64 / ny as f64];
        let node = |n: usize| {
            let at = [(n % (nx + 1)) as f64, (n / (nx + 1)) as f64];
            let to = self.at([0, 1].map(|axis| at[axis] * scale[axis]));
            [0, 1].map(|axis| (to[axis] / scale[axis] - at[axis]) as f32)
        };
        Warp { nx, ny, u: (0..(nx + 1) * (ny + 1)).map(node).collect() }
    }

    /// The smallest corner Jacobian of all cells of the tile.
    pub fn min_jacobian(&self) -> f64 {
        let mut least = f64::INFINITY;
        for j in 0..self.ny {
            for i in 0..self.nx {
                let p = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(di, dj)| self.node(i + di, j + dj));
                for k in 0..4 {
                    least = least.min(cross(p[k], p[(k + 1) % 4], p[(k + 3) % 4]));
                }
            }
        }
        least
    }

    /// Number of warped triangles that cover each texel centre of an image, row by row from v = 0. A centre on an edge
    /// belongs to the triangle that contains it after a shift by (ε, ε²); the triangles on both sides of an edge
    /// evaluate the same number.
    pub fn count(&self, size: [usize; 2]) -> Vec<u8> {
        let scale = [size[0] as f64 / self.nx as f64, size[1] as f64 / self.ny as f64];
        let mut count = vec![0u8; size[0] * size[1]];
        for j in 0..self.ny {
            for i in 0..self.nx {
                for middle in [(1, 0), (0, 1)] {
                    let corners = [(0, 0), middle, (1, 1)].map(|(di, dj)| {
                        let p = self.node(i + di, j + dj);
                        [p[0] * scale[0], p[1] * scale[1]]
                    });
                    self.visit(corners, size, &mut count);
                }
            }
        }
        count
    }

    fn visit(&self, corners: [[f64; 2]; 3], size: [usize; 2], count: &mut [u8]) {
        let span = |axis: usize| {
            let at = corners.map(|p| p[axis]);
            let low = at.iter().fold(f64::INFINITY, |m, &x| m.min(x)) - 0.5;
            let high = at.iter().fold(f64::NEG_INFINITY, |m, &x| m.max(x)) - 0.5;
            (low.floor().max(0.0) as usize)..((high.ceil() + 1.0).max(0.0) as usize).min(size[axis])
        };
        for y in span(1) {
            for x in span(0) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let left = |k: usize| is_left(corners[k], corners[(k + 1) % 3], p);
                if left(0) == left(1) && left(1) == left(2) {
                    count[y * size[0] + x] += 1;
                }
            }
        }
    }
}

/// Twice the area of a triangle; negative if its corners are in clockwise order.
pub fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

pub fn barycentric(&[a, b, c]: &[[f64; 2]; 3], at: [f64; 2]) -> [f64; 3] {
    let all = cross(a, b, c);
    [cross(at, b, c) / all, cross(a, at, c) / all, cross(a, b, at) / all]
}

/// True if a point lies to the left of a directed line, after a shift by (ε, ε²).
fn is_left(a: [f64; 2], b: [f64; 2], p: [f64; 2]) -> bool {
    if (b[0], b[1]) < (a[0], a[1]) {
        return !is_left(b, a, p);
    }
    let d = [b[0] - a[0], b[1] - a[1]];
    let cross = d[0] * (p[1] - a[1]) - d[1] * (p[0] - a[0]);
    match cross {
        c if c != 0.0 => c > 0.0,
        _ if d[1] != 0.0 => d[1] < 0.0,
        _ => d[0] > 0.0,
    }
}
