// correct: the step length of conjugate gradients (method §7.3).

/// The length of a step along a direction: rz divided by the curvature; 0 if the curvature is not positive or the
/// quotient is not finite.
fn step_length(rz: f32, curvature: f32) -> f32 {
    let length = rz / select(1.0, curvature, curvature > 0.0);
    return select(0.0, length, curvature > 0.0 && is_finite(length));
}

/// The factors of the two directions of conjugate gradients and of the last step p in the step, and the predicted gain.
struct Combination {
    factors: vec3f,
    predicted: f32,
}

/// Adds to the step along two directions the part of p that is conjugate to both, at its best length. `curvatures` are
/// those of the directions; `products` are r1 . p, those of A p with the directions, and p . A p.
fn with_last_step(lengths: vec2f, curvatures: vec2f, predicted: f32, products: vec4f) -> Combination {
    // A direction along which no step was taken is no part of the step.
    let parts = select(vec2f(), products.yz / curvatures, lengths != vec2f());
    let curvature = products.w - select(0.0, parts.x * products.y, parts.x != 0.0) - select(0.0, parts.y * products.z, parts.y != 0.0);
    let falls = products.x - select(0.0, lengths.y * products.z, lengths.y != 0.0);
    let length = falls / curvature;
    if !(curvature > MIN_NEW_CURVATURE * products.w && is_finite(length)) {
        return Combination(vec3f(lengths, 0.0), predicted);
    }
    return Combination(vec3f(lengths - length * parts, length), predicted + length * falls);
}
