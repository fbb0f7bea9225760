//! The stages that the schedule calls (method §5). Each delegates to a file: `identity` and `previous` to `prolong`,
//! `iterate` and `smooth` to `pbd`, and the others to the files of their names.

use std::time::Instant;

use crate::method::acceptance::Correction;
use crate::method::pbd::Iteration;
use crate::method::schedule::Stages;

use super::Run;

impl Stages for Run<'_> {
    fn levels(&self) -> usize {
        self.grid.levels.len()
    }

    fn surface(&mut self) {
        self.pose_triangles();
    }

    fn pyramid(&mut self) {
        self.pose_metrics();
    }

    fn identity(&mut self, level: usize) {
        self.start_from_identity(level);
    }

    fn previous(&mut self) {
        self.start_from_previous();
    }

    fn prolong(&mut self, level: usize) {
        self.prolong_level(level);
    }

    fn relax(&mut self, level: usize, sweeps: u32) {
        self.known_energies.fill(None);
        self.relax_level(level, sweeps, None);
    }

    fn correct(&mut self, level: usize, correction: &Correction) {
        self.correct_level(level, correction);
    }

    fn iterate(&mut self, level: usize, iteration: &Iteration) {
        self.iterate_level(level, iteration);
    }

    fn regularise(&mut self, level: usize, smoothing: f32) {
        self.regularise_level(level, smoothing);
    }

    fn certify(&mut self, allow_folds: bool) {
        self.certify_result(allow_folds);
    }

    fn blocks(&self, level: usize) -> usize {
        self.work[level].active.len()
    }

    fn open_blocks(&self, level: usize) -> usize {
        let (list, fraction) = (&self.grid.levels[level].blocks.list, &self.memory.workspace.next_fraction);
        let is_open = |b: &&u32| fraction[list[**b as usize].chart as usize] > 0.0;
        self.work[level].active.iter().filter(is_open).count()
    }

    fn triangle_count(&self) -> usize {
        self.grid.triangles.len()
    }

    fn skip(&mut self, level: usize) {
        self.interpolate_level(level);
    }

    fn stop_at(&mut self, time: Option<Instant>) {
        (self.stop, self.stopped) = (time, false);
    }

    fn was_stopped(&self) -> bool {
        self.stopped
    }

    fn give_up(&mut self) {
        self.fall_back_everywhere();
    }
}
