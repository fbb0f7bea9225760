//! An open GPU: wgpu's device and queue, what they can do, and what has gone wrong on them.

use std::sync::{Arc, Mutex, PoisonError};

use super::kernels::Pipelines;
use crate::error::{Error, ErrorKind, Result};

/// An open GPU.
#[derive(Debug)]
pub(crate) struct Context {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub adapter: wgpu::AdapterInfo,
    pub limits: wgpu::Limits,
    /// True if passes can be timed on the device.
    pub timestamps: bool,
    pub pipelines: Pipelines,
    trouble: Arc<Trouble>,
}

/// What went wrong since the last look.
#[derive(Debug, Default)]
struct Trouble {
    /// Why the device is gone.
    lost: Mutex<Option<String>>,
    /// The first error that no scope caught.
    error: Mutex<Option<Error>>,
}

impl Context {
    /// Opens an adapter.
    pub fn open(adapter: &wgpu::Adapter) -> Result<Context> {
        let features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
        let limits = adapter.limits();
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("vrtm"),
            required_features: features,
            required_limits: limits.clone(),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::new(ErrorKind::Unsupported, format!("adapter: {error}")))?;
        let trouble = Arc::new(Trouble::default());
        let lost = trouble.clone();
        device.set_device_lost_callback(move |_, why| {
            lost.lost.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(why);
        });
        let errors = trouble.clone();
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let kind = match &error {
                wgpu::Error::OutOfMemory { .. } => ErrorKind::OutOfMemory,
                _ => ErrorKind::Internal,
            };
            let error = Error::new(kind, error.to_string());
            errors.error.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }));
        let timestamps = features.contains(wgpu::Features::TIMESTAMP_QUERY);
        let pipelines = Pipelines::default();
        Ok(Context { device, queue, adapter: adapter.get_info(), limits, timestamps, pipelines, trouble })
    }

    /// The first error since the last check.
    pub fn check(&self) -> Result<()> {
        if let Some(why) = &*self.trouble.lost.lock().unwrap_or_else(PoisonError::into_inner) {
            return Err(Error::new(ErrorKind::Internal, format!("the GPU is lost: {why}")));
        }
        self.trouble.error.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    /// Waits for all work that was submitted.
    pub fn wait(&self) -> Result<()> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|error| Error::new(ErrorKind::Internal, format!("the GPU: {error}")))
    }

    /// Makes a buffer of `size` bytes, all zero.
    pub fn buffer(&self, label: &str, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let buffer = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: size.max(16).next_multiple_of(16),
            usage,
            mapped_at_creation: false,
        });
        if let Some(error) = pollster::block_on(scope.pop()) {
            return Err(Error::new(
                ErrorKind::OutOfMemory,
                format!("{label}: {size} bytes on the GPU: {error}"),
            ));
        }
        self.check()?;
        Ok(buffer)
    }
}
