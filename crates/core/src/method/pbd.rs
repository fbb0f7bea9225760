//! The schedule of `pbd` on a level (method §10): the paper's solver (its section 4), position based dynamics (Müller
//! et al., "Position Based Dynamics", 2007) on a hierarchy of grids. It is the baseline with which `descent` is
//! compared.
//!
//! From the coarsest level to the finest: bilinear interpolation, smoothing by eq. 4-5, and the level's iterations. An
//! iteration projects the eight sets of edges of figure 8 in turn, each over the whole level. With d the offset between
//! the ends of an edge in the plane, L and l its length in the pose and at rest, w the larger rigidity of its ends
//! (eq. 1), and c the level's factor on corrections:
//!
//! ```text
//! d <- d (1 + w c (l / L - 1)), turned back towards its rest direction by a fraction, about its centre or its fixed
//! end; each end is then limited to the bounding box of its eight neighbours.
//! ```
//!
//! After every fourth iteration and after the last one come regularisation (eq. 4-5), integration and, except after the
//! last one, damping and prediction: p + (1 - damping) (p - p'), where p' is the position at the previous integration.
//!
//! docs/decisions/paper_solver.md has the numbers that the paper leaves open, and the figures behind them.

use crate::grid::planes::EDGES;
use crate::settings::PbdSettings;

/// Iterations to a regularisation.
const PROJECTIONS: u32 = 4;

/// One iteration on a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Iteration {
    /// True for the first one on the level: velocities are 0.
    pub first: bool,
    /// True if regularisation and integration follow.
    pub regularise: bool,
    /// True for the last one on the level: no prediction follows.
    pub last: bool,
    /// Fraction of its velocity that a node keeps: 1 - damping.
    pub momentum: f32,
    /// Fraction by which an edge is turned back towards its rest direction.
    pub orientation: f32,
    /// See `PbdSettings`.
    pub smoothing: f32,
    /// Factor on this level's corrections, C to the power of the level.
    pub correction: f32,
}

/// One of the eight sets of edges that share no node (the paper's figure 8): the index of a direction in `EDGES`, and
/// the parity of the node that owns the edge, of its i for edges to the east and of its j for the others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Set {
    pub edge: usize,
    pub parity: usize,
}

/// All sets, in the order of their projection.
pub const SETS: [Set; 8] = [
    Set { edge: 0, parity: 0 },
    Set { edge: 0, parity: 1 },
    Set { edge: 1, parity: 0 },
    Set { edge: 1, parity: 1 },
    Set { edge: 2, parity: 0 },
    Set { edge: 2, parity: 1 },
    Set { edge: 3, parity: 0 },
    Set { edge: 3, parity: 1 },
];

impl Set {
    /// The offset to the other end of the one edge of this set that node (i, j) has, and whether that end owns the
    /// edge.
    #[inline(always)]
    pub fn partner(self, i: usize, j: usize) -> ((i64, i64), bool) {
        let along = if self.edge == 0 { i } else { j };
        let (di, dj) = EDGES[self.edge];
        if along & 1 == self.parity { ((di, dj), false) } else { ((-di, -dj), true) }
    }
}

impl PbdSettings {
    /// The `n`-th iteration on a level, counted from 0.
    pub fn iteration(&self, level: usize, n: u32) -> Iteration {
        let last = n + 1 == self.iterations;
        Iteration {
            first: n == 0,
            regularise: last || (n + 1).is_multiple_of(PROJECTIONS),
            last,
            momentum: 1.0 - self.damping,
            orientation: self.orientation_preservation,
            smoothing: self.smoothing,
            correction: (0..level).fold(1.0, |factor, _| factor * self.coarse_correction),
        }
    }
}
