//! Describes a GPU to a host. The identifiers by which any program can tell it from other GPUs are read from the
//! graphics interface itself, since wgpu does not pass them on.

use vrtm_core::panics::contain;
use vrtm_core::report::{AdapterInfo, report};

/// Describes an adapter to a host.
pub(super) fn describe(adapter: &wgpu::Adapter) -> AdapterInfo {
    let info = adapter.get_info();
    let ids = contain(|| ids_of(adapter)).unwrap_or_default();
    report!(ids, {
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        api: api(info.backend),
        software: is_software(&info),
        vendor: info.vendor,
        device: info.device,
        pci_bus: info.device_pci_bus_id,
        name: info.name,
    })
}

/// True unless the adapter states that it is hardware.
pub(super) fn is_software(info: &wgpu::AdapterInfo) -> bool {
    rank(info.device_type) > 2
}

/// Ranks hardware before software, and discrete before integrated GPUs.
pub(super) fn rank(kind: wgpu::DeviceType) -> u8 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        // A part of a hardware GPU, in a virtual machine.
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Cpu => 3,
        wgpu::DeviceType::Other => 4,
    }
}

/// The name of a graphics interface.
pub(super) fn api(backend: wgpu::Backend) -> &'static str {
    match backend {
        wgpu::Backend::Vulkan => "Vulkan",
        wgpu::Backend::Dx12 => "Direct3D 12",
        wgpu::Backend::Metal => "Metal",
        wgpu::Backend::Noop | wgpu::Backend::Gl | wgpu::Backend::BrowserWebGpu => "unknown",
    }
}

/// The identifiers that the interface provides.
fn ids_of(adapter: &wgpu::Adapter) -> AdapterInfo {
    vulkan(adapter).or_else(|| direct3d(adapter)).or_else(|| metal(adapter)).unwrap_or_default()
}

#[cfg(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd"))]
fn vulkan(adapter: &wgpu::Adapter) -> Option<AdapterInfo> {
    use ash::vk;

    // SAFETY: the adapter is only used here, not destroyed.
    let adapter = unsafe { adapter.as_hal::<wgpu::hal::api::Vulkan>() }?;
    let shared = adapter.shared_instance();
    let device_version = adapter.physical_device_capabilities().properties().api_version;
    // The function was added in Vulkan 1.1.
    if shared.instance_api_version().min(device_version) < vk::API_VERSION_1_1 {
        return Some(AdapterInfo::default());
    }
    let mut ids = vk::PhysicalDeviceIDProperties::default();
    let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
    // SAFETY: the device belongs to this instance, and both have the function.
    unsafe {
        let instance = shared.raw_instance();
        instance.get_physical_device_properties2(adapter.raw_physical_device(), &mut properties);
    }
    Some(report!(AdapterInfo {
        uuid: Some(ids.device_uuid),
        driver_uuid: Some(ids.driver_uuid),
        luid: (ids.device_luid_valid != vk::FALSE).then_some(ids.device_luid),
    }))
}

#[cfg(not(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd")))]
fn vulkan(_: &wgpu::Adapter) -> Option<AdapterInfo> {
    None
}

/// This is compiled for Windows, but was never run by its author.
#[cfg(windows)]
fn direct3d(adapter: &wgpu::Adapter) -> Option<AdapterInfo> {
    // SAFETY: the adapter is only used here, not destroyed.
    let adapter = unsafe { adapter.as_hal::<wgpu::hal::api::Dx12>() }?;
    // SAFETY: the adapter is alive.
    let description = unsafe { adapter.as_raw().GetDesc1() }.ok()?;
    let luid = description.AdapterLuid;
    let mut bytes = [0; 8];
    bytes[..4].copy_from_slice(&luid.LowPart.to_ne_bytes());
    bytes[4..].copy_from_slice(&luid.HighPart.to_ne_bytes());
    Some(report!(AdapterInfo { luid: Some(bytes) }))
}

#[cfg(not(windows))]
fn direct3d(_: &wgpu::Adapter) -> Option<AdapterInfo> {
    None
}

/// This is compiled for macOS, but was never run by its author.
#[cfg(target_vendor = "apple")]
fn metal(adapter: &wgpu::Adapter) -> Option<AdapterInfo> {
    use objc2_metal::MTLDevice;

    // SAFETY: the adapter is only used here, not destroyed.
    let adapter = unsafe { adapter.as_hal::<wgpu::hal::api::Metal>() }?;
    Some(report!(AdapterInfo { registry_id: Some(adapter.raw_device().registryID()) }))
}

#[cfg(not(target_vendor = "apple"))]
fn metal(_: &wgpu::Adapter) -> Option<AdapterInfo> {
    None
}
