//! A device: which backend, how many threads, how much memory, where the log goes.

mod choice;

use std::num::NonZeroU32;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use vrtm_core::allocation::{self, Current, boxed};
use vrtm_core::backend::{Gpu, Options, TileSolver};
use vrtm_core::control::Control;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::grid::Grid;
use vrtm_core::log::{LogCode, LogEntry};
use vrtm_core::mesh::TileMesh;
use vrtm_core::method::plan::Purpose;
use vrtm_core::report::{AdapterInfo, DeviceInfo, report};
use vrtm_core::settings::{AdapterId, Backend, DeviceSettings, MAX_THREADS};
use vrtm_core::team::{Crew, Executor, Team};
use vrtm_core::unwind::caught;
use vrtm_cpu as cpu;

/// A backend on which assets are solved. Cloning gives another handle to the same device.
#[derive(Clone, Debug)]
pub struct Device(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    settings: DeviceSettings,
    threads: u32,
    reason: String,
    bytes_held: AtomicU64,
    gpu: Option<Arc<dyn Gpu>>,
    assets: AtomicUsize,
}

/// Counts a live asset. After the last one, free memory goes back to the system.
#[derive(Debug)]
pub(crate) struct LiveAsset(Device);

impl LiveAsset {
    pub fn new(device: &Device) -> LiveAsset {
        device.0.assets.fetch_add(1, Ordering::Relaxed);
        LiveAsset(device.clone())
    }
}

impl Drop for LiveAsset {
    fn drop(&mut self) {
        if self.0.0.assets.fetch_sub(1, Ordering::Relaxed) == 1 {
            give_memory_back();
        }
    }
}

/// Returns free pages of the heap to the system. Without this, glibc keeps up to hundreds of megabytes of freed memory
/// for later use.
fn give_memory_back() {
    #[cfg(all(target_os = "linux", target_env = "gnu", not(miri)))]
    // SAFETY: may be called at any time by any thread.
    unsafe {
        libc::malloc_trim(0);
    }
}

/// Settings that come from the environment; tests set them directly.
#[derive(Clone, Copy, Debug, Default)]
struct Overrides {
    backend: Option<Backend>,
    adapter_id: Option<AdapterId>,
    threads: Option<Option<NonZeroU32>>,
    gpu: Options,
}

impl Overrides {
    fn read(variable: impl Fn(&str) -> Option<String>) -> Result<Overrides> {
        let mut overrides = Overrides::default();
        if let Some(value) = variable("VRTM_DEVICE") {
            overrides.backend = Some(match (value.as_str(), value.strip_prefix("gpu:")) {
                ("auto", _) => Backend::Auto,
                ("cpu", _) => Backend::Cpu,
                ("gpu", _) => Backend::Gpu,
                (_, Some(uuid)) => {
                    let message = || format!("VRTM_DEVICE: '{uuid}' is no UUID of 32 hexadecimal digits");
                    let id = AdapterId::uuid(uuid).ok_or_else(|| Error::argument(message()))?;
                    overrides.adapter_id = Some(id);
                    Backend::Gpu
                }
                _ => {
                    let message = format!("VRTM_DEVICE: '{value}' is not auto, cpu, gpu or gpu:UUID");
                    return Err(Error::argument(message));
                }
            });
        }
        if let Some(value) = variable("VRTM_THREADS") {
            let threads: u32 = value.parse().map_err(|_| {
                Error::argument(format!("VRTM_THREADS: '{value}' is not a number of threads"))
            })?;
            overrides.threads = Some(NonZeroU32::new(threads));
        }
        if let Some(value) = variable("VRTM_GPU_LIMITS") {
            ensure!(value == "webgpu", "VRTM_GPU_LIMITS: '{value}' is not webgpu");
            overrides.gpu.webgpu_limits = true;
        }
        Ok(overrides)
    }
}

/// The GPUs that a device can be made on: those that run compute shaders with at least WebGPU's default limits, through
/// Vulkan, Direct3D 12 or Metal. Hardware GPUs come before software ones, discrete before integrated; the order is
/// stable for the same machine and drivers. Empty without a GPU or a driver.
///
/// Each call loads the drivers, which takes tens of milliseconds, and longer the first time. This library prints
/// nothing, but a driver may: Mesa's on Linux prints a line about XDG_RUNTIME_DIR if it is not set.
#[must_use]
#[expect(clippy::disallowed_types, reason = "public: that of the standard library")]
pub fn adapters() -> std::vec::Vec<AdapterInfo> {
    choice::find().infos().into()
}

impl Device {
    /// Makes a device. Looking for a GPU and opening it takes tens of milliseconds, and an open one keeps threads of
    /// its driver, so make one device and keep it. For support, environment variables override the settings:
    /// VRTM_DEVICE (auto, cpu, gpu, or gpu:UUID for the GPU with this UUID), VRTM_THREADS, and VRTM_GPU_LIMITS=webgpu,
    /// which opens a GPU with WebGPU's default limits and without optional features.
    ///
    /// # Errors
    /// For [`Backend::Gpu`], `Unsupported` if no GPU was found or it cannot be opened, and `InvalidArgument` for an
    /// unknown number or identity; `InvalidArgument` for more than 1024 threads or an unreadable environment variable;
    /// `Unsupported` for an allocator unless [`crate::Allocator`] is the global one; `OutOfMemory`.
    pub fn new(settings: &DeviceSettings) -> Result<Device> {
        let variable = |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
        Device::with(settings, Overrides::read(variable)?)
    }

    /// Makes a device with the given overrides instead of the environment's, and with GPU buffers of at most
    /// `most_blocks` blocks.
    #[doc(hidden)]
    pub fn with_variables(
        settings: &DeviceSettings,
        variables: &[(&str, &str)],
        most_blocks: Option<usize>,
    ) -> Result<Device> {
        let find =
            |name: &str| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| value.to_string());
        let mut overrides = Overrides::read(find)?;
        overrides.gpu.most_blocks = most_blocks;
        Device::with(settings, overrides)
    }

    fn with(settings: &DeviceSettings, overrides: Overrides) -> Result<Device> {
        if settings.allocator.is_some() && !allocation::is_installed() {
            let why = "allocator: the program's global allocator is not vrtm::Allocator";
            return Err(Error::new(ErrorKind::Unsupported, why));
        }
        in_memory_of(settings, || Device::make(settings, overrides))
    }

    fn make(settings: &DeviceSettings, overrides: Overrides) -> Result<Device> {
        let mut settings = settings.clone();
        settings.threads = overrides.threads.unwrap_or(settings.threads);
        settings.backend = overrides.backend.unwrap_or(settings.backend);
        settings.adapter_id = overrides.adapter_id.or(settings.adapter_id);
        let origin = if overrides.backend.is_some() { " (VRTM_DEVICE)" } else { "" };
        if let Some(threads) = settings.threads.filter(|threads| threads.get() > MAX_THREADS) {
            return Err(Error::argument(format!("threads: {threads} is over {MAX_THREADS}")));
        }
        let (gpu, reason) = match settings.backend {
            Backend::Cpu => (None, format!("cpu was asked for{origin}")),
            Backend::Gpu => {
                let (gpu, which) = choice::open(&settings, origin, overrides.gpu)?;
                (Some(gpu), format!("gpu was asked for{origin}: {which}"))
            }
            Backend::Auto => {
                let (gpu, why) = choice::choose(settings.adapter_id, overrides.gpu);
                (gpu, format!("auto{origin}: {why}"))
            }
        };
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
        let threads = settings.threads.map_or(cores.min(MAX_THREADS), NonZeroU32::get);
        let (bytes_held, assets) = (AtomicU64::new(0), AtomicUsize::new(0));
        let device = Device(Arc::new(Inner { settings, threads, reason, bytes_held, gpu, assets }));
        let info = device.info();
        let message = format!("device: {}, {threads} threads; {}", info.name, info.reason);
        device.log(LogCode::Device, None, &[f64::from(threads)], &message);
        Ok(device)
    }

    /// The chosen backend, why it was chosen, and the memory held.
    #[must_use]
    pub fn info(&self) -> DeviceInfo {
        let mut reason = self.0.reason.clone();
        if let Err(error) = self.alive() {
            reason = format!("{}; {reason}", error.message);
        }
        report!(DeviceInfo {
            backend: if self.0.gpu.is_some() { Backend::Gpu } else { Backend::Cpu },
            name: match &self.0.gpu {
                Some(gpu) => gpu.info().name.clone(),
                None => format!("CPU ({})", std::env::consts::ARCH),
            },
            reason: reason,
            threads: self.0.threads,
            bytes_held: self.0.bytes_held.load(Ordering::Relaxed),
        })
    }

    /// Calls `f` with the device's allocator; missing memory becomes an error.
    #[doc(hidden)]
    pub fn call<R>(&self, f: impl FnOnce() -> Result<R>) -> Result<R> {
        in_memory_of(&self.0.settings, f)
    }

    #[doc(hidden)]
    pub fn gpu(&self) -> Option<&Arc<dyn Gpu>> {
        self.0.gpu.as_ref()
    }

    /// Allocates the solver of a tile, or of several with their joined grid.
    pub(crate) fn solver(
        &self,
        grid: &Arc<Grid>,
        tiles: &[&TileMesh],
        purpose: Purpose,
    ) -> Result<Box<dyn TileSolver>> {
        match self.gpu() {
            Some(gpu) => gpu.clone().solver(grid, tiles),
            None => Ok(boxed(cpu::Memory::new(grid, purpose))),
        }
    }

    /// Bytes that `solver` allocates.
    pub(crate) fn solver_bytes(&self, grid: &Grid, tiles: &[&TileMesh], purpose: Purpose) -> u64 {
        match self.gpu() {
            Some(gpu) => gpu.solver_bytes(grid, tiles),
            None => cpu::Memory::bytes_for(grid, purpose),
        }
    }

    /// `DeviceLost` if the GPU was lost.
    pub(crate) fn alive(&self) -> Result<()> {
        self.gpu().map_or(Ok(()), |gpu| gpu.alive())
    }

    /// For tests: destroys the GPU, as if it were lost. True if this device has one.
    #[doc(hidden)]
    pub fn lose_for_tests(&self) -> bool {
        self.gpu().map(|gpu| gpu.lose()).is_some()
    }

    /// On a GPU, times each kernel separately from now on ([`crate::GpuKernel::ms`]). For benchmarks, since it costs
    /// time.
    #[doc(hidden)]
    pub fn time_kernels(&self, yes: bool) {
        if let Some(gpu) = self.gpu() {
            gpu.time_kernels(yes);
        }
    }

    /// The threads of a call: `threads`, or as many as the device has.
    pub(crate) fn crew(&self, threads: Option<NonZeroU32>, control: Option<Arc<Control>>) -> Crew {
        let threads = threads.map_or(self.0.threads, NonZeroU32::get) as usize;
        Crew { threads, executor: self.0.settings.executor.clone(), control }
    }

    #[doc(hidden)]
    pub fn executor(&self) -> Option<&Arc<dyn Executor>> {
        self.0.settings.executor.as_ref()
    }

    /// Calls `f` with the device's threads.
    #[doc(hidden)]
    pub fn team<R: Send>(&self, f: impl FnOnce(&Team) -> R + Send) -> R {
        Team::of(&self.crew(None, None), f)
    }

    pub(crate) fn has_log(&self) -> bool {
        self.0.settings.log.is_some()
    }

    /// Writes a line, which names its tile first if it is about one.
    pub(crate) fn log(&self, code: LogCode, tile: Option<&TileMesh>, values: &[f64], message: &str) {
        let Some(log) = &self.0.settings.log else { return };
        let named = tile.map(|tile| format!("{}: {message}", tile.name()));
        let key = tile.map(|tile| [tile.udim, tile.uv_set, tile.layer]);
        log(&LogEntry::new(code, key, values, named.as_deref().unwrap_or(message)));
    }

    /// Most bytes on the device's account.
    pub(crate) fn memory_budget(&self) -> Option<u64> {
        self.0.settings.memory_budget
    }

    /// An entry of the device's account, still of no bytes.
    pub(crate) fn booking(&self) -> Booked {
        Booked { device: self.clone(), bytes: 0 }
    }
}

/// Bytes on a device's account, until this is dropped.
#[derive(Debug)]
pub(crate) struct Booked {
    device: Device,
    bytes: u64,
}

impl Booked {
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Books this many bytes in place of those before: as many or fewer always, more if the budget allows; the error
    /// names `what` if it does not.
    pub fn set(&mut self, bytes: u64, what: &str) -> Result<()> {
        let (before, budget) = (self.bytes, self.device.memory_budget());
        let change = |held: u64| {
            let next = held - before.min(held) + bytes;
            (bytes <= before || budget.is_none_or(|budget| next <= budget)).then_some(next)
        };
        let changed = self.device.0.bytes_held.fetch_update(Ordering::Relaxed, Ordering::Relaxed, change);
        changed.map_err(|held| {
            let (held, budget) = (held - before.min(held), budget.unwrap_or_default());
            let message = format!("{what} needs {bytes} bytes; {held} of the device's {budget} are in use");
            Error::new(ErrorKind::OutOfMemory, message)
        })?;
        self.bytes = bytes;
        Ok(())
    }
}

/// Drop what the bytes were booked for first: a GPU then frees it.
impl Drop for Booked {
    fn drop(&mut self) {
        if self.bytes > 0 {
            // Booking less always succeeds.
            let _ = self.set(0, "");
            if let Some(gpu) = self.device.gpu() {
                gpu.reclaim();
            }
        }
    }
}

/// Calls `f` with the allocator of a device with these settings.
fn in_memory_of<R>(settings: &DeviceSettings, f: impl FnOnce() -> Result<R>) -> Result<R> {
    let _scope = Current::new(settings.allocator.as_ref()).enter();
    caught(f)
}
