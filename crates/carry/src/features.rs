//! Features: connected rigid regions of the surface, over all tiles of a UV set and beyond seams, by the nodes of the
//! grids.

use glam::{DVec2, DVec3};

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::Grid;
use vrtm_core::grid::coverage::{NodeMaps, node_maps};
use vrtm_core::grid::maps::Values;
use vrtm_core::mesh::{Mesh, NONE, TileMesh};
use vrtm_core::sets::root;
use vrtm_core::team::Team;

use crate::frame::smooth;
use crate::surface::{Posed, Spot, Surface, weights};
use crate::tile::Tile;

/// Nodes above this rigidity belong to features.
pub const RIGID: f32 = 0.5;
/// Points of this rigidity and above move with their feature alone.
const WHOLE: f32 = 0.75;
/// About the most nodes by which the motion of a feature is found: more of them say nothing new of a rigid motion.
const MOST: usize = 1024;

/// Bytes while features are found on grids: per node coverage, maps, numbers.
pub fn bytes_of_features<'a>(grids: impl Iterator<Item = &'a Grid>) -> u64 {
    grids.map(|grid| 32 * (grid.levels[0].nx * grid.levels[0].ny) as u64).sum()
}

struct TileNodes {
    /// Numbers of nodes along u and v.
    size: [usize; 2],
    /// The triangle under each node, or `NONE`.
    triangle: Vec<u32>,
    rigidity: Vec<f32>,
    /// The number of each rigid node among those of all tiles, or `NONE`.
    rigid: Vec<u32>,
}

impl TileNodes {
    /// The corners of the cell at a UV, and their weights.
    fn corners(&self, uv: DVec2) -> [(usize, f64); 4] {
        let [width, height] = self.size;
        let at = uv * DVec2::new((width - 1) as f64, (height - 1) as f64);
        let most = DVec2::new(width as f64 - 2.0, height as f64 - 2.0);
        let cell = at.floor().clamp(DVec2::ZERO, most);
        let (s, t) = ((at.x - cell.x).clamp(0.0, 1.0), (at.y - cell.y).clamp(0.0, 1.0));
        let first = cell.y as usize * width + cell.x as usize;
        [
            (first, (1.0 - s) * (1.0 - t)),
            (first + 1, s * (1.0 - t)),
            (first + width, (1.0 - s) * t),
            (first + width + 1, s * t),
        ]
    }

    fn uv(&self, node: usize) -> DVec2 {
        let [width, height] = self.size;
        let at = DVec2::new((node % width) as f64, (node / width) as f64);
        at / DVec2::new((width - 1) as f64, (height - 1) as f64)
    }
}

/// All features of a carrier's UV set.
pub struct Features<'a> {
    surfaces: &'a [Option<Surface>],
    nodes: Vec<Option<TileNodes>>,
    /// Tile and node of each rigid node.
    rigid: Vec<(u32, u32)>,
    /// Per rigid node, one of the same feature; the first for the first one.
    sets: Vec<u32>,
}

#[derive(Clone, Copy, Debug)]
pub struct FeatureNode {
    pub tile: u32,
    /// The triangle under it.
    pub triangle: u32,
    /// Its place in the arrays of displacements.
    pub node: u32,
    pub uv: DVec2,
    /// On the rest surface.
    pub rest: DVec3,
    /// Rigidity times area; 0 for a node of the rim alone.
    pub weight: f64,
    pub is_rim: bool,
}

impl<'a> Features<'a> {
    pub fn new(team: &Team, mesh: &Mesh, tiles: &[Tile], surfaces: &'a [Option<Surface>]) -> Features<'a> {
        let mut nodes: Vec<Option<TileNodes>> = team.map(tiles.len(), |k| {
            let tile = &tiles[k];
            let has_rigidity = !matches!(tile.maps.rigidity, Values::None);
            surfaces[k].as_ref().filter(|_| has_rigidity && tile.grid.is_some())?;
            let [nx, ny] = tile.cells();
            let NodeMaps { triangle, rigidity, .. } = node_maps(tile.mesh, tile.maps, [nx, ny]);
            let rigid = vec![NONE; triangle.len()];
            Some(TileNodes { size: [nx + 1, ny + 1], triangle, rigidity, rigid })
        });
        let mut rigid = Vec::new();
        for (k, nodes) in nodes.iter_mut().enumerate() {
            let Some(TileNodes { triangle, rigidity, rigid: numbers, .. }) = nodes else { continue };
            for (n, number) in numbers.iter_mut().enumerate() {
                if triangle[n] != NONE && rigidity[n] > RIGID {
                    *number = rigid.len() as u32;
                    rigid.push((k as u32, n as u32));
                }
            }
        }
        let sets = (0..rigid.len() as u32).collect();
        let mut features = Features { surfaces, nodes, rigid, sets };
        features.join_neighbours(team);
        features.join_seams(mesh, tiles);
        features
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (root(&mut self.sets, a), root(&mut self.sets, b));
        self.sets[a.max(b) as usize] = a.min(b);
    }

    /// Joins neighbours in the grid, diagonals included, between which the surface goes on.
    fn join_neighbours(&mut self, team: &Team) {
        let joined = team.map(self.rigid.len(), |a| {
            let (tile, n) = self.rigid[a];
            let mut joined = [NONE; 4];
            let (Some(nodes), Some(surface)) = (&self.nodes[tile as usize], &self.surfaces[tile as usize])
            else {
                return joined;
            };
            let ([width, height], n) = (nodes.size, n as usize);
            let (i, j) = (n % width, n / width);
            for (k, (di, dj)) in [(1, 0), (0, 1), (1, 1), (-1, 1)].into_iter().enumerate() {
                let (x, y) = (i as i64 + di, j + dj);
                if !(0..width as i64).contains(&x) || y >= height {
                    continue;
                }
                let other = y * width + x as usize;
                let (b, from) = (nodes.rigid[other], nodes.triangle[n]);
                if b != NONE
                    && surface.chart(from) == surface.chart(nodes.triangle[other])
                    && surface.leads_to(from, nodes.uv(other))
                {
                    joined[k] = b;
                }
            }
            joined
        });
        for (a, joined) in joined.into_iter().enumerate() {
            joined.into_iter().filter(|&b| b != NONE).for_each(|b| self.join(a as u32, b));
        }
    }

    /// Joins what faces each other across seams: two sides of triangles with the same two vertices, which no third one
    /// has.
    fn join_seams(&mut self, mesh: &Mesh, tiles: &[Tile]) {
        /// A side without a neighbour: its vertices, tile, triangle and corner.
        type Side = ([u32; 2], u32, u32, u8);
        let place = |v: u32| mesh.place.get(v as usize).copied().unwrap_or(v);
        let mut sides: Vec<Side> = Vec::new();
        for (k, tile) in tiles.iter().enumerate().filter(|(k, _)| self.nodes[*k].is_some()) {
            for chart in &tile.mesh.charts {
                for t in chart.triangles.clone() {
                    let triangle = &tile.mesh.triangles[t];
                    for c in (0..3).filter(|&c| triangle.neighbours[c] == NONE) {
                        let [a, b] = ends(c).map(|c| place(chart.vertices[triangle.local[c] as usize]));
                        sides.push(([a.min(b), a.max(b)], k as u32, t as u32, c as u8));
                    }
                }
            }
        }
        sides.sort_unstable();
        for twins in sides.chunk_by(|a, b| a.0 == b.0).filter(|twins| twins.len() == 2) {
            let edges = [0, 1].map(|k| {
                let (vertices, tile, t, c) = twins[k];
                let mesh = tiles[tile as usize].mesh;
                edge(mesh, t, c as usize, |v| place(v) == vertices[0])
            });
            let cells = |k: usize| {
                let [nx, ny] = tiles[twins[k].1 as usize].cells().map(|n| n as f64);
                ((edges[k][1] - edges[k][0]) * DVec2::new(nx, ny)).abs().max_element()
            };
            let steps = (2.0 * cells(0).max(cells(1))).ceil().min(1e5) as usize + 1;
            for step in 0..=steps {
                let t = step as f64 / steps as f64;
                let found = [0, 1].map(|k| {
                    let (_, tile, triangle, _) = twins[k];
                    self.rigid_near(tile, triangle, edges[k][0] + t * (edges[k][1] - edges[k][0]))
                });
                if let [Some(a), Some(b)] = found {
                    self.join(a, b);
                }
            }
        }
    }

    /// The nearest rigid node of a triangle's chart at the cell of a UV.
    fn rigid_near(&self, tile: u32, triangle: u32, uv: DVec2) -> Option<u32> {
        let nodes = self.nodes[tile as usize].as_ref()?;
        let surface = self.surfaces[tile as usize].as_ref()?;
        let mut best: Option<(f64, u32)> = None;
        for (n, weight) in nodes.corners(uv) {
            let is_of = |t: u32| t != NONE && surface.chart(t) == surface.chart(triangle);
            if nodes.rigid[n] != NONE
                && is_of(nodes.triangle[n])
                && best.is_none_or(|(most, _)| weight > most)
            {
                best = Some((weight, nodes.rigid[n]));
            }
        }
        best.map(|(_, rigid)| rigid)
    }

    /// The feature at a point of a triangle, as the number of one of its nodes, and how far the point moves with it:
    /// from 0 where features end to 1. Beside a chart there are no nodes, so that the mean is one of those that there
    /// are.
    pub fn at(&self, tile: u32, triangle: u32, uv: DVec2) -> Option<(u32, f32)> {
        let nodes = self.nodes[tile as usize].as_ref()?;
        let surface = self.surfaces[tile as usize].as_ref()?;
        let feature = self.rigid_near(tile, triangle, uv)?;
        let (mut sum, mut all) = (0.0, 0.0);
        for (n, weight) in nodes.corners(uv) {
            if nodes.triangle[n] != NONE && surface.chart(nodes.triangle[n]) == surface.chart(triangle) {
                (sum, all) = (sum + weight * f64::from(nodes.rigidity[n]), all + weight);
            }
        }
        // A corner exactly at the point has all of the weight.
        let rigidity = if all > 0.0 {
            (sum / all) as f32
        } else {
            nodes.rigidity[self.rigid[feature as usize].1 as usize]
        };
        let part = smooth(f64::from((rigidity - RIGID) / (WHOLE - RIGID))) as f32;
        (part > 0.0).then_some((feature, part))
    }

    /// Numbers the features that are `used`, given by one of their nodes, and replaces these by the numbers. Returns
    /// the nodes by which they move, those of each feature in a row, and where each row ends.
    pub fn of_use(
        mut self,
        tiles: &[Tile],
        rest: &[Posed],
        used: &mut [u32],
    ) -> (Vec<FeatureNode>, Vec<u32>) {
        let mut number = vec![NONE; self.rigid.len()];
        let mut count = 0;
        for feature in used.iter_mut().filter(|feature| **feature != NONE) {
            let root = root(&mut self.sets, *feature) as usize;
            if number[root] == NONE {
                number[root] = count;
                count += 1;
            }
            *feature = number[root];
        }
        let mut members: Vec<(u32, u32)> = Vec::new();
        for a in 0..self.rigid.len() as u32 {
            let root = root(&mut self.sets, a) as usize;
            if number[root] != NONE {
                members.push((number[root], a));
            }
        }
        members.sort_unstable();
        let (mut found, mut ends) = (Vec::new(), Vec::with_capacity(count as usize));
        for of_feature in members.chunk_by(|a, b| a.0 == b.0) {
            let stride = (1..).find(|stride| of_feature.len() / (stride * stride) <= MOST).unwrap_or(1);
            let rims = of_feature.iter().filter(|(_, a)| self.is_rim(*a)).count();
            let rim_stride = rims.div_ceil(MOST).max(1);
            let mut rim = 0;
            for &(_, a) in of_feature {
                let (tile, n) = self.rigid[a as usize];
                let nodes = self.nodes[tile as usize].as_ref();
                let is_rim = self.is_rim(a);
                rim += usize::from(is_rim);
                let is_rim = is_rim && rim % rim_stride == 0;
                let Some((nodes, surface)) = nodes.zip(self.surfaces[tile as usize].as_ref()) else {
                    continue;
                };
                let n = n as usize;
                let (i, j) = (n % nodes.size[0], n / nodes.size[0]);
                let fits = i % stride == 0 && j % stride == 0;
                if !fits && !is_rim {
                    continue;
                }
                let (triangle, uv) = (nodes.triangle[n], nodes.uv(n));
                let of = &tiles[tile as usize];
                let weights = weights(of.mesh.triangles[triangle as usize].uv, uv);
                let spot = Spot { triangle, weights, is_inside: true };
                let place = surface.place(&rest[tile as usize], &spot);
                let cell = place.tangents[0].cross(place.tangents[1]).length() / nodes.triangle.len() as f64;
                let weight = if fits { f64::from(nodes.rigidity[n]) * cell } else { 0.0 };
                let node = of.node(surface.chart(triangle), i as i64, j as i64);
                found.push(FeatureNode { tile, triangle, node, uv, rest: place.at, weight, is_rim });
            }
            ends.push(found.len() as u32);
        }
        (found, ends)
    }

    /// True if a neighbour along an axis is no rigid node.
    fn is_rim(&self, a: u32) -> bool {
        let (tile, n) = self.rigid[a as usize];
        let Some(nodes) = &self.nodes[tile as usize] else { return false };
        let ([width, height], n) = (nodes.size, n as usize);
        let (i, j) = (n % width, n / width);
        let is_rigid = |n: usize| nodes.rigid[n] != NONE;
        !(i > 0 && is_rigid(n - 1) && i + 1 < width && is_rigid(n + 1))
            || !(j > 0 && is_rigid(n - width) && j + 1 < height && is_rigid(n + width))
    }
}

/// The corners at the ends of the side opposite to a corner.
fn ends(corner: usize) -> [usize; 2] {
    [(corner + 1) % 3, (corner + 2) % 3]
}

/// The UVs of a side's ends, that of the `first` vertex first.
fn edge(mesh: &TileMesh, t: u32, corner: usize, first: impl Fn(u32) -> bool) -> [DVec2; 2] {
    let triangle = &mesh.triangles[t as usize];
    let vertices = &mesh.charts[mesh.chart_of_triangle(t) as usize].vertices;
    let [a, b] = ends(corner);
    let (p, q) = (triangle.uv[a], triangle.uv[b]);
    if first(vertices[triangle.local[a] as usize]) { [p, q] } else { [q, p] }
}
