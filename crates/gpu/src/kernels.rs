//! The table of compute kernels: entry point, shader files, bindings and bytes moved of each.

use vrtm_core::allocation::Collect;

/// One binding of a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Binding {
    /// The dispatch's parameters, at a dynamic offset.
    Params,
    /// A storage buffer that the kernel only reads.
    Read(u32),
    /// A storage buffer that the kernel may write.
    Write(u32),
}

impl Binding {
    /// The number of the binding in the shaders.
    pub fn number(self) -> u32 {
        match self {
            Binding::Params => 0,
            Binding::Read(n) | Binding::Write(n) => n,
        }
    }
}

/// Numbers of the bindings that have the same meaning in all shaders.
pub mod slot {
    pub const CHARTS: u32 = 1;
    pub const BLOCKS: u32 = 2;
    pub const LISTS: u32 = 3;
    pub const NODES: u32 = 4;
    pub const STATE: u32 = 5;
    /// Triangles on level 0, metrics on coarser levels.
    pub const SURFACE: u32 = 6;
    pub const ROWS: u32 = 7;
    pub const VECTORS: u32 = 8;
    pub const PARTIALS: u32 = 9;
    /// The first number of a kernel's extra buffers, which differ from kernel to kernel.
    pub const EXTRA: u32 = 10;
}

/// A kernel. Kernels that sample the surface come in two versions: chords for level 0, metrics for coarser levels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kernel {
    Surface,
    PyramidGather,
    PyramidRestrict,
    Protect,
    ProtectFinest,
    IdentityChords,
    IdentityMetrics,
    Previous,
    ProlongChords,
    ProlongMetrics,
    StepChords,
    StepMetrics,
    RelaxChords,
    RelaxMetrics,
    EnergyChords,
    EnergyMetrics,
    AssembleChords,
    AssembleMetrics,
    Pull,
    Galerkin,
    GalerkinTogether,
    MultigridDown,
    MultigridUp,
    MultigridCoarse,
    Product,
    Curvature,
    FirstFractions,
    Falloff,
    Shrink,
    ProjectChords,
    ProjectMetrics,
    RegulariseChords,
    RegulariseMetrics,
    CopyState,
    Decide,
    SelectCharts,
    Gate,
    Certify,
    FallBack,
    SamplesChords,
    SamplesMetrics,
    Invert,
    Redirect,
}

/// The source of a kernel.
#[derive(Debug)]
pub struct Source {
    pub kernel: Kernel,
    pub entry: &'static str,
    /// Files in `shaders/` that follow `generated` and `common`.
    pub parts: &'static [&'static str],
    pub bindings: &'static [Binding],
    /// The least number of bytes moved per node, counting each datum once, except for what is counted per triangle.
    pub bytes_per_node: u32,
}

use Binding::{Params as P, Read as R, Write as W};
use slot::*;

/// The files of kernels that sample the surface on level 0, and the file for coarser levels.
const CHORDS: [&str; 2] = ["sampling/triangle", "sampling/chords"];
const METRICS: &str = "sampling/metrics";

macro_rules! source {
    ($kernel:ident, $entry:literal, [$($part:expr),*], [$($binding:expr),*], $bytes:literal) => {
        Source {
            kernel: Kernel::$kernel,
            entry: $entry,
            parts: &[$($part),*],
            bindings: &[P, W(CHARTS), $($binding),*],
            bytes_per_node: $bytes,
        }
    };
}

/// All kernels, in the order of the stages.
#[rustfmt::skip]
pub const SOURCES: [Source; 43] = [
    source!(Surface, "surface", [CHORDS[0], "surface"], [W(SURFACE), R(EXTRA), R(EXTRA + 1)], 0),
    source!(PyramidGather, "pyramid_gather", [CHORDS[0], "pyramid_gather"],
        [R(BLOCKS), R(LISTS), W(SURFACE), R(EXTRA), R(EXTRA + 1), W(EXTRA + 2)], 24),
    source!(PyramidRestrict, "pyramid_restrict", [METRICS, "pyramid_restrict"],
        [R(BLOCKS), R(LISTS), W(SURFACE), R(EXTRA), R(EXTRA + 1), R(EXTRA + 2)], 76),
    source!(Protect, "protect", [METRICS, "protect"], [R(BLOCKS), R(LISTS), W(SURFACE), W(EXTRA)], 72),
    source!(ProtectFinest, "protect_finest", ["protect_finest"],
        [R(BLOCKS), R(LISTS), W(EXTRA), R(EXTRA + 1), R(EXTRA + 2)], 12),
    source!(IdentityChords, "identity", [CHORDS[0], CHORDS[1], "sampling/resample"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE)], 20),
    source!(IdentityMetrics, "identity", [METRICS, "sampling/resample"],
        [R(BLOCKS), R(LISTS), W(STATE)], 8),
    source!(Previous, "previous", [CHORDS[0], CHORDS[1], "sampling/resample"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)], 28),
    source!(ProlongChords, "prolong", [CHORDS[0], CHORDS[1], "sampling/resample", "prolong"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA), R(EXTRA + 1)], 22),
    source!(ProlongMetrics, "prolong", [METRICS, "sampling/resample", "prolong"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), R(EXTRA), R(EXTRA + 1)], 14),
    source!(StepChords, "step", [CHORDS[0], CHORDS[1], "sampling/resample", "correct/step_vector", "correct/step"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(VECTORS)], 64),
    source!(StepMetrics, "step", [METRICS, "sampling/resample", "correct/step_vector", "correct/step"],
        [R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)], 52),
    source!(RelaxChords, "relax", [CHORDS[0], CHORDS[1], "patch", "slopes", "terms", "pull", "relax"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)], 36),
    source!(RelaxMetrics, "relax", [METRICS, "patch", "slopes", "terms", "pull", "relax"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)], 40),
    source!(EnergyChords, "energy", [CHORDS[0], CHORDS[1], "patch", "terms", "pull", "shared_energy", "energy"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(PARTIALS), R(EXTRA)], 24),
    source!(EnergyMetrics, "energy", [METRICS, "patch", "terms", "pull", "shared_energy", "energy"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(PARTIALS), R(EXTRA)], 32),
    source!(AssembleChords, "assemble", [CHORDS[0], CHORDS[1], "patch", "slopes", "terms", "shared_energy", "correct/assemble"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(ROWS), W(VECTORS)], 76),
    source!(AssembleMetrics, "assemble", [METRICS, "patch", "slopes", "terms", "shared_energy", "correct/assemble"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(ROWS), W(VECTORS)], 84),
    source!(Pull, "pull", [CHORDS[0], CHORDS[1], "patch", "pull", "correct/pull"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(VECTORS), R(EXTRA)], 48),
    source!(Galerkin, "galerkin", ["correct/rows_apart", "correct/galerkin"],
        [R(BLOCKS), R(LISTS), R(NODES), W(ROWS), R(EXTRA), R(EXTRA + 1)], 224),
    source!(GalerkinTogether, "galerkin", ["correct/rows_together", "correct/galerkin"],
        [R(BLOCKS), R(LISTS), R(NODES), W(ROWS), R(EXTRA)], 224),
    source!(MultigridDown, "multigrid_down", ["correct/node_row", "correct/multigrid", "correct/restrict", "correct/arrive", "correct/multigrid_down"],
        [R(BLOCKS), R(LISTS), R(NODES), W(ROWS), W(VECTORS), R(EXTRA), W(EXTRA + 1)], 68),
    source!(MultigridUp, "multigrid_up", ["partial_sum", "correct/node_row", "correct/multigrid", "correct/multigrid_up"],
        [R(BLOCKS), R(LISTS), R(NODES), W(ROWS), W(VECTORS), W(PARTIALS), R(EXTRA)], 79),
    source!(MultigridCoarse, "multigrid_coarse", ["correct/step_length", "correct/node_row", "correct/arrive", "correct/multigrid_coarse"],
        [W(ROWS), W(VECTORS), R(EXTRA), R(EXTRA + 1), R(EXTRA + 2)], 0),
    source!(Product, "product", ["partial_sum", "correct/node_row", "correct/multigrid", "correct/restrict", "correct/conjugate_gradients"],
        [R(BLOCKS), R(LISTS), W(ROWS), W(VECTORS), W(PARTIALS), W(EXTRA + 1)], 64),
    source!(Curvature, "curvature", ["partial_sum", "correct/node_row", "correct/multigrid", "correct/restrict", "correct/conjugate_gradients"],
        [R(BLOCKS), R(LISTS), W(ROWS), W(VECTORS), W(PARTIALS)], 52),
    source!(FirstFractions, "first_fractions", ["correct/step_vector", "correct/step_limit", "correct/first_fractions"],
        [R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)], 28),
    source!(Falloff, "falloff", ["correct/falloff"], [R(BLOCKS), R(LISTS), W(VECTORS)], 16),
    source!(Shrink, "shrink", ["correct/step_vector", "correct/step_limit", "correct/shrink"],
        [R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)], 32),
    source!(ProjectChords, "project", [CHORDS[0], CHORDS[1], "pbd/state", "pbd/moves", "pbd/project"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 32),
    source!(ProjectMetrics, "project", [METRICS, "pbd/state", "pbd/moves", "pbd/project"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 36),
    source!(RegulariseChords, "regularise", [CHORDS[0], CHORDS[1], "pbd/state", "pbd/moves", "pbd/regularise"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 44),
    source!(RegulariseMetrics, "regularise", [METRICS, "pbd/state", "pbd/moves", "pbd/regularise"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 36),
    source!(CopyState, "copy_state", ["pbd/state", "pbd/copy"], [R(BLOCKS), R(LISTS), W(STATE), W(EXTRA)], 16),
    source!(Decide, "decide", ["correct/step_length", "correct/control"], [W(PARTIALS), R(EXTRA)], 0),
    source!(SelectCharts, "select_charts", ["correct/step_length", "correct/control"], [], 0),
    source!(Gate, "gate", ["correct/gate"], [R(EXTRA), W(EXTRA + 1), W(EXTRA + 2)], 0),
    source!(Certify, "certify", ["certify"], [R(BLOCKS), R(LISTS), W(STATE), W(PARTIALS)], 8),
    source!(FallBack, "fall_back", ["certify"], [R(BLOCKS), R(LISTS), W(STATE)], 0),
    // These kernels belong to no stage of a solve.
    source!(SamplesChords, "samples", [CHORDS[0], CHORDS[1], "sampling/samples"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 0),
    source!(SamplesMetrics, "samples", [METRICS, "sampling/samples"],
        [R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)], 0),
    // These kernels belong to no solve, and bind neither parameters nor charts.
    Source {
        kernel: Kernel::Invert,
        entry: "invert",
        parts: &["invert"],
        bindings: &[R(BLOCKS), R(EXTRA), R(EXTRA + 1), R(EXTRA + 2), W(EXTRA + 3)],
        bytes_per_node: 8,
    },
    Source {
        kernel: Kernel::Redirect,
        entry: "redirect",
        parts: &["redirect"],
        bindings: &[R(EXTRA), R(EXTRA + 1), R(EXTRA + 2), W(EXTRA + 3)],
        bytes_per_node: 0,
    },
];

impl Kernel {
    /// The source of the kernel.
    pub fn source(self) -> &'static Source {
        const { assert!(SOURCES.len() == Kernel::Redirect as usize + 1) };
        let source = &SOURCES[self as usize];
        debug_assert_eq!(source.kernel, self);
        source
    }

    /// Bytes of a triangle's record that the kernel reads. All nodes on a triangle share its record, which stays in the
    /// cache, so it counts once per dispatch over all of the triangles' blocks.
    pub fn bytes_per_triangle(self) -> u32 {
        /// What a walk reads: corner, rows of the inverse edge matrix, neighbours.
        const WALK: u32 = 8 + 16 + 12;
        /// The pose: position and tangents.
        const POSE: u32 = 36;
        match self {
            Kernel::PyramidGather => 24,
            // These kernels also read the chart.
            Kernel::IdentityChords | Kernel::Previous | Kernel::ProlongChords | Kernel::StepChords => {
                WALK + 4
            }
            Kernel::EnergyChords | Kernel::AssembleChords | Kernel::Pull => 8 + POSE,
            Kernel::RelaxChords | Kernel::ProjectChords => WALK + POSE,
            Kernel::RegulariseChords => WALK,
            _ => 0,
        }
    }
}

impl Source {
    /// The complete WGSL source.
    pub fn text(&self) -> String {
        ["generated", "common"].into_iter().chain(self.parts.iter().copied()).map(part).collected().join("\n")
    }
}

/// The content of a file in `shaders/`.
fn part(name: &str) -> &'static str {
    macro_rules! files {
        ($($name:literal),*) => {
            match name {
                $($name => include_str!(concat!("../../../shaders/", $name, ".wgsl")),)*
                _ => "",
            }
        };
    }
    files!(
        "generated",
        "common",
        "surface",
        "pyramid_gather",
        "pyramid_restrict",
        "protect",
        "protect_finest",
        "sampling/triangle",
        "sampling/chords",
        "sampling/metrics",
        "sampling/resample",
        "sampling/samples",
        "prolong",
        "patch",
        "slopes",
        "terms",
        "pull",
        "relax",
        "energy",
        "shared_energy",
        "correct/assemble",
        "correct/pull",
        "correct/rows_apart",
        "correct/rows_together",
        "correct/galerkin",
        "partial_sum",
        "correct/node_row",
        "correct/multigrid",
        "correct/restrict",
        "correct/arrive",
        "correct/step_length",
        "correct/step_vector",
        "correct/step",
        "correct/multigrid_down",
        "correct/multigrid_up",
        "correct/multigrid_coarse",
        "correct/conjugate_gradients",
        "correct/step_limit",
        "correct/first_fractions",
        "correct/falloff",
        "correct/shrink",
        "correct/control",
        "correct/gate",
        "pbd/state",
        "pbd/moves",
        "pbd/project",
        "pbd/regularise",
        "pbd/copy",
        "certify",
        "invert",
        "redirect"
    )
}
