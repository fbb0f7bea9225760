//! What a host may set: per device, per tile, per solve.

use std::fmt;
use std::sync::Arc;

use crate::error::{Error, Result};

/// Which backend a device runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// A hardware GPU if there is one, the CPU otherwise; [`crate::DeviceInfo::reason`] says why.
    #[default]
    Auto,
    /// The CPU.
    Cpu,
    /// A GPU; never falls back.
    Gpu,
}

/// How important a log line is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogLevel {
    /// Something the host may want to show: clipped faces, overlaps.
    Warning,
    /// What was chosen and why.
    Info,
}

/// A host's log function; called on the thread that called into vrtm. The asset that the line is about is busy meanwhile.
pub type LogFn = Arc<dyn Fn(LogLevel, &str) + Send + Sync>;

/// What a device is made from. The default is: choose the backend, all cores, no budget, no log.
#[derive(Clone, Default)]
pub struct DeviceSettings {
    /// Which backend.
    pub backend: Backend,
    /// Which adapter, for [`Backend::Gpu`].
    pub adapter: u32,
    /// CPU threads per solve; 0 = one per core.
    pub threads: u32,
    /// Most bytes that the tiles of all assets of the device may hold together, while no call is under way: maps, grids,
    /// solvers, results; 0 = no limit.
    pub memory_budget: u64,
    /// Where warnings go; `None` = nowhere.
    pub log: Option<LogFn>,
}

impl fmt::Debug for DeviceSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("DeviceSettings")
            .field("backend", &self.backend)
            .field("adapter", &self.adapter)
            .field("threads", &self.threads)
            .field("memory_budget", &self.memory_budget)
            .field("log", &self.log.is_some())
            .finish()
    }
}

/// Texels that faces of different charts, or two layers of one chart, share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlap {
    /// They do not move, so nothing gets worse.
    #[default]
    Fixed,
    /// The chart with the first face owns them: for mirrored halves that deform alike.
    FirstFace,
}

/// A tile's settings. All have a working default; a change rebuilds only what depends on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TileSettings {
    /// Cells of the grid in u and v; 0 = the rigidity map's size. Rounded up to a multiple of 16, at most 16384.
    pub grid: [u32; 2],
    /// Smoothness λ of elastic material against the stiffness 1 of rigid material, >= 0. A lower one lets rigid features
    /// keep their shape better where elastic material has to give way for them, and makes material of little rigidity more
    /// rigid: what counts is R against λ (1 - R).
    pub smoothness: f32,
    /// Smoothness λ0 of all material, > 0: keeps every node's problem well-posed.
    pub smoothness_floor: f32,
    /// Orientation preservation κ, >= 0 (the paper's section 4.2).
    pub orientation: f32,
    /// How much of it is added where rigid material is dense, >= 0 (the heuristic of the paper's figure 5): a node has
    /// κ = `orientation` + this times the density around it, which is the mean rigidity over a tent of half of the tile,
    /// 0..1. For [`Solver::Pbd`] it is added to the share that a segment turns back.
    pub orientation_density: f32,
    /// Room β, >= 0: weight of the penalty on cells that lose their area.
    pub room: f32,
    /// Room threshold τ, 0..1: the corner Jacobian under which the penalty starts.
    pub room_threshold: f32,
    /// Who owns overlapped texels.
    pub overlap: Overlap,
}

impl Default for TileSettings {
    fn default() -> Self {
        TileSettings {
            grid: [0, 0],
            smoothness: 0.02,
            smoothness_floor: 0.0005,
            orientation: 0.0,
            orientation_density: 0.0,
            room: 0.3,
            room_threshold: 0.4,
            overlap: Overlap::Fixed,
        }
    }
}

impl TileSettings {
    pub(crate) fn check(&self) -> Result<()> {
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
        if self.grid.iter().any(|&n| n > MAX_GRID) {
            let [nx, ny] = self.grid;
            return Err(Error::argument(format!("settings.grid: {nx}x{ny} is over {MAX_GRID} cells a side")));
        }
        Ok(())
    }
}

/// Most cells on a side of a tile's grid.
pub const MAX_GRID: u32 = 16384;

/// How much work a solve does per level.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Quality {
    /// One correction per level, but relaxation alone on the finest.
    Draft,
    /// One correction per level; on the finest up to four where a chart is crowded, while they gain 0.3 % of its energy.
    #[default]
    Normal,
    /// As `Normal` on coarser levels; up to twelve corrections on the finest, with more sweeps, while they gain 0.01 %.
    High,
}

/// How a solve finds its warp.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Solver {
    /// Block descent with Gauss-Newton corrections: never folds.
    #[default]
    Descent,
    /// The paper's own: position-based dynamics on a hierarchy of grids (its section 4). The baseline. It may fold, and its
    /// result is what it is: [`crate::TileReport::folds`] and [`crate::TileReport::min_jacobian`] tell.
    Pbd,
}

/// Settings of [`Solver::Pbd`], with the paper's names. 0 in a field means its default, and [`PbdSettings::OFF`] in one
/// that is a share means 0.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PbdSettings {
    /// Iterations per level, 1..=1024: projections of all constraints, of which every fourth is followed by a
    /// regularisation.
    pub iterations: u32,
    /// Velocity damping, 0..=1: the share of its velocity that a node loses from one regularisation to the next. There is no time
    /// step to set: without forces it cancels out.
    pub damping: f32,
    /// Orientation preservation, 0..=1: the share of its turn that a segment takes back after its projection.
    pub orientation_preservation: f32,
    /// Smoothing s of eq. 4, 0..=1: how much as-rigid-as-possible material is smoothed.
    pub smoothing: f32,
    /// Factor on the corrections of each level over those of the next finer one, 0..=1.
    pub coarse_correction: f32,
}

impl PbdSettings {
    /// 0, in a field whose 0 means the default.
    pub const OFF: f32 = -1.0;

    /// What 0 stands for; `method/pbd.rs` has the figures that chose them.
    const DEFAULTS: PbdSettings = PbdSettings {
        iterations: 16,
        damping: 0.0,
        orientation_preservation: 0.0,
        smoothing: 0.8,
        coarse_correction: 0.7,
    };

    /// All fields with a value.
    pub(crate) fn resolved(&self) -> PbdSettings {
        let or_default = |value: f32, default: f32| match value {
            0.0 => default,
            PbdSettings::OFF => 0.0,
            _ => value,
        };
        let default = PbdSettings::DEFAULTS;
        PbdSettings {
            iterations: if self.iterations == 0 { default.iterations } else { self.iterations },
            damping: or_default(self.damping, default.damping),
            orientation_preservation: or_default(
                self.orientation_preservation,
                default.orientation_preservation,
            ),
            smoothing: or_default(self.smoothing, default.smoothing),
            coarse_correction: or_default(self.coarse_correction, default.coarse_correction),
        }
    }

    fn check(&self) -> Result<()> {
        if self.iterations > MAX_ITERATIONS {
            return Err(Error::argument(format!(
                "options.pbd.iterations: {} is over {MAX_ITERATIONS}",
                self.iterations
            )));
        }
        for (name, value) in [
            ("damping", self.damping),
            ("orientation_preservation", self.orientation_preservation),
            ("smoothing", self.smoothing),
            ("coarse_correction", self.coarse_correction),
        ] {
            if !(0.0..=1.0).contains(&value) && value != PbdSettings::OFF {
                return Err(Error::argument(format!(
                    "options.pbd.{name}: {value} is neither in 0..1 nor -1 (none)"
                )));
            }
        }
        Ok(())
    }
}

/// Most iterations per level: work is bounded.
const MAX_ITERATIONS: u32 = 1024;

/// Options of one solve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolveOptions {
    /// How much work.
    pub quality: Quality,
    /// Start from the previous result instead of the identity: faster on small changes, but the result then
    /// depends on the order of frames.
    pub warm: bool,
    /// Stop correcting a chart when a correction gains less than this share of its energy (to which 6 % of what the
    /// original UVs have is added), or when a level's first correction gained what its linear model foretold, to a tenth
    /// of that share; 0 = the quality's own. Up to four times these the next correction is taken in part.
    pub tolerance: f32,
    /// Cap on corrections per level in place of the quality's own, at most 64; 0 = the quality's own.
    pub max_corrections: u32,
    /// Stop after about this many milliseconds with the best state so far; 0 = no limit.
    pub time_budget_ms: f32,
    /// Also measure the strain on the mesh (slow, f64): fills [`crate::TileReport::strain`].
    pub measure: bool,
    /// How the warp is found. `quality`, `tolerance` and `max_corrections` speak to [`Solver::Descent`] alone, `pbd` to
    /// [`Solver::Pbd`].
    pub solver: Solver,
    /// Settings of [`Solver::Pbd`].
    pub pbd: PbdSettings,
}

/// Most corrections per level: work is bounded.
const MAX_CORRECTIONS: u32 = 64;

impl SolveOptions {
    pub(crate) fn check(&self) -> Result<()> {
        if !(0.0..1.0).contains(&self.tolerance) {
            return Err(Error::argument(format!("options.tolerance: {} is not in 0..1", self.tolerance)));
        }
        if self.max_corrections > MAX_CORRECTIONS {
            return Err(Error::argument(format!(
                "options.max_corrections: {} is over {MAX_CORRECTIONS}",
                self.max_corrections
            )));
        }
        if !(self.time_budget_ms >= 0.0 && self.time_budget_ms.is_finite()) {
            return Err(Error::argument(format!(
                "options.time_budget_ms: {} is not a finite, non-negative number",
                self.time_budget_ms
            )));
        }
        self.pbd.check()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zero_means_the_default_and_off_means_none() {
        assert_eq!(PbdSettings::default().resolved(), PbdSettings::DEFAULTS);
        let off = PbdSettings { smoothing: PbdSettings::OFF, damping: 0.25, ..PbdSettings::default() };
        let resolved = PbdSettings { smoothing: 0.0, damping: 0.25, ..PbdSettings::DEFAULTS };
        assert_eq!(off.resolved(), resolved);
    }
}
