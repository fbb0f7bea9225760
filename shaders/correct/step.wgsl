// correct: takes a fraction of the step and resamples the surface (method §7.7). In addition to what `resample` does,
// it reads 20 bytes of vectors per node, and in the first trial 8 of the state, and writes 20 there.

/// Sets u = u0 + `factor` psi phi x (method §7.7): the displacement before the step plus the trial's fraction, times
/// the chart's step fraction, times the node's step fraction, of the step x. In the first trial, u0 and x replace the
/// two vectors of which x is a combination.
@compute @workgroup_size(256)
fn step(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let b = block_of_workgroup(group, t);
    if b == NONE {
        return;
    }
    let before = vector_index(b, U_BEFORE, t);
    let step = vector_index(b, STEP, t);
    if params.mode == STEP_FIRST_TRIAL {
        let x = step_vector(b, t);
        let u = displacement(b, t);
        vectors[before] = u.x;
        vectors[before + NODES] = u.y;
        vectors[step] = x.x;
        vectors[step + NODES] = x.y;
        vectors[vector_index(b, LAST_STEP, t)] = encode_vector(x);
    }
    var u = vec2f(vectors[before], vectors[before + NODES]);
    if params.factor > 0.0 {
        // The rounds of the step limit write the two planes alternately.
        let rounds = max(atomicLoad(&charts[blocks[b].chart].limit_rounds), 1u) - 1u;
        let plane = FRACTION + (rounds & 1u);
        let fraction = params.factor * charts[blocks[b].chart].fraction;
        u += fraction * vectors[vector_index(b, plane, t)] * vec2f(vectors[step], vectors[step + NODES]);
    }
    resample(b, t, u);
}
