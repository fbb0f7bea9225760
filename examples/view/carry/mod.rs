//! Geometry on the surface: a stud or a spike for each feature (`pieces`), and how it moves with a pose (`ride`).

mod outward;
pub mod pieces;
pub mod ride;

/// Kind of geometry on features.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Shape {
    #[default]
    Studs,
    Spikes,
}

impl Shape {
    pub const ALL: [(&'static str, Shape); 2] = [("studs", Shape::Studs), ("spikes", Shape::Spikes)];

    /// The kind of a built-in scene.
    pub fn of_scene(name: &str) -> Option<Shape> {
        match name {
            "arm" => Some(Shape::Studs),
            "creature" => Some(Shape::Spikes),
            _ => None,
        }
    }
}
