//! A device: which backend, how many threads, how much memory, where the log goes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, ErrorKind, Result};
use crate::gpu;
use crate::gpu::adapters::{self, Survey};
use crate::gpu::context::Context;
use crate::report::{AdapterInfo, DeviceInfo};
use crate::settings::{Backend, DeviceSettings, LogLevel};

/// Where assets are solved. Cloning gives another handle to the same device.
#[derive(Clone, Debug)]
pub struct Device(Arc<Inner>);

#[derive(Debug)]
struct Inner {
    settings: DeviceSettings,
    threads: u32,
    reason: String,
    bytes_held: AtomicU64,
    gpu: Option<Arc<Context>>,
}

/// What the environment, or a test, decides beside the settings.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Options {
    /// False keeps devices on the CPU.
    pub gpu_solves: bool,
    pub gpu: gpu::context::Options,
}

impl Options {
    fn from_environment() -> Result<Options> {
        let webgpu_limits = match variable("VRTM_GPU_LIMITS").as_deref() {
            None => false,
            Some("webgpu") => true,
            Some(other) => return Err(Error::argument(format!("VRTM_GPU_LIMITS: '{other}' is not webgpu"))),
        };
        Ok(Options { gpu_solves: gpu::SOLVES, gpu: gpu::context::Options { webgpu_limits } })
    }
}

fn variable(name: &str) -> Option<String> {
    std::env::var_os(name).map(|value| value.to_string_lossy().into_owned())
}

/// The GPUs that a device can be made on: those that run compute shaders with at least WebGPU's default limits, through
/// Vulkan, Direct3D 12 or Metal. Hardware stands before software, discrete before integrated; the order stays while
/// the machine and its drivers do. Empty without a GPU or a driver.
///
/// Each call loads the drivers anew, which takes tens of milliseconds.
pub fn adapters() -> Vec<AdapterInfo> {
    Survey::new().usable.iter().map(|adapter| adapters::describe(&adapter.get_info())).collect()
}

impl Device {
    /// Makes a device. Environment variables override the settings, for support: VRTM_DEVICE (auto, cpu, gpu),
    /// VRTM_THREADS, and VRTM_GPU_LIMITS=webgpu, which opens a GPU with WebGPU's default limits and without optional
    /// features.
    ///
    /// # Errors
    /// For [`Backend::Gpu`], `Unsupported` if there is no GPU or it cannot be opened, and `InvalidArgument` if there is
    /// none of that number; `InvalidArgument` for more than 1024 threads or an unreadable environment variable.
    pub fn new(settings: &DeviceSettings) -> Result<Device> {
        Device::with(settings, Options::from_environment()?)
    }

    pub(crate) fn with(settings: &DeviceSettings, options: Options) -> Result<Device> {
        let mut settings = settings.clone();
        let mut origin = "";
        if let Some(value) = variable("VRTM_DEVICE") {
            origin = " (VRTM_DEVICE)";
            settings.backend = match value.as_str() {
                "auto" => Backend::Auto,
                "cpu" => Backend::Cpu,
                "gpu" => Backend::Gpu,
                _ => return Err(Error::argument(format!("VRTM_DEVICE: '{value}' is not auto, cpu or gpu"))),
            };
        }
        if let Some(value) = variable("VRTM_THREADS") {
            settings.threads = value.parse().map_err(|_| {
                Error::argument(format!("VRTM_THREADS: '{value}' is not a number of threads"))
            })?;
        }
        if settings.threads > 1024 {
            return Err(Error::argument(format!("threads: {} is over 1024", settings.threads)));
        }
        let (gpu, reason) = match settings.backend {
            Backend::Cpu => (None, format!("cpu was asked for{origin}")),
            Backend::Gpu => {
                let (gpu, which) = open(settings.adapter, origin, options)?;
                (Some(gpu), format!("gpu was asked for{origin}: {which}"))
            }
            Backend::Auto => {
                let (gpu, why) = choose(options);
                (gpu, format!("auto{origin}: {why}"))
            }
        };
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
        let threads = if settings.threads == 0 { cores.min(1024) } else { settings.threads };
        let gpu = gpu.map(Arc::new);
        let device =
            Device(Arc::new(Inner { settings, threads, reason, bytes_held: AtomicU64::new(0), gpu }));
        let info = device.info();
        device.log(LogLevel::Info, &format!("device: {}, {threads} threads; {}", info.name, info.reason));
        Ok(device)
    }

    /// What this device is, and why.
    pub fn info(&self) -> DeviceInfo {
        let mut reason = self.0.reason.clone();
        if let Err(error) = self.alive() {
            reason = format!("{}; {reason}", error.message);
        }
        DeviceInfo {
            backend: if self.0.gpu.is_some() { Backend::Gpu } else { Backend::Cpu },
            name: match &self.0.gpu {
                Some(gpu) => gpu.adapter.name.clone(),
                None => format!("CPU ({})", std::env::consts::ARCH),
            },
            reason,
            threads: self.0.threads,
            bytes_held: self.0.bytes_held.load(Ordering::Relaxed),
        }
    }

    /// The open GPU, if this is one.
    pub(crate) fn gpu(&self) -> Option<&Arc<Context>> {
        self.0.gpu.as_ref()
    }

    /// `DeviceLost` if the GPU went away.
    pub(crate) fn alive(&self) -> Result<()> {
        self.gpu().map_or(Ok(()), |gpu| gpu.alive())
    }

    /// Destroys the GPU, as if it went away; true if this device has one.
    #[doc(hidden)]
    pub fn lose_for_tests(&self) -> bool {
        self.gpu().map(|gpu| gpu.lose()).is_some()
    }

    /// On a GPU, times each kernel by itself from now on ([`crate::GpuKernel::ms`]): for benches, since it costs time.
    pub fn time_kernels(&self, yes: bool) {
        if let Some(gpu) = self.gpu() {
            gpu.time_kernels(yes);
        }
    }

    pub(crate) fn threads(&self) -> usize {
        self.0.threads as usize
    }

    pub(crate) fn log(&self, level: LogLevel, message: &str) {
        if let Some(log) = &self.0.settings.log {
            log(level, message);
        }
    }

    /// Books a change of an asset's bytes against the budget; `what` is named if it does not fit.
    pub(crate) fn rebook(&self, before: u64, after: u64, what: &str) -> Result<()> {
        let budget = self.0.settings.memory_budget;
        self.0
            .bytes_held
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, |held| {
                let next = held - before.min(held) + after;
                (after <= before || budget == 0 || next <= budget).then_some(next)
            })
            .map(drop)
            .map_err(|held| {
                Error::new(
                    ErrorKind::OutOfMemory,
                    format!(
                        "{what} needs {after} bytes; {} of the device's {budget} are in use",
                        held - before.min(held)
                    ),
                )
            })
    }
}

/// The GPU that was asked for by its number, and which one that is.
fn open(index: u32, origin: &str, options: Options) -> Result<(Context, String)> {
    let unsupported = |why: &str| {
        Error::new(ErrorKind::Unsupported, format!("backend: gpu was asked for{origin}, but {why}"))
    };
    if !options.gpu_solves {
        return Err(unsupported("this build has the CPU backend only"));
    }
    let survey = Survey::new();
    let count = survey.usable.len();
    if count == 0 {
        return Err(unsupported(&format!(
            "there is no GPU that runs compute shaders with WebGPU's default limits (looked through {}; found: {})",
            adapters::interfaces(),
            survey.found()
        )));
    }
    let adapter = survey.usable.get(index as usize).ok_or_else(|| {
        let s = if count == 1 { "" } else { "s" };
        Error::argument(format!("adapter: {index} is out of range, there is {count} adapter{s}"))
    })?;
    let gpu = Context::open(adapter, options.gpu)?;
    let which = format!("adapter {index} of {count}, {}", through(&gpu));
    Ok((gpu, which))
}

/// The GPU that `auto` takes, or the CPU, and why.
fn choose(options: Options) -> (Option<Context>, String) {
    if !options.gpu_solves {
        return (None, "this build has the CPU backend only".to_owned());
    }
    let survey = Survey::new();
    let Some(adapter) = survey.hardware() else {
        return (None, format!("no hardware GPU (found: {})", survey.found()));
    };
    match Context::open(adapter, options.gpu) {
        Ok(gpu) => {
            let why = format!("a hardware GPU, {}", through(&gpu));
            (Some(gpu), why)
        }
        Err(error) => (None, format!("the CPU, as {}", error.message)),
    }
}

fn through(gpu: &Context) -> String {
    let info = adapters::describe(&gpu.adapter);
    let software = if info.software { ", a software driver" } else { "" };
    format!("through {} ({}){software}", info.api, info.driver)
}
