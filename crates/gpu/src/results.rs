//! A result on the GPU: the state of level 0, whose displacements are read into host memory on demand.

use std::any::Any;
use std::ops::Range;
use std::sync::{Arc, OnceLock};

use super::context::Context;
use super::layout::{FINEST_STATE_PLANES, PLANE};
use vrtm_core::allocation::{Vec, boxed};
use vrtm_core::backend::GpuWarp;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::grid::planes::{NODES, Plane};

/// The buffers of a result.
#[derive(Debug)]
pub struct ResultBuffers {
    /// A solve works in it: it is the state of level 0 until it becomes its result.
    pub state: wgpu::Buffer,
    /// The records of level 0's blocks, kept alive because a result may outlive its solver.
    pub blocks: wgpu::Buffer,
}

/// Bytes of a block of a result.
pub const RESULT_BLOCK: u64 = FINEST_STATE_PLANES as u64 * PLANE;

/// The displacements of a result.
#[derive(Debug)]
pub struct Displacements {
    pub context: Arc<Context>,
    pub grid: Arc<Grid>,
    pub buffers: Arc<ResultBuffers>,
    /// The blocks of the grid among those of the buffers, which may hold the results of several tiles.
    pub blocks: Range<usize>,
    host: OnceLock<Vec<[Plane; 2]>>,
}

impl Displacements {
    pub fn new(context: Arc<Context>, grid: Arc<Grid>, buffers: Arc<ResultBuffers>) -> Displacements {
        let blocks = 0..grid.levels[0].blocks.list.len();
        Displacements { context, grid, buffers, blocks, host: OnceLock::new() }
    }

    /// Displacements that this backend has made.
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
        let [first, end] = [self.blocks.start, self.blocks.end].map(|b| b as u64 * RESULT_BLOCK);
        let bytes = self.context.read(&self.buffers.state, first..end)?;
        let planes = |block: &[u8]| {
            // The displacements are the first two planes.
            let mut planes = [[0.0f32; NODES]; 2];
            for (value, bytes) in planes.as_flattened_mut().iter_mut().zip(block.chunks_exact(4)) {
                *value = f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            }
            planes
        };
        let all = bytes.chunks_exact(RESULT_BLOCK as usize).map(planes).collect();
        Ok(self.host.get_or_init(|| all))
    }

    fn part(&self, grid: &Arc<Grid>, blocks: Range<usize>) -> Box<dyn GpuWarp> {
        let (context, buffers) = (self.context.clone(), self.buffers.clone());
        boxed(Displacements { blocks, ..Displacements::new(context, grid.clone(), buffers) })
    }
}
