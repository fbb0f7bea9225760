//! GPUs that a device can be made on, and how a host names one.

use std::ffi::c_char;

use super::desc::{Out, Place, sized};
use super::guard::guard;
use super::status::{Failure, Outcome, chars, vrtm_status};
use vrtm::adapters;
use vrtm_core::settings::AdapterId;

/// Kind of name by which vrtm_device_desc selects a GPU.
pub type vrtm_adapter_by = i32;
/// By its number, vrtm_device_desc.adapter; the default.
pub const VRTM_ADAPTER_BY_NUMBER: vrtm_adapter_by = 0;
/// By its UUID, 16 bytes: VkPhysicalDeviceIDProperties::deviceUUID of the host's own VkPhysicalDevice.
pub const VRTM_ADAPTER_BY_UUID: vrtm_adapter_by = 1;
/// By its LUID, 8 bytes: the host's DXGI_ADAPTER_DESC1::AdapterLuid, ID3D12Device::GetAdapterLuid(), or, on Windows,
/// VkPhysicalDeviceIDProperties::deviceLUID. A GPU that is listed both for Vulkan and for Direct3D 12 is used through
/// the first of the two.
pub const VRTM_ADAPTER_BY_LUID: vrtm_adapter_by = 2;
/// By its registry ID, 8 bytes: the number MTLDevice.registryID.
pub const VRTM_ADAPTER_BY_REGISTRY_ID: vrtm_adapter_by = 3;

/// A GPU that a device can be made on. Start from vrtm_adapter_info_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_adapter_info {
    /// sizeof(vrtm_adapter_info); set by vrtm_adapter_info_init().
    pub struct_size: u32,
    /// 1 for an adapter that is emulated on the CPU (or does not identify as hardware): VRTM_BACKEND_AUTO never chooses
    /// it. 0 otherwise.
    pub software: u32,
    /// The adapter's name, UTF-8.
    pub name: [c_char; 128],
    /// The driver's name and version, UTF-8.
    pub driver: [c_char; 128],
    /// The graphics interface it is driven through: "Vulkan", "Direct3D 12" or "Metal".
    pub api: [c_char; 16],
    /// PCI vendor ID; 0 if the interface does not report it.
    pub vendor: u32,
    /// PCI device ID of the vendor; 0 if the interface does not report it.
    pub device: u32,
    /// Place on the PCI bus, domain:bus:device.function, hexadecimal; empty if the interface does not report it.
    pub pci_bus: [c_char; 32],
    /// 1 if `uuid` and `driver_uuid` are known: through Vulkan. 0 otherwise.
    pub has_uuid: u32,
    /// VkPhysicalDeviceIDProperties::deviceUUID: the same for this GPU in all programs.
    pub uuid: [u8; 16],
    /// VkPhysicalDeviceIDProperties::driverUUID: a host's memory can be imported (vrtm_tile_fetch_external) if both
    /// UUIDs equal those of its own device.
    pub driver_uuid: [u8; 16],
    /// 1 if `luid` is known: on Windows. 0 otherwise.
    pub has_luid: u32,
    /// The LUID of Direct3D and DXGI, in memory order.
    pub luid: [u8; 8],
    /// The number MTLDevice.registryID, in memory order; all bytes are 0 if the GPU is not driven through Metal.
    pub registry_id: [u8; 8],
}

// SAFETY: repr(C), struct_size first, plain numbers.
sized!(vrtm_adapter_info);

/// The GPU that a host names by its identity; `None` for one that it names by its number.
pub(super) fn adapter_id(by: vrtm_adapter_by, id: [u8; 16]) -> Outcome<Option<AdapterId>> {
    let [mut first, mut second] = [[0; 8]; 2];
    first.copy_from_slice(&id[..8]);
    second.copy_from_slice(&id[8..]);
    let (id, rest) = match by {
        VRTM_ADAPTER_BY_NUMBER => (None, &id[..]),
        VRTM_ADAPTER_BY_UUID => (Some(AdapterId::Uuid(id)), &[][..]),
        VRTM_ADAPTER_BY_LUID => (Some(AdapterId::Luid(first)), &second[..]),
        VRTM_ADAPTER_BY_REGISTRY_ID => (Some(AdapterId::Registry(u64::from_ne_bytes(first))), &second[..]),
        other => {
            return Err(Failure::argument(format!("desc.adapter_by is {other}, no VRTM_ADAPTER_BY_ value")));
        }
    };
    if rest.iter().any(|&byte| byte != 0) {
        let at = 16 - rest.len();
        return Err(Failure::argument(format!(
            "desc.adapter_id: bytes from number {at} on are set, which desc.adapter_by, {}, does not have",
            by
        )));
    }
    Ok(id)
}

/// Number of GPUs that a device can be made on: those that run compute shaders with at least WebGPU's default limits,
/// through Vulkan, Direct3D 12 or Metal. Hardware is listed before software, discrete before integrated; the order is
/// stable as long as the machine and its drivers do not change. 0 without a GPU or a driver. Each call loads the
/// drivers, which takes tens of milliseconds.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT if `count` is null.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_adapter_count(count: *mut u32) -> vrtm_status {
    guard("vrtm_adapter_count", || {
        let out = Place::new(count, "count")?;
        out.write(u32::try_from(adapters().len()).unwrap_or(u32::MAX));
        Ok(())
    })
}

/// Describes adapter `index`, 0 <= index < vrtm_adapter_count. Takes as long as vrtm_adapter_count.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for an index out of range, or if `info` is null or has a wrong struct_size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_adapter_get_info(index: u32, info: *mut vrtm_adapter_info) -> vrtm_status {
    guard("vrtm_adapter_get_info", || {
        let out = Out::new(info, "info")?;
        let all = adapters();
        let adapter = all.get(index as usize).ok_or_else(|| {
            Failure::argument(format!("index is {index}, but the number of adapters is {}", all.len()))
        })?;
        out.write(vrtm_adapter_info {
            struct_size: 0,
            software: u32::from(adapter.software),
            name: chars(&adapter.name),
            driver: chars(&adapter.driver),
            api: chars(adapter.api),
            has_uuid: u32::from(adapter.uuid.is_some()),
            has_luid: u32::from(adapter.luid.is_some()),
            uuid: adapter.uuid.unwrap_or_default(),
            driver_uuid: adapter.driver_uuid.unwrap_or_default(),
            luid: adapter.luid.unwrap_or_default(),
            registry_id: adapter.registry_id.unwrap_or_default().to_ne_bytes(),
            vendor: adapter.vendor,
            device: adapter.device,
            pci_bus: chars(&adapter.pci_bus),
        });
        Ok(())
    })
}
