//! The displacements of a result's nodes, in rows, and the warp as an image.

use std::sync::Arc;

use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::error::Result;
use vrtm_core::grid::Level;
use vrtm_core::grid::blocks::Block;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, node_at, slot};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::TileMesh;
use vrtm_core::team::Team;

use super::inverse::Area;
use crate::solved::Solved;
use vrtm_beyond::owners::NodeOwners;

/// Most items of work into which writing a warp is divided.
const ITEMS: usize = 64;

/// Memory for writing a part of a warp: two rows of nodes for each item of work.
pub(crate) fn rows(solved: &Solved, part: &ImagePart) -> Vec<Vec<[f32; 2]>> {
    let width = 2 * (solved.grid.levels[0].nx + 1);
    (0..part.extent()[1].min(ITEMS)).map(|_| zeroed(width)).collect()
}

/// Writes a warp; `rows` has two rows of nodes for each item of work.
pub(crate) fn write(area: &Area, nodes: &NodeRows, mut rows: Vec<Vec<[f32; 2]>>) {
    let Area { team, solved, part, canvas, .. } = *area;
    let level = &solved.grid.levels[0];
    let cells = [level.nx, level.ny].map(|n| n as f64);
    let [width, height] = part.extent();
    // The cell of a texel along an axis, and its fractional place in the cell.
    let place = |x: usize, axis: usize| {
        let last = (part.size[axis] - 1).max(1) as f64;
        let at = (part.first[axis] + x) as f64 * cells[axis] / last;
        let cell = at.floor().min(cells[axis] - 1.0);
        (cell as usize, at - cell)
    };
    let items = rows.len();
    let write_row = |y: usize, rows: &mut [[f32; 2]]| {
        let (j, t) = place(y, 1);
        let (first, second) = rows.split_at_mut(level.nx + 1);
        nodes.read_row(j, first);
        nodes.read_row(j + 1, second);
        let rows = [first, second];
        for x in 0..width {
            let (i, s) = place(x, 0);
            let at = |di: usize, dj: usize, k: usize| f64::from(rows[dj][i + di][k]);
            // First along the axis of the larger of s and t to the triangle's third corner, then to the far corner
            // (method §9).
            let (third, first, second) = if s >= t { ([1, 0], s, t) } else { ([0, 1], t, s) };
            let [u, v] = [(i, s, 0), (j, t, 1)].map(|(cell, along, k)| {
                let (near, far, third) = (at(0, 0, k), at(1, 1, k), at(third[0], third[1], k));
                let moved = near + first * (third - near) + second * (far - third);
                (cell as f64 + along + moved) / cells[k]
            });
            canvas.put(x, y, [u, v, 0.0]);
        }
    };
    team.fill(&mut rows, |k, rows| {
        (k * height / items..(k + 1) * height / items).for_each(|y| write_row(y, rows))
    });
}

/// The displacements of a result's nodes, row by row.
pub(crate) struct NodeRows<'a> {
    level: &'a Level,
    u: &'a [[Plane; 2]],
    /// The charts of nodes of active blocks, for a tile with collars.
    owners: Option<NodeOwners>,
    /// The active blocks, sorted by row.
    blocks: Vec<u32>,
}

impl<'a> NodeRows<'a> {
    pub fn new(solved: &'a Solved) -> Result<NodeRows<'a>> {
        let level = &solved.grid.levels[0];
        let list = &level.blocks.list;
        let mut blocks: Vec<u32> = (0..list.len() as u32).filter(|&b| list[b as usize].active).collect();
        blocks.sort_unstable_by_key(|&b| (list[b as usize].y, b));
        let of_nodes = |tile: &Arc<TileMesh>| {
            let mut squares: Vec<[u32; 2]> =
                blocks.iter().map(|&b| [list[b as usize].y, list[b as usize].x]).collect();
            squares.sort_unstable();
            squares.dedup();
            Team::with(1, |team| NodeOwners::new(team, tile, [level.nx, level.ny], squares))
        };
        let owners = solved.extended.as_ref().map(of_nodes);
        Ok(NodeRows { level, u: solved.warp.host()?, owners, blocks })
    }

    /// Calls `f` for each node that moves, with its displacement.
    pub fn visit_moved(&self, f: &mut dyn FnMut([usize; 2], [f32; 2])) {
        for &b in &self.blocks {
            let block = &self.level.blocks.list[b as usize];
            let owners = self.owners_of(block);
            for s in 0..NODES {
                let (i, j) = node_at(s);
                let at = [block.x as usize * SIDE + i, block.y as usize * SIDE + j];
                let u = [0, 1].map(|c| self.u[b as usize][c][s]);
                if u != [0.0; 2]
                    && at[0] <= self.level.nx
                    && at[1] <= self.level.ny
                    && self.is_of(b as usize, s, owners)
                {
                    f(at, u);
                }
            }
        }
    }

    /// The charts of the nodes of an active block, for a tile with collars.
    fn owners_of(&self, block: &Block) -> Option<&Plane<u32>> {
        self.owners.as_ref().and_then(|owners| owners.of(block.x, block.y))
    }

    /// True if a node's displacement is that of a block: where charts share a square, each chart has its own movable
    /// nodes, unless they have collars.
    fn is_of(&self, b: usize, s: usize, owners: Option<&Plane<u32>>) -> bool {
        self.level.movable[b][s] != 0
            && owners.is_none_or(|owners| owners[s] == self.level.blocks.list[b].chart)
    }

    /// Reads row j, from u = 0.
    fn read_row(&self, j: usize, row: &mut [[f32; 2]]) {
        row.fill([0.0; 2]);
        let list = &self.level.blocks.list;
        let y = (j / SIDE) as u32;
        let first = self.blocks.partition_point(|&b| list[b as usize].y < y);
        for &b in self.blocks[first..].iter().take_while(|&&b| list[b as usize].y == y) {
            let b = b as usize;
            let (x, owners) = (list[b].x as usize * SIDE, self.owners_of(&list[b]));
            for i in 0..SIDE.min(self.level.nx + 1 - x) {
                let s = slot(i, j % SIDE);
                if self.is_of(b, s, owners) {
                    row[x + i] = [self.u[b][0][s], self.u[b][1][s]];
                }
            }
        }
    }
}

/// Displacements of all nodes of the tile, row by row from v = 0.
pub(crate) fn dense(solved: &Solved) -> Result<Vec<[f32; 2]>> {
    let nodes = NodeRows::new(solved)?;
    let [width, height] = [nodes.level.nx + 1, nodes.level.ny + 1];
    let mut all = zeroed(width * height);
    all.chunks_exact_mut(width).enumerate().for_each(|(j, row)| nodes.read_row(j, row));
    Ok(all)
}
