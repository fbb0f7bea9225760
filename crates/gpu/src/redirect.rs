//! redirect: the values of a redirection, in the format that a host asks for, from W⁻¹ at texel centres.

use std::ops::Range;

use super::context::Context;
use super::kernels::Kernel;
use super::layout::{RedirectRequest, SPREAD};
use super::pipelines::{Pipeline, range};
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::error::Result;
use vrtm_core::image::format::PixelFormat;

/// Bytes of W⁻¹ at a texel's centre: two f32.
pub const INVERSE_BYTES: u64 = 8;
/// Bytes between two requests, and alignment of bindings: WebGPU's largest alignment of storage bindings.
pub const ALIGNMENT: u64 = 256;

/// Bytes of a texel: two channels of this format.
pub fn texel_bytes(format: PixelFormat) -> u64 {
    2 * format.size() as u64
}

/// Texel rows written by one dispatch, and where they lie.
pub struct RowBand {
    pub rows: Range<usize>,
    /// The bytes bound for them, from a multiple of `ALIGNMENT` on.
    pub bytes: Range<u64>,
    /// Index of the first texel of the first row, counted in texels from the start of the binding.
    pub first: u32,
    /// Distance to the next row, in texels, modulo 2^32.
    pub step: u32,
}

/// Values to write.
#[derive(Clone, Copy, Debug)]
pub struct Values {
    /// The image's width and height.
    pub size: [usize; 2],
    /// Number of the grid's cells along u and v.
    pub cells: [usize; 2],
    /// The tile's lower left corner, which is added to UVs; `None` for offsets from the texels' centres.
    pub origin: Option<[u32; 2]>,
    pub format: PixelFormat,
}

/// The dispatches that write a redirection, one for each band of rows.
pub struct Redirection<'a> {
    context: &'a Context,
    pipeline: &'a Pipeline,
    width: usize,
    pub bands: Vec<RowBand>,
    /// Per band, its request.
    requests: wgpu::Buffer,
    centres: wgpu::Buffer,
}

impl<'a> Redirection<'a> {
    pub fn new(context: &'a Context, values: &Values, bands: Vec<RowBand>) -> Result<Redirection<'a>> {
        let &Values { size, cells, origin, format } = values;
        let pipeline = context.pipeline(Kernel::Redirect)?;
        let mut requests = zeroed::<u8>(bands.len() * ALIGNMENT as usize);
        for (band, record) in bands.iter().zip(requests.chunks_exact_mut(ALIGNMENT as usize)) {
            let request = RedirectRequest {
                width: size[0] as u32,
                row: band.rows.start as u32,
                rows: band.rows.len() as u32,
                first: band.first,
                step: band.step,
                is_delta: u32::from(origin.is_none()),
                is_half: u32::from(format == PixelFormat::F16),
                cells: cells.map(|n| n as u32),
                origin: origin.unwrap_or_default(),
            };
            record[..size_of::<RedirectRequest>()].copy_from_slice(bytemuck::bytes_of(&request));
        }
        let requests = context.filled("requests", &requests, wgpu::BufferUsages::STORAGE)?;
        // Computed as on the CPU. The low word comes first, because all machines with such GPUs are little-endian.
        let centre = |n: usize| (0..n).map(move |x| ((x as f64 + 0.5) / n as f64).to_bits());
        let centres: Vec<u64> = centre(size[0]).chain(centre(size[1])).collect();
        let centres =
            context.filled("centres", bytemuck::cast_slice(&centres), wgpu::BufferUsages::STORAGE)?;
        Ok(Redirection { context, pipeline, width: size[0], bands, requests, centres })
    }

    /// Bytes of W⁻¹ at the texels of the largest band.
    pub fn inverse_bytes(&self) -> u64 {
        let rows = self.bands.iter().map(|band| band.rows.len()).max().unwrap_or_default();
        (rows * self.width) as u64 * INVERSE_BYTES
    }

    /// Records the dispatch of band `k`: from W⁻¹ at its texels to the values in `memory`.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        k: usize,
        inverse: &wgpu::Buffer,
        memory: &wgpu::Buffer,
    ) {
        let band = &self.bands[k];
        let buffers = [
            range(&self.requests, k as u64 * ALIGNMENT, size_of::<RedirectRequest>() as u64),
            self.centres.as_entire_binding(),
            inverse.as_entire_binding(),
            range(memory, band.bytes.start, band.bytes.end - band.bytes.start),
        ];
        let bind_group = self.pipeline.bind_group(&self.context.device, Kernel::Redirect.source(), buffers);
        let workgroups = (band.rows.len() * self.width).div_ceil(64) as u32;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline.pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(workgroups.min(SPREAD), workgroups.div_ceil(SPREAD), 1);
    }
}

#[cfg(test)]
mod tests;
