//! The schedule on one backend up to a point, on the other from there.

use crate::error::{Error, Result};
use crate::memory::Collect;
use crate::method::acceptance::Correction;
use crate::method::pbd::Iteration;
use crate::method::point::{Point, Switch};
use crate::method::schedule::Stages;
use crate::{cpu, gpu};

/// A run on each backend, of which one is on at a time.
pub(crate) struct Switched<'a> {
    pub cpu: cpu::Run<'a>,
    pub gpu: gpu::Run<'a>,
    switch: Switch,
    /// True while the GPU's is on.
    on_gpu: bool,
    correction: u32,
    pub error: Option<Error>,
}

impl<'a> Switched<'a> {
    pub fn new(cpu: cpu::Run<'a>, gpu: gpu::Run<'a>, switch: Switch) -> Switched<'a> {
        Switched { cpu, gpu, switch, on_gpu: switch.gpu_first, correction: 0, error: None }
    }

    /// The backend of a stage.
    fn at(&mut self, point: Point) -> &mut dyn Stages {
        let on_gpu = (point <= self.switch.last) == self.switch.gpu_first;
        if on_gpu != self.on_gpu {
            let outcome = if on_gpu { self.hand_to_gpu() } else { self.hand_to_cpu() };
            self.error = self.error.take().or(outcome.err());
            self.on_gpu = on_gpu;
        }
        if on_gpu { &mut self.gpu } else { &mut self.cpu }
    }

    fn hand_to_gpu(&mut self) -> Result<()> {
        self.gpu.set_triangles(&self.cpu.triangles())?;
        for level in 0..self.cpu.levels() {
            self.gpu.set_metric(level, &self.cpu.metric(level))?;
            self.gpu.set_state(level, &self.cpu.state(level))?;
        }
        let mut records = self.gpu.chart_records()?;
        for (c, record) in records.iter_mut().enumerate() {
            record.identity = self.cpu.results[c].energy_before as f32;
            record.fraction = self.cpu.next_fraction()[c];
            record.finished = u32::from(record.fraction == 0.0);
        }
        self.gpu.set_chart_records(&records)
    }

    fn hand_to_cpu(&mut self) -> Result<()> {
        self.cpu.set_triangles(&self.gpu.triangles()?);
        for level in 0..self.cpu.levels() {
            self.cpu.set_metric(level, &self.gpu.metric(level)?);
            self.cpu.set_state(level, &self.gpu.state(level)?);
        }
        let records = self.gpu.chart_records()?;
        let next: Vec<f32> =
            records.iter().map(|r| if r.finished == 0 { r.fraction } else { 0.0 }).collected();
        self.cpu.set_next_fraction(&next);
        for (outcome, record) in self.cpu.results.iter_mut().zip(&records) {
            outcome.energy_before = f64::from(record.identity);
        }
        Ok(())
    }

    /// Waits for all of it. The result is on the GPU, whichever backend certified it.
    pub fn finish(mut self) -> Result<gpu::Solution> {
        if let Some(error) = self.error {
            return Err(error);
        }
        if self.on_gpu {
            let mut done = self.gpu.finish()?;
            done.node_updates += self.cpu.node_updates();
            return Ok(done);
        }
        self.gpu.set_result(self.cpu.result())?;
        let mut done = self.gpu.finish()?;
        done.node_updates += self.cpu.node_updates();
        done.charts = self.cpu.results;
        Ok(done)
    }
}

impl Stages for Switched<'_> {
    fn levels(&self) -> usize {
        self.cpu.levels()
    }

    fn surface(&mut self) {
        self.at(Point::Surface).surface();
    }

    fn pyramid(&mut self) {
        self.at(Point::Pyramid).pyramid();
    }

    fn identity(&mut self, level: usize) {
        self.at(Point::level(level, 0)).identity(level);
    }

    fn previous(&mut self) {
        self.at(Point::level(0, 0)).previous();
    }

    fn prolong(&mut self, level: usize) {
        self.at(Point::level(level, 0)).prolong(level);
    }

    fn relax(&mut self, level: usize, sweeps: u32) {
        self.at(Point::level(level, 1)).relax(level, sweeps);
    }

    fn correct(&mut self, level: usize, correction: &Correction) {
        self.correction = if correction.first { 1 } else { self.correction + 1 };
        self.at(Point::level(level, 1 + self.correction)).correct(level, correction);
    }

    fn iterate(&mut self, level: usize, iteration: &Iteration) {
        self.at(Point::level(level, 1)).iterate(level, iteration);
    }

    fn regularise(&mut self, level: usize, smoothing: f32) {
        self.at(Point::level(level, 0)).regularise(level, smoothing);
    }

    fn certify(&mut self, allow_folds: bool) {
        self.at(Point::Certify).certify(allow_folds);
    }

    fn is_done_on_return(&self) -> bool {
        false
    }

    fn blocks(&self, level: usize) -> usize {
        self.cpu.blocks(level)
    }

    fn triangle_count(&self) -> usize {
        self.cpu.triangle_count()
    }

    fn give_up(&mut self) {
        self.at(Point::Certify).give_up();
    }

    fn wait(&mut self) {
        let on: &mut dyn Stages = if self.on_gpu { &mut self.gpu } else { &mut self.cpu };
        on.wait();
    }
}
