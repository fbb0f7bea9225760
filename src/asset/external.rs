//! Redirections into memory of a host's graphics device.

use std::time::Instant;

use crate::error::{Error, ErrorKind, Result};
use crate::gpu;
use crate::gpu::external::Values;
use crate::image::external::{ExternalImage, ExternalTexels};

use super::backend::Warp;
use super::form::Form;
use super::kind::FetchKind;
use super::results::Results;
use super::solved::Solved;

impl Results {
    /// Writes a redirection of a tile's result into memory of the host's own graphics device, which must be the same GPU,
    /// without a way through the CPU. The texels are, bit by bit, those of [`Results::fetch`]. The call returns when they are
    /// there: no semaphore is needed. The handle stays the caller's.
    ///
    /// # Errors
    /// `NotSolved` before the first solve; `Unsupported` on the CPU, for kinds that are no redirection, and for memory that
    /// this GPU does not import; `InvalidArgument`, naming the field, for a layout that does not fit; `OutOfMemory`. Nothing
    /// is written then. `DeviceLost`: the texels are undefined.
    ///
    /// # Safety
    /// The handle is of memory as the image describes it, and while the call lasts, no other program and no device uses
    /// the image's texels.
    pub unsafe fn fetch_external(&self, tile: usize, kind: FetchKind, image: &ExternalImage) -> Result<()> {
        let texels = image.check("image")?;
        if !kind.is_redirection() {
            let message =
                format!("kind: {kind:?} is computed on the CPU, and not written to memory of a GPU");
            return Err(Error::new(ErrorKind::Unsupported, message));
        }
        self.device().call(|| {
            let solved = self.solved(tile)?.solved;
            self.write_external(&solved, kind, &texels)
        })
    }

    fn write_external(&self, solved: &Solved, kind: FetchKind, texels: &ExternalTexels) -> Result<()> {
        let start = Instant::now();
        let device = self.device();
        let Some(context) = device.gpu() else {
            let message = "tile: its device is the CPU, which does not write to memory of a GPU";
            return Err(Error::new(ErrorKind::Unsupported, message));
        };
        let values = match Form::new(kind, &solved.mesh) {
            Form::Delta => Values::Delta,
            Form::Tile => Values::Absolute([0; 2]),
            Form::Udim(origin) => Values::Absolute(origin.to_array().map(|x| x as u32)),
        };
        let u = match &*solved.warp {
            Warp::Gpu(u) => Some(u),
            // On a GPU's device the identity alone is in host memory.
            Warp::Host(_) => None,
        };
        let level = &solved.grid.levels[0];
        let bytes = gpu::external::bytes_for(context, texels)?;
        let what = format!("an image of {}x{} texels", texels.size[0], texels.size[1]);
        device.rebook(0, bytes, &what)?;
        let result = gpu::external::write(context, u, [level.nx, level.ny], values, texels);
        let _ = device.rebook(bytes, 0, "");
        // The buffers are dropped: their memory goes back, and the hold on the host's ends.
        context.reclaim();
        result?;
        solved.set_invert_ms(start.elapsed().as_secs_f32() * 1000.0);
        Ok(())
    }
}
