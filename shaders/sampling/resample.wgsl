// Sets a block's displacements from outside and samples the surface under them anew: the identity, the previous
// result, or a part of a step. Reads 20 bytes per node and the triangle under it, writes 24.

/// The previous result: two planes per block.
@group(0) @binding(10) var<storage, read> previous_result: array<f32>;

fn put(b: u32, s: u32, u: vec2f) {
    let fixed = is_fixed(b, s);
    let found = refreshed(b, node_in_level(b, s), s, u, fixed);
    let to = state_at(b, 0u, s);
    state[to] = bitcast<u32>(u.x);
    state[to + NODES] = bitcast<u32>(u.y);
    for (var c = 0u; c < 3u; c++) {
        state[to + (VALUE + c) * NODES] = bitcast<u32>(found.value[c]);
    }
    state[to + TRIANGLE * NODES] = found.triangle;
}

@compute @workgroup_size(64)
fn identity(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        put(b, own_slot(colour, t), vec2f());
    }
}

@compute @workgroup_size(64)
fn previous(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let at = 2u * b * NODES + s;
        put(b, s, vec2f(previous_result[at], previous_result[at + NODES]));
    }
}

/// u = what it was before the step, and `factor` of the fraction of the step. The first trial keeps what it was.
@compute @workgroup_size(64)
fn step(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = choose(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = own_slot(colour, t);
        let keep = vector_at(b, BEFORE, s);
        if params.mode == STEP_FIRST_TRIAL {
            let u = displacement(b, s);
            vectors[keep] = u.x;
            vectors[keep + NODES] = u.y;
        }
        var u = vec2f(vectors[keep], vectors[keep + NODES]);
        if params.factor > 0.0 {
            let x = vector_at(b, STEP, s);
            // Each round of the step limit wrote the other plane.
            let plane = FRACTION + (atomicLoad(&charts[blocks[b].chart].limit_rounds) & 1u);
            let part = params.factor * charts[blocks[b].chart].fraction;
            u += part * vectors[vector_at(b, plane, s)] * vec2f(vectors[x], vectors[x + NODES]);
        }
        put(b, s, u);
    }
}
