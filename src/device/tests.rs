//! Tests of which backend a device gets and what it reports, in any environment.

use super::choice::{find, or_the_cpu};
use super::*;
use crate::{Asset, Fetch, FetchKind, ImageLayout, ImageView, ImageViewMut, PixelFormat};
use vrtm_core::allocation::{Vec, vec};
use vrtm_core::mesh::{MeshSource, UvSource};
use vrtm_core::settings::{SolveOptions, TileSettings};
use vrtm_core::view::Strided;

fn make(backend: Backend, adapter: u32) -> Result<Device> {
    Device::with(
        &DeviceSettings { backend, adapter, threads: NonZeroU32::new(1), ..DeviceSettings::default() },
        Overrides::default(),
    )
}

/// A device on the first GPU, software or not. `None`, with a printed note, if no GPU was found; VRTM_REQUIRE_GPU=1
/// makes that a failure.
pub(crate) fn gpu() -> Option<Device> {
    let found = find();
    if found.infos().is_empty() {
        let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
        assert!(!required, "VRTM_REQUIRE_GPU is set, but there is no GPU adapter: {}", found.listed());
        println!("skipped: no GPU adapter");
        return None;
    }
    Some(make(Backend::Gpu, 0).unwrap())
}

#[test]
fn auto_takes_hardware_only_and_says_what_it_found() {
    let info = make(Backend::Auto, 9).unwrap().info();
    let found = find();
    match found.infos().into_iter().find(|adapter| !adapter.software) {
        Some(adapter) => {
            assert_eq!((info.backend, info.name), (Backend::Gpu, adapter.name));
            assert!(info.reason.starts_with("auto: a hardware GPU, through "), "{}", info.reason);
        }
        None => {
            assert_eq!(info.backend, Backend::Cpu);
            assert_eq!(info.reason, format!("auto: no hardware GPU (found: {})", found.listed()));
        }
    }
    for adapter in found.infos().into_iter().filter(|adapter| adapter.software) {
        assert!(found.listed().contains(&format!("{}, a software driver", adapter.name)));
    }
}

#[test]
fn auto_falls_back_to_the_cpu_and_says_why() {
    let refused = Error::new(ErrorKind::Unsupported, "adapter: X cannot be opened: no more devices");
    let (gpu, why) = or_the_cpu(Err(refused), Options::default());
    assert!(gpu.is_none());
    assert_eq!(why, "the CPU, as the GPU cannot be used: adapter: X cannot be opened: no more devices");
}

#[test]
fn gpu_takes_the_adapter_that_was_asked_for() {
    let Some(device) = gpu() else { return };
    let info = device.info();
    let first = &adapters()[0];
    assert_eq!((info.backend, &info.name), (Backend::Gpu, &first.name));
    assert!(info.reason.starts_with("gpu was asked for: adapter 0 of "), "{}", info.reason);
    assert!(info.reason.contains(first.api) && info.reason.contains(&first.driver), "{}", info.reason);
    assert_eq!(info.reason.contains("a software driver"), first.software);
    assert!(device.gpu().is_some() && device.alive().is_ok());

    let count = adapters().len();
    let error = make(Backend::Gpu, count as u32).unwrap_err();
    assert_eq!(error.kind, ErrorKind::InvalidArgument);
    assert!(error.message.starts_with(&format!("adapter: {count} is out of range, there ")), "{error}");
    assert_eq!(make(Backend::Gpu, u32::MAX).unwrap_err().kind, ErrorKind::InvalidArgument);
}

#[test]
fn the_webgpu_limits_are_a_matter_of_options() {
    if gpu().is_none() {
        return;
    }
    let gpu = Options { webgpu_limits: true, ..Options::default() };
    let overrides = Overrides { backend: Some(Backend::Gpu), gpu, ..Overrides::default() };
    let device = Device::with(&DeviceSettings::default(), overrides).unwrap();
    let reason = device.info().reason;
    assert!(reason.starts_with("gpu was asked for (VRTM_DEVICE): adapter 0 of "), "{reason}");
    assert!(reason.ends_with("with WebGPU's default limits"), "{reason}");
}

const REST: [[f32; 3]; 6] =
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0]];

/// Two squares side by side, rigid in the middle.
pub(crate) fn asset(device: &Device) -> Result<Asset> {
    let uvs = REST.map(|[x, y, _]| [x / 2.0, y]);
    let corners = [0, 1, 4, 3, 1, 2, 5, 4];
    let mut asset = Asset::new(
        device,
        &MeshSource {
            positions: Strided::from_f32x3(&REST),
            face_counts: Some(&[4, 4]),
            indices: &corners,
            uvs: UvSource { u: Strided::from_f32x2(&uvs), v: None, indices: Some(&corners) },
            ..MeshSource::default()
        },
    )?;
    asset.set_rigidity(0, Some(painted(&[0, 255, 255, 0])))?;
    Ok(asset)
}

fn painted(row: &[u8; 4]) -> ImageView<'_> {
    ImageView::new("rigidity", row, ImageLayout::packed(4, 1, PixelFormat::U8)).unwrap()
}

fn solve(asset: &mut Asset) -> Result<Vec<u8>> {
    let mut pose = REST;
    (pose[1][0], pose[4][0]) = (1.3, 1.3);
    let mut map = vec![0; 16 * 16 * 8];
    let layout = ImageLayout::packed(16, 16, PixelFormat::F32);
    let image = ImageViewMut::new("image", &mut map, layout)?;
    let fetch = Fetch::Image { tile: 0, kind: FetchKind::Redirection, image };
    asset.redirect(Strided::from_f32x3(&pose), &SolveOptions::default(), &mut [fetch])?;
    Ok(map)
}

#[test]
fn after_a_loss_every_call_says_so_and_a_new_device_works() {
    let Some(device) = gpu() else { return };
    let mut lost = asset(&device).unwrap();
    let map = solve(&mut lost).unwrap();
    assert!(device.lose_for_tests());

    let mut failures = vec![asset(&device).map(drop), solve(&mut lost).map(drop)];
    failures.push(lost.set_rigidity(0, Some(painted(&[9; 4]))));
    failures.push(lost.set_mask(0, None));
    failures.push(lost.set_vertex_rigidity(Some(Strided::from_f32(&[0.0; 6]))));
    failures.push(lost.set_vertex_mask(Some(Strided::from_f32(&[0.0; 6]))));
    failures.push(lost.set_settings(0, &TileSettings::default()));
    failures.push(lost.tile_info(0).map(drop));
    failures.push(lost.tile_report(0).map(drop));
    failures.push(lost.report().map(drop));
    failures.push(lost.corner_uvs(&mut [[0.0; 2]; 8]));
    for (index, failure) in failures.into_iter().enumerate() {
        let error = failure.expect_err(&index.to_string());
        assert_eq!(error.kind, ErrorKind::DeviceLost, "{index}: {error}");
        assert!(error.message.contains(" is lost: it was destroyed; make a new device"), "{index}: {error}");
    }
    let info = device.info();
    assert!(info.reason.starts_with("the GPU ") && info.reason.contains("is lost"), "{}", info.reason);
    assert_eq!((lost.info().vertices, lost.tile_count(), lost.find_tile(1001)), (6, 1, Some(0)));

    let new = make(Backend::Gpu, 0).unwrap();
    assert_eq!(solve(&mut asset(&new).unwrap()).unwrap(), map);
    drop(lost);
    assert_eq!(device.info().bytes_held, 0);
}

#[test]
fn an_asset_outlives_the_handle_of_its_device() {
    let Some(device) = gpu() else { return };
    let mut asset = asset(&device).unwrap();
    drop(device);
    solve(&mut asset).unwrap();
    assert!(asset.device().info().bytes_held > 0);
    assert!(!make(Backend::Cpu, 0).unwrap().lose_for_tests());
}

#[test]
fn a_budget_that_is_too_small_is_out_of_memory() {
    if gpu().is_none() {
        return;
    }
    let settings = DeviceSettings {
        backend: Backend::Gpu,
        memory_budget: Some(1000),
        threads: NonZeroU32::new(1),
        ..DeviceSettings::default()
    };
    let device = Device::with(&settings, Overrides::default()).unwrap();
    let error = solve(&mut asset(&device).unwrap()).unwrap_err();
    assert_eq!(error.kind, ErrorKind::OutOfMemory);
    assert!(error.message.contains("of the device's 1000 are in use"), "{error}");
    assert_eq!(device.info().bytes_held, 0);
}
