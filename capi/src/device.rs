//! Devices.

use std::ffi::{CString, c_char, c_void};
use std::num::NonZeroU32;
use std::sync::Arc;

use super::adapter::{adapter_id, vrtm_adapter_by};
use super::allocator::{self, vrtm_allocator};
use super::desc::{self, Sized32, User, sized};
use super::executor::{HostExecutor, vrtm_executor};
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{DEVICES, vrtm_device};
use super::mirror::{Mirror, choice, mirror};
use super::status::{Outcome, chars, vrtm_status};
use vrtm::Device;
use vrtm_core::log::{LogCode, LogEntry, LogFn, LogLevel};
use vrtm_core::report::DeviceInfo;
use vrtm_core::settings::{Backend, DeviceSettings};

choice! {
    BACKENDS: vrtm_backend of Backend {
        VRTM_BACKEND_AUTO = 0: Auto, VRTM_BACKEND_CPU = 1: Cpu, VRTM_BACKEND_GPU = 2: Gpu,
    }
}

choice! {
    LOG_LEVELS: vrtm_log_level of LogLevel { VRTM_LOG_LEVEL_WARNING = 1: Warning, VRTM_LOG_LEVEL_INFO = 2: Info }
}

choice! {
    LOG_CODES: vrtm_log_code of LogCode {
        VRTM_LOG_CODE_DEVICE = 1: Device,
        VRTM_LOG_CODE_MESH = 2: Mesh,
        VRTM_LOG_CODE_TILE = 3: Tile,
        VRTM_LOG_CODE_FACES_CLIPPED = 4: FacesClipped,
        VRTM_LOG_CODE_FACES_OUTSIDE = 5: FacesOutside,
        VRTM_LOG_CODE_TRIANGLES_DEGENERATE = 6: TrianglesDegenerate,
        VRTM_LOG_CODE_EDGES_APART = 7: EdgesApart,
        VRTM_LOG_CODE_SEAMS_UNUSED = 8: SeamsUnused,
        VRTM_LOG_CODE_REST_IS_POINT = 9: RestIsPoint,
        VRTM_LOG_CODE_RIGIDITY_RANGE = 10: RigidityRange,
        VRTM_LOG_CODE_MASK_RANGE = 11: MaskRange,
        VRTM_LOG_CODE_GRID_TOO_COARSE = 12: GridTooCoarse,
        VRTM_LOG_CODE_GRID_TOO_FINE = 13: GridTooFine,
        VRTM_LOG_CODE_OVERLAP = 14: Overlap,
        VRTM_LOG_CODE_NODES_AT_GAPS = 15: NodesAtGaps,
        VRTM_LOG_CODE_GRID = 16: Grid,
        VRTM_LOG_CODE_NOTHING_MOVES = 17: NothingMoves,
        VRTM_LOG_CODE_NO_RIGIDITY = 18: NoRigidity,
        VRTM_LOG_CODE_POSE_SCALE = 19: PoseScale,
        VRTM_LOG_CODE_POSE_ORDER = 20: PoseOrder,
        VRTM_LOG_CODE_WELDS_TORN = 21: WeldsTorn,
        VRTM_LOG_CODE_WELDS_WHOLE = 22: WeldsWhole,
    }
}

/// A line of the log, which the library fills. It lives during the call of the log function.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_log_entry {
    /// sizeof(vrtm_log_entry) of the library.
    pub struct_size: u32,
    /// One of VRTM_LOG_LEVEL_.
    pub level: vrtm_log_level,
    /// One of VRTM_LOG_CODE_, or one of a later version. Programs decide by it and by `values`: the words of a message
    /// may change.
    pub code: vrtm_log_code,
    /// UDIM number of the tile that the line is about; 0 = about no single tile.
    pub udim: u32,
    /// UV set of that tile.
    pub uv_set: u32,
    /// Layer of that tile.
    pub layer: u32,
    /// Numbers of the message, as the code's comment lists them; the others are 0.
    pub values: [f64; 6],
    /// One line for people, UTF-8, without a line break.
    pub message: *const c_char,
}

/// A host's log function. It is called during a call into vrtm, on the thread that does the call's work, also by
/// several threads at once. It may call vrtm functions; calls that use the asset of the current call give
/// VRTM_ERROR_BUSY, as does waiting for the current job.
pub type vrtm_log_fn = Option<unsafe extern "C" fn(user: *mut c_void, entry: *const vrtm_log_entry)>;

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
    /// Number of the GPU, 0 <= adapter < vrtm_adapter_count, if `backend` is GPU and `adapter_by` is NUMBER;
    /// ignored otherwise.
    pub adapter: u32,
    /// The identity of the adapter, in memory order; unused bytes are zero.
    pub adapter_id: [u8; 16],
    /// CPU threads that one solve uses, at most 1024; 0 = one per core. The result is the same bit for bit. The
    /// environment variable VRTM_THREADS overrides it.
    pub threads: u32,
    /// Maximum bytes that the prepared tiles of all assets of the device may hold together, with their maps and
    /// solvers, and with carriers and the poses that they follow; 0 = no limit. A call that would exceed it gives
    /// VRTM_ERROR_OUT_OF_MEMORY. A carrier is also refused if there is no room for what its first fetch will hold.
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

mirror! {
    report vrtm_device_info of r: DeviceInfo {
        backend: vrtm_backend = r.backend.to_c(),
        /// The processor's or adapter's name, UTF-8.
        name: [c_char; 128] = chars::<128>(&r.name),
        /// Reason for the choice of this backend, a sentence, UTF-8. If the GPU was lost, the cause comes first.
        reason: [c_char; 256] = chars::<256>(&r.reason),
        threads: u32, bytes_held: u64,
    }
}

// SAFETY: repr(C), struct_size first, numbers, raw pointers and an optional function.
sized!(vrtm_device_desc, vrtm_log_entry);

impl Default for vrtm_device_desc {
    fn default() -> vrtm_device_desc {
        Sized32::zeroed()
    }
}

/// A host's log function and its user data.
struct HostLog {
    call: unsafe extern "C" fn(*mut c_void, *const vrtm_log_entry),
    user: User,
}

impl HostLog {
    fn write(&self, entry: &LogEntry) {
        let &LogEntry { level, code, udim, uv_set, layer, values: numbers, message, .. } = entry;
        let line: String =
            message.chars().map(|c| if matches!(c, '\0' | '\n' | '\r') { ' ' } else { c }).collect();
        let mut values = [0.0; 6];
        values[..numbers.len()].copy_from_slice(numbers);
        if let Ok(line) = CString::new(line) {
            let entry = vrtm_log_entry {
                level: level.to_c(),
                code: code.to_c(),
                udim: udim.unwrap_or(0),
                uv_set,
                layer,
                values,
                message: line.as_ptr(),
                ..Sized32::zeroed()
            };
            // SAFETY: the host vouches for the function and for its user data.
            unsafe { (self.call)(self.user.pointer(), &entry) }
        }
    }
}

unsafe fn settings(desc: &vrtm_device_desc) -> Outcome<DeviceSettings> {
    let backend = Backend::from_c(desc.backend, "desc.backend")?;
    let log = desc.log.map(|call| {
        let host = HostLog { call, user: User(desc.log_user) };
        Arc::new(move |entry: &LogEntry| host.write(entry)) as LogFn
    });
    // SAFETY: the host's pointer.
    let executor = unsafe { HostExecutor::read(desc.executor, "desc.executor") }?;
    Ok(DeviceSettings {
        backend,
        adapter: desc.adapter,
        adapter_id: adapter_id(desc.adapter_by, desc.adapter_id)?,
        threads: NonZeroU32::new(desc.threads),
        memory_budget: (desc.memory_budget != 0).then_some(desc.memory_budget),
        log,
        executor: executor.map(|executor| Arc::new(executor) as _),
        // SAFETY: the host's pointer.
        allocator: unsafe { allocator::read(desc.allocator, "desc.allocator") }?,
    })
}

/// Makes a device. `desc` may be null, which means all defaults. The caller destroys `*device`. Make one device and
/// keep it: looking for GPUs and opening one loads drivers, which takes tens of milliseconds, and an open GPU keeps
/// threads of its driver alive. For support, the environment variable VRTM_GPU_LIMITS=webgpu opens GPUs with WebGPU's
/// default limits and without optional features.
///
/// Errors: VRTM_ERROR_INVALID_ARGUMENT for an identity that no adapter has (VRTM_BACKEND_GPU; the message lists the
/// available ones), an allocator without a function, or an environment variable that cannot be read;
/// VRTM_ERROR_UNSUPPORTED for VRTM_BACKEND_GPU if no GPU was found or it cannot be opened, and for an allocator if the
/// library was built without the feature for it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_create(
    desc: *const vrtm_device_desc,
    device: *mut vrtm_device,
) -> vrtm_status {
    guard_value("vrtm_device_create", device, "device", || {
        // SAFETY: the host's pointer.
        let desc = unsafe { desc::read_or_default(desc, "desc") }?;
        // SAFETY: as above.
        let device = Device::new(&unsafe { settings(&desc) }?)?;
        Ok(vrtm_device { id: DEVICES.add(device)? })
    })
}

/// Describes a device: its backend, why it was chosen, and how much memory its assets hold. Works even after the GPU
/// was lost.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_get_info(
    device: vrtm_device,
    info: *mut vrtm_device_info,
) -> vrtm_status {
    guard_struct("vrtm_device_get_info", info, "info", || Ok(DEVICES.get("device", device.id)?.info().into()))
}

/// Destroys a device's handle. Assets that were made on it, and the log function, remain in use until the assets are
/// destroyed, in any order.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_device_destroy(device: vrtm_device) -> vrtm_status {
    guard("vrtm_device_destroy", || DEVICES.remove(device.id).map(drop))
}
