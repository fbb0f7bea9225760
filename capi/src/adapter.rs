//! GPUs that a device can be made on, and how a host names one.

use std::ffi::c_char;

use super::guard::{guard_struct, guard_value};
use super::mirror::mirror;
use super::status::{Failure, Outcome, chars, vrtm_status};
use vrtm::adapters;
use vrtm_core::report::AdapterInfo;
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

mirror! {
    report vrtm_adapter_info of r: AdapterInfo {
        /// 1 for an adapter that is emulated on the CPU (or does not identify as hardware): VRTM_BACKEND_AUTO never
        /// chooses it. 0 otherwise.
        software: u32,
        /// The adapter's name, UTF-8.
        name: [c_char; 128] = chars::<128>(&r.name),
        /// The driver's name and version, UTF-8.
        driver: [c_char; 128] = chars::<128>(&r.driver),
        /// The graphics interface it is driven through: "Vulkan", "Direct3D 12" or "Metal".
        api: [c_char; 16] = chars::<16>(r.api),
        vendor: u32, device: u32,
        /// Place on the PCI bus, domain:bus:device.function, hexadecimal; empty if the interface does not report it.
        pci_bus: [c_char; 32] = chars::<32>(&r.pci_bus),
        /// 1 if `uuid` and `driver_uuid` are known: through Vulkan. 0 otherwise.
        has_uuid: u32 = r.uuid.is_some(),
        /// VkPhysicalDeviceIDProperties::deviceUUID: the same for this GPU in all programs.
        uuid: [u8; 16] = r.uuid.unwrap_or_default(),
        /// VkPhysicalDeviceIDProperties::driverUUID: a host's memory can be imported (vrtm_tile_fetch_external) if both
        /// UUIDs equal those of its own device.
        driver_uuid: [u8; 16] = r.driver_uuid.unwrap_or_default(),
        /// 1 if `luid` is known: on Windows. 0 otherwise.
        has_luid: u32 = r.luid.is_some(),
        /// The LUID of Direct3D and DXGI, in memory order.
        luid: [u8; 8] = r.luid.unwrap_or_default(),
        /// The number MTLDevice.registryID, in memory order; all bytes are 0 if the GPU is not driven through Metal.
        registry_id: [u8; 8] = r.registry_id.unwrap_or_default().to_ne_bytes(),
    }
}

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
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_adapter_count(count: *mut u32) -> vrtm_status {
    guard_value("vrtm_adapter_count", count, "count", || {
        Ok(u32::try_from(adapters().len()).unwrap_or(u32::MAX))
    })
}

/// Describes adapter `index`, 0 <= index < vrtm_adapter_count. Takes as long as vrtm_adapter_count.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_adapter_get_info(index: u32, info: *mut vrtm_adapter_info) -> vrtm_status {
    guard_struct("vrtm_adapter_get_info", info, "info", || {
        let (all, at) = (adapters(), index as usize);
        ensure!(at < all.len(), "index is {index}, but the number of adapters is {}", all.len());
        Ok(all[at].clone().into())
    })
}
