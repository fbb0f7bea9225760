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
//! nodes and a margin around them. Even and odd columns of a patch stand apart, as in planes, so that the columns of a
//! row are computed side by side.

use super::codes::{decode_rigidity, encode_weight};
use super::survey::SurveyLevel;
use crate::allocation::{Plain, vec, zeroed_box};
use crate::grid::planes::{EDGES, NODES, Plane, SIDE, slot};
use crate::mesh::NONE;
use crate::settings::TileSettings;
use crate::team::{PerThread, Team};

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

/// The nodes of a level around a block of the next coarser one: its 32 by 32 nodes, 8 more around them, and one more
/// row and column.
pub const PATCH: usize = 2 * SIDE + 2 * MARGIN + 1;
/// Twice the reach of the Galerkin product and of its weights, and even.
pub const MARGIN: usize = 8;

/// The weights of the finer blocks under a block of the coarser level, and that block's stiffness.
#[derive(Clone)]
struct PatchResult {
    /// The finer blocks, by quarter, and the coarser one, or `NONE`.
    children: [u32; 4],
    block: u32,
    /// Per quarter of the coarser block, as codes of `encode_weight`.
    weights: [Plane<u8>; 4],
    stiffness: StiffnessPlanes,
}

/// Patches per round; they are computed before they are copied to their blocks.
const ROUND: usize = 256;

/// Computes the patches over the given positions (chart, y, x) of the coarser level: the stiffness of the coarser
/// blocks and the weights of the finer blocks under them.
pub fn patches(
    team: &Team,
    [finer, coarser]: [&SurveyLevel; 2],
    source: Source,
    places: &[(u32, u32, u32)],
    weights: &mut [Plane<u8>],
    stiffness: &mut [StiffnessPlanes],
) {
    // Allocated once for all rounds: a patch is too large for the stack.
    let none = PatchResult {
        children: [NONE; 4],
        block: NONE,
        weights: [[0; NODES]; 4],
        stiffness: [[0.0; NODES]; 4],
    };
    let mut found = vec![none; places.len().min(ROUND)];
    let models = PerThread::new(team, zeroed_box::<Model>);
    for round in places.chunks(ROUND) {
        team.fill_on(&mut found[..round.len()], |worker, p, found| {
            let (chart, y, x) = round[p];
            found.children = std::array::from_fn(|quarter| {
                let [x, y] = [(x, quarter % 2), (y, quarter / 2)].map(|(x, q)| i64::from(x) * 2 + q as i64);
                finer.blocks.find(chart, x, y)
            });
            found.block = coarser.blocks.find(chart, i64::from(x), i64::from(y));
            models.with(worker, |model| {
                model.load(finer, source, (chart, [x, y]), &found.children);
                model.collapse();
                model.store(found);
            });
            if found.block != NONE {
                drop_fixed_edges(coarser, found.block as usize, &mut found.stiffness);
            }
        });
        for patch in &found[..round.len()] {
            for (&child, plane) in patch.children.iter().zip(&patch.weights).filter(|(b, _)| **b != NONE) {
                weights[child as usize] = *plane;
            }
            if patch.block != NONE {
                stiffness[patch.block as usize] = patch.stiffness;
            }
        }
    }
}

/// Sets the stiffness of the edges between two fixed nodes of block `b` to 0.
fn drop_fixed_edges(level: &SurveyLevel, b: usize, stiffness: &mut StiffnessPlanes) {
    let movable = level.blocks.window(&level.movable, b);
    for (plane, (di, dj)) in stiffness.iter_mut().zip(EDGES) {
        for j in 0..SIDE {
            let far = movable.0[(j as i64 + 1 + dj) as usize] >> (1 + di);
            let kept = movable.0[j + 1] >> 1 | far;
            for i in (0..SIDE).filter(|i| kept >> i & 1 == 0) {
                plane[slot(i, j)] = 0.0;
            }
        }
    }
}

/// Indices of the directions in `EDGES`.
const EAST: usize = 0;
const NORTH: usize = 1;
const NORTH_EAST: usize = 2;
const NORTH_WEST: usize = 3;

/// A number at the even or the odd columns of a row of a patch.
type Row = [f32; COLUMNS];
/// Even columns of a patch; there is one odd column less.
pub const COLUMNS: usize = PATCH / 2 + 1;
/// One quantity on a patch, at even or odd columns.
type Half<T = Row> = [T; PATCH];

/// The even columns of the coarser level's block, and those whose stiffness on even columns and all rows it follows
/// from.
pub const OWN: std::ops::Range<usize> = MARGIN / 2..MARGIN / 2 + SIDE;
const AROUND: std::ops::Range<usize> = OWN.start - 2..OWN.end + 2;
/// The rows of these, and those whose weights and edges they follow from.
const ROWS: std::ops::Range<usize> = MARGIN - 2..MARGIN + 2 * SIDE;

/// The scalar model on a patch: the stiffness of the edges `EDGES` of each node.
pub struct Model {
    /// At even and odd columns, per direction.
    pub edges: [[Half; 4]; 2],
    /// Rigidity, and 1 for nodes that may move, at even and odd columns.
    pub rigidity: [Half; 2],
    pub movable: [Half; 2],
    /// A weight belongs to a node's lower neighbour: the western one at odd columns, the southern one at even columns
    /// and odd rows. The upper neighbour has the remaining weight.
    pub west: Half,
    pub south: Half,
    /// The Galerkin product on even columns and all rows.
    pub halfway: [Half; 4],
    /// The stiffness on even columns and even rows.
    pub coarser: [[Row; COLUMNS]; 4],
}

// SAFETY: arrays of numbers.
unsafe impl Plain for Model {}

impl Model {
    /// Takes over what the source has at the nodes of the patch over the block at (x, y) of the coarser level of a
    /// chart; 0 where the chart has no stored block. `children` are the finer blocks under that block.
    fn load(
        &mut self,
        finer: &SurveyLevel,
        source: Source,
        (chart, [x, y]): (u32, [u32; 2]),
        children: &[u32; 4],
    ) {
        match source {
            Source::Rigidity(..) => {
                let both = [&mut self.rigidity, &mut self.movable];
                both.into_iter().for_each(|of| of.as_flattened_mut().as_flattened_mut().fill(0.0));
            }
            Source::Stiffness(_) => {
                self.edges.as_flattened_mut().as_flattened_mut().as_flattened_mut().fill(0.0);
            }
        }
        // The patch begins in the middle of a block, and ends in the fourth one.
        for (bx, by) in (0..16).map(|n| (n % 4, n / 4)) {
            let [near_x, near_y] = [bx, by].map(|b: usize| b.clamp(1, 2));
            let b = match children[(near_y - 1) * 2 + near_x - 1] {
                NONE => {
                    let [x, y] = [(x, bx), (y, by)].map(|(x, b)| 2 * i64::from(x) + b as i64 - 1);
                    finer.blocks.find(chart, x, y)
                }
                near => finer.blocks.neighbours[near as usize][(by + 1 - near_y) * 3 + bx + 1 - near_x],
            };
            if b != NONE {
                self.load_block(finer, source, b as usize, [bx, by]);
            }
        }
        if let Source::Rigidity(_, settings) = source {
            self.at_rest(settings);
        }
    }

    /// Takes over what the source has at the nodes of one block, the position of which is counted from the first one.
    fn load_block(&mut self, finer: &SurveyLevel, source: Source, b: usize, [bx, by]: [usize; 2]) {
        let first = [bx, by].map(|b| (b * SIDE) as i64 - MARGIN as i64);
        for j in 0..SIDE {
            let Ok(row) = usize::try_from(first[1] + j as i64) else { continue };
            if row >= PATCH {
                break;
            }
            for odd in 0..2 {
                // The part of the block's columns that lies in the patch.
                let column = first[0] / 2;
                let skip = (-column).max(0) as usize;
                let end = (COLUMNS as i64 - column).min(SIDE as i64 / 2) as usize;
                let (from, to) = (slot(odd, j) + skip, (column + skip as i64) as usize);
                let count = end - skip;
                match source {
                    Source::Rigidity(codes, _) => {
                        let codes = &codes[b][from..from + count];
                        let rigidity = &mut self.rigidity[odd][row][to..to + count];
                        rigidity.iter_mut().zip(codes).for_each(|(of, &code)| *of = decode_rigidity(code));
                        let bits = u32::from(finer.movable[b].0[j]) >> odd >> (2 * skip);
                        let movable = &mut self.movable[odd][row][to..to + count];
                        for (k, movable) in movable.iter_mut().enumerate() {
                            *movable = (bits >> (2 * k) & 1) as f32;
                        }
                    }
                    Source::Stiffness(planes) => {
                        for (edges, plane) in self.edges[odd].iter_mut().zip(&planes[b]) {
                            edges[row][to..to + count].copy_from_slice(&plane[from..from + count]);
                        }
                    }
                }
            }
        }
    }

    /// The model on level 0: half of the trace of the 2x2 block between two nodes, at rest.
    pub fn at_rest(&mut self, settings: &TileSettings) {
        let Model { edges: [even, odd], rigidity, movable, .. } = self;
        let (smoothness, floor) = (settings.smoothness, settings.smoothness_floor);
        for j in ROWS.start - 1..=ROWS.end {
            // Of the nodes of a row, `near`, and of those at the other ends of their edges, `far`.
            let edge = |out: &mut Row, near: usize, first: usize, far: usize, dj: usize, square: f32| {
                let r = (&rigidity[near][j][1..COLUMNS - 1], &rigidity[far][j + dj][first..]);
                let m = (&movable[near][j][1..COLUMNS - 1], &movable[far][j + dj][first..]);
                for (k, out) in out[1..COLUMNS - 1].iter_mut().enumerate() {
                    let weight = r.0[k].max(r.1[k]);
                    let smooth = smoothness * (1.0 - weight) + floor;
                    let stiffness = (0.5 * weight + smooth) / square;
                    *out = if m.0[k] + m.1[k] > 0.0 { stiffness } else { 0.0 };
                }
            };
            edge(&mut even[EAST][j], 0, 1, 1, 0, 1.0);
            edge(&mut odd[EAST][j], 1, 2, 0, 0, 1.0);
            edge(&mut even[NORTH][j], 0, 1, 0, 1, 1.0);
            edge(&mut odd[NORTH][j], 1, 1, 1, 1, 1.0);
            edge(&mut even[NORTH_EAST][j], 0, 1, 1, 1, 2.0);
            edge(&mut odd[NORTH_EAST][j], 1, 2, 0, 1, 2.0);
            edge(&mut even[NORTH_WEST][j], 0, 0, 1, 1, 2.0);
            edge(&mut odd[NORTH_WEST][j], 1, 1, 0, 1, 2.0);
        }
    }

    /// Computes the weights and the model on the coarser level.
    pub fn collapse(&mut self) {
        for j in ROWS.start..=ROWS.end {
            self.weigh_x(j);
        }
        for j in ROWS {
            self.collapse_x(j);
        }
        for j in ROWS.skip(1).step_by(2) {
            self.weigh_y(j);
        }
        for j in OWN {
            self.collapse_y(j);
        }
    }

    /// The weights at odd columns of a row.
    #[inline(always)]
    fn weigh_x(&mut self, j: usize) {
        let Model { edges: [even, odd], west, .. } = self;
        let [east, north_east, north_west] = [EAST, NORTH_EAST, NORTH_WEST].map(|e| &odd[e][j]);
        let (west_east, below_north_east) = (&even[EAST][j], &even[NORTH_EAST][j - 1]);
        let below_north_west = &even[NORTH_WEST][j - 1];
        for i in AROUND.start - 1..AROUND.end {
            let lower = [west_east[i], north_west[i], below_north_east[i]];
            west[j][i] = lower_weight(lower, [east[i], north_east[i], below_north_west[i + 1]]);
        }
    }

    /// The Galerkin product on the even columns of a row.
    #[inline(always)]
    fn collapse_x(&mut self, j: usize) {
        let Model { edges: [even, odd], west: weights, halfway, .. } = self;
        let (e, o) = (even.each_ref().map(|edges| &edges[j]), odd.each_ref().map(|edges| &edges[j]));
        let (e_below, o_below) =
            (even.each_ref().map(|edges| &edges[j - 1]), odd.each_ref().map(|edges| &edges[j - 1]));
        let (here, above) = (&weights[j], &weights[j + 1]);
        let [out_east, out_north, out_north_east, out_north_west] =
            halfway.each_mut().map(|edges| &mut edges[j]);
        for i in AROUND {
            // The weights that nodes of the odd columns on both sides give to this column, in this row and the next.
            let (west, north_west) = (1.0 - here[i - 1], 1.0 - above[i - 1]);
            let (east, north_east) = (here[i], above[i]);
            // The edges from the odd node to the east to nodes of other rows: they couple its two neighbours, with a
            // negative stiffness.
            let to_other_rows = o[NORTH][i]
                + o[NORTH_EAST][i]
                + o[NORTH_WEST][i]
                + o_below[NORTH][i]
                + e_below[NORTH_EAST][i]
                + e_below[NORTH_WEST][i + 1];
            out_east[i] = e[EAST][i] * (1.0 - east) * (1.0 - east) + o[EAST][i] * east * east
                - to_other_rows * east * (1.0 - east);
            out_north[i] = e[NORTH][i]
                + o[NORTH][i] * east * north_east
                + o[NORTH][i - 1] * west * north_west
                + e[NORTH_EAST][i] * north_east
                + o[NORTH_EAST][i - 1] * west
                + e[NORTH_WEST][i] * north_west
                + o[NORTH_WEST][i] * east;
            out_north_east[i] = o[NORTH][i] * east * (1.0 - north_east)
                + e[NORTH_EAST][i] * (1.0 - north_east)
                + o[NORTH_EAST][i] * east;
            out_north_west[i] = o[NORTH][i - 1] * west * (1.0 - north_west)
                + e[NORTH_WEST][i] * (1.0 - north_west)
                + o[NORTH_WEST][i - 1] * west;
        }
    }

    /// The weights at the even columns of an odd row.
    #[inline(always)]
    fn weigh_y(&mut self, j: usize) {
        let Model { halfway, south, .. } = self;
        let [north, north_east, north_west] = [NORTH, NORTH_EAST, NORTH_WEST].map(|e| &halfway[e][j]);
        let [below, below_north_east, below_north_west] =
            [NORTH, NORTH_EAST, NORTH_WEST].map(|e| &halfway[e][j - 1]);
        for i in OWN.start - 1..OWN.end + 1 {
            let lower = [below[i], below_north_east[i - 1], below_north_west[i + 1]];
            south[j][i] = lower_weight(lower, [north[i], north_east[i], north_west[i]]);
        }
    }

    /// The Galerkin product on the even columns of an even row, the number of which counts even rows.
    #[inline(always)]
    fn collapse_y(&mut self, j: usize) {
        let Model { halfway, south: weights, coarser, .. } = self;
        let (s, above, below) = (
            halfway.each_ref().map(|edges| &edges[2 * j]),
            halfway.each_ref().map(|edges| &edges[2 * j + 1]),
            halfway.each_ref().map(|edges| &edges[2 * j - 1]),
        );
        let (lower, upper) = (&weights[2 * j - 1], &weights[2 * j + 1]);
        let [out_east, out_north, out_north_east, out_north_west] =
            coarser.each_mut().map(|edges| &mut edges[j]);
        for i in OWN {
            // The weights that nodes of the odd rows on both sides give to this row, in this column and its neighbours.
            let (south, south_east) = (1.0 - lower[i], 1.0 - lower[i + 1]);
            let (north, north_east, north_west) = (upper[i], upper[i + 1], upper[i - 1]);
            let to_other_columns = above[EAST][i]
                + above[EAST][i - 1]
                + above[NORTH_EAST][i]
                + above[NORTH_WEST][i]
                + s[NORTH_WEST][i + 1]
                + s[NORTH_EAST][i - 1];
            out_east[i] = s[EAST][i]
                + above[EAST][i] * north * north_east
                + below[EAST][i] * south * south_east
                + s[NORTH_EAST][i] * north_east
                + s[NORTH_WEST][i + 1] * north
                + below[NORTH_EAST][i] * south
                + below[NORTH_WEST][i + 1] * south_east;
            out_north[i] = s[NORTH][i] * (1.0 - north) * (1.0 - north) + above[NORTH][i] * north * north
                - to_other_columns * north * (1.0 - north);
            out_north_east[i] = above[EAST][i] * north * (1.0 - north_east)
                + s[NORTH_EAST][i] * (1.0 - north_east)
                + above[NORTH_EAST][i] * north;
            out_north_west[i] = above[EAST][i - 1] * north * (1.0 - north_west)
                + s[NORTH_WEST][i] * (1.0 - north_west)
                + above[NORTH_WEST][i] * north;
        }
    }

    /// Gives the results to the blocks.
    fn store(&self, result: &mut PatchResult) {
        for (quarter, plane) in result.weights.iter_mut().enumerate() {
            let (first, row) = (OWN.start + quarter % 2 * (SIDE / 2), MARGIN + quarter / 2 * SIDE);
            for j in 0..SIDE {
                for odd in 0..2 {
                    let codes = &mut plane[slot(odd, j)..][..SIDE / 2];
                    match (odd, j % 2) {
                        (0, 0) => codes.fill(encode_weight(HALF)),
                        (0, _) => encode(&self.south[row + j][first..], codes),
                        _ => encode(&self.west[row + j][first..], codes),
                    }
                }
            }
        }
        for (plane, edges) in result.stiffness.iter_mut().zip(&self.coarser) {
            for (j, row) in edges[OWN].iter().enumerate() {
                for (i, stiffness) in row[OWN].iter().enumerate() {
                    plane[slot(i, j)] = *stiffness;
                }
            }
        }
    }
}

fn encode(weights: &[f32], codes: &mut [u8]) {
    codes.iter_mut().zip(weights).for_each(|(code, weight)| *code = encode_weight(*weight));
}

/// The weight if both sides are equally stiff or have no stiffness.
const HALF: f32 = 0.5;

/// The lower neighbour's weight, given the stiffness of the edges to either side. Edges of coarse levels may have a
/// negative stiffness, which is ignored.
#[inline(always)]
fn lower_weight(lower: [f32; 3], upper: [f32; 3]) -> f32 {
    let [lower, upper] = [lower, upper].map(|edges| edges.into_iter().map(|s| s.max(0.0)).sum::<f32>());
    if lower + upper > 0.0 { lower / (lower + upper) } else { HALF }
}
