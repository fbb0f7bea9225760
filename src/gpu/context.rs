//! An open GPU: wgpu's device and queue, what they can do, and what has gone wrong on them.
//!
//! wgpu tells of errors by callbacks, on the thread that made the call, or (`poll` on a lost device) by a panic. Here
//! all of it becomes an [`Error`]: after a batch of wgpu calls, [`Context::check`] on the same thread says what came of
//! them. An open GPU holds driver threads; they end with it.

use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, ThreadId};
use std::time::Duration;

use super::adapters::describe;
use super::kernels::Pipelines;
use crate::error::{Error, ErrorKind, Result};
use crate::method::point::Switch;
use crate::panics::contain;
use crate::report::AdapterInfo;

/// How a GPU is opened.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    /// With WebGPU's default limits (bindings of 128 MiB, buffers of 256 MiB) and no optional feature, instead of what
    /// the adapter has: for tests, and to tell a driver's defect from ours.
    pub webgpu_limits: bool,
    /// Some stages run on the CPU: for support.
    pub switch: Option<Switch>,
    /// Most blocks of one buffer, if fewer than bindings hold: for tests of bands.
    pub band: Option<usize>,
}

/// An open GPU.
#[derive(Debug)]
pub(crate) struct Context {
    pub device: wgpu::Device,
    /// Dropped by hand: it waits for what was submitted, and panics if that fails.
    pub queue: ManuallyDrop<wgpu::Queue>,
    pub adapter: wgpu::AdapterInfo,
    pub limits: wgpu::Limits,
    pub options: Options,
    /// True if passes can be timed on the device.
    pub timestamps: bool,
    pub pipelines: Pipelines,
    time_kernels: AtomicBool,
    trouble: Arc<Trouble>,
}

/// Bytes of a buffer for `size` bytes.
pub fn padded(size: u64) -> u64 {
    size.max(16).next_multiple_of(16)
}

/// What went wrong since the last look.
#[derive(Debug, Default)]
struct Trouble {
    /// Why the device is gone.
    lost: Mutex<Option<String>>,
    /// Errors that no scope caught, each with the thread whose call it was: assets are solved side by side, and an
    /// error of one must not be taken for another's.
    errors: Mutex<Vec<(ThreadId, Error)>>,
}

/// Errors kept for threads that never look.
const MOST_ERRORS: usize = 64;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// wgpu explains over several lines.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl Trouble {
    fn keep_loss(&self, why: &str) {
        let why = if why.trim().is_empty() { "it was destroyed".to_owned() } else { one_line(why) };
        lock(&self.lost).get_or_insert(why);
    }

    fn keep(&self, error: &wgpu::Error) {
        let kind = match error {
            wgpu::Error::OutOfMemory { .. } => ErrorKind::OutOfMemory,
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => ErrorKind::Internal,
        };
        let mut errors = lock(&self.errors);
        if errors.len() < MOST_ERRORS {
            let error = Error::new(kind, format!("the GPU: {}", one_line(&error.to_string())));
            errors.push((thread::current().id(), error));
        }
    }

    /// This thread's first error; the others, which follow from it, are forgotten.
    fn take(&self) -> Option<Error> {
        let mut errors = lock(&self.errors);
        if errors.is_empty() {
            return None;
        }
        let me = thread::current().id();
        let first = errors.iter().find(|(thread, _)| *thread == me).map(|(_, error)| error.clone());
        errors.retain(|(thread, _)| *thread != me);
        first
    }
}

impl Context {
    /// Opens an adapter.
    ///
    /// # Errors
    /// `Unsupported`, with the driver's reason.
    pub fn open(adapter: &wgpu::Adapter, options: Options) -> Result<Context> {
        let (features, limits) = if options.webgpu_limits {
            (wgpu::Features::empty(), wgpu::Limits::defaults())
        } else {
            (adapter.features() & wgpu::Features::TIMESTAMP_QUERY, adapter.limits())
        };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("vrtm"),
            required_features: features,
            required_limits: limits.clone(),
            // The host renders on the same GPU: small blocks, given back early.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let refused = |why: String| {
            let name = &adapter.get_info().name;
            Error::new(
                ErrorKind::Unsupported,
                format!("adapter: {name} cannot be opened: {}", one_line(&why)),
            )
        };
        let (device, queue) = contain(|| pollster::block_on(adapter.request_device(&descriptor)))
            .map_err(refused)?
            .map_err(|error| refused(error.to_string()))?;
        let trouble = Arc::new(Trouble::default());
        let kept = trouble.clone();
        device.set_device_lost_callback(move |_, why| kept.keep_loss(&why));
        let kept = trouble.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| kept.keep(&error)));
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let queue = ManuallyDrop::new(queue);
        let (adapter, pipelines) = (adapter.get_info(), Pipelines::default());
        let time_kernels = AtomicBool::new(false);
        Ok(Context { device, queue, adapter, limits, options, timestamps, pipelines, time_kernels, trouble })
    }

    /// What a host is told of the adapter.
    pub fn describe(&self) -> AdapterInfo {
        describe(&self.adapter)
    }

    /// True if each dispatch has a pass of its own, so that each kernel's time is known.
    pub fn times_kernels(&self) -> bool {
        self.time_kernels.load(Ordering::Relaxed)
    }

    /// Times each kernel by itself from now on, which costs some time.
    #[cfg(feature = "oracle")]
    pub fn time_kernels(&self, yes: bool) {
        self.time_kernels.store(yes, Ordering::Relaxed);
    }

    /// `DeviceLost` if the GPU went away.
    pub fn alive(&self) -> Result<()> {
        match &*lock(&self.trouble.lost) {
            Some(why) => Err(Error::new(
                ErrorKind::DeviceLost,
                format!("the GPU {} is lost: {why}; make a new device and new assets", self.adapter.name),
            )),
            None => Ok(()),
        }
    }

    /// The first error of this thread's calls since its last check: `DeviceLost`, `OutOfMemory`, or `Internal` for what
    /// wgpu's validation rejects.
    pub fn check(&self) -> Result<()> {
        let error = self.trouble.take();
        self.alive()?;
        let Some(error) = error else { return Ok(()) };
        // A device that goes away rejects calls before it says that it is lost: it gets a moment to say so.
        for _ in 0..if error.kind == ErrorKind::Internal { 20 } else { 0 } {
            let _ = contain(|| self.device.poll(wgpu::PollType::Poll));
            self.alive()?;
            thread::sleep(Duration::from_millis(1));
        }
        Err(error)
    }

    /// Runs wgpu calls that may panic where they should fail, and checks.
    pub fn contain<R>(&self, body: impl FnOnce() -> R) -> Result<R> {
        let outcome = contain(body);
        self.check()?;
        outcome.map_err(|why| Error::new(ErrorKind::Internal, format!("the GPU: {}", one_line(&why))))
    }

    /// Submits what was encoded, in order, as one submission.
    pub fn submit(&self, encoders: impl IntoIterator<Item = wgpu::CommandEncoder>) -> Result<()> {
        self.contain(|| {
            let _ = self.queue.submit(encoders.into_iter().map(wgpu::CommandEncoder::finish));
        })
    }

    /// Waits for all work that was submitted.
    pub fn wait(&self) -> Result<()> {
        self.contain(|| self.device.poll(wgpu::PollType::wait_indefinitely()))?
            .map(drop)
            .map_err(|error| Error::new(ErrorKind::Internal, format!("the GPU: {error}")))
    }

    /// Gives the memory of dropped buffers back that finished work does not need any more; waits for nothing. Call it
    /// after dropping a tile's or an asset's buffers.
    pub fn reclaim(&self) {
        // Whatever goes wrong here is met again by the next call that has a result.
        let _ = contain(|| self.device.poll(wgpu::PollType::Poll));
    }

    /// Makes a buffer of at least `size` bytes, all zero.
    ///
    /// # Errors
    /// `OutOfMemory` with the label and the bytes, also if the GPU has no buffers of that size; `DeviceLost`.
    pub fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let short = |why: &str| {
            Error::new(ErrorKind::OutOfMemory, format!("{label}: {size} bytes on the GPU: {why}"))
        };
        let most = self.limits.max_buffer_size;
        let padded = size.checked_add(16).map(|_| padded(size)).filter(|&padded| padded <= most);
        let padded = padded.ok_or_else(|| short(&format!("its buffers hold at most {most}")))?;
        let descriptor =
            wgpu::BufferDescriptor { label: Some(label), size: padded, usage, mapped_at_creation: false };
        let make = || self.contain(|| self.device.create_buffer(&descriptor));
        let short_of_memory = |error: &Error| error.kind == ErrorKind::OutOfMemory;
        make()
            .or_else(|error| {
                if !short_of_memory(&error) {
                    return Err(error);
                }
                // Dropped buffers may wait for work that is under way.
                self.wait()?;
                make()
            })
            .map_err(|error| if short_of_memory(&error) { short("out of memory") } else { error })
    }

    /// Destroys the GPU's device, as if it went away: for tests.
    #[cfg(feature = "oracle")]
    pub fn lose(&self) {
        self.device.destroy();
        // The loss is reported once the queue is empty.
        let _ = contain(|| self.device.poll(wgpu::PollType::wait_indefinitely()));
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: the queue is not used again: this is the end of its owner.
        let _ = contain(|| unsafe { ManuallyDrop::drop(&mut self.queue) });
    }
}

#[cfg(test)]
pub(crate) mod tests;
