//! The minimisation problem of one chart: its rectangle of the grid, its edges with their rest lengths and weights
//! (method §2 and §4), and the cells whose Jacobians count.

use glam::DVec2;

use super::law::Law;
use super::linear::neighbour;
use vrtm_core::grid::coverage::NodeMaps;
use vrtm_core::grid::density::density;
use vrtm_core::grid::planes::EDGES;
use vrtm_core::mesh::NONE;
use vrtm_core::settings::TileSettings;
use vrtm_core::strain::exact::{Locator, Surface};

/// Number of dimensions in which chords are measured. Between rest and the pose the surface is (sqrt(1 - t) f_rest,
/// sqrt(t) f_pose) in six dimensions: its metric is (1 - t) G_rest + t G_pose, which neither collapses half-way through
/// a twist nor changes under a rigid motion, as blended positions would.
pub const DIM: usize = 6;

/// Floor of rest lengths, as a fraction of the smaller of two medians: those of the edges to the east and to the north.
const FLOOR_FRACTION: f64 = 0.05;

/// An edge (a, b) between two nodes that are neighbours among eight.
pub struct Edge {
    pub a: u32,
    pub b: u32,
    /// w: the larger rigidity of the two nodes.
    pub weight: f64,
    /// (λ(1-w) + λ0) / |d0|².
    pub smooth: f64,
    /// κ / |d0|².
    pub orientation: f64,
    /// ν: the unit normal of the edge's offset at rest.
    pub normal: DVec2,
    /// l: the rest length.
    pub length: f64,
    /// 1 / max(l, floor).
    pub inverse: f64,
}

impl Edge {
    /// The end that is not `n`.
    pub fn other(&self, n: usize) -> usize {
        if self.a as usize == n { self.b as usize } else { self.a as usize }
    }

    /// Second derivative of the smoothness and orientation terms with respect to the edge's offset.
    pub fn soft(&self) -> [DVec2; 2] {
        let (s, o, n) = (2.0 * self.smooth, 2.0 * self.orientation, self.normal);
        [DVec2::new(s + o * n.x * n.x, o * n.x * n.y), DVec2::new(o * n.x * n.y, s + o * n.y * n.y)]
    }
}

/// A chart's problem. Its nodes are those of a rectangle: the bounding box of the movable nodes, and one node more on
/// each side, so that the rim is fixed.
pub struct ChartProblem {
    /// The rectangle's lower corner in the tile's grid.
    origin: [usize; 2],
    /// Cells of the rectangle along both axes.
    pub nx: usize,
    pub ny: usize,
    pub movable: Vec<bool>,
    /// Movable nodes, in order.
    pub nodes: Vec<u32>,
    /// Movable nodes and their neighbours: the nodes on whose positions the energy depends.
    pub touched: Vec<u32>,
    /// The triangle under each node at rest, or `NONE`.
    pub home: Vec<u32>,
    pub edges: Vec<Edge>,
    /// Per node, the indices of its eight edges, or `NONE`; only movable nodes have all eight.
    pub edges_of: Vec<[u32; 8]>,
    /// The lower left node of each cell with a corner that counts.
    pub cells: Vec<u32>,
    pub law: Law,
}

/// The problems of all charts; `None` for a chart without movable nodes.
pub(super) fn problems(
    charts: usize,
    maps: &NodeMaps,
    locator: &Locator,
    rest: &Surface<DIM>,
    settings: &TileSettings,
) -> Vec<Option<ChartProblem>> {
    let mut boxes: Vec<Option<[[usize; 2]; 2]>> = vec![None; charts];
    for (n, &chart) in maps.chart.iter().enumerate().filter(|(_, c)| **c != NONE) {
        let at = [n % (maps.nx + 1), n / (maps.nx + 1)];
        let [low, high] = boxes[chart as usize].get_or_insert([at, at]);
        for axis in 0..2 {
            low[axis] = low[axis].min(at[axis]);
            high[axis] = high[axis].max(at[axis]);
        }
    }
    let density = (settings.orientation_density > 0.0).then(|| density(maps));
    let problem = |(c, b): (usize, Option<_>)| {
        b.map(|b| ChartProblem::new(c as u32, b, maps, locator, rest, settings, density.as_deref()))
    };
    boxes.into_iter().enumerate().map(problem).collect()
}

impl ChartProblem {
    fn new(
        chart: u32,
        [low, high]: [[usize; 2]; 2],
        maps: &NodeMaps,
        locator: &Locator,
        rest: &Surface<DIM>,
        settings: &TileSettings,
        density: Option<&[f32]>,
    ) -> ChartProblem {
        let origin = low.map(|x| x - 1);
        let [nx, ny] = [0, 1].map(|axis| high[axis] + 1 - origin[axis]);
        let width = nx + 1;
        let size = width * (ny + 1);
        let global = |n: usize| (origin[1] + n / width) * (maps.nx + 1) + origin[0] + n % width;
        let movable: Vec<bool> = (0..size).map(|n| maps.chart[global(n)] == chart).collect();
        let nodes: Vec<u32> = (0..size as u32).filter(|&n| movable[n as usize]).collect();
        let mut is_touched = vec![false; size];
        for &n in &nodes {
            (0..9).for_each(|k| is_touched[neighbour(n as usize, k, width)] = true);
        }
        let touched: Vec<u32> = (0..size as u32).filter(|&n| is_touched[n as usize]).collect();
        let home: Vec<u32> =
            (0..size).map(|n| locator.under(origin[0] + n % width, origin[1] + n / width)).collect();
        let mut problem = ChartProblem {
            origin,
            nx,
            ny,
            movable,
            nodes,
            touched,
            home,
            edges: Vec::new(),
            edges_of: vec![[NONE; 8]; size],
            cells: Vec::new(),
            law: Law::new(settings),
        };
        let kappa = |n: usize| {
            let of_density = density.map_or(0.0, |density| density[global(n)]);
            f64::from(settings.orientation) + f64::from(settings.orientation_density) * f64::from(of_density)
        };
        problem.list_edges(rest, settings, |n| f64::from(maps.rigidity[global(n)]), kappa);
        problem.list_cells();
        problem
    }

    pub fn width(&self) -> usize {
        self.nx + 1
    }

    /// The node (i, j) in the tile's grid of a node of the rectangle.
    pub fn node(&self, n: usize) -> [usize; 2] {
        [self.origin[0] + n % self.width(), self.origin[1] + n / self.width()]
    }

    /// A node's place in the tile's grid, in cells.
    pub fn place(&self, n: usize) -> DVec2 {
        self.node(n).map(|x| x as f64).into()
    }

    /// Lists the edges with a movable end.
    fn list_edges(
        &mut self,
        rest: &Surface<DIM>,
        settings: &TileSettings,
        rigidity: impl Fn(usize) -> f64,
        kappa: impl Fn(usize) -> f64,
    ) {
        let width = self.width();
        let mut axis_parallel: [Vec<f64>; 2] = Default::default();
        for &a in &self.touched {
            for (kind, (di, dj)) in EDGES.into_iter().enumerate() {
                let b = i64::from(a) + dj * width as i64 + di;
                let (a, b) = (a as usize, b as usize);
                if !(self.movable[a] || self.movable.get(b).is_some_and(|&m| m)) {
                    continue;
                }
                let (p, q) = (rest.at(self.home[a], self.place(a)), rest.at(self.home[b], self.place(b)));
                let length = p.iter().zip(&q).map(|(p, q)| (q - p).powi(2)).sum::<f64>().sqrt();
                if kind < 2 && self.movable[a] {
                    axis_parallel[kind].push(length);
                }
                let weight = rigidity(a).max(rigidity(b));
                let d2 = (di * di + dj * dj) as f64;
                let (lambda, floor) = (f64::from(settings.smoothness), f64::from(settings.smoothness_floor));
                let id = self.edges.len() as u32;
                self.edges_of[a][kind] = id;
                self.edges_of[b][kind + 4] = id;
                self.edges.push(Edge {
                    a: a as u32,
                    b: b as u32,
                    weight,
                    smooth: (lambda * (1.0 - weight) + floor) / d2,
                    orientation: 0.5 * (kappa(a) + kappa(b)) / d2,
                    normal: DVec2::new(-dj as f64, di as f64) / d2.sqrt(),
                    length,
                    inverse: 0.0,
                });
            }
        }
        let median = axis_parallel.map(|mut lengths| {
            lengths.sort_by(f64::total_cmp);
            lengths[lengths.len() / 2]
        });
        let floor = FLOOR_FRACTION * median[0].min(median[1]);
        for edge in &mut self.edges {
            let l = edge.length.max(floor);
            // A chart that is a single point at rest has no strain.
            edge.inverse = if l > 0.0 { 1.0 / l } else { 0.0 };
        }
    }

    /// Lists the cells with a corner that counts.
    fn list_cells(&mut self) {
        for j in 0..self.ny {
            for i in 0..self.nx {
                let n = j * self.width() + i;
                if self.corners(n).any(|c| self.counts(c)) {
                    self.cells.push(n as u32);
                }
            }
        }
    }

    /// The four corners of the cell whose lower left node is `n`: the node at the corner, its neighbours along x and
    /// along y, and the sign with which J = 1 at rest.
    pub fn corners(&self, n: usize) -> impl Iterator<Item = Corner> + use<> {
        let width = self.width();
        (0..4).map(move |k| {
            let (a, b) = (k % 2, k / 2);
            let at = |a: usize, b: usize| n + a + b * width;
            let sign = if a == b { 1.0 } else { -1.0 };
            Corner { nodes: [at(a, b), at(1 - a, b), at(a, 1 - b)], sign }
        })
    }

    /// True if a corner's Jacobian depends on a movable node, and so counts in the energy.
    pub fn counts(&self, corner: Corner) -> bool {
        corner.nodes.iter().any(|&n| self.movable[n])
    }
}

/// A corner of a cell (method §1, Corner Jacobians).
#[derive(Clone, Copy)]
pub struct Corner {
    pub nodes: [usize; 3],
    sign: f64,
}

impl Corner {
    /// J and its gradients with respect to the three nodes, from their displacements and the two sides at rest, (±1, 0)
    /// and (0, ±1).
    pub fn jacobian(&self, u: [DVec2; 3], rest: [DVec2; 2]) -> (f64, [DVec2; 3]) {
        let side = |k: usize| rest[k] + u[k + 1] - u[0];
        let (p, q, s) = (side(0), side(1), self.sign);
        let (x, y) = (-s * q.perp(), s * p.perp());
        (s * p.perp_dot(q), [-x - y, x, y])
    }

    /// The two sides at rest.
    pub fn rest(&self) -> [DVec2; 2] {
        let [c, x, y] = self.nodes;
        [DVec2::new(if x > c { 1.0 } else { -1.0 }, 0.0), DVec2::new(0.0, if y > c { 1.0 } else { -1.0 })]
    }
}
