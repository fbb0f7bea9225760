//! Samples of the surface at warped positions W(p), and the lengths of edges between them: exact positions and tangents
//! on the finest level (method §2), metrics and their derivatives on coarser ones (method §3).

pub mod chords;
pub mod metrics;
pub mod record;
pub mod resample;

use super::lanes::{LANES, Lanes, Mask, each};
use super::row::Row;
use vrtm_core::grid::Level;
use vrtm_core::grid::planes::{Plane, SIDE};

/// Derivatives along x and y of the three sampled values, at a row's eight nodes.
pub type Slopes<V> = [V; 6];

/// Samples of the surface at the warped positions of a row's eight nodes.
///
/// On the finest level, `value` is the position f(W(p)), `triangle` is the triangle under W(p), and `tangents` are
/// ∂f/∂x and ∂f/∂y on it. On coarser levels, `value` is the metric (E, F, G) at W(p), and the other fields are not
/// used.
#[derive(Clone, Copy)]
pub struct Samples<V: Lanes> {
    pub value: [V; 3],
    pub tangents: Slopes<V>,
    pub triangle: V::Index,
}

/// A row's eight nodes in the coordinates of the level: (i + 2k, j) for lane k, all of one block.
#[derive(Clone, Copy)]
pub struct GridRow {
    pub block: usize,
    pub i: i64,
    pub j: i64,
}

impl GridRow {
    /// The nodes of a row of block `b`.
    #[inline(always)]
    pub fn new(level: &Level, b: usize, row: Row) -> GridRow {
        let block = &level.blocks.list[b];
        let [x, y] = [block.x, block.y].map(|n| i64::from(n) * SIDE as i64);
        GridRow { block: b, i: x + row.column() as i64, j: y + row.line() as i64 }
    }

    /// Column of the node in lane k.
    #[inline(always)]
    pub fn column(&self, k: usize) -> i64 {
        self.i + 2 * k as i64
    }
}

/// Places near a row's nodes, as multiples of cells, relative to the first node of their block.
struct BlockPlace<V>([V; 2]);

impl<V: Lanes> BlockPlace<V> {
    /// The places at whole offsets from the nodes.
    #[inline(always)]
    fn new(nodes: &GridRow, offset: [V; 2]) -> BlockPlace<V> {
        let (i, j) = (nodes.i % SIDE as i64, nodes.j % SIDE as i64);
        let columns = V::from_array(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| (i + 2 * k as i64) as f32));
        BlockPlace([offset[0] + columns, offset[1] + V::splat(j as f32)])
    }

    /// The slots of these places in a plane, and the lanes in which both coordinates are under `side`: only there the
    /// slots have a meaning.
    #[inline(always)]
    fn slots(&self, side: usize) -> ([u8; LANES], u8) {
        let BlockPlace([x, y]) = *self;
        let [p, q] = each!([0, 1], |c| (self.0[c] * 0.5).floor());
        let slots = (x - p * 2.0) * 64.0 + p + ((y - q * 2.0) * 128.0 + q * 8.0);
        let (low, high) = (V::zero(), V::splat(side as f32));
        let inside = low.le(x).and(low.le(y)).and(x.lt(high)).and(y.lt(high));
        (slots.to_array().map(|slot| slot as u8), inside.bits())
    }
}

/// The surface map of a level: how it is sampled, and how the lengths of edges are computed from samples.
pub trait Surface: Copy + Sync {
    /// True if lengths are chords, as on the finest level.
    const CHORDS: bool;

    /// Samples the surface at a row's nodes displaced by u, in the given lanes. Point location begins at the triangles
    /// in `samples`. Returns the lanes that have a sample; in the other lanes W leaves the chart, and `samples` is
    /// undefined.
    fn sample_row<V: Lanes>(
        &self,
        nodes: &GridRow,
        u: &[V; 2],
        lanes: V::Mask,
        samples: &mut Samples<V>,
    ) -> V::Mask;

    /// Per block, the sampled values at the nodes themselves, if they are stored.
    fn at_nodes(&self) -> Option<&[[Plane; 3]]>;

    /// The tangents on eight triangles of the finest level; 0 for `NONE`, and on coarser levels.
    fn tangents_row<V: Lanes>(&self, triangle: &[u32; LANES]) -> Slopes<V>;

    /// Lengths L of the edges between nodes with the values p and n, given the tangents at p, the offsets d, and
    /// whether both ends are on one triangle.
    fn length<V: Lanes>(p: &[V; 3], tangents: &Slopes<V>, n: &[V; 3], same: V::Mask, d: &[V; 2]) -> V;

    /// Lengths as computed by `length`, their gradients ∂L/∂u_p from the slopes at p, and the terms from which
    /// `far_gradient` computes ∂L/∂u_n.
    fn gradient<V: Lanes>(
        p: &[V; 3],
        tangents: &Slopes<V>,
        slopes: &Slopes<V>,
        n: &[V; 3],
        same: V::Mask,
        d: &[V; 2],
    ) -> (V, [V; 2], GradientTerms<V>);

    /// ∂L/∂u_n, from the terms that `gradient` returned and the slopes at n.
    fn far_gradient<V: Lanes>(terms: &GradientTerms<V>, neighbour_slope: &Slopes<V>) -> [V; 2];
}

/// Terms shared by the gradients of a length at both ends of an edge.
#[derive(Clone, Copy)]
pub struct GradientTerms<V> {
    /// The chord c on the finest level, the mean metric times d on coarser ones.
    along: [V; 3],
    d: [V; 2],
    inverse_length: V,
}
