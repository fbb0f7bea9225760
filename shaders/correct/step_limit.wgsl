// correct: the conditions of the step limit (method §7.6) on a node's twelve corners. The kernel that includes this
// file declares `offset_to(n, o)`, the offset of node n's neighbour at o, and `change(n, o)`, its change over the whole
// step.

/// The smallest normal f32: keeps a quotient finite.
const SMALLEST: f32 = 1.1754944e-38;

/// The smallest fraction that the twelve corners of node n allow if each keeps the fraction `left` of its margin
/// (method §7.6, Fraction per corner).
fn allowed_fraction(n: vec2i, left: f32) -> f32 {
    var fraction = 1.0;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let o = array<vec2i, 3>(vec2i(s.x, 0), vec2i(0, s.y), s);
        var offsets: array<vec2f, 3>;
        var changes: array<vec2f, 3>;
        for (var k = 0u; k < 3u; k++) {
            offsets[k] = offset_to(n, o[k]);
            changes[k] = change(n, o[k]);
        }
        let sign = f32(s.x * s.y);
        for (var k = 0u; k < 3u; k++) {
            // The node's own corner, its x-neighbour's, its y-neighbour's.
            let i = select(0u, 2u, k == 2u);
            let j = select(1u, 2u, k == 1u);
            // At the fraction s of the step, J minus the margin that must be left is q(s) = start + first s + second
            // s^2, with q(0) >= 0. If q(1) < 0, it has one root in between.
            let over = max(sign * cross2(offsets[i], offsets[j]) - STEP_MIN_JACOBIAN, 0.0);
            let start = over * (1.0 - left);
            let first = sign * (cross2(changes[i], offsets[j]) + cross2(offsets[i], changes[j]));
            let second = sign * cross2(changes[i], changes[j]);
            if start + first + second < 0.0 {
                let root = sqrt(max(first * first - 4.0 * start * second, 0.0)) - first;
                fraction = min(fraction, (start + start) / max(root, SMALLEST));
            }
        }
    }
    return fraction;
}

fn cross2(a: vec2f, b: vec2f) -> f32 {
    return a.x * b.y - a.y * b.x;
}

/// The smallest of the twelve corner Jacobians that depend on node n; -INVALID_ENERGY if one is NaN or infinite.
fn worst_corner(n: vec2i) -> f32 {
    var worst = INVALID_ENERGY;
    for (var q = 0u; q < 4u; q++) {
        let s = quadrant(q);
        let a = offset_to(n, vec2i(s.x, 0));
        let b = offset_to(n, vec2i(0, s.y));
        let c = offset_to(n, s);
        let sign = f32(s.x * s.y);
        let corners = sign * vec3f(cross2(a, b), cross2(a, c), cross2(c, b));
        for (var k = 0u; k < 3u; k++) {
            worst = min(worst, select(-INVALID_ENERGY, corners[k], is_finite(corners[k])));
        }
    }
    return worst;
}
