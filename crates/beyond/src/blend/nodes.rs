//! Nodes that need depths of other charts: those with copies, and those of features that reach to such nodes.

use glam::DVec2;

use super::places::{Place, Places, on_surface};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::codes::decode_rigidity;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, node_at, slot};
use vrtm_core::grid::{Grid, Level};
use vrtm_core::mesh::NONE;

/// The rigidity of a node of a feature.
const RIGID: f32 = 0.5;
/// The number of a node where only its own chart is.
pub const FAR: u32 = NONE - 1;

#[derive(Clone, Copy)]
pub struct Node {
    pub tile: u32,
    pub block: u32,
    pub slot: u16,
    pub rigid: bool,
}

pub struct Nodes<'a> {
    pub grid: Option<&'a Grid>,
    /// Per node of each block, its number in `Depths`; `FAR` where only the node's own chart is, far from all others;
    /// `NONE` outside of charts.
    pub number: Vec<Plane<u32>>,
}

/// Kind of a node in a block.
#[derive(Clone, Copy, Default, PartialEq, Eq)]
pub struct Kind {
    /// A node of the block's chart itself.
    pub is_own: bool,
    pub rigid: bool,
    /// A node near a seam, or of a feature that reaches there: it gets depths.
    pub is_near: bool,
}

/// Nodes and the places that lie one node further, in the collar.
pub type Links = Vec<(Node, Place)>;

impl Nodes<'_> {
    /// Marks features that lie partly near another chart as near, and numbers the other nodes.
    pub fn number(&mut self, kinds: &mut [Plane<Kind>]) {
        let Some(grid) = self.grid else { return };
        let is_open = |kind: &Kind| kind.is_near && kind.rigid;
        let open = |(b, plane): (usize, &Plane<Kind>)| {
            (0..NODES).filter(|&s| is_open(&plane[s])).map(|s| (b, s)).collect::<Vec<_>>()
        };
        let mut stack: Vec<(usize, usize)> = kinds.iter().enumerate().flat_map(open).collect();
        while let Some((b, s)) = stack.pop() {
            for (axis, sign) in [(0, 1), (1, 1), (0, -1), (1, -1)] {
                let Some((b, s)) = beside(grid, b, s, axis, sign) else { continue };
                let kind = &mut kinds[b][s];
                if kind.is_own && kind.rigid && !std::mem::replace(&mut kind.is_near, true) {
                    stack.push((b, s));
                }
            }
        }
        let number = |plane: &Plane<Kind>| plane.map(|kind| if kind.is_own { FAR } else { NONE });
        self.number = kinds.iter().map(number).collect();
    }
}

/// The nodes of a block, and those at the border of its chart with what lies one node further in its collar.
pub fn kinds_of(places: &Places, index: u32, grid: Option<&&Grid>, b: usize) -> (Plane<Kind>, Links) {
    let (mut kinds, mut links): (Plane<Kind>, Links) = ([Kind::default(); NODES], Vec::new());
    let Some(grid) = grid else { return (kinds, links) };
    let (tile, level) = (&*places.tiles[index as usize], &grid.levels[0]);
    let block = &level.blocks.list[b];
    for (s, kind) in kinds.iter_mut().enumerate() {
        let triangle = grid.triangle[b][s];
        if triangle as usize >= tile.own() || tile.chart_of_triangle(triangle) != block.chart {
            continue;
        }
        let rigid = decode_rigidity(level.rigidity[b][s]) > RIGID;
        let is_near = !places.of(index, triangle).is_empty();
        *kind = Kind { is_own: true, rigid, is_near };
        for (axis, sign) in [(0, 1), (1, 1), (0, -1), (1, -1)] {
            let Some((other, t)) = beside(grid, b, s, axis, sign) else { continue };
            let triangle = grid.triangle[other][t];
            if triangle != NONE && triangle as usize >= tile.own() && !tile.is_image(triangle) {
                let node = Node { tile: index, block: b as u32, slot: s as u16, rigid };
                links.push((node, on_surface(tile, index, triangle, uv_of(grid, other, t))));
                kind.is_near = true;
            }
        }
    }
    (kinds, links)
}

/// The place of a node, in cells.
pub fn place_of(level: &Level, b: usize, s: usize) -> DVec2 {
    let (block, (i, j)) = (&level.blocks.list[b], node_at(s));
    DVec2::new((block.x as usize * SIDE + i) as f64, (block.y as usize * SIDE + j) as f64)
}

/// The UV of a node.
pub fn uv_of(grid: &Grid, b: usize, s: usize) -> DVec2 {
    place_of(&grid.levels[0], b, s) / grid.levels[0].cells()
}

/// The block and slot of a chart's node (x, y), if it is stored.
pub fn node_of(grid: &Grid, chart: u32, x: i64, y: i64) -> Option<(usize, usize)> {
    let level = &grid.levels[0];
    let is_node = (0..=level.nx as i64).contains(&x) && (0..=level.ny as i64).contains(&y);
    let b = if is_node { level.blocks.find(chart, x >> 4, y >> 4) } else { NONE };
    (b != NONE).then(|| (b as usize, slot((x & 15) as usize, (y & 15) as usize)))
}

/// The neighbour of a node along an axis, if it is stored.
pub fn beside(grid: &Grid, b: usize, s: usize, axis: usize, sign: i64) -> Option<(usize, usize)> {
    let (i, j) = node_at(s);
    let mut at = [i as i64, j as i64];
    at[axis] += sign;
    let [dx, dy] = at.map(|x| x.div_euclid(SIDE as i64) + 1);
    let other = grid.levels[0].blocks.neighbours[b][(3 * dy + dx) as usize];
    let [i, j] = at.map(|x| x.rem_euclid(SIDE as i64) as usize);
    (other != NONE).then(|| (other as usize, slot(i, j)))
}

/// True if two neighbours have the same column.
pub fn along_v(nodes: &[Node], a: u32, b: u32) -> bool {
    let column = |n: u32| node_at(nodes[n as usize].slot as usize).0;
    column(a) == column(b)
}
