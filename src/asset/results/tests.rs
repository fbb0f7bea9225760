//! Tests that fetch a GPU's result on both backends.

use std::sync::Arc;

use super::*;
use crate::device::Device;
use crate::{Asset, FetchKind, ImageLayout, ImageView, ImageViewMut, PixelFormat};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::backend::Warp;
use vrtm_core::mesh::{MeshSource, UvSource};
use vrtm_core::settings::{Backend, DeviceSettings, Quality, SolveOptions, TileSettings};
use vrtm_core::view::Strided;

/// Inverts a GPU's result on the GPU and on the CPU.
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
    asset.set_settings(0, &TileSettings { grid: [Some(128), Some(96)], ..TileSettings::default() }).unwrap();
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
            let warp = Arc::new(Warp::Host(of_gpu.warp.host().unwrap().into()));
            let show = |solved: Arc<Solved>| {
                let tiles = vec![Some(TileResult { solved, kept: false, late: false })];
                asset.results.replace(Last { tiles, solved_ms: Some(0.0), ..Last::default() });
            };
            show(Arc::new(of_gpu.with_warp(warp)));
            let (on_cpu, cpu_ms) = fetch(&asset, kind, size);
            show(of_gpu);
            let mut worst = 0.0f64;
            for (k, (a, b)) in on_gpu.iter().zip(&on_cpu).enumerate() {
                let off = (f64::from(*a) - f64::from(*b)).abs();
                // The offset from the centre is in f32 cells, from f32 barycentrics; then the output itself is f32.
                let slack = 4e-6 / 96.0 + f64::from(b.abs() * f32::EPSILON);
                assert!(off < slack, "{kind:?} {size:?}: {k}: {a} {b}");
                worst = worst.max(off * f64::from(size[k % 2]));
            }
            println!("{kind:?} {size:?}: {worst:.1e} texel; {gpu_ms:.2} ms, on the CPU {cpu_ms:.2} ms");
        }
    }
}
