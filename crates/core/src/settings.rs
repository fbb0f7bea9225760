//! The settings of a host: per device, per tile, per solve.

use std::fmt;
use std::num::NonZeroU32;
use std::sync::Arc;
use std::time::Duration;

use crate::allocation::HostAllocator;
use crate::error::{Error, Result};
use crate::team::Executor;

/// Most CPU threads per solve.
pub const MAX_THREADS: u32 = 1024;

/// Which backend a device runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// A hardware GPU if one is available, the CPU otherwise; [`crate::DeviceInfo::reason`] says why.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU; never falls back.
    Gpu,
}

/// How important a log line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum LogLevel {
    /// Something the host may want to show: clipped faces, overlaps.
    Warning,
    /// The chosen backend and device, and the reason.
    Info,
}

/// A host's log function, called on the thread that called into vrtm. The asset that the line is about is in use
/// meanwhile.
pub type LogFn = Arc<dyn Fn(LogLevel, &str) + Send + Sync>;

/// An identity of a GPU that is unique in the machine and the same in every program: see [`crate::AdapterInfo`].
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
        let bytes = match self {
            AdapterId::Uuid(bytes) => {
                f.write_str("UUID ")?;
                &bytes[..]
            }
            AdapterId::Luid(bytes) => {
                f.write_str("LUID ")?;
                &bytes[..]
            }
            AdapterId::Registry(number) => return write!(f, "registry ID {number}"),
        };
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
    /// Which backend.
    pub backend: Backend,
    /// Which adapter, for [`Backend::Gpu`]: its place in [`crate::adapters`].
    pub adapter: u32,
    /// The adapter's identity instead of its number, such as that of the GPU that the host draws with. [`Backend::Gpu`]
    /// requires it to exist; [`Backend::Auto`] uses it if it is usable hardware, and the CPU otherwise. `None` = by
    /// number.
    pub adapter_id: Option<AdapterId>,
    /// CPU threads per solve, at most 1024; `None` = one per core.
    pub threads: Option<NonZeroU32>,
    /// Most bytes that the tiles of all assets of the device may hold together between calls: maps, grids, solvers,
    /// results; `None` = no limit.
    pub memory_budget: Option<u64>,
    /// Where warnings go; `None` = nowhere.
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

/// Ownership of texels shared by faces of different charts, or by two layers of one chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlap {
    /// Shared texels do not move, so nothing gets worse.
    #[default]
    Fixed,
    /// The chart with the first face owns them: for mirrored halves that deform alike.
    FirstFace,
}

/// What happens where the surface goes on beyond a chart's border, elsewhere in the UV plane.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Seams {
    /// Nothing moves at a border. Any texture will do.
    #[default]
    Shut,
    /// Each chart is solved together with what lies beyond its seams, laid out in its own plane up to
    /// [`TileSettings::seam_reach`]. Redirections near a seam then lead over the border of the chart: the texture must show
    /// there what lies beyond it, as [`crate::Results::fetch_dilation`] of at least the same reach says. Open borders, and
    /// charts that lie over one another, stay as they are with [`Seams::Shut`]. Tiles that are solved in one call are brought
    /// together at their seams.
    Continue,
    /// As `Shut`, but rigid features that touch a border of their chart (with [`OpenBorders::Slide`]: a seam) stay as they were,
    /// whole, and their elastic surroundings give way: never half of a feature. A feature is what hangs together of nodes with a rigidity of at least 0.5. Any
    /// texture will do.
    Keep,
}

/// What happens at a border of a chart beyond which the surface ends: along an edge that only one face with
/// texture has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OpenBorders {
    /// Nothing moves at an open border. The surface may go on in a mesh that is not known here, as a head's neck does.
    #[default]
    Fixed,
    /// Texture slides along open borders, as if the surface were mirrored there, so that a feature at a border keeps its shape.
    /// Corners of more than 50 degrees stay where they are, and so do ends of a chart's seam with itself. Edges whose
    /// vertices are not welded, those at which faces of other sizes meet, and those beyond which faces have no texture, look
    /// like open borders.
    Slide,
}

/// What charts go on beyond, and how far in UV.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beyond {
    pub seams: bool,
    pub open_borders: bool,
    pub reach: f64,
}

/// A tile's settings. All have a working default; a change rebuilds only what depends on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileSettings {
    /// Cells of the grid in u and v, 1..=16384, rounded up to a multiple of 16; `None` = the rigidity map's size.
    pub grid: [Option<u32>; 2],
    /// Smoothness λ of elastic material against the stiffness 1 of rigid material, >= 0. A lower value lets rigid
    /// features keep their shape better where elastic material has to give way, and makes material of low rigidity more
    /// rigid: the ratio of R to λ (1 - R) matters.
    pub smoothness: f32,
    /// Smoothness λ0 of all material, > 0: keeps every node's problem well-posed.
    pub smoothness_floor: f32,
    /// Orientation preservation κ, >= 0 (the paper's section 4.2).
    pub orientation: f32,
    /// Extra orientation preservation where rigid material is dense, >= 0 (the heuristic of the paper's figure 5): a node
    /// has κ = `orientation` + this times the density around it, 0..1, which is the mean rigidity over a tent of half of
    /// the tile. For [`Solver::Pbd`] it is added to the fraction that a segment turns back.
    pub orientation_density: f32,
    /// Room β, >= 0: weight of the penalty on cells that lose their area.
    pub room: f32,
    /// Room threshold τ, 0..1: the corner Jacobian under which the penalty starts.
    pub room_threshold: f32,
    /// Protection, 0..1: how far features that the pose does not strain come before those that it strains. At 0 each gives
    /// way alike, and a feature beside much strained ones may come out worse than without the warp; the higher this is, the
    /// fewer do, and the others keep a little more strain. For [`Solver::Descent`].
    pub protect: f32,
    /// Who owns overlapped texels.
    pub overlap: Overlap,
    /// What happens at seams.
    pub seams: Seams,
    /// How far charts go on beyond their seams and open borders, in UV, over 0 and at most 0.5; about the size of a large
    /// rigid feature. For [`Seams::Continue`] and [`OpenBorders::Slide`].
    pub seam_reach: f32,
    /// What happens at open borders.
    pub open_borders: OpenBorders,
}

impl Default for TileSettings {
    fn default() -> Self {
        TileSettings {
            grid: [None; 2],
            smoothness: 0.02,
            smoothness_floor: 0.0005,
            orientation: 0.0,
            orientation_density: 0.0,
            room: 0.3,
            room_threshold: 0.4,
            protect: 0.0,
            overlap: Overlap::Fixed,
            seams: Seams::Shut,
            seam_reach: 1.0 / 32.0,
            open_borders: OpenBorders::Fixed,
        }
    }
}

impl TileSettings {
    /// What charts go on beyond, if anything.
    pub fn beyond(&self) -> Option<Beyond> {
        let seams = self.seams == Seams::Continue;
        let open_borders = self.open_borders == OpenBorders::Slide;
        (seams || open_borders).then_some(Beyond { seams, open_borders, reach: f64::from(self.seam_reach) })
    }

    pub fn check(&self) -> Result<()> {
        let bad = |name: &str, value: f32, range: &str| {
            Err(Error::argument(format!("settings.{name}: {value} is not {range}")))
        };
        let not_negative = |v: f32| (0.0..=1e6).contains(&v);
        if !not_negative(self.smoothness) {
            return bad("smoothness", self.smoothness, "in 0..1e6");
        }
        if !(1e-6..=1e6).contains(&self.smoothness_floor) {
            return bad("smoothness_floor", self.smoothness_floor, "in 1e-6..1e6");
        }
        if !not_negative(self.orientation) {
            return bad("orientation", self.orientation, "in 0..1e6");
        }
        if !not_negative(self.orientation_density) {
            return bad("orientation_density", self.orientation_density, "in 0..1e6");
        }
        if !not_negative(self.room) {
            return bad("room", self.room, "in 0..1e6");
        }
        if !(0.0..=1.0).contains(&self.room_threshold) {
            return bad("room_threshold", self.room_threshold, "in 0..1");
        }
        if !(0.0..=1.0).contains(&self.protect) {
            return bad("protect", self.protect, "in 0..1");
        }
        if !(self.seam_reach > 0.0 && self.seam_reach <= MAX_SEAM_REACH) {
            return bad("seam_reach", self.seam_reach, "over 0 and at most 0.5");
        }
        if let Some(beyond) = self.beyond()
            && self.orientation_density > 0.0
        {
            let name = if beyond.seams { "seams" } else { "open_borders" };
            let message = "charts cannot go on beyond their borders with settings.orientation_density over 0";
            return Err(Error::argument(format!("settings.{name}: {message}")));
        }
        for (side, n) in ["width", "height"].into_iter().zip(self.grid) {
            if let Some(n) = n.filter(|n| !(1..=MAX_GRID).contains(n)) {
                let message = format!("settings.grid: a {side} of {n} cells is not in 1..={MAX_GRID}");
                return Err(Error::argument(message));
            }
        }
        Ok(())
    }
}

/// The farthest that charts go on beyond seams, in UV.
pub const MAX_SEAM_REACH: f32 = 0.5;

/// Most cells on a side of a tile's grid.
pub const MAX_GRID: u32 = 16384;

/// The amount of work per level of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Quality {
    /// A preview: one correction per level, up to the one before the finest. With [`SolveOptions::warm`], relaxation of the
    /// last result on the finest.
    Draft,
    /// One correction per level; on the finest, up to four for crowded charts, while they gain 0.3 % of the chart's
    /// energy.
    #[default]
    Normal,
    /// As `Normal` on coarser levels; on the finest, up to seven corrections, with a sweep more after each, while
    /// they gain 0.01 %.
    High,
}

/// How a solve finds its warp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Solver {
    /// Gauss-Newton corrections and relaxation: never folds.
    #[default]
    Descent,
    /// The paper's solver: position-based dynamics on a hierarchy of grids (its section 4), as a baseline. It may fold,
    /// and its result is not repaired: [`crate::TileReport::folds`] and [`crate::TileReport::min_jacobian`] report it.
    /// Nodes may leave their charts, and the tile.
    Pbd,
}

/// Settings of [`Solver::Pbd`], with the paper's names. `None` means the default.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PbdSettings {
    /// Iterations per level, 1..=1024: projections of all constraints, every fourth one followed by a regularisation.
    pub iterations: Option<u32>,
    /// Velocity damping, 0..=1: the fraction of its velocity that a node loses from one regularisation to the next.
    /// Without forces the time step cancels out, so it is not a setting.
    pub damping: Option<f32>,
    /// Orientation preservation, 0..=1: the fraction of its rotation that is undone after a segment's projection.
    pub orientation_preservation: Option<f32>,
    /// Smoothing s of eq. 4, 0..=1: how much as-rigid-as-possible material is smoothed.
    pub smoothing: Option<f32>,
    /// Ratio of the corrections of each level to those of the next finer one, 0..=1.
    pub coarse_correction: Option<f32>,
}

/// [`PbdSettings`] with every field resolved to a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PbdValues {
    pub iterations: u32,
    pub damping: f32,
    pub orientation_preservation: f32,
    pub smoothing: f32,
    pub coarse_correction: f32,
}

impl PbdValues {
    /// The defaults; method §10 gives the measurements behind them.
    const DEFAULTS: PbdValues = PbdValues {
        iterations: 16,
        damping: 0.0,
        orientation_preservation: 0.0,
        smoothing: 0.8,
        coarse_correction: 0.7,
    };
}

impl PbdSettings {
    /// The settings, with defaults for absent fields.
    pub fn resolved(&self) -> PbdValues {
        let default = PbdValues::DEFAULTS;
        let orientation_preservation = self.orientation_preservation;
        PbdValues {
            iterations: self.iterations.unwrap_or(default.iterations),
            damping: self.damping.unwrap_or(default.damping),
            orientation_preservation: orientation_preservation.unwrap_or(default.orientation_preservation),
            smoothing: self.smoothing.unwrap_or(default.smoothing),
            coarse_correction: self.coarse_correction.unwrap_or(default.coarse_correction),
        }
    }

    fn check(&self) -> Result<()> {
        if let Some(n) = self.iterations.filter(|n| !(1..=MAX_ITERATIONS).contains(n)) {
            return Err(Error::argument(format!(
                "options.pbd.iterations: {n} is not in 1..={MAX_ITERATIONS}"
            )));
        }
        for (name, value) in [
            ("damping", self.damping),
            ("orientation_preservation", self.orientation_preservation),
            ("smoothing", self.smoothing),
            ("coarse_correction", self.coarse_correction),
        ] {
            if let Some(value) = value.filter(|value| !(0.0..=1.0).contains(value)) {
                return Err(Error::argument(format!("options.pbd.{name}: {value} is not in 0..=1")));
            }
        }
        Ok(())
    }
}

/// Most iterations per level, to bound the work.
const MAX_ITERATIONS: u32 = 1024;

/// Options of one solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveOptions {
    /// The amount of work.
    pub quality: Quality,
    /// Start from the previous result instead of the identity: faster for small changes, but the result then depends on
    /// the order of frames.
    pub warm: bool,
    /// With `warm`: how strongly the warp is pulled towards the last result, 0..=1e6, in the unit of
    /// [`TileSettings::smoothness`]; 0 = not at all. 0.03 to 0.3 is a useful range: at 0.1, jumps from frame to frame
    /// shrink to between three quarters and a fifth, and the warp of a steady motion lags by one to two frames (method
    /// §5). Without `warm` it has no effect.
    pub temporal_weight: f32,
    /// Stop correcting a chart when a correction gains less than this fraction of its energy (to which 6 % of the energy
    /// with the original UVs is added), or when the gain of a level's first correction matches its quadratic model's
    /// prediction to within a quarter of that fraction; over 0 and under 1. Up to four times the former and eight times
    /// the latter, the next correction is applied in part. `None` = the quality's own.
    pub tolerance: Option<f32>,
    /// Maximum corrections per level instead of the quality's own, 1..=64; `None` = the quality's own.
    pub max_corrections: Option<u32>,
    /// The time that a call may take, not counting its fetches, measuring and the building of grids; `None` = no limit.
    /// The result is the certified result of the best level reached, or the identity if there was no time for any level.
    /// The time of the remaining work is predicted from the last solves, so that calls end within 1.2 times the budget
    /// plus 5 ms, unless the machine suddenly becomes busier. With a limit the result depends on the speed of the
    /// machine.
    pub time_budget: Option<Duration>,
    /// Also measure the strain on the mesh (slow, f64): fills [`crate::TileReport::strain`].
    pub measure: bool,
    /// How the warp is found. `quality`, `tolerance` and `max_corrections` apply to [`Solver::Descent`] only, `pbd` to
    /// [`Solver::Pbd`].
    pub solver: Solver,
    /// Settings of [`Solver::Pbd`].
    pub pbd: PbdSettings,
}

/// Most corrections per level, to bound the work.
const MAX_CORRECTIONS: u32 = 64;

/// With a larger weight, f32 has no digits left for the other terms.
const MAX_TEMPORAL_WEIGHT: f32 = 1e6;

impl SolveOptions {
    pub fn check(&self) -> Result<()> {
        if !(0.0..=MAX_TEMPORAL_WEIGHT).contains(&self.temporal_weight) {
            return Err(Error::argument(format!(
                "options.temporal_weight: {} is not in 0..=1e6",
                self.temporal_weight
            )));
        }
        if let Some(tolerance) = self.tolerance.filter(|x| !(*x > 0.0 && *x < 1.0)) {
            return Err(Error::argument(format!("options.tolerance: {tolerance} is not in 0..1")));
        }
        if let Some(n) = self.max_corrections.filter(|n| !(1..=MAX_CORRECTIONS).contains(n)) {
            return Err(Error::argument(format!(
                "options.max_corrections: {n} is not in 1..={MAX_CORRECTIONS}"
            )));
        }
        self.pbd.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn none_means_the_default() {
        assert_eq!(PbdSettings::default().resolved(), PbdValues::DEFAULTS);
        let given = PbdSettings { smoothing: Some(0.0), damping: Some(0.25), ..PbdSettings::default() };
        let resolved = PbdValues { smoothing: 0.0, damping: 0.25, ..PbdValues::DEFAULTS };
        assert_eq!(given.resolved(), resolved);
    }
}
