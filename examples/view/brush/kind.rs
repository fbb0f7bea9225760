//! What a brush is: how large, how soft, and what it does.

/// Target of a click.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Click {
    /// The surface around it.
    Paint,
    /// The chart under it.
    Fill,
    /// All of the textures that has the colour under it.
    Colour,
}

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
    pub click: Click,
    /// Distance of colours that count as the one under a click, 0..1.
    pub tolerance: f32,
    /// True if it paints on the opposite side of the mesh, too.
    pub symmetry: bool,
}

impl Brush {
    pub const DEFAULT: Brush = Brush {
        radius: 28.0,
        value: 1.0,
        softness: 0.25,
        click: Click::Paint,
        tolerance: 0.2,
        erase: false,
        symmetry: false,
    };

    pub fn target(&self) -> f32 {
        if self.erase { 0.0 } else { self.value.clamp(0.0, 1.0) * 65535.0 }
    }
}
