// Sets the displacements of blocks and, on level 0, finds the triangles there (method §2, Point location): to the
// identity, to the previous result, or to a fraction of a step. Per node `identity` writes 8 bytes; on level 0 it reads
// 8 of constants and writes 12, and reads 40 per triangle. In addition, `previous` reads 8 bytes of the result, and
// `step` 20 of vectors; in the first trial, `step` also reads 8 and writes 8 more.

/// Displacements of the previous result: two planes per block.
@group(0) @binding(10) var<storage, read> previous_result: array<f32>;

fn resample(b: u32, s: u32, u: vec2f) {
    set_displacement(b, s, u);
    find_triangle(b, s, u);
}

@compute @workgroup_size(64)
fn identity(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        resample(b, thread_slot(colour, t), vec2f());
    }
}

@compute @workgroup_size(64)
fn previous(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let at = 2u * b * NODES + s;
        resample(b, s, vec2f(previous_result[at], previous_result[at + NODES]));
    }
}

/// Sets u = u0 + `factor` psi phi x (method §7.7): the displacement before the step plus the trial's fraction, times
/// the chart's step fraction, times the node's step fraction, of the step x. The first trial stores u0.
@compute @workgroup_size(64)
fn step(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    for (var colour = 0u; colour < 4u; colour++) {
        let s = thread_slot(colour, t);
        let before = vector_index(b, U_BEFORE, s);
        if params.mode == STEP_FIRST_TRIAL {
            let u = displacement(b, s);
            vectors[before] = u.x;
            vectors[before + NODES] = u.y;
        }
        var u = vec2f(vectors[before], vectors[before + NODES]);
        if params.factor > 0.0 {
            let x = vector_index(b, STEP, s);
            // The rounds of the step limit write the two planes alternately.
            let plane = FRACTION + (atomicLoad(&charts[blocks[b].chart].limit_rounds) & 1u);
            let fraction = params.factor * charts[blocks[b].chart].fraction;
            u += fraction * vectors[vector_index(b, plane, s)] * vec2f(vectors[x], vectors[x + NODES]);
        }
        resample(b, s, u);
    }
}
