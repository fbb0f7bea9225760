// correct: the vector operations of conjugate gradients (method §7.3). Their scalars are formed chart by chart and
// stand in `charts`. A dot product is summed per block here, and per chart in control.wgsl. Per node: `residual_dot`
// reads 16 bytes; `direction` reads 16 and writes 8; `curvature` reads 44 of rows and 8 of vectors (a quarter more for
// the halo) and writes 8; `advance` reads 32 (24 in the first iteration) and writes 16.

var<workgroup> sums: array<f32, 64>;

/// A v at the node at slot s, where the window holds v.
fn product(b: u32, s: u32) -> vec2f {
    let d = diagonal(b, s);
    let v = window_z[place_of_slot(s)];
    return off_diagonal(b, node_at(s)) + vec2f(d.x * v.x + d.y * v.y, d.y * v.x + d.z * v.y);
}

/// Writes the sum of all threads' values as the block's partial sum.
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

/// Sums r . z per block.
@compute @workgroup_size(64)
fn residual_dot(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        sum += dot(vector(b, RESIDUAL, s), vector(b, DIRECTION, s));
    }
    write_sum(group, t, sum);
}

/// z += beta x: the second direction; x is a multiple of the first one.
@compute @workgroup_size(64)
fn direction(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let beta = charts[blocks[b].chart].beta;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        set_vector(b, DIRECTION, s, vector(b, DIRECTION, s) + beta * vector(b, STEP, s));
    }
}

/// t = A z, and the sum of z . t per block.
@compute @workgroup_size(64)
fn curvature(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var k = t; k < WINDOW; k += 64u) {
        let source = window_source(window_node(k));
        let holder = blocks[b].active_neighbours[source.x];
        window_z[k] = vec2f();
        if holder != NONE {
            window_z[k] = vector(holder, DIRECTION, source.y);
        }
    }
    workgroupBarrier();
    var sum = 0.0;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        let v = product(b, s);
        set_vector(b, PRODUCT, s, v);
        sum += dot(vector(b, DIRECTION, s), v);
    }
    write_sum(group, t, sum);
}

/// x += alpha z, r -= alpha t.
@compute @workgroup_size(64)
fn advance(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let alpha = charts[blocks[b].chart].alpha;
    for (var k = 0u; k < 4u; k++) {
        let s = thread_slot(k, t);
        var x = alpha * vector(b, DIRECTION, s);
        if params.mode > 0u {
            x += vector(b, STEP, s);
        }
        // A system that f32 cannot solve must not make the state invalid.
        set_vector(b, STEP, s, select(vec2f(), x, abs(x) < vec2f(MAX_STEP)));
        // A step of length 0 leaves r as it is, even where t is NaN.
        if alpha != 0.0 {
            set_vector(b, RESIDUAL, s, vector(b, RESIDUAL, s) - alpha * vector(b, PRODUCT, s));
        }
    }
}
