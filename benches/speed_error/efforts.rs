//! The efforts that are compared: each solver with several settings that trade time for error.

use vrtm::{PbdSettings, Quality, SolveOptions, Solver};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    Descent,
    Pbd,
}

impl Who {
    pub fn name(self) -> &'static str {
        match self {
            Who::Descent => "descent",
            Who::Pbd => "pbd",
        }
    }
}

/// A solver with one of its settings.
#[derive(Clone, Debug)]
pub struct Effort {
    pub who: Who,
    pub name: String,
    /// Iterations per level of pbd, or the cap on corrections per level of descent (0 = the quality's own number).
    pub iterations: u32,
    pub options: SolveOptions,
}

/// The effort to which the times of the others are related.
pub const NORMAL: &str = "normal";

/// All efforts, or only a few fast ones.
pub fn efforts(quick: bool) -> Vec<Effort> {
    let mut all: Vec<Effort> = [
        ("draft", Quality::Draft, 0, 0.0),
        ("1 correction", Quality::Normal, 1, 0.0),
        ("2 corrections", Quality::Normal, 2, 0.0),
        (NORMAL, Quality::Normal, 0, 0.0),
        ("7 corrections", Quality::Normal, 7, 0.0),
        ("to the end", Quality::Normal, 32, 1e-6),
    ]
    .into_iter()
    .map(|(name, quality, max_corrections, tolerance)| Effort {
        who: Who::Descent,
        name: name.into(),
        iterations: max_corrections,
        options: SolveOptions {
            quality,
            max_corrections: (max_corrections > 0).then_some(max_corrections),
            tolerance: (tolerance > 0.0).then_some(tolerance),
            ..SolveOptions::default()
        },
    })
    .collect();
    all.extend((0..8).map(|k| pbd(1 << k)));
    if quick {
        all.retain(|effort| {
            matches!(effort.name.as_str(), "draft" | NORMAL | "1 iteration" | "4 iterations")
        });
    }
    all
}

/// The paper's solver with this number of iterations per level.
fn pbd(iterations: u32) -> Effort {
    let pbd = PbdSettings { iterations, ..PbdSettings::default() };
    let name = format!("{iterations} iteration{}", if iterations == 1 { "" } else { "s" });
    let options = SolveOptions { solver: Solver::Pbd, pbd, ..SolveOptions::default() };
    Effort { who: Who::Pbd, name, iterations, options }
}
