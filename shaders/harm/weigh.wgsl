// harm: writes the multiplier of each node's feature beside the node's rigidity (method §4, Harm). Reads 6 bytes per
// node and writes 4.

/// The constants of the level's nodes.
@group(0) @binding(11) var<storage, read_write> weighed: array<u32>;
@group(0) @binding(12) var<storage, read> multipliers: array<f32>;

@compute @workgroup_size(256)
fn weigh(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) s: u32) {
    let b = block_of_workgroup(group, s);
    if b == NONE {
        return;
    }
    let piece = tag_at(b, s) & 0xffu;
    var code = 0u;
    if piece > 0u {
        code = u32(multipliers[features[first_name() + first_piece(b) + piece - 1u]] * MULTIPLIER_STEPS);
    }
    let at = node_index(b, RIGIDITY, s);
    weighed[at] = (weighed[at] & 0x8000ffffu) | (code << 16u);
}
