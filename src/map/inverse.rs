//! W⁻¹ of a tile's result at texel centres, on the backend that holds the result.

use std::sync::Arc;

use crate::device::{Booked, Device};
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;
use vrtm_core::image::ImagePart;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::team::Team;
use vrtm_cpu::invert::{self, Inverse};

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

/// The part of an image that is inverted; where the charts of the result go on beyond their borders, the charts of its
/// texels; and the room for that, if redirections are to stay where there is some.
pub(crate) struct Area<'a> {
    pub part: &'a ImagePart,
    pub owners: Option<&'a Owners>,
    pub room: Option<Room<'a>>,
}

/// The room for redirections beyond the borders of charts, and what was limited.
#[derive(Clone, Copy)]
pub(crate) struct Room<'a> {
    pub gutter: &'a Gutter,
    pub limited: &'a LimitedTexels,
}

/// Outputs larger than this many bytes are freed after each fetch.
const KEPT: u64 = 1 << 28;

impl Outputs {
    /// Calls `put(x, y, uv, delta)` for all texels of a part of an image, with their places in the part, rows from v =
    /// 0 upward: `uv` is W⁻¹ at the texel centre, and `delta` is `uv` minus the centre. A texel may come twice, and its
    /// last call counts, but never on two threads at once.
    pub fn invert(
        &mut self,
        device: &Device,
        team: &Team,
        solved: &Solved,
        area: &Area,
        centres: &Centres,
        put: impl Fn(usize, usize, [f64; 2], [f64; 2]) + Sync,
    ) -> Result<()> {
        let level = &solved.grid.levels[0];
        let cells = [level.nx as f64, level.ny as f64];
        let size = area.part.size;
        let centre = |x: usize, y: usize| [centres.0[0][x], centres.0[1][y]];
        let on_gpu = self.on_gpu(device, solved, area, PixelFormat::F32, |output, u| {
            output.invert(u, size, &mut |first, texels| {
                team.run(texels.len() / size[0], |row| {
                    let y = first + row;
                    for (x, d) in texels[row * size[0]..][..size[0]].iter().enumerate() {
                        let delta = [0, 1].map(|k| f64::from(d[k]) / cells[k]);
                        let at = centre(x, y);
                        put(x, y, [0, 1].map(|k| at[k] + delta[k]), delta);
                    }
                });
            })
        });
        if on_gpu? {
            return Ok(());
        }
        let still = |x: usize, y: usize| put(x, y, centre(x, y), [0.0; 2]);
        visit(team, solved, area, still, |x, y, inverse| {
            let at = centre(x, y);
            let [px, py] = inverse.point();
            let mut uv = [px / cells[0], py / cells[1]];
            if let Some(room) = area.room
                && inverse.is_beyond()
                && let Some(limited) = room.gutter.limit(inverse.chart, at, uv)
            {
                if area.owners.is_some_and(|owners| owners.is_inside(x, y)) {
                    let by = [0, 1].map(|k| (limited[k] - uv[k]) * size[k] as f64);
                    // Not `hypot`, for which a system's library would have to be newer.
                    let by = (by[0] * by[0] + by[1] * by[1]).sqrt() as f32;
                    if by > LEAST {
                        room.limited.count(by);
                    }
                }
                uv = limited;
            }
            put(x, y, uv, [uv[0] - at[0], uv[1] - at[1]]);
        })
    }

    /// Writes the first three channels of a redirection, which the GPU computes as the image holds them. Returns false,
    /// and writes nothing, where the CPU computes it.
    pub fn redirect(
        &mut self,
        device: &Device,
        team: &Team,
        solved: &Solved,
        area: &Area,
        form: Form,
        canvas: &Canvas,
    ) -> Result<bool> {
        let (size, format) = (area.part.size, canvas.format());
        let row_bytes = size[0] * 2 * format.size();
        self.on_gpu(device, solved, area, format, |output, u| {
            output.redirect(u, size, form.origin(), format, &mut |first, bytes| {
                team.run(bytes.len() / row_bytes, |row| {
                    canvas.put_row(first + row, &bytes[row * row_bytes..][..row_bytes]);
                });
            })
        })
    }

    /// Has the GPU write a whole image with two channels of this format. Returns false where the CPU does it: where
    /// charts may lie over one another, it tells their texels apart.
    fn on_gpu(
        &mut self,
        device: &Device,
        solved: &Solved,
        area: &Area,
        format: PixelFormat,
        write: impl FnOnce(&dyn GpuOutput, &dyn GpuWarp) -> Result<()>,
    ) -> Result<bool> {
        let size = area.part.size;
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

/// Calls `put(x, y, jacobian)` for all texels of a part of an image, as `Outputs::invert` does: the derivatives of W⁻¹
/// by the UV, one row per component.
pub(crate) fn jacobians(
    team: &Team,
    solved: &Solved,
    area: &Area,
    put: impl Fn(usize, usize, [[f64; 2]; 2]) + Sync,
) -> Result<()> {
    let level = &solved.grid.levels[0];
    // Converts cells per texel to UV per UV.
    let of = |axis: usize| area.part.size[axis] as f64;
    let scale = [level.nx, level.ny].map(|cells| [0, 1].map(|axis| of(axis) / cells as f64));
    let still = |x: usize, y: usize| put(x, y, [[1.0, 0.0], [0.0, 1.0]]);
    visit(team, solved, area, still, |x, y, inverse| {
        let [[a, b], [c, d]] = inverse.jacobian();
        put(x, y, [[a * scale[0][0], b * scale[0][1]], [c * scale[1][0], d * scale[1][1]]]);
    })
}

/// Calls `still(x, y)` for all texels of a part of an image, with their places in the part, and then `moved` for the
/// texels in moved cells. Never calls for one texel on two threads at once.
fn visit(
    team: &Team,
    solved: &Solved,
    area: &Area,
    still: impl Fn(usize, usize) + Sync,
    moved: impl Fn(usize, usize, Inverse) + Sync,
) -> Result<()> {
    let u = solved.warp.host()?;
    let Area { part, owners, .. } = *area;
    let (first, extent) = (part.first, part.extent());
    team.run(extent[1], |y| (0..extent[0]).for_each(|x| still(x, y)));
    let reach = solved.report.max_displacement;
    let visit = |team: &Team| {
        let own = solved.extended.as_ref().map(|tile| tile.own() as u32);
        invert::texels(team, &solved.grid, own, u, part, reach, |x, y, inverse| {
            let (x, y) = (x - first[0], y - first[1]);
            if owners.is_none_or(|owners| owners.chart(x, y) == inverse.chart) {
                moved(x, y, inverse);
            }
        });
    };
    // Where a warp folds, several cells cover the same texel: on one thread, the last cell always wins.
    if solved.report.folds > 0 {
        Team::with(1, visit)
    } else {
        visit(team)
    }
    Ok(())
}
