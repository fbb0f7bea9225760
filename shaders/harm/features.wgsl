// The painted features of a level (method §4, Harm), as crates/gpu/src/records.rs writes them: numbers of blocks, of
// pieces and of features; the tags of the nodes, two to a word; and the lists of `Pieces` in
// crates/core/src/grid/features.rs.

@group(0) @binding(10) var<storage, read> features: array<u32>;

const FIRST_TAG: u32 = 3u;

/// In the lower 8 bits 1 plus the place of the node's piece in its block, or 0; in 4 more the owned edges inside.
fn tag_at(b: u32, s: u32) -> u32 {
    return (features[FIRST_TAG + (b * NODES + s) / 2u] >> (16u * (s & 1u))) & 0xffffu;
}

/// The first piece of block b.
fn first_piece(b: u32) -> u32 {
    return features[FIRST_TAG + features[0] * (NODES / 2u) + b];
}

/// The place of the pieces' features.
fn first_name() -> u32 {
    return FIRST_TAG + features[0] * (NODES / 2u + 1u) + 1u;
}
