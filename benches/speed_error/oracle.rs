//! Computes E*, the energy to which gaps refer: the minimum that the reference reaches by descent in f64 from the best
//! of the results.

use vrtm::TileReport;
use vrtm_testkit::Lab as _;

use crate::rows::Row;
use crate::runs::SolvedRow;
use vrtm_testkit::cases::Case;
use vrtm_testkit::{cpu, on_all_cores};

/// A case with the results of all efforts.
pub struct Done {
    pub case: Case,
    pub ran: Vec<SolvedRow>,
    /// E of the identity.
    pub before: f64,
    pub oracle: Oracle,
}

#[derive(Clone, Debug, Default)]
pub struct Oracle {
    /// E*: the lowest of all energies, the reference's included.
    pub energy: f64,
    /// True if the reference ran. Otherwise E* is the lowest energy of the results, and the gaps are too small.
    pub by_reference: bool,
}

impl Done {
    pub fn new(case: Case, ran: Vec<SolvedRow>) -> Result<Done, String> {
        let (asset, tile) = case.asset(&cpu(1));
        let zeros = vec![[0.0; 2]; (case.grid as usize + 1).pow(2)];
        let before = asset.reference_energy(tile, case.pose(0), &zeros).map_err(|error| error.to_string())?;
        let best = ran.iter().map(|ran| ran.row.energy).fold(before, f64::min);
        let oracle = Oracle { energy: best, ..Oracle::default() };
        Ok(Done { case, ran, before, oracle })
    }

    /// The rows with their gaps; the row of the identity comes first.
    pub fn rows(&self) -> Vec<Row> {
        let Done { case, ran, before, oracle } = self;
        let gap = |energy: f64| (energy - oracle.energy) / (before - oracle.energy);
        let blank = Row::blank(case);
        let mut rows = Vec::new();
        if let Some(SolvedRow { row, .. }) = ran.first() {
            // The strain before a solve is that of the original UVs.
            let strain = row.strain.map(|mut strain| {
                (strain.after, strain.harm, strain.help) = (strain.before, 0.0, 0.0);
                strain
            });
            let mut report = TileReport::default();
            report.min_jacobian = 1.0;
            rows.push(Row { solver: "identity", energy: *before, gap: 1.0, strain, report, ..blank.clone() });
        }
        rows.extend(ran.iter().map(|ran| Row { gap: gap(ran.row.energy), ..ran.row.clone() }));
        if oracle.by_reference {
            rows.push(Row { solver: "reference", energy: oracle.energy, ..blank });
        }
        rows
    }
}

/// Runs the reference from each case's best result, which takes seconds to minutes per case, with one thread per case.
pub fn consult(done: &mut [Done]) -> Result<(), String> {
    let found = on_all_cores(done, |done| {
        let Done { case, ran, .. } = done;
        let (asset, tile) = case.asset(&cpu(1));
        let unfolded = ran.iter().filter(|ran| !ran.row.folded());
        let best = unfolded.min_by(|a, b| a.row.energy.total_cmp(&b.row.energy)).map(|ran| ran.u.as_slice());
        let minimum = asset.reference_minimum(tile, case.pose(0), best, false);
        minimum.map(|minimum| minimum.energy)
    });
    for (done, found) in done.iter_mut().zip(found) {
        let energy = found.map_err(|error| format!("{}: {error}", done.case.name))?;
        done.oracle = Oracle { energy: energy.min(done.oracle.energy), by_reference: true };
    }
    Ok(())
}
