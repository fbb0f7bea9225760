//! Four neighbouring texels of a redirection map: its bilinear interpolation between them is one-to-one if the Jacobians at
//! their corners, of which it has its smallest at one, are positive.

/// The smallest Jacobian at a corner of a quad, 1 where nothing moves. `deltas` are the ways in UV from its texels' centres to
/// the redirected UVs, first of the two at its lower side; `size` is that of the map in texels.
pub(super) fn smallest_jacobian(deltas: [[f64; 2]; 4], size: [f64; 2]) -> f64 {
    // The places of the texels, in texels.
    let at = |k: usize| {
        let delta = deltas[k];
        [(k % 2) as f64 + delta[0] * size[0], (k / 2) as f64 + delta[1] * size[1]]
    };
    let (a, b, c, d) = (at(0), at(1), at(2), at(3));
    let way = |from: [f64; 2], to: [f64; 2]| [to[0] - from[0], to[1] - from[1]];
    let cross = |e: [f64; 2], f: [f64; 2]| e[0] * f[1] - e[1] * f[0];
    let (low, high, left, right) = (way(a, b), way(c, d), way(a, c), way(b, d));
    let smallest = cross(low, left).min(cross(low, right)).min(cross(high, left)).min(cross(high, right));
    // Of coarse numbers neighbours may be equal: the rounding of their distance must not pass for one.
    if smallest.abs() < 1e-11 { 0.0 } else { smallest }
}
