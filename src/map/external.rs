//! Writes redirections into memory of a host's graphics device.

use crate::device::Device;
use crate::solved::Solved;
use vrtm_core::clock::Instant;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::image::external::{ExternalImage, ExternalTexels};

use super::{FetchKind, Form};

/// # Errors
/// `Unsupported` for kinds other than redirections; `InvalidArgument`, naming the field, for a layout that does not
/// fit.
pub(crate) fn check(kind: FetchKind, image: &ExternalImage) -> Result<ExternalTexels> {
    let texels = image.check("image")?;
    if kind.is_redirection() {
        return Ok(texels);
    }
    let message = format!("kind: {kind:?} is computed on the CPU, and not written to memory of a GPU");
    Err(Error::new(ErrorKind::Unsupported, message))
}

/// Writes a redirection of a result; see `Tile::fetch_external`.
pub(crate) fn write(
    device: &Device,
    solved: &Solved,
    kind: FetchKind,
    texels: &ExternalTexels,
) -> Result<()> {
    let start = Instant::now();
    let Some(gpu) = device.gpu() else {
        let message = "tile: its device is the CPU, which does not write to memory of a GPU";
        return Err(Error::new(ErrorKind::Unsupported, message));
    };
    if solved.extended.is_some() {
        let message = "tile: its charts go on beyond their borders (settings.seams, settings.open_borders), which memory of a GPU \
                       is not written with";
        return Err(Error::new(ErrorKind::Unsupported, message));
    }
    let origin = Form::new(kind, &solved.mesh).origin();
    // On a GPU device only the identity is in host memory.
    let u = solved.warp.on_gpu();
    let level = &solved.grid.levels[0];
    let bytes = gpu.external_bytes(texels)?;
    let what = format!("an image of {}x{} texels", texels.size[0], texels.size[1]);
    let mut booked = device.booking();
    booked.set(bytes, &what)?;
    gpu.write_external(u, [level.nx, level.ny], origin, texels)?;
    // The buffers have been dropped: this frees their memory and releases the host's memory.
    drop(booked);
    solved.set_invert_ms(start.elapsed().as_secs_f32() * 1000.0);
    Ok(())
}
