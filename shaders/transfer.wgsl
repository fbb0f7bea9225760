// correct: residuals to the coarser level (P'), and corrections back (P). Reads 8 bytes of each of 9 finer nodes, or
// 2 per node of the coarser level; writes 8.

@group(0) @binding(10) var<storage, read> other_blocks: array<Block>;
@group(0) @binding(11) var<storage, read> other_vectors: array<f32>;

fn other(b: u32, plane: u32, n: vec2u) -> vec2f {
    let source = window_source(n);
    let holder = other_blocks[b].links[source.x];
    if holder == NONE {
        return vec2f();
    }
    let at = vector_at(holder, plane, source.y);
    return vec2f(other_vectors[at], other_vectors[at + NODES]);
}

/// r = P' t of the finer level, at movable nodes.
@compute @workgroup_size(64)
fn restrict_residual(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let n = node_of(s);
        let child = blocks[b].children[n.y / 8u * 2u + n.x / 8u];
        var sum = vec2f();
        if child != NONE && !is_fixed(b, s) {
            let c = 2u * (n % 8u);
            sum = other(child, T, c + 1u)
                + 0.5 * (other(child, T, c + vec2u(0u, 1u)) + other(child, T, c + vec2u(2u, 1u))
                    + other(child, T, c + vec2u(1u, 0u)) + other(child, T, c + vec2u(1u, 2u)))
                + 0.25 * (other(child, T, c) + other(child, T, c + vec2u(2u, 0u))
                    + other(child, T, c + vec2u(0u, 2u)) + other(child, T, c + 2u));
        }
        let at = vector_at(b, R, s);
        vectors[at] = sum.x;
        vectors[at + NODES] = sum.y;
    }
}

/// z += P z of the coarser level.
@compute @workgroup_size(64)
fn add_coarse(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let parent = blocks[b].parent;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        if parent != NONE && !is_fixed(b, s) {
            let n = node_of(s);
            let low = vec2u(blocks[b].x & 1u, blocks[b].y & 1u) * 8u + n / 2u + 1u;
            let high = low + n % 2u;
            let south = other(parent, Z, low) + other(parent, Z, vec2u(high.x, low.y));
            let north = other(parent, Z, vec2u(low.x, high.y)) + other(parent, Z, high);
            let at = vector_at(b, Z, s);
            let add = (south + north) * 0.25;
            vectors[at] += add.x;
            vectors[at + NODES] += add.y;
        }
    }
}
