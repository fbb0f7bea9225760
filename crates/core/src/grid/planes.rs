//! The layout of a block's 16 by 16 nodes in planes (method §1).

/// Nodes on a side of a block.
pub const SIDE: usize = 16;
/// Nodes of a block.
pub const NODES: usize = SIDE * SIDE;

/// One quantity at the nodes of a block, as four planes of 8x8, one per node colour (i & 1, j & 1). The neighbours of
/// consecutive nodes of one colour are then consecutive, too.
pub type Plane<T = f32> = [T; NODES];

/// Index of node (i, j) of a block in its planes.
pub const fn slot(i: usize, j: usize) -> usize {
    ((j & 1) * 2 + (i & 1)) * 64 + (j >> 1) * 8 + (i >> 1)
}

/// The node (i, j) at an index of a plane.
pub const fn node_at(slot: usize) -> (usize, usize) {
    let (colour, row, column) = (slot / 64, slot / 8 % 8, slot % 8);
    (2 * column + colour % 2, 2 * row + colour / 2)
}

/// Offsets of the four edges that a node owns: east, north, north-east, north-west. The other four belong to its
/// neighbours (the paper's V_horz, V_vert, V_shear0, V_shear1).
pub const EDGES: [(i64, i64); 4] = [(1, 0), (0, 1), (1, 1), (-1, 1)];
