// Written from crates/core/src/method/law.rs, crates/gpu/src/layout.rs and crates/gpu/src/redirect.rs. Change those, then
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
/// A node's step in a sweep takes at most this fraction of what a corner Jacobian has over `MIN_JACOBIAN`: a corner
/// with next to nothing left would decide about the whole chart's next correction.
const SWEPT_MARGIN: f32 = 0.25;
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
/// Weight of the tangents in the slopes of the finest level (method §2); differences have the rest. More of it
/// follows the energy more closely across the edges of triangles, and jumps more there.
const TANGENT_WEIGHT: f32 = 0.15;
/// Weight of the hold at open borders along which texture slides (method §16).
const HOLD: f32 = 4.0;
/// Protection (method §4): with `protect` at 1, rigid material that the pose does not strain has 1 plus this times
/// the weight of what it strains most.
const PROTECTION: f32 = 9.0;
/// The strain at which half of that is left.
const PROTECTED_STRAIN: f32 = 0.04;
/// Resolution of stored weight reductions: they are multiples of 1 / this.
const LOST_STEPS: f32 = 32768.0;
/// Stress stiffness (method §4, Derivatives): the factor of the strain of an edge that is longer than at rest ...
const TENSION_STIFFNESS: f32 = 0.25;
/// ... and of one that is shorter.
const COMPRESSION_STIFFNESS: f32 = 0.5;
/// Least square of an edge's offset that the stress stiffness is divided by, relative to that at rest.
const MIN_OFFSET_SQUARE: f32 = 0.1;
/// Sweeps of the V-cycle's smoother on either side of the coarse correction (method §7.4).
const SMOOTHER_SWEEPS: u32 = 3u;
/// Sweeps of the smoother on either side on the coarsest level.
const COARSEST_SWEEPS: u32 = 6u;
/// Most iterations of conjugate gradients in a correction: more gain less than the next level or the next
/// correction does, which continues along the last step, and need more memory (method §7.3).
const CG_ITERATIONS: u32 = 2u;
/// The last step is a direction of conjugate gradients if at least this part of its curvature is left once it is
/// conjugate to the other directions.
const MIN_NEW_CURVATURE: f32 = 0.001;
/// A component of a step of this many cells or more is replaced by 0: it exceeds the largest grid.
const MAX_STEP: f32 = 32768.0;
/// The bound on the Jacobian of a correction's step (method §7.6). It is lower than that of the sweeps, so that
/// corners which these have brought close to theirs leave the step room.
const STEP_MIN_JACOBIAN: f32 = 0.012999999;
/// A step leaves at least this fraction of what a corner Jacobian has over `STEP_MIN_JACOBIAN`.
const MARGIN_LEFT: f32 = 0.1;
/// The step fractions of neighbouring nodes differ by at most this ...
const FRACTION_FALLOFF: f32 = 0.125;
/// ... and by at most what makes this many cells of the chart's longest step: a step that changes abruptly from
/// node to node folds by itself.
const STEP_FALLOFF: f32 = 0.25;
/// Rounds that multiply the step fractions around corners which would still lose too much by what these allow.
const SHRINKING_ROUNDS: u32 = 8u;
/// Rounds in all on level 0: after the shrinking ones, nodes around corners that would still fall under the bound
/// stay where they are. A chart that is not free of folds after all rounds is refused for its energy.
const LIMIT_ROUNDS: u32 = 16u;
/// Rounds on each of the other levels, where three have been enough in all scenes and hard cases.
const COARSER_LIMIT_ROUNDS: u32 = 4u;
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
const MODEL_ERROR_RAMP: vec2f = vec2f(0.25, 2.0);

/// Stands for "no block" and "no triangle".
const NONE: u32 = 0xffffffffu;
/// Nodes of a block.
const NODES: u32 = 256u;
/// Nodes of a window: a block and its halo.
const WINDOW: u32 = 324u;
/// Most workgroups of a dispatch in x; further ones form rows in y.
const SPREAD: u32 = 65535u;
/// The energy of an invalid state: more than any other energy.
const INVALID_ENERGY: f32 = 3e38;
/// Plane of the rigidity's code (16 bits), of what it has lost in this pose (15 bits) and of the sign bit of
/// fixed nodes.
const RIGIDITY: u32 = 0u;
/// First of the two planes of rest lengths: the codes of the owned edges 0 and 1, then of 2 and 3, the first of
/// a pair in the lower 16 bits.
const LENGTH: u32 = 1u;
/// Plane of the triangle under the node, or of the coverage.
const TRIANGLE_OR_COVERAGE: u32 = 3u;
/// Plane of the density, or of what holds nodes at open borders, on grids that have it: none has both.
const EXTRA: u32 = 4u;
/// Planes per block of the state of a coarser level: displacement (2).
const COARSE_STATE_PLANES: u32 = 2u;
/// Planes per block of the state of level 0: displacement (2), triangle under W.
const FINEST_STATE_PLANES: u32 = 3u;
/// First of the two planes of the displacement.
const U: u32 = 0u;
/// Plane of the triangle under W, on level 0.
const TRIANGLE: u32 = 2u;
/// Planes per block of what the state implies: position (level 0) or metric (coarser levels) at W (3), triangle
/// under W. Only inspection stores these.
const SAMPLE_PLANES: u32 = 4u;
/// Planes per block of a level's linear system: diagonal (3), pairs of the owned edges (two words each).
const ROW_PLANES: u32 = 11u;
/// First of the eight planes of the pairs.
const PAIR: u32 = 3u;
/// Planes per block of the vectors of a correction. A plane holds different quantities one after the other.
const VECTOR_PLANES: u32 = 7u;
/// The residual (2); on the corrected level, once the second V-cycle is done, the second preconditioned
/// residual z1.
const RESIDUAL: u32 = 0u;
/// The result of the V-cycle (2); on the corrected level that of the first one, z0.
const DIRECTION: u32 = 2u;
/// z smoothed on the way to coarser levels (2).
const SMOOTHED: u32 = 4u;
/// The block's energy before a correction, at its first node, from assembly until z0 takes its place.
const ENERGY_BEFORE: u32 = 2u;
/// The step fraction of each node, in two planes used alternately, while the step is limited and tried. Until
/// the first trial, the step itself is a combination of z0, z1 and the last step.
const FRACTION: u32 = 4u;
/// The step (2), while it is tried.
const STEP: u32 = 2u;
/// The last step that was tried, as two bfloat16.
const LAST_STEP: u32 = 6u;
/// The displacement before the step (2), while the step is tried.
const U_BEFORE: u32 = 0u;
/// Scratch memory of the V-cycle (2) on the levels that one dispatch works on, behind the vectors of these
/// levels.
const SCRATCH: u32 = 7u;
/// Quantities that are summed per block.
const SUMS: u32 = 12u;
/// The energy.
const SUM_ENERGY: u32 = 0u;
/// The least corner Jacobian, of which not the sum is taken.
const SUM_LEAST_JACOBIAN: u32 = 1u;
/// The number of folds.
const SUM_FOLDS: u32 = 2u;
/// The largest displacement, of which not the sum is taken.
const SUM_LARGEST: u32 = 3u;
/// While the system is solved: r . z0.
const SUM_RZ: u32 = 1u;
/// z0 . A z0.
const SUM_Z_PRODUCT: u32 = 2u;
/// r1 . z1.
const SUM_RZ_SECOND: u32 = 4u;
/// z1 . A z0.
const SUM_PRODUCT_Z_SECOND: u32 = 5u;
/// z1 . A z1.
const SUM_CURVATURE_SECOND: u32 = 6u;
/// The last step p: r1 . p.
const SUM_LAST_RESIDUAL: u32 = 8u;
/// p . A z0.
const SUM_LAST_FIRST: u32 = 9u;
/// p . A z1.
const SUM_LAST_SECOND: u32 = 10u;
/// p . A p.
const SUM_LAST_CURVATURE: u32 = 11u;
/// The displacement at the last integration (2). The paper's solver uses the planes of the vectors for the
/// second copy of the state.
const U_INTEGRATED: u32 = 4u;
/// `decide`: the chart's sum is the energy of the identity.
const DECIDE_IDENTITY: u32 = 0u;
/// `decide`: the energy before a correction, and the length of the first step of conjugate gradients.
const DECIDE_FIRST_STEP: u32 = 2u;
/// `decide`: the step, after the second iteration of conjugate gradients.
const DECIDE_SECOND_STEP: u32 = 3u;
/// `decide`: the energy after a trial.
const DECIDE_TRIAL: u32 = 5u;
/// `decide`: the energy after the last trial, which is always accepted.
const DECIDE_LAST_TRIAL: u32 = 6u;
/// `decide`: the energy of the result.
const DECIDE_ENERGY: u32 = 7u;
/// `decide`: the certificate of the result, which decides on the fallback.
const DECIDE_CERTIFICATE: u32 = 8u;
/// `decide`: the certificate of a result that may fold: the fallback is taken only if the energy is NaN or
/// infinite.
const DECIDE_ALLOWING_FOLDS: u32 = 9u;
/// `select_charts`: all charts that are solved, at the beginning of a level's first correction.
const SELECT_FIRST_CORRECTION: u32 = 1u;
/// `select_charts`: the charts that take part in a further correction of the level.
const SELECT_LATER_CORRECTION: u32 = 2u;
/// `step`: the first trial, which stores the displacement before the step.
const STEP_FIRST_TRIAL: u32 = 0u;
/// `step`: a further trial.
const STEP_LATER_TRIAL: u32 = 1u;
/// `relax`: nodes take whole steps.
const RELAX_WHOLE: u32 = 0u;
/// `relax`: nodes multiply their steps by the step fraction of their chart.
const RELAX_FRACTION: u32 = 1u;
/// `energy`: a state with a corner Jacobian under CRUSHED_JACOBIAN is invalid.
const ENERGY_VALID: u32 = 0u;
/// `energy`: a state with any corner Jacobians is valid.
const ENERGY_ALLOWING_FOLDS: u32 = 1u;
/// `multigrid_down`: the residual is there.
const DOWN_FROM_RESIDUAL: u32 = 0u;
/// `multigrid_down`: the residual is gathered from what the finer level contributed.
const DOWN_GATHER: u32 = 1u;
/// `multigrid_up`: on a level other than the corrected one.
const UP_COARSE: u32 = 0u;
/// `multigrid_up`: on the corrected level, in the first V-cycle.
const UP_FIRST: u32 = 1u;
/// `multigrid_up`: on the corrected level, in the second V-cycle, which begins with A z0.
const UP_SECOND: u32 = 2u;
/// The paper's solver (the bits under 16 are the number of the set), a bit: the state to read is in the
/// vectors.
const PBD_FROM_VECTORS: u32 = 16u;
/// The paper's solver, a bit: the level's last iteration.
const PBD_LAST: u32 = 32u;
/// The paper's solver, a bit: velocities are neither used nor stored.
const PBD_WITHOUT_VELOCITY: u32 = 64u;

/// Parameters of one dispatch.
struct Params {
    /// First and count of the blocks to work on in `lists`.
    first: u32,
    count: u32,
    /// The number of the gate that `gate` opens.
    gate: u32,
    /// Variant of the kernel: one of the constants above, or a number that the kernel explains.
    mode: u32,
    sweeps: u32,
    /// 1 in a correction: kernels work on the charts that take part in it; else on all that are solved.
    in_correction: u32,
    /// 1 in a correction that follows another one of the same level: the last step is a direction.
    has_last_step: u32,
    /// 1 if the state to read is the identity, whatever stands in `state`.
    is_identity: u32,
    /// Number of charts; for `surface`, of triangles.
    items: u32,
    /// Side of this level's cells in cells of level 0.
    scale: f32,
    /// `step`: the fraction t of the trial; `shrink`: the fraction of a margin that the round leaves, negative
    /// in the last rounds; `protect`: what rigidity loses at most, in multiples of 1 / LOST_STEPS.
    factor: f32,
    tolerance: f32,
    /// 1 if a first correction that gained what its model predicted ends the level's corrections.
    trusts_model: u32,
    smoothness: f32,
    smoothness_floor: f32,
    orientation: f32,
    /// Added to the weight of the orientation term in proportion to the density of rigid material.
    orientation_density: f32,
    room: f32,
    room_threshold: f32,
    /// Weight of the hold at open borders; 0 without one.
    hold: f32,
    level: u32,
    /// 1 if the V-cycle visits a coarser level than this one.
    has_coarser: u32,
    /// The paper's solver: factor C_k of the level's projections.
    correction: f32,
    /// The paper's solver: fraction of the turn back towards the rest direction.
    orientation_fraction: f32,
    /// The paper's solver: 1 - damping, the fraction of a velocity that is kept.
    momentum: f32,
    /// The paper's solver: smoothing s of its eq. 4.
    smoothing: f32,
    /// Weight theta of the pull towards the previous result; 0 without a pull.
    pull: f32,
    /// 1 if the previous result is the identity, whatever stands in `anchor`.
    anchor_is_identity: u32,
    /// Planes per block of this level's state.
    state_planes: u32,
    /// Planes per block of the constants of all levels' nodes.
    node_planes: u32,
    /// The unit of what rigidity has lost: 1 / LOST_STEPS; 0 if nothing is protected, whatever stands in `nodes`.
    lost: f32,
}

/// A chart, and the decisions about it during a solve.
struct Chart {
    /// 1 if the chart is solved.
    solved: u32,
    /// 1 if the chart takes part in the present correction, until a trial is accepted.
    working: u32,
    /// 1 if the chart sits out the level's further corrections.
    finished: u32,
    /// 1 if the result is the identity because the warp did not pass certification.
    fallback: u32,
    /// Floor l_min of rest lengths on level 0.
    length_floor: f32,
    /// Energy of the identity on the level on which work ends.
    identity: f32,
    /// Energy before the present correction.
    before: f32,
    /// Energy of the result.
    energy: f32,
    /// Conjugate gradients: product of residual and preconditioned residual.
    rz: f32,
    /// Conjugate gradients: product of z0, matrix and z0.
    curvature: f32,
    /// Conjugate gradients: length of the first step.
    alpha: f32,
    /// The step is this combination of z0, z1 and the last step.
    step: array<f32, 3>,
    /// Predicted gain: the fall of the quadratic model over the step.
    predicted: f32,
    /// 1 during a level's first correction.
    first: u32,
    /// Step fraction of the present correction, and once that is accepted, of the next one.
    fraction: f32,
    min_jacobian: f32,
    max_displacement: f32,
    folds: u32,
    /// Dispatches of the step limit that found something to limit, the first fractions included; 0 if the step is
    /// not limited.
    limit_rounds: atomic<u32>,
    /// The longest component of the present step, in cells, as bits.
    longest: atomic<u32>,
    /// The largest part of the present step that the limit's first fractions cut off at a corner, as bits.
    cut: atomic<u32>,
}

/// A block. Blocks are named by their indices in the buffers of their level.
struct BlockRecord {
    /// The 3x3 neighbour blocks of the same chart, the block itself in the middle; NONE where the chart has
    /// no block.
    neighbours: array<u32, 9>,
    /// The active ones of these blocks; NONE elsewhere.
    active_neighbours: array<u32, 9>,
    chart: u32,
    x: u32,
    y: u32,
    /// 1 if the block has a movable node.
    is_active: u32,
    /// The block of the next coarser level that holds the nodes at this block's even nodes; its neighbours on the
    /// side of the quarter of it that this block is, along x, along y and across the corner; NONE where that level
    /// has no block.
    parents: array<u32, 4>,
    /// One bit per parent: 1 if it has a movable node.
    active_parents: u32,
    /// The blocks of the next finer level at its four quarters.
    children: array<u32, 4>,
    /// First and count of the chart's blocks, sorted by y, then x.
    chart_first: u32,
    chart_count: u32,
    /// The coding of the rest lengths of each of the four owned edges (`codes::Lengths`).
    length_base: array<u32, 4>,
    length_shift: array<u32, 4>,
    /// Per slot the code of the weight of the lower neighbour in the interpolation from the next coarser level,
    /// four to a word: the neighbour to the west at nodes in odd columns, to the south at nodes in even columns and
    /// odd rows (method §7.5). 0 on the coarsest level.
    weights: array<u32, 64>,
}

/// A triangle: its UVs in cells, and its pose.
struct Triangle {
    corner: array<f32, 2>,
    /// Rows of the inverse UV edge matrix, which maps an offset from the first corner to the barycentric
    /// coordinates of corners 1 and 2.
    barycentric: array<f32, 4>,
    /// The neighbours across the edges opposite to each corner, or NONE.
    neighbours: array<u32, 3>,
    chart: u32,
    /// Position of the first corner, df/dx, df/dy.
    pose: array<f32, 9>,
}

/// The part of an image that a dispatch of `invert` writes.
struct Request {
    /// First and count of the blocks to work on.
    first: u32,
    count: u32,
    /// Workgroups per block.
    workgroups_per_block: u32,
    /// The side of a cell is 2^bits steps of the lattice.
    bits: u32,
    /// Size of the whole image in texels.
    width: u32,
    height: u32,
    /// First and count of the texel rows to write.
    row: u32,
    rows: u32,
    /// Texels per step of the lattice.
    texels_per_step: vec2f,
}

/// A band of texel rows that the kernel `redirect` writes.
struct RedirectRequest {
    /// Texels per row.
    width: u32,
    /// The band's first row, counted from v = 0 upward.
    row: u32,
    /// Number of rows in the band.
    rows: u32,
    /// Index of the band's first texel, in texels from the start of the binding.
    first: u32,
    /// Distance from a row to the next one, in texels, modulo 2^32.
    step: u32,
    /// 1 to write redirections as offsets from the texel's centre; 0 to write UVs.
    is_delta: u32,
    /// 1 to write f16; 0 to write f32.
    is_half: u32,
    /// Number of the grid's cells along u and v.
    cells: array<u32, 2>,
    /// The tile's lower left corner in UV space, which is added to UVs.
    origin: array<u32, 2>,
}
