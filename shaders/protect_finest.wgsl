// protect, level 0: what rigid material loses of its weight, interpolated from level 1 (method §4, Protection). Reads 4
// bytes of each of 4 coarse nodes and 4 per node, writes 4.

/// The constants of the nodes of level 0.
@group(0) @binding(10) var<storage, read_write> weakened: array<u32>;
@group(0) @binding(11) var<storage, read> coarse_blocks: array<BlockRecord>;
@group(0) @binding(12) var<storage, read> coarse_nodes: array<u32>;

fn coarse_lost(parent: u32, n: vec2u) -> u32 {
    let source = window_source(n);
    let holder = coarse_blocks[parent].neighbours[source.x];
    if holder == NONE {
        return 0u;
    }
    return lost_code(coarse_nodes[node_index(holder, RIGIDITY, source.y)]);
}

@compute @workgroup_size(256)
fn protect_finest(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let parent = blocks[b].parents[0];
    var lost = 0u;
    if parent != NONE {
        let n = node_at(t);
        let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + n / 2u + 1u;
        let high = low + n % 2u;
        let south = coarse_lost(parent, low) + coarse_lost(parent, vec2u(high.x, low.y));
        let north = coarse_lost(parent, vec2u(low.x, high.y)) + coarse_lost(parent, high);
        lost = (south + north + 2u) / 4u;
    }
    let at = node_index(b, RIGIDITY, t);
    weakened[at] = (weakened[at] & 0x8000ffffu) | (lost << 16u);
}
