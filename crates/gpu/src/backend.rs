//! What `vrtm` knows of an open GPU and of its results.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::context::Context;
use super::external;
use super::invert::Output;
use super::memory::{Memory, kind, most_blocks};
use super::results::Displacements;
use vrtm_core::allocation::boxed;
use vrtm_core::backend::{Gpu, GpuOutput, GpuWarp, TileSolver};
use vrtm_core::error::Result;
use vrtm_core::grid::Grid;
use vrtm_core::image::external::ExternalTexels;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::mesh::TileMesh;
use vrtm_core::panics::contain;
use vrtm_core::report::AdapterInfo;

impl Gpu for Context {
    fn info(&self) -> &AdapterInfo {
        &self.about
    }

    fn alive(&self) -> Result<()> {
        Context::alive(self)
    }

    fn reclaim(&self) {
        // Only work that has finished is looked at. An error here occurs again in the next call that returns a result.
        let _ = contain(|| self.device.poll(wgpu::PollType::Poll));
    }

    fn lose(&self) {
        self.device.destroy();
        // The loss is reported once the queue is empty.
        let _ = contain(|| self.device.poll(wgpu::PollType::wait_indefinitely()));
    }

    fn time_kernels(&self, yes: bool) {
        self.time_kernels.store(yes, Ordering::Relaxed);
    }

    fn solver_bytes(&self, grid: &Grid, tiles: &[&TileMesh]) -> u64 {
        Memory::bytes_for(grid, tiles)
    }

    fn solver(self: Arc<Self>, grid: &Arc<Grid>, tiles: &[&TileMesh]) -> Result<Box<dyn TileSolver>> {
        Ok(boxed(Memory::new(&self, grid, tiles)?))
    }

    fn are_alike(&self, a: &Grid, b: &Grid) -> bool {
        kind(a) == kind(b)
    }

    fn most_blocks(&self) -> usize {
        most_blocks(self)
    }

    fn output_bytes(&self, size: [usize; 2], format: PixelFormat) -> Option<u64> {
        Output::bytes_for(self, size, format)
    }

    fn output(self: Arc<Self>, size: [usize; 2], format: PixelFormat) -> Result<Box<dyn GpuOutput>> {
        Ok(boxed(Output::new(&self, size, format)?))
    }

    fn external_bytes(&self, texels: &ExternalTexels) -> Result<u64> {
        external::bytes_for(self, texels)
    }

    fn write_external(
        &self,
        u: Option<&dyn GpuWarp>,
        cells: [usize; 2],
        origin: Option<[u32; 2]>,
        texels: &ExternalTexels,
    ) -> Result<()> {
        external::write(self, u.map(Displacements::of).transpose()?, cells, origin, texels)
    }
}
