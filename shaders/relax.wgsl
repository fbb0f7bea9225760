// relax: relaxation (method §6). Each movable node takes its own 2x2 Gauss-Newton step while its neighbours are fixed,
// limited so that no corner Jacobian falls under MIN_JACOBIAN, and only if the node's energy does not rise.
//
// One dispatch does all sweeps of a pass on the blocks of one block colour, which do not touch one another. On level 0
// it reads 12 bytes of state and 12 of constants per node (a quarter more for the halo; 4 more constants if
// `orientation_density` is not 0) and 72 per triangle, and writes 12 per node. On coarser levels it reads 8 bytes of
// state, 12 of constants and 12 of metrics per node, and writes 8.

const PATCH_THREADS: u32 = 64u;

/// -H^-1 gamma, clamped to MAX_NODE_STEP and limited so that every corner Jacobian keeps most of what it has over
/// MIN_JACOBIAN.
fn newton_step(n: vec2u, u: vec2f, l: Local) -> vec2f {
    let determinant = l.matrix.x * l.matrix.z - l.matrix.y * l.matrix.y;
    let full = vec2f(
        l.matrix.y * l.gradient.y - l.matrix.z * l.gradient.x,
        l.matrix.y * l.gradient.x - l.matrix.x * l.gradient.y
    ) / select(determinant, TINY, determinant == 0.0);
    let delta = clamp(full, vec2f(-MAX_NODE_STEP), vec2f(MAX_NODE_STEP));
    var bound = 1.0;
    for (var q = 0u; q < 4u; q++) {
        let m = cell_offsets(n, u, q);
        for (var k = 0u; k < 3u; k++) {
            let c = cell_corner(m, k);
            let change = dot(c.slope, delta);
            // Only corners whose Jacobian decreases limit the step.
            if change < 0.0 {
                bound = min(bound, SWEPT_MARGIN * max(c.jacobian - MIN_JACOBIAN, 0.0) / -change);
            }
        }
    }
    return delta * bound;
}

fn step_node(b: u32, n: vec2u, floor: f32, fraction: f32) {
    let at = place_at(n, vec2i());
    let p = node_state(n);
    var l = local_problem(n, p, slopes(b, vec2i(n), p.u, triangle_of(p.tag)), floor);
    if params.pull > 0.0 {
        l.energy += pull_energy(b, n, p.u);
        l.gradient += pull_gradient(b, n, p.u);
    }
    let node = vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + n);
    var delta = newton_step(n, p.u, l);
    if !(-dot(l.gradient, delta) > MIN_RELATIVE_GAIN * l.energy) {
        return;
    }
    delta *= fraction;
    // The second trial takes half of the step.
    for (var trial = 0u; trial < 2u; trial++) { // model: 1 times
        let u = p.u + delta;
        let found = sample_surface(b, node, u, triangle_of(p.tag));
        if found.found {
            let trial_state = NodeState(u, found.value, tangents(found.triangle), found.triangle << 1u);
            var energy = node_energy(n, trial_state, floor);
            if params.pull > 0.0 {
                energy += pull_energy(b, n, u);
            }
            if energy <= l.energy && energy < INVALID_ENERGY {
                patch_u[at] = u;
                patch_value[at] = vec4f(found.value, patch_value[at].w);
                patch_tag[at] = found.triangle << 1u;
                return;
            }
        }
        delta *= 0.5;
    }
}

@compute @workgroup_size(64)
fn relax(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    // model: near
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    // After a partial correction, sweeps take the same fraction of their steps, so that both fade in together.
    let fraction = select(1.0, charts[blocks[b].chart].fraction, params.mode == RELAX_FRACTION);
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        let n = node_at(thread_slot(sweep % 4u, t));
        if !fixed_in_patch(place_at(n, vec2i())) {
            step_node(b, n, floor, fraction);
        }
        workgroupBarrier();
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let at = place_at(node_at(s), vec2i());
        if !fixed_in_patch(at) {
            set_displacement(b, s, patch_u[at]);
            set_triangle(b, s, triangle_of(patch_tag[at]));
        }
    }
}
