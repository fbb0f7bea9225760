//! A tile of an asset, to be read.

use super::results::{Results, TileResult};
use crate::map::certificate::desc::{MapDesc, MapReport};
use crate::map::fetch::Output;
use crate::map::{FetchKind, certificate, dilation, external};
use vrtm_core::error::Result;
use vrtm_core::image::ImageViewMut;
use vrtm_core::image::external::ExternalImage;
use vrtm_core::mesh::TileMesh;
use vrtm_core::report::{GpuWork, TileReport, report};

/// One tile of an asset, with its last good result, as [`Results::tile`] gives it. Calls for a tile that the asset has
/// not return `InvalidArgument`. [`crate::TileMut`] sets its maps and settings.
#[derive(Clone, Copy, Debug)]
pub struct Tile<'a> {
    results: &'a Results,
    index: usize,
}

impl Results {
    /// The tile at `index`, counted as [`crate::Asset::tile_count`] says.
    #[must_use]
    pub fn tile(&self, index: usize) -> Tile<'_> {
        Tile { results: self, index }
    }
}

impl Tile<'_> {
    /// Its UDIM number; panics if there is no such tile, as `uv_set` and `layer` do.
    #[must_use]
    pub fn udim(&self) -> u32 {
        self.mesh().udim
    }

    /// Its UV set.
    #[must_use]
    pub fn uv_set(&self) -> u32 {
        self.mesh().uv_set
    }

    /// Its layer, and the number of layers of its UDIM number.
    #[must_use]
    pub fn layer(&self) -> (u32, u32) {
        (self.mesh().layer, self.results.mesh().layers(self.index).len() as u32)
    }

    fn mesh(&self) -> &TileMesh {
        &self.results.mesh().tiles[self.index]
    }

    fn solved(&self) -> Result<TileResult> {
        self.results.solved(self.index)
    }

    /// Writes one output of its result.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn fetch(&self, kind: FetchKind, image: &mut ImageViewMut) -> Result<()> {
        kind.check_channels("image", image.layout.channels)?;
        let device = self.results.device();
        device.call(|| {
            let solved = self.solved()?.solved;
            let output = Output::new(self.results.mesh(), &solved, kind, image.part(), &image.layout)?;
            device.team(|team| self.results.write(team, output, image))
        })
    }

    /// Writes what a texture must hold around its charts: for each texel whose centre lies beside them, up to
    /// `reach` (in UV, at most 0.5) from a seam, the UV among all tiles, as in [`FetchKind::RedirectionUdim`], of the
    /// texel that shows what the surface shows there; for all other texels their own centre. The fourth channel, if the
    /// image has one, is 1 in charts and where a UV was found, and 0 elsewhere. It depends on the rest pose and the UVs
    /// alone, and needs no solve. Two to four channels.
    pub fn fetch_dilation(&self, reach: f64, image: &mut ImageViewMut) -> Result<()> {
        let Tile { results, index } = *self;
        let (device, mesh) = (results.device(), results.mesh());
        results.check_tile(index)?;
        ensure!(reach > 0.0 && reach <= 0.5, "reach: {reach} is not over 0 and at most 0.5");
        FetchKind::RedirectionUdim.check_channels("image", image.layout.channels)?;
        device.call(|| {
            device.team(|team| {
                dilation::write(team, mesh, index, reach, image);
                Ok(())
            })
        })
    }

    /// Writes a redirection of its result into memory of the host's own graphics device, which must be the same
    /// GPU, without passing through the CPU. The texels, in f32 or f16, are bit-identical to those of
    /// [`Tile::fetch`]. The call returns when they are written, so no semaphore is needed. The caller remains
    /// responsible for the handle.
    ///
    /// # Errors
    /// `NotSolved` before the first solve; `Unsupported` on the CPU, for kinds other than redirections, and for memory
    /// that this GPU does not import. After `DeviceLost` the texels are undefined.
    ///
    /// # Safety
    /// The handle refers to memory as the image describes it, and during the call no other program or device uses the
    /// image's texels.
    pub unsafe fn fetch_external(&self, kind: FetchKind, image: &ExternalImage) -> Result<()> {
        let texels = external::check(kind, image)?;
        let device = self.results.device();
        device.call(|| external::write(device, &self.solved()?.solved, kind, &texels))
    }

    /// Inspects the map that a fetch of this kind, size and format would write: whether it is one-to-one when read with
    /// bilinear interpolation, and how far it is from the redirection. Computed on the CPU.
    ///
    /// # Errors
    /// `NotSolved` before the first solve; `InvalidArgument` for another kind than a redirection; `Unsupported` for
    /// integer formats.
    pub fn inspect_map(&self, desc: &MapDesc) -> Result<MapReport> {
        let device = self.results.device();
        device.call(|| {
            let solved = self.solved()?.solved;
            desc.check()?;
            device.team(|team| certificate::inspect(device, team, self.results.mesh(), &solved, desc))
        })
    }

    /// The report of its last solve.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn report(&self) -> Result<TileReport> {
        let TileResult { solved, kept, late } = self.solved()?;
        let report = solved.report();
        Ok(report!(report, { kept: kept, truncated: report.truncated || late }))
    }

    /// The dispatches, submissions and transfers of its last solve; `None` on the CPU, or if no chart needed
    /// solving.
    ///
    /// # Errors
    /// `NotSolved` before the first solve.
    pub fn gpu_work(&self) -> Result<Option<GpuWork>> {
        self.solved().map(|result| result.solved.work.clone())
    }
}
