//! W⁻¹ of a tile's result at texel centres, on the backend that has the result.

use crate::cpu::invert::{self, Inverse};
use crate::device::Device;
use crate::error::Result;
use crate::gpu::{self, Displacements};
use crate::image::ImagePart;
use crate::memory::Collect;
use crate::team::Team;

use super::backend::Warp;
use super::solved::Solved;

/// What fetched images come through on their way from a GPU. One serves all tiles of an asset, one after the other:
/// most of the time their images have the same size.
#[derive(Debug, Default)]
pub(super) struct Outputs {
    gpu: Option<gpu::Output>,
    /// The memory that the device has on its account for this output.
    booked: u64,
}

/// The centres of the texels of a part of an image, in UV: those of its columns, and those of its rows.
pub(super) struct Centres([Vec<f64>; 2]);

impl Centres {
    pub fn new(part: &ImagePart) -> Centres {
        Centres([0, 1].map(|axis| {
            let of = |x: usize| (x as f64 + 0.5) / part.size[axis] as f64;
            (part.first[axis]..part.end[axis]).map(of).collected()
        }))
    }
}

/// More bytes than these are given back after each fetch.
const KEPT: u64 = 1 << 28;

impl Outputs {
    /// Calls `put(x, y, uv, delta)` for all texels of a part of an image, with their places in the part, rows from v = 0
    /// upward: W⁻¹ at the texel centre, and the same less the centre. A texel may come twice, its last call counts; never on two threads at
    /// once.
    pub fn invert(
        &mut self,
        device: &Device,
        team: &Team,
        solved: &Solved,
        part: &ImagePart,
        centres: &Centres,
        put: impl Fn(usize, usize, [f64; 2], [f64; 2]) + Sync,
    ) -> Result<()> {
        let level = &solved.grid.levels[0];
        let cells = [level.nx as f64, level.ny as f64];
        let (size, extent) = (part.size, part.extent());
        let centre = |x: usize, y: usize| [centres.0[0][x], centres.0[1][y]];
        if let Warp::Gpu(u) = &*solved.warp
            && extent == size
            && gpu::Output::suits(&u.context, size)
        {
            return self.on_gpu(device, u, size, |first, texels| {
                team.run(texels.len() / size[0], |row| {
                    let y = first + row;
                    for (x, d) in texels[row * size[0]..][..size[0]].iter().enumerate() {
                        let delta = [0, 1].map(|k| f64::from(d[k]) / cells[k]);
                        let at = centre(x, y);
                        put(x, y, [0, 1].map(|k| at[k] + delta[k]), delta);
                    }
                });
            });
        }
        let still = |x: usize, y: usize| put(x, y, centre(x, y), [0.0; 2]);
        visit(team, solved, part, still, |x, y, inverse| {
            let (uv, at) = ([0, 1].map(|k| inverse.p[k] / cells[k]), centre(x, y));
            put(x, y, uv, [0, 1].map(|k| uv[k] - at[k]));
        })
    }

    fn on_gpu(
        &mut self,
        device: &Device,
        u: &Displacements,
        size: [usize; 2],
        read: impl FnMut(usize, &[[f32; 2]]),
    ) -> Result<()> {
        let output = match self.gpu.take().filter(|output| output.holds(size)) {
            Some(output) => output,
            None => {
                // The old one goes before the new one comes.
                self.release(device);
                let bytes = gpu::Output::bytes_for(&u.context, size);
                device.rebook(0, bytes, &format!("an image of {}x{} texels", size[0], size[1]))?;
                self.booked = bytes;
                gpu::Output::new(&u.context, size).inspect_err(|_| self.release(device))?
            }
        };
        let result = output.invert(u, size, read);
        self.gpu = Some(output);
        if self.booked > KEPT || result.is_err() {
            self.release(device);
        }
        result
    }

    /// After a call that memory was missing for: the output may be gone.
    pub fn settle(&mut self, device: &Device) {
        if self.gpu.is_none() {
            self.release(device);
        }
    }

    /// Frees the memory and takes it off the device's budget.
    pub fn release(&mut self, device: &Device) {
        self.gpu = None;
        let _ = device.rebook(self.booked, 0, "");
        self.booked = 0;
        if let Some(context) = device.gpu() {
            context.reclaim();
        }
    }
}

/// Calls `put(x, y, jacobian)` for all texels of a part of an image, as `Outputs::invert` does: the derivatives of W⁻¹ by
/// the UV, a row for each component.
pub(super) fn jacobians(
    team: &Team,
    solved: &Solved,
    part: &ImagePart,
    put: impl Fn(usize, usize, [[f64; 2]; 2]) + Sync,
) -> Result<()> {
    let level = &solved.grid.levels[0];
    // Cells per texel to UV per UV.
    let of = |axis: usize| part.size[axis] as f64;
    let scale = [level.nx, level.ny].map(|cells| [0, 1].map(|axis| of(axis) / cells as f64));
    let still = |x: usize, y: usize| put(x, y, [[1.0, 0.0], [0.0, 1.0]]);
    visit(team, solved, part, still, |x, y, inverse| {
        let cells = inverse.jacobian();
        put(x, y, [0, 1].map(|k| [0, 1].map(|axis| cells[k][axis] * scale[k][axis])));
    })
}

/// Calls `still(x, y)` for all texels of a part of an image, with their places in the part, and then `moved` for those in
/// moved cells. Never for one texel on two threads at once.
fn visit(
    team: &Team,
    solved: &Solved,
    part: &ImagePart,
    still: impl Fn(usize, usize) + Sync,
    moved: impl Fn(usize, usize, Inverse) + Sync,
) -> Result<()> {
    let u = solved.warp.host()?;
    let (first, extent) = (part.first, part.extent());
    team.run(extent[1], |y| (0..extent[0]).for_each(|x| still(x, y)));
    let reach = solved.report.max_displacement;
    let visit = |team: &Team| {
        invert::texels(team, &solved.grid, u, part, reach, |x, y, inverse| {
            moved(x - first[0], y - first[1], inverse);
        });
    };
    // Where a warp folds, several cells have the same texel: on one thread, the last one always gets it.
    if solved.report.folds > 0 {
        Team::with(1, visit)
    } else {
        visit(team)
    }
    Ok(())
}

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use std::sync::Arc;

    use super::super::results::{Last, TileResult};
    use super::*;
    use crate::mesh::{MeshSource, UvSource};
    use crate::settings::{Backend, DeviceSettings, Quality, SolveOptions, TileSettings};
    use crate::view::Strided;
    use crate::{Asset, FetchKind, ImageLayout, ImageView, ImageViewMut, PixelFormat};

    /// A GPU's result, inverted there and on the CPU.
    #[test]
    fn both_backends_invert_a_result_alike() {
        let settings = DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() };
        if crate::adapters().is_empty() {
            println!("skipped: no GPU adapter");
            return;
        }
        let device = Device::new(&settings).unwrap();
        if device.gpu().is_none() {
            println!("skipped: {}", device.info().reason);
            return;
        }
        let rest = [0.0, 0.5, 1.0].map(|y| [0.0, 0.4, 1.0].map(|x: f32| [x, y, 0.0]));
        let mut pose = rest;
        pose.iter_mut().for_each(|row| row[1] = [0.6, row[1][1] * 1.2, 0.1]);
        let uvs: Vec<[f32; 2]> = rest.as_flattened().iter().map(|p| [p[0], p[1]]).collect();
        let corners = [0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7];
        let source = MeshSource {
            positions: Strided::from_f32x3(rest.as_flattened()),
            face_counts: Some(&[4; 4]),
            indices: &corners,
            uvs: UvSource { u: Strided::from_f32x2(&uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        };
        let mut asset = Asset::new(&device, &source).unwrap();
        let spots: Vec<u8> =
            (0..64 * 64).map(|i| if i / 8 % 3 == 0 && i / 512 % 2 == 0 { 255 } else { 0 }).collect();
        let map = ImageView::new("rigidity", &spots, ImageLayout::packed(64, 64, PixelFormat::U8)).unwrap();
        asset.set_rigidity(0, Some(map)).unwrap();
        asset
            .set_settings(0, &TileSettings { grid: [Some(128), Some(96)], ..TileSettings::default() })
            .unwrap();
        let options = SolveOptions { quality: Quality::Draft, ..SolveOptions::default() };
        asset.solve(Strided::from_f32x3(pose.as_flattened()), &options).unwrap();
        assert!(asset.tile_report(0).unwrap().max_displacement > 1.0);
        let fetch = |asset: &Asset, kind, size: [u32; 2]| {
            let mut bytes = vec![0; (size[0] * size[1]) as usize * 8];
            let layout = ImageLayout::packed(size[0], size[1], PixelFormat::F32);
            asset.fetch(0, kind, &mut ImageViewMut::new("image", &mut bytes, layout).unwrap()).unwrap();
            (bytemuck::pod_collect_to_vec::<u8, f32>(&bytes), asset.tile_report(0).unwrap().times.invert)
        };
        for size in [[128, 96], [64, 48], [512, 512], [77, 131], [1, 1]] {
            for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta] {
                fetch(&asset, kind, size);
                let (on_gpu, gpu_ms) = fetch(&asset, kind, size);
                let of_gpu = asset.results.solved(0).unwrap().solved;
                assert!(matches!(&*of_gpu.warp, Warp::Gpu(_)), "{}", device.info().reason);
                let warp = Arc::new(Warp::Host(of_gpu.warp.host().unwrap().to_vec()));
                let show = |solved: Arc<Solved>| {
                    let tiles = vec![Some(TileResult { solved, kept: false })];
                    asset.results.replace(Last { tiles, solved_ms: Some(0.0) });
                };
                show(Arc::new(of_gpu.with_warp(warp)));
                let (on_cpu, cpu_ms) = fetch(&asset, kind, size);
                show(of_gpu);
                let mut worst = 0.0f64;
                for (k, (a, b)) in on_gpu.iter().zip(&on_cpu).enumerate() {
                    let off = (f64::from(*a) - f64::from(*b)).abs();
                    // The way from the centre is f32 cells, from f32 barycentrics; then the output is f32 itself.
                    let slack = 4e-6 / 96.0 + f64::from(b.abs() * f32::EPSILON);
                    assert!(off < slack, "{kind:?} {size:?}: {k}: {a} {b}");
                    worst = worst.max(off * f64::from(size[k % 2]));
                }
                println!("{kind:?} {size:?}: {worst:.1e} texel; {gpu_ms:.2} ms, on the CPU {cpu_ms:.2} ms");
            }
        }
    }
}
