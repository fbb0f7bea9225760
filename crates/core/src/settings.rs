//! The settings of a host: per device, per tile, per solve.

use std::fmt;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use crate::allocation::HostAllocator;
use crate::declare::{self, settings};
use crate::error::{Result, ensure};
use crate::log::LogFn;
use crate::team::Executor;

/// Most CPU threads per solve.
pub const MAX_THREADS: u32 = 1024;

/// Backend on which assets are solved.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// A hardware GPU, discrete before integrated; the CPU if no such GPU was found or it cannot be opened. A software
    /// driver does not count as a GPU. [`crate::report::DeviceInfo::reason`] says what was chosen and why.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// The GPU that [`DeviceSettings`] selects, even a software driver; never falls back to the CPU.
    Gpu,
}

/// An identity of a GPU that is unique in the machine and the same in every program: see
/// [`crate::report::AdapterInfo`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum AdapterId {
    /// `VkPhysicalDeviceIDProperties::deviceUUID`, for Vulkan adapters.
    Uuid([u8; 16]),
    /// The LUID of Direct3D and DXGI, in memory order; Vulkan on Windows reports it as
    /// `VkPhysicalDeviceIDProperties::deviceLUID`. A GPU that is listed through both interfaces is used through the
    /// first.
    Luid([u8; 8]),
    /// `MTLDevice.registryID`.
    Registry(u64),
}

impl AdapterId {
    /// A UUID from 32 hexadecimal digits, with hyphens anywhere.
    pub fn uuid(text: &str) -> Option<AdapterId> {
        let digits = text.chars().filter(|&c| c != '-');
        let mut bytes = [0u8; 16];
        let mut count = 0;
        for digit in digits {
            let byte = bytes.get_mut(count / 2)?;
            *byte = *byte << 4 | digit.to_digit(16)? as u8;
            count += 1;
        }
        (count == 32).then_some(AdapterId::Uuid(bytes))
    }
}

impl fmt::Display for AdapterId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, bytes) = match self {
            AdapterId::Uuid(bytes) => ("UUID", &bytes[..]),
            AdapterId::Luid(bytes) => ("LUID", &bytes[..]),
            AdapterId::Registry(number) => return write!(f, "registry ID {number}"),
        };
        write!(f, "{kind} ")?;
        for (k, byte) in bytes.iter().enumerate() {
            // Hyphens where UUIDs conventionally have them.
            let hyphen = if bytes.len() == 16 && [4, 6, 8, 10].contains(&k) { "-" } else { "" };
            write!(f, "{hyphen}{byte:02x}")?;
        }
        Ok(())
    }
}

/// Settings of a new device. The default is: choose the backend, all cores, no budget, no log.
#[derive(Clone, Default)]
pub struct DeviceSettings {
    /// The backend.
    pub backend: Backend,
    /// Number of the adapter, for [`Backend::Gpu`]: its place in `adapters`.
    pub adapter: u32,
    /// The adapter's identity instead of its number, such as that of the GPU that the host draws with. [`Backend::Gpu`]
    /// requires it to exist; [`Backend::Auto`] uses it if it is usable hardware, and the CPU otherwise. `None` = by
    /// number.
    pub adapter_id: Option<AdapterId>,
    /// CPU threads per solve, at most 1024; `None` = one per core.
    pub threads: Option<NonZeroU32>,
    /// Most bytes that the tiles of all assets of the device may hold together between calls: maps, grids, solvers,
    /// results, and carriers with the poses that they follow; `None` = no limit.
    pub memory_budget: Option<u64>,
    /// Receiver of the log's lines; `None` = none.
    pub log: Option<LogFn>,
    /// The host's threads, on which solves and fetches work instead of the library's own, with bit-identical results;
    /// `None` = the library's own, which end with each call.
    pub executor: Option<Arc<dyn Executor>>,
    /// The host's allocator; `None` = the system's.
    pub allocator: Option<HostAllocator>,
}

impl fmt::Debug for DeviceSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeviceSettings")
            .field("backend", &self.backend)
            .field("adapter", &self.adapter)
            .field("adapter_id", &self.adapter_id)
            .field("threads", &self.threads)
            .field("memory_budget", &self.memory_budget)
            .field("log", &self.log.is_some())
            .field("executor", &self.executor.is_some())
            .field("allocator", &self.allocator)
            .finish()
    }
}

/// Rule for texels that several charts of a tile share, or that a chart shares with itself. With
/// [`crate::mesh::MeshSource::max_layers`] over 1, charts share texels only where these layers do not suffice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlap {
    /// Shared texels do not move, so that nothing gets worse.
    #[default]
    Fixed,
    /// The chart with the first face moves them: for mirrored halves that deform alike.
    FirstFace,
}

/// Treatment of seams, where the surface continues beyond a chart's border elsewhere in the UV plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Seams {
    /// Nothing moves at a border, and any texture will do.
    #[default]
    Shut,
    /// Each chart is solved together with the surface beyond its seams, laid out in its own plane up to
    /// [`TileSettings::seam_reach`]. Redirections near a seam then lead over the border of the chart: the texture must
    /// show that surface there, as [`Tile::fetch_dilation`] with at least the same reach writes it. Open borders,
    /// and charts that overlap in a layer, stay as with [`Seams::Shut`]. Tiles that are solved in one call are brought
    /// together at their seams.
    Continue,
    /// As [`Seams::Shut`], but a rigid feature that touches a border of its chart (with [`OpenBorders::Slide`]: a seam)
    /// keeps its place as a whole, and its elastic surroundings give way. A feature is a connected region of nodes with
    /// a rigidity of at least 0.5. Any texture will do.
    Keep,
}

/// Treatment of open borders, beyond which the surface ends: along an edge that only one face with texture has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OpenBorders {
    /// Nothing moves at an open border. The surface may continue in another mesh, as a head's neck does.
    #[default]
    Fixed,
    /// Texture slides along open borders, as if the surface were mirrored there, so that a feature at a border keeps
    /// its shape; any texture will do. Corners of more than 50 degrees stay in place, and so do ends of a chart's seam
    /// with itself. Unwelded edges count as open borders, and so do edges between faces of different sizes and edges
    /// beside faces without texture.
    Slide,
}

/// Borders beyond which charts continue, and the reach in UV.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    pub seams: bool,
    pub open_borders: bool,
    pub reach: f64,
}

settings! {
    /// A tile's settings. All have a working default; a change rebuilds only what depends on it.
    pub struct TileSettings in "settings" {
        /// Cells of the grid in u and v: the resolution of the solve. `None` = as many as resolve the rigid features,
        /// 20 across the narrowest (method §1): 64 to 4096, and no finer than the rigidity map and 256, or than an
        /// equal share of the device's memory budget and a GPU's buffers allow. Other numbers are rounded up to a
        /// multiple of 16, at most 16384.
        pub grid: [Option<u32>; 2] = [None; 2];
        /// Who owns overlapped texels.
        pub overlap: Overlap = Overlap::Fixed;
        /// Smoothness of elastic material against the stiffness 1 of rigid material. Lower values keep the shape of
        /// rigid features better, and make material of low rigidity more rigid.
        pub smoothness: f32 = 0.02, 0.0 to 1e6;
        /// Smoothness of all material, which keeps every node's problem well-posed.
        pub smoothness_floor: f32 = 0.0005, 1e-6 to 1e6;
        /// Weight that keeps rigid features from turning (the paper's section 4.2).
        pub orientation: f32 = 0.0, 0.0 to 1e6;
        /// Addition to `orientation` where rigid features are dense, times that density (the mean rigidity, 0..1, over
        /// a tent of half of the tile; the heuristic of the paper's figure 5). Sparse features then turn to keep their
        /// shape, and dense ones keep their orientation. [`Solver::Pbd`] adds it to the fraction of its turn that a
        /// segment takes back.
        pub orientation_density: f32 = 0.0, 0.0 to 1e6;
        /// Weight of the penalty on cells that lose their area.
        pub room: f32 = 0.3, 0.0 to 1e6;
        /// Fraction of a cell's area under which that penalty starts: a threshold of its corner Jacobians.
        pub room_threshold: f32 = 0.4, 0.0 to 1.0;
        /// Treatment of seams. [`Seams::Continue`] goes only with an `orientation_density` of 0.
        pub seams: Seams = Seams::Shut;
        /// Reach of charts beyond their seams with [`Seams::Continue`], and beyond their open borders with
        /// [`OpenBorders::Slide`], in UV: about the size of a large rigid feature. Over 0, at most 0.5.
        pub seam_reach: f32 = 0.03125;
        /// Treatment of open borders. [`OpenBorders::Slide`] goes only with an `orientation_density` of 0.
        pub open_borders: OpenBorders = OpenBorders::Fixed;
        /// Stiffness, 0..16, that a painted feature gains where it would come out worse than without the warp. At 0
        /// all features give way alike, and in a crowd some come out worse. For [`Solver::Descent`].
        pub harm: f32 = 7.0, 0.0 to 16.0;
    }
}

impl TileSettings {
    /// Numbers that the energy depends on, but for the maps (method §4).
    #[doc(hidden)]
    #[must_use]
    pub fn weights(&self) -> [f32; 7] {
        let TileSettings { smoothness, smoothness_floor, orientation, orientation_density, .. } = *self;
        let TileSettings { room, room_threshold, harm, .. } = *self;
        [smoothness, smoothness_floor, orientation, orientation_density, room, room_threshold, harm]
    }

    /// Borders beyond which charts continue, if any.
    pub fn beyond(&self) -> Option<Beyond> {
        let seams = self.seams == Seams::Continue;
        let open_borders = self.open_borders == OpenBorders::Slide;
        (seams || open_borders).then_some(Beyond { seams, open_borders, reach: f64::from(self.seam_reach) })
    }

    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        self.check_limits()?;
        let reach = self.seam_reach;
        let can_be = reach > 0.0 && reach <= MAX_SEAM_REACH;
        ensure!(can_be, "settings.seam_reach: {reach} is not over 0 and at most 0.5");
        if let Some(beyond) = self.beyond() {
            let name = if beyond.seams { "seams" } else { "open_borders" };
            let message = "charts cannot go on beyond their borders with settings.orientation_density over 0";
            let has_densities = self.orientation_density > 0.0;
            ensure!(!has_densities, "settings.{name}: {message}");
        }
        for (side, n) in ["width", "height"].into_iter().zip(self.grid) {
            let Some(n) = n else { continue };
            let can_be = (1..=MAX_GRID).contains(&n);
            ensure!(can_be, "settings.grid: a {side} of {n} cells is not between 1 and {MAX_GRID}");
        }
        Ok(())
    }
}

/// The farthest that charts go on beyond seams, in UV.
pub const MAX_SEAM_REACH: f32 = 0.5;

/// Most cells on a side of a tile's grid.
pub const MAX_GRID: u32 = 16384;

/// Amount of work of a solve on each level of its grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quality {
    /// A preview: one correction on each level up to the one before the finest, so that the warp has half as many cells
    /// along each axis. With [`SolveOptions::warm`], relaxation of the last result on the finest level.
    Draft,
    /// One correction on each level; on the finest, up to four for crowded charts, while they gain 0.3 % of the chart's
    /// energy.
    #[default]
    Normal,
}

/// Method by which a solve finds its warp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Solver {
    /// Gauss-Newton corrections and relaxation, which never folds.
    #[default]
    Descent,
    /// The solver of the paper that the library follows: position-based dynamics on a hierarchy of grids (its section
    /// 4). For comparison: its result is returned unchecked, and may fold ([`crate::report::TileReport::folds`]) or be
    /// worse than the mesh's own UVs. Where it folds, a texel has several possible lookups and gets one of them. Nodes
    /// may leave their charts, and even the tile, by 0.08 of its side in the worst pose tested. Redirections stay
    /// within the tile.
    Pbd,
}

/// The size that rigid features have in a pose.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Features keep their size at rest, in the units of the positions: for a body that inflates or swells.
    #[default]
    Keep,
    /// Features grow and shrink with the pose as a whole: rest lengths are multiplied by the pose's median stretch
    /// ([`crate::report::AssetReport::scale`]). For a character under a scale control, and for poses in other units.
    Follow,
}

// Method §10 gives the measurements behind the defaults, method §5 those of `temporal_weight`.
settings! {
    /// Settings of [`Solver::Pbd`], with the paper's names.
    pub struct PbdSettings in "options.pbd" {
        /// Iterations on each level of the grid. Each projects all constraints once; every fourth is followed by a
        /// regularisation.
        pub iterations: u32 = 16, 1 to 1024;
        /// Fraction of its velocity that a node loses from one regularisation to the next. Without forces the time step
        /// cancels out, so it is not a setting.
        pub damping: f32 = 0.0, 0.0 to 1.0;
        /// Fraction of its turn that a segment takes back after its projection.
        pub orientation_preservation: f32 = 0.0, 0.0 to 1.0;
        /// Smoothing of as-rigid-as-possible material (eq. 4).
        pub smoothing: f32 = 0.8, 0.0 to 1.0;
        /// Factor on the corrections of each level over those of the next finer one.
        pub coarse_correction: f32 = 0.7, 0.0 to 1.0;
    }
}

settings! {
    /// Options of one solve.
    pub struct SolveOptions in "options" {
        /// Amount of work of a solve. [`Solver::Pbd`] ignores this, `max_corrections` and `tolerance`, unchecked.
        pub quality: Quality = Quality::Normal;
        /// Maximum corrections on the finest level, 1..64, in place of the quality's limit; `None` = the quality's own.
        /// With more than four, a sweep more follows each, and a chart continues until one gains less than 0.01 %, or
        /// `tolerance`: seven lower the energy by 0.3 % in the mean, for up to twice the time, and make some crowded
        /// charts rougher over the pose.
        pub max_corrections: Option<u32> = None;
        /// A chart is done when a correction gains less than this fraction of its energy (to which 6 % of the energy of
        /// the original UVs is added), or when a level's first correction gains what its quadratic model predicts to a
        /// quarter of that fraction; over 0 and under 1. `None` = the quality's own.
        pub tolerance: Option<f32> = None;
        /// The time after which the call begins no further level of a grid; `None` = no limit. The work that is under
        /// way is finished: one level's first step, at most half of a whole solve, then interpolation, the certificate
        /// and the seams. The coarsest levels, up to 4,096 nodes each, are always solved. The result comes from the
        /// finest level that was reached, certified, and is never worse than the identity; its report is `truncated`.
        /// A tile whose turn comes after the end, or for which the time gave nothing better than the identity, keeps
        /// its last result (`kept` and `truncated`) and is among the first in the next call. With a limit the result
        /// depends on the speed of the machine.
        pub time_budget: Option<Duration> = None;
        /// False (the default): start from the identity, so that a frame's result depends on its inputs alone. True:
        /// start from the last result, for interactive use: faster on small changes, but it depends on the order of the
        /// frames.
        pub warm: bool = false;
        /// With `warm` and [`Solver::Descent`]: how strongly the warp is pulled towards the last result, in the unit of
        /// the tile settings' smoothness; 0 = not at all. 0.03 to 0.3 is a useful range: 0.1 reduces jumps between
        /// frames to between three quarters and a fifth, and delays the warp of a steady motion by one to two frames.
        /// Without `warm` it has no effect.
        pub temporal_weight: f32 = 0.0, 0.0 to 1e6;
        /// True: also measure the strain on the mesh (in f64) and count painted features, for the tiles' reports. Slow.
        pub measure: bool = false;
        /// Method by which the warp is found.
        pub solver: Solver = Solver::Descent;
        /// Settings of [`Solver::Pbd`].
        pub pbd: PbdSettings = PbdSettings::default();
        /// The size that features have in the pose.
        pub scale: Scale = Scale::Keep;
    }
}

/// Most corrections per level, to bound the work.
const MAX_CORRECTIONS: u32 = 64;

impl SolveOptions {
    /// Checks the options that the solver uses.
    #[doc(hidden)]
    pub fn check(&self) -> Result<()> {
        if self.solver == Solver::Pbd {
            return self.pbd.check_limits();
        }
        self.check_limits()?;
        if let Some(x) = self.tolerance {
            ensure!(x > 0.0 && x < 1.0, "options.tolerance: {x} is not over 0 and under 1");
        }
        if let Some(n) = &self.max_corrections {
            declare::check("options.max_corrections", n, &(1..=MAX_CORRECTIONS))?;
        }
        Ok(())
    }
}
