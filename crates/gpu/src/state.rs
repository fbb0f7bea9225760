//! Reads and sets a run's state, for comparing the two backends. A module of `gpu`, so that it can access private
//! state. Every call submits the commands recorded so far; calls that read wait for them.

use super::kernels::Kernel;
use super::layout::{
    COARSE_STATE_PLANES, Chart, METRIC_PLANES, PLANE, ROW_PLANES, SAMPLE_PLANES, Triangle, VECTOR_PLANES,
    state_planes,
};
use super::layout::{DECIDE_ENERGY, FRACTION, INVALID_ENERGY, RESIDUAL, STEP};
use super::run::Run;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::grid::planes::NODES;

/// Planes per block of a level's state as it is read and set here: displacement (2), position or metric at W (3),
/// triangle under W.
pub const STATE_PLANES: usize = COARSE_STATE_PLANES + SAMPLE_PLANES;

impl Run<'_> {
    /// Per triangle in the pose: position of the first corner, df/dx, df/dy.
    pub fn triangles(&mut self) -> Result<Vec<[f32; 9]>> {
        Ok(self.all_triangles()?.iter().map(|t| t.pose).collect())
    }

    pub fn set_triangles(&mut self, poses: &[[f32; 9]]) -> Result<()> {
        let mut all = self.all_triangles()?;
        all.iter_mut().zip(poses).for_each(|(t, &pose)| t.pose = pose);
        self.upload(&self.memory.triangles, 0, &all)
    }

    fn all_triangles(&mut self) -> Result<Vec<Triangle>> {
        self.recorder.flush();
        let bytes = (self.grid.triangles.len() * size_of::<Triangle>()) as u64;
        Ok(bytemuck::pod_collect_to_vec(&self.context.read(&self.memory.triangles, 0..bytes)?).into())
    }

    pub fn chart_records(&mut self) -> Result<Vec<Chart>> {
        self.recorder.flush();
        let bytes = (self.charts.len() * size_of::<Chart>()) as u64;
        Ok(bytemuck::pod_collect_to_vec(&self.context.read(&self.memory.charts, 0..bytes)?).into())
    }

    pub fn set_chart_records(&mut self, records: &[Chart]) -> Result<()> {
        self.recorder.flush();
        self.upload(&self.memory.charts, 0, records)
    }

    /// The metrics of the pose on a level from 1 on: three planes per block.
    pub fn metric(&mut self, level: usize) -> Result<Vec<u32>> {
        match self.memory.levels[level].metric.clone() {
            Some(metric) => self.read(level, &metric, METRIC_PLANES),
            None => Ok(Vec::new()),
        }
    }

    pub fn set_metric(&mut self, level: usize, bits: &[u32]) -> Result<()> {
        self.recorder.flush();
        let metric = self.memory.levels[level].metric.as_ref();
        metric.map_or(Ok(()), |metric| self.upload(metric, 0, bits))
    }

    /// A level's displacements (2), values (3) and triangles (1) per block.
    pub fn state(&mut self, level: usize) -> Result<Vec<u32>> {
        let (state, samples) = (self.read_state(level)?, self.samples(level)?);
        let mut all = Vec::with_capacity(state.len() / state_planes(level) * STATE_PLANES);
        let samples = samples.chunks(SAMPLE_PLANES * NODES);
        for (state, samples) in state.chunks(state_planes(level) * NODES).zip(samples) {
            all.extend(state[..COARSE_STATE_PLANES * NODES].iter().chain(samples).copied());
        }
        Ok(all)
    }

    /// Computes the values (3) and triangles (1) per block of a level's state.
    fn samples(&mut self, level: usize) -> Result<Vec<u32>> {
        let kernel = if level == 0 { Kernel::SamplesChords } else { Kernel::SamplesMetrics };
        let bytes = self.grid.levels[level].blocks.list.len() as u64 * SAMPLE_PLANES as u64 * PLANE;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let buffer = self.context.buffer("samples", bytes, usage)?;
        self.dispatch_stored(kernel, level, std::slice::from_ref(&buffer), self.at_level(level));
        // The buffer is temporary, so its bind group must not be kept either.
        self.memory.bind_groups.retain(|(of, ..), _| *of != kernel);
        self.read(level, &buffer, SAMPLE_PLANES)
    }

    /// Sets the displacements and triangles of a level's solved charts; its values follow from them.
    pub fn set_state(&mut self, level: usize, bits: &[u32]) -> Result<()> {
        self.energy_is_known = false;
        let mut state = Vec::with_capacity(bits.len() / STATE_PLANES * state_planes(level));
        for block in bits.chunks(STATE_PLANES * NODES) {
            state.extend_from_slice(&block[..COARSE_STATE_PLANES * NODES]);
            if level == 0 {
                state.extend_from_slice(&block[(STATE_PLANES - 1) * NODES..]);
            }
        }
        // On level 0 the other charts keep their results in these planes.
        if level == 0 && self.charts.contains(&false) {
            let present = self.read_state(level)?;
            let block = state_planes(level) * NODES;
            for (b, of) in self.grid.levels[level].blocks.list.iter().enumerate() {
                if !self.charts[of.chart as usize] {
                    state[b * block..][..block].copy_from_slice(&present[b * block..][..block]);
                }
            }
        }
        self.recorder.flush();
        self.upload(self.state_buffer(level), 0, &state)
    }

    /// Per chart, the energy of a level's present state.
    pub fn energies_of(&mut self, level: usize) -> Result<Vec<f64>> {
        self.energy_is_known = false;
        self.energy(self.at_level(level), level, DECIDE_ENERGY);
        // The energy of an invalid state is infinite on the CPU.
        let energy = |x: f32| if x < INVALID_ENERGY { f64::from(x) } else { f64::INFINITY };
        Ok(self.chart_records()?.iter().map(|chart| energy(chart.energy)).collect())
    }

    /// Assembles a level's system for its present state. Returns its rows and its right-hand side.
    pub fn assembled(&mut self, level: usize) -> Result<[Vec<u32>; 2]> {
        self.assemble(level);
        let vectors = self.read_vectors(level)?;
        Ok([self.rows(level)?, vector_planes(&vectors, RESIDUAL)])
    }

    /// A level's system, in planes per block: the diagonal (3), the pairs of the owned edges (8).
    pub fn rows(&mut self, level: usize) -> Result<Vec<u32>> {
        let rows = self.memory.levels[level].rows.clone();
        self.read(level, &rows, ROW_PLANES)
    }

    /// The last step on a level, before it was limited, and the step fraction of each node.
    pub fn step_of(&mut self, level: usize) -> Result<[Vec<u32>; 2]> {
        let vectors = self.read_vectors(level)?;
        let records = self.chart_records()?;
        let list = &self.grid.levels[level].blocks.list;
        // The rounds of the step limit write the two planes alternately.
        let rounds = |b: usize| records[list[b].chart as usize].limit_rounds.saturating_sub(1);
        let plane = |b: usize| FRACTION + (rounds(b) & 1) as usize;
        let fraction =
            (0..list.len()).flat_map(|b| &vectors[(b * VECTOR_PLANES + plane(b)) * NODES..][..NODES]);
        Ok([vector_planes(&vectors, STEP), fraction.copied().collect()])
    }

    /// Reads all planes of one of a level's buffers, in the order of its blocks.
    fn read(&mut self, level: usize, buffer: &wgpu::Buffer, planes: usize) -> Result<Vec<u32>> {
        self.recorder.flush();
        let bytes = self.grid.levels[level].blocks.list.len() as u64 * planes as u64 * PLANE;
        Ok(bytemuck::pod_collect_to_vec(&self.context.read(buffer, 0..bytes)?).into())
    }

    fn read_state(&mut self, level: usize) -> Result<Vec<u32>> {
        let state = self.state_buffer(level).clone();
        self.read(level, &state, state_planes(level))
    }

    fn read_vectors(&mut self, level: usize) -> Result<Vec<u32>> {
        let vectors = self.memory.levels[level].vectors.clone();
        self.read(level, &vectors, VECTOR_PLANES)
    }

    fn upload<T: bytemuck::NoUninit>(&self, buffer: &wgpu::Buffer, offset: u64, data: &[T]) -> Result<()> {
        self.context.contain(|| self.context.queue.write_buffer(buffer, offset, bytemuck::cast_slice(data)))
    }
}

/// Two planes of the vectors, `first` and the next one, per block.
fn vector_planes(vectors: &[u32], first: usize) -> Vec<u32> {
    let pair = first * NODES..(first + 2) * NODES;
    vectors.chunks(VECTOR_PLANES * NODES).flat_map(|block| &block[pair.clone()]).copied().collect()
}
