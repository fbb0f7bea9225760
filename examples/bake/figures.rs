//! The figures of a frame as lines of text: one column per tile.

use vrtm::TileReport;

/// Number of tiles that fit side by side on the sheet.
const COLUMNS: usize = 5;

type Figure = (&'static str, fn(&TileReport) -> String);

/// A figure of the strain as text, or a dash if no edge was measured.
fn strain(report: &TileReport, f: impl Fn(&vrtm::StrainReport) -> String) -> String {
    report.strain.as_ref().filter(|s| s.edges > 0).map_or("-".into(), f)
}

const FIGURES: [Figure; 17] = [
    ("grid", |r| format!("{}x{}", r.grid[0], r.grid[1])),
    ("strain RMS, before", |r| strain(r, |s| format!("{:.4}", s.before.rms))),
    ("            after", |r| strain(r, |s| format!("{:.4}", s.after.rms))),
    ("       95 %, before", |r| strain(r, |s| format!("{:.4}", s.before.p95))),
    ("            after", |r| strain(r, |s| format!("{:.4}", s.after.p95))),
    ("       max, before", |r| strain(r, |s| format!("{:.3}", s.before.max))),
    ("            after", |r| strain(r, |s| format!("{:.3}", s.after.max))),
    ("near borders, after", |r| strain(r, |s| format!("{:.4}", s.after.border_rms))),
    ("free nodes, after", |r| strain(r, |s| format!("{:.4}", s.after.free_rms))),
    ("elsewhere, after", |r| strain(r, |s| format!("{:.4}", s.after.interior_rms))),
    ("helped", |r| strain(r, |s| format!("{:.2} %", 100.0 * s.help))),
    ("harmed", |r| strain(r, |s| format!("{:.3} %", 100.0 * s.harm))),
    ("min Jacobian", |r| format!("{:.3}", r.min_jacobian)),
    ("folds", |r| r.folds.to_string()),
    ("active nodes", |r| r.nodes_active.to_string()),
    ("solve", |r| format!("{:.1} ms", r.times.total)),
    ("inversion", |r| format!("{:.1} ms", r.times.invert)),
];

/// Lines of text for the sheet: a heading with the tiles' numbers, then a line per figure.
pub fn lines(reports: &[TileReport]) -> Vec<String> {
    let mut shown: Vec<&TileReport> = reports.iter().collect();
    if shown.len() > COLUMNS {
        shown.sort_by_key(|r| std::cmp::Reverse(r.nodes_active));
        shown.truncate(COLUMNS);
        shown.sort_by_key(|r| r.udim);
    }
    let row = |label: &str, value: &dyn Fn(&TileReport) -> String| {
        let values = shown.iter().map(|r| format!("{:>11}", value(r))).collect::<String>();
        format!("{label:<20}{values}")
    };
    let mut lines = vec![row("tile", &|r| r.udim.to_string())];
    lines.extend(FIGURES.iter().map(|(label, value)| row(label, &|r| value(r))));
    if shown.len() < reports.len() {
        lines.push(format!("and {} more tiles in report.json", reports.len() - shown.len()));
    }
    lines
}
