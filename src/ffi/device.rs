//! Devices and adapters.

use std::ffi::{CString, c_char, c_void};
use std::num::NonZeroU32;
use std::sync::Arc;

use super::allocator::{self, vrtm_allocator};
use super::desc::{self, Out, Place, Sized32};
use super::executor::{HostExecutor, vrtm_executor};
use super::guard::guard;
use super::handle::{self, vrtm_device};
use super::status::{Failure, Outcome, chars, vrtm_status};
use crate::device::{Device, adapters};
use crate::settings::{AdapterId, Backend, DeviceSettings, LogFn, LogLevel};

/// Where assets are solved.
pub type vrtm_backend = i32;
/// A hardware GPU, discrete before integrated; the CPU if no such GPU was found or it cannot be opened; the default. A
/// software driver does not count as a GPU. vrtm_device_info says what was chosen and why.
pub const VRTM_BACKEND_AUTO: vrtm_backend = 0;
/// The CPU.
pub const VRTM_BACKEND_CPU: vrtm_backend = 1;
/// The GPU that vrtm_device_desc selects, even a software driver; never falls back to the CPU.
pub const VRTM_BACKEND_GPU: vrtm_backend = 2;

/// How vrtm_device_desc names a GPU.
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

/// How important a log line is.
pub type vrtm_log_level = i32;
/// Something to show to the artist: clipped faces, overlapping charts.
pub const VRTM_LOG_WARNING: vrtm_log_level = 1;
/// The chosen backend and device, and the reason.
pub const VRTM_LOG_INFO: vrtm_log_level = 2;

/// A host's log function. It is called on the thread that called into vrtm, during that call (on one of a host's
/// threads, if the device has an executor, and on a job's thread); several threads may call it at once. `message` is
/// one UTF-8 line without a line break, valid during the call. It may call vrtm functions; calls that use the asset of
/// the current call give VRTM_ERROR_BUSY, as does waiting for the current job. It must return normally: no exception,
/// no longjmp.
pub type vrtm_log_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, level: vrtm_log_level, message: *const c_char)>;

/// Settings of a new device. Start from vrtm_device_desc_init(), whose defaults are: automatic backend, all cores, no
/// memory budget, no log.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_device_desc {
    /// sizeof(vrtm_device_desc); set by vrtm_device_desc_init().
    pub struct_size: u32,
    /// One of VRTM_BACKEND_: AUTO (0, the default), CPU, GPU. The environment variable VRTM_DEVICE (auto, cpu, gpu, or
    /// gpu:UUID with the UUID of an adapter) overrides it, for support.
    pub backend: vrtm_backend,
    /// One of VRTM_ADAPTER_BY_: NUMBER (0, the default), UUID, LUID, REGISTRY_ID. With the last three, `adapter_id` is
    /// used instead of `adapter`, so that vrtm can compute on the GPU that the host draws with. With `backend` GPU, the
    /// adapter must exist; AUTO uses it if it is a usable hardware GPU, and the CPU otherwise.
    pub adapter_by: vrtm_adapter_by,
    /// Which GPU, 0 <= adapter < vrtm_adapter_count, if `backend` is GPU and `adapter_by` is NUMBER; ignored otherwise.
    pub adapter: u32,
    /// The identity of the adapter, in memory order; unused bytes are zero.
    pub adapter_id: [u8; 16],
    /// CPU threads that one solve uses, at most 1024; 0 = one per core. The result is the same bit for bit. The
    /// environment variable VRTM_THREADS overrides it.
    pub threads: u32,
    /// Maximum bytes that all assets of the device may hold together; 0 = no limit. A call that would exceed it gives
    /// VRTM_ERROR_OUT_OF_MEMORY.
    pub memory_budget: u64,
    /// Receives log messages; null (the default) = no log. The function and `log_user` must stay valid until the device
    /// and all of its assets are destroyed.
    pub log: vrtm_log_fn,
    /// Passed to `log` unchanged.
    pub log_user: *mut c_void,
    /// The host's threads; null (the default) = the library starts threads for each solve or fetch, which end with the
    /// call. The struct is copied.
    pub executor: *const vrtm_executor,
    /// The host's allocator; null (the default) = the system's. The struct is copied.
    pub allocator: *const vrtm_allocator,
}

/// Description of a device. Start from vrtm_device_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_device_data {
    /// sizeof(vrtm_device_data); set by vrtm_device_data_init().
    pub struct_size: u32,
    /// The backend in use: VRTM_BACKEND_CPU or VRTM_BACKEND_GPU.
    pub backend: vrtm_backend,
    /// The processor's or adapter's name, UTF-8.
    pub name: [c_char; 128],
    /// Why this backend was chosen, in a sentence, UTF-8. If the GPU was lost, the cause comes first.
    pub reason: [c_char; 256],
    /// CPU threads per solve.
    pub threads: u32,
    /// Bytes that all assets of the device currently hold.
    pub bytes_held: u64,
}

/// A GPU that a device can be made on. Start from vrtm_adapter_data_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_adapter_data {
    /// sizeof(vrtm_adapter_data); set by vrtm_adapter_data_init().
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

// SAFETY: repr(C), struct_size first, plain numbers, raw pointers and an optional function, as in the two structs
// below.
unsafe impl Sized32 for vrtm_device_desc {
    const NAME: &'static str = "vrtm_device_desc";
}

impl Default for vrtm_device_desc {
    fn default() -> vrtm_device_desc {
        Sized32::zeroed()
    }
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_device_data {
    const NAME: &'static str = "vrtm_device_data";
}

// SAFETY: as above.
unsafe impl Sized32 for vrtm_adapter_data {
    const NAME: &'static str = "vrtm_adapter_data";
}

/// A host's log function and its user data.
struct HostLog {
    call: unsafe extern "C" fn(*mut c_void, vrtm_log_level, *const c_char),
    user: *mut c_void,
}

// SAFETY: the header tells the host that its function is called from any thread that calls into vrtm.
unsafe impl Send for HostLog {}
// SAFETY: as above.
unsafe impl Sync for HostLog {}

impl HostLog {
    fn write(&self, level: LogLevel, message: &str) {
        #[expect(clippy::disallowed_methods, reason = "one line")]
        let line: String =
            message.chars().map(|c| if matches!(c, '\0' | '\n' | '\r') { ' ' } else { c }).collect();
        let level = match level {
            LogLevel::Warning => VRTM_LOG_WARNING,
            LogLevel::Info => VRTM_LOG_INFO,
        };
        if let Ok(line) = CString::new(line) {
            // SAFETY: the host vouches for the function and for its user data.
            unsafe { (self.call)(self.user, level, line.as_ptr()) }
        }
    }
}

fn adapter_id(desc: &vrtm_device_desc) -> Outcome<Option<AdapterId>> {
    let id = desc.adapter_id;
    let [mut first, mut second] = [[0; 8]; 2];
    first.copy_from_slice(&id[..8]);
    second.copy_from_slice(&id[8..]);
    let (id, rest) = match desc.adapter_by {
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
            desc.adapter_by
        )));
    }
    Ok(id)
}

unsafe fn settings(desc: &vrtm_device_desc) -> Outcome<DeviceSettings> {
    let backend = match desc.backend {
        VRTM_BACKEND_AUTO => Backend::Auto,
        VRTM_BACKEND_CPU => Backend::Cpu,
        VRTM_BACKEND_GPU => Backend::Gpu,
        other => return Err(Failure::argument(format!("desc.backend is {other}, no VRTM_BACKEND_ value"))),
    };
    let log = desc.log.map(|call| {
        let host = HostLog { call, user: desc.log_user };
        Arc::new(move |level: LogLevel, message: &str| host.write(level, message)) as LogFn
    });
    // SAFETY: the host's pointer.
    let executor = unsafe { HostExecutor::read(desc.executor, "desc.executor") }?;
    Ok(DeviceSettings {
        backend,
        adapter: desc.adapter,
        adapter_id: adapter_id(desc)?,
        threads: NonZeroU32::new(desc.threads),
        memory_budget: (desc.memory_budget != 0).then_some(desc.memory_budget),
        log,
        executor: executor.map(|executor| Arc::new(executor) as _),
        // SAFETY: the host's pointer.
        allocator: unsafe { allocator::read(desc.allocator, "desc.allocator") }?,
    })
}

/// Makes a device. `desc` may be null, which means all defaults. The caller destroys `*device`.
///
/// Looking for GPUs and opening one loads drivers, which takes tens of milliseconds, the first time more; an open GPU
/// keeps threads of its driver alive until the device and all of its assets are destroyed. So make one device and keep
/// it. The library prints nothing, but a driver may: Mesa's writes a line to stderr where XDG_RUNTIME_DIR is not set.
///
/// The environment variable VRTM_GPU_LIMITS=webgpu opens GPUs with WebGPU's default limits (bindings of 128 MiB,
/// buffers of 256 MiB) and without optional features, for support.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for an unknown backend, an adapter out of range or an identity that no adapter
/// has (VRTM_BACKEND_GPU; the message lists the available ones), more than 1024 threads, an allocator without a
/// function, or an environment variable VRTM_DEVICE, VRTM_THREADS or VRTM_GPU_LIMITS that cannot be read;
/// VRTM_ERROR_UNSUPPORTED for VRTM_BACKEND_GPU if no GPU was found or it cannot be opened, and for an allocator if the
/// library was built without the feature for it; VRTM_ERROR_OUT_OF_MEMORY.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_create(
    desc: *const vrtm_device_desc,
    device: *mut vrtm_device,
) -> vrtm_status {
    guard("vrtm_device_create", || {
        let out = Place::new(device, "device")?;
        // SAFETY: the host's pointer.
        let desc = unsafe { desc::read_or_default(desc, "desc") }?;
        // SAFETY: as above.
        let device = Device::new(&unsafe { settings(&desc) }?)?;
        out.write(handle::add_device(device)?);
        Ok(())
    })
}

/// Describes a device: its backend, why it was chosen, and how much memory its assets hold. Works even after the GPU
/// was lost.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE; VRTM_ERROR_INVALID_ARGUMENT if `info` is null or has a wrong struct_size.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_info(device: vrtm_device, info: *mut vrtm_device_data) -> vrtm_status {
    guard("vrtm_device_info", || {
        let out = Out::new(info, "info")?;
        let info = handle::device(device)?.info();
        out.write(vrtm_device_data {
            struct_size: 0,
            backend: match info.backend {
                Backend::Auto => VRTM_BACKEND_AUTO,
                Backend::Cpu => VRTM_BACKEND_CPU,
                Backend::Gpu => VRTM_BACKEND_GPU,
            },
            threads: info.threads,
            bytes_held: info.bytes_held,
            name: chars(&info.name),
            reason: chars(&info.reason),
        });
        Ok(())
    })
}

/// Destroys a device's handle. Assets that were made on it, and the log function, remain in use until the assets are
/// destroyed, in any order.
///
/// Errors: VRTM_ERROR_INVALID_HANDLE, also when it was destroyed before.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_destroy(device: vrtm_device) -> vrtm_status {
    guard("vrtm_device_destroy", || handle::remove_device(device))
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
pub unsafe extern "C" fn vrtm_adapter_info(index: u32, info: *mut vrtm_adapter_data) -> vrtm_status {
    guard("vrtm_adapter_info", || {
        let out = Out::new(info, "info")?;
        let all = adapters();
        let adapter = all.get(index as usize).ok_or_else(|| {
            Failure::argument(format!("index is {index}, but the number of adapters is {}", all.len()))
        })?;
        out.write(vrtm_adapter_data {
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

#[cfg(all(test, feature = "gpu"))]
mod tests {
    use std::ffi::CStr;

    use super::super::asset::{
        vrtm_asset_create, vrtm_asset_destroy, vrtm_asset_tile, vrtm_asset_tile_count,
    };
    use super::super::fetch::vrtm_asset_fetch_corner_uvs;
    use super::super::handle::{vrtm_asset, vrtm_tile};
    use super::super::report::vrtm_asset_report;
    use super::super::solve::vrtm_asset_solve;
    use super::super::status::{VRTM_ERROR_DEVICE_LOST, VRTM_ERROR_INVALID_HANDLE, VRTM_OK, vrtm_last_error};
    use super::super::tile::vrtm_tile_set_mask;
    use super::super::types::{VRTM_SCALAR_F32, vrtm_array};
    use super::*;
    use crate::device::tests::{asset, gpu};

    fn sized<T: Sized32>() -> T {
        // SAFETY: all zeros is a valid value (trait contract).
        let mut value: T = unsafe { std::mem::zeroed() };
        // SAFETY: the first field is `struct_size: u32` (trait contract).
        unsafe { (&raw mut value).cast::<u32>().write(size_of::<T>() as u32) };
        value
    }

    #[test]
    fn a_lost_gpu_is_a_status_of_its_own_and_handles_still_end() {
        let Some(lost) = gpu() else { return };
        let made = handle::add_asset(asset(&lost).unwrap()).unwrap();
        let device = handle::add_device(lost.clone()).unwrap();
        assert!(lost.lose_for_tests());
        drop(lost);
        let said = |status: vrtm_status, function: &str| {
            assert_eq!(status, VRTM_ERROR_DEVICE_LOST, "{function}");
            // SAFETY: the function returns this thread's zero-terminated line.
            let message = unsafe { CStr::from_ptr(vrtm_last_error()) }.to_str().unwrap();
            assert!(message.starts_with(&format!("{function}: the GPU ")), "{message}");
            assert!(
                message.ends_with(" is lost: it was destroyed; make a new device and new assets"),
                "{message}"
            );
        };
        // SAFETY: all pointers are null or point to living memory.
        unsafe {
            let mut tile = vrtm_tile { id: 0 };
            let mut count = 0;
            assert_eq!(vrtm_asset_tile_count(made, &mut count), VRTM_OK);
            assert_eq!(vrtm_asset_tile(made, 0, &mut tile), VRTM_OK);
            said(vrtm_tile_set_mask(tile, std::ptr::null()), "vrtm_tile_set_mask");
            let points = [0.0f32; 18];
            let mut positions: vrtm_array = sized();
            positions.data = points.as_ptr().cast();
            positions.count = 6;
            positions.format = VRTM_SCALAR_F32;
            said(vrtm_asset_solve(made, &positions, std::ptr::null()), "vrtm_asset_solve");
            said(
                vrtm_asset_fetch_corner_uvs(made, [0.0f32; 16].as_mut_ptr(), 8),
                "vrtm_asset_fetch_corner_uvs",
            );
            let mut uvs: vrtm_array = positions;
            uvs.count = 3;
            let indices = [0u32, 1, 2];
            let mut mesh: super::super::mesh::vrtm_mesh_desc = sized();
            (mesh.positions, mesh.uvs) = (&positions, &uvs);
            (mesh.indices, mesh.index_count) = (indices.as_ptr(), 3);
            let mut other = vrtm_asset { id: 77 };
            said(vrtm_asset_create(device, &mesh, &mut other), "vrtm_asset_create");
            assert_eq!(other.id, 77);

            let mut info: vrtm_device_data = sized();
            assert_eq!(vrtm_device_info(device, &mut info), VRTM_OK);
            assert_eq!(info.backend, VRTM_BACKEND_GPU);
            assert!(CStr::from_ptr(info.reason.as_ptr()).to_str().unwrap().contains(" is lost: "));
            // In any order.
            assert_eq!(vrtm_device_destroy(device), VRTM_OK);
            said(vrtm_asset_solve(made, &positions, std::ptr::null()), "vrtm_asset_solve");
            assert_eq!(vrtm_asset_destroy(made), VRTM_OK);
            assert_eq!(vrtm_asset_report(made, &mut sized()), VRTM_ERROR_INVALID_HANDLE);
        }
    }

    #[test]
    fn every_adapter_is_described() {
        let mut count = 77;
        // SAFETY: the pointers point to living memory.
        unsafe {
            assert_eq!(vrtm_adapter_count(&mut count), VRTM_OK);
            for (index, adapter) in adapters().iter().enumerate() {
                let mut info: vrtm_adapter_data = sized();
                assert_eq!(vrtm_adapter_info(index as u32, &mut info), VRTM_OK);
                assert_eq!(info.software == 1, adapter.software);
                let text = [&info.name[..], &info.driver, &info.api]
                    .map(|text| CStr::from_ptr(text.as_ptr()).to_str().unwrap());
                assert_eq!(text, [&adapter.name, &adapter.driver, adapter.api]);
            }
            let mut info: vrtm_adapter_data = sized();
            assert_eq!(
                vrtm_adapter_info(count, &mut info),
                super::super::status::VRTM_ERROR_INVALID_ARGUMENT
            );
        }
    }
}
