//! The weights with which corrections are interpolated from a level to the next finer one (method §7.5): linearly in x,
//! then in y, with more weight on the neighbour with the stiffer connection. With weights of one half, interpolation
//! would stretch rigid features on coarse levels, where one coarse cell holds rigid and elastic material; the
//! preconditioner would then converge slowly, and more slowly with a greater ratio of stiffnesses (200 to 1).
//!
//! The weights come from a scalar model of the energy's second derivative, with the same sparsity. Each edge has a
//! stiffness, from which the weights are computed as in Dendy's black box multigrid (1982), here split into an x and a
//! y part, and the coarser level's stiffness is the Galerkin product of the finer one's. Edges between two fixed nodes
//! have no effect and no stiffness. The model depends on rigidity, but not on the pose, so it is built once per map.
//!
//! It is computed patch by patch: for a square of 32 by 32 nodes, which a block of the coarser level covers, from these
//! nodes and a margin around them.

use super::codes::{decode_rigidity, encode_weight};
use super::survey::SurveyLevel;
use crate::allocation::{Vec, vec, zeroed};
use crate::grid::planes::EDGES;
use crate::grid::planes::{NODES, Plane, SIDE, slot};
use crate::mesh::NONE;
use crate::settings::TileSettings;
use crate::team::Team;

/// The stiffness of the edges `EDGES` of the nodes of a block.
pub type StiffnessPlanes = [Plane; 4];

/// The source of the stiffness of a level's edges.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    /// On level 0: the codes of rigidity, per block.
    Rigidity(&'a [Plane<u16>], &'a TileSettings),
    /// On the coarser levels: the stiffness of the level's edges, per block.
    Stiffness(&'a [StiffnessPlanes]),
}

/// The nodes of a level around a block of the next coarser one: its 32 by 32 nodes, 8 more around them, and one more row
/// and column.
pub const PATCH: usize = 2 * SIDE + 2 * MARGIN + 1;
/// Twice the reach of the Galerkin product and of its weights, and even.
pub const MARGIN: usize = 8;

/// The weights of the finer blocks under a block of the coarser level, and that block's stiffness.
#[derive(Clone)]
struct PatchResult {
    /// Per quarter of the coarser block, as codes of `encode_weight`.
    weights: [Plane<u8>; 4],
    stiffness: StiffnessPlanes,
}

/// Computes the model around the coarser level's block at (x, y) of a chart.
fn patch(finer: &SurveyLevel, source: Source, chart: u32, [x, y]: [u32; 2], result: &mut PatchResult) {
    let model = Stiffness::around(finer, source, chart, [x, y]);
    let (weights, coarser) = model.coarser();
    for (quarter, plane) in result.weights.iter_mut().enumerate() {
        let [first_i, first_j] = [quarter % 2, quarter / 2].map(|q| MARGIN + q * SIDE);
        for j in 0..SIDE {
            for i in 0..SIDE {
                plane[slot(i, j)] = encode_weight(weights[(first_j + j) * PATCH + first_i + i]);
            }
        }
    }
    for j in 0..SIDE {
        for i in 0..SIDE {
            let edges = coarser.edges[(MARGIN / 2 + j) * coarser.columns + MARGIN / 2 + i];
            for (plane, stiffness) in result.stiffness.iter_mut().zip(edges) {
                plane[slot(i, j)] = stiffness;
            }
        }
    }
}

/// Patches per round; they are computed before they are copied to their blocks.
const ROUND: usize = 1024;

/// Computes the patches over the given positions (chart, y, x) of the coarser level: the stiffness of the coarser
/// blocks and, if wanted, the weights of the finer blocks under them.
pub fn patches(
    team: &Team,
    [finer, coarser]: [&SurveyLevel; 2],
    source: Source,
    places: &[(u32, u32, u32)],
    mut weights: Option<&mut [Plane<u8>]>,
    stiffness: &mut [StiffnessPlanes],
) {
    // Allocated once for all rounds: a patch is too large for the stack.
    let mut found =
        vec![PatchResult { weights: [[0; NODES]; 4], stiffness: [[0.0; NODES]; 4] }; places.len().min(ROUND)];
    for round in places.chunks(ROUND) {
        team.fill(&mut found[..round.len()], |p, found| {
            let (chart, y, x) = round[p];
            patch(finer, source, chart, [x, y], found);
            let b = coarser.blocks.find(chart, i64::from(x), i64::from(y));
            if b != NONE {
                drop_fixed_edges(coarser, b as usize, &mut found.stiffness);
            }
        });
        for (&(chart, y, x), patch) in round.iter().zip(&found) {
            for (quarter, plane) in patch.weights.iter().enumerate() {
                let (qx, qy) = (quarter as u32 % 2, quarter as u32 / 2);
                let b = finer.blocks.find(chart, i64::from(2 * x + qx), i64::from(2 * y + qy));
                if let Some(weights) = weights.as_mut().filter(|_| b != NONE) {
                    weights[b as usize] = *plane;
                }
            }
            let b = coarser.blocks.find(chart, i64::from(x), i64::from(y));
            if b != NONE {
                stiffness[b as usize] = patch.stiffness;
            }
        }
    }
}

/// Sets the stiffness of the edges between two fixed nodes of block `b` to 0.
fn drop_fixed_edges(level: &SurveyLevel, b: usize, stiffness: &mut StiffnessPlanes) {
    let movable = level.blocks.window(&level.movable, b);
    for (plane, (di, dj)) in stiffness.iter_mut().zip(EDGES) {
        for j in 0..SIDE {
            for i in 0..SIDE {
                let far = ((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
                if !movable.contains(i + 1, j + 1) && !movable.contains(far.0, far.1) {
                    plane[slot(i, j)] = 0.0;
                }
            }
        }
    }
}

/// The scalar model on one level: the stiffness of the edges `EDGES` of each node, row by row.
pub struct Stiffness {
    columns: usize,
    rows: usize,
    edges: Vec<[f32; 4]>,
}

/// Indices of the directions in `EDGES`.
const EAST: usize = 0;
const NORTH: usize = 1;
const NORTH_EAST: usize = 2;
const NORTH_WEST: usize = 3;

impl Stiffness {
    /// The model at the nodes of a patch; 0 where the chart has no stored block.
    fn around(finer: &SurveyLevel, source: Source, chart: u32, [x, y]: [u32; 2]) -> Stiffness {
        let (columns, rows) = (PATCH, PATCH);
        let mut edges = zeroed(PATCH * PATCH);
        let mut rigidity = zeroed(if matches!(source, Source::Rigidity(..)) { PATCH * PATCH } else { 0 });
        let mut movable = zeroed(rigidity.len());
        let first = [x, y].map(|x| i64::from(x) * 2 * SIDE as i64 - MARGIN as i64);
        let side = SIDE as i64;
        for by in first[1].div_euclid(side)..=(first[1] + PATCH as i64 - 1).div_euclid(side) {
            for bx in first[0].div_euclid(side)..=(first[0] + PATCH as i64 - 1).div_euclid(side) {
                let b = finer.blocks.find(chart, bx, by);
                if b == NONE {
                    continue;
                }
                let b = b as usize;
                // The part of the patch that the block covers.
                let range = |at: i64, first: i64| {
                    let start = at * side;
                    (start.max(first), (start + side).min(first + PATCH as i64))
                };
                let ((i0, i1), (j0, j1)) = (range(bx, first[0]), range(by, first[1]));
                for j in j0..j1 {
                    for i in i0..i1 {
                        let n = (j - first[1]) as usize * PATCH + (i - first[0]) as usize;
                        let (i, j) = ((i - bx * side) as usize, (j - by * side) as usize);
                        match source {
                            Source::Rigidity(codes, _) => {
                                rigidity[n] = decode_rigidity(codes[b][slot(i, j)]);
                                movable[n] = finer.movable[b].contains(i, j);
                            }
                            Source::Stiffness(planes) => {
                                edges[n] = std::array::from_fn(|e| planes[b][e][slot(i, j)]);
                            }
                        }
                    }
                }
            }
        }
        if let Source::Rigidity(_, settings) = source {
            Self::at_rest(&mut edges, &rigidity, &movable, settings);
        }
        Stiffness { columns, rows, edges }
    }

    /// The model on level 0: half of the trace of the 2x2 block between two nodes, at rest.
    fn at_rest(edges: &mut [[f32; 4]], rigidity: &[f32], movable: &[bool], settings: &TileSettings) {
        for (y, row) in edges.chunks_exact_mut(PATCH).enumerate() {
            for (e, (di, dj)) in EDGES.into_iter().enumerate() {
                if y as i64 + dj >= PATCH as i64 {
                    continue;
                }
                let square = (di * di + dj * dj) as f32;
                // The columns whose neighbour in this direction is in the patch.
                let columns = usize::from(di < 0)..PATCH - usize::from(di > 0);
                for x in columns {
                    let n = y * PATCH + x;
                    let far = (n as i64 + dj * PATCH as i64 + di) as usize;
                    if movable[n] || movable[far] {
                        let weight = rigidity[n].max(rigidity[far]);
                        let smooth = settings.smoothness * (1.0 - weight) + settings.smoothness_floor;
                        row[x][e] = (0.5 * weight + smooth) / square;
                    }
                }
            }
        }
    }

    /// The stiffness of an edge of node (i, j); 0 for nodes beyond the level.
    fn at(&self, i: i64, j: i64, edge: usize) -> f32 {
        if i < 0 || j < 0 || i >= self.columns as i64 || j >= self.rows as i64 {
            return 0.0;
        }
        self.edges[j as usize * self.columns + i as usize][edge]
    }

    /// Returns the weights of this level, row by row, and the model on the next coarser one. A weight belongs to a
    /// node's lower neighbour: the western one at odd columns, the southern one at even columns and odd rows. The upper
    /// neighbour has the remaining weight.
    fn coarser(&self) -> (Vec<f32>, Stiffness) {
        let (mut weights, halfway) = self.collapse_x();
        let coarser = halfway.collapse_y(&mut weights, self.columns);
        (weights, coarser)
    }

    /// The weights at odd columns, and the Galerkin product on even columns and all rows.
    fn collapse_x(&self) -> (Vec<f32>, Stiffness) {
        let mut weights = vec![HALF; self.columns * self.rows];
        for j in 0..self.rows as i64 {
            for i in (1..self.columns as i64).step_by(2) {
                let west =
                    [self.at(i - 1, j, EAST), self.at(i, j, NORTH_WEST), self.at(i - 1, j - 1, NORTH_EAST)];
                let east =
                    [self.at(i, j, EAST), self.at(i, j, NORTH_EAST), self.at(i + 1, j - 1, NORTH_WEST)];
                weights[j as usize * self.columns + i as usize] = lower_weight(west, east);
            }
        }
        let weight = |i: i64, j: i64| {
            let inside = i >= 0 && j >= 0 && i < self.columns as i64 && j < self.rows as i64;
            if inside { weights[j as usize * self.columns + i as usize] } else { HALF }
        };
        let columns = (self.columns - 1) / 2 + 1;
        let halfway = (0..columns * self.rows).map(|n| {
            let (i, j) = (2 * (n % columns) as i64, (n / columns) as i64);
            let s = |di: i64, dj: i64, edge: usize| self.at(i + di, j + dj, edge);
            // The weights that nodes of the odd columns on both sides give to this column, in this row and the next.
            let (west, north_west) = (1.0 - weight(i - 1, j), 1.0 - weight(i - 1, j + 1));
            let (east, north_east) = (weight(i + 1, j), weight(i + 1, j + 1));
            // The edges from the odd node to the east to nodes of other rows: they couple its two neighbours, with a
            // negative stiffness.
            let to_other_rows = s(1, 0, NORTH)
                + s(1, 0, NORTH_EAST)
                + s(1, 0, NORTH_WEST)
                + s(1, -1, NORTH)
                + s(0, -1, NORTH_EAST)
                + s(2, -1, NORTH_WEST);
            [
                s(0, 0, EAST) * (1.0 - east) * (1.0 - east) + s(1, 0, EAST) * east * east
                    - to_other_rows * east * (1.0 - east),
                s(0, 0, NORTH)
                    + s(1, 0, NORTH) * east * north_east
                    + s(-1, 0, NORTH) * west * north_west
                    + s(0, 0, NORTH_EAST) * north_east
                    + s(-1, 0, NORTH_EAST) * west
                    + s(0, 0, NORTH_WEST) * north_west
                    + s(1, 0, NORTH_WEST) * east,
                s(1, 0, NORTH) * east * (1.0 - north_east)
                    + s(0, 0, NORTH_EAST) * (1.0 - north_east)
                    + s(1, 0, NORTH_EAST) * east,
                s(-1, 0, NORTH) * west * (1.0 - north_west)
                    + s(0, 0, NORTH_WEST) * (1.0 - north_west)
                    + s(-1, 0, NORTH_WEST) * west,
            ]
        });
        let halfway = halfway.collect();
        (weights, Stiffness { columns, rows: self.rows, edges: halfway })
    }

    /// Sets the weights at odd rows and even columns, and returns the model on the coarser level. `columns` is the
    /// number of columns before `collapse_x`.
    fn collapse_y(&self, weights: &mut [f32], columns: usize) -> Stiffness {
        for j in (1..self.rows as i64).step_by(2) {
            for i in 0..self.columns as i64 {
                let south = [
                    self.at(i, j - 1, NORTH),
                    self.at(i - 1, j - 1, NORTH_EAST),
                    self.at(i + 1, j - 1, NORTH_WEST),
                ];
                let north = [self.at(i, j, NORTH), self.at(i, j, NORTH_EAST), self.at(i, j, NORTH_WEST)];
                weights[j as usize * columns + 2 * i as usize] = lower_weight(south, north);
            }
        }
        let weight = |i: i64, j: i64| {
            let inside = i >= 0 && j >= 0 && i < self.columns as i64 && j < self.rows as i64;
            if inside { weights[j as usize * columns + 2 * i as usize] } else { HALF }
        };
        let rows = (self.rows - 1) / 2 + 1;
        let edges = (0..self.columns * rows).map(|n| {
            let (i, j) = ((n % self.columns) as i64, 2 * (n / self.columns) as i64);
            let s = |di: i64, dj: i64, edge: usize| self.at(i + di, j + dj, edge);
            // The weights that nodes of the odd rows on both sides give to this row, in this column and its neighbours.
            let (south, south_east) = (1.0 - weight(i, j - 1), 1.0 - weight(i + 1, j - 1));
            let (north, north_east, north_west) =
                (weight(i, j + 1), weight(i + 1, j + 1), weight(i - 1, j + 1));
            let to_other_columns = s(0, 1, EAST)
                + s(-1, 1, EAST)
                + s(0, 1, NORTH_EAST)
                + s(0, 1, NORTH_WEST)
                + s(1, 0, NORTH_WEST)
                + s(-1, 0, NORTH_EAST);
            [
                s(0, 0, EAST)
                    + s(0, 1, EAST) * north * north_east
                    + s(0, -1, EAST) * south * south_east
                    + s(0, 0, NORTH_EAST) * north_east
                    + s(1, 0, NORTH_WEST) * north
                    + s(0, -1, NORTH_EAST) * south
                    + s(1, -1, NORTH_WEST) * south_east,
                s(0, 0, NORTH) * (1.0 - north) * (1.0 - north) + s(0, 1, NORTH) * north * north
                    - to_other_columns * north * (1.0 - north),
                s(0, 1, EAST) * north * (1.0 - north_east)
                    + s(0, 0, NORTH_EAST) * (1.0 - north_east)
                    + s(0, 1, NORTH_EAST) * north,
                s(-1, 1, EAST) * north * (1.0 - north_west)
                    + s(0, 0, NORTH_WEST) * (1.0 - north_west)
                    + s(0, 1, NORTH_WEST) * north,
            ]
        });
        Stiffness { columns: self.columns, rows, edges: edges.collect() }
    }
}

/// The weight if both sides are equally stiff or have no stiffness.
const HALF: f32 = 0.5;

/// The lower neighbour's weight, given the stiffness of the edges to either side. Edges of coarse levels may have a
/// negative stiffness, which is ignored.
fn lower_weight(lower: [f32; 3], upper: [f32; 3]) -> f32 {
    let [lower, upper] = [lower, upper].map(|edges| edges.into_iter().map(|s| s.max(0.0)).sum::<f32>());
    if lower + upper > 0.0 { lower / (lower + upper) } else { HALF }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(nx: usize, ny: usize, rigidity: impl Fn(usize, usize) -> f32) -> Stiffness {
        let (columns, rows) = (nx + 1, ny + 1);
        let settings = TileSettings::default();
        let stiffness = |i: usize, j: usize, (di, dj): (i64, i64)| {
            let (x, y) = (i as i64 + di, j as i64 + dj);
            if x < 0 || x >= columns as i64 || y >= rows as i64 {
                return 0.0;
            }
            let weight = rigidity(i, j).max(rigidity(x as usize, y as usize));
            let smooth = settings.smoothness * (1.0 - weight) + settings.smoothness_floor;
            (0.5 * weight + smooth) / (di * di + dj * dj) as f32
        };
        let edges = (0..columns * rows).map(|n| EDGES.map(|e| stiffness(n % columns, n / columns, e)));
        Stiffness { columns, rows, edges: edges.collect() }
    }

    fn random(seed: &mut u32) -> f32 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (*seed >> 8) as f32 / (1 << 24) as f32
    }

    /// Σ s (u_a - u_b)² over all edges.
    fn energy(level: &Stiffness, u: &[f32]) -> f64 {
        let mut sum = 0.0;
        for n in 0..level.columns * level.rows {
            for (e, (di, dj)) in EDGES.into_iter().enumerate() {
                let (i, j) = ((n % level.columns) as i64 + di, (n / level.columns) as i64 + dj);
                if (0..level.columns as i64).contains(&i) && (0..level.rows as i64).contains(&j) {
                    let d = u[n] - u[j as usize * level.columns + i as usize];
                    sum += f64::from(level.edges[n][e]) * f64::from(d * d);
                }
            }
        }
        sum
    }

    /// Interpolates the values of a coarse level with the weights.
    fn interpolate(weights: &[f32], columns: usize, rows: usize, coarse: &[f32]) -> Vec<f32> {
        let wide = (columns - 1) / 2 + 1;
        let in_y = |i: usize, j: usize| {
            let low = coarse[j / 2 * wide + i];
            let weight = weights[j * columns + 2 * i];
            if j.is_multiple_of(2) {
                low
            } else {
                low * weight + coarse[(j / 2 + 1) * wide + i] * (1.0 - weight)
            }
        };
        (0..columns * rows)
            .map(|n| {
                let (i, j) = (n % columns, n / columns);
                let weight = weights[n];
                if i.is_multiple_of(2) {
                    in_y(i / 2, j)
                } else {
                    in_y(i / 2, j) * weight + in_y(i / 2 + 1, j) * (1.0 - weight)
                }
            })
            .collect()
    }

    #[test]
    fn the_coarser_level_is_the_galerkin_product() {
        let mut seed = 7;
        let values: Vec<f32> = (0..33 * 25).map(|_| random(&mut seed)).collect();
        let mut level = level(32, 24, |i, j| if values[j * 33 + i] < 0.4 { 1.0 } else { 0.0 });
        for _ in 0..3 {
            let (weights, coarser) = level.coarser();
            let coarse: Vec<f32> = (0..coarser.columns * coarser.rows).map(|_| random(&mut seed)).collect();
            let fine = interpolate(&weights, level.columns, level.rows, &coarse);
            let (a, b) = (energy(&level, &fine), energy(&coarser, &coarse));
            assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
            level = coarser;
        }
    }

    #[test]
    fn one_material_is_halved() {
        for rigidity in [0.0, 0.3, 1.0] {
            let (weights, coarser) = level(16, 16, |_, _| rigidity).coarser();
            // The rim's nodes have neighbours on one side only; they are fixed anyway.
            let inner = |n: &usize| (1..16).contains(&(n % 17)) && (1..16).contains(&(n / 17));
            assert!((0..17 * 17).filter(inner).all(|n| (weights[n] - 0.5).abs() < 1e-6), "{rigidity}");
            let (weights, _) = coarser.coarser();
            assert!((weights[9 * 3 + 3] - 0.5).abs() < 1e-6);
        }
    }

    #[test]
    fn the_stiffer_side_weighs_more() {
        // Rigid to the west of column 8, including the edges up to it. Column 7 lies in rigid material, column 9 in
        // elastic material.
        let (weights, _) = level(16, 16, |i, _| if i < 8 { 1.0 } else { 0.0 }).coarser();
        let at = |i: usize| weights[17 * 6 + i];
        assert!((at(7) - 0.5).abs() < 1e-6 && (at(9) - 0.5).abs() < 1e-6, "{} {}", at(7), at(9));
        // Rigid up to column 6: the stiffness to the west of column 7 is 0.5 + λ0 times the stiffness to its east.
        let (weights, _) = level(16, 16, |i, _| if i < 7 { 1.0 } else { 0.0 }).coarser();
        let settings = TileSettings::default();
        let (rigid, elastic) =
            (0.5 + settings.smoothness_floor, settings.smoothness + settings.smoothness_floor);
        assert!((weights[17 * 6 + 7] - rigid / (rigid + elastic)).abs() < 1e-6);
        // The same test along y.
        let (weights, _) = level(16, 16, |_, j| if j < 7 { 1.0 } else { 0.0 }).coarser();
        assert!((weights[17 * 7 + 6] - rigid / (rigid + elastic)).abs() < 1e-6);
    }
}
