//! The constants that both backends use. Kernels of a GPU get them from here (`crates/gpu/src/layout.rs`), so that each
//! number is defined once.

constants! {
    /// ε: every corner Jacobian of a descent's warp is at least this (method §6).
    MIN_JACOBIAN: f32 = 0.02;
    /// A state with a corner Jacobian under this has no energy: rounding may take one a little under `MIN_JACOBIAN`.
    CRUSHED_JACOBIAN: f32 = 0.5 * MIN_JACOBIAN;
    /// Keeps 1 / L finite; lengths of a chart of unit size are far longer.
    TINY: f32 = 1e-24;

    /// A point counts as inside a triangle if no barycentric coordinate is under minus this.
    INSIDE_TOLERANCE: f32 = 1e-6;
    /// As `INSIDE_TOLERANCE`, at a chart's border, where there is no neighbour to walk to (method §2).
    BORDER_TOLERANCE: f32 = 1e-3;
    /// Greatest number of triangles that a walk to a point visits. A node moves a few cells before its start is
    /// renewed; fine meshes have several triangles per cell.
    WALK_STEPS: u32 = 256;

    /// Greatest length of a node's step in a sweep, in cells along either axis: the linear model is not trusted
    /// further.
    MAX_NODE_STEP: f32 = 2.0;
    /// A node's step in a sweep takes at most this fraction of what a corner Jacobian has over `MIN_JACOBIAN`: a corner
    /// with next to nothing left would decide about the whole chart's next correction.
    SWEPT_MARGIN: f32 = 0.25;
    /// A node whose step in a sweep has no component over this many cells stays where it is.
    MIN_NODE_STEP: f32 = 1e-6;
    /// Sweeps that are done on a block while it is gathered, its halo frozen. With more, nodes that have not moved yet
    /// would hold back their neighbours.
    SWEEPS_PER_PASS: u32 = 2;

    /// Corners with a Jacobian under this get the near-bound penalty (method §7.1) ...
    NEAR_BOUND_JACOBIAN: f32 = 2.5 * MIN_JACOBIAN;
    /// ... of this stiffness, in the step's system only, not in the energy: where the bound is active, the step slides
    /// along it instead of being limited by it.
    NEAR_BOUND_STIFFNESS: f32 = 10.0;

    /// Weight of the tangents in the slopes of the finest level (method §2); differences have the rest. More of it
    /// follows the energy more closely across the edges of triangles, and jumps more there.
    TANGENT_WEIGHT: f32 = 0.15;

    /// Weight of the hold at open borders along which texture slides (method §16).
    HOLD: f32 = 4.0;

    /// Strain of a feature that does not count as harm (method §4, Harm).
    HARM_MARGIN: f32 = 0.01;
    /// Harm over which the growth of a multiplier bends: with a kink, features that begin to be worse would jerk.
    HARM_ONSET: f32 = 0.03;
    /// Stored multipliers are multiples of 1 / this.
    MULTIPLIER_STEPS: f32 = 1024.0;
    /// Largest multiplier: its code has 15 bits.
    MOST_MULTIPLIER: f32 = 31.0;
    /// The part of its multiplier that a feature keeps where a solve starts from the last result.
    WARM_MULTIPLIER: f32 = 0.9;
    /// Factor of the stress stiffness of the weight that multipliers add.
    HARM_STRESS: f32 = 6.0;

    /// Stress stiffness (method §4, Derivatives): the factor of the strain of an edge that is longer than at rest ...
    TENSION_STIFFNESS: f32 = 0.25;
    /// ... and of one that is shorter.
    COMPRESSION_STIFFNESS: f32 = 0.5;
    /// Least square of an edge's offset that the stress stiffness is divided by, relative to that at rest.
    MIN_OFFSET_SQUARE: f32 = 0.1;

    /// Sweeps of the V-cycle's smoother on either side of the coarse correction (method §7.4).
    SMOOTHER_SWEEPS: u32 = 3;
    /// Sweeps of the smoother on either side on the coarsest level.
    COARSEST_SWEEPS: u32 = 6;
    /// Most iterations of conjugate gradients in a correction: more gain less than the next level or the next
    /// correction does, which continues along the last step, and need more memory (method §7.3).
    CG_ITERATIONS: u32 = 2;
    /// The last step is a direction of conjugate gradients if at least this part of its curvature is left once it is
    /// conjugate to the other directions.
    MIN_NEW_CURVATURE: f32 = 1e-3;
    /// A component of a step of this many cells or more is replaced by 0: it exceeds the largest grid.
    MAX_STEP: f32 = 32768.0;

    /// The bound on the Jacobian of a correction's step (method §7.6). It is lower than that of the sweeps, so that
    /// corners which these have brought close to theirs leave the step room.
    STEP_MIN_JACOBIAN: f32 = 0.65 * MIN_JACOBIAN;
    /// A step leaves at least this fraction of what a corner Jacobian has over `STEP_MIN_JACOBIAN`.
    MARGIN_LEFT: f32 = 0.1;
    /// The step fractions of neighbouring nodes differ by at most this ...
    FRACTION_FALLOFF: f32 = 0.125;
    /// ... and by at most what makes this many cells of the chart's longest step: a step that changes abruptly from
    /// node to node folds by itself.
    STEP_FALLOFF: f32 = 0.25;
    /// Rounds that multiply the step fractions around corners which would still lose too much by what these allow.
    SHRINKING_ROUNDS: u32 = 8;
    /// Rounds in all on level 0: after the shrinking ones, nodes around corners that would still fall under the bound
    /// stay where they are. A chart that is not free of folds after all rounds is refused for its energy.
    LIMIT_ROUNDS: u32 = 16;
    /// Rounds on each of the other levels, where three have been enough in all scenes and hard cases.
    COARSER_LIMIT_ROUNDS: u32 = 4;

    /// A trial is accepted if it gains more than this fraction of the gain that the model predicts (method §7.7): a
    /// whole step that gains next to nothing would end a chart's corrections where half of the step would continue
    /// them.
    SUFFICIENT_DECREASE: f32 = 0.02;
    /// Weight of the identity's energy in the unit of gains: where little is left of much energy, a small part of what
    /// is left does not matter.
    IDENTITY_ENERGY_WEIGHT: f64 = 0.06;
    /// Greatest ratio of the step fraction of one correction to that of the one before.
    FRACTION_GROWTH: f64 = 4.0;
    /// The gains, in units of tolerance times energy, between which the next step fraction grows from 0 to 1.
    GAIN_RAMP: [f64; 2] = [1.0, 4.0];
    /// The errors of a first correction's predicted gain, in the same units, between which the next step fraction
    /// grows.
    MODEL_ERROR_RAMP: [f64; 2] = [0.25, 2.0];
}

/// The growth of a feature's multiplier, in units of H, from the mean squares of its strain without a warp and with it
/// (method §4, Harm).
pub fn growth(before: f32, now: f32) -> f32 {
    let now = now.sqrt();
    let harm = now - (before + HARM_MARGIN * HARM_MARGIN).sqrt();
    if harm > 0.0 { harm / now * (harm / (harm + HARM_ONSET)) } else { 0.0 }
}

/// H on a level.
pub fn harm_on(harm: f32, level: usize) -> f32 {
    harm / (1u32 << level) as f32
}

/// A multiplier that has grown, rounded as it is stored.
pub fn multiplier(before: f32, growth: f32) -> f32 {
    ((before + growth).min(MOST_MULTIPLIER) * MULTIPLIER_STEPS + 0.5).floor() / MULTIPLIER_STEPS
}

/// The number of sweeps of each pass over a level.
pub fn passes(sweeps: u32) -> impl Iterator<Item = u32> {
    (0..sweeps).step_by(SWEEPS_PER_PASS as usize).map(move |done| (sweeps - done).min(SWEEPS_PER_PASS))
}

/// The fraction of a corner's margin that round `round` of the step limit leaves: a little less than the round before,
/// so that corners which kept enough then are not limited again. `None` in the rounds after the shrinking ones.
pub fn margin_left(round: u32) -> Option<f32> {
    (round < SHRINKING_ROUNDS).then(|| MARGIN_LEFT * (1.0 - (round + 1) as f32 / SHRINKING_ROUNDS as f32))
}

/// Most rounds of the step limit on a level.
pub const fn limit_rounds(level: usize) -> u32 {
    if level == 0 { LIMIT_ROUNDS } else { COARSER_LIMIT_ROUNDS }
}

/// Fractions of the step that are tried on a level until one is accepted; then comes relaxation alone. Where a coarser
/// level refuses the whole step, a part of it has hardly ever been accepted: level 0 has the shorter trials.
pub const fn trial_fractions(level: usize) -> &'static [f32] {
    if level == 0 { &[1.0, 0.5, 0.25] } else { &[1.0] }
}

// Both backends form the second direction from the first step, which further ones could not be formed from.
const _: () = assert!(CG_ITERATIONS <= 2);
