//! A tile's maps: mobility, rigidity, node -> triangle coverage, active blocks, on every level of its grid.

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

/// Where a tile's rigidity comes from.
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

/// What a host has set on a tile.
#[derive(Clone, Debug, Default)]
pub(crate) struct TileMaps {
    pub rigidity: Rigidity,
    pub mask: Option<Map>,
    pub settings: TileSettings,
}

/// Grid of a tile whose rigidity comes from the vertices, if no setting gives its size.
const VERTEX_GRID: usize = 1024;

impl TileMaps {
    /// Cells of the grid: the settings', or the rigidity map's size, rounded up to a multiple of 16.
    pub fn grid_size(&self) -> [usize; 2] {
        let default = match &self.rigidity {
            Rigidity::Map(map) => [map.width, map.height],
            Rigidity::Vertices(_) => [VERTEX_GRID; 2],
            // Nothing will move: the smallest grid says so at no cost.
            Rigidity::None => [SIDE; 2],
        };
        std::array::from_fn(|axis| {
            let n = self.settings.grid[axis].map_or(default[axis], |n| n as usize);
            n.next_multiple_of(SIDE).min(MAX_GRID as usize)
        })
    }
}

/// A triangle's UVs, ready for location: in cells, relative to its first corner.
#[derive(Clone, Copy, Debug)]
pub struct UvTriangle {
    /// Its first corner, in cells.
    pub origin: [f32; 2],
    /// Rows of the 2x2 matrix that takes an offset from `origin` to the barycentrics of corners 1 and 2.
    pub barycentric: [[f32; 2]; 2],
    /// The triangle across the edge opposite to each corner, or `NONE`.
    pub neighbours: [u32; 3],
}

/// One level of a tile's grid: what does not depend on the pose.
#[derive(Debug)]
pub struct Level {
    /// Cells in u.
    pub nx: usize,
    /// Cells in v.
    pub ny: usize,
    pub blocks: Blocks,
    /// Per block: codes of `codes::share`.
    pub rigidity: Vec<Plane<u16>>,
    /// Per block, only if a setting asks for it: how dense rigid material is around each node, 0..1.
    pub density: Vec<Plane>,
    /// Per block: what a correction's interpolation from the next coarser level gives to each node's lower neighbour, as
    /// `interpolation` says; the upper one has the rest. Codes of `codes::weight`. Not on the coarsest level.
    pub interpolation: Vec<Plane<u8>>,
    /// Per block: 1 may move, 0 fixed.
    pub movable: Vec<Plane<u8>>,
    /// Per block: rest length l of the edges `EDGES` of each node, in units of the chart; codes of `lengths`.
    pub rest_length: Vec<[Plane<u16>; 4]>,
    /// Per chart, of each of `EDGES`.
    pub lengths: Vec<[Lengths; 4]>,
    /// Per chart: floor of l.
    pub floor: Vec<f32>,
    /// Per block, on coarser levels: how much of each node's surroundings the chart covers, 0..1.
    pub coverage: Vec<Plane>,
    /// Per block: the block of the next finer level at (2x, 2y), (2x + 1, 2y), (2x, 2y + 1), (2x + 1, 2y + 1).
    pub children: Vec<[u32; 4]>,
    /// Per block: the block of the next coarser level that holds its even nodes, or `NONE`.
    pub parent: Vec<u32>,
}

/// A tile's grid: everything that is built once per mesh, map and setting.
#[derive(Debug)]
pub struct Grid {
    pub levels: Vec<Level>,
    pub triangles: Vec<UvTriangle>,
    pub chart_of: Vec<u32>,
    /// Per block of level 0: the triangle under each node at rest.
    pub triangle: Vec<Plane<u32>>,
    /// Triangles and areas around each node of level 1.
    pub gather: Gather,
    /// Movable nodes per chart: 0 for charts that nothing moves or stiffens.
    pub movable: Vec<u64>,
    pub overlap: f32,
    /// The rest pose, as the solver sees it.
    pub rest: Pose,
}

/// l is floored at this share of a chart's median edge: a texel that maps onto almost nothing must not rule.
const FLOOR_SHARE: f32 = 0.05;

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
            level.interpolation = planes(&level, |i, j| codes::weight(weights[j * (maps.nx + 1) + i]));
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

    /// True if the identity is a chart's best warp for a pose: nothing of it may move, or it is as long as at rest.
    pub(crate) fn is_still(&self, tile: &TileMesh, pose: &Pose, chart: usize) -> bool {
        self.movable[chart] == 0
            || self.levels[0].floor[chart] == 0.0
            || pose.is_isometric(&self.rest, tile, chart)
    }

    /// The triangles of a pose.
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
        let of_level = |l: &Level| {
            l.blocks.list.len() * per_block
                + (l.density.len() + l.coverage.len()) * size_of::<Plane>()
                + l.interpolation.len() * blocks::NODES
        };
        let levels: usize = self.levels.iter().map(of_level).sum();
        let finest = self.triangle.len() * blocks::NODES * 4;
        let triangles = self.triangles.len() * (size_of::<UvTriangle>() + 4);
        (levels + finest + triangles + self.gather.bytes() + self.rest.bytes()) as u64
    }
}

/// Bytes per node of `Level`.
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
        level.rigidity = planes(&level, |i, j| codes::share(maps.rigidity[j * width + i]));
        level.movable = level
            .blocks
            .list
            .iter()
            .map(|b| plane(&level, b, |i, j| u8::from(maps.chart[j * width + i] == b.chart)))
            .collect();
        level
    }
}

/// One plane of a block from a function of its nodes (i, j); nodes beyond the level get the default.
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

fn planes<T: Copy + Default>(level: &Level, f: impl Fn(usize, usize) -> T) -> Vec<Plane<T>> {
    level.blocks.list.iter().map(|b| plane(level, b, &f)).collect()
}

/// The finest level's maps: what may move, how rigid it is. Charts in which nothing is rigid are fixed: their best warp
/// is the identity.
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
            let moves = coverage.interior[n] && free.as_ref().is_none_or(|free| free[n]);
            if moves { chart_of[coverage.triangle[n] as usize] } else { NONE }
        })
        .collect();
    let mut rigid = vec![false; tile.charts.len()];
    for j in 1..ny {
        for i in 1..nx {
            let at = j * (nx + 1) + i;
            // An edge is rigid if either end is, so a movable node next to a rigid one counts too.
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

/// Rigidity per vertex, linear over the triangle under each node; 0 where there is none.
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

fn uv_triangles(tile: &TileMesh, nx: usize, ny: usize) -> Vec<UvTriangle> {
    tile.triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.uv.map(|uv| [uv[0] * nx as f64, uv[1] * ny as f64]);
            let (e1, e2) = ([b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]);
            let det = e1[0] * e2[1] - e1[1] * e2[0];
            let row = |x: f64, y: f64| [(x / det) as f32, (y / det) as f32];
            UvTriangle {
                origin: a.map(|x| x as f32),
                barycentric: [row(e2[1], -e2[0]), row(-e1[1], e1[0])],
                neighbours: t.neighbours,
            }
        })
        .collect()
}
