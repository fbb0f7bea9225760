//! What Rust and WGSL share: the structs of buffers, the planes of blocks, and what a dispatch's `mode` says. All of it is
//! declared here and written to `shaders/generated.wgsl` (`gpu/generated.rs`).

use bytemuck::{Pod, Zeroable};

#[cfg(test)]
use super::generated::WgslType;
use super::generated::structs;

/// Numbers that both sides know.
pub mod shared {
    use crate::method::constants::constants;
    use crate::tile::{blocks, window};

    constants! {
        /// No block, no triangle.
        NONE: u32 = crate::mesh::NONE;
        /// Nodes of a block.
        NODES: usize = blocks::NODES;
        /// Nodes of a window: a block and its halo.
        WINDOW: usize = window::WINDOW_NODES;
        /// Workgroups in x; more go to y.
        SPREAD: u32 = 65535;
        /// More than any energy: that of a state that has none.
        INVALID_ENERGY: f32 = 3e38;

        /// Planes per block of a level's constants: rigidity (sign bit: fixed), four rest lengths, triangle under the node
        /// or coverage, density of rigid material.
        NODE_PLANES: usize = 7;
        /// Of these.
        RIGIDITY: usize = 0;
        /// Of these: four.
        LENGTH: usize = 1;
        /// Of these.
        UNDER: usize = 5;
        /// Of these.
        DENSITY: usize = 6;

        /// Planes per block of a level's state: displacement (2), position or metric at W (3), triangle.
        STATE_PLANES: usize = 6;
        /// Of these: two.
        U: usize = 0;
        /// Of these: three.
        VALUE: usize = 2;
        /// Of these.
        TRIANGLE: usize = 5;

        /// Planes per block of a level's system: diagonal (3), pairs of the owned edges (two words each), interpolation's
        /// weights.
        ROW_PLANES: usize = 12;
        /// Of these: eight.
        PAIR: usize = 3;
        /// Of these; uploaded once per grid.
        INTERPOLATION: usize = 11;

        /// Planes per block of the vectors of a correction. As on the CPU (`cpu/correct/workspace.rs`), the same planes
        /// serve several quantities one after the other.
        VECTOR_PLANES: usize = 8;
        /// While the system is solved: the residual (2), ...
        RESIDUAL: usize = 0;
        /// ... what the V-cycle makes of it, then the direction (2), ...
        DIRECTION: usize = 2;
        /// ... the matrix times that, and the residual inside the V-cycle (2), ...
        PRODUCT: usize = 4;
        /// ... and, to the end, the step (2).
        STEP: usize = 6;
        /// While the step is limited and tried: the step fraction, in two planes in turn, ...
        FRACTION: usize = 0;
        /// ... while it is limited: 1 where a corner would fall under the bound, ...
        MARK: usize = 2;
        /// ... and while it is tried: the displacement before it (2).
        BEFORE: usize = 2;

        /// Of the vectors' planes, which the paper's solver uses for a second state: the displacement as it was integrated
        /// last (2).
        PREVIOUS: usize = 6;

        /// `decide`: a chart's sum is the energy of the identity, ...
        DECIDE_IDENTITY: u32 = 0;
        /// ... the energy before a correction, ...
        DECIDE_BEFORE: u32 = 1;
        /// ... residual times preconditioned residual, ...
        DECIDE_DIRECTION: u32 = 2;
        /// ... the same in the first iteration, ...
        DECIDE_FIRST_DIRECTION: u32 = 3;
        /// ... direction times matrix times direction, ...
        DECIDE_STEP_LENGTH: u32 = 4;
        /// ... the energy after a trial, ...
        DECIDE_TRIAL: u32 = 5;
        /// ... the energy after the last trial, which is accepted whatever it is, ...
        DECIDE_LAST_TRIAL: u32 = 6;
        /// ... the energy of the result, ...
        DECIDE_ENERGY: u32 = 7;
        /// ... or its certificate, which decides on the fallback, ...
        DECIDE_CERTIFICATE: u32 = 8;
        /// ... or only if the energy is NaN or infinite.
        DECIDE_AS_IS: u32 = 9;

        /// `select_charts`: all that are solved, ...
        SELECT_ALL: u32 = 0;
        /// ... the same for a level's first correction, ...
        SELECT_FIRST_CORRECTION: u32 = 1;
        /// ... or those that take part in a further one.
        SELECT_LATER_CORRECTION: u32 = 2;

        /// `step`: the first trial keeps the displacement before the step.
        STEP_FIRST_TRIAL: u32 = 0;
        /// `step`: a further trial.
        STEP_LATER_TRIAL: u32 = 1;
        /// `relax`: nodes take their whole step.
        RELAX_WHOLE: u32 = 0;
        /// `relax`: nodes take the fraction that their chart takes of the correction.
        RELAX_FRACTION: u32 = 1;
        /// `energy`: a state with a crushed cell has none.
        ENERGY_VALID: u32 = 0;
        /// `energy`: whatever the state is like.
        ENERGY_AS_IS: u32 = 1;
        /// `smooth`, a bit: backwards.
        SMOOTH_BACKWARDS: u32 = 1;
        /// `smooth`, a bit: the direction is 0 before this pass over the block colours.
        SMOOTH_FROM_ZERO: u32 = 2;
        /// `gate`, a bit: only charts whose step is limited count.
        GATE_LIMITED: u32 = 1;
        /// The paper's solver, bits under these are the set; a bit: the state is among the vectors.
        PBD_FROM_VECTORS: u32 = 16;
        /// A bit: the level's last iteration.
        PBD_LAST: u32 = 32;
        /// A bit: no velocities.
        PBD_WITHOUT_VELOCITY: u32 = 64;
    }
}
pub use shared::*;

/// Threads of a workgroup.
pub const THREADS: u32 = 64;
/// Planes per block of a metric.
pub const METRIC_PLANES: usize = 3;
/// Planes per block of a result.
pub const RESULT_PLANES: usize = 2;

structs! {
    /// One dispatch.
    #[derive(Default)]
    pub struct Params {
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
    #[derive(Default)]
    pub struct Chart {
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
        limit_rounds: u32 as "atomic<u32>",
    }

    /// A block, with its neighbours' places in the same buffers.
    pub struct BlockRecord {
        /// The 3x3 blocks of the same chart around it, itself in the middle; NONE where there is none.
        neighbours: [u32; 9],
        /// The same without blocks that have no movable node.
        active_neighbours: [u32; 9],
        chart: u32,
        x: u32,
        y: u32,
        /// 1 if it has a movable node.
        is_active: u32,
        /// The block of the next coarser level that holds its even nodes.
        parent: u32,
        /// The blocks of the next finer level over its quarters.
        children: [u32; 4],
        /// Its chart's blocks here, sorted by y, then x.
        chart_first: u32,
        chart_count: u32,
        /// Bits: 1 if the chart goes on below what is held here, 2 if above.
        continues: u32,
    }

    /// A triangle: its UVs, in cells from its first corner, and its pose.
    pub struct Triangle {
        corner: [f32; 2],
        /// Rows of the matrix that takes an offset to the barycentrics of corners 1 and 2.
        barycentric: [f32; 4],
        /// Across the edge opposite to each corner, or NONE.
        neighbours: [u32; 3],
        chart: u32,
        /// Position at the first corner, df/dx, df/dy.
        pose: [f32; 9],
    }

    /// A block of one of the coarse levels that one kernel does; places are in their common buffers.
    pub struct CoarseBlock {
        active_neighbours: [u32; 9],
        parent: u32,
        children: [u32; 4],
        /// Colour of the block, which is also its quarter of the parent.
        colour: u32,
        /// A bit per slot.
        fixed: [u32; 8],
    }

    /// What `invert` is asked for.
    pub struct Request {
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
        texels: [f32; 2] as "vec2f",
    }
}

#[cfg(test)]
mod tests;
