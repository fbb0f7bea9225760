//! Declarations shared by Rust and WGSL: the structs of buffers, the planes of blocks, and the values of a dispatch's
//! `mode`. All kernels begin with them, and with the constants of `method::law` (`text`).

use bytemuck::{Pod, Zeroable};

use super::wgsl::{self, WgslType, structs};
use vrtm_core::grid::Grid;
use vrtm_core::method::law;

/// Constants of both languages.
pub mod shared {
    use vrtm_core::constants;
    use vrtm_core::grid::{planes, window};

    constants! {
        /// Stands for "no block" and "no triangle".
        NONE: u32 = vrtm_core::mesh::NONE;
        /// Nodes of a block.
        NODES: usize = planes::NODES;
        /// Nodes of a window: a block and its halo.
        WINDOW: usize = window::WINDOW_NODES;
        /// Fewest edges of a feature on a level that changes its multiplier.
        LEAST_EDGES: u32 = vrtm_core::grid::features::LEAST_EDGES;
        /// Most workgroups of a dispatch in x; further ones form rows in y.
        SPREAD: u32 = 65535;
        /// The energy of an invalid state: more than any other energy.
        INVALID_ENERGY: f32 = 3e38;

        /// Plane of the rigidity's code (16 bits), of its multiplier in this pose (15 bits) and of the sign bit of
        /// fixed nodes.
        RIGIDITY: usize = 0;
        /// First of the two planes of rest lengths: the codes of the owned edges 0 and 1, then of 2 and 3, the first of
        /// a pair in the lower 16 bits.
        LENGTH: usize = 1;
        /// Plane of the triangle under the node, or of the coverage.
        TRIANGLE_OR_COVERAGE: usize = 3;
        /// Plane of the density, or of what holds nodes at open borders, on grids that have it: none has both.
        EXTRA: usize = 4;

        /// Planes per block of the state of a coarser level: displacement (2).
        COARSE_STATE_PLANES: usize = 2;
        /// Planes per block of the state of level 0: displacement (2), triangle under W.
        FINEST_STATE_PLANES: usize = 3;
        /// First of the two planes of the displacement.
        U: usize = 0;
        /// Plane of the triangle under W, on level 0.
        TRIANGLE: usize = 2;
        /// Planes per block of what the state implies: position (level 0) or metric (coarser levels) at W (3), triangle
        /// under W. Only inspection stores these.
        SAMPLE_PLANES: usize = 4;

        /// Planes per block of a level's linear system: diagonal (3), pairs of the owned edges (two words each).
        ROW_PLANES: usize = 11;
        /// First of the eight planes of the pairs.
        PAIR: usize = 3;

        /// Planes per block of the vectors of a correction. A plane holds different quantities one after the other.
        VECTOR_PLANES: usize = 7;
        /// The residual (2); on the corrected level, once the second V-cycle is done, the second preconditioned
        /// residual z1.
        RESIDUAL: usize = 0;
        /// The result of the V-cycle (2); on the corrected level that of the first one, z0.
        DIRECTION: usize = 2;
        /// z smoothed on the way to coarser levels (2).
        SMOOTHED: usize = 4;
        /// The block's energy before a correction, at its first node, from assembly until z0 takes its place.
        ENERGY_BEFORE: usize = 2;
        /// The step fraction of each node, in two planes used alternately, while the step is limited and tried. Until
        /// the first trial, the step itself is a combination of z0, z1 and the last step.
        FRACTION: usize = 4;
        /// The step (2), while it is tried.
        STEP: usize = 2;
        /// The last step that was tried, two numbers in a word.
        LAST_STEP: usize = 6;
        /// The displacement before the step (2), while the step is tried.
        U_BEFORE: usize = 0;

        /// Quantities that are summed per block.
        SUMS: u32 = 12;
        /// The energy.
        SUM_ENERGY: u32 = 0;
        /// The least corner Jacobian, of which not the sum is taken.
        SUM_LEAST_JACOBIAN: u32 = 1;
        /// The number of folds.
        SUM_FOLDS: u32 = 2;
        /// The largest displacement, of which not the sum is taken.
        SUM_LARGEST: u32 = 3;
        /// While the system is solved: r . z0.
        SUM_RZ: u32 = 1;
        /// z0 . A z0.
        SUM_Z_PRODUCT: u32 = 2;
        /// r1 . z1.
        SUM_RZ_SECOND: u32 = 4;
        /// z1 . A z0.
        SUM_PRODUCT_Z_SECOND: u32 = 5;
        /// z1 . A z1.
        SUM_CURVATURE_SECOND: u32 = 6;
        /// The last step p: r1 . p.
        SUM_LAST_RESIDUAL: u32 = 8;
        /// p . A z0.
        SUM_LAST_FIRST: u32 = 9;
        /// p . A z1.
        SUM_LAST_SECOND: u32 = 10;
        /// p . A p.
        SUM_LAST_CURVATURE: u32 = 11;

        /// The displacement at the last integration (2). The paper's solver uses the planes of the vectors for the
        /// second copy of the state.
        U_INTEGRATED: usize = 4;

        /// `decide`: the chart's sum is the energy of the identity.
        DECIDE_IDENTITY: u32 = 0;
        /// `decide`: the energy before a correction, and the length of the first step of conjugate gradients.
        DECIDE_FIRST_STEP: u32 = 2;
        /// `decide`: the step, after the second iteration of conjugate gradients.
        DECIDE_SECOND_STEP: u32 = 3;
        /// `decide`: the energy after a trial.
        DECIDE_TRIAL: u32 = 5;
        /// `decide`: the energy after the last trial, which is always accepted.
        DECIDE_LAST_TRIAL: u32 = 6;
        /// `decide`: the energy of the result.
        DECIDE_ENERGY: u32 = 7;
        /// `decide`: the certificate of the result, which decides on the fallback.
        DECIDE_CERTIFICATE: u32 = 8;
        /// `decide`: the certificate of a result that may fold: the fallback is taken only if the energy is NaN or
        /// infinite.
        DECIDE_ALLOWING_FOLDS: u32 = 9;

        /// `select_charts`: all charts that are solved, at the beginning of a level's first correction.
        SELECT_FIRST_CORRECTION: u32 = 1;
        /// `select_charts`: the charts that take part in a further correction of the level.
        SELECT_LATER_CORRECTION: u32 = 2;

        /// `step`: the first trial, which stores the displacement before the step.
        STEP_FIRST_TRIAL: u32 = 0;
        /// `step`: a further trial.
        STEP_LATER_TRIAL: u32 = 1;
        /// `relax`: nodes take whole steps.
        RELAX_WHOLE: u32 = 0;
        /// `relax`: nodes multiply their steps by the step fraction of their chart.
        RELAX_FRACTION: u32 = 1;
        /// `energy`: a state with a corner Jacobian under CRUSHED_JACOBIAN is invalid.
        ENERGY_VALID: u32 = 0;
        /// `energy`: a state with any corner Jacobians is valid.
        ENERGY_ALLOWING_FOLDS: u32 = 1;
        /// `multigrid_down`: the residual is there.
        DOWN_FROM_RESIDUAL: u32 = 0;
        /// `multigrid_down`: the residual is gathered from what the finer level contributed.
        DOWN_GATHER: u32 = 1;
        /// `multigrid_up`: on a level other than the corrected one.
        UP_COARSE: u32 = 0;
        /// `multigrid_up`: on the corrected level, in the first V-cycle.
        UP_FIRST: u32 = 1;
        /// `multigrid_up`: on the corrected level, in the second V-cycle, which begins with A z0.
        UP_SECOND: u32 = 2;
        /// The paper's solver (the bits under 16 are the number of the set), a bit: the state to read is in the
        /// vectors.
        PBD_FROM_VECTORS: u32 = 16;
        /// The paper's solver, a bit: the level's last iteration.
        PBD_LAST: u32 = 32;
        /// The paper's solver, a bit: velocities are neither used nor stored.
        PBD_WITHOUT_VELOCITY: u32 = 64;
    }
}
pub use shared::*;

/// Bytes of a plane.
pub const PLANE: u64 = NODES as u64 * 4;
/// Threads of a workgroup.
pub const THREADS: u32 = 64;
/// Planes per block of a metric.
pub const METRIC_PLANES: usize = 3;

/// Planes per block of the constants of a grid's nodes: rigidity, four rest lengths (two planes), triangle under the
/// node (level 0) or coverage (coarser levels) and, where a setting asks for it, density of rigid material or what
/// holds nodes.
pub fn node_planes(grid: &Grid) -> usize {
    EXTRA + usize::from(grid.has_extra)
}

/// Planes per block of a level's state.
pub const fn state_planes(level: usize) -> usize {
    if level == 0 { FINEST_STATE_PLANES } else { COARSE_STATE_PLANES }
}

structs! {
    /// Parameters of one dispatch.
    #[derive(Default)]
    pub struct Params {
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
        /// in the last rounds; `multiply`: H on the level.
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
        /// The unit of multipliers, 1 / MULTIPLIER_STEPS; 0 if the level is not weighed, whatever stands in `nodes`.
        multiplier: f32,
        /// `multiply`: the part of the multipliers that remains.
        kept: f32,
    }

    /// A chart, and the decisions about it during a solve.
    #[derive(Default)]
    pub struct Chart {
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
        step: [f32; 3],
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
        limit_rounds: u32 as "atomic<u32>",
        /// The longest component of the present step, in cells, as bits.
        longest: u32 as "atomic<u32>",
        /// The largest part of the present step that the limit's first fractions cut off at a corner, as bits.
        cut: u32 as "atomic<u32>",
    }

    /// A block. Blocks are named by their indices in the buffers of their level.
    pub struct BlockRecord {
        /// The 3x3 neighbour blocks of the same chart, the block itself in the middle; NONE where the chart has
        /// no block.
        neighbours: [u32; 9],
        /// The active ones of these blocks; NONE elsewhere.
        active_neighbours: [u32; 9],
        chart: u32,
        x: u32,
        y: u32,
        /// 1 if the block has a movable node.
        is_active: u32,
        /// The block of the next coarser level that holds the nodes at this block's even nodes; its neighbours on the
        /// side of the quarter of it that this block is, along x, along y and across the corner; NONE where that level
        /// has no block.
        parents: [u32; 4],
        /// One bit per parent: 1 if it has a movable node.
        active_parents: u32,
        /// The blocks of the next finer level at its four quarters.
        children: [u32; 4],
        /// First and count of the chart's blocks, sorted by y, then x.
        chart_first: u32,
        chart_count: u32,
        /// The coding of the rest lengths of each of the four owned edges (`codes::Lengths`).
        length_base: [u32; 4],
        length_shift: [u32; 4],
        /// Per slot the code of the weight of the lower neighbour in the interpolation from the next coarser level,
        /// four to a word: the neighbour to the west at nodes in odd columns, to the south at nodes in even columns and
        /// odd rows (method §7.5). 0 on the coarsest level.
        weights: [u32; 64],
    }

    /// A triangle: its UVs in cells, and its pose.
    pub struct Triangle {
        corner: [f32; 2],
        /// Rows of the inverse UV edge matrix, which maps an offset from the first corner to the barycentric
        /// coordinates of corners 1 and 2.
        barycentric: [f32; 4],
        /// The neighbours across the edges opposite to each corner, or NONE.
        neighbours: [u32; 3],
        chart: u32,
        /// Position of the first corner, df/dx, df/dy.
        pose: [f32; 9],
    }

    /// The part of an image that a dispatch of `invert` writes.
    pub struct Request {
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
        texels_per_step: [f32; 2] as "vec2f",
    }

    /// A band of texel rows that the kernel `redirect` writes.
    pub struct RedirectRequest {
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
        cells: [u32; 2],
        /// The tile's lower left corner in UV space, which is added to UVs.
        origin: [u32; 2],
    }
}

/// All of these declarations, and the constants of both backends, in WGSL.
pub fn text() -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = wgsl::write(&mut text, &law::declarations(), &[]);
    let _ = wgsl::write(&mut text, &shared::declarations(), &struct_declarations());
    text
}

#[cfg(test)]
mod tests;
