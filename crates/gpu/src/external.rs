//! Computes a redirection on the GPU and writes it into memory of the host's own graphics device. All steps that can
//! fail precede the single submission that writes to that memory.

use std::ops::Range;

use super::context::Context;
use super::invert::{Inversion, max_binding};
use super::kernels::Kernel;
use super::redirect::{ALIGNMENT, INVERSE_BYTES, Redirection, RowBand, Values, texel_bytes};
use super::results::Displacements;
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::image::external::ExternalTexels;

mod import;

/// The maximum number of texels on a side, so that f32 resolves texels.
const MAX_SIDE: usize = 1 << 20;

/// Divides the rows into bands whose texels fit into a binding, both packed and in the host's memory.
fn bands(texels: &ExternalTexels, most: u64) -> Result<Vec<RowBand>> {
    let &ExternalTexels { size, row_stride, offset, is_top_first, format, .. } = texels;
    let row_bytes = size[0] as u64 * texel_bytes(format);
    let inverse_bytes = size[0] as u64 * INVERSE_BYTES;
    let room = most.saturating_sub(ALIGNMENT + inverse_bytes);
    if size.iter().any(|&side| side > MAX_SIDE) || inverse_bytes > most.saturating_sub(ALIGNMENT) {
        let message = format!("image: {}x{} texels are more than a GPU writes at once", size[0], size[1]);
        return Err(Error::new(ErrorKind::Unsupported, message));
    }
    // From the first byte of the first row to the last byte of the last row.
    let rows = (room / row_stride + 1).min(most / inverse_bytes).clamp(1, size[1] as u64) as usize;
    let of = |first: usize| {
        let rows = first..(first + rows).min(size[1]);
        let at = if is_top_first { size[1] - rows.end } else { rows.start };
        let start = offset + at as u64 * row_stride;
        let end = start + (rows.len() as u64 - 1) * row_stride + row_bytes;
        let bytes = start - start % ALIGNMENT..end;
        let step = (row_stride / texel_bytes(format)) as u32;
        // Of rows from the top, the last one is the band's first.
        let at = start + if is_top_first { (rows.len() as u64 - 1) * row_stride } else { 0 };
        let first = ((at - bytes.start) / texel_bytes(format)) as u32;
        RowBand { rows, bytes, first, step: if is_top_first { step.wrapping_neg() } else { step } }
    };
    Ok((0..size[1]).step_by(rows).map(of).collect())
}

/// See `Gpu::external_bytes`.
pub fn bytes_for(context: &Context, texels: &ExternalTexels) -> Result<u64> {
    let bands = bands(texels, max_binding(context))?;
    let rows = bands.iter().map(|band| band.rows.len()).max().unwrap_or_default();
    Ok((rows * texels.size[0]) as u64 * INVERSE_BYTES)
}

/// See `Gpu::write_external`.
pub fn write(
    context: &Context,
    u: Option<&Displacements>,
    cells: [usize; 2],
    origin: Option<[u32; 2]>,
    texels: &ExternalTexels,
) -> Result<()> {
    let values = Values { size: texels.size, cells, origin, format: texels.format };
    let redirection = Redirection::new(context, &values, bands(texels, max_binding(context))?)?;
    let inversion = u.map(|u| inversion(context, u, texels.size, &redirection)).transpose()?;
    let inverse = inverse_buffer(context, &redirection)?;
    // This comes last, after everything else that can fail for lack of a resource.
    let imported = import::Imported::new(context, texels)?;
    let (take, give) = imported.transfers(context)?;
    let commands = record(context, &redirection, inversion.as_ref(), &inverse, &imported.buffer)?;
    context.submit([take, commands, give])?;
    context.wait()
}

/// The dispatches that invert the displacements for these bands.
fn inversion<'a>(
    context: &'a Context,
    u: &'a Displacements,
    size: [usize; 2],
    redirection: &Redirection,
) -> Result<Inversion<'a>> {
    let rows: Vec<Range<usize>> = redirection.bands.iter().map(|band| band.rows.clone()).collect();
    Inversion::new(context, context.pipeline(Kernel::Invert)?, u, size, &rows)
}

/// A buffer for W⁻¹ at the texels of a band.
fn inverse_buffer(context: &Context, redirection: &Redirection) -> Result<wgpu::Buffer> {
    use wgpu::BufferUsages as Usage;
    context.buffer("image", redirection.inverse_bytes(), Usage::STORAGE | Usage::COPY_DST)
}

/// Records all bands: W⁻¹ into `inverse`, and its values into the host's memory.
fn record(
    context: &Context,
    redirection: &Redirection,
    inversion: Option<&Inversion>,
    inverse: &wgpu::Buffer,
    memory: &wgpu::Buffer,
) -> Result<wgpu::CommandEncoder> {
    context.contain(|| {
        let label = wgpu::CommandEncoderDescriptor { label: Some("redirect") };
        let mut encoder = context.device.create_command_encoder(&label);
        for k in 0..redirection.bands.len() {
            match inversion {
                Some(inversion) => inversion.record(&mut encoder, k, inverse),
                None => encoder.clear_buffer(inverse, 0, None),
            }
            redirection.record(&mut encoder, k, inverse, memory);
        }
        encoder
    })
}

#[cfg(test)]
mod tests;
