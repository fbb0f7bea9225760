//! The nodes of a tile that are blended, and what each is blended of: its copies in other charts, with their parts.

use glam::DVec2;

use super::depths::{Depths, smooth};
use super::nodes::uv_of;
use super::places::{Places, depth_of, on_surface, sheets};
use vrtm_core::allocation::Vec;
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::NODES;
use vrtm_core::mesh::triangle::{barycentrics, doubled_area};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// A node that is blended.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub slot: u16,
    count: u16,
    /// The index of the first one.
    first: u32,
    /// Weight of the copy in the blend, 0..1: where the collar comes to its end, the node keeps what its own
    /// chart says.
    pub fade: f32,
}

/// A node's place in another chart, or beyond another seam or an open border of its own.
#[derive(Clone, Copy, Debug)]
pub(super) struct NodeCopy {
    /// The tile in the mesh, and the triangle there.
    pub tile: u32,
    pub triangle: u32,
    /// Barycentric coordinates of corners 1 and 2.
    pub at: [f32; 2],
    /// The block of its chart that holds the lower left node of its cell, or `NONE`.
    pub block: u32,
    pub part: f32,
    /// True if one of the node and the copy lies on a mirror image of the surface: what the copy's chart says
    /// is mirrored, too.
    pub mirrored: bool,
}

/// Copies that a tile's nodes are blended of. They depend on the mesh, on the grid's size and on which nodes
/// may move.
#[derive(Debug)]
pub struct Copies {
    /// The blocks with nodes that are blended, ascending, and the index of each one's first node, followed by the
    /// number of all nodes.
    blocks: Vec<u32>,
    starts: Vec<u32>,
    nodes: Vec<Node>,
    copies: Vec<NodeCopy>,
}

/// Parts under this are left out.
const SMALLEST: f32 = 1e-3;

impl Copies {
    /// The copies of the nodes of the mesh's tile `index`, given the surface that charts have in common, and how deep
    /// each is there.
    pub fn new(team: &Team, places: &Places, depths: &Depths, grid: &Grid, index: usize) -> Copies {
        let level = &grid.levels[0];
        let active: Vec<u32> =
            (0..level.blocks.list.len() as u32).filter(|&b| level.blocks.list[b as usize].active).collect();
        let found = team.map(active.len(), |k| {
            let b = active[k] as usize;
            let mut of_block = OfBlock::default();
            for s in (0..NODES).filter(|&s| level.movable[b][s] != 0) {
                let triangle = grid.triangle[b][s];
                if triangle != NONE {
                    of_block.add((places, depths), index as u32, triangle, s, uv_of(grid, b, s));
                }
            }
            of_block
        });
        let mut copies =
            Copies { blocks: Vec::new(), starts: Vec::new(), nodes: Vec::new(), copies: Vec::new() };
        for (b, of_block) in active.into_iter().zip(found).filter(|(_, found)| !found.nodes.is_empty()) {
            copies.blocks.push(b);
            copies.starts.push(copies.nodes.len() as u32);
            let first = copies.copies.len() as u32;
            copies
                .nodes
                .extend(of_block.nodes.iter().map(|node| Node { first: first + node.first, ..*node }));
            copies.copies.extend(of_block.copies);
        }
        copies.starts.push(copies.nodes.len() as u32);
        copies
    }

    /// Bytes of the copies of a tile with collars on a grid, and of the depths while they are found, about.
    pub fn bytes_for(tile: &TileMesh, grid: &Grid) -> [u64; 2] {
        let level = &grid.levels[0];
        let area: f64 = tile.triangles[tile.own()..].iter().map(|t| 0.5 * doubled_area(t.uv).abs()).sum();
        // Most of a collar lies on another chart.
        let nodes = 2.0 * area * (level.nx * level.ny) as f64;
        let copies = nodes * (size_of::<Node>() as f64 + 1.3 * size_of::<NodeCopy>() as f64);
        [copies as u64, Depths::bytes_for(nodes, level.blocks.list.len())]
    }

    pub fn bytes(&self) -> usize {
        self.blocks.len() * 8 + size_of_val(&*self.nodes) + size_of_val(&*self.copies)
    }

    pub(super) fn blocks(&self) -> &[u32] {
        &self.blocks
    }

    pub(super) fn of_block(&self, k: usize) -> &[Node] {
        &self.nodes[self.starts[k] as usize..self.starts[k + 1] as usize]
    }

    pub(super) fn of_node(&self, node: &Node) -> &[NodeCopy] {
        &self.copies[node.first as usize..][..node.count as usize]
    }
}

#[derive(Default)]
struct OfBlock {
    nodes: Vec<Node>,
    copies: Vec<NodeCopy>,
}

impl OfBlock {
    /// Adds a node at a UV on a triangle, if the blend changes it.
    fn add(&mut self, (places, depths): (&Places, &Depths), index: u32, triangle: u32, s: usize, uv: DVec2) {
        let tile = &*places.tiles[index as usize];
        let place = on_surface(tile, index, triangle, uv);
        let all = sheets(places, place);
        let is_collar = tile.source(triangle as usize).is_some();
        let own = (index, tile.chart_of_triangle(triangle), is_collar, place.image);
        let Some(home) = all.iter().find(|on| on.sheet() == own) else { return };
        let parts = depths.parts(places, place, &all);
        let fade = if is_collar { smooth(2.0 * depth_of(places, home)) } else { 1.0 };
        let first = self.copies.len();
        for (on, part) in all.iter().zip(parts).filter(|(on, part)| on.sheet() != own && *part >= SMALLEST) {
            let at = barycentrics(places.tiles[on.tile as usize].triangles[on.triangle as usize].uv, on.uv);
            let at = at.map(|x| x as f32);
            let mirrored = on.image != place.image;
            let block = depths.block(on.tile, on.chart, on.uv);
            self.copies.push(NodeCopy { tile: on.tile, triangle: on.triangle, at, block, part, mirrored });
        }
        let count = self.copies.len() - first;
        if count > 0 && fade > SMALLEST {
            self.nodes.push(Node { slot: s as u16, count: count as u16, first: first as u32, fade });
        } else {
            self.copies.truncate(first);
        }
    }
}
