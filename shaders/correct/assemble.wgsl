// correct, first step: assembles the Gauss-Newton system of a level (method §7.1). For each pair of neighbours p and n
// it sums w / l^2 g_p g_n' and the other terms that depend on both; the pair is stored once, with the node that owns
// the edge. The right-hand side is minus the gradient (matrix and gradient are halves of derivatives). Per node it
// reads what relax reads, and writes 52 bytes; it reads 44 per triangle.

/// The near-bound penalty's stiffness at a corner (method §7.1).
fn near_bound(jacobian: f32) -> f32 {
    return select(0.0, NEAR_BOUND_STIFFNESS, jacobian < NEAR_BOUND_JACOBIAN);
}

/// The outer product a b', row-major.
fn outer_pair(a: vec2f, b: vec2f) -> vec4f {
    return vec4f(a.x * b.x, a.x * b.y, a.y * b.x, a.y * b.y);
}

/// Index of the neighbour at offset o: the inverse of `offset`.
fn neighbour_at(o: vec2i) -> u32 {
    let neighbour_owns = o.y < 0 || (o.y == 0 && o.x < 0);
    let d = select(o, -o, neighbour_owns);
    let e = select(select(select(3u, 2u, d.x > 0), 1u, d.x == 0), 0u, d.y == 0);
    return e + select(0u, 4u, neighbour_owns);
}

@compute @workgroup_size(64)
fn assemble(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    var energy = 0.0;
    var worst = 1.0;
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let n = node_at(s);
        if fixed_in_patch(place_at(n, vec2i())) {
            // A fixed node has the identity as its diagonal, so that the smoother does not divide by zero.
            let at = row_index(b, 0u, s);
            set_diagonal(at, vec3f(1.0, 0.0, 1.0));
            for (var c = 0u; c < 8u; c++) {
                rows[at + (PAIR + c) * NODES] = 0u;
            }
            vectors[vector_index(b, RESIDUAL, s)] = 0.0;
            vectors[vector_index(b, RESIDUAL + 1u, s)] = 0.0;
        } else {
            assemble_node(b, n, s, floor);
            energy += shared_energy(n, node_state(n), floor);
            worst = worst_corner(n, worst);
        }
    }
    // The energy before the correction. It is added up before its memory is used for other quantities.
    let sum = energy_of_block(t, energy, worst, false);
    if t == 0u {
        vectors[vector_index(b, ENERGY_BEFORE, 0u)] = sum;
    }
}

fn set_diagonal(at: u32, diagonal: vec3f) {
    for (var c = 0u; c < 3u; c++) {
        rows[at + c * NODES] = bitcast<u32>(diagonal[c]);
    }
}

fn assemble_node(b: u32, n: vec2u, s: u32, floor: f32) {
    let p = node_state(n);
    let own = slopes(b, vec2i(n), p.u, triangle_of(p.tag));
    let l = local_problem(n, p, own, floor);
    var diagonal = l.matrix;
    var pairs: array<vec4f, 8>;
    for (var q = 0u; q < 4u; q++) {
        let m = cell_offsets(n, p.u, q);
        let sign = quadrant(q);
        for (var k = 0u; k < 3u; k++) {
            let first = select(m.a, m.c, k == 2u);
            let second = select(m.b, m.c, k == 1u);
            let c = corner(first, second, m.sign);
            diagonal += near_bound(c.jacobian) * outer(c.slope);
            let beta = select(0.0, params.room, c.jacobian < params.room_threshold) + near_bound(c.jacobian);
            // The products dJ/dp dJ/da' and dJ/dp dJ/db', with a and b the ends of the offsets `first` and `second`.
            // The factor `sign` of all derivatives cancels in the products.
            let gradient_p = vec2f(first.y - second.y, second.x - first.x);
            let to_first = select(vec2i(sign.x, 0), sign, k == 2u);
            let to_second = select(vec2i(0, sign.y), sign, k == 1u);
            pairs[neighbour_at(to_first)] += beta * outer_pair(gradient_p, vec2f(second.y, -second.x));
            pairs[neighbour_at(to_second)] += beta * outer_pair(gradient_p, vec2f(-first.y, first.x));
        }
    }
    let at = row_index(b, 0u, s);
    vectors[vector_index(b, RESIDUAL, s)] = -l.gradient.x;
    vectors[vector_index(b, RESIDUAL + 1u, s)] = -l.gradient.y;
    for (var k = 0u; k < 8u; k++) {
        let e = edge(n, p, k, floor);
        var pair = vec4f();
        // Only pairs of two movable nodes count.
        if !fixed_in_patch(e.neighbour) {
            let far = slopes(b, vec2i(n) + offset(k), patch_u[e.neighbour], triangle_of(patch_tag[e.neighbour]));
            let square = e.weight * e.inverse_length * e.inverse_length;
            let isotropic = smoothness(e) + stress_stiffness(e) + params.pull * e.inverse_d0_square;
            let normal = vec2f(-e.offset.y, e.offset.x);
            pair = square * outer_pair(near_gradient(e.chord, own), far_gradient(e.chord, far))
                - vec4f(isotropic, 0.0, 0.0, isotropic)
                - e.orientation * e.inverse_d0_square * e.inverse_d0_square * outer_pair(normal, normal)
                + pairs[k];
        }
        diagonal += rounding_loss(pair);
        if k < 4u {
            let words = encode(pair);
            rows[at + (PAIR + 2u * k) * NODES] = words.x;
            rows[at + (PAIR + 2u * k + 1u) * NODES] = words.y;
        }
    }
    set_diagonal(at, diagonal);
}
