//! The schedule on both backends side by side, with a comparison of their states after each stage.

use super::StageDifference;
use super::point::Point;
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::codes::unpack_two;
use vrtm_core::grid::planes::NODES;
use vrtm_core::method::acceptance::Correction;
use vrtm_core::method::plan::Summary;
use vrtm_core::method::stage::{Stage, Stages, Start};
use vrtm_cpu as cpu;
use vrtm_gpu as gpu;
use vrtm_gpu::layout::{METRIC_PLANES, ROW_PLANES};
use vrtm_gpu::state::STATE_PLANES;

/// A run on each backend, for the same input, whose states are compared after each stage.
pub struct Pair<'a> {
    cpu: cpu::Run<'a>,
    gpu: gpu::Run<'a>,
    grid: &'a Grid,
    /// Per chart, true if it is to be solved.
    charts: &'a [bool],
    /// True if the GPU continues from the CPU's state after each stage, so that a difference comes from one stage only.
    lockstep: bool,
    /// Number of the present correction on its level.
    correction: u32,
    /// Per chart, the energy of the last state that was compared, on either backend.
    energies: [Vec<f64>; 2],
    differences: Vec<StageDifference>,
    error: Option<Error>,
}

/// Planes per block of decoded rows: diagonal blocks (3), pairs (16).
const DECODED_PLANES: usize = 19;

/// Rows with their pairs decoded to f32 (method §7.2).
fn decoded(rows: &[u32]) -> Vec<u32> {
    let mut all = Vec::with_capacity(rows.len() / ROW_PLANES * DECODED_PLANES);
    for block in rows.chunks(ROW_PLANES * NODES) {
        all.extend_from_slice(&block[..3 * NODES]);
        for edge in block[3 * NODES..].chunks(2 * NODES) {
            for words in edge.chunks(NODES) {
                let number = |n: usize| words.iter().map(move |&word| unpack_two(word)[n].to_bits());
                all.extend(number(0).chain(number(1)));
            }
        }
    }
    all
}

/// The planes of a level's blocks that are compared.
#[derive(Clone, Copy)]
struct Selection {
    level: usize,
    /// Planes per block in the array.
    planes: usize,
    /// The first plane that is compared.
    first: usize,
    /// Number of planes that are compared.
    count: usize,
    /// True if only movable nodes are compared.
    movable: bool,
}

const DISPLACEMENT: &str = "displacement (cells)";

impl<'a> Pair<'a> {
    pub fn new(
        cpu: cpu::Run<'a>,
        gpu: gpu::Run<'a>,
        grid: &'a Grid,
        charts: &'a [bool],
        lockstep: bool,
    ) -> Pair<'a> {
        Pair {
            cpu,
            gpu,
            grid,
            charts,
            lockstep,
            correction: 0,
            energies: [Vec::new(), Vec::new()],
            differences: Vec::new(),
            error: None,
        }
    }

    /// All differences, those of the certificates last.
    pub fn finish(mut self) -> Result<Vec<StageDifference>> {
        if let Some(error) = self.error {
            return Err(error);
        }
        let done = self.gpu.finish(Summary::default())?;
        let mut add = |quantity, of: &dyn Fn(&vrtm_core::method::plan::ChartResult) -> f64| {
            let solved = |c: &usize| self.charts[*c];
            let pairs = (0..self.charts.len()).filter(solved).map(|c| {
                let (cpu, gpu) = (&self.cpu.results[c], &done.charts[c]);
                (of(cpu), of(gpu))
            });
            self.differences.push(StageDifference::new(Point::Certify, quantity, pairs));
        };
        add("smallest corner Jacobian", &|chart| chart.min_jacobian);
        add("folds", &|chart| chart.folds as f64);
        add("fallback", &|chart| f64::from(u8::from(chart.fallback)));
        add("longest displacement (cells)", &|chart| f64::from(chart.max_displacement));
        Ok(self.differences)
    }

    /// Does a comparison, unless an earlier one failed; keeps the error.
    fn attempt(&mut self, f: impl FnOnce(&mut Self) -> Result<()>) {
        if self.error.is_none() {
            self.error = f(self).err();
        }
    }

    /// Compares the selected planes of the blocks of some charts.
    fn compare(
        &mut self,
        at: Point,
        quantity: &'static str,
        selection: Selection,
        charts: &[bool],
        cpu: &[u32],
        gpu: &[u32],
    ) {
        let level = &self.grid.levels[selection.level];
        let blocks = level.blocks.list.iter().enumerate();
        let planes = blocks
            .filter(|(_, block)| charts[block.chart as usize] && (block.active || !selection.movable))
            .flat_map(|(b, _)| {
                (selection.first..selection.first + selection.count).map(move |plane| (b, plane))
            });
        let pairs = planes.flat_map(|(b, plane)| {
            let at = (b * selection.planes + plane) * NODES;
            let wanted = move |s: &usize| !selection.movable || level.movable[b][*s] != 0;
            let value = move |bits: &[u32], s: usize| f64::from(f32::from_bits(bits[at + s]));
            (0..NODES).filter(wanted).map(move |s| (value(cpu, s), value(gpu, s)))
        });
        self.differences.push(StageDifference::new(at, quantity, pairs));
    }

    /// Compares the state of a level: displacements, samples of the surface and energies.
    fn state(&mut self, at: Point, level: usize) -> Result<()> {
        let (cpu, gpu) = (self.cpu.state(level), self.gpu.state(level)?);
        let selection = Selection { level, planes: STATE_PLANES, first: 0, count: 2, movable: false };
        let charts = self.charts;
        self.compare(at, DISPLACEMENT, selection, charts, &cpu, &gpu);
        let selection = Selection { first: 2, count: 3, movable: true, ..selection };
        let values = if level == 0 { "position under W (chart sizes)" } else { "metric under W" };
        self.compare(at, values, selection, charts, &cpu, &gpu);
        let of_cpu = self.cpu.energies(level);
        let of_gpu = self.gpu.energies_of(level)?;
        self.per_chart(at, "energy of a chart, relative", |c| relative(of_cpu[c], of_gpu[c]));
        let sum = |of: &[f64]| (0..of.len()).filter(|&c| charts[c]).map(|c| of[c]).sum();
        let all = [relative(sum(&of_cpu), sum(&of_gpu))];
        self.differences.push(StageDifference::new(at, "energy of all charts, relative", all.into_iter()));
        self.energies = [of_cpu, of_gpu];
        if self.lockstep {
            self.gpu.set_state(level, &cpu)?;
        }
        Ok(())
    }

    /// Compares one pair (CPU, GPU) per chart that is solved.
    fn per_chart(&mut self, at: Point, quantity: &'static str, pair: impl Fn(usize) -> (f64, f64)) {
        let solved = (0..self.charts.len()).filter(|&c| self.charts[c]);
        self.differences.push(StageDifference::new(at, quantity, solved.map(pair)));
    }

    /// Compares after a stage that sets or changes a level's displacements.
    fn level(&mut self, level: usize, step: u32) {
        self.attempt(|pair| {
            let at = Point::level(level, step);
            pair.state(at, level)?;
            Ok(())
        });
        if step == 0 && level == 0 {
            self.energies_of_identity(Point::level(level, step));
        }
    }

    /// Compares the energies of the identity that both backends have stored.
    fn energies_of_identity(&mut self, at: Point) {
        self.attempt(|pair| {
            let records = pair.gpu.chart_records()?;
            let before: Vec<f64> = pair.cpu.results.iter().map(|chart| chart.energy_before).collect();
            pair.per_chart(at, "energy of the identity, relative", |c| {
                relative(before[c], f64::from(records[c].identity))
            });
            Ok(())
        });
    }

    /// Compares the displacements of a level that the work only passes through; its samples have no use.
    fn passed(&mut self, level: usize) {
        self.attempt(|pair| {
            let (cpu, gpu) = (pair.cpu.state(level), pair.gpu.state(level)?);
            let selection = Selection { level, planes: STATE_PLANES, first: 0, count: 2, movable: false };
            let charts = pair.charts;
            pair.compare(Point::level(level, 0), DISPLACEMENT, selection, charts, &cpu, &gpu);
            Ok(())
        });
    }

    /// Compares the matrix of a level, for some charts.
    fn rows(&mut self, at: Point, level: usize, quantity: &'static str, charts: &[bool]) -> Result<()> {
        let (cpu, gpu) = (self.cpu.rows(level), self.gpu.rows(level)?);
        let selection =
            Selection { level, planes: DECODED_PLANES, first: 0, count: DECODED_PLANES, movable: true };
        self.compare(at, quantity, selection, charts, &decoded(&cpu), &decoded(&gpu));
        Ok(())
    }

    /// Compares the linear systems with which a correction begins. In lockstep, both are those of the same state.
    fn before_correction(&mut self, at: Point, level: usize) -> Result<()> {
        let [_, right] = self.cpu.assembled(level);
        let [_, other] = self.gpu.assembled(level)?;
        let selection = Selection { level, planes: 2, first: 0, count: 2, movable: true };
        self.compare(at, "right-hand side", selection, self.charts, &right, &other);
        self.rows(at, level, "assembled rows", self.charts)
    }

    /// Compares the internal results of a correction: coarser matrices, the step and its fractions, decisions.
    fn after_correction(&mut self, at: Point, level: usize, charts: &[bool]) -> Result<()> {
        for k in level + 1..=self.grid.coarsest() {
            self.rows(at, k, "Galerkin rows", charts)?;
        }
        let [step, fraction] = self.cpu.step_of(level);
        let [other_step, other_fraction] = self.gpu.step_of(level)?;
        // Most nodes take the whole step: 1 minus the fraction has better resolution near 1.
        let [cut, other_cut] = [fraction, other_fraction]
            .map(|bits| bits.into_iter().map(|x| (1.0 - f32::from_bits(x)).to_bits()).collect::<Vec<_>>());
        let selection = Selection { level, planes: 2, first: 0, count: 2, movable: true };
        self.compare(at, "step (cells)", selection, charts, &step, &other_step);
        let selection = Selection { planes: 1, count: 1, ..selection };
        self.compare(at, "limited part of the step", selection, charts, &cut, &other_cut);
        let mut records = self.gpu.chart_records()?;
        let next = self.cpu.next_fraction().to_vec();
        let blocks = &self.grid.levels[level].blocks;
        // Without an active block on this level, a chart has no decision.
        let moves = |c: usize| blocks.list[blocks.of_chart[c].clone()].iter().any(|block| block.active);
        let deciding = (0..charts.len()).filter(|&c| charts[c] && moves(c));
        let pairs = deciding.map(|c| (f64::from(u8::from(next[c] == 0.0)), f64::from(records[c].finished)));
        self.differences.push(StageDifference::new(at, "decision to stop", pairs));
        if self.lockstep {
            for (record, &next) in records.iter_mut().zip(&next) {
                (record.fraction, record.finished) = (next, u32::from(next == 0.0));
            }
            self.gpu.set_chart_records(&records)?;
        }
        Ok(())
    }
}

/// Both values divided by the CPU's, where that is finite and positive.
fn relative(cpu: f64, gpu: f64) -> (f64, f64) {
    if cpu.is_finite() && cpu > 0.0 { (1.0, gpu / cpu) } else { (cpu, gpu) }
}

impl Stages for Pair<'_> {
    fn run(&mut self, stage: &Stage) {
        match stage {
            Stage::Correct { level, correction } => self.correct(stage, *level, correction),
            _ => self.run_both(stage),
        }
        match *stage {
            Stage::Surface => self.attempt(Pair::surface),
            Stage::Pyramid { coarsest } => self.attempt(|pair| pair.pyramid(coarsest)),
            Stage::Start { level, from: Start::Passing } => self.passed(level),
            Stage::Start { level, .. } => self.level(level, 0),
            Stage::Relax { level, .. } => self.level(level, 1),
            Stage::Iterate { level, .. } => {
                self.gpu.copy_back(level);
                self.level(level, 1);
            }
            Stage::Energies { level, .. } => self.energies_of_identity(Point::level(level, 2)),
            Stage::Correct { .. } | Stage::Certify { .. } => {}
        }
    }
}

impl Pair<'_> {
    fn run_both(&mut self, stage: &Stage) {
        self.cpu.run(stage);
        self.gpu.run(stage);
    }

    /// Compares the results of `surface`.
    fn surface(&mut self) -> Result<()> {
        let (cpu, gpu) = (self.cpu.triangles(), self.gpu.triangles()?);
        let solved = |t: &usize| self.charts[self.grid.chart_of[*t] as usize];
        let pairs = (0..cpu.len()).filter(solved).flat_map(|t| {
            let (cpu, gpu) = (cpu[t], gpu[t]);
            (0..9).map(move |k| (f64::from(cpu[k]), f64::from(gpu[k])))
        });
        self.differences.push(StageDifference::new(Point::Surface, "pose triangles", pairs));
        if self.lockstep { self.gpu.set_triangles(&cpu) } else { Ok(()) }
    }

    /// Compares the results of `pyramid`.
    fn pyramid(&mut self, coarsest: usize) -> Result<()> {
        for level in 1..self.grid.levels.len().min(coarsest + 1) {
            let (cpu, gpu) = (self.cpu.metric(level), self.gpu.metric(level)?);
            let selection =
                Selection { level, planes: METRIC_PLANES, first: 0, count: METRIC_PLANES, movable: false };
            self.compare(Point::Pyramid, "metrics", selection, self.charts, &cpu, &gpu);
            if self.lockstep {
                self.gpu.set_metric(level, &cpu)?;
            }
        }
        Ok(())
    }

    /// Does a correction on both backends, and compares the systems before it and the results after it.
    fn correct(&mut self, stage: &Stage, level: usize, correction: &Correction) {
        self.correction = if correction.first { 1 } else { self.correction + 1 };
        let at = Point::level(level, 1 + self.correction);
        let taking_part: Vec<bool> = if correction.first {
            self.charts.into()
        } else {
            self.charts
                .iter()
                .zip(self.cpu.next_fraction())
                .map(|(&solve, &next)| solve && next > 0.0)
                .collect()
        };
        let mut before = [Vec::new(), Vec::new()];
        self.attempt(|pair| {
            before = [pair.cpu.energies(level), pair.gpu.energies_of(level)?];
            pair.before_correction(at, level)
        });
        self.run_both(stage);
        self.attempt(|pair| pair.after_correction(at, level, &taking_part));
        self.level(level, 1 + self.correction);
        self.attempt(|pair| {
            let rise = |k: usize, c: usize| (pair.energies[k][c] / before[k][c] - 1.0).max(0.0);
            // An increase on the CPU would be visible in `size`.
            let pairs = (0..taking_part.len()).filter(|&c| taking_part[c] && before[0][c] > 0.0);
            let pairs: Vec<_> = pairs.map(|c| (rise(0, c), rise(1, c))).collect();
            pair.differences.push(StageDifference::new(
                at,
                "rise of a chart's energy, relative",
                pairs.into_iter(),
            ));
            Ok(())
        });
    }
}
