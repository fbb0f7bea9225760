//! Runs the efforts on a case: once to look at the errors, then timed, round by round, so that whatever else the machine
//! does hits all alike and ratios can be taken in pairs.

use vrtm::{Asset, Device, SolveOptions, Strided};

use crate::common::on_all_cores;
use crate::efforts::{Effort, NORMAL, Who};
use crate::rows::{Row, Times, median};
use crate::scenes::Case;

/// How often to time what.
#[derive(Clone, Copy, Debug)]
pub struct Repeats {
    /// Rounds.
    pub most: usize,
    /// An effort sits out the later rounds when it has taken so many milliseconds (but not the first).
    pub budget_ms: f64,
}

/// A backend that is there.
pub struct Place {
    pub name: &'static str,
    pub device: Device,
}

/// A row and the warp that it tells of.
pub struct Ran {
    pub row: Row,
    pub u: Vec<[f64; 2]>,
}

/// An asset for each solver, whose memory is then its own; its poses come in turn.
struct Seat {
    asset: Asset,
    tile: usize,
    turn: usize,
}

impl Seat {
    fn new(case: &Case, place: &Place) -> Seat {
        let (asset, tile) = case.asset(&place.device);
        Seat { asset, tile, turn: 0 }
    }

    /// Milliseconds of a whole solve.
    fn solve(&mut self, case: &Case, options: &SolveOptions) -> Result<f64, String> {
        self.turn += 1;
        self.asset.solve(case.pose(self.turn), options).map_err(|error| format!("{}: {error}", case.name))?;
        let report = self.asset.tile_report(self.tile).map_err(|error| error.to_string())?;
        // A chart that keeps its last result costs nothing, which would be told as speed.
        assert_eq!(report.charts_reused, 0, "{}: no chart's inputs are those of the solve before", case.name);
        Ok(f64::from(report.times.total))
    }
}

/// All efforts on a case. Energies are in f64, by the reference; gaps are not known yet.
pub fn run(case: &Case, place: &Place, efforts: &[Effort], repeats: Repeats) -> Result<Vec<Ran>, String> {
    let mut seats = [Seat::new(case, place), Seat::new(case, place)];
    let seat = |who: Who| usize::from(who == Who::Pbd);
    let mut ran = Vec::new();
    for effort in efforts {
        let seat = &mut seats[seat(effort.who)];
        // The first frame allocates.
        if seat.turn == 0 {
            seat.solve(case, &effort.options)?;
        }
        // The pose itself, not the one beside it, is what errors are told of.
        seat.turn = 1;
        seat.solve(case, &SolveOptions { measure: true, ..effort.options })?;
        let report = seat.asset.tile_report(seat.tile).map_err(|error| error.to_string())?;
        let u = seat.asset.displacements(seat.tile).map_err(|error| error.to_string())?;
        let row = Row {
            backend: place.name,
            solver: effort.who.name(),
            effort: effort.name.clone(),
            iterations: effort.iterations,
            strain: report.strain,
            report,
            ..blank(case)
        };
        ran.push(Ran { row, u: u.into_iter().map(|u| u.map(f64::from)).collect() });
    }
    time(efforts, repeats, &mut ran, |effort| {
        let seat = &mut seats[seat(effort.who)];
        seat.solve(case, &effort.options)
    })?;
    let (asset, tile) = (&seats[0].asset, seats[0].tile);
    let energies = on_all_cores(&ran, |ran| energy(asset, tile, case.pose(0), &ran.u));
    for (ran, energy) in ran.iter_mut().zip(energies) {
        ran.row.energy = energy?;
    }
    Ok(ran)
}

/// Rounds of all efforts.
fn time(
    efforts: &[Effort],
    repeats: Repeats,
    ran: &mut [Ran],
    mut solve: impl FnMut(&Effort) -> Result<f64, String>,
) -> Result<(), String> {
    let mut times: Vec<Vec<f64>> = vec![Vec::new(); efforts.len()];
    let normal = efforts.iter().position(|effort| effort.name == NORMAL && effort.who == Who::Descent);
    for round in 0..repeats.most {
        for (effort, times) in efforts.iter().zip(&mut times) {
            let is_late = round >= 1 && times.iter().sum::<f64>() > repeats.budget_ms;
            // `normal` runs in every round: the others' ratios need it.
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

fn energy(asset: &Asset, tile: usize, pose: Strided, u: &[[f64; 2]]) -> Result<f64, String> {
    asset.reference_energy(tile, pose, u).map_err(|error| error.to_string())
}

fn blank(case: &Case) -> Row {
    Row { scene: case.name.clone(), frame: case.frame, udim: case.udim, grid: case.grid, ..Row::default() }
}
