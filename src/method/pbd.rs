//! pbd: the paper's solver (its section 4): position-based dynamics (Müller et al., "Position Based Dynamics", 2007) on a
//! hierarchy of grids. The baseline that `descent` is measured against.
//!
//! From the coarsest level to the finest: bilinear interpolation, smoothing by eq. 4-5, and the level's iterations. An
//! iteration projects the eight sets of figure 8 in turn, each over the whole level. With d the offset between the ends of
//! a segment in the tile, L and l its length in the pose and at rest, w the larger rigidity of its ends (eq. 1):
//!
//! ```text
//! d <- d (1 + w c (l / L - 1)), turned toward its rest direction by a share, about its centre or its fixed end;
//! each end then stays inside the bounding box of its eight neighbours.
//! ```
//!
//! After every fourth iteration, and the last, come regularisation (eq. 4-5), integration and, but for the last, damping
//! and prediction: p + (1 - damping) (p - p'), p' being where the positions were integrated before.
//!
//! What the paper leaves open is as it does best on six scenes at 256² (bulge, pinch, shear, squash, torus, the mug's belly
//! and neck). The figures are E and the strain's RMS on the mesh, over those of the identity: geometric means, with the
//! defaults but for what is named. The defaults: **0.128, 0.106**; `descent`: draft 0.125, 0.177, normal 0.101, 0.104.
//!
//! - Projections of all sets to a regularisation: **4**; 1: 0.162, 0.275; 2: 0.133, 0.169; 8: 0.136, 0.098; 16: 0.137, 0.124.
//! - Iterations: **16**; 1: 0.629, 0.786; 2: 0.428, 0.624; 4: 0.252, 0.432; 8: 0.141, 0.214; 32: 0.126, 0.090; 64: 0.122,
//!   0.109; 128: 0.120, 0.107. A time step is not among the choices: without a force it cancels out.
//! - Velocity damping: **none**; 0.1: 0.128, 0.113; 0.2: 0.128, 0.122; 0.3: 0.128, 0.131. Inertia does the work of iterations.
//! - Share of the rotation toward rest: **none**; 0.01: 0.128, 0.110; 0.05: 0.129, 0.129. It did not prevent folds of a
//!   sheet squashed to 40 %, either.
//! - Smoothing s: **0.8**; 0.1: 0.135, 0.109; 0.3: 0.132, 0.107; 0.5: 0.130, 0.105; 1: 0.127, 0.107.
//! - Factor on corrections per coarser level: **0.7**; 0.5: 0.130, 0.143; 0.6: 0.124, 0.122; 0.8: 0.135, 0.094; 1: 0.146,
//!   0.082. It scales the rotation too.
//! - Order of the sets: **level, upright, slanted**; slanted first: 0.128, 0.107; all even ones first: 0.135, 0.130.
//! - Smoothing after interpolation: **eq. 4-5**; the Gaussian everywhere: 0.128, 0.106; none: 0.129, 0.104.
//! - Direction of a correction: **along the segment**, as for Müller's distance constraint; along the gradient of L in the
//!   tile: 0.127, 0.100, for the surface's slopes at both ends of every segment.
//! - Length: the distance of the two ends' positions on the finest level, arc length by metrics on coarser ones.
//! - A node that would leave its chart stays. A warm start goes on from the last result on the finest level alone.
//!
//! Sixteen projections to a regularisation and 64 in all bring the strain to 0.025, a quarter of what `descent` leaves, at an
//! E of 0.159: features then take their room from elastic material, whose own deformation is in E.

use super::schedule::{Stages, Summary};
use crate::settings::PbdValues;
use crate::tile::EDGES;

/// Iterations to a regularisation.
const PROJECTIONS: u32 = 4;

/// One iteration on a level.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Iteration {
    /// The level's first: velocities are 0.
    pub first: bool,
    /// Regularisation and integration follow.
    pub regularise: bool,
    /// Its last: no positions are predicted any more.
    pub last: bool,
    /// Share of its velocity that a node keeps.
    pub momentum: f32,
    /// Share of the rotation toward the rest direction.
    pub orientation: f32,
    pub smoothing: f32,
    /// Factor on this level's corrections.
    pub correction: f32,
}

/// One of the eight sets of edges that share no node (the paper's figure 8): an edge of `EDGES`, and the parity of the
/// node that owns it, of its i for horizontal edges and of its j for others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Set {
    pub edge: usize,
    pub parity: usize,
}

/// In the order of their projection.
pub(crate) const SETS: [Set; 8] = [
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
    /// To the other end of the one edge of this set that node (i, j) has, and whether that end owns it.
    #[inline(always)]
    pub fn partner(self, i: usize, j: usize) -> ((i64, i64), bool) {
        let along = if self.edge == 0 { i } else { j };
        let (di, dj) = EDGES[self.edge];
        if along & 1 == self.parity { ((di, dj), false) } else { ((-di, -dj), true) }
    }
}

/// A level's iterations. `late` tells when the time is up.
pub(crate) fn level<S: Stages>(
    stages: &mut S,
    settings: &PbdValues,
    level: usize,
    coarsest: usize,
    late: impl Fn(&mut S) -> bool,
    summary: &mut Summary,
) {
    if level < coarsest {
        stages.smooth(level, settings.smoothing);
    }
    if summary.truncated {
        return;
    }
    let correction = (0..level).fold(1.0, |factor, _| factor * settings.coarse_correction);
    for n in 1..=settings.iterations {
        // The last one leaves the positions where they are integrated, so this has to be known before it.
        summary.truncated = late(stages);
        let last = n == settings.iterations || summary.truncated;
        let iteration = Iteration {
            first: n == 1,
            regularise: last || n % PROJECTIONS == 0,
            last,
            momentum: 1.0 - settings.damping,
            orientation: settings.orientation_preservation,
            smoothing: settings.smoothing,
            correction,
        };
        stages.iterate(level, &iteration);
        summary.sweeps += 1;
        if summary.truncated {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn the_eight_sets_share_no_node_and_have_every_edge_once() {
        let inside = |(i, j): (i64, i64)| (0..16).contains(&i) && (0..16).contains(&j);
        let mut edges = BTreeSet::new();
        for set in SETS {
            let mut seen = BTreeSet::new();
            for (i, j) in (0..256).map(|k| (k % 16, k / 16)) {
                let ((di, dj), theirs) = set.partner(i, j);
                let (own, other) = ((i as i64, j as i64), (i as i64 + di, j as i64 + dj));
                if !inside(other) {
                    continue;
                }
                // The other end says the same.
                let back = set.partner(other.0 as usize, other.1 as usize);
                assert_eq!(back, ((-di, -dj), !theirs), "{set:?} at {own:?}");
                if !theirs {
                    assert!(seen.insert(own) && seen.insert(other), "{set:?} has a node of {own:?} twice");
                    assert!(edges.insert((own, other)), "{own:?} to {other:?} is in two sets");
                }
            }
        }
        // 15 x 16 along each axis, 15 x 15 along each diagonal.
        assert_eq!(edges.len(), 2 * 15 * 16 + 2 * 15 * 15);
    }
}
