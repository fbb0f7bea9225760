//! The grid of a tile (method §1 to §3), built from the mesh, the maps and the settings: rigidity, mobility, blocks,
//! rest lengths and weights of interpolation on every level, and the triangle under each node of level 0.

pub(crate) mod blocks;
pub(crate) mod codes;
pub(crate) mod coverage;
pub(crate) mod density;
pub(crate) mod fill;
pub(crate) mod window;
pub(crate) mod interpolation;
pub(crate) mod metric;
pub(crate) mod pose;
pub(crate) mod pyramid;

use glam::DVec2;

use crate::image::Map;
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::settings::{MAX_GRID, TileSettings};
use blocks::{Block, Blocks, Plane, SIDE, slot};
use codes::Lengths;
use coverage::Coverage;
use interpolation::Stiffness;
use metric::Gather;
use pose::{Pose, PoseTriangle};
use pyramid::NodeMaps;

/// Offsets of the four edges that a node owns: east, north, north-east, north-west. The other four belong to its
/// neighbours (the paper's V_horz, V_vert, V_shear0, V_shear1).
pub const EDGES: [(i64, i64); 4] = [(1, 0), (0, 1), (1, 1), (-1, 1)];

/// The source of a tile's rigidity.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) enum Rigidity {
    /// Nothing is rigid.
    #[default]
    None,
    /// An image.
    Map(Map),
    /// One value per vertex of the mesh.
    Vertices(Vec<f32>),
}

/// A tile's maps and settings, as the host has set them.
#[derive(Clone, Debug, Default)]
pub(crate) struct TileMaps {
    pub rigidity: Rigidity,
    pub mask: Option<Map>,
    pub settings: TileSettings,
}

/// Cells on a side of the grid of a tile with rigidity per vertex, unless a setting gives its size.
const VERTEX_GRID: usize = 1024;

impl TileMaps {
    /// Cells of the grid: the settings', or the rigidity map's size, rounded up to a multiple of 16.
    pub fn grid_size(&self) -> [usize; 2] {
        let default = match &self.rigidity {
            Rigidity::Map(map) => [map.width, map.height],
            Rigidity::Vertices(_) => [VERTEX_GRID; 2],
            // No node will be movable: the smallest grid is enough.
            Rigidity::None => [SIDE; 2],
        };
        std::array::from_fn(|axis| {
            let n = self.settings.grid[axis].map_or(default[axis], |n| n as usize);
            n.next_multiple_of(SIDE).min(MAX_GRID as usize)
        })
    }
}

/// A triangle in the UV plane, in cells, prepared for point location (method §2).
#[derive(Clone, Copy, Debug)]
pub struct UvTriangle {
    /// Its first UV corner, in cells.
    pub origin: [f32; 2],
    /// Rows of the 2x2 matrix that takes an offset from `origin` to the barycentric coordinates of corners 1 and 2.
    pub barycentric: [[f32; 2]; 2],
    /// The triangle across the edge opposite to each corner, or `NONE`.
    pub neighbours: [u32; 3],
}

/// One level of a tile's grid: all of its data that does not depend on the pose.
#[derive(Debug)]
pub struct Level {
    /// Cells along u.
    pub nx: usize,
    /// Cells along v.
    pub ny: usize,
    pub blocks: Blocks,
    /// Per block: rigidity, as codes of `codes::encode_rigidity`.
    pub rigidity: Vec<Plane<u16>>,
    /// Per block: density ρ of rigid material around each node, 0..1 (method §4). Empty unless a setting asks for it.
    pub density: Vec<Plane>,
    /// Per block: weight of each node's lower neighbour where corrections are interpolated from the next coarser level
    /// (method §7.5; the upper neighbour has the rest), as codes of `codes::encode_weight`. Empty on the coarsest
    /// level.
    pub interpolation: Vec<Plane<u8>>,
    /// Per block: 1 for movable nodes, 0 for fixed ones.
    pub movable: Vec<Plane<u8>>,
    /// Per block: rest lengths l of the edges `EDGES` of each node, in units of the chart, as codes of `lengths`.
    pub rest_length: Vec<[Plane<u16>; 4]>,
    /// Per chart: the coding of rest lengths, for each of `EDGES`.
    pub lengths: Vec<[Lengths; 4]>,
    /// Per chart: floor of rest lengths (method §2).
    pub floor: Vec<f32>,
    /// Per block, on coarser levels: each node's coverage θ by the chart, 0..1 (method §3).
    pub coverage: Vec<Plane>,
    /// Per block: the block of the next finer level at (2x, 2y), (2x + 1, 2y), (2x, 2y + 1), (2x + 1, 2y + 1).
    pub children: Vec<[u32; 4]>,
    /// Per block: the block of the next coarser level that holds its even nodes, or `NONE`.
    pub parent: Vec<u32>,
}

/// A tile's grid: all data that is built once per mesh, maps and settings.
#[derive(Debug)]
pub struct Grid {
    pub levels: Vec<Level>,
    pub triangles: Vec<UvTriangle>,
    pub chart_of: Vec<u32>,
    /// Per block of level 0: the triangle under each node at rest.
    pub triangle: Vec<Plane<u32>>,
    /// The triangles in the dual cell of each node of level 1, with their fractions of its covered area.
    pub gather: Gather,
    /// Movable nodes of level 0, per chart; 0 for a chart without rigidity (method §1).
    pub movable: Vec<u64>,
    /// Fraction of the covered nodes that more than one layer covers.
    pub overlap: f32,
    /// The rest pose, in the charts' units.
    pub rest: Pose,
}

/// Floor of rest lengths, as a fraction of the chart's median edge (method §2): a texel that maps onto almost nothing
/// must not dominate the energy.
const FLOOR_FRACTION: f32 = 0.05;

impl Grid {
    /// Builds a tile's grid.
    pub(crate) fn new(mesh: &Mesh, tile: &TileMesh, maps: &TileMaps, coverage: &Coverage) -> Grid {
        let finest = node_maps(mesh, tile, maps, coverage);
        let charts = tile.charts.len();
        let (nx, ny) = (coverage.nx, coverage.ny);
        let mut movable = vec![0u64; charts];
        finest.chart.iter().filter(|&&c| c != NONE).for_each(|&c| movable[c as usize] += 1);
        let rest = Pose::new(tile, |v| mesh.rest[v as usize], None);
        let triangles = uv_triangles(tile, nx, ny);
        let density = (maps.settings.orientation_density > 0.0).then(|| density::density(&finest));
        let mut levels: Vec<Level> = Vec::new();
        let mut stiffness = Stiffness::new(&finest, &maps.settings);
        let mut maps = finest;
        loop {
            let mut level = Level::new(&maps, charts, levels.last_mut());
            if let Some(density) = &density {
                let step = 1 << levels.len();
                level.density = planes(&level, |i, j| density[j * step * (nx + 1) + i * step]);
            }
            let coarser = maps.coarser();
            if coarser.nx == 0 || coarser.ny == 0 || coarser.is_fixed() {
                levels.push(level);
                break;
            }
            let (weights, next) = stiffness.coarser();
            level.interpolation = planes(&level, |i, j| codes::encode_weight(weights[j * (maps.nx + 1) + i]));
            levels.push(level);
            (maps, stiffness) = (coarser, next);
        }
        let triangle = planes(&levels[0], |i, j| coverage.triangle[j * (nx + 1) + i]);
        let mut gather = Gather::default();
        if let Some(level) = levels.get_mut(1) {
            (gather, level.coverage) = Gather::new(tile, nx, ny, level);
        }
        let chart_of = tile.chart_of_triangles();
        let overlap = coverage.overlap;
        let mut grid = Grid { levels, triangles, chart_of, triangle, gather, movable, overlap, rest };
        metric::rest_lengths(&mut grid, mesh, tile);
        grid
    }

    /// True if the identity is a chart's best warp for a pose, so that it needs no solve (method §5): it has no movable
    /// node, its floor is 0, or its triangle edges are as long as at rest.
    pub(crate) fn is_still(&self, tile: &TileMesh, pose: &Pose, chart: usize) -> bool {
        self.movable[chart] == 0
            || self.levels[0].floor[chart] == 0.0
            || pose.is_isometric(&self.rest, tile, chart)
    }

    /// Returns the function from a triangle's number to the triangle in a pose.
    pub(crate) fn pose_triangles<'a>(
        &'a self,
        tile: &'a TileMesh,
        pose: &'a Pose,
    ) -> impl Fn(usize) -> PoseTriangle + 'a {
        move |t| {
            let positions = &pose.charts[self.chart_of[t] as usize].positions;
            let corners = tile.triangles[t].local.map(|v| positions[v as usize]);
            PoseTriangle::new(corners, &self.triangles[t].barycentric)
        }
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        let per_block = NODE_BYTES * blocks::NODES;
        let level_bytes = |l: &Level| {
            l.blocks.list.len() * per_block
                + (l.density.len() + l.coverage.len()) * size_of::<Plane>()
                + l.interpolation.len() * blocks::NODES
        };
        let levels: usize = self.levels.iter().map(level_bytes).sum();
        let finest = self.triangle.len() * blocks::NODES * 4;
        let triangles = self.triangles.len() * (size_of::<UvTriangle>() + 4);
        (levels + finest + triangles + self.gather.bytes() + self.rest.bytes()) as u64
    }
}

/// Bytes per node of a level's rigidity, mobility and rest lengths.
const NODE_BYTES: usize = 2 + 1 + 8;

impl Level {
    fn new(maps: &NodeMaps, charts: usize, finer: Option<&mut Level>) -> Level {
        let width = maps.nx + 1;
        let blocks = Blocks::new(maps.nx, maps.ny, charts, |i, j| maps.chart[j * width + i]);
        let mut children = vec![[NONE; 4]; blocks.list.len()];
        if let Some(finer) = finer {
            for (b, block) in finer.blocks.list.iter().enumerate() {
                let parent = blocks.find(block.chart, i64::from(block.x / 2), i64::from(block.y / 2));
                finer.parent[b] = parent;
                if parent != NONE {
                    children[parent as usize][(block.y % 2 * 2 + block.x % 2) as usize] = b as u32;
                }
            }
        }
        let mut level = Level {
            nx: maps.nx,
            ny: maps.ny,
            rigidity: Vec::new(),
            density: Vec::new(),
            interpolation: Vec::new(),
            movable: Vec::new(),
            rest_length: vec![[[0; blocks::NODES]; 4]; blocks.list.len()],
            lengths: vec![[Lengths::default(); 4]; charts],
            floor: vec![0.0; charts],
            coverage: Vec::new(),
            children,
            parent: vec![NONE; blocks.list.len()],
            blocks,
        };
        level.rigidity = planes(&level, |i, j| codes::encode_rigidity(maps.rigidity[j * width + i]));
        level.movable = level
            .blocks
            .list
            .iter()
            .map(|b| plane(&level, b, |i, j| u8::from(maps.chart[j * width + i] == b.chart)))
            .collect();
        level
    }
}

/// A block's plane of the values of a function at its nodes (i, j); nodes beyond the level have the default.
fn plane<T: Copy + Default>(level: &Level, block: &Block, f: impl Fn(usize, usize) -> T) -> Plane<T> {
    let mut plane = [T::default(); blocks::NODES];
    let (x, y) = (block.x as usize * SIDE, block.y as usize * SIDE);
    for j in 0..SIDE.min(level.ny + 1 - y) {
        for i in 0..SIDE.min(level.nx + 1 - x) {
            plane[slot(i, j)] = f(x + i, y + j);
        }
    }
    plane
}

/// The planes of all blocks of a level.
fn planes<T: Copy + Default>(level: &Level, f: impl Fn(usize, usize) -> T) -> Vec<Plane<T>> {
    level.blocks.list.iter().map(|b| plane(level, b, &f)).collect()
}

/// Rigidity and mobility on level 0 (method §1). The nodes of a chart without rigidity are fixed: its best warp is the
/// identity.
pub(crate) fn node_maps(mesh: &Mesh, tile: &TileMesh, maps: &TileMaps, coverage: &Coverage) -> NodeMaps {
    let (nx, ny) = (coverage.nx, coverage.ny);
    let nodes = (nx + 1) * (ny + 1);
    let rigidity = match &maps.rigidity {
        Rigidity::None => vec![0.0; nodes],
        Rigidity::Map(map) => map.to_nodes(nx, ny),
        Rigidity::Vertices(values) => vertex_rigidity(mesh, tile, coverage, values),
    };
    let free = maps.mask.as_ref().map(|mask| mask.to_free_nodes(nx, ny));
    let chart_of = tile.chart_of_triangles();
    let mut chart: Vec<u32> = (0..nodes)
        .map(|n| {
            let is_movable = coverage.interior[n] && free.as_ref().is_none_or(|free| free[n]);
            if is_movable { chart_of[coverage.triangle[n] as usize] } else { NONE }
        })
        .collect();
    let mut rigid = vec![false; tile.charts.len()];
    for j in 1..ny {
        for i in 1..nx {
            let at = j * (nx + 1) + i;
            // The weight of an edge is the larger rigidity of its ends: a movable node next to a rigid one counts too.
            if chart[at] != NONE && !rigid[chart[at] as usize] {
                let near = |dj: usize| rigidity[at + dj * (nx + 1) - nx - 2..][..3].iter().any(|&r| r > 0.0);
                rigid[chart[at] as usize] = near(0) || near(1) || near(2);
            }
        }
    }
    for c in &mut chart {
        if *c != NONE && !rigid[*c as usize] {
            *c = NONE;
        }
    }
    NodeMaps { nx, ny, rigidity, chart }
}

/// Rigidity per vertex, interpolated linearly on the triangle under each node; 0 at nodes without a triangle.
fn vertex_rigidity(mesh: &Mesh, tile: &TileMesh, coverage: &Coverage, values: &[f32]) -> Vec<f32> {
    debug_assert_eq!(values.len(), mesh.rest.len());
    let chart_of = tile.chart_of_triangles();
    let triangles = uv_triangles(tile, coverage.nx, coverage.ny);
    let width = coverage.nx + 1;
    coverage
        .triangle
        .iter()
        .enumerate()
        .map(|(node, &t)| {
            if t == NONE {
                return 0.0;
            }
            let uv = &triangles[t as usize];
            let offset = [(node % width) as f32 - uv.origin[0], (node / width) as f32 - uv.origin[1]];
            let [l1, l2] = uv.barycentric.map(|row| row[0] * offset[0] + row[1] * offset[1]);
            let chart = &tile.charts[chart_of[t as usize] as usize];
            let [a, b, c] =
                tile.triangles[t as usize].local.map(|v| values[chart.vertices[v as usize] as usize]);
            (a + l1 * (b - a) + l2 * (c - a)).clamp(0.0, 1.0)
        })
        .collect()
}

/// The triangles of a tile, prepared for point location on a grid of nx by ny cells.
fn uv_triangles(tile: &TileMesh, nx: usize, ny: usize) -> Vec<UvTriangle> {
    let cells = DVec2::new(nx as f64, ny as f64);
    tile.triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.uv.map(|uv| uv * cells);
            let (e1, e2) = (b - a, c - a);
            let det = e1.perp_dot(e2);
            let single = |v: DVec2| v.to_array().map(|x| x as f32);
            UvTriangle {
                origin: single(a),
                barycentric: [single(-e2.perp() / det), single(e1.perp() / det)],
                neighbours: t.neighbours,
            }
        })
        .collect()
}
