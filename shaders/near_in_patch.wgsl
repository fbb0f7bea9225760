// For slopes.wgsl, at the nodes of a block: their neighbours are in its patch.

/// Node n of block b, from (-1, -1) to (16, 16).
fn near_node(b: u32, n: vec2i) -> NearNode {
    let at = place(u32(n.x + 1), u32(n.y + 1));
    return NearNode(patch_u[at], patch_value[at].xyz, triangle_of(patch_tag[at]));
}
