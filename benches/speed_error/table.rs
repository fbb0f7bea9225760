//! The tables: for the terminal, and as Markdown beside the plots.

use std::fmt::Write as _;

use crate::claims::{BAR, Claim};
use crate::machine::Machine;
use crate::oracle::Done;
use crate::rows::Row;

const NAMED: [&str; 3] = ["draft", "normal", "7 corrections"];

/// Formats all results of a run as text.
pub fn text(machine: &Machine, done: &[Done], rows: &[Row], claims: &[Claim]) -> String {
    format!("# Speed against error\n\n{}\n\n", machine.text()) + &scenes(done, rows) + &claimed(claims)
}

/// Strain and time per scene: of the original UVs, of the named qualities, and of the best row of pbd.
fn scenes(done: &[Done], rows: &[Row]) -> String {
    let mut text = String::from(
        "Strain RMS on the mesh (rigid edges, f64) and gap = (E - E*) / (E0 - E*), beside the median time of a whole solve. \
         The paper's solver minimises another functional: gaps tell of it only how it does on this one, strain is fair to both.\n\n\
         | scene | grid | backend | strain before | draft | normal | 7 corrections | lowest of pbd | E* by |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    let cell = |row: Option<&Row>, with_name: bool| {
        let Some(row) = row else { return "-".into() };
        let (strain, ms) = (crate::claims::strain(row), row.ms.map_or(f64::NAN, |t| t.median));
        let name = if with_name { format!(", {}", row.effort) } else { String::new() };
        let folds = if row.folded() { format!(", **{} folds**", row.report.folds) } else { String::new() };
        format!("{strain:.4}, gap {}, {ms:.0} ms{name}{folds}", percent(row.gap))
    };
    for case in done {
        let mut backends: Vec<&str> = case.ran.iter().map(|ran| ran.row.backend).collect();
        backends.dedup();
        for backend in backends {
            let of = |solver: &str| {
                let wanted = (case.case.name.clone(), backend, solver.to_string());
                rows.iter().filter(move |r| {
                    (r.scene.as_str(), r.backend, r.solver)
                        == (wanted.0.as_str(), wanted.1, wanted.2.as_str())
                })
            };
            let before = case.ran.first().and_then(|ran| ran.row.strain).map_or(f32::NAN, |s| s.before.rms);
            let named = NAMED.map(|name| cell(of("descent").find(|row| row.effort == name), false));
            let least =
                of("pbd").min_by(|a, b| crate::claims::strain(a).total_cmp(&crate::claims::strain(b)));
            let oracle = if case.oracle.by_reference { "reference" } else { "best result" };
            let _ = writeln!(
                text,
                "| {} | {}² | {backend} | {before:.4} | {} | {} | {oracle} |",
                case.case.name,
                case.case.grid,
                named.join(" | "),
                cell(least, true)
            );
        }
    }
    text
}

fn claimed(claims: &[Claim]) -> String {
    if claims.is_empty() {
        return String::new();
    }
    let mut text = format!(
        "\n## The same error in less time\n\nThe lowest error that pbd ever reaches, and the quickest effort of descent at or \
         under it. Bar: {BAR:.0} times less.\n\n\
         | scene | backend | error | pbd | ms | descent | ms | times less |\n|---|---|---|---|---|---|---|---|\n"
    );
    for claim in claims {
        let ms = |row: &Row| row.ms.map_or(f64::NAN, |t| t.median);
        let folds = if claim.pbd.folded() { ", folded" } else { "" };
        let (descent, time) = match &claim.descent {
            Some(row) => (format!("{:.4} ({})", claim.error(row), row.effort), format!("{:.0}", ms(row))),
            None => ("never".into(), "-".into()),
        };
        let _ = writeln!(
            text,
            "| {} | {} | {} | {:.4} ({}{folds}) | {:.0} | {descent} | {time} | {} |",
            claim.scene,
            claim.backend,
            claim.by,
            claim.error(&claim.pbd),
            claim.pbd.effort,
            ms(&claim.pbd),
            claim.ratio().map_or("-".into(), |ratio| format!("**{ratio:.1}**"))
        );
    }
    let ratios = |by: &str| {
        let mut all: Vec<f64> =
            claims.iter().filter(|c| c.by == by).map(|c| c.ratio().unwrap_or(0.0)).collect();
        all.sort_by(f64::total_cmp);
        let met = all.iter().filter(|&&ratio| ratio >= BAR).count();
        let (n, middle) = (all.len(), vrtm_testkit::bench::median(&all));
        let least = all.first().copied().unwrap_or(f64::NAN);
        format!("{by}: bar met on {met} of {n}, median {middle:.1}, least {least:.1} (0: never)")
    };
    let _ = writeln!(text, "\n{}; {}.", ratios("E"), ratios("strain"));
    text
}

fn percent(fraction: f64) -> String {
    let percent = 100.0 * fraction;
    match percent.abs() {
        p if p >= 10.0 => format!("{percent:.0} %"),
        p if p >= 0.1 => format!("{percent:.1} %"),
        p if p >= 0.001 => format!("{percent:.3} %"),
        _ => "< 0.001 %".into(),
    }
}
