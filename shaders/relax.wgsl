// relax: block descent. Each node takes its own 2x2 Gauss-Newton step with its neighbours fixed, cut so that no corner
// Jacobian falls under epsilon, and only if its own energy falls.
//
// One dispatch is one block colour, all sweeps of a pass: blocks of a colour do not touch. Per node it reads 24 bytes of state and 20 of
// constants (a quarter more for the ring) and the triangle under it (36), and writes 24.

/// -H^-1 g, cut to the trusted length and to J >= epsilon at every corner.
fn newton_step(n: vec2u, u: vec2f, l: Local) -> vec2f {
    let determinant = l.matrix.x * l.matrix.z - l.matrix.y * l.matrix.y;
    let full = vec2f(
        l.matrix.y * l.gradient.y - l.matrix.z * l.gradient.x,
        l.matrix.y * l.gradient.x - l.matrix.x * l.gradient.y
    ) / select(determinant, TINY, determinant == 0.0);
    let delta = clamp(full, vec2f(-MAX_NODE_STEP), vec2f(MAX_NODE_STEP));
    var bound = 1.0;
    for (var q = 0u; q < 4u; q++) {
        let m = arms(n, u, q);
        for (var k = 0u; k < 3u; k++) {
            let c = corner_of(m, k);
            let change = dot(c.slope, delta);
            // Only corners that shrink limit the step.
            if change < 0.0 {
                bound = min(bound, max(c.jacobian - MIN_JACOBIAN, 0.0) / -change);
            }
        }
    }
    return delta * bound * BOUND_SAFETY;
}

fn step_node(b: u32, n: vec2u, floor: f32, fraction: f32) {
    let at = seen(n, vec2i());
    let p = here(b, n);
    let l = local_problem(n, p, floor);
    let node = vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + n);
    var delta = newton_step(n, p.u, l);
    if !(-dot(l.gradient, delta) > MIN_RELATIVE_GAIN * l.energy) {
        return;
    }
    delta *= fraction;
    // The second try has half the step.
    for (var try_ = 0u; try_ < 2u; try_++) {
        let u = p.u + delta;
        let found = sample_surface(b, node, u, triangle_of(p.tag));
        if found.found {
            let there = Here(u, found.value, mat2x3f(found.slope_x, found.slope_y), found.triangle << 1u);
            let energy = node_energy(n, there, floor);
            if energy <= l.energy && energy < INVALID_ENERGY {
                near_u[at] = u;
                near_value[at] = vec4f(found.value, near_value[at].w);
                near_tag[at] = found.triangle << 1u;
                return;
            }
        }
        delta *= 0.5;
    }
}

@compute @workgroup_size(64)
fn relax(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    // After a partial correction sweeps take the same fraction of their steps, so that both set in together.
    let fraction = select(1.0, charts[blocks[b].chart].fraction, params.mode == RELAX_FRACTION);
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        let n = node_of(own_slot(sweep % 4u, t));
        if !fixed_in_patch(seen(n, vec2i())) {
            step_node(b, n, floor, fraction);
        }
        workgroupBarrier();
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let at = seen(node_of(s), vec2i());
        if !fixed_in_patch(at) {
            let to = state_at(b, 0u, s);
            state[to] = bitcast<u32>(near_u[at].x);
            state[to + NODES] = bitcast<u32>(near_u[at].y);
            for (var c = 0u; c < 3u; c++) {
                state[to + (VALUE + c) * NODES] = bitcast<u32>(near_value[at][c]);
            }
            state[to + TRIANGLE * NODES] = triangle_of(near_tag[at]);
        }
    }
}
