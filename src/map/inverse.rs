//! W⁻¹ of a tile's result at texel centres, on the backend that holds the result.

use std::sync::Arc;

use crate::device::{Booked, Device};
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::image::ImagePart;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::team::Team;
use vrtm_cpu::invert::{self, Found, Texel};

use super::Form;
use super::canvas::Canvas;
use crate::solved::Solved;
use vrtm_beyond::gutter::{Gutter, LimitedTexels};
use vrtm_beyond::owners::Owners;
use vrtm_core::backend::{Gpu, GpuOutput, GpuWarp, Warp};

/// A redirection that is limited by less, in texels, does not count.
const LEAST: f32 = 1e-5;

/// Memory for images fetched from a GPU. One serves all tiles of an asset in turn: most of the time their images have
/// the same size.
#[derive(Debug, Default)]
pub(crate) struct Outputs(Option<BookedOutput>);

#[derive(Debug)]
struct BookedOutput {
    output: Box<dyn GpuOutput>,
    /// Dropped after the output.
    booked: Booked,
}

/// The centres of the texels of a part of an image, in UV: those of its columns, and those of its rows.
pub(crate) struct Centres([Vec<f64>; 2]);

impl Centres {
    pub fn new(part: &ImagePart) -> Centres {
        Centres([0, 1].map(|axis| {
            let of = |x: usize| (x as f64 + 0.5) / part.size[axis] as f64;
            (part.first[axis]..part.end[axis]).map(of).collect()
        }))
    }
}

/// The part of an image for which a result is inverted, and where its texels are written; where the charts of the
/// result go on beyond their borders, the charts of the texels; and the room for that, if redirections are to stay
/// where there is some.
pub(crate) struct Area<'a> {
    pub device: &'a Device,
    pub team: &'a Team,
    pub solved: &'a Solved,
    pub part: &'a ImagePart,
    pub canvas: &'a Canvas,
    pub owners: Option<&'a Owners>,
    pub room: Option<Room<'a>>,
}

/// The room for redirections beyond the borders of charts, and what was limited.
#[derive(Clone, Copy)]
pub(crate) struct Room<'a> {
    pub gutter: &'a Gutter,
    pub limited: &'a LimitedTexels,
}

impl Area<'_> {
    /// The redirection from `at` to `uv` where there is room for it. Not inlined, since few texels need it.
    #[inline(never)]
    fn limited(&self, room: &Room, chart: u32, [x, y]: [usize; 2], at: [f64; 2], uv: [f64; 2]) -> [f64; 2] {
        let Some(limited) = room.gutter.limit(chart, at, uv) else { return uv };
        if self.owners.is_some_and(|owners| owners.is_inside(x, y)) {
            let by = [0, 1].map(|k| (limited[k] - uv[k]) * self.part.size[k] as f64);
            // Not `hypot`, for which a system's library would have to be newer.
            let by = (by[0] * by[0] + by[1] * by[1]).sqrt() as f32;
            if by > LEAST {
                room.limited.count(by);
            }
        }
        limited
    }
}

/// Outputs larger than this many bytes are freed after each fetch.
const KEPT: u64 = 1 << 28;

impl Outputs {
    /// Writes `value(x, y, uv, delta)` to all texels of a part of an image, by their places in the part, rows from v =
    /// 0 upward: `uv` is W⁻¹ at the texel centre, and `delta` is `uv` minus the centre.
    pub fn invert<const N: usize>(
        &mut self,
        area: &Area,
        centres: &Centres,
        value: impl Fn(usize, usize, [f64; 2], [f64; 2]) -> [f64; N] + Sync,
    ) -> Result<()> {
        let cells = area.solved.grid.levels[0].cells();
        let size = area.part.size;
        let centre = |x: usize, y: usize| [centres.0[0][x], centres.0[1][y]];
        let on_gpu = self.on_gpu(area, PixelFormat::F32, |output, u| {
            output.invert(u, size, &mut |first, texels| {
                area.team.run(texels.len() / size[0], |row| {
                    let (y, texels) = (first + row, texels[row * size[0]..][..size[0]].iter().enumerate());
                    let values = texels.map(|(x, d)| {
                        let (at, delta) = (centre(x, y), [0, 1].map(|k| f64::from(d[k]) / cells[k]));
                        (x, y, value(x, y, [0, 1].map(|k| at[k] + delta[k]), delta))
                    });
                    area.canvas.put_from(0, values);
                });
            })
        });
        if on_gpu? {
            return Ok(());
        }
        let still = |x: usize, y: usize| value(x, y, centre(x, y), [0.0; 2]);
        visit(area, still, |x, y, found, texel| {
            let (at, [px, py]) = (centre(x, y), texel.point);
            let mut uv = [px / cells[0], py / cells[1]];
            if let Some(room) = &area.room
                && found.is_beyond(texel)
            {
                uv = area.limited(room, found.chart, [x, y], at, uv);
            }
            value(x, y, uv, [uv[0] - at[0], uv[1] - at[1]])
        })
    }

    /// Writes the first three channels of a redirection, which the GPU computes as the image holds them. Returns false,
    /// and writes nothing, where the CPU computes it.
    pub fn redirect(&mut self, area: &Area, form: Form) -> Result<bool> {
        let (canvas, size, format) = (area.canvas, area.part.size, area.canvas.format());
        let row_bytes = size[0] * 2 * format.size();
        self.on_gpu(area, format, |output, u| {
            output.redirect(u, size, form.origin(), format, &mut |first, bytes| {
                area.team.run(bytes.len() / row_bytes, |row| {
                    canvas.put_row(first + row, &bytes[row * row_bytes..][..row_bytes]);
                });
            })
        })
    }

    /// Has the GPU write a whole image with two channels of this format. Returns false where the CPU does it: where
    /// charts may lie over one another, it tells their texels apart.
    fn on_gpu(
        &mut self,
        area: &Area,
        format: PixelFormat,
        write: impl FnOnce(&dyn GpuOutput, &dyn GpuWarp) -> Result<()>,
    ) -> Result<bool> {
        let Area { device, solved, part: &ImagePart { size, .. }, .. } = *area;
        if let Warp::Gpu(u) = &*solved.warp
            && solved.extended.is_none()
            && area.part.extent() == size
            && let Some(gpu) = device.gpu()
            && let Some(bytes) = gpu.output_bytes(size, format)
        {
            let of = self.output(device, gpu, size, format, bytes)?;
            let result = write(&*of.output, &**u);
            self.0 = Some(of).filter(|of| of.booked.bytes() <= KEPT && result.is_ok());
            return result.map(|()| true);
        }
        Ok(false)
    }

    /// Takes the output out, if images of this size and format fit into it, and otherwise makes one.
    fn output(
        &mut self,
        device: &Device,
        gpu: &Arc<dyn Gpu>,
        size: [usize; 2],
        format: PixelFormat,
        bytes: u64,
    ) -> Result<BookedOutput> {
        // The old output is freed before the new one is allocated.
        if let Some(of) = self.0.take().filter(|of| of.output.holds(size, format)) {
            return Ok(of);
        }
        let mut booked = device.booking();
        booked.set(bytes, &format!("an image of {}x{} texels", size[0], size[1]))?;
        Ok(BookedOutput { output: gpu.clone().output(size, format)?, booked })
    }
}

/// Writes `value(jacobian)` to all texels of a part of an image, as `Outputs::invert` does: of the derivatives of W⁻¹
/// by the UV, one row per component.
pub(crate) fn jacobians<const N: usize>(
    area: &Area,
    value: impl Fn([[f64; 2]; 2]) -> [f64; N] + Sync,
) -> Result<()> {
    let level = &area.solved.grid.levels[0];
    // Converts cells per texel to UV per UV.
    let of = |axis: usize| area.part.size[axis] as f64;
    let scale = [level.nx, level.ny].map(|cells| [0, 1].map(|axis| of(axis) / cells as f64));
    let still = |_, _| value([[1.0, 0.0], [0.0, 1.0]]);
    visit(area, still, |_, _, found, texel| {
        let [[a, b], [c, d]] = found.jacobian(texel);
        value([[a * scale[0][0], b * scale[0][1]], [c * scale[1][0], d * scale[1][1]]])
    })
}

/// Writes `still(x, y)` to all texels of a part of an image, by their places in the part, and then `moved` to the
/// texels in moved cells. Never writes one texel on two threads at once.
fn visit<const N: usize>(
    area: &Area,
    still: impl Fn(usize, usize) -> [f64; N] + Sync,
    moved: impl Fn(usize, usize, &Found, &Texel) -> [f64; N] + Sync,
) -> Result<()> {
    let Area { team, solved, part, canvas, owners, .. } = *area;
    let u = solved.warp.host()?;
    let [width, height] = part.extent();
    team.run(height, |y| canvas.put_from(0, (0..width).map(|x| (x, y, still(x, y)))));
    let own = solved.extended.as_ref().map(|tile| tile.own() as u32);
    // Where a warp folds, several cells cover the same texel: the last cell always wins.
    invert::texels(team, &solved.grid, own, u, part, &solved.report, &|found| {
        let texels = found.texels.iter().map(|texel| (texel.at.map(|x| x as usize), texel));
        let own =
            texels.filter(|([x, y], _)| owners.is_none_or(|owners| owners.chart(*x, *y) == found.chart));
        canvas.put_from(0, own.map(|([x, y], texel)| (x, y, moved(x, y, found, texel))));
    });
    Ok(())
}
