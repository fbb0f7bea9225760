// correct: the step length of conjugate gradients (method §7.3).

/// The length of a step along a direction: rz divided by the curvature; 0 if the curvature is not positive or the
/// quotient is not finite.
fn step_length(rz: f32, curvature: f32) -> f32 {
    let length = rz / select(1.0, curvature, curvature > 0.0);
    return select(0.0, length, curvature > 0.0 && is_finite(length));
}
