//! A device: which backend, how many threads, how much memory, where the log goes.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use crate::error::{Error, ErrorKind, Result};
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
}

/// The GPUs that a device could be made on. None in this build: it has the CPU backend only.
pub fn adapters() -> Vec<AdapterInfo> {
    Vec::new()
}

impl Device {
    /// Makes a device. The environment variables VRTM_DEVICE (auto, cpu, gpu) and VRTM_THREADS override the
    /// settings, for support.
    ///
    /// # Errors
    /// `Unsupported` for [`Backend::Gpu`]; `InvalidArgument` for more than 1024 threads or an unreadable
    /// environment variable.
    pub fn new(settings: &DeviceSettings) -> Result<Device> {
        let mut settings = settings.clone();
        let mut origin = "";
        if let Ok(value) = std::env::var("VRTM_DEVICE") {
            origin = " (VRTM_DEVICE)";
            settings.backend = match value.as_str() {
                "auto" => Backend::Auto,
                "cpu" => Backend::Cpu,
                "gpu" => Backend::Gpu,
                _ => return Err(Error::argument(format!("VRTM_DEVICE: '{value}' is not auto, cpu or gpu"))),
            };
        }
        if let Ok(value) = std::env::var("VRTM_THREADS") {
            settings.threads = value.parse().map_err(|_| {
                Error::argument(format!("VRTM_THREADS: '{value}' is not a number of threads"))
            })?;
        }
        if settings.threads > 1024 {
            return Err(Error::argument(format!("threads: {} is over 1024", settings.threads)));
        }
        let reason = match settings.backend {
            Backend::Gpu => {
                return Err(Error::new(
                    ErrorKind::Unsupported,
                    format!("backend: gpu was asked for{origin}, but this build has the CPU backend only"),
                ));
            }
            Backend::Cpu => format!("cpu was asked for{origin}"),
            Backend::Auto => format!("auto{origin}: this build has the CPU backend only"),
        };
        let cores = std::thread::available_parallelism().map_or(1, |n| n.get() as u32);
        let threads = if settings.threads == 0 { cores.min(1024) } else { settings.threads };
        let device = Device(Arc::new(Inner { settings, threads, reason, bytes_held: AtomicU64::new(0) }));
        device.log(LogLevel::Info, &format!("device: CPU, {threads} threads; {}", device.0.reason));
        Ok(device)
    }

    /// What this device is, and why.
    pub fn info(&self) -> DeviceInfo {
        DeviceInfo {
            backend: Backend::Cpu,
            name: format!("CPU ({})", std::env::consts::ARCH),
            reason: self.0.reason.clone(),
            threads: self.0.threads,
            bytes_held: self.0.bytes_held.load(Ordering::Relaxed),
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
