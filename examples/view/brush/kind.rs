//! What a brush is: how large, how soft, and what it does.

/// Operation of the brush.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brush {
    /// Radius on the screen, in points.
    pub radius: f32,
    /// The rigidity that it paints, 0..1.
    pub value: f32,
    /// The part of the radius over which it fades out, 0..1.
    pub softness: f32,
    /// True if it paints 0 instead.
    pub erase: bool,
    /// True if a click fills the chart under it.
    pub fills: bool,
    /// True if it paints on the opposite side of the mesh, too.
    pub symmetry: bool,
}

impl Default for Brush {
    fn default() -> Brush {
        Brush { radius: 28.0, value: 1.0, softness: 0.25, erase: false, fills: false, symmetry: false }
    }
}

impl Brush {
    /// Coverage at a distance, in units of its radius.
    pub fn cover(&self, distance: f32) -> f32 {
        let t = ((1.0 - distance) / self.softness.max(1e-3)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }

    pub fn target(&self) -> f32 {
        if self.erase { 0.0 } else { self.value.clamp(0.0, 1.0) * 65535.0 }
    }
}
