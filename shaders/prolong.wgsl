// prolong: bilinear interpolation of displacements from the next coarser level, then resampling (method §3). A quarter
// of a bilinear cell has its corner Jacobians within the range of those of the cell, so that prolongation cannot fold.
// It reads 8 bytes per coarse node, which is 2 per fine node, 4 bytes of constants (8 on level 0, and 40 per triangle),
// and writes 8 bytes per fine node (12 on level 0).

@group(0) @binding(10) var<storage, read> coarse_blocks: array<BlockRecord>;
@group(0) @binding(11) var<storage, read> coarse_state: array<u32>;

fn coarse_u(parent: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = coarse_blocks[parent].neighbours[source.x];
    if holder == NONE {
        return vec2f();
    }
    let at = (holder * COARSE_STATE_PLANES + U) * NODES + source.y;
    return bitcast<vec2f>(vec2u(coarse_state[at], coarse_state[at + NODES]));
}

@compute @workgroup_size(256)
fn prolong(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let parent = blocks[b].parents[0];
    var u = vec2f();
    if parent != NONE && !is_fixed(b, t) {
        let n = node_at(t);
        let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + n / 2u + 1u;
        let high = low + n % 2u;
        let south = coarse_u(parent, low) + coarse_u(parent, vec2u(high.x, low.y));
        let north = coarse_u(parent, vec2u(low.x, high.y)) + coarse_u(parent, high);
        // A displacement of one coarse cell is a displacement of two fine cells: half of the sum is twice the mean
        // of the four values.
        u = (south + north) * 0.5;
    }
    resample(b, t, u);
}
