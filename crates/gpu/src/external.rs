//! Computes a redirection on the GPU and writes it into memory of the host's own graphics device. All steps that can
//! fail precede the single submission that writes to that memory.

use std::num::NonZeroU64;
use std::ops::Range;

use bytemuck::{Pod, Zeroable};

use super::context::Context;
#[cfg(test)]
use super::generated::WgslType;
use super::generated::structs;
use super::invert::{Inversion, TEXEL_BYTES, max_binding};
use super::kernels::{Binding, Kernel, slot};
use super::layout::SPREAD;
use super::pipelines::Pipeline;
use super::results::Displacements;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::image::external::ExternalTexels;

mod import;

structs! {
    /// A band of texel rows that the kernel `redirect` writes into the host's memory.
    pub struct RedirectRequest {
        /// Texels per row.
        width: u32,
        /// The band's first row, counted from v = 0 upward.
        row: u32,
        /// Number of rows in the band.
        rows: u32,
        /// Index of the band's first texel in the host's memory, in texels from the start of the binding.
        first: u32,
        /// Distance in the host's memory from a row to the next one, in texels, modulo 2^32.
        step: u32,
        /// 1 to write redirections as offsets from the texel's centre; 0 to write UVs.
        is_delta: u32,
        /// Number of the grid's cells along u and v.
        cells: [u32; 2],
        /// The tile's lower left corner in UV space, which is added to UVs.
        origin: [u32; 2],
    }
}

/// Bytes between two requests, and alignment of bindings: WebGPU's largest alignment of storage bindings.
const ALIGNMENT: u64 = 256;
/// The maximum number of texels on a side, so that f32 resolves texels.
const MAX_SIDE: usize = 1 << 20;

/// Texel rows written by one dispatch, and the bytes of the host's memory bound for them.
struct RowBand {
    rows: Range<usize>,
    bytes: Range<u64>,
}

/// Divides the rows into bands whose texels fit into a binding, both packed and in the host's memory.
fn bands(texels: &ExternalTexels, most: u64) -> Result<Vec<RowBand>> {
    let &ExternalTexels { size, row_stride, offset, is_top_first, .. } = texels;
    let row_bytes = size[0] as u64 * TEXEL_BYTES;
    let room = most.saturating_sub(ALIGNMENT + row_bytes);
    if size.iter().any(|&side| side > MAX_SIDE) || row_bytes > most.saturating_sub(ALIGNMENT) {
        let message = format!("image: {}x{} texels are more than a GPU writes at once", size[0], size[1]);
        return Err(Error::new(ErrorKind::Unsupported, message));
    }
    // From the first byte of the first row to the last byte of the last row.
    let rows = (room / row_stride + 1).min(most / row_bytes).clamp(1, size[1] as u64) as usize;
    let of = |first: usize| {
        let rows = first..(first + rows).min(size[1]);
        let at = if is_top_first { size[1] - rows.end } else { rows.start };
        let start = offset + at as u64 * row_stride;
        let end = start + (rows.len() as u64 - 1) * row_stride + row_bytes;
        RowBand { rows, bytes: start - start % ALIGNMENT..end }
    };
    Ok((0..size[1]).step_by(rows).map(of).collect())
}

fn request(
    texels: &ExternalTexels,
    band: &RowBand,
    cells: [usize; 2],
    origin: Option<[u32; 2]>,
) -> RedirectRequest {
    let &ExternalTexels { size, row_stride, offset, is_top_first, .. } = texels;
    let step = (row_stride / TEXEL_BYTES) as u32;
    // The index in memory of the band's first row.
    let at = if is_top_first { size[1] - 1 - band.rows.start } else { band.rows.start };
    RedirectRequest {
        width: size[0] as u32,
        row: band.rows.start as u32,
        rows: band.rows.len() as u32,
        first: ((offset + at as u64 * row_stride - band.bytes.start) / TEXEL_BYTES) as u32,
        step: if is_top_first { step.wrapping_neg() } else { step },
        is_delta: u32::from(origin.is_none()),
        cells: cells.map(|n| n as u32),
        origin: origin.unwrap_or_default(),
    }
}

/// See `Gpu::external_bytes`.
pub fn bytes_for(context: &Context, texels: &ExternalTexels) -> Result<u64> {
    let bands = bands(texels, max_binding(context))?;
    let rows = bands.iter().map(|band| band.rows.len()).max().unwrap_or_default();
    Ok((rows * texels.size[0]) as u64 * TEXEL_BYTES)
}

/// See `Gpu::write_external`.
pub fn write(
    context: &Context,
    u: Option<&Displacements>,
    cells: [usize; 2],
    origin: Option<[u32; 2]>,
    texels: &ExternalTexels,
) -> Result<()> {
    let redirection = Redirection::new(context, cells, origin, texels, max_binding(context))?;
    let inversion = redirection.inversion(u)?;
    let image = redirection.image()?;
    // This comes last, after everything else that can fail for lack of a resource.
    let imported = import::Imported::new(context, texels)?;
    let (take, give) = imported.transfers(context)?;
    let commands = redirection.record(inversion.as_ref(), &image, &imported.buffer)?;
    context.submit([take, commands, give])?;
    context.wait()
}

/// The dispatches that write a redirection.
struct Redirection<'a> {
    context: &'a Context,
    pipeline: &'a Pipeline,
    size: [usize; 2],
    bands: Vec<RowBand>,
    /// Per band, its request.
    requests: wgpu::Buffer,
    centres: wgpu::Buffer,
}

impl<'a> Redirection<'a> {
    /// Prepares the dispatches, with bindings of at most `most` bytes.
    fn new(
        context: &'a Context,
        cells: [usize; 2],
        origin: Option<[u32; 2]>,
        texels: &ExternalTexels,
        most: u64,
    ) -> Result<Redirection<'a>> {
        let size = texels.size;
        let bands = bands(texels, most)?;
        let pipeline = context.pipeline(Kernel::Redirect)?;
        let mut requests = zeroed::<u8>(bands.len() * ALIGNMENT as usize);
        for (band, record) in bands.iter().zip(requests.chunks_exact_mut(ALIGNMENT as usize)) {
            let request = request(texels, band, cells, origin);
            record[..size_of::<RedirectRequest>()].copy_from_slice(bytemuck::bytes_of(&request));
        }
        let requests = context.filled("requests", &requests, wgpu::BufferUsages::STORAGE)?;
        // Computed as on the CPU. The low word comes first, because all machines with such GPUs are little-endian.
        let centre = |n: usize| (0..n).map(move |x| ((x as f64 + 0.5) / n as f64).to_bits());
        let centres: Vec<u64> = centre(size[0]).chain(centre(size[1])).collect();
        let centres =
            context.filled("centres", bytemuck::cast_slice(&centres), wgpu::BufferUsages::STORAGE)?;
        Ok(Redirection { context, pipeline, size, bands, requests, centres })
    }

    /// The dispatches that invert the displacements for these bands.
    fn inversion(&self, u: Option<&'a Displacements>) -> Result<Option<Inversion<'a>>> {
        let rows: Vec<Range<usize>> = self.bands.iter().map(|band| band.rows.clone()).collect();
        let pipeline = self.context.pipeline(Kernel::Invert)?;
        u.map(|u| Inversion::new(self.context, pipeline, u, self.size, &rows)).transpose()
    }

    /// A buffer for W⁻¹ at the texels of a band.
    fn image(&self) -> Result<wgpu::Buffer> {
        let rows = self.bands.iter().map(|band| band.rows.len()).max().unwrap_or_default();
        let bytes = (rows * self.size[0]) as u64 * TEXEL_BYTES;
        self.context.buffer("image", bytes, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST)
    }

    /// Records all bands: W⁻¹ into `image`, and its values into the host's memory.
    fn record(
        &self,
        inversion: Option<&Inversion>,
        image: &wgpu::Buffer,
        memory: &wgpu::Buffer,
    ) -> Result<wgpu::CommandEncoder> {
        let context = self.context;
        context.contain(|| {
            let label = wgpu::CommandEncoderDescriptor { label: Some("redirect") };
            let mut encoder = context.device.create_command_encoder(&label);
            for (k, band) in self.bands.iter().enumerate() {
                let bytes = (band.rows.len() * self.size[0]) as u64 * TEXEL_BYTES;
                encoder.clear_buffer(image, 0, Some(bytes));
                if let Some(inversion) = inversion {
                    inversion.record(&mut encoder, k, image);
                }
                self.dispatch(&mut encoder, k, image, memory);
            }
            encoder
        })
    }

    fn dispatch(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        k: usize,
        image: &wgpu::Buffer,
        memory: &wgpu::Buffer,
    ) {
        let band = &self.bands[k];
        let buffers = [
            range(&self.requests, k as u64 * ALIGNMENT, size_of::<RedirectRequest>() as u64),
            self.centres.as_entire_binding(),
            image.as_entire_binding(),
            range(memory, band.bytes.start, band.bytes.end - band.bytes.start),
        ];
        let bind_group = bind_group(self.context, self.pipeline, buffers);
        let workgroups = (band.rows.len() * self.size[0]).div_ceil(64) as u32;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline.pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(workgroups.min(SPREAD), workgroups.div_ceil(SPREAD), 1);
    }
}

fn range(buffer: &wgpu::Buffer, offset: u64, size: u64) -> wgpu::BindingResource<'_> {
    wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size: NonZeroU64::new(size) })
}

fn bind_group(
    context: &Context,
    pipeline: &Pipeline,
    buffers: [wgpu::BindingResource<'_>; 4],
) -> wgpu::BindGroup {
    let numbers = Kernel::Redirect.source().bindings.iter().map(|&binding| Binding::number(binding));
    debug_assert!(numbers.clone().eq(slot::EXTRA..slot::EXTRA + 4));
    let entries = numbers.zip(buffers).map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource });
    context.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("redirect"),
        layout: &pipeline.layout,
        entries: &entries.collect::<Vec<_>>(),
    })
}

#[cfg(test)]
mod tests;
