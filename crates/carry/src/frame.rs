//! Frames of tangent maps, quaternions (x, y, z, w), and the rigid motion that fits points best. Of f64, by + - * /
//! and square roots alone, so that the bits are the same on any machine.

use glam::{DMat3, DQuat, DVec3};

/// The rotation nearest to the tangents of a surface, with its normal as third axis, and what is left of their stretch.
#[derive(Clone, Copy, Debug)]
pub struct Frame {
    pub axes: DMat3,
    /// The singular values of the tangents, the larger first.
    pub stretch: [f64; 2],
}

/// A share of the squared lengths of two tangents below which they have no plane.
const FLAT: f64 = 1e-24;

/// The unit normal of two tangents. Tangents without a plane get one that is continued from the longer of them.
#[inline(always)]
pub fn normal(a: DVec3, b: DVec3) -> DVec3 {
    let (aa, bb) = (a.length_squared(), b.length_squared());
    let cross = a.cross(b);
    let area2 = cross.length_squared();
    // Also false for values that are not finite.
    if area2 > FLAT * aa * bb && area2.is_finite() { cross * area2.sqrt().recip() } else { any_normal(a, b) }
}

/// The polar decomposition of two tangents with this normal n: the rotation takes the first axis to the direction of
/// a - n x b. Of all rotations within the plane, that one maximises the trace of its product with the tangents.
#[inline(always)]
pub fn polar(normal: DVec3, [a, b]: [DVec3; 2]) -> Frame {
    let turned = normal.cross(b);
    let (along, apart) = (a - turned, (a + turned).length());
    let sum = along.length();
    let first =
        if sum > 0.0 && sum.is_finite() { along * sum.recip() } else { any_normal(normal, DVec3::ZERO) };
    let stretch = if sum.is_finite() { [0.5 * (sum + apart), 0.5 * (sum - apart).abs()] } else { [0.0; 2] };
    Frame { axes: DMat3::from_cols(first, normal.cross(first), normal), stretch }
}

/// A unit vector at right angles to the longer of two vectors.
#[cold]
fn any_normal(a: DVec3, b: DVec3) -> DVec3 {
    let (aa, bb) = (a.length_squared(), b.length_squared());
    let longer = if bb > aa { b } else { a };
    let length2 = longer.length_squared();
    if length2 <= 0.0 || !length2.is_finite() {
        return DVec3::Z;
    }
    let size = longer.abs();
    let axis = if size.z <= size.x && size.z <= size.y {
        DVec3::Z
    } else if size.y <= size.x {
        DVec3::Y
    } else {
        DVec3::X
    };
    let apart = axis - longer * (axis.dot(longer) / length2);
    apart / apart.length()
}

#[inline(always)]
pub fn quaternion(m: &DMat3) -> DQuat {
    let [[a, b, c], [d, e, f], [g, h, i]] = m.to_cols_array_2d();
    // The largest component first: its square is a quarter at least.
    let q = if a + e + i > 0.0 {
        [f - h, g - c, b - d, 1.0 + a + e + i]
    } else if a >= e && a >= i {
        [1.0 + a - e - i, b + d, g + c, f - h]
    } else if e >= i {
        [b + d, 1.0 - a + e - i, f + h, g - c]
    } else {
        [g + c, f + h, 1.0 - a - e + i, b - d]
    };
    normalised(q)
}

/// The power of two next below a number of at least 0. Division by it changes no ratio, and keeps what is squared then
/// within the range of f64.
pub fn power_of_two(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & f64::INFINITY.to_bits()).max(f64::MIN_POSITIVE)
}

/// A unit quaternion; the identity if that is not possible.
#[inline(always)]
pub fn normalised(q: [f64; 4]) -> DQuat {
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if length > 0.0 && length.is_finite() {
        let scale = length.recip();
        DQuat::from_array(q.map(|x| x * scale))
    } else {
        DQuat::IDENTITY
    }
}

/// From one rotation to another, the short way; `t` from 0 to 1.
pub fn blended(from: DQuat, to: DQuat, t: f64) -> DQuat {
    let sign = if from.dot(to) < 0.0 { -1.0 } else { 1.0 };
    let (p, q) = (from.to_array(), to.to_array());
    normalised([0, 1, 2, 3].map(|k| p[k] + t * (sign * q[k] - p[k])))
}

/// A rigid motion: rotation about a point, which goes to another.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    pub rotation: DQuat,
    matrix: DMat3,
    from: DVec3,
    to: DVec3,
    /// Share of the motion in that of its points, from 0 to 1: less than 1 where the rotation about a line, near which
    /// the points lie, is lost in the rounding of positions.
    pub part: f64,
}

impl Motion {
    #[inline(always)]
    pub fn at(&self, point: DVec3) -> DVec3 {
        self.to + self.matrix * (point - self.from)
    }

    /// The motion that takes points nearest to others, in the sense of least squares: of (weight, from, to). A
    /// rotation by Horn's quaternion, never a reflection. `None` if points, or where they go, lie on a line as far as
    /// positions of f32 tell: nothing then says how they turn about it.
    pub fn fit(points: impl Iterator<Item = (f64, DVec3, DVec3)> + Clone) -> Option<Motion> {
        let (mut sum, mut p, mut q, mut farthest) = (0.0, DVec3::ZERO, DVec3::ZERO, DVec3::ZERO);
        // Differences from the first point: what is far from the origin loses nothing.
        let (_, p0, q0) = points.clone().next()?;
        for (w, a, b) in points.clone() {
            (sum, p, q) = (sum + w, p + w * (a - p0), q + w * (b - q0));
            farthest = farthest.max(a.abs()).max(b.abs());
        }
        let (from, to) = (p0 + p / sum, q0 + q / sum);
        let mut m = DMat3::ZERO;
        for (w, a, b) in points {
            let (a, b) = (a - from, b - to);
            m += DMat3::from_cols(w * b.x * a, w * b.y * a, w * b.z * a);
        }
        // Rows: components of `from`; columns: components of `to`.
        let s = |i: usize, j: usize| m.col(j)[i];
        let (values, vectors) = eigen([
            [s(0, 0) + s(1, 1) + s(2, 2), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0)],
            [s(1, 2) - s(2, 1), s(0, 0) - s(1, 1) - s(2, 2), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2)],
            [s(2, 0) - s(0, 2), s(0, 1) + s(1, 0), s(1, 1) - s(0, 0) - s(2, 2), s(1, 2) + s(2, 1)],
            [s(0, 1) - s(1, 0), s(2, 0) + s(0, 2), s(1, 2) + s(2, 1), s(2, 2) - s(0, 0) - s(1, 1)],
        ]);
        let best = (1..4).fold(0, |best, k| if values[k] > values[best] { k } else { best });
        let second = (0..4).filter(|&k| k != best).map(|k| values[k]).fold(f64::NEG_INFINITY, f64::max);
        // On a line the two largest are equal: half of what is between is the mean square of the distances from it.
        let apart = (0.5 * (values[best] - second) / sum).sqrt() / farthest.max_element();
        let part = smooth((apart - LINE[0]) / (LINE[1] - LINE[0]));
        if part.is_nan() || part <= 0.0 || !values[best].is_finite() {
            return None;
        }
        let [w, x, y, z] = vectors[best];
        let rotation = normalised([x, y, z, w]);
        Some(Motion { rotation, matrix: DMat3::from_quat(rotation), from, to, part })
    }
}

/// Distances of points from their line, by the largest coordinate, of which a rounding of f32 has up to 2⁻²⁴: up to the
/// first a rotation about the line is mostly rounding, and from the second on it counts in full.
const LINE: [f64; 2] = [64.0 / 16_777_216.0, 256.0 / 16_777_216.0];

/// From 0 to 1 as x does, with a derivative that is 0 at both.
pub fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by Jacobi's rotations in their cyclic order.
fn eigen(mut a: [[f64; 4]; 4]) -> ([f64; 4], [[f64; 4]; 4]) {
    const SWEEPS: usize = 24;
    let mut v = [0, 1, 2, 3].map(|k| [0, 1, 2, 3].map(|l| f64::from(u8::from(k == l))));
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for p in 0..3 {
            for q in p + 1..4 {
                let (apq, diagonal) = (a[p][q], a[p][p].abs() + a[q][q].abs());
                let is_finite = apq.is_finite() && diagonal.is_finite();
                if !is_finite || apq.abs() <= 1e-17 * diagonal {
                    continue;
                }
                is_done = false;
                let theta = (a[q][q] - a[p][p]) / (2.0 * apq);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                let (upper, lower) = a.split_at_mut(q);
                for (x, y) in upper[p].iter_mut().zip(&mut lower[0]) {
                    (*x, *y) = (c * *x - s * *y, s * *x + c * *y);
                }
                (a[p][q], a[q][p]) = (0.0, 0.0);
                for row in &mut v {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
            }
        }
        if is_done {
            break;
        }
    }
    ([0, 1, 2, 3].map(|k| a[k][k]), [0, 1, 2, 3].map(|k| [0, 1, 2, 3].map(|l| v[l][k])))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_blended_the_short_way() {
        let (from, to) = (DQuat::IDENTITY, DQuat::from_rotation_z(1.0));
        for to in [to, -to] {
            assert!(blended(from, to, 0.5).dot(DQuat::from_rotation_z(0.5)).abs() > 1.0 - 1e-12);
        }
    }
}
