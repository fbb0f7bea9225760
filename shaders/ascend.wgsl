// correct, on the way back from a coarser level: z += P z of the coarser level, then smoothing backwards, one dispatch a
// block colour. Adding happens where a block is first read: blocks of the colours that came before have it already.

@group(0) @binding(10) var<storage, read> coarse_blocks: array<Block>;
@group(0) @binding(11) var<storage, read> coarse_vectors: array<f32>;

fn coarse_z(parent: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = coarse_blocks[parent].links[source.x];
    if holder == NONE {
        return vec2f();
    }
    let at = ((params.other_base + holder) * VECTOR_PLANES + Z) * NODES + source.y;
    return vec2f(coarse_vectors[at], coarse_vectors[at + NODES]);
}

/// P z of the coarser level at a node of block b.
fn correction(b: u32, s: u32) -> vec2f {
    let parent = blocks[b].parent;
    if parent == NONE || is_fixed(b, s) {
        return vec2f();
    }
    let n = node_of(s);
    let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + n / 2u + 1u;
    let high = low + n % 2u;
    let south = coarse_z(parent, low) + coarse_z(parent, vec2u(high.x, low.y));
    let north = coarse_z(parent, vec2u(low.x, high.y)) + coarse_z(parent, high);
    return (south + north) * 0.25;
}

@compute @workgroup_size(64)
fn ascend(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let colour = block_colour(b);
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].links[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = vector(holder, Z, source.y);
            if block_colour(holder) <= colour {
                near[k] += correction(holder, source.y);
            }
        }
    }
    workgroupBarrier();
    sweep_block(b, t, true);
}
