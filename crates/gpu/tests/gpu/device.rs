//! GPU devices from a program's view: the list of adapters, the messages where there are none, and the loss of a GPU.
//! Tests that depend on environment variables run in a process of their own.

use std::path::Path;

use vrtm::{
    AdapterId, Asset, Backend, Device, DeviceSettings, ErrorKind, FetchKind, MeshSource, Quality, Strided,
    TileSettings, adapters,
};

use crate::child::in_a_child;
use vrtm_testkit::{self, Model, gpu, gpus, has_gpu, options};

fn settings(backend: Backend, adapter: u32) -> DeviceSettings {
    DeviceSettings { backend, adapter, threads: std::num::NonZeroU32::new(1), ..DeviceSettings::default() }
}

#[test]
fn adapters_are_described_in_an_order_that_stays() {
    let Some(all) = gpus() else { return };
    for adapter in &all {
        assert!(!adapter.name.is_empty() && !adapter.driver.is_empty(), "{adapter:?}");
        assert!(["Vulkan", "Direct3D 12", "Metal"].contains(&adapter.api), "{adapter:?}");
    }
    assert!(all.is_sorted_by_key(|adapter| adapter.software), "{all:?}");
    assert_eq!(format!("{all:?}"), format!("{:?}", adapters()));
}

/// Checks what holds wherever no driver can be loaded.
fn nothing_is_there() {
    assert!(adapters().is_empty());
    let error = Device::new(&settings(Backend::Gpu, 0)).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);
    let start = "backend: gpu was asked for, but there is no GPU that runs compute shaders with WebGPU's default limits";
    assert!(error.message.starts_with(start), "{error}");
    assert!(error.message.ends_with("; found: none)"), "{error}");
    let info = Device::new(&settings(Backend::Auto, 0)).unwrap().info();
    assert_eq!(info.backend, Backend::Cpu);
    assert!(info.reason.starts_with("auto: "), "{}", info.reason);
}

#[cfg(not(any(windows, target_os = "macos")))]
#[test]
fn without_a_driver_there_is_no_gpu() {
    let nowhere = "/nonexistent.json";
    if in_a_child(
        "device::without_a_driver_there_is_no_gpu",
        &[("VK_DRIVER_FILES", nowhere), ("VK_ICD_FILENAMES", nowhere)],
    ) {
        nothing_is_there();
    }
}

/// A file that is not a library takes the place of a missing driver: the loader reads it and fails.
#[cfg(target_os = "linux")]
#[test]
fn without_vulkan_s_library_there_is_no_gpu() {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("no_vulkan");
    std::fs::create_dir_all(&folder).unwrap();
    for name in ["libvulkan.so.1", "libvulkan.so"] {
        std::fs::write(folder.join(name), "").unwrap();
    }
    let folder = folder.to_str().unwrap();
    if in_a_child("device::without_vulkan_s_library_there_is_no_gpu", &[("LD_LIBRARY_PATH", folder)]) {
        nothing_is_there();
    }
}

#[test]
fn an_adapter_that_is_not_there_is_named() {
    let Some(all) = gpus() else { return };
    let count = all.len() as u32;
    for adapter in [count, count + 1, u32::MAX] {
        let error = Device::new(&settings(Backend::Gpu, adapter)).unwrap_err();
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
        assert!(error.message.starts_with(&format!("adapter: {adapter} is out of range, there ")), "{error}");
    }
    // Only `Backend::Gpu` demands that the adapter exists.
    for backend in [Backend::Cpu, Backend::Auto] {
        Device::new(&settings(backend, count)).unwrap();
    }
}

fn by_id(backend: Backend, id: AdapterId) -> DeviceSettings {
    DeviceSettings { adapter_id: Some(id), ..settings(backend, 99) }
}

/// The identity takes the place of the number, in each interface that has one.
#[test]
fn an_adapter_is_found_by_its_identity() {
    let Some(all) = gpus() else { return };
    for (index, adapter) in all.iter().enumerate() {
        let ids = [
            adapter.uuid.map(AdapterId::Uuid),
            adapter.luid.map(AdapterId::Luid),
            adapter.registry_id.map(AdapterId::Registry),
        ];
        assert!(ids.iter().any(Option::is_some), "{adapter:?}");
        for id in ids.into_iter().flatten() {
            assert!(adapter.has_id(id));
            let first = all.iter().position(|adapter| adapter.has_id(id)).unwrap();
            let info = Device::new(&by_id(Backend::Gpu, id)).unwrap().info();
            assert_eq!(info.name, all[first].name);
            let start = format!("gpu was asked for: adapter {first} of {}, by its ", all.len());
            assert!(info.reason.starts_with(&start), "{index}: {}", info.reason);
            // A software driver is not taken without being asked for.
            let auto = Device::new(&by_id(Backend::Auto, id)).unwrap().info();
            assert_eq!(auto.backend == Backend::Gpu, !all[first].software, "{auto:?}");
        }
    }
}

#[test]
fn an_identity_that_no_adapter_has_is_named_with_those_that_there_are() {
    let Some(all) = gpus() else { return };
    for (id, text) in [
        (AdapterId::Uuid([0xab; 16]), "UUID abababab-abab-abab-abab-abababababab"),
        (AdapterId::Luid([1, 2, 3, 4, 5, 6, 7, 8]), "LUID 0102030405060708"),
        (AdapterId::Registry(12345), "registry ID 12345"),
    ] {
        let error = Device::new(&by_id(Backend::Gpu, id)).unwrap_err();
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
        let start = format!("adapter_id: no adapter has the {text}; there are: 0: {} through ", all[0].name);
        assert!(error.message.starts_with(&start), "{error}");
        if let Some(uuid) = all[0].uuid {
            let hex: String = uuid.iter().map(|byte| format!("{byte:02x}")).collect();
            assert!(error.message.replace('-', "").contains(&format!("UUID {hex}")), "{error}");
        }
        let auto = Device::new(&by_id(Backend::Auto, id)).unwrap().info();
        assert_eq!(auto.backend, Backend::Cpu);
        assert!(auto.reason.starts_with(&format!("auto: the CPU, as no GPU has the {text} ")), "{auto:?}");
        Device::new(&by_id(Backend::Cpu, id)).unwrap();
    }
}

#[test]
fn the_variable_takes_a_uuid() {
    let Some(uuid) = adapters().into_iter().find_map(|adapter| adapter.uuid) else {
        has_gpu();
        return;
    };
    let digits: String = uuid.iter().map(|byte| format!("{byte:02X}")).collect();
    let name = "device::the_variable_takes_a_uuid";
    for value in [format!("gpu:{digits}"), format!("gpu:{}-{}", &digits[..8], &digits[8..])] {
        if in_a_child(name, &[("VRTM_DEVICE", &value)]) {
            return match std::env::var("VRTM_DEVICE").unwrap().as_str() {
                "gpu:12" | "gpu:" | "gpu:no" => {
                    let error = Device::new(&settings(Backend::Cpu, 0)).unwrap_err();
                    assert_eq!(error.kind, ErrorKind::InvalidArgument);
                    assert!(error.message.starts_with("VRTM_DEVICE: '"), "{error}");
                    assert!(error.message.ends_with("' is no UUID of 32 hexadecimal digits"), "{error}");
                }
                _ => {
                    let info = Device::new(&by_id(Backend::Cpu, AdapterId::Registry(1))).unwrap().info();
                    assert!(info.reason.starts_with("gpu was asked for (VRTM_DEVICE): adapter "), "{info:?}");
                }
            };
        }
    }
    for value in ["gpu:12", "gpu:", "gpu:no"] {
        in_a_child(name, &[("VRTM_DEVICE", value)]);
    }
}

#[test]
fn the_cpu_is_asked_for_by_name_or_by_variable() {
    if in_a_child("device::the_cpu_is_asked_for_by_name_or_by_variable", &[("VRTM_DEVICE", "cpu")]) {
        let info = Device::new(&settings(Backend::Gpu, 99)).unwrap().info();
        assert_eq!((info.backend, info.reason.as_str()), (Backend::Cpu, "cpu was asked for (VRTM_DEVICE)"));
    }
}

#[test]
fn auto_never_takes_a_software_driver() {
    if in_a_child("device::auto_never_takes_a_software_driver", &[]) {
        let info = Device::new(&settings(Backend::Auto, 0)).unwrap().info();
        let hardware = adapters().first().is_some_and(|adapter| !adapter.software);
        assert!(info.backend == Backend::Cpu || hardware, "{info:?}");
    }
}

#[test]
fn webgpu_s_limits_are_a_variable() {
    if in_a_child(
        "device::webgpu_s_limits_are_a_variable",
        &[("VRTM_GPU_LIMITS", "webgpu"), ("VRTM_DEVICE", "gpu")],
    ) {
        // The parent process checks that there is a GPU.
        match Device::new(&DeviceSettings::default()) {
            Ok(device) => {
                let reason = device.info().reason;
                assert!(reason.starts_with("gpu was asked for (VRTM_DEVICE): adapter 0 of "), "{reason}");
                assert!(reason.ends_with(", with WebGPU's default limits"), "{reason}");
            }
            Err(error) => assert_eq!(error.kind, ErrorKind::Unsupported, "{error}"),
        }
    } else {
        has_gpu();
    }
}

#[test]
fn limits_that_are_not_known_are_refused() {
    if in_a_child("device::limits_that_are_not_known_are_refused", &[("VRTM_GPU_LIMITS", "small")]) {
        for backend in [Backend::Cpu, Backend::Auto, Backend::Gpu] {
            let error = Device::new(&settings(backend, 0)).unwrap_err();
            assert_eq!(error.kind, ErrorKind::InvalidArgument);
            assert_eq!(error.message, "VRTM_GPU_LIMITS: 'small' is not webgpu");
        }
    }
}

#[test]
fn devices_are_made_and_ended_on_many_threads() {
    let Some(all) = gpus() else { return };
    let first = format!("{all:?}");
    std::thread::scope(|scope| {
        for thread in 0..4 {
            let first = &first;
            scope.spawn(move || {
                for _ in 0..4 {
                    assert_eq!(format!("{:?}", adapters()), *first);
                    let backend = if thread % 2 == 0 { Backend::Gpu } else { Backend::Auto };
                    match Device::new(&settings(backend, 0)) {
                        Ok(device) => assert!(!device.info().reason.is_empty()),
                        Err(error) => assert_eq!(error.kind, ErrorKind::Unsupported, "{error}"),
                    }
                }
            });
        }
    });
}

fn asset(model: &Model, device: &Device) -> Asset {
    model.asset_on(device, 32)
}

fn solve(asset: &mut Asset, model: &Model) -> vrtm::Result<()> {
    asset.solve(model.frame(1), &options(Quality::Draft))
}

#[test]
fn after_a_loss_every_call_says_so_and_a_new_device_works() {
    let Some(device) = gpu(&settings(Backend::Gpu, 0)) else { return };
    let model = &vrtm_testkit::analytic()[0];
    let mut lost = asset(model, &device);
    solve(&mut lost, model).unwrap();
    let expected = vrtm_testkit::fetch(&mut lost, 0, FetchKind::Redirection, [32, 32]);
    assert!(device.lose_for_tests());
    for error in [
        solve(&mut lost, model).unwrap_err(),
        lost.tile_mut(0).info().unwrap_err(),
        lost.tile(0).report().unwrap_err(),
        lost.report().unwrap_err(),
        lost.tile_mut(0).set_mask(None).unwrap_err(),
        lost.tile_mut(0).set_rigidity(None).unwrap_err(),
        lost.set_vertex_rigidity(Some(Strided::default())).unwrap_err(),
        lost.set_vertex_mask(Some(Strided::default())).unwrap_err(),
        lost.tile_mut(0).set_settings(&TileSettings::default()).unwrap_err(),
        lost.corner_uvs(0, &mut vec![[0.0; 2]; lost.info().corners as usize]).unwrap_err(),
        Asset::new(&device, &MeshSource::default()).unwrap_err(),
    ] {
        assert_eq!(error.kind, ErrorKind::DeviceLost, "{error}");
        assert!(error.message.contains(" is lost: it was destroyed; make a new device"), "{error}");
    }
    assert!(device.info().reason.contains(" is lost: "), "{:?}", device.info());
    let new = gpu(&settings(Backend::Gpu, 0)).unwrap();
    let mut asset = asset(model, &new);
    solve(&mut asset, model).unwrap();
    assert_eq!(vrtm_testkit::fetch(&mut asset, 0, FetchKind::Redirection, [32, 32]), expected);
    drop((lost, device));
    solve(&mut asset, model).unwrap();
}

#[test]
fn a_device_that_is_lost_during_solves_fails_them_cleanly() {
    let Some(device) = gpu(&settings(Backend::Gpu, 0)) else { return };
    let model = &vrtm_testkit::analytic()[0];
    std::thread::scope(|scope| {
        for _ in 0..2 {
            let mut asset = asset(model, &device);
            scope.spawn(move || {
                let error = (0..100_000).find_map(|_| solve(&mut asset, model).err()).unwrap();
                assert_eq!(error.kind, ErrorKind::DeviceLost, "{error}");
            });
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
        device.lose_for_tests();
    });
}

#[test]
fn a_budget_that_is_too_small_is_out_of_memory() {
    let Some(device) = gpu(&DeviceSettings { memory_budget: Some(5000), ..settings(Backend::Gpu, 0) }) else {
        return;
    };
    let model = &vrtm_testkit::analytic()[0];
    let error = solve(&mut asset(model, &device), model).unwrap_err();
    assert_eq!(error.kind, ErrorKind::OutOfMemory);
    assert!(error.message.contains("of the device's 5000 are in use"), "{error}");
    assert_eq!(device.info().bytes_held, 0);
}

#[test]
fn an_asset_outlives_the_handle_of_its_device() {
    let Some(device) = gpu(&settings(Backend::Gpu, 0)) else { return };
    let model = &vrtm_testkit::analytic()[0];
    let mut asset = asset(model, &device);
    drop(device);
    solve(&mut asset, model).unwrap();
    assert!(asset.device().info().bytes_held > 0);
}
