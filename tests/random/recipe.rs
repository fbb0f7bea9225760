//! What a random model is made of: few numbers with a meaning, so that a failure shrinks to the ones that matter, and its
//! `Debug` text is Rust that `named.rs` can hold.

use vrtm::{SolveOptions, TileSettings};

/// A mesh, its maps and what is done with it.
#[derive(Clone, Debug)]
pub struct Recipe {
    pub pieces: Vec<Piece>,
    /// Faces as polygons with their counts; otherwise all are triangles.
    pub polygons: bool,
    /// UVs as two arrays with one entry per corner; otherwise as pairs with indices.
    pub split_uvs: bool,
    /// Positions are handed over as f64; otherwise as f32.
    pub doubles: bool,
    /// All positions, at rest and posed, are in units of ten to this power ...
    pub unit: i32,
    /// ... and, in such units, this far away.
    pub away: f64,
    pub rigidity: Rigidity,
    pub mask: Option<Layer>,
    pub settings: TileSettings,
    pub options: SolveOptions,
    /// One pose each: moves one after the other.
    pub frames: Vec<Vec<Move>>,
    /// Size of the redirection that is fetched.
    pub output: [u32; 2],
    pub threads: u32,
    pub then: Then,
}

/// A chart, or what is left of one.
#[derive(Clone, Debug)]
pub struct Piece {
    pub shape: Shape,
    /// Lower corner and size in UV, before it is turned about its middle.
    pub low: [f32; 2],
    pub size: [f32; 2],
    /// Radians.
    pub turn: f32,
    pub mirrored: bool,
    /// Share of a quad by which UVs are off; triangles turn over from about 0.5 on.
    pub jitter: f32,
    /// Each so many-th face has the other winding; 0 = none.
    pub flip: u32,
    /// Each so many-th vertex has the UV of the next; 0 = none.
    pub weld: u32,
    /// Length in space of a unit of u and of v.
    pub stretch: [f32; 2],
    /// How far the surface is from flat at rest: smoothly, and vertex by vertex.
    pub bend: f32,
    pub crumple: f32,
    pub seed: u32,
}

#[derive(Clone, Debug)]
pub enum Shape {
    /// Quads in both directions.
    Sheet(u32, u32),
    /// Triangles side by side.
    Strip(u32),
    /// Triangles around a vertex.
    Fan(u32),
    /// One star-shaped polygon.
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
    /// Between 0 and 1, by seed.
    Grey(u32),
    /// 0 or 1, by seed.
    Bits(u32),
    /// So many discs a side.
    Discs(u32),
    /// So many holes a side.
    Holes(u32),
    /// Squares of so many texels.
    Checker(u32),
    /// 0 along a parabola, 1 elsewhere.
    Curve,
}

#[derive(Clone, Debug)]
pub enum Rigidity {
    Nothing,
    Map(Layer),
    /// By the vertex's number along a row of texels.
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
    /// One vertex somewhere else.
    Spike(u32, f64),
}

/// What is checked beside the frames.
#[derive(Clone, Debug)]
pub enum Then {
    /// The same once more, on a new asset: the same bits.
    Again,
    /// On so many threads: the same bits.
    Threads(u32),
    /// The last frame alone, on a new asset: the same bits, unless solves are warm.
    Alone,
    /// The pose is rest: exactly no displacement.
    Rest,
    /// A call that has to be refused: the result stays.
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
