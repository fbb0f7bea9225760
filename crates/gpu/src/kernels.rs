//! The table of compute kernels: entry point, shader files, bindings and bytes moved of each.

use super::layout;
use vrtm_shaders::text;

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

/// The source of a kernel.
#[derive(Clone, Debug)]
pub struct Source {
    pub kernel: Kernel,
    pub entry: &'static str,
    /// Files in `shaders/` that follow `common`.
    pub parts: &'static [&'static str],
    /// The contents of these files.
    texts: &'static [&'static str],
    pub bindings: &'static [Binding],
    /// The least number of bytes moved per node, counting each datum once, except for what is counted per triangle.
    pub bytes_per_node: u32,
}

use Binding::{Params as P, Read as R, Write as W};
use slot::*;

macro_rules! kernels {
    ($($kernel:ident $entry:literal [$($part:literal),*] [$($binding:expr),*] $bytes:literal;)*) => {
        /// A kernel. Those that sample the surface come in two versions: chords for level 0, metrics for coarser
        /// levels.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Kernel {
            $($kernel,)*
        }

        /// All kernels, in the order of the stages.
        pub const SOURCES: [Source; [$($entry),*].len()] = [$(Source {
            kernel: Kernel::$kernel,
            entry: $entry,
            parts: &[$($part),*],
            texts: &[$(text($part)),*],
            bindings: &[$($binding),*],
            bytes_per_node: $bytes,
        }),*];
    };
}

// Entry point, files in `shaders/` that follow `common`, bindings, and bytes per node.
kernels! {
    Surface "surface" ["sampling/triangle", "surface"] [P, W(CHARTS), W(SURFACE), R(EXTRA), R(EXTRA + 1)] 0;
    PyramidGather "pyramid_gather" ["sampling/triangle", "pyramid_gather"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(SURFACE), R(EXTRA), R(EXTRA + 1), W(EXTRA + 2)] 24;
    PyramidRestrict "pyramid_restrict" ["sampling/metrics", "pyramid_restrict"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(SURFACE), R(EXTRA), R(EXTRA + 1), R(EXTRA + 2)] 76;
    IdentityChords "identity" ["sampling/triangle", "sampling/chords", "sampling/resample"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE)] 20;
    IdentityMetrics "identity" ["sampling/metrics", "sampling/resample"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE)] 8;
    Previous "previous" ["sampling/triangle", "sampling/chords", "sampling/resample"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)] 28;
    ProlongChords "prolong" ["sampling/triangle", "sampling/chords", "sampling/resample", "prolong"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA), R(EXTRA + 1)] 22;
    ProlongMetrics "prolong" ["sampling/metrics", "sampling/resample", "prolong"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), R(EXTRA), R(EXTRA + 1)] 14;
    SquaresChords "sum_squares" ["sampling/triangle", "sampling/chords", "patch", "harm/features", "harm/squares"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA), W(EXTRA + 1)] 26;
    SquaresMetrics "sum_squares" ["sampling/metrics", "patch", "harm/features", "harm/squares"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA), W(EXTRA + 1)] 34;
    Multiply "multiply" ["harm/features", "harm/multiply"] [P, R(EXTRA), R(EXTRA + 1), W(EXTRA + 2)] 0;
    Weigh "weigh" ["harm/features", "harm/weigh"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(EXTRA), W(EXTRA + 1), R(EXTRA + 2)] 10;
    StepChords "step" ["sampling/triangle", "sampling/chords", "sampling/resample", "correct/step_vector",
        "correct/step"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(VECTORS)] 64;
    StepMetrics "step" ["sampling/metrics", "sampling/resample", "correct/step_vector", "correct/step"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)] 52;
    RelaxChords "relax" ["sampling/triangle", "sampling/chords", "patch", "near_in_patch", "slopes", "terms", "pull", "relax_narrow", "relax"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)] 36;
    RelaxChordsWide "relax" ["sampling/triangle", "sampling/chords", "patch", "near_in_patch", "slopes", "terms", "pull", "relax_wide", "relax"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)] 36;
    RelaxMetrics "relax" ["sampling/metrics", "patch", "near_in_patch", "slopes", "terms", "pull", "relax_narrow", "relax"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)] 40;
    RelaxMetricsWide "relax" ["sampling/metrics", "patch", "near_in_patch", "slopes", "terms", "pull", "relax_wide", "relax"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), R(EXTRA)] 40;
    EnergyChords "energy" ["sampling/triangle", "sampling/chords", "patch", "terms", "pull", "shared_energy", "energy"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(PARTIALS), R(EXTRA)] 24;
    EnergyMetrics "energy" ["sampling/metrics", "patch", "terms", "pull", "shared_energy", "energy"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(PARTIALS), R(EXTRA)] 32;
    AssembleChords "assemble" ["sampling/triangle", "sampling/chords", "patch", "near_beyond", "slopes", "terms", "shared_energy",
        "correct/slopes_kept", "correct/assemble"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(ROWS), W(VECTORS)] 76;
    AssembleMetrics "assemble" ["sampling/metrics", "patch", "near_beyond", "slopes", "terms", "shared_energy",
        "correct/slopes_kept", "correct/assemble"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(ROWS), W(VECTORS)] 84;
    Pull "pull" ["sampling/triangle", "sampling/chords", "patch", "pull", "correct/pull"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(VECTORS), R(EXTRA)] 48;
    Galerkin "galerkin" ["correct/galerkin"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(ROWS), R(EXTRA), R(EXTRA + 1)] 224;
    MultigridDown "multigrid_down" ["correct/node_row", "correct/block_smoother", "correct/multigrid",
        "correct/restrict", "correct/arrive", "correct/multigrid_down"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(ROWS), W(VECTORS), R(EXTRA), W(EXTRA + 1)] 68;
    MultigridUp "multigrid_up" ["partial_sum", "correct/node_row", "correct/block_smoother", "correct/multigrid",
        "correct/multigrid_up"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(ROWS), W(VECTORS), W(PARTIALS), R(EXTRA)] 79;
    MultigridCoarsest "multigrid_coarsest" ["correct/node_row", "correct/block_smoother", "correct/multigrid",
        "correct/arrive", "correct/multigrid_coarsest"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(ROWS), W(VECTORS), R(EXTRA), R(EXTRA + 1)] 137;
    Product "product" ["partial_sum", "correct/node_row", "correct/block_smoother", "correct/multigrid",
        "correct/restrict", "correct/conjugate_gradients"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(ROWS), W(VECTORS), W(PARTIALS), W(EXTRA + 1)] 64;
    Curvature "curvature" ["partial_sum", "correct/node_row", "correct/block_smoother", "correct/multigrid",
        "correct/restrict", "correct/conjugate_gradients"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(ROWS), W(VECTORS), W(PARTIALS)] 52;
    FirstFractions "first_fractions" ["correct/step_vector", "correct/step_limit", "correct/first_fractions"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)] 28;
    Falloff "falloff" ["correct/falloff"] [P, W(CHARTS), R(BLOCKS), R(LISTS), W(VECTORS)] 16;
    Shrink "shrink" ["correct/step_vector", "correct/step_limit", "correct/shrink"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE), W(VECTORS)] 32;
    ProjectChords "project" ["sampling/triangle", "sampling/chords", "pbd/state", "pbd/moves", "pbd/project"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 32;
    ProjectMetrics "project" ["sampling/metrics", "pbd/state", "pbd/moves", "pbd/project"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 36;
    RegulariseChords "regularise" ["sampling/triangle", "sampling/chords", "pbd/state", "pbd/moves", "pbd/regularise"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 44;
    RegulariseMetrics "regularise" ["sampling/metrics", "pbd/state", "pbd/moves", "pbd/regularise"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 36;
    CopyState "copy_state" ["pbd/state", "pbd/copy"] [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE), W(EXTRA)] 16;
    Decide "decide" ["correct/step_length", "correct/control"] [P, W(CHARTS), W(PARTIALS), R(EXTRA)] 0;
    SelectCharts "select_charts" ["correct/step_length", "correct/control"] [P, W(CHARTS)] 0;
    Gate "gate" ["correct/gate"] [P, W(CHARTS), R(EXTRA), W(EXTRA + 1), W(EXTRA + 2)] 0;
    Certify "certify" ["certify"] [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE), W(PARTIALS)] 8;
    FallBack "fall_back" ["certify"] [P, W(CHARTS), R(BLOCKS), R(LISTS), W(STATE)] 0;
    // These kernels belong to no stage of a solve.
    SamplesChords "samples" ["sampling/triangle", "sampling/chords", "sampling/samples"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 0;
    SamplesMetrics "samples" ["sampling/metrics", "sampling/samples"]
        [P, W(CHARTS), R(BLOCKS), R(LISTS), R(NODES), W(STATE), W(SURFACE), W(EXTRA)] 0;
    // These kernels belong to no solve, and bind neither parameters nor charts.
    Invert "invert" ["invert"] [R(BLOCKS), R(EXTRA), R(EXTRA + 1), R(EXTRA + 2), W(EXTRA + 3)] 8;
    Redirect "redirect" ["redirect"] [R(EXTRA), R(EXTRA + 1), R(EXTRA + 2), W(EXTRA + 3)] 0;
}

impl Kernel {
    /// The source of the kernel.
    pub fn source(self) -> &'static Source {
        &SOURCES[self as usize]
    }

    /// Bytes of a triangle's record that the kernel reads. All nodes on a triangle share its record, which stays in the
    /// cache, so it counts once per dispatch over all of the triangles' blocks.
    pub fn bytes_per_triangle(self) -> u32 {
        /// Bytes that a walk reads: corner, rows of the inverse edge matrix, neighbours.
        const WALK: u32 = 8 + 16 + 12;
        /// The pose: position and tangents.
        const POSE: u32 = 36;
        match self {
            Kernel::PyramidGather => 24,
            // These kernels also read the chart.
            Kernel::IdentityChords | Kernel::Previous | Kernel::ProlongChords | Kernel::StepChords => {
                WALK + 4
            }
            Kernel::EnergyChords | Kernel::SquaresChords | Kernel::AssembleChords | Kernel::Pull => 8 + POSE,
            Kernel::RelaxChords | Kernel::RelaxChordsWide | Kernel::ProjectChords => WALK + POSE,
            Kernel::RegulariseChords => WALK,
            _ => 0,
        }
    }
}

/// Bytes of workgroup memory that some files need besides a patch, and the files that take their place on devices with
/// less.
const LARGE: u32 = 24 << 10;
const SMALL: [[&str; 2]; 2] =
    [[text("correct/slopes_kept"), text("correct/slopes_anew")], [text("relax_wide"), text("relax_narrow")]];

impl Source {
    /// The complete WGSL source, for a device with so many bytes of workgroup memory.
    pub fn text(&self, workgroup_bytes: u32) -> String {
        let small = |part| match SMALL.iter().find(|[large, _]| *large == part && workgroup_bytes < LARGE) {
            Some([_, small]) => *small,
            None => part,
        };
        let parts = [text("common")].into_iter().chain(self.texts.iter().copied());
        parts.map(small).fold(layout::text(), |all, part| all + "\n" + part)
    }
}
