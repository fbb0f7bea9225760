// The pull towards the previous result (method §5): the term theta |d - d'|^2 / |d0|^2 in each edge of level 0. Its
// contribution to the node's matrix is constant, and is added by `local_problem`.

/// The previous result u'.
@group(0) @binding(10) var<storage, read> anchor: array<f32>;

/// u' at node n + o of a block or its halo.
fn anchor_at(b: u32, n: vec2u, o: vec2i) -> vec2f {
    let source = window_source(vec2u(vec2i(n) + 1 + o));
    let holder = blocks[b].neighbours[source.x];
    if holder == NONE || params.anchor_is_identity != 0u {
        return vec2f();
    }
    let at = FINEST_STATE_PLANES * holder * NODES + source.y;
    return vec2f(anchor[at], anchor[at + NODES]);
}

/// d - d' of edge k of node n, whose displacement is u.
fn change_of_offset(b: u32, n: vec2u, u: vec2f, k: u32) -> vec2f {
    let o = offset(k);
    return (patch_u[place_at(n, o)] - u) - (anchor_at(b, n, o) - anchor_at(b, n, vec2i()));
}

/// theta / |d0|^2.
fn pull_stiffness(k: u32) -> f32 {
    let o = vec2f(offset(k));
    return params.pull / dot(o, o);
}

fn pull_gradient(b: u32, n: vec2u, u: vec2f) -> vec2f {
    var gradient = vec2f();
    for (var k = 0u; k < 8u; k++) {
        gradient -= pull_stiffness(k) * change_of_offset(b, n, u, k);
    }
    return gradient;
}
