// Written from law.rs of core, layout.rs and redirect.rs of gpu, which tell what all is.
// Change those, then VRTM_UPDATE_SHADERS=1 cargo test -p vrtm-gpu --lib generated

const MIN_JACOBIAN: f32 = 0.02;
const CRUSHED_JACOBIAN: f32 = 0.01;
const TINY: f32 = 1e-24;
const INSIDE_TOLERANCE: f32 = 1e-6;
const BORDER_TOLERANCE: f32 = 0.001;
const WALK_STEPS: u32 = 256u;
const MAX_NODE_STEP: f32 = 2.0;
const SWEPT_MARGIN: f32 = 0.25;
const MIN_RELATIVE_GAIN: f32 = 1e-6;
const SWEEPS_PER_PASS: u32 = 2u;
const NEAR_BOUND_JACOBIAN: f32 = 0.049999997;
const NEAR_BOUND_STIFFNESS: f32 = 10.0;
const TANGENT_WEIGHT: f32 = 0.15;
const HOLD: f32 = 4.0;
const HARM_MARGIN: f32 = 0.01;
const HARM_ONSET: f32 = 0.03;
const MULTIPLIER_STEPS: f32 = 1024.0;
const MOST_MULTIPLIER: f32 = 31.0;
const WARM_MULTIPLIER: f32 = 0.9;
const HARM_STRESS: f32 = 6.0;
const TENSION_STIFFNESS: f32 = 0.25;
const COMPRESSION_STIFFNESS: f32 = 0.5;
const MIN_OFFSET_SQUARE: f32 = 0.1;
const SMOOTHER_SWEEPS: u32 = 3u;
const COARSEST_SWEEPS: u32 = 6u;
const CG_ITERATIONS: u32 = 2u;
const MIN_NEW_CURVATURE: f32 = 0.001;
const MAX_STEP: f32 = 32768.0;
const STEP_MIN_JACOBIAN: f32 = 0.012999999;
const MARGIN_LEFT: f32 = 0.1;
const FRACTION_FALLOFF: f32 = 0.125;
const STEP_FALLOFF: f32 = 0.25;
const SHRINKING_ROUNDS: u32 = 8u;
const LIMIT_ROUNDS: u32 = 16u;
const COARSER_LIMIT_ROUNDS: u32 = 4u;
const SUFFICIENT_DECREASE: f32 = 0.02;
const IDENTITY_ENERGY_WEIGHT: f32 = 0.06;
const FRACTION_GROWTH: f32 = 4.0;
const GAIN_RAMP: vec2f = vec2f(1.0, 4.0);
const MODEL_ERROR_RAMP: vec2f = vec2f(0.25, 2.0);

const NONE: u32 = 0xffffffffu;
const NODES: u32 = 256u;
const WINDOW: u32 = 324u;
const LEAST_EDGES: u32 = 12u;
const SPREAD: u32 = 65535u;
const INVALID_ENERGY: f32 = 3e38;
const RIGIDITY: u32 = 0u;
const LENGTH: u32 = 1u;
const TRIANGLE_OR_COVERAGE: u32 = 3u;
const EXTRA: u32 = 4u;
const COARSE_STATE_PLANES: u32 = 2u;
const FINEST_STATE_PLANES: u32 = 3u;
const U: u32 = 0u;
const TRIANGLE: u32 = 2u;
const SAMPLE_PLANES: u32 = 4u;
const ROW_PLANES: u32 = 11u;
const PAIR: u32 = 3u;
const VECTOR_PLANES: u32 = 7u;
const RESIDUAL: u32 = 0u;
const DIRECTION: u32 = 2u;
const SMOOTHED: u32 = 4u;
const ENERGY_BEFORE: u32 = 2u;
const FRACTION: u32 = 4u;
const STEP: u32 = 2u;
const LAST_STEP: u32 = 6u;
const U_BEFORE: u32 = 0u;
const SCRATCH: u32 = 7u;
const SUMS: u32 = 12u;
const SUM_ENERGY: u32 = 0u;
const SUM_LEAST_JACOBIAN: u32 = 1u;
const SUM_FOLDS: u32 = 2u;
const SUM_LARGEST: u32 = 3u;
const SUM_RZ: u32 = 1u;
const SUM_Z_PRODUCT: u32 = 2u;
const SUM_RZ_SECOND: u32 = 4u;
const SUM_PRODUCT_Z_SECOND: u32 = 5u;
const SUM_CURVATURE_SECOND: u32 = 6u;
const SUM_LAST_RESIDUAL: u32 = 8u;
const SUM_LAST_FIRST: u32 = 9u;
const SUM_LAST_SECOND: u32 = 10u;
const SUM_LAST_CURVATURE: u32 = 11u;
const U_INTEGRATED: u32 = 4u;
const DECIDE_IDENTITY: u32 = 0u;
const DECIDE_FIRST_STEP: u32 = 2u;
const DECIDE_SECOND_STEP: u32 = 3u;
const DECIDE_TRIAL: u32 = 5u;
const DECIDE_LAST_TRIAL: u32 = 6u;
const DECIDE_ENERGY: u32 = 7u;
const DECIDE_CERTIFICATE: u32 = 8u;
const DECIDE_ALLOWING_FOLDS: u32 = 9u;
const SELECT_FIRST_CORRECTION: u32 = 1u;
const SELECT_LATER_CORRECTION: u32 = 2u;
const STEP_FIRST_TRIAL: u32 = 0u;
const STEP_LATER_TRIAL: u32 = 1u;
const RELAX_WHOLE: u32 = 0u;
const RELAX_FRACTION: u32 = 1u;
const ENERGY_VALID: u32 = 0u;
const ENERGY_ALLOWING_FOLDS: u32 = 1u;
const DOWN_FROM_RESIDUAL: u32 = 0u;
const DOWN_GATHER: u32 = 1u;
const UP_COARSE: u32 = 0u;
const UP_FIRST: u32 = 1u;
const UP_SECOND: u32 = 2u;
const PBD_FROM_VECTORS: u32 = 16u;
const PBD_LAST: u32 = 32u;
const PBD_WITHOUT_VELOCITY: u32 = 64u;

struct Params {
    first: u32,
    count: u32,
    gate: u32,
    mode: u32,
    sweeps: u32,
    in_correction: u32,
    has_last_step: u32,
    is_identity: u32,
    items: u32,
    scale: f32,
    factor: f32,
    tolerance: f32,
    trusts_model: u32,
    smoothness: f32,
    smoothness_floor: f32,
    orientation: f32,
    orientation_density: f32,
    room: f32,
    room_threshold: f32,
    hold: f32,
    level: u32,
    has_coarser: u32,
    correction: f32,
    orientation_fraction: f32,
    momentum: f32,
    smoothing: f32,
    pull: f32,
    anchor_is_identity: u32,
    state_planes: u32,
    node_planes: u32,
    multiplier: f32,
    kept: f32,
}

struct Chart {
    solved: u32,
    working: u32,
    finished: u32,
    fallback: u32,
    length_floor: f32,
    identity: f32,
    before: f32,
    energy: f32,
    rz: f32,
    curvature: f32,
    alpha: f32,
    step: array<f32, 3>,
    predicted: f32,
    first: u32,
    fraction: f32,
    min_jacobian: f32,
    max_displacement: f32,
    folds: u32,
    limit_rounds: atomic<u32>,
    longest: atomic<u32>,
    cut: atomic<u32>,
}

struct BlockRecord {
    neighbours: array<u32, 9>,
    active_neighbours: array<u32, 9>,
    chart: u32,
    x: u32,
    y: u32,
    is_active: u32,
    parents: array<u32, 4>,
    active_parents: u32,
    children: array<u32, 4>,
    chart_first: u32,
    chart_count: u32,
    length_base: array<u32, 4>,
    length_shift: array<u32, 4>,
    weights: array<u32, 64>,
}

struct Triangle {
    corner: array<f32, 2>,
    barycentric: array<f32, 4>,
    neighbours: array<u32, 3>,
    chart: u32,
    pose: array<f32, 9>,
}

struct Request {
    first: u32,
    count: u32,
    workgroups_per_block: u32,
    bits: u32,
    width: u32,
    height: u32,
    row: u32,
    rows: u32,
    texels_per_step: vec2f,
}

struct RedirectRequest {
    width: u32,
    row: u32,
    rows: u32,
    first: u32,
    step: u32,
    is_delta: u32,
    is_half: u32,
    cells: array<u32, 2>,
    origin: array<u32, 2>,
}
