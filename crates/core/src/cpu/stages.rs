//! The stages that the schedule calls (method §5). `Start` delegates to `prolong`, `Iterate` to `pbd`, and each other
//! stage to the file of its name.

use crate::method::stage::{Stage, Stages, Start};

use super::run::Run;

impl Stages for Run<'_> {
    fn run(&mut self, stage: &Stage) -> bool {
        if let Stage::Start { from, .. } = *stage
            && from != Start::Passing
        {
            self.known_energies.fill(None);
        }
        match *stage {
            Stage::Surface => self.pose_triangles(),
            Stage::Pyramid => {
                self.pose_metrics();
                self.protect();
            }
            Stage::Start { level, from } => match from {
                Start::Identity => self.start_from_identity(level),
                Start::Previous => self.start_from_previous(),
                Start::Coarser => self.prolong_level(level),
                Start::Smoothed(smoothing) => {
                    self.prolong_level(level);
                    self.regularise_level(level, smoothing);
                }
                Start::Passing => self.interpolate_level(level),
            },
            Stage::Relax { level, sweeps } => {
                self.known_energies.fill(None);
                self.relax_level(level, sweeps, None);
            }
            Stage::Correct { level, ref correction, stop } => {
                (self.stop, self.stopped) = (stop, false);
                self.correct_level(level, correction);
                return !self.stopped;
            }
            Stage::Iterate { level, ref iteration } => self.iterate_level(level, iteration),
            Stage::Energies { level, allow_folds } => {
                self.store_identity_energy(level);
                self.complete_energies(level, allow_folds);
            }
            Stage::Certify { allow_folds } => self.certify_result(allow_folds),
            Stage::GiveUp => self.fall_back_everywhere(),
        }
        true
    }
}
