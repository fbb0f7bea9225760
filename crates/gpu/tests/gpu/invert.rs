//! Redirection maps from a GPU's results, in every format and layout, also after a failure.
//! `tests/solver/invariants` checks that they invert the warp.

use std::sync::OnceLock;

use half::f16;

use vrtm::{
    Asset, Device, DeviceSettings, ErrorKind, FetchKind, ImageLayout, ImageViewMut, Origin, PixelFormat,
    Quality,
};

use vrtm_testkit::{self, Model, fetch, gpu, has_gpu, options, raw, scenes, texels};

const KINDS: [FetchKind; 2] = [FetchKind::Redirection, FetchKind::RedirectionDelta];

/// One device for all tests: creating its pipelines takes longer than the tests.
fn device() -> Option<&'static Device> {
    static DEVICE: OnceLock<Option<Device>> = OnceLock::new();
    // Without a GPU, each test prints a message.
    if !has_gpu() {
        return None;
    }
    DEVICE.get_or_init(|| gpu(&DeviceSettings::default())).as_ref()
}

fn solved(model: &Model, device: &Device, grid: u32) -> Asset {
    let asset = model.solved(device, grid, 1, &options(Quality::Draft));
    assert!(asset.tile(0).report().unwrap().max_displacement > 0.5, "{}", model.name);
    asset
}

#[test]
fn every_layout_holds_the_same_texels() {
    let Some(device) = device() else { return };
    let model = Model::from(scenes::mug_to_jug());
    let mut asset = solved(&model, device, 128);
    let (width, height) = (75usize, 50usize);
    for kind in KINDS {
        let whole = fetch(&mut asset, 0, kind, [width as u32, height as u32]);
        for (format, size) in [(PixelFormat::F32, 8), (PixelFormat::F16, 4)] {
            for origin in [Origin::Top, Origin::Bottom] {
                let mut packed: Option<Vec<u8>> = None;
                for (pixel, row, tail) in [(0, 0, 0), (size + 5, (size + 5) * width + 13, 99)] {
                    let layout = ImageLayout {
                        origin,
                        pixel_stride: (pixel > 0).then_some(pixel),
                        row_stride: (row > 0).then_some(row),
                        ..ImageLayout::packed(width as u32, height as u32, format)
                    };
                    let (pixel, row) = (pixel.max(size), row.max(size * width));
                    let out = raw(&asset, 0, kind, layout, row * height + tail, 0xa5);
                    let mut texels = Vec::new();
                    let mut written = vec![false; out.len()];
                    for y in 0..height {
                        let line = if origin == Origin::Bottom { y } else { height - 1 - y };
                        for x in 0..width {
                            let at = line * row + x * pixel;
                            texels.extend_from_slice(&out[at..at + size]);
                            written[at..at + size].fill(true);
                        }
                    }
                    assert!(out.iter().zip(&written).all(|(byte, written)| *written || *byte == 0xa5));
                    if format == PixelFormat::F32 {
                        assert!(vrtm_testkit::floats(&texels) == whole, "{kind:?} {origin:?}");
                    }
                    assert!(packed.get_or_insert_with(|| texels.clone()) == &texels, "{kind:?} {origin:?}");
                }
                if format == PixelFormat::F16 {
                    for (half, value) in packed.unwrap().chunks_exact(2).zip(whole.iter().flatten()) {
                        assert_eq!(half, f16::from_f32(*value).to_ne_bytes(), "{kind:?}: {value}");
                    }
                }
            }
        }
    }
}

/// A delta in f16 takes half of the bytes on the way to the host, is off by its rounding alone, and is the CPU's.
#[test]
fn a_delta_in_f16_is_off_by_a_thirtieth_of_a_texel_of_4096() {
    let Some(device) = device() else { return };
    for model in [scenes::analytic::bulge(), scenes::mug_to_jug(), scenes::arm()].map(Model::from) {
        let mut asset = solved(&model, device, 128);
        let (side, kind) = (256usize, FetchKind::RedirectionDelta);
        let layout = ImageLayout::packed(side as u32, side as u32, PixelFormat::F16);
        let halves = |bytes: &[u8]| -> Vec<f16> {
            bytes.chunks_exact(2).map(|two| f16::from_ne_bytes([two[0], two[1]])).collect()
        };
        let found = texels(asset.results(), 0, kind, [side as u32; 2], [f16::ZERO; 2]).concat();
        let exact = fetch(&mut asset, 0, kind, [side as u32; 2]);
        let (mut worst, mut largest) = (0.0f32, 0.0f32);
        for (half, &exact) in found.iter().zip(exact.iter().flatten()) {
            let off = (half.to_f32() - exact).abs();
            // 11 significant bits, or the smallest step.
            assert!(off <= (exact.abs() / 2048.0).max(2f32.powi(-25)), "{}: {half} of {exact}", model.name);
            (worst, largest) = (worst.max(4096.0 * off), largest.max(exact.abs()));
        }
        // Up to 1/32 the step is 2^-16.
        assert!(worst <= (largest * 2.0).max(1.0 / 32.0), "{}: {worst} texels at {largest}", model.name);
        // Parts of an image are inverted on the CPU, here from the GPU's warp.
        let in_parts = |format: PixelFormat| {
            let mut parts = vec![0u8; side * side * 2 * format.size()];
            for (k, part) in parts.chunks_exact_mut(side * side * format.size()).enumerate() {
                let layout =
                    ImageLayout { height: side as u32 / 2, format, origin: Origin::Bottom, ..layout };
                let image = ImageViewMut::new("part", part, layout).unwrap();
                let first = [0, k as u32 * side as u32 / 2];
                let mut part = image.part_of("part", [side as u32; 2], first).unwrap();
                asset.tile(0).fetch(kind, &mut part).unwrap();
            }
            parts
        };
        let floats = in_parts(PixelFormat::F32);
        for (bytes, on_gpu) in floats.chunks_exact(4).zip(exact.iter().flatten()) {
            let on_cpu = f32::from_ne_bytes(bytes.try_into().unwrap());
            // The offset from the centre is in f32 cells, from f32 barycentrics; then the output itself is f32.
            let slack = 4e-6 / 128.0 + on_cpu.abs() * f32::EPSILON;
            assert!((on_gpu - on_cpu).abs() < slack, "{}: {on_gpu} {on_cpu}", model.name);
        }
        let parts = halves(&in_parts(PixelFormat::F16));
        let differ = found.iter().zip(&parts).filter(|(a, b)| a.to_bits() != b.to_bits());
        let differ: Vec<f32> = differ.map(|(a, b)| (a.to_f32() - b.to_f32()).abs() * side as f32).collect();
        let apart = differ.iter().fold(0.0f32, |a, &b| a.max(b));
        let moved = exact.iter().flatten().filter(|d| **d != 0.0).count();
        println!(
            "{:12} off by {worst:.4} texels of 4096, of deltas up to {largest:.4}; of {moved} numbers {} differ from the CPU's, by up \
             to {apart:.1e} texels",
            model.name,
            differ.len()
        );
        // Those that lie at the middle of two halves, and steps near 0, where the GPU's f32 has fewer digits.
        assert!(differ.len() * 100 < moved && apart < 2e-2, "{}: {} {apart}", model.name, differ.len());
    }
}

/// Bytes per texel that a fetch of each format holds on the GPU for the next one: W⁻¹, the values, and their copy for
/// the host.
#[test]
fn a_fetch_in_f16_holds_two_thirds() {
    for (format, bytes) in [(PixelFormat::F32, 8 + 8 + 8), (PixelFormat::F16, 8 + 4 + 4)] {
        let Some(device) = gpu(&DeviceSettings::default()) else { return };
        let asset = solved(&Model::from(scenes::analytic::bulge()), &device, 64);
        let before = device.info().bytes_held;
        let layout = ImageLayout::packed(64, 64, format);
        raw(&asset, 0, FetchKind::RedirectionDelta, layout, 64 * 64 * 8, 0);
        assert_eq!(device.info().bytes_held - before, 64 * 64 * bytes, "{format:?}");
    }
}

/// A third channel is 0, and a fourth tells where charts are; texels between are left alone.
#[test]
fn further_channels_stand_beside_the_gpu_s() {
    let Some(device) = device() else { return };
    let mut asset = solved(&Model::from(scenes::mug_to_jug()), device, 128);
    for kind in KINDS {
        let pairs = fetch(&mut asset, 0, kind, [40, 30]);
        for channels in [3, 4] {
            let layout = ImageLayout {
                channels: Some(channels),
                pixel_stride: Some(20),
                origin: Origin::Bottom,
                ..ImageLayout::packed(40, 30, PixelFormat::F32)
            };
            let bytes = raw(&asset, 0, kind, layout, 40 * 30 * 20, 0xff);
            let texels: Vec<[f32; 5]> = bytemuck::pod_collect_to_vec(&bytes);
            for (texel, pair) in texels.iter().zip(&pairs) {
                assert_eq!((&texel[..2], texel[2]), (&pair[..], 0.0));
                assert!(texel[4].is_nan() && (channels == 4) == (texel[3] == 0.0 || texel[3] == 1.0));
            }
            let covered = texels.iter().filter(|texel| texel[3] == 1.0).count();
            assert!(channels == 3 || (covered > 0 && covered < texels.len()), "{covered}");
        }
    }
}

/// Message of a fetch that is refused, of an image of a size on a side. Nothing is written to it.
fn refused(asset: &Asset, size: u32) -> vrtm::Error {
    let mut out = vec![[7.0; 2]; (size * size) as usize];
    let mut image = ImageViewMut::from_texels("image", &mut out, [size; 2]).unwrap();
    let error = asset.tile(0).fetch(FetchKind::Redirection, &mut image).unwrap_err();
    assert!(out.iter().all(|uv| *uv == [7.0; 2]), "something was written");
    error
}

#[test]
fn an_image_that_does_not_fit_is_an_error_and_a_smaller_one_comes() {
    let settings = DeviceSettings { memory_budget: Some(64 << 20), ..DeviceSettings::default() };
    let Some(device) = gpu(&settings) else { return };
    let mut asset = solved(&Model::from(scenes::analytic::bulge()), &device, 64);
    let before = device.info().bytes_held;
    let small = fetch(&mut asset, 0, FetchKind::Redirection, [64; 2]);
    assert!(device.info().bytes_held > before, "the image is in the books");
    let error = refused(&asset, 3000);
    assert_eq!(error.kind, ErrorKind::OutOfMemory);
    assert!(error.message.starts_with("an image of 3000x3000 texels needs "), "{error}");
    assert!(device.info().bytes_held <= before);
    assert!(fetch(&mut asset, 0, FetchKind::Redirection, [64; 2]) == small);
    drop(asset);
    assert_eq!(device.info().bytes_held, 0);
}

#[test]
fn a_lost_gpu_is_an_error_and_nothing_is_written() {
    let Some(device) = gpu(&DeviceSettings::default()) else { return };
    let mut asset = solved(&Model::from(scenes::analytic::bulge()), &device, 64);
    fetch(&mut asset, 0, FetchKind::Redirection, [64; 2]);
    device.lose_for_tests();
    for size in [64, 200] {
        let error = refused(&asset, size);
        assert_eq!(error.kind, ErrorKind::DeviceLost, "{error}");
    }
}
