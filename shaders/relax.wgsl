// relax: relaxation (method §6). Each movable node takes its own 2x2 Gauss-Newton step while its neighbours are fixed,
// limited so that no corner Jacobian falls under MIN_JACOBIAN.
//
// One dispatch does all sweeps of a pass on the blocks of one block colour, which do not touch one another. On level 0
// it reads 12 bytes of state and 12 of constants per node (a quarter more for the halo; 4 more constants if
// `orientation_density` is not 0) and 72 per triangle, and writes 12 per node. On coarser levels it reads 8 bytes of
// state, 12 of constants and 12 of metrics per node, and writes 8.
//
// A node's terms are divided into quarters: two opposite edges, and the corners of one cell. How many threads work on a
// node is up to the file that this one follows: relax_narrow.wgsl or relax_wide.wgsl.

/// The gradient gamma_p of a node's energy, and its Gauss-Newton matrix H_p (xx, xy, yy).
struct Local {
    gradient: vec2f,
    matrix: vec3f,
}

/// Adds edge k. Only the matrix of the pull towards the previous result (pull.wgsl) is included.
fn add_edge(out: ptr<function, Local>, n: vec2u, p: NodeState, slopes: mat2x3f, floor: f32, k: u32) {
    let e = edge(n, p, k, floor);
    let near = near_gradient(e.chord, slopes);
    let scaled = e.weight * e.inverse_length;
    let smooth_weight = smoothness(e);
    let isotropic = smooth_weight + stress_stiffness(e) + params.pull * e.inverse_d0_square;
    let normal = vec2f(-e.offset.y, e.offset.x);
    let kappa = e.orientation * e.inverse_d0_square * e.inverse_d0_square;
    (*out).gradient += scaled * ((e.chord.length - e.length) * e.inverse_length) * near
        - smooth_weight * (e.chord.d - e.offset) - off_axis(e) * kappa * normal;
    (*out).matrix += scaled * e.inverse_length * outer(near) + vec3f(isotropic, 0.0, isotropic) + kappa * outer(normal);
}

fn add_corner(out: ptr<function, Local>, c: Corner) {
    let lack = max(params.room_threshold - c.jacobian, 0.0);
    (*out).gradient -= lack * params.room * c.slope;
    (*out).matrix += select(0.0, params.room, c.jacobian < params.room_threshold) * outer(c.slope);
}

/// Quarter q of a node's terms; `slopes` are the slopes at the node.
fn quarter(n: vec2u, p: NodeState, slopes: mat2x3f, floor: f32, q: u32) -> Local {
    var out = Local();
    add_edge(&out, n, p, slopes, floor, q);
    add_edge(&out, n, p, slopes, floor, q + 4u);
    let m = cell_offsets(n, p.u, q);
    add_corner(&out, cell_corner(m, 0u));
    add_corner(&out, cell_corner(m, 1u));
    add_corner(&out, cell_corner(m, 2u));
    return out;
}

/// The part of a step `delta` that leaves corner c most of what its Jacobian has over MIN_JACOBIAN.
fn corner_bound(c: Corner, delta: vec2f) -> f32 {
    let change = dot(c.slope, delta);
    // Only corners whose Jacobian decreases limit the step.
    return select(1.0, min(1.0, SWEPT_MARGIN * max(c.jacobian - MIN_JACOBIAN, 0.0) / -change), change < 0.0);
}

/// The least of these parts in quarter q.
fn quarter_bound(n: vec2u, u: vec2f, delta: vec2f, q: u32) -> f32 {
    let m = cell_offsets(n, u, q);
    return min(
        min(corner_bound(cell_corner(m, 0u), delta), corner_bound(cell_corner(m, 1u), delta)),
        corner_bound(cell_corner(m, 2u), delta)
    );
}

/// -H^-1 gamma, clamped to MAX_NODE_STEP.
fn newton_step(l: Local) -> vec2f {
    let determinant = l.matrix.x * l.matrix.z - l.matrix.y * l.matrix.y;
    let full = vec2f(
        l.matrix.y * l.gradient.y - l.matrix.z * l.gradient.x,
        l.matrix.y * l.gradient.x - l.matrix.x * l.gradient.y
    ) / select(determinant, TINY, determinant == 0.0);
    return clamp(full, vec2f(-MAX_NODE_STEP), vec2f(MAX_NODE_STEP));
}

/// Does a step of node n, if it may move. All threads of the workgroup call it.
fn step_node(b: u32, n: vec2u, t: u32, floor: f32, fraction: f32) {
    let at = place_at(n, vec2i());
    let moves = !fixed_in_patch(at);
    let p = node_state(n);
    var part = Local();
    if moves {
        part = terms_of_thread(n, p, slopes(b, vec2i(n), p.u, triangle_of(p.tag)), floor, t);
    }
    var l = sum_of_terms(part, t);
    let across = across_border(n);
    let moved = dot(across, p.u);
    l.gradient += params.hold * moved * across;
    l.matrix += params.hold * outer(across);
    if params.pull > 0.0 && moves {
        l.gradient += pull_gradient(b, n, p.u);
    }
    var delta = newton_step(l);
    delta *= least_bound(bound_of_thread(n, p.u, delta, t), t);
    delta *= fraction;
    // Steps that nobody sees are not worth a sample of the surface. A comparison with NaN is false: no step.
    if moves && t < 64u && dot(delta, delta) > MIN_NODE_STEP * MIN_NODE_STEP {
        let u = p.u + delta;
        let node = vec2i(vec2u(blocks[b].x, blocks[b].y) * 16u + n);
        let found = sample_surface(b, node, u, triangle_of(p.tag));
        if found.found {
            patch_u[at] = u;
            patch_value[at] = vec4f(found.value, patch_value[at].w);
            patch_tag[at] = found.triangle << 1u;
        }
    }
}

@compute @workgroup_size(PATCH_THREADS)
fn relax(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    load_patch(b, t);
    let floor = charts[blocks[b].chart].length_floor * params.scale;
    // After a partial correction, sweeps take the same fraction of their steps, so that both fade in together.
    let fraction = select(1.0, charts[blocks[b].chart].fraction, params.mode == RELAX_FRACTION);
    for (var sweep = 0u; sweep < 4u * params.sweeps; sweep++) {
        step_node(b, node_at(thread_slot(sweep % 4u, t % 64u)), t, floor, fraction);
        workgroupBarrier();
    }
    for (var s = t; s < NODES; s += PATCH_THREADS) {
        let at = place_at(node_at(s), vec2i());
        if !fixed_in_patch(at) {
            set_displacement(b, s, patch_u[at]);
            set_triangle(b, s, triangle_of(patch_tag[at]));
        }
    }
}
