// correct, first step: the Gauss-Newton system of a level. For each pair of neighbours the sum of w / l^2 g_p g_n' over
// what depends on both, stored once, with the node that owns the edge; the right-hand side is minus the gradient
// (halves of the derivatives on both sides). Reads what relax reads, writes 52 bytes per node.

/// The near-bound penalty's stiffness at a corner (method §7.1).
fn near_bound(jacobian: f32) -> f32 {
    return select(0.0, NEAR_BOUND_STIFFNESS, jacobian < NEAR_BOUND_JACOBIAN);
}

/// a b', row-major.
fn outer_pair(a: vec2f, b: vec2f) -> vec4f {
    return vec4f(a.x * b.x, a.x * b.y, a.y * b.x, a.y * b.y);
}

/// The neighbour at o: the inverse of `offset`.
fn neighbour_at(o: vec2i) -> u32 {
    let theirs = o.y < 0 || (o.y == 0 && o.x < 0);
    let d = select(o, -o, theirs);
    let e = select(select(select(3u, 2u, d.x > 0), 1u, d.x == 0), 0u, d.y == 0);
    return e + select(0u, 4u, theirs);
}

@compute @workgroup_size(64)
fn assemble(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let n = node_of(s);
        if fixed_in_patch(seen(n, vec2i())) {
            // The identity, so that nothing divides by zero.
            let at = row_at(b, 0u, s);
            set_diagonal(at, vec3f(1.0, 0.0, 1.0));
            for (var c = 0u; c < 8u; c++) {
                rows[at + (PAIR + c) * NODES] = 0u;
            }
            vectors[vector_at(b, RESIDUAL, s)] = 0.0;
            vectors[vector_at(b, RESIDUAL + 1u, s)] = 0.0;
        } else {
            assemble_node(b, n, s, floor);
        }
    }
}

fn set_diagonal(at: u32, diagonal: vec3f) {
    for (var c = 0u; c < 3u; c++) {
        rows[at + c * NODES] = bitcast<u32>(diagonal[c]);
    }
}

fn assemble_node(b: u32, n: vec2u, s: u32, floor: f32) {
    let p = here(b, n);
    let l = local_problem(n, p, floor);
    var diagonal = l.matrix;
    var pairs: array<vec4f, 8>;
    for (var q = 0u; q < 4u; q++) {
        let m = arms(n, p.u, q);
        let sign = quadrant(q);
        for (var k = 0u; k < 3u; k++) {
            let first = select(m.a, m.c, k == 2u);
            let second = select(m.b, m.c, k == 1u);
            let c = corner(first, second, m.sign);
            diagonal += near_bound(c.jacobian) * outer(c.slope);
            let beta = select(0.0, params.room, c.jacobian < params.room_threshold) + near_bound(c.jacobian);
            // dJ/dp, dJ/da and dJ/db; the sign squares away.
            let own = vec2f(first.y - second.y, second.x - first.x);
            let to_first = select(vec2i(sign.x, 0), sign, k == 2u);
            let to_second = select(vec2i(0, sign.y), sign, k == 1u);
            pairs[neighbour_at(to_first)] += beta * outer_pair(own, vec2f(second.y, -second.x));
            pairs[neighbour_at(to_second)] += beta * outer_pair(own, vec2f(-first.y, first.x));
        }
    }
    let at = row_at(b, 0u, s);
    vectors[vector_at(b, RESIDUAL, s)] = -l.gradient.x;
    vectors[vector_at(b, RESIDUAL + 1u, s)] = -l.gradient.y;
    let node = vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + n);
    for (var k = 0u; k < 8u; k++) {
        let e = edge(n, p, k, floor);
        var pair = vec4f();
        // Only pairs of movable nodes take part.
        if !fixed_in_patch(e.at) {
            let slope_n = slopes(b, node + offset(k), near_u[e.at], triangle_of(near_tag[e.at]));
            let square = e.weight * e.inverse * e.inverse;
            let smooth_weight = smoothness(e);
            let normal = vec2f(-e.offset.y, e.offset.x);
            pair = square * outer_pair(near_gradient(e.chord, p.slope), far_gradient(e.chord, slope_n))
                - vec4f(smooth_weight, 0.0, 0.0, smooth_weight)
                - e.orientation * e.shorter * e.shorter * outer_pair(normal, normal)
                + pairs[k];
        }
        diagonal += lost(pair);
        if k < 4u {
            let words = encode(pair);
            rows[at + (PAIR + 2u * k) * NODES] = words.x;
            rows[at + (PAIR + 2u * k + 1u) * NODES] = words.y;
        }
    }
    set_diagonal(at, diagonal);
}
