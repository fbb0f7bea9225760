// correct: the step, a combination of the two preconditioned residuals of conjugate gradients and of the last step
// (method §7.3).

fn step_vector(b: u32, s: u32) -> vec2f {
    let factors = charts[blocks[b].chart].step;
    var x = vec2f();
    // A vector with a factor of 0 is left out, even where it is NaN.
    if factors[0] != 0.0 {
        let at = vector_index(b, DIRECTION, s);
        x += factors[0] * vec2f(vectors[at], vectors[at + NODES]);
    }
    if factors[1] != 0.0 {
        let at = vector_index(b, RESIDUAL, s);
        x += factors[1] * vec2f(vectors[at], vectors[at + NODES]);
    }
    if factors[2] != 0.0 {
        x += factors[2] * decode_vector(vectors[vector_index(b, LAST_STEP, s)]);
    }
    // A system that f32 cannot solve must not make the state invalid.
    return select(vec2f(), x, abs(x) < vec2f(MAX_STEP));
}
