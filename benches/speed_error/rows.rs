//! A row of the result: one effort on one case, with its error and its time.

use serde_json::{Map, Value, json};
use vrtm::{StrainReport, TileReport};

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
    pub fn folded(&self) -> bool {
        self.report.folds > 0
    }

    /// Names and values, in the order in which they are written.
    pub fn columns(&self) -> Vec<(&'static str, Value)> {
        let Row { report, strain, .. } = self;
        let ms = |f: fn(&Times) -> f64| self.ms.as_ref().map(f).map_or(Value::Null, |x| short(x, 4));
        let of =
            |f: fn(&StrainReport) -> f32| strain.as_ref().map_or(Value::Null, |s| short(f64::from(f(s)), 5));
        vec![
            ("scene", json!(self.scene)),
            ("frame", json!(self.frame)),
            ("udim", json!(self.udim)),
            ("backend", json!(self.backend)),
            ("solver", json!(self.solver)),
            ("effort", json!(self.effort)),
            ("iterations", json!(self.iterations)),
            ("grid", json!(self.grid)),
            ("nodes_active", json!(report.nodes_active)),
            ("runs", json!(self.runs)),
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
            ("folds", json!(report.folds)),
            ("sweeps", json!(report.sweeps)),
            ("corrections", json!(report.corrections)),
            ("node_updates", json!(report.node_updates)),
            ("bytes", json!(report.bytes)),
        ]
    }

    pub fn json(&self) -> Value {
        Value::Object(
            self.columns().into_iter().map(|(name, value)| (name.into(), value)).collect::<Map<_, _>>(),
        )
    }
}

/// Writes a line of names and one line per row.
pub fn csv(rows: &[Row]) -> String {
    let line = |cells: Vec<String>| cells.join(",") + "\n";
    let Some(first) = rows.first() else { return String::new() };
    let plain = |value: Value| match value {
        Value::String(text) => text,
        Value::Null => String::new(),
        other => other.to_string(),
    };
    let mut text = line(first.columns().into_iter().map(|(name, _)| name.into()).collect());
    for row in rows {
        text += &line(row.columns().into_iter().map(|(_, value)| plain(value)).collect());
    }
    text
}

/// Rounds to a number of digits: results are kept under version control, where further digits only cause differences.
pub fn short(x: f64, digits: usize) -> Value {
    if !x.is_finite() {
        return Value::Null;
    }
    json!(format!("{x:.*e}", digits - 1).parse::<f64>().unwrap_or(x))
}

pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}
