// correct: conjugate gradients around the V-cycle, chart by chart; their scalars stand in the charts. A dot product is
// a sum per block here, and a sum per chart in control.wgsl.

var<workgroup> sums: array<f32, 64>;

/// A v at a node, v being in the window.
fn product(b: u32, s: u32) -> vec2f {
    let d = diagonal(b, s);
    let v = near[own_place(s)];
    return off_diagonal(b, node_of(s)) + vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
}

/// Writes a block's sum of what its threads bring.
fn write_sum(group: vec3u, t: u32, value: f32) {
    sums[t] = value;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if t < half {
            sums[t] += sums[t + half];
        }
        workgroupBarrier();
    }
    if t == 0u {
        partials[params.partial + group.y * SPREAD + group.x] = vec4f(sums[0], 0.0, 0.0, 0.0);
    }
}

/// r . z
@compute @workgroup_size(64)
fn residual_dot(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        sum += dot(vector(b, RESIDUAL, s), vector(b, DIRECTION, s));
    }
    write_sum(group, t, sum);
}

/// z += beta x: the second direction, since the first one is a share of the first step.
@compute @workgroup_size(64)
fn direction(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let beta = charts[blocks[b].chart].beta;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        set_vector(b, DIRECTION, s, vector(b, DIRECTION, s) + beta * vector(b, STEP, s));
    }
}

/// t = A z, and z . A z.
@compute @workgroup_size(64)
fn curvature(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        near[k] = vec2f();
        if holder != NONE {
            near[k] = vector(holder, DIRECTION, source.y);
        }
    }
    workgroupBarrier();
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        let v = product(b, s);
        set_vector(b, PRODUCT, s, v);
        sum += dot(vector(b, DIRECTION, s), v);
    }
    write_sum(group, t, sum);
}

/// x += alpha z, r -= alpha t.
@compute @workgroup_size(64)
fn advance(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    let alpha = charts[blocks[b].chart].alpha;
    for (var k = 0u; k < 4u; k++) {
        let s = own_slot(k, t);
        var x = alpha * vector(b, DIRECTION, s);
        if params.mode > 0u {
            x += vector(b, STEP, s);
        }
        // A system that f32 cannot solve must not spoil the state.
        set_vector(b, STEP, s, select(vec2f(), x, abs(x) < vec2f(MAX_STEP)));
        // No step leaves r as it is, also where t is not a number.
        if alpha != 0.0 {
            set_vector(b, RESIDUAL, s, vector(b, RESIDUAL, s) - alpha * vector(b, PRODUCT, s));
        }
    }
}
