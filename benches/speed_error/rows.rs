//! A row of the result: one effort on one case, with its error and its time.

use vrtm::{StrainReport, TileReport};
use vrtm_testkit::cases::Case;

#[derive(Clone, Debug, Default)]
pub struct Row {
    pub scene: String,
    pub frame: usize,
    pub udim: u32,
    pub backend: &'static str,
    pub solver: &'static str,
    pub effort: String,
    pub iterations: u32,
    pub grid: u32,
    /// Number of timed solves.
    pub runs: usize,
    pub ms: Option<Times>,
    /// Energy in f64, by the reference.
    pub energy: f64,
    /// (E - E*) / (E0 - E*).
    pub gap: f64,
    pub report: TileReport,
    /// Absent for the reference's own minimum.
    pub strain: Option<StrainReport>,
}

/// Milliseconds of whole solves.
#[derive(Clone, Copy, Debug, Default)]
pub struct Times {
    pub median: f64,
    pub min: f64,
    /// Median over the rounds of the ratio to `normal` of descent on the same backend.
    pub to_normal: f64,
}

impl Row {
    /// Of a case, without any result.
    pub fn blank(case: &Case) -> Row {
        Row {
            scene: case.name.clone(),
            frame: case.frame,
            udim: case.udim,
            grid: case.grid,
            ..Row::default()
        }
    }

    pub fn folded(&self) -> bool {
        self.report.folds > 0
    }

    /// Names and values, in the order in which they are written.
    fn columns(&self) -> Vec<(&'static str, String)> {
        let Row { report, strain, .. } = self;
        let ms = |f: fn(&Times) -> f64| self.ms.as_ref().map_or(String::new(), |times| short(f(times), 4));
        let of = |f: fn(&StrainReport) -> f32| {
            strain.as_ref().map_or(String::new(), |s| short(f64::from(f(s)), 5))
        };
        vec![
            ("scene", self.scene.clone()),
            ("frame", self.frame.to_string()),
            ("udim", self.udim.to_string()),
            ("backend", self.backend.into()),
            ("solver", self.solver.into()),
            ("effort", self.effort.clone()),
            ("iterations", self.iterations.to_string()),
            ("grid", self.grid.to_string()),
            ("nodes_active", report.nodes_active.to_string()),
            ("runs", self.runs.to_string()),
            ("ms_median", ms(|t| t.median)),
            ("ms_min", ms(|t| t.min)),
            ("ms_to_descent_normal", ms(|t| t.to_normal)),
            ("energy", short(self.energy, 9)),
            ("gap", short(self.gap, 4)),
            ("strain_rms", of(|s| s.after.rms)),
            ("strain_free_rms", of(|s| s.after.free_rms)),
            ("strain_p95", of(|s| s.after.p95)),
            ("strain_max", of(|s| s.after.max)),
            ("harm", of(|s| s.harm)),
            ("help", of(|s| s.help)),
            ("min_jacobian", short(report.min_jacobian, 5)),
            ("folds", report.folds.to_string()),
            ("sweeps", report.sweeps.to_string()),
            ("corrections", report.corrections.to_string()),
            ("node_updates", report.node_updates.to_string()),
            ("bytes", report.bytes.to_string()),
        ]
    }
}

/// Writes a line of names and one line per row.
pub fn csv(rows: &[Row]) -> String {
    let Some(first) = rows.first() else { return String::new() };
    let names: Vec<String> = first.columns().into_iter().map(|(name, _)| name.to_owned()).collect();
    let cells = |row: &Row| row.columns().into_iter().map(|(_, cell)| cell).collect();
    let lines = std::iter::once(names).chain(rows.iter().map(cells));
    lines.map(|cells: Vec<String>| cells.join(",") + "\n").collect()
}

/// Rounds to a number of digits: results are kept under version control, where further digits only cause differences.
fn short(x: f64, digits: usize) -> String {
    if !x.is_finite() {
        return String::new();
    }
    format!("{:?}", format!("{x:.*e}", digits - 1).parse().unwrap_or(x))
}
