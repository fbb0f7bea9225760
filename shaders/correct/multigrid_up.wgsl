// correct: the V-cycle on the way back from a coarser level (method §7.4): z += P z of the coarser level, then
// smoothing backwards, one dispatch per block colour. P z is added where a block is first read in the pass: blocks of
// the colours that came before have it already.

@group(0) @binding(10) var<storage, read> coarse_blocks: array<BlockRecord>;
@group(0) @binding(11) var<storage, read> coarse_vectors: array<f32>;

fn coarse_z(parent: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = coarse_blocks[parent].active_neighbours[source.x];
    if holder == NONE {
        return vec2f();
    }
    let at = ((params.other_base + holder) * VECTOR_PLANES + DIRECTION) * NODES + source.y;
    return vec2f(coarse_vectors[at], coarse_vectors[at + NODES]);
}

/// The weight ω of the lower neighbour at node n of the window of block b.
fn interpolation_weight(b: u32, n: vec2u) -> f32 {
    let source = window_source(n);
    let holder = blocks[b].active_neighbours[source.x];
    if holder == NONE {
        return 0.0;
    }
    return interpolation_weight_at(holder, source.y);
}

/// z of the coarser level at coarse column `column` (0 to 8) and fine row `row` of block b: interpolated in y alone.
fn interpolate_in_y(b: u32, parent: u32, column: u32, row: u32) -> vec2f {
    let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + vec2u(column, row / 2u) + 1u;
    let own = coarse_z(parent, low);
    if row % 2u == 0u {
        return own;
    }
    let weight = interpolation_weight(b, vec2u(2u * column + 1u, row + 1u));
    return own * weight + coarse_z(parent, low + vec2u(0u, 1u)) * (1.0 - weight);
}

/// P z of the coarser level at the node at slot s of block b.
fn interpolated_z(b: u32, s: u32) -> vec2f {
    let parent = blocks[b].parent;
    if parent == NONE || is_fixed(b, s) {
        return vec2f();
    }
    let n = node_at(s);
    let west = interpolate_in_y(b, parent, n.x / 2u, n.y);
    if n.x % 2u == 0u {
        return west;
    }
    let weight = interpolation_weight_at(b, s);
    return west * weight + interpolate_in_y(b, parent, n.x / 2u + 1u, n.y) * (1.0 - weight);
}

@compute @workgroup_size(64)
fn multigrid_up(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let colour = block_colour(b);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE {
            window_z[k] = vector(holder, DIRECTION, source.y);
            if block_colour(holder) <= colour {
                window_z[k] += interpolated_z(holder, source.y);
            }
        }
    }
    workgroupBarrier();
    sweep_block(b, t, true);
}
