//! The solution of A x = b, where A has nine points and 2x2 blocks: conjugate gradients, preconditioned with a V(2,2)
//! cycle of block Gauss-Seidel and Galerkin products.

use glam::DVec2;

/// A 2x2 block, row by row.
pub(super) type Block = [f64; 4];

/// The blocks that couple a node with the 3x3 nodes around it, itself at 4.
pub(super) type Stencil = [Block; 9];

/// m v.
pub fn times(m: &Block, v: DVec2) -> DVec2 {
    DVec2::new(m[0] * v.x + m[1] * v.y, m[2] * v.x + m[3] * v.y)
}

/// The inverse of a symmetric positive definite block; 0 for any other block.
pub(super) fn inverse(m: &Block) -> Block {
    let det = m[0] * m[3] - m[1] * m[2];
    if det > 0.0 { [m[3] / det, -m[1] / det, -m[2] / det, m[0] / det] } else { [0.0; 4] }
}

struct Level {
    width: usize,
    /// Movable nodes, in order; x is 0 at all others.
    nodes: Vec<u32>,
    matrix: Vec<Stencil>,
    inverse: Vec<Block>,
    x: Vec<DVec2>,
    b: Vec<DVec2>,
}

/// The levels of one chart's grid. A coarse node may move if all 3x3 finer nodes around it may (the paper's eq. 8), so
/// that bilinear interpolation never moves a fixed node.
pub struct Multigrid {
    levels: Vec<Level>,
    /// Per finer level, for each of its nodes: up to four coarser nodes with their weights.
    parents: Vec<Vec<[(u32, f64); 4]>>,
}

const NO_PARENT: (u32, f64) = (0, 0.0);

impl Multigrid {
    /// Builds the levels for nx x ny cells; `movable` has (nx + 1) x (ny + 1) entries, false on the rim.
    pub fn new(nx: usize, ny: usize, movable: &[bool]) -> Multigrid {
        let mut levels = Vec::new();
        let mut parents = Vec::new();
        let (mut nx, mut ny, mut movable) = (nx, ny, movable.to_vec());
        loop {
            let width = nx + 1;
            let nodes: Vec<u32> = (0..movable.len() as u32).filter(|&n| movable[n as usize]).collect();
            let size = movable.len();
            levels.push(Level {
                width,
                nodes,
                matrix: vec![[[0.0; 4]; 9]; size],
                inverse: vec![[0.0; 4]; size],
                x: vec![DVec2::ZERO; size],
                b: vec![DVec2::ZERO; size],
            });
            let (cx, cy) = (nx / 2, ny / 2);
            let mut coarse = vec![false; (cx + 1) * (cy + 1)];
            for j in 1..cy {
                for i in 1..cx {
                    coarse[j * (cx + 1) + i] =
                        (0..9).all(|k| movable[(2 * j + k / 3 - 1) * width + 2 * i + k % 3 - 1]);
                }
            }
            if !coarse.contains(&true) {
                return Multigrid { levels, parents };
            }
            let table = (0..size).map(|n| {
                let (i, j) = (n % width, n / width);
                let mut list = [NO_PARENT; 4];
                for (k, entry) in list.iter_mut().enumerate() {
                    let (di, dj) = (k % 2, k / 2);
                    // Along an axis, a node with an even index has one parent, one with an odd index two.
                    if di > i % 2 || dj > j % 2 {
                        continue;
                    }
                    let (x, y) = (i / 2 + di, j / 2 + dj);
                    if x <= cx && y <= cy && coarse[y * (cx + 1) + x] {
                        let weight = [1.0, 0.5][i % 2] * [1.0, 0.5][j % 2];
                        *entry = ((y * (cx + 1) + x) as u32, weight);
                    }
                }
                list
            });
            parents.push(table.collect());
            (nx, ny, movable) = (cx, cy, coarse);
        }
    }

    /// The finest matrix, to be filled; then call `prepare`.
    pub fn matrix(&mut self) -> &mut Vec<Stencil> {
        &mut self.levels[0].matrix
    }

    /// The Galerkin products P'AP, and the inverses of the diagonal blocks.
    pub fn prepare(&mut self) {
        for k in 0..self.levels.len() {
            if k > 0 {
                let (finer, coarser) = self.levels.split_at_mut(k);
                product(&finer[k - 1], &self.parents[k - 1], &mut coarser[0]);
            }
            let level = &mut self.levels[k];
            for &n in &level.nodes {
                level.inverse[n as usize] = inverse(&level.matrix[n as usize][4]);
            }
        }
    }

    /// Solves A x = b until the norm of the residual is at most `tolerance` times that of b, in at most `most`
    /// iterations.
    pub fn solve(&mut self, b: &[DVec2], tolerance: f64, most: usize) -> Vec<DVec2> {
        let dot = |x: &[DVec2], y: &[DVec2]| -> f64 { x.iter().zip(y).map(|(x, y)| x.dot(*y)).sum() };
        let mut x = vec![DVec2::ZERO; b.len()];
        let mut r = b.to_vec();
        let goal = tolerance * dot(b, b).sqrt();
        let mut z = self.cycle(&r);
        let mut p = z.clone();
        let mut rz = dot(&r, &z);
        for _ in 0..most {
            if dot(&r, &r).sqrt() <= goal || rz <= 0.0 {
                return x;
            }
            let q = self.levels[0].apply(&p);
            let curvature = dot(&p, &q);
            if curvature <= 0.0 {
                return x;
            }
            let alpha = rz / curvature;
            for n in 0..x.len() {
                x[n] += alpha * p[n];
                r[n] -= alpha * q[n];
            }
            z = self.cycle(&r);
            let next = dot(&r, &z);
            let beta = next / rz;
            rz = next;
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + beta * *p;
            }
        }
        x
    }

    /// Approximates the solution of A z = r by one symmetric V(2,2) cycle from 0.
    fn cycle(&mut self, r: &[DVec2]) -> Vec<DVec2> {
        self.levels[0].b.copy_from_slice(r);
        for k in 0..self.levels.len() {
            let (finer, coarser) = self.levels.split_at_mut(k + 1);
            let level = &mut finer[k];
            level.x.fill(DVec2::ZERO);
            level.forward();
            level.forward();
            let Some(coarser) = coarser.first_mut() else {
                break;
            };
            coarser.b.fill(DVec2::ZERO);
            for &n in &level.nodes {
                let residual = level.residual(n as usize);
                for &(parent, weight) in &self.parents[k][n as usize] {
                    coarser.b[parent as usize] += weight * residual;
                }
            }
        }
        for k in (0..self.levels.len()).rev() {
            let (finer, coarser) = self.levels.split_at_mut(k + 1);
            let level = &mut finer[k];
            if let Some(coarser) = coarser.first() {
                for &n in &level.nodes {
                    for &(parent, weight) in &self.parents[k][n as usize] {
                        level.x[n as usize] += weight * coarser.x[parent as usize];
                    }
                }
            }
            level.backward();
            level.backward();
        }
        self.levels[0].x.clone()
    }
}

/// Sets coarser.matrix to P' finer.matrix P. With bilinear P it has nine points again.
fn product(finer: &Level, parents: &[[(u32, f64); 4]], coarser: &mut Level) {
    coarser.matrix.fill([[0.0; 4]; 9]);
    for &n in &finer.nodes {
        let stencil = &finer.matrix[n as usize];
        for (k, block) in stencil.iter().enumerate() {
            let m = neighbour(n as usize, k, finer.width);
            for &(row, a) in parents[n as usize].iter().filter(|p| p.1 > 0.0) {
                for &(column, b) in parents[m].iter().filter(|p| p.1 > 0.0) {
                    let (row, column) = (row as usize, column as usize);
                    let dj = column / coarser.width + 1 - row / coarser.width;
                    let di = column % coarser.width + 1 - row % coarser.width;
                    let out = &mut coarser.matrix[row][dj * 3 + di];
                    for (out, x) in out.iter_mut().zip(block) {
                        *out += a * b * x;
                    }
                }
            }
        }
    }
}

/// Node `k` of the 3x3 nodes around node `n`.
pub fn neighbour(n: usize, k: usize, width: usize) -> usize {
    n + (k / 3) * width + k % 3 - width - 1
}

impl Level {
    /// b - A x at node `n`.
    fn residual(&self, n: usize) -> DVec2 {
        let mut r = self.b[n];
        for (k, block) in self.matrix[n].iter().enumerate() {
            r -= times(block, self.x[neighbour(n, k, self.width)]);
        }
        r
    }

    fn relax(&mut self, n: usize) {
        let residual = self.residual(n);
        self.x[n] += times(&self.inverse[n], residual);
    }

    fn forward(&mut self) {
        for at in 0..self.nodes.len() {
            self.relax(self.nodes[at] as usize);
        }
    }

    fn backward(&mut self) {
        for at in (0..self.nodes.len()).rev() {
            self.relax(self.nodes[at] as usize);
        }
    }

    /// A p.
    fn apply(&self, p: &[DVec2]) -> Vec<DVec2> {
        let mut q = vec![DVec2::ZERO; p.len()];
        for &n in &self.nodes {
            let n = n as usize;
            for (k, block) in self.matrix[n].iter().enumerate() {
                q[n] += times(block, p[neighbour(n, k, self.width)]);
            }
        }
        q
    }
}
