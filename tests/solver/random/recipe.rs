//! The description of a random model: few numbers with a meaning, so that a failure shrinks to those that matter. Its
//! `Debug` text is Rust that `named.rs` can hold.

use vrtm::{SolveOptions, TileSettings, WeldBy};

/// A mesh, its maps and the checks that are run on it.
#[derive(Clone, Debug)]
pub struct Recipe {
    pub pieces: Vec<Piece>,
    pub joints: Joints,
    /// Faces are polygons with their counts if true; otherwise all are triangles.
    pub polygons: bool,
    /// UVs are two arrays with one entry per corner if true; otherwise pairs with indices.
    pub split_uvs: bool,
    /// Positions are handed over as f64 if true; otherwise as f32.
    pub doubles: bool,
    /// All positions, at rest and posed, are in units of ten to this power.
    pub unit: i32,
    /// Distance of all positions from the origin, in these units.
    pub away: f64,
    pub rigidity: Rigidity,
    pub mask: Option<Layer>,
    pub settings: TileSettings,
    pub options: SolveOptions,
    /// One pose per entry: its moves are applied one after the other.
    pub frames: Vec<Vec<Move>>,
    /// Size of the redirection that is fetched.
    pub output: [u32; 2],
    pub threads: u32,
    pub then: Then,
}

/// A chart, or a part of one if faces are flipped or vertices welded.
#[derive(Clone, Debug)]
pub struct Piece {
    pub shape: Shape,
    /// Lower corner and size in UV, before the piece is turned about its middle.
    pub low: [f32; 2],
    pub size: [f32; 2],
    /// Angle in radians.
    pub turn: f32,
    pub mirrored: bool,
    /// UV noise as a fraction of a quad; triangles turn over from about 0.5 on.
    pub jitter: f32,
    /// Every n-th face has the other winding; 0 = none.
    pub flip: u32,
    /// Every n-th vertex has the UV of the next one; 0 = none.
    pub weld: u32,
    /// Length in space of a unit of u and of v.
    pub stretch: [f32; 2],
    /// Deviation of the surface from flat at rest: smooth, and vertex by vertex.
    pub bend: f32,
    pub crumple: f32,
    pub seed: u32,
}

/// Connection of the faces, and the way to tell it to the library.
#[derive(Clone, Debug, Default)]
pub struct Joints {
    /// Chance of a face to be one of those that have copies of their vertices, at the same places: the edges between
    /// them and the others are cuts.
    pub cut: f32,
    /// Noise of the copies' UVs, and of those of all corners if each has one of its own.
    pub noise: f32,
    pub weld: WeldBy,
    /// Every n-th edge of a face is a seam; 0 = none.
    pub seams: u32,
    /// Every n-th face has no texture; 0 = none.
    pub bare: u32,
    /// Polygons come with offsets if true; otherwise with counts.
    pub offsets: bool,
    pub seed: u32,
}

#[derive(Clone, Debug)]
pub enum Shape {
    /// Number of quads along both axes.
    Sheet(u32, u32),
    /// Number of triangles side by side.
    Strip(u32),
    /// Number of triangles around a vertex.
    Fan(u32),
    /// One star-shaped polygon with this number of corners.
    Polygon(u32),
}

/// An image of one channel, f32.
#[derive(Clone, Debug)]
pub struct Layer {
    pub size: [u32; 2],
    pub paint: Paint,
}

#[derive(Clone, Debug)]
pub enum Paint {
    Constant(f32),
    /// Noise between 0 and 1 with this seed.
    Grey(u32),
    /// Noise of values 0 and 1 with this seed.
    Bits(u32),
    /// This number of discs a side.
    Discs(u32),
    /// This number of holes a side.
    Holes(u32),
    /// Squares of this number of texels.
    Checker(u32),
    /// 0 along a parabola, 1 elsewhere.
    Curve,
}

#[derive(Clone, Debug)]
pub enum Rigidity {
    Nothing,
    Map(Layer),
    /// One value per vertex: a row of texels, indexed by the vertex.
    Vertices(Paint),
}

/// One step from rest to a pose. Lengths are in units of the piece's UV.
#[derive(Clone, Debug)]
pub enum Move {
    Turn(f64),
    Scale([f64; 3]),
    Shear(f64),
    Twist(f64),
    Bulge(f64),
    Noise(f64, u32),
    Shift(f64),
    Line,
    Point,
    /// Moves one vertex far away.
    Spike(u32, f64),
}

/// A check in addition to those of the frames.
#[derive(Clone, Debug)]
pub enum Then {
    /// Solves again on a new asset: the bits are the same.
    Again,
    /// Solves with this number of threads: the bits are the same.
    Threads(u32),
    /// Solves the last frame alone on a new asset: the bits are the same unless solves are warm.
    Alone,
    /// Solves rest as a pose: all displacements are exactly 0.
    Rest,
    /// Makes an invalid call: the result stays.
    Refused(Refusal),
}

#[derive(Clone, Debug)]
pub enum Refusal {
    NanPosition(u32),
    InfinitePosition(u32),
    FewPositions,
    NanTexel,
    BadSetting,
    BadOption,
}
