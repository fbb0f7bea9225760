//! The stages that both backends implement, as the schedule calls them (method §5).

use std::time::Instant;

use super::acceptance::Correction;
use super::pbd;

/// The stages of a backend, for the charts of one tile that are to be solved. No stage returns anything on which the
/// schedule would have to decide: a GPU records a solve in advance.
pub(crate) trait Stages {
    /// Levels of the grid; 0 is the finest.
    fn levels(&self) -> usize;
    /// Computes the pose's triangles and their metrics.
    fn surface(&mut self);
    /// Computes the pose's metrics on all coarser levels.
    fn pyramid(&mut self);
    /// Sets a level to the identity.
    fn identity(&mut self, level: usize);
    /// Sets level 0 to the previous result.
    fn previous(&mut self);
    /// Interpolates the displacements of a level from the next coarser one (method §3).
    fn prolong(&mut self, level: usize);
    /// Relaxes a level node by node (method §6).
    fn relax(&mut self, level: usize, sweeps: u32);
    /// Does one Gauss-Newton step for all nodes of a level, relaxes, and accepts or refuses chart by chart (method §7).
    fn correct(&mut self, level: usize, correction: &Correction);
    /// Does one iteration of the paper's solver on a level (method §10).
    fn iterate(&mut self, level: usize, iteration: &pbd::Iteration);
    /// Smooths a level's displacements after interpolation, as the paper does.
    fn regularise(&mut self, level: usize, smoothing: f32);
    /// Computes energies and corner Jacobians, and applies the fallback (method §8): a chart that is folded, or whose
    /// energy is not finite or above that of the identity, becomes the identity; with `allow_folds`, only one whose
    /// energy is not finite.
    fn certify(&mut self, allow_folds: bool);
    /// Waits until all stages called so far are done. Called before the clock is read, if there is a time budget.
    fn wait(&mut self) {}

    // What follows serves time budgets alone.

    /// Whether a stage is done when its call returns, without `wait`.
    fn is_done_on_return(&self) -> bool {
        true
    }
    /// Active blocks of a level.
    fn blocks(&self, level: usize) -> usize;
    /// Those of charts that take part in the level's next correction, as far as known.
    fn open_blocks(&self, level: usize) -> usize {
        self.blocks(level)
    }
    /// Triangles of the tile.
    fn triangle_count(&self) -> usize;
    /// Like `prolong`, for a level on which nothing else is done.
    fn skip(&mut self, level: usize) {
        self.prolong(level);
    }
    /// When the next correction is to end early, leaving the level as it was, if that can be.
    fn stop_at(&mut self, _: Option<Instant>) {}
    /// Whether the last correction did.
    fn was_stopped(&self) -> bool {
        false
    }
    /// Makes the identity the result, in the place of `certify`; with as little work as can be.
    fn give_up(&mut self);
}
