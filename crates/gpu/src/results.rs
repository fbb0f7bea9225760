//! A result on the GPU: the state of level 0, whose displacements are read into host memory on demand.

use std::any::Any;
use std::sync::{Arc, OnceLock};

use super::bands::Band;
use super::context::Context;
use super::layout::{FINEST_STATE_PLANES, PLANE};
use vrtm_core::allocation::Vec;
use vrtm_core::backend::GpuWarp;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{NODES, Plane};

/// The buffers of a result, per band. A solve works in them: they are the state of level 0 until they become its
/// result.
#[derive(Debug)]
pub struct ResultBuffers {
    pub bands: Vec<(Band, wgpu::Buffer)>,
    /// The records of the bands' blocks, kept alive because a result may outlive its solver.
    pub blocks: Vec<wgpu::Buffer>,
}

/// Bytes of a block of a result.
pub const RESULT_BLOCK: u64 = FINEST_STATE_PLANES as u64 * PLANE;

impl ResultBuffers {
    pub fn new(
        bands: &[Band],
        blocks: Vec<wgpu::Buffer>,
        storage: &impl Fn(&str, u64) -> Result<wgpu::Buffer>,
    ) -> Result<ResultBuffers> {
        let bands = bands
            .iter()
            .map(|band| Ok((band.clone(), storage("result", band.buffered.len() as u64 * RESULT_BLOCK)?)))
            .collect::<Result<Vec<_>>>()?;
        Ok(ResultBuffers { bands, blocks })
    }
}

/// The displacements of a result.
#[derive(Debug)]
pub struct Displacements {
    pub context: Arc<Context>,
    pub grid: Arc<Grid>,
    pub buffers: Arc<ResultBuffers>,
    host: OnceLock<Vec<[Plane; 2]>>,
}

impl Displacements {
    pub fn new(context: Arc<Context>, grid: Arc<Grid>, buffers: Arc<ResultBuffers>) -> Displacements {
        Displacements { context, grid, buffers, host: OnceLock::new() }
    }

    /// Those that this backend has made.
    pub fn of(u: &dyn GpuWarp) -> Result<&Displacements> {
        let other = || Error::new(ErrorKind::Internal, "the result of another backend");
        (u as &dyn Any).downcast_ref().ok_or_else(other)
    }
}

impl GpuWarp for Displacements {
    fn host(&self) -> Result<&[[Plane; 2]]> {
        if let Some(host) = self.host.get() {
            return Ok(host);
        }
        let mut all = Vec::with_capacity(self.grid.levels[0].blocks.list.len());
        for (band, buffer) in &self.buffers.bands {
            let range =
                [band.owned.start, band.owned.end].map(|b| (b - band.buffered.start) as u64 * RESULT_BLOCK);
            let bytes = self.context.read(buffer, range[0]..range[1])?;
            all.extend(bytes.chunks_exact(RESULT_BLOCK as usize).map(|block| {
                // The displacements are the first two planes.
                let mut planes = [[0.0f32; NODES]; 2];
                for (value, bytes) in planes.as_flattened_mut().iter_mut().zip(block.chunks_exact(4)) {
                    *value = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
                }
                planes
            }));
        }
        Ok(self.host.get_or_init(|| all))
    }
}
