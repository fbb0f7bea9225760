// pbd: access to the displacements of a block and its halo, and the writing of new ones (method §10).

/// The triangle under W of a node in the copy that is read.
fn present_triangle(b: u32, s: u32, fixed: bool) -> u32 {
    if TANGENTS && !fixed {
        return get_state(b, TRIANGLE, s);
    }
    return rest_triangle(b, s);
}

/// Writes the state of a node at its new displacement u if it moves and if the surface has a sample there; a node that
/// would leave its chart stays.
fn move_to(b: u32, s: u32, u: vec2f, moves: bool) {
    let u_before = get_u(b, s);
    if moves && any(u != u_before) {
        let sample = sample_surface(b, node_in_level(b, s), u, present_triangle(b, s, false));
        if sample.found {
            put_state(b, U, s, bitcast<u32>(u.x));
            put_state(b, U + 1u, s, bitcast<u32>(u.y));
            if TANGENTS {
                put_state(b, TRIANGLE, s, sample.triangle);
            }
            return;
        }
    }
    for (var plane = 0u; plane < params.state_planes; plane++) {
        put_state(b, plane, s, get_state(b, plane, s));
    }
}

var<workgroup> patch_u: array<vec2f, 324>;

fn load_u(b: u32, t: u32) {
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].neighbours[source.x];
        patch_u[k] = vec2f();
        if holder != NONE {
            patch_u[k] = get_u(holder, source.y);
        }
    }
}

/// Index in the window of the node at offset o from node n of the block.
fn place_at(n: vec2u, o: vec2i) -> u32 {
    let at = vec2u(vec2i(n) + 1 + o);
    return place(at.x, at.y);
}
