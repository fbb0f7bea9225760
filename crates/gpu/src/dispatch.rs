//! How stages record their dispatches: over lists of blocks, block colour by block colour, under gates, with sums per
//! block and decisions based on them. Also copies blocks between the bands of a level.

use super::kernels::Kernel;
use super::layout::{self, METRIC_PLANES, PLANE, Params, ROW_PLANES, VECTOR_PLANES, state_planes};
use super::lists::{Gate, GateSet, List, MAX_GATES};
use super::recorder::DispatchSize;
use super::run::Run;
use super::sizes::CONTRIBUTIONS;
use vrtm_core::allocation::{Vec, make_room_in};
use vrtm_core::grid::planes::NODES;

/// The buffers of a band whose blocks are copied to neighbour bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BandBuffer {
    State,
    Metric,
    Nodes,
    Rows,
    Vectors,
    Contributions,
}

impl Run<'_> {
    /// The extra buffer of kernels that may apply the pull: the previous result. It is not read without a pull, nor on
    /// coarser levels (`with_pull`).
    pub(super) fn anchor(&self, level: usize, band: usize) -> wgpu::Buffer {
        match &self.last_result {
            Some(result) if level == 0 => result.bands[band].1.clone(),
            _ => self.memory.no_contributions.clone(),
        }
    }

    /// The state of a band; on level 0 it is the result that this solve writes.
    pub(super) fn state_buffer(&self, level: usize, band: usize) -> &wgpu::Buffer {
        self.memory.buffers[level][band].state.as_ref().unwrap_or_else(|| &self.result.bands[band].1)
    }

    /// Selects the charts that the following kernels work on; `mode` is one of `SELECT_`.
    pub(super) fn select(&mut self, mode: u32) {
        let params = Params { mode, ..self.params };
        let size = DispatchSize::ungated(params.items.div_ceil(layout::THREADS));
        self.dispatch(Kernel::SelectCharts, [0, 0], &[], &params, size, 0);
    }

    /// The size of a dispatch; under a closed gate it becomes 0. `size_index` is its index among the dispatch sizes.
    pub(super) fn dispatch_size(&self, size_index: u32, workgroups: u32) -> DispatchSize {
        let gate = self.gate.map(|gate| {
            let arguments = gate.set as u32 * self.memory.dispatch_size_count + size_index;
            (self.memory.indirect_arguments.clone(), u64::from(arguments) * 16, gate.number)
        });
        DispatchSize { workgroups, gate }
    }

    /// Records a gate. Until `self.gate` is reset, the following dispatches run only if some chart is at work at this
    /// point and was limited by at least `limited` dispatches of the step limit.
    pub(super) fn open_gate(&mut self, set: GateSet, limited: u32) {
        let count = self.memory.dispatch_size_count;
        let number = self.gates.min(MAX_GATES - 1);
        self.gates += 1;
        self.gate = None;
        let first = set as u32 * count;
        let params = Params { first, count, partial: number, mode: limited, ..self.params };
        let extra = [
            self.memory.dispatch_sizes.clone(),
            self.memory.indirect_arguments.clone(),
            self.memory.gate_open.clone(),
        ];
        self.dispatch(Kernel::Gate, [0, 0], &extra, &params, DispatchSize::ungated(1), 0);
        self.gate = Some(Gate { set, number });
    }

    /// Records one dispatch on the buffers of band `at` (level, index) and the kernel's extra buffers. `bytes` is the
    /// least number of bytes that it moves.
    pub(super) fn dispatch(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        extra: &[wgpu::Buffer],
        params: &Params,
        size: DispatchSize,
        bytes: u64,
    ) {
        if size.workgroups == 0 {
            return;
        }
        if self.error.is_some() {
            return;
        }
        // Blocks of charts that take no part in a further correction return at once.
        let bytes = bytes * self.share[0] / self.share[1].max(1);
        let context = self.context.clone();
        let pipeline = match context.pipeline(kernel) {
            Ok(pipeline) => pipeline,
            Err(error) => {
                self.error = Some(error);
                return;
            }
        };
        let key = (kernel, at, self.state_buffer(at[0], at[1]).clone(), Vec::from(extra));
        let bind_group = match self.memory.bind_groups.get(&key) {
            Some(bind_group) => bind_group.clone(),
            None => {
                let bind_group = self.memory.bind_group(kernel, &pipeline.layout, at, &key.2, extra);
                make_room_in(&mut self.memory.bind_groups, 1);
                #[expect(clippy::disallowed_methods, reason = "room was made above")]
                self.memory.bind_groups.insert(key, bind_group.clone());
                bind_group
            }
        };
        self.recorder.dispatch(kernel, &pipeline.pipeline, &bind_group, params, size, bytes);
    }

    /// Dispatches a kernel over a list of a band's blocks.
    pub(super) fn dispatch_list(
        &mut self,
        kernel: Kernel,
        at: [usize; 2],
        extra: &[wgpu::Buffer],
        list: List,
        params: Params,
    ) {
        let List { first, count, size_index } = list;
        let bytes = u64::from(kernel.source().bytes_per_node) * u64::from(count) * NODES as u64
            + self.triangle_bytes(kernel, at[0], count);
        let size = self.dispatch_size(size_index, count);
        let state_planes = state_planes(at[0]) as u32;
        let params = Params { first, count, state_planes, ..params };
        self.dispatch(kernel, at, extra, &params, size, bytes);
    }

    /// Bytes of triangles that a dispatch over `count` blocks of a level reads. Its share of the triangles is taken to
    /// be its share of the level's active blocks.
    pub(super) fn triangle_bytes(&self, kernel: Kernel, level: usize, count: u32) -> u64 {
        let active = self.memory.active_blocks[level].max(1);
        let triangles = self.grid.triangles.len() as u64 * u64::from(count).min(active) / active;
        u64::from(kernel.bytes_per_triangle()) * triangles
    }

    /// Dispatches a kernel over all active blocks of a level, then updates the bands' copies of the buffer that it
    /// wrote.
    pub(super) fn dispatch_active(
        &mut self,
        kernel: Kernel,
        level: usize,
        params: Params,
        written: Option<BandBuffer>,
    ) {
        for band in 0..self.memory.bands[level].len() {
            let active = self.memory.lists[level][band].active;
            self.dispatch_list(kernel, [level, band], &[], active, params);
        }
        if let Some(written) = written {
            self.exchange(level, written);
        }
    }

    /// Calls `f` with each band's list of blocks of each block colour in turn, and updates the copies after each
    /// colour.
    pub(super) fn each_colour(
        &mut self,
        level: usize,
        backwards: bool,
        written: BandBuffer,
        f: impl Fn(&mut Run, usize, List),
    ) {
        for k in 0..4 {
            for band in 0..self.memory.bands[level].len() {
                let list = self.memory.lists[level][band].colours[if backwards { 3 - k } else { k }];
                f(self, band, list);
            }
            self.exchange(level, written);
        }
    }

    /// Dispatches a kernel that writes partial sums per active block.
    pub(super) fn sums(&mut self, kernel: Kernel, level: usize, params: Params) {
        for band in 0..self.memory.bands[level].len() {
            let (active, partial) =
                (self.memory.lists[level][band].active, self.memory.lists[level][band].partial);
            let params = Params { partial, ..params };
            if matches!(kernel, Kernel::EnergyChords | Kernel::EnergyMetrics) {
                let extra = [self.anchor(level, band)];
                self.dispatch_list(kernel, [level, band], &extra, active, params);
            } else {
                self.dispatch_list(kernel, [level, band], &[], active, params);
            }
        }
    }

    /// Dispatches a kernel that writes partial sums per active block, then `decide`, which adds them chart by chart and
    /// makes the decision `decision`, one of `DECIDE_`.
    pub(super) fn reduce(&mut self, kernel: Kernel, level: usize, params: Params, decision: u32) {
        self.sums(kernel, level, params);
        self.decide(level, params, decision);
    }

    /// Dispatches `decide`: makes the decision `decision` from the sums of a level's blocks, chart by chart.
    pub(super) fn decide(&mut self, level: usize, params: Params, decision: u32) {
        let params = Params { mode: decision, level: level as u32, ..params };
        let extra = [self.memory.ranges.clone()];
        let size = self.dispatch_size(0, params.items);
        self.dispatch(Kernel::Decide, [0, 0], &extra, &params, size, 0);
    }

    /// Updates the bands' copies of each other's blocks on a level.
    pub(super) fn exchange(&mut self, level: usize, what: BandBuffer) {
        let Some(bands) = self.memory.bands.get(level) else { return };
        if bands.len() == 1 {
            return;
        }
        let buffer = |band: usize| {
            let buffers = &self.memory.buffers[level][band];
            let (buffer, planes) = match what {
                BandBuffer::State => (self.state_buffer(level, band), state_planes(level)),
                BandBuffer::Metric => (buffers.metric.as_ref()?, METRIC_PLANES),
                BandBuffer::Nodes => (&buffers.nodes, self.params.node_planes as usize),
                BandBuffer::Rows => (&buffers.rows, ROW_PLANES),
                BandBuffer::Vectors => (&buffers.vectors, VECTOR_PLANES),
                BandBuffer::Contributions => (&buffers.contributions, 1),
            };
            Some((buffer.clone(), planes))
        };
        let buffers: Vec<_> = (0..bands.len()).map(buffer).collect();
        for (a, source) in bands.iter().enumerate() {
            for (b, target) in bands.iter().enumerate().filter(|&(b, _)| b != a) {
                let (first, end) = (
                    source.owned.start.max(target.buffered.start),
                    source.owned.end.min(target.buffered.end),
                );
                if let (true, Some((from, planes)), Some((to, _))) = (first < end, &buffers[a], &buffers[b]) {
                    let block = match what {
                        BandBuffer::Contributions => CONTRIBUTIONS,
                        _ => *planes as u64 * PLANE,
                    };
                    let at = |b: usize, start: usize| (b - start) as u64 * block;
                    let bytes = at(end, first);
                    self.recorder.copy(
                        from,
                        at(first, source.buffered.start),
                        to,
                        at(first, target.buffered.start),
                        bytes,
                    );
                }
            }
        }
    }
}
