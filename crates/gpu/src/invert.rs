//! invert: computes W⁻¹ at texel centres (method §9) from a result's buffers, and hands it or the redirection of it to
//! the host. All steps that can fail precede the first texel that is handed out, except for mapping the staging
//! buffers.

use std::ops::Range;
use std::sync::Arc;

use super::context::Context;
use super::kernels::Kernel;
use super::layout::{Request, SPREAD};
use super::pipelines::{Pipeline, range};
use super::redirect::{INVERSE_BYTES, Redirection, RowBand, Values, texel_bytes};
use super::results::Displacements;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::{GpuOutput, GpuWarp};
use vrtm_core::error::Result;
use vrtm_core::image::format::PixelFormat;

/// The maximum number of bytes of an image bound at once: larger bindings would only take memory from other programs.
const MAX_BINDING: u64 = 1 << 26;
/// Bytes between two requests: WebGPU's largest alignment of storage bindings.
const STRIDE: usize = 256;
/// The maximum number of workgroups per block, which is enough for images far finer than the grid.
const MAX_WORKGROUPS_PER_BLOCK: usize = 64;

/// Buffers through which images reach the host, kept from one fetch to the next.
#[derive(Debug)]
pub struct Output {
    context: Arc<Context>,
    /// The maximum number of bytes of W⁻¹ bound at once.
    max_binding: u64,
    /// W⁻¹ at one band of texel rows.
    inverse: wgpu::Buffer,
    /// The same band as the host wants it.
    values: wgpu::Buffer,
    /// All bands of texel rows, in buffers that the host can map.
    staging: Vec<wgpu::Buffer>,
}

pub(super) fn max_binding(context: &Context) -> u64 {
    let limits = &context.limits;
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size).min(MAX_BINDING)
}

/// Divides the texel rows of an image into bands.
fn bands(max_binding: u64, size: [usize; 2]) -> impl Iterator<Item = Range<usize>> {
    let rows = ((max_binding / INVERSE_BYTES) as usize / size[0]).clamp(1, size[1]);
    (0..size[1]).step_by(rows).map(move |row| row..(row + rows).min(size[1]))
}

/// Bytes of a band whose texels take so many bytes.
fn band_bytes(rows: &Range<usize>, size: [usize; 2], texel: u64) -> u64 {
    (rows.len() * size[0]) as u64 * texel
}

impl Output {
    /// Bytes that `new` allocates. `None` if such images cannot be written: a row must fit into a binding, and no side
    /// may exceed 2^20 texels, so that f32 resolves texels.
    pub fn bytes_for(context: &Context, size: [usize; 2], format: PixelFormat) -> Option<u64> {
        let most = max_binding(context);
        let fits = size[0] as u64 * INVERSE_BYTES <= most && size.iter().all(|&n| n <= 1 << 20);
        let texel = texel_bytes(format);
        fits.then(|| {
            let first = bands(most, size).next().unwrap_or_default();
            band_bytes(&first, size, INVERSE_BYTES + texel) + (size[0] * size[1]) as u64 * texel
        })
    }

    /// Allocates the buffers for images of this size and format.
    pub fn new(context: &Arc<Context>, size: [usize; 2], format: PixelFormat) -> Result<Output> {
        Output::with_max_binding(context, size, format, max_binding(context))
    }

    /// The same, with bands of at most `max_binding` bytes.
    fn with_max_binding(
        context: &Arc<Context>,
        size: [usize; 2],
        format: PixelFormat,
        max_binding: u64,
    ) -> Result<Output> {
        use wgpu::BufferUsages as Usage;
        let texel = texel_bytes(format);
        let first = bands(max_binding, size).next().unwrap_or_default();
        let usage = Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC;
        let inverse = context.buffer("inverse", band_bytes(&first, size, INVERSE_BYTES), usage)?;
        let values =
            context.buffer("values", band_bytes(&first, size, texel), Usage::STORAGE | Usage::COPY_SRC)?;
        let staging = bands(max_binding, size)
            .map(|rows| context.staging("image for the host", band_bytes(&rows, size, texel)))
            .collect::<Result<Vec<_>>>()?;
        Ok(Output { context: context.clone(), max_binding, inverse, values, staging })
    }

    /// Computes W⁻¹ at all texels, with the pipeline of `Kernel::Invert`, and of it the values of a redirection, if one
    /// is wanted; hands out the bytes of these, or of W⁻¹.
    fn run(
        &self,
        pipeline: &Pipeline,
        u: &Displacements,
        size: [usize; 2],
        values: Option<&Values>,
        read: &mut dyn FnMut(usize, &[u8]),
    ) -> Result<()> {
        let context = &self.context;
        let texel = values.map_or(INVERSE_BYTES, |values| texel_bytes(values.format));
        let bands: Vec<_> = bands(self.max_binding, size).collect();
        let inversion = Inversion::new(context, pipeline, u, size, &bands)?;
        let packed = |rows: &Range<usize>| RowBand {
            rows: rows.clone(),
            bytes: 0..band_bytes(rows, size, texel),
            first: 0,
            step: size[0] as u32,
        };
        let redirection =
            values.map(|values| Redirection::new(context, values, bands.iter().map(packed).collect()));
        let redirection = redirection.transpose()?;
        let mut encoder = context.contain(|| {
            let label = wgpu::CommandEncoderDescriptor { label: Some("invert") };
            context.device.create_command_encoder(&label)
        })?;
        context.contain(|| {
            for (k, rows) in bands.iter().enumerate() {
                inversion.record(&mut encoder, k, &self.inverse);
                let image = match &redirection {
                    None => &self.inverse,
                    Some(redirection) => {
                        redirection.record(&mut encoder, k, &self.inverse, &self.values);
                        &self.values
                    }
                };
                encoder.copy_buffer_to_buffer(image, 0, &self.staging[k], 0, band_bytes(rows, size, texel));
            }
        })?;
        context.submit([encoder])?;
        for (rows, staging) in bands.iter().zip(&self.staging) {
            context.mapped(staging, band_bytes(rows, size, texel), |bytes| read(rows.start, bytes))?;
        }
        Ok(())
    }
}

impl GpuOutput for Output {
    fn holds(&self, size: [usize; 2], format: PixelFormat) -> bool {
        let texel = texel_bytes(format);
        let mut staging = self.staging.iter();
        bands(self.max_binding, size).all(|rows| {
            let bytes = |texel| band_bytes(&rows, size, texel);
            bytes(INVERSE_BYTES) <= self.inverse.size()
                && bytes(texel) <= self.values.size()
                && staging.next().is_some_and(|staging| bytes(texel) <= staging.size())
        })
    }

    fn invert(
        &self,
        u: &dyn GpuWarp,
        size: [usize; 2],
        read: &mut dyn FnMut(usize, &[[f32; 2]]),
    ) -> Result<()> {
        assert!(self.holds(size, PixelFormat::F32));
        let pipeline = self.context.pipeline(Kernel::Invert)?;
        let read = &mut |row: usize, bytes: &[u8]| read(row, bytemuck::cast_slice(bytes));
        self.run(pipeline, Displacements::of(u)?, size, None, read)
    }

    fn redirect(
        &self,
        u: &dyn GpuWarp,
        size: [usize; 2],
        origin: Option<[u32; 2]>,
        format: PixelFormat,
        read: &mut dyn FnMut(usize, &[u8]),
    ) -> Result<()> {
        assert!(self.holds(size, format));
        let u = Displacements::of(u)?;
        let level = &u.grid.levels[0];
        let values = Values { size, cells: [level.nx, level.ny], origin, format };
        self.run(self.context.pipeline(Kernel::Invert)?, u, size, Some(&values), read)
    }
}

/// The dispatches that invert a result, band by band of texel rows.
pub(super) struct Inversion<'a> {
    context: &'a Context,
    pipeline: &'a Pipeline,
    u: &'a Displacements,
    /// Per band of texel rows, its bytes, and its request.
    band_bytes: Vec<u64>,
    requests: Vec<Request>,
    records: wgpu::Buffer,
    centres: wgpu::Buffer,
}

impl<'a> Inversion<'a> {
    /// Prepares the dispatches for an image of `size` texels in the given bands. `pipeline` is the one of
    /// `Kernel::Invert`.
    pub fn new(
        context: &'a Context,
        pipeline: &'a Pipeline,
        u: &'a Displacements,
        size: [usize; 2],
        bands: &[Range<usize>],
    ) -> Result<Inversion<'a>> {
        let level = &u.grid.levels[0];
        let cells = [level.nx, level.ny];
        let requests = requests(u, size, bands);
        let bytes: Vec<u8> = requests
            .iter()
            .flat_map(|request| {
                let mut record = [0; STRIDE];
                record[..size_of::<Request>()].copy_from_slice(bytemuck::bytes_of(request));
                record
            })
            .collect();
        let records = context.filled("requests", &bytes, wgpu::BufferUsages::STORAGE)?;
        let centres: Vec<i32> =
            (0..2).flat_map(|axis| centres(size[axis], cells[axis], bits(cells))).collect();
        let centres =
            context.filled("centres", bytemuck::cast_slice(&centres), wgpu::BufferUsages::STORAGE)?;
        let band_bytes = bands.iter().map(|rows| band_bytes(rows, size, INVERSE_BYTES)).collect();
        Ok(Inversion { context, pipeline, u, band_bytes, requests, records, centres })
    }

    /// Records the dispatches of band `k` of texel rows into an image, which starts with this band.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, k: usize, image: &wgpu::Buffer) {
        encoder.clear_buffer(image, 0, Some(self.band_bytes[k]));
        let (request, buffers) = (&self.requests[k], &self.u.buffers);
        if request.count == 0 {
            return;
        }
        let request_bytes = size_of::<Request>() as u64;
        let resources = [
            buffers.blocks.as_entire_binding(),
            range(&self.records, (k * STRIDE) as u64, request_bytes),
            self.centres.as_entire_binding(),
            buffers.state.as_entire_binding(),
            image.as_entire_binding(),
        ];
        let bind_group = self.pipeline.bind_group(&self.context.device, Kernel::Invert.source(), resources);
        let workgroups = request.count * request.workgroups_per_block;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(&self.pipeline.pipeline);
        pass.set_bind_group(0, &bind_group, &[]);
        pass.dispatch_workgroups(workgroups.min(SPREAD), workgroups.div_ceil(SPREAD), 1);
    }
}

/// Number of bits b of the lattice of `shaders/invert.wgsl`: a cell has 2^b steps.
fn bits(cells: [usize; 2]) -> u32 {
    30 - cells[0].max(cells[1]).next_power_of_two().ilog2()
}

/// Lattice coordinates of the texel centres along one axis.
fn centres(texels: usize, cells: usize, bits: u32) -> impl Iterator<Item = i32> {
    let (texels, side) = (texels as u64, (cells as u64) << bits);
    (0..texels).map(move |x| (((2 * x + 1) * side + texels) / (2 * texels)) as i32)
}

/// The requests for bands of texel rows.
fn requests(u: &Displacements, size: [usize; 2], bands: &[Range<usize>]) -> Vec<Request> {
    let level = &u.grid.levels[0];
    let cells = [level.nx, level.ny];
    let bits = bits(cells);
    let request = |rows: &Range<usize>| Request {
        first: u.blocks.start as u32,
        count: u.blocks.len() as u32,
        workgroups_per_block: size[1].div_ceil(level.ny).min(MAX_WORKGROUPS_PER_BLOCK) as u32,
        bits,
        width: size[0] as u32,
        height: size[1] as u32,
        row: rows.start as u32,
        rows: rows.len() as u32,
        texels_per_step: [0, 1]
            .map(|axis| (size[axis] as f64 / ((cells[axis] as u64) << bits) as f64) as f32),
    };
    bands.iter().map(request).collect()
}

#[cfg(test)]
mod tests;
