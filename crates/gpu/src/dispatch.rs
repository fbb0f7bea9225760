//! How stages record their dispatches: over lists of blocks, block colour by block colour, under gates, with sums per
//! block and decisions based on them.

use super::kernels::Kernel;
use super::layout::{self, Params, state_planes};
use super::lists::{Gate, GateSet, List, MAX_GATES};
use super::recorder::DispatchSize;
use super::run::Run;
use vrtm_core::allocation::{Vec, make_room_in};
use vrtm_core::grid::planes::NODES;

impl Run<'_> {
    /// The extra buffer of kernels that may apply the pull: the previous result. It is not read without a pull, nor on
    /// coarser levels (`with_pull`).
    pub(super) fn anchor(&self, level: usize) -> wgpu::Buffer {
        match &self.last_result {
            Some(result) if level == 0 => result.state.clone(),
            _ => self.memory.no_contributions.clone(),
        }
    }

    /// The state of a level; on level 0 it is the result that this solve writes.
    pub(super) fn state_buffer(&self, level: usize) -> &wgpu::Buffer {
        self.memory.levels[level].state.as_ref().unwrap_or(&self.result.state)
    }

    /// Selects the charts that the following kernels work on; `mode` is one of `SELECT_`.
    pub(super) fn select(&mut self, mode: u32) {
        let params = Params { mode, ..self.params };
        let size = DispatchSize::ungated(params.items.div_ceil(layout::THREADS));
        self.dispatch(Kernel::SelectCharts, 0, &[], &params, size, 0);
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
        let params = Params { first, count, gate: number, mode: limited, ..self.params };
        let extra = [
            self.memory.dispatch_sizes.clone(),
            self.memory.indirect_arguments.clone(),
            self.memory.gate_open.clone(),
        ];
        self.dispatch(Kernel::Gate, 0, &extra, &params, DispatchSize::ungated(1), 0);
        self.gate = Some(Gate { set, number });
    }

    /// Records one dispatch on the buffers of a level and the kernel's extra buffers. `bytes` is the
    /// least number of bytes that it moves.
    pub(super) fn dispatch(
        &mut self,
        kernel: Kernel,
        level: usize,
        extra: &[wgpu::Buffer],
        params: &Params,
        size: DispatchSize,
        bytes: u64,
    ) {
        if size.workgroups == 0 || self.error.is_some() {
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
        let key = (kernel, level, self.state_buffer(level).clone(), Vec::from(extra));
        let bind_group = match self.memory.bind_groups.get(&key) {
            Some(bind_group) => bind_group.clone(),
            None => {
                let bind_group = self.memory.bind_group(kernel, pipeline, level, &key.2, extra);
                make_room_in(&mut self.memory.bind_groups, 1);
                #[expect(clippy::disallowed_methods, reason = "room was made above")]
                self.memory.bind_groups.insert(key, bind_group.clone());
                bind_group
            }
        };
        self.recorder.dispatch(kernel, &pipeline.pipeline, &bind_group, params, size, bytes);
    }

    /// Dispatches a kernel over a list of a level's blocks.
    pub(super) fn dispatch_list(
        &mut self,
        kernel: Kernel,
        level: usize,
        extra: &[wgpu::Buffer],
        list: List,
        params: Params,
    ) {
        let List { first, count, size_index } = list;
        // Its share of the triangles is taken to be its share of the level's active blocks.
        let active = self.memory.active_blocks[level].max(1);
        let triangles = self.grid.triangles.len() as u64 * u64::from(count).min(active) / active;
        let bytes = u64::from(kernel.source().bytes_per_node) * u64::from(count) * NODES as u64
            + u64::from(kernel.bytes_per_triangle()) * triangles;
        let size = self.dispatch_size(size_index, count);
        let state_planes = state_planes(level) as u32;
        let params = Params { first, count, state_planes, ..params };
        self.dispatch(kernel, level, extra, &params, size, bytes);
    }

    /// Dispatches a kernel over all active blocks of a level.
    pub(super) fn dispatch_active(
        &mut self,
        kernel: Kernel,
        level: usize,
        extra: &[wgpu::Buffer],
        params: Params,
    ) {
        let active = self.memory.lists[level].active;
        self.dispatch_list(kernel, level, extra, active, params);
    }

    /// Dispatches a kernel over all stored blocks of a level.
    pub(super) fn dispatch_stored(
        &mut self,
        kernel: Kernel,
        level: usize,
        extra: &[wgpu::Buffer],
        params: Params,
    ) {
        let stored = self.memory.lists[level].stored;
        self.dispatch_list(kernel, level, extra, stored, params);
    }

    /// Dispatches a kernel that writes partial sums per active block, then `decide`, which adds them chart by chart and
    /// makes the decision `decision`, one of `DECIDE_`.
    pub(super) fn reduce(&mut self, kernel: Kernel, level: usize, params: Params, decision: u32) {
        self.dispatch_active(kernel, level, &[], params);
        self.decide(level, params, decision);
    }

    /// Dispatches `decide`: makes the decision `decision` from the sums of a level's blocks, chart by chart.
    pub(super) fn decide(&mut self, level: usize, params: Params, decision: u32) {
        let params = Params { mode: decision, level: level as u32, ..params };
        let extra = [self.memory.ranges.clone()];
        let size = self.dispatch_size(0, params.items);
        self.dispatch(Kernel::Decide, 0, &extra, &params, size, 0);
    }
}
