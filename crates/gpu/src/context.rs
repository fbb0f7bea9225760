//! An open GPU: wgpu's device and queue, their capabilities, and the errors that occurred on them.
//!
//! wgpu reports errors by callbacks, on the thread that made the call, or (`poll` on a lost device) by a panic. This
//! module turns all of them into an [`Error`]: after a batch of wgpu calls, [`Context::check`] on the same thread
//! returns their first error. An open GPU holds driver threads, which end with it.

use std::mem::ManuallyDrop;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, ThreadId};
use std::time::Duration;

use super::identity::describe;
use super::kernels::Kernel;
use super::pipelines::{Pipeline, Pipelines};
use vrtm_core::backend::Options;
use vrtm_core::control::Control;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::panics::{contain, lock};
use vrtm_core::report::AdapterInfo;
use vrtm_core::unwind::caught;

/// An open GPU.
#[derive(Debug)]
pub struct Context {
    pub device: wgpu::Device,
    /// Dropped explicitly, because dropping waits for submitted work and panics if that fails.
    pub queue: ManuallyDrop<wgpu::Queue>,
    pub adapter: wgpu::AdapterInfo,
    /// The description of the adapter for the host.
    pub about: AdapterInfo,
    pub limits: wgpu::Limits,
    pub options: Options,
    /// True if the device can time passes.
    pub timestamps: bool,
    pipelines: Pipelines,
    /// True if each dispatch has its own pass, so that each kernel is timed.
    pub time_kernels: AtomicBool,
    error_log: Arc<ErrorLog>,
}

/// Size of a buffer that has to hold `size` bytes.
pub fn padded(size: u64) -> u64 {
    size.max(16).next_multiple_of(16)
}

/// The errors since the last check.
#[derive(Debug, Default)]
#[expect(clippy::disallowed_types, reason = "wgpu's own calls fill it, and must not be unwound")]
struct ErrorLog {
    /// The reason why the device was lost.
    lost: Mutex<Option<String>>,
    /// Errors that no error scope caught, each with the thread that made the call: assets are solved in parallel, and
    /// an error in one must not be attributed to another.
    errors: Mutex<Vec<(ThreadId, Error)>>,
}

/// The first and the longest interval at which a cancellable call checks whether its work is done.
const PAUSES: [Duration; 2] = [Duration::from_micros(20), Duration::from_micros(200)];

/// The maximum number of errors kept, since some threads may never check.
const MAX_ERRORS: usize = 64;

/// Joins the lines of a wgpu message.
#[expect(clippy::disallowed_types, reason = "wgpu calls it, and must not be unwound")]
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

impl ErrorLog {
    fn record_loss(&self, why: &str) {
        let why = if why.trim().is_empty() { "it was destroyed".to_owned() } else { one_line(why) };
        lock(&self.lost).get_or_insert(why);
    }

    fn record(&self, error: &wgpu::Error) {
        let kind = match error {
            wgpu::Error::OutOfMemory { .. } => ErrorKind::OutOfMemory,
            wgpu::Error::Validation { .. } | wgpu::Error::Internal { .. } => ErrorKind::Internal,
        };
        let mut errors = lock(&self.errors);
        if errors.len() < MAX_ERRORS {
            let error = Error::new(kind, format!("the GPU: {}", one_line(&error.to_string())));
            errors.push((thread::current().id(), error));
        }
    }

    /// Takes this thread's first error; its other errors, which follow from the first one, are discarded.
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
            // The host renders on the same GPU, so memory is allocated in small blocks and released early.
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
        let error_log = Arc::new(ErrorLog::default());
        let log = error_log.clone();
        device.set_device_lost_callback(move |_, why| log.record_loss(&why));
        let log = error_log.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| log.record(&error)));
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let queue = ManuallyDrop::new(queue);
        let about = describe(adapter);
        let (adapter, pipelines) = (adapter.get_info(), Pipelines::default());
        let time_kernels = AtomicBool::new(false);
        Ok(Context {
            device,
            queue,
            adapter,
            about,
            limits,
            options,
            timestamps,
            pipelines,
            time_kernels,
            error_log,
        })
    }

    /// Returns `DeviceLost` if the device was lost.
    pub fn alive(&self) -> Result<()> {
        match &*lock(&self.error_log.lost) {
            Some(why) => Err(Error::new(
                ErrorKind::DeviceLost,
                format!("the GPU {} is lost: {why}; make a new device and new assets", self.adapter.name),
            )),
            None => Ok(()),
        }
    }

    /// Returns the first error of this thread's calls since its last check: `DeviceLost`, `OutOfMemory`, or `Internal`
    /// for calls that wgpu's validation rejects.
    pub fn check(&self) -> Result<()> {
        let error = self.error_log.take();
        self.alive()?;
        let Some(error) = error else { return Ok(()) };
        // A device that is being lost rejects calls before it reports its loss, so wait a moment for the report.
        for _ in 0..if error.kind == ErrorKind::Internal { 20 } else { 0 } {
            let _ = contain(|| self.device.poll(wgpu::PollType::Poll));
            self.alive()?;
            thread::sleep(Duration::from_millis(1));
        }
        Err(error)
    }

    /// Runs wgpu calls that may panic instead of failing, and checks for errors.
    pub fn contain<R>(&self, body: impl FnOnce() -> R) -> Result<R> {
        // If memory runs out, wgpu's errors up to then must not be left for the next call.
        let outcome = caught(|| Ok(contain(body)));
        self.check()?;
        outcome?.map_err(|why| Error::new(ErrorKind::Internal, format!("the GPU: {}", one_line(&why))))
    }

    /// Returns a kernel's pipeline. If its compilation failed, the next call tries again.
    pub fn pipeline(&self, kernel: Kernel) -> Result<&Pipeline> {
        let pipeline = self.pipelines.place(kernel);
        if pipeline.get().is_none() {
            let made = self.contain(|| Pipeline::new(&self.device, kernel.source()))?;
            // Another thread may have set it in the meantime.
            let _ = pipeline.set(made);
        }
        let missing = || Error::new(ErrorKind::Internal, "a pipeline is missing");
        pipeline.get().ok_or_else(missing)
    }

    /// Submits encoded commands, in order, as one submission.
    pub fn submit(&self, encoders: impl IntoIterator<Item = wgpu::CommandEncoder>) -> Result<()> {
        self.contain(|| {
            let _ = self.queue.submit(encoders.into_iter().map(wgpu::CommandEncoder::finish));
        })
    }

    /// Waits for all submitted work.
    pub fn wait(&self) -> Result<()> {
        self.contain(|| self.device.poll(wgpu::PollType::wait_indefinitely()))?
            .map(drop)
            .map_err(|error| Error::new(ErrorKind::Internal, format!("the GPU: {error}")))
    }

    /// Waits for all submitted work, unless the call is cancelled meanwhile.
    pub fn wait_for(&self, control: &Control) -> Result<()> {
        let done = Arc::new(AtomicBool::new(false));
        let told = done.clone();
        self.contain(|| self.queue.on_submitted_work_done(move || told.store(true, Ordering::Release)))?;
        let mut pause = PAUSES[0];
        loop {
            control.check()?;
            // A wait with a timeout does not work here: when it expires, wgpu 30 panics if another thread has just
            // emptied the queue.
            self.contain(|| self.device.poll(wgpu::PollType::Poll))?
                .map_err(|error| Error::new(ErrorKind::Internal, format!("the GPU: {error}")))?;
            if done.load(Ordering::Acquire) {
                return Ok(());
            }
            thread::sleep(pause);
            pause = (2 * pause).min(PAUSES[1]);
        }
    }

    /// Creates a buffer of at least `size` bytes, all zero.
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
                // Dropped buffers may still be in use by submitted work.
                self.wait()?;
                make()
            })
            .map_err(|error| if short_of_memory(&error) { short("out of memory") } else { error })
    }
}

impl Drop for Context {
    fn drop(&mut self) {
        // SAFETY: the queue is not used again, since its owner is being dropped.
        let _ = contain(|| unsafe { ManuallyDrop::drop(&mut self.queue) });
    }
}

#[cfg(test)]
pub mod tests;
