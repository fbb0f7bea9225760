// Written from src/method/law.rs and src/gpu/layout.rs. Change those, then
// VRTM_UPDATE_SHADERS=1 cargo test --lib generated

/// ε: every corner Jacobian of a descent's warp is at least this (method §6).
const MIN_JACOBIAN: f32 = 0.02;
/// A state with a corner Jacobian under this has no energy: rounding may take one a little under `MIN_JACOBIAN`.
const CRUSHED_JACOBIAN: f32 = 0.01;
/// Keeps 1 / L finite; lengths of a chart of unit size are far longer.
const TINY: f32 = 1e-24;
/// A point counts as inside a triangle if no barycentric coordinate is under minus this.
const INSIDE_TOLERANCE: f32 = 1e-6;
/// As `INSIDE_TOLERANCE`, at a chart's border, where there is no neighbour to walk to (method §2).
const BORDER_TOLERANCE: f32 = 0.001;
/// Greatest number of triangles that a walk to a point visits. A node moves a few cells before its start is
/// renewed; fine meshes have several triangles per cell.
const WALK_STEPS: u32 = 256u;
/// Greatest length of a node's step in a sweep, in cells along either axis: the linear model is not trusted
/// further.
const MAX_NODE_STEP: f32 = 2.0;
/// Fraction that is taken of the step at which a corner reaches the bound on the Jacobian: less than 1, because of
/// rounding.
const BOUND_SAFETY: f32 = 0.999;
/// A step whose predicted gain is under this fraction of the node's energy is lost in that energy's rounding: it is
/// not taken.
const MIN_RELATIVE_GAIN: f32 = 1e-6;
/// Sweeps that are done on a block while it is gathered, its halo frozen. With more, nodes that have not moved yet
/// would hold back their neighbours.
const SWEEPS_PER_PASS: u32 = 2u;
/// Corners with a Jacobian under this get the near-bound penalty (method §7.1) ...
const NEAR_BOUND_JACOBIAN: f32 = 0.049999997;
/// ... of this stiffness, in the step's system only, not in the energy: where the bound is active, the step slides
/// along it instead of being limited by it.
const NEAR_BOUND_STIFFNESS: f32 = 10.0;
/// Sweeps of the V-cycle's smoother on either side of the coarse correction (method §7.4).
const SMOOTHER_SWEEPS: u32 = 2u;
/// Rounds of these sweeps in each direction on the coarsest level, all of which lies in one or a few blocks.
const COARSEST_ROUNDS: u32 = 4u;
/// Iterations of conjugate gradients in a correction: more gain less than the next level or the next correction
/// does, and need more memory (method §7.3).
const CG_ITERATIONS: u32 = 2u;
/// A component of a step of this many cells or more is replaced by 0: it exceeds the largest grid.
const MAX_STEP: f32 = 32768.0;
/// A step leaves at least this fraction of what a corner Jacobian has over `MIN_JACOBIAN` (method §7.6).
const KEPT_MARGIN: f32 = 0.1;
/// A node's step fraction exceeds those of its neighbours by at most this: a step that changes abruptly folds by
/// itself.
const FRACTION_FALLOFF: f32 = 0.125;
/// Passes of this falloff before the first round; `FALLOFF_PASSES` follow each round.
const FIRST_FALLOFF_PASSES: u32 = 4u;
/// Passes of the falloff after each round.
const FALLOFF_PASSES: u32 = 2u;
/// Rounds that halve the step fraction around corners which would still fall under the bound.
const HALVING_ROUNDS: u32 = 8u;
/// Rounds in all: after the halvings, nodes around such corners stay where they are. A chart that is not free of
/// folds after them is refused for its energy.
const LIMIT_ROUNDS: u32 = 16u;
/// A trial is accepted if it gains more than this fraction of the gain that the model predicts (method §7.7): a
/// whole step that gains next to nothing would end a chart's corrections where half of the step would continue
/// them.
const SUFFICIENT_DECREASE: f32 = 0.02;
/// Weight of the identity's energy in the unit of gains: where little is left of much energy, a small part of what
/// is left does not matter.
const IDENTITY_ENERGY_WEIGHT: f32 = 0.06;
/// Greatest ratio of the step fraction of one correction to that of the one before.
const FRACTION_GROWTH: f32 = 4.0;
/// The gains, in units of tolerance times energy, between which the next step fraction grows from 0 to 1.
const GAIN_RAMP: vec2f = vec2f(1.0, 4.0);
/// The errors of a first correction's predicted gain, in the same units, between which the next step fraction
/// grows.
const MODEL_ERROR_RAMP: vec2f = vec2f(0.1, 3.0);

/// No block, no triangle.
const NONE: u32 = 0xffffffffu;
/// Nodes of a block.
const NODES: u32 = 256u;
/// Nodes of a window: a block and its halo.
const WINDOW: u32 = 324u;
/// Workgroups in x; more go to y.
const SPREAD: u32 = 65535u;
/// More than any energy: that of a state that has none.
const INVALID_ENERGY: f32 = 3e38;
/// Planes per block of a level's constants: rigidity (sign bit: fixed), four rest lengths, triangle under the node
/// or coverage, density of rigid material.
const NODE_PLANES: u32 = 7u;
/// Of these.
const RIGIDITY: u32 = 0u;
/// Of these: four.
const LENGTH: u32 = 1u;
/// Of these.
const UNDER: u32 = 5u;
/// Of these.
const DENSITY: u32 = 6u;
/// Planes per block of a level's state: displacement (2), position or metric at W (3), triangle.
const STATE_PLANES: u32 = 6u;
/// Of these: two.
const U: u32 = 0u;
/// Of these: three.
const VALUE: u32 = 2u;
/// Of these.
const TRIANGLE: u32 = 5u;
/// Planes per block of a level's system: diagonal (3), pairs of the owned edges (two words each), interpolation's
/// weights.
const ROW_PLANES: u32 = 12u;
/// Of these: eight.
const PAIR: u32 = 3u;
/// Of these; uploaded once per grid.
const INTERPOLATION: u32 = 11u;
/// Planes per block of the vectors of a correction. As on the CPU (`cpu/correct/workspace.rs`), the same planes
/// serve several quantities one after the other.
const VECTOR_PLANES: u32 = 8u;
/// While the system is solved: the residual (2), ...
const RESIDUAL: u32 = 0u;
/// ... what the V-cycle makes of it, then the direction (2), ...
const DIRECTION: u32 = 2u;
/// ... the matrix times that, and the residual inside the V-cycle (2), ...
const PRODUCT: u32 = 4u;
/// ... and, to the end, the step (2).
const STEP: u32 = 6u;
/// While the step is limited and tried: the step fraction, in two planes in turn, ...
const FRACTION: u32 = 0u;
/// ... while it is limited: 1 where a corner would fall under the bound, ...
const MARK: u32 = 2u;
/// ... and while it is tried: the displacement before it (2).
const BEFORE: u32 = 2u;
/// Of the vectors' planes, which the paper's solver uses for a second state: the displacement as it was integrated
/// last (2).
const PREVIOUS: u32 = 6u;
/// `decide`: a chart's sum is the energy of the identity, ...
const DECIDE_IDENTITY: u32 = 0u;
/// ... the energy before a correction, ...
const DECIDE_BEFORE: u32 = 1u;
/// ... residual times preconditioned residual, ...
const DECIDE_DIRECTION: u32 = 2u;
/// ... the same in the first iteration, ...
const DECIDE_FIRST_DIRECTION: u32 = 3u;
/// ... direction times matrix times direction, ...
const DECIDE_STEP_LENGTH: u32 = 4u;
/// ... the energy after a trial, ...
const DECIDE_TRIAL: u32 = 5u;
/// ... the energy after the last trial, which is accepted whatever it is, ...
const DECIDE_LAST_TRIAL: u32 = 6u;
/// ... the energy of the result, ...
const DECIDE_ENERGY: u32 = 7u;
/// ... or its certificate, which decides on the fallback, ...
const DECIDE_CERTIFICATE: u32 = 8u;
/// ... or only if the energy is NaN or infinite.
const DECIDE_AS_IS: u32 = 9u;
/// `select_charts`: all that are solved, ...
const SELECT_ALL: u32 = 0u;
/// ... the same for a level's first correction, ...
const SELECT_FIRST_CORRECTION: u32 = 1u;
/// ... or those that take part in a further one.
const SELECT_LATER_CORRECTION: u32 = 2u;
/// `step`: the first trial keeps the displacement before the step.
const STEP_FIRST_TRIAL: u32 = 0u;
/// `step`: a further trial.
const STEP_LATER_TRIAL: u32 = 1u;
/// `relax`: nodes take their whole step.
const RELAX_WHOLE: u32 = 0u;
/// `relax`: nodes take the fraction that their chart takes of the correction.
const RELAX_FRACTION: u32 = 1u;
/// `energy`: a state with a crushed cell has none.
const ENERGY_VALID: u32 = 0u;
/// `energy`: whatever the state is like.
const ENERGY_AS_IS: u32 = 1u;
/// `smooth`, a bit: backwards.
const SMOOTH_BACKWARDS: u32 = 1u;
/// `smooth`, a bit: the direction is 0 before this pass over the block colours.
const SMOOTH_FROM_ZERO: u32 = 2u;
/// `gate`, a bit: only charts whose step is limited count.
const GATE_LIMITED: u32 = 1u;
/// The paper's solver, bits under these are the set; a bit: the state is among the vectors.
const PBD_FROM_VECTORS: u32 = 16u;
/// A bit: the level's last iteration.
const PBD_LAST: u32 = 32u;
/// A bit: no velocities.
const PBD_WITHOUT_VELOCITY: u32 = 64u;

/// One dispatch.
struct Params {
    /// The range of `lists` with the blocks to work on.
    first: u32,
    count: u32,
    /// Where the sums of these blocks begin in `partials`; the number of a gate.
    partial: u32,
    /// A kernel's own choice.
    mode: u32,
    sweeps: u32,
    /// Charts, or other things to work on.
    items: u32,
    /// Length of this level's cells, in those of level 0.
    scale: f32,
    /// The fraction of the step that is tried; the factor of a round of the step limit.
    factor: f32,
    tolerance: f32,
    /// 1 if a first correction that gained what was predicted is the last one.
    trusts_model: u32,
    smoothness: f32,
    smoothness_floor: f32,
    orientation: f32,
    /// Added to the orientation's weight where rigid material is dense.
    orientation_density: f32,
    room: f32,
    room_threshold: f32,
    level: u32,
    /// Where this level's blocks begin in `rows` and `vectors`, ...
    base: u32,
    /// ... and those of another level in its own.
    other_base: u32,
    /// The paper's solver: factor on a level's corrections, ...
    correction: f32,
    /// ... fraction of the rotation toward rest, ...
    orientation_fraction: f32,
    /// ... fraction of a velocity that is kept, ...
    momentum: f32,
    /// ... smoothing s of eq. 4.
    smoothing: f32,
}

/// A chart, and what is decided about it during a solve.
struct Chart {
    /// 1 if it is solved.
    solved: u32,
    /// 1 if kernels work on it now.
    working: u32,
    /// 1 if it sits out the level's further corrections.
    finished: u32,
    /// 1 if the result is the identity because nothing better was found.
    fallback: u32,
    /// Floor of rest lengths on level 0.
    length_floor: f32,
    /// Energy of the identity, ...
    identity: f32,
    /// ... before the correction under way, ...
    before: f32,
    /// ... and of the result.
    energy: f32,
    /// Conjugate gradients: residual times preconditioned residual, ...
    rz: f32,
    /// ... length of the last step in directions, ...
    alpha: f32,
    /// ... and what the next direction has of the last step.
    beta: f32,
    /// Gain that the quadratic model predicts.
    predicted: f32,
    /// 1 during a level's first correction.
    first: u32,
    /// Fraction of the step, of this correction and then of the next, that the chart is to take.
    fraction: f32,
    min_jacobian: f32,
    max_displacement: f32,
    folds: u32,
    /// Rounds of the step limit that found something to limit.
    limit_rounds: atomic<u32>,
}

/// A block, with its neighbours' places in the same buffers.
struct BlockRecord {
    /// The 3x3 blocks of the same chart around it, itself in the middle; NONE where there is none.
    neighbours: array<u32, 9>,
    /// The same without blocks that have no movable node.
    active_neighbours: array<u32, 9>,
    chart: u32,
    x: u32,
    y: u32,
    /// 1 if it has a movable node.
    is_active: u32,
    /// The block of the next coarser level that holds its even nodes.
    parent: u32,
    /// The blocks of the next finer level over its quarters.
    children: array<u32, 4>,
    /// Its chart's blocks here, sorted by y, then x.
    chart_first: u32,
    chart_count: u32,
    /// Bits: 1 if the chart goes on below what is held here, 2 if above.
    continues: u32,
}

/// A triangle: its UVs, in cells from its first corner, and its pose.
struct Triangle {
    corner: array<f32, 2>,
    /// Rows of the matrix that takes an offset to the barycentrics of corners 1 and 2.
    barycentric: array<f32, 4>,
    /// Across the edge opposite to each corner, or NONE.
    neighbours: array<u32, 3>,
    chart: u32,
    /// Position at the first corner, df/dx, df/dy.
    pose: array<f32, 9>,
}

/// A block of one of the coarse levels that one kernel does; places are in their common buffers.
struct CoarseBlock {
    active_neighbours: array<u32, 9>,
    parent: u32,
    children: array<u32, 4>,
    /// Colour of the block, which is also its quarter of the parent.
    colour: u32,
    /// A bit per slot.
    fixed: array<u32, 8>,
}

/// What `invert` is asked for.
struct Request {
    /// Places of the blocks to look at.
    first: u32,
    count: u32,
    /// Workgroups per block.
    parts: u32,
    /// A cell is 2^bits steps of the lattice.
    bits: u32,
    /// Texels of the whole image.
    width: u32,
    height: u32,
    /// The rows that are written here.
    row: u32,
    rows: u32,
    /// Texels per step.
    texels: vec2f,
}
