// prolong: bilinear interpolation of displacements from the next coarser level. A quarter of a bilinear cell has its
// corner Jacobians inside the cell's own range, so it cannot fold. Reads 2 bytes per node of the coarser level and the
// triangle under it, writes 24.

@group(0) @binding(10) var<storage, read> coarse_blocks: array<BlockRecord>;
@group(0) @binding(11) var<storage, read> coarse_state: array<u32>;

fn coarse(parent: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = coarse_blocks[parent].neighbours[source.x];
    if holder == NONE {
        return vec2f();
    }
    let at = state_at(holder, U, source.y);
    return bitcast<vec2f>(vec2u(coarse_state[at], coarse_state[at + NODES]));
}

@compute @workgroup_size(64)
fn prolong(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let parent = blocks[b].parent;
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        var u = vec2f();
        if parent != NONE && !is_fixed(b, s) {
            let n = node_of(s);
            let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + n / 2u + 1u;
            let high = low + n % 2u;
            let south = coarse(parent, low) + coarse(parent, vec2u(high.x, low.y));
            let north = coarse(parent, vec2u(low.x, high.y)) + coarse(parent, high);
            // A coarse cell is two fine ones.
            u = (south + north) * 0.5;
        }
        put(b, s, u);
    }
}
