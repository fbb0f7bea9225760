// pbd: where a block's nodes and those around it are, and where they go.

/// Writes a node: where the surface is there to be sampled, at its new place; a node that would leave its chart stays.
fn move_to(b: u32, s: u32, u: vec2f, moves: bool) {
    let here = get_u(b, s);
    let start = get_state(b, TRIANGLE, s);
    if moves && any(u != here) {
        let found = sample_surface(b, node_in_level(b, s), u, start);
        if found.found {
            put_state(b, U, s, bitcast<u32>(u.x));
            put_state(b, U + 1u, s, bitcast<u32>(u.y));
            for (var c = 0u; c < 3u; c++) {
                put_state(b, VALUE + c, s, bitcast<u32>(found.value[c]));
            }
            put_state(b, TRIANGLE, s, found.triangle);
            return;
        }
    }
    for (var plane = 0u; plane < STATE_PLANES; plane++) {
        put_state(b, plane, s, get_state(b, plane, s));
    }
}

var<workgroup> near_u: array<vec2f, 324>;

fn load_u(b: u32, t: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        near_u[k] = vec2f();
        if holder != NONE {
            near_u[k] = get_u(holder, source.y);
        }
    }
}

/// A node's place in the window, seen from node n of the block.
fn seen(n: vec2u, o: vec2i) -> u32 {
    let at = vec2u(vec2i(n) + 1 + o);
    return place(at.x, at.y);
}
