//! A region of the surface as small triangles: where a mesh is coarse, each of its triangles is divided evenly, since a
//! coarse triangle cannot bend around a vertex of the border.

use glam::DVec3;

use super::surface::{Region, Rim, Side, Surface};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::mesh::NONE;

/// Most parts into which a side is divided.
const MOST_PARTS: usize = 8;
/// Regions are not divided into more triangles than this.
const MOST_TRIANGLES: usize = 1 << 17;

/// Small triangles, connected.
pub(super) struct Patch {
    pub triangles: Vec<PatchTriangle>,
    /// The sides at the chart's border, with the chart's own UVs.
    pub rims: Vec<(Side, Rim)>,
    /// The number of parts into which each side is divided.
    pub parts: usize,
}

pub(super) struct PatchTriangle {
    pub corners: [DVec3; 3],
    /// The triangle that it is part of, and the barycentric coordinates of its corners there.
    pub of: u32,
    pub weights: [[f64; 3]; 3],
    /// The side of another triangle beyond each side, or (NONE, 0).
    pub across: [Side; 3],
    /// True for each side with a second end that is the first end of the side beyond it.
    pub turns: [bool; 3],
}

/// A point of the patch: a vertex of the mesh (with its place twice), a point of an edge between two vertices, counted
/// from the lower one, or a point inside of a triangle.
type Point = (u32, u32, u32);

/// A side of a small triangle.
struct Edge {
    /// Its ends in ascending order, and whether the first end is the higher one.
    ends: [Point; 2],
    falls: bool,
    side: Side,
    /// The triangle of the mesh that it is part of, and the one beyond it: the same one inside of a triangle.
    of: u32,
    beyond: u32,
}

impl Patch {
    /// Divides a region so that sides are about as long as `side`, a length on the surface.
    pub fn new(surface: &Surface, region: &Region, side: f64) -> Patch {
        let most = ((MOST_TRIANGLES / region.triangles.len().max(1)) as f64).sqrt() as usize;
        let wanted = (surface.mean_side(&region.triangles) / side).ceil() as usize;
        let parts = wanted.min(most).clamp(1, MOST_PARTS);
        let mut patch = Patch { triangles: Vec::new(), rims: Vec::new(), parts };
        let mut edges: Vec<Edge> = Vec::new();
        for &g in &region.triangles {
            patch.divide(surface, g, parts, region, &mut edges);
        }
        patch.connect(edges);
        patch
    }

    fn divide(&mut self, surface: &Surface, g: u32, parts: usize, region: &Region, edges: &mut Vec<Edge>) {
        let (places, beyond) = (surface.places(g), surface.neighbours(g));
        let corners = places.map(|v| surface.point(v));
        let rims: [Option<Rim>; 3] = [0, 1, 2].map(|k| {
            let found = region.rims.binary_search_by_key(&(g, k), |(side, _)| *side);
            found.ok().map(|at| region.rims[at].1)
        });
        // Corner k of a small triangle has barycentric coordinates (n0, n1, n2) / parts.
        let n = parts as u32;
        let mut add = |of: [[u32; 3]; 3]| {
            let weights = of.map(|w| w.map(|x| f64::from(x) / f64::from(n)));
            let t = self.triangles.len() as u32;
            let corners = weights.map(|w| w[0] * corners[0] + w[1] * corners[1] + w[2] * corners[2]);
            let (across, turns) = ([(NONE, 0); 3], [false; 3]);
            self.triangles.push(PatchTriangle { corners, of: g, weights, across, turns });
            for k in 0..3usize {
                let ends = [of[(k + 1) % 3], of[(k + 2) % 3]];
                // The side of the mesh's triangle on which both ends lie.
                let on = (0..3).find(|&c| ends[0][c] == 0 && ends[1][c] == 0);
                let rim = on.and_then(|c| rims[c].map(|rim| (c, rim)));
                if let Some((c, rim)) = rim {
                    let along = |w: [u32; 3]| f64::from(w[(c + 2) % 3]) / f64::from(n);
                    // Along a line of the grid its coordinate stays what it is.
                    let uv = ends.map(|end| rim.uv[0] + along(end) * (rim.uv[1] - rim.uv[0]));
                    self.rims.push(((t, k as u8), Rim { uv, ..rim }));
                } else {
                    let [a, b] = ends.map(|end| point(g, places, end));
                    let beyond = on.map_or(g, |c| beyond[c]);
                    let (ends, side) = ([a.min(b), a.max(b)], (t, k as u8));
                    edges.push(Edge { ends, falls: a > b, side, of: g, beyond });
                }
            }
        };
        for i in 0..n {
            for j in 0..n - i {
                let at = |i: u32, j: u32| [n - i - j, i, j];
                add([at(i, j), at(i + 1, j), at(i, j + 1)]);
                if i + j + 1 < n {
                    add([at(i + 1, j + 1), at(i, j + 1), at(i + 1, j)]);
                }
            }
        }
    }

    /// Connects the small triangles at their common edges.
    fn connect(&mut self, mut edges: Vec<Edge>) {
        edges.sort_unstable_by_key(|edge| (edge.ends, edge.side));
        for at_edge in edges.chunk_by(|a, b| a.ends == b.ends) {
            for a in at_edge {
                // More than two where a third triangle stands on an edge that two others connect, and with mirror
                // images.
                let fits = |b: &&Edge| b.side != a.side && a.beyond == b.of && b.beyond == a.of;
                if let Some(b) = at_edge.iter().take(8).find(fits) {
                    let triangle = &mut self.triangles[a.side.0 as usize];
                    triangle.across[a.side.1 as usize] = b.side;
                    triangle.turns[a.side.1 as usize] = a.falls != b.falls;
                }
            }
        }
    }

    /// The rim at each side, as an index in `rims`, or `NONE`.
    pub fn rim_of_sides(&self) -> Vec<[u32; 3]> {
        let mut rims = vec![[NONE; 3]; self.triangles.len()];
        for (index, ((t, k), _)) in self.rims.iter().enumerate() {
            rims[*t as usize][*k as usize] = index as u32;
        }
        rims
    }
}

/// The point of a triangle with barycentric coordinates in proportion to `weights`.
fn point(g: u32, places: [u32; 3], weights: [u32; 3]) -> Point {
    if let Some(k) = (0..3).find(|&k| weights[(k + 1) % 3] == 0 && weights[(k + 2) % 3] == 0) {
        return (places[k], places[k], 0);
    }
    if let Some(k) = (0..3).find(|&k| weights[k] == 0) {
        let (a, b) = ((k + 1) % 3, (k + 2) % 3);
        let (low, high) = if places[a] < places[b] { (a, b) } else { (b, a) };
        return (places[low], places[high], weights[high]);
    }
    (NONE, g, weights[0] << 16 | weights[1])
}
