//! The surface under W(p): exact positions and tangents on the finest level, metrics and their slopes on coarser ones.

mod chords;
mod metrics;
mod record;
mod resample;

use super::lanes::{LANES, Lanes};
use super::row::Row;
use crate::tile::Level;
use crate::tile::blocks::SIDE;
pub use chords::Chords;
pub use metrics::Metrics;
pub use record::Record;
pub use resample::Start;

/// The slopes at a row's eight nodes.
pub type Slopes<V> = [V; 6];

/// What edges need to know of their ends, at a row's eight nodes.
/// Finest level: `value` = position, `slope` = df/dx and df/dy, and the triangles under W(p). Coarser: `value` =
/// (E, F, G), `slope` = its d/dx, d/dy.
#[derive(Clone, Copy)]
pub struct Samples<V: Lanes> {
    pub value: [V; 3],
    pub slope: Slopes<V>,
    pub triangle: V::Index,
}

/// A row's eight nodes: (i + 2k, j) of the level, seen from one block.
#[derive(Clone, Copy)]
pub struct Site {
    pub block: usize,
    pub i: i64,
    pub j: i64,
}

impl Site {
    /// Of a row of block `b`.
    #[inline(always)]
    pub fn new(level: &Level, b: usize, row: Row) -> Site {
        let block = &level.blocks.list[b];
        let [x, y] = [block.x, block.y].map(|n| i64::from(n) * SIDE as i64);
        Site { block: b, i: x + row.column() as i64, j: y + row.line() as i64 }
    }

    /// A lane's node: its column.
    #[inline(always)]
    pub fn lane(&self, k: usize) -> i64 {
        self.i + 2 * k as i64
    }
}

/// How a level measures lengths.
pub trait Surface: Copy + Sync {
    /// True on the finest level.
    const CHORDS: bool;

    /// Samples the surface at those of a row's nodes that the mask names, displaced by u, starting at the triangles in
    /// `samples`; the mask that comes back says where there is a sample: elsewhere W leaves the chart. Other lanes of
    /// `samples` may be anything after it.
    fn sample_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask;

    /// The slope alone, where the state is known to be good.
    fn slope(&self, b: usize, i: i64, j: i64, u: [f32; 2], triangle: u32) -> [f32; 6];

    /// The same for those of a row's nodes that the mask names.
    fn slope_row<V: Lanes>(
        &self,
        site: &Site,
        u: &[V; 2],
        triangle: &[u32; LANES],
        lanes: V::Mask,
    ) -> Slopes<V>;

    /// Lengths L of the edges from p to n, given the offsets d and whether both ends are on one triangle.
    fn length<V: Lanes>(p: &[V; 3], slope: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> V;

    /// The same, with dL/du_p and, where `slope_n` is given, dL/du_n.
    fn gradient<V: Lanes>(
        p: &[V; 3],
        slope: &Slopes<V>,
        n: &[V; 3],
        same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], Chord<V>);

    /// dL/du_n from what `gradient` kept.
    fn far_gradient<V: Lanes>(chord: &Chord<V>, slope_n: &Slopes<V>) -> [V; 2];
}

/// What the gradients at both ends of an edge share.
#[derive(Clone, Copy)]
pub struct Chord<V> {
    /// Finest: the chord. Coarser: the metric times d.
    along: [V; 3],
    d: [V; 2],
    inverse_length: V,
}
