//! The brush.

/// Coverage by a brush, 0..1, at a distance from its middle in units of its radius; `softness`: the part of the radius
/// over which it fades out, 0..1.
#[must_use]
pub fn cover(distance: f32, softness: f32) -> f32 {
    let t = ((1.0 - distance) / softness.max(1e-3)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
