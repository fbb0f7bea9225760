//! Runs the efforts on a case: once to measure the errors, then timed in rounds, so that other load on the machine
//! affects all efforts alike and ratios can be taken within a round.

use vrtm::{Asset, Device, SolveOptions};
use vrtm_testkit::Lab as _;

use crate::efforts::{Effort, NORMAL, Who};
use crate::rows::{Row, Times};
use vrtm_testkit::bench::median;
use vrtm_testkit::cases::Case;
use vrtm_testkit::on_all_cores;

/// Number of timed runs of each effort.
#[derive(Clone, Copy, Debug)]
pub struct Repeats {
    /// The maximum number of rounds.
    pub most: usize,
    /// An effort takes part in no further round once it has taken this number of milliseconds, but always in the first.
    pub budget_ms: f64,
}

/// A backend on which efforts are run.
pub struct Target {
    pub name: &'static str,
    pub device: Device,
}

/// A row, and the displacements of its result.
pub struct SolvedRow {
    pub row: Row,
    pub u: Vec<[f64; 2]>,
}

/// An asset of one solver, which holds memory for that solver alone. Its two poses are solved alternately.
struct SolverAsset {
    asset: Asset,
    tile: usize,
    solves: usize,
}

impl SolverAsset {
    fn new(case: &Case, target: &Target) -> SolverAsset {
        let (asset, tile) = case.asset(&target.device);
        SolverAsset { asset, tile, solves: 0 }
    }

    /// Solves the next pose. Returns the time of the whole solve in milliseconds.
    fn solve(&mut self, case: &Case, options: &SolveOptions) -> Result<f64, String> {
        self.solves += 1;
        self.asset
            .solve(case.pose(self.solves), options)
            .map_err(|error| format!("{}: {error}", case.name))?;
        let report = self.asset.tile(self.tile).report().map_err(|error| error.to_string())?;
        // A chart that keeps its last result takes no time, which would look like speed.
        assert_eq!(report.charts_reused, 0, "{}: no chart's inputs are those of the solve before", case.name);
        Ok(f64::from(report.times.total))
    }
}

/// Runs all efforts on a case. Energies are in f64, by the reference; gaps are computed later.
pub fn run(
    case: &Case,
    target: &Target,
    efforts: &[Effort],
    repeats: Repeats,
) -> Result<Vec<SolvedRow>, String> {
    let mut assets = [SolverAsset::new(case, target), SolverAsset::new(case, target)];
    let index = |who: Who| usize::from(who == Who::Pbd);
    let mut ran = Vec::new();
    for effort in efforts {
        let asset = &mut assets[index(effort.who)];
        // The first frame also allocates memory.
        if asset.solves == 0 {
            asset.solve(case, &effort.options)?;
        }
        // Errors are measured on the pose itself, not on its slightly moved copy.
        asset.solves = 1;
        asset.solve(case, &SolveOptions { measure: true, ..effort.options })?;
        let report = asset.asset.tile(asset.tile).report().map_err(|error| error.to_string())?;
        let u = asset.asset.displacements(asset.tile).map_err(|error| error.to_string())?;
        let row = Row {
            backend: target.name,
            solver: effort.who.name(),
            effort: effort.name.clone(),
            iterations: effort.iterations,
            strain: report.strain,
            report,
            ..Row::blank(case)
        };
        ran.push(SolvedRow { row, u: u.into_iter().map(|u| u.map(f64::from)).collect() });
    }
    time(efforts, repeats, &mut ran, |effort| {
        let asset = &mut assets[index(effort.who)];
        asset.solve(case, &effort.options)
    })?;
    let (asset, tile) = (&assets[0].asset, assets[0].tile);
    let energies = on_all_cores(&ran, |ran| asset.reference_energy(tile, case.pose(0), &ran.u));
    for (ran, energy) in ran.iter_mut().zip(energies) {
        ran.row.energy = energy.map_err(|error| error.to_string())?;
    }
    Ok(ran)
}

/// Times all efforts in rounds.
fn time(
    efforts: &[Effort],
    repeats: Repeats,
    ran: &mut [SolvedRow],
    mut solve: impl FnMut(&Effort) -> Result<f64, String>,
) -> Result<(), String> {
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); efforts.len()];
    let normal = efforts.iter().position(|effort| effort.name == NORMAL && effort.who == Who::Descent);
    for round in 0..repeats.most {
        for (effort, times) in efforts.iter().zip(&mut times) {
            let is_late = round >= 1 && times.iter().sum::<f64>() > repeats.budget_ms;
            // `normal` runs in every round, because the ratios of the others need it.
            if effort.name == NORMAL || !is_late {
                times.push(solve(effort)?);
            }
        }
    }
    for (ran, of_effort) in ran.iter_mut().zip(&times) {
        let ratio = |(a, b): (&f64, &f64)| a / b;
        let pairs: Option<Vec<f64>> = normal.map(|n| of_effort.iter().zip(&times[n]).map(ratio).collect());
        ran.row.runs = of_effort.len();
        ran.row.ms = Some(Times {
            median: median(of_effort),
            min: of_effort.iter().copied().fold(f64::INFINITY, f64::min),
            to_normal: pairs.map_or(f64::NAN, |pairs| median(&pairs)),
        });
    }
    Ok(())
}
