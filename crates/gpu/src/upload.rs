//! Uploads to a tile's memory, submitted in portions.

use std::cell::Cell;
use std::sync::Arc;

use super::context::Context;
use vrtm_core::error::{Error, ErrorKind, Result};

/// The maximum number of uploaded bytes that wait in host memory for submission.
const MAX_UNSUBMITTED: usize = 32 << 20;

/// Creates storage buffers and fills them.
pub struct Uploader<'a> {
    context: &'a Arc<Context>,
    /// Bytes written since the last submission.
    unsubmitted: Cell<usize>,
}

impl<'a> Uploader<'a> {
    pub fn new(context: &'a Arc<Context>) -> Uploader<'a> {
        Uploader { context, unsubmitted: Cell::new(0) }
    }

    /// Creates a storage buffer, all zero.
    ///
    /// # Errors
    /// `Unsupported` if it is too large to be bound; `OutOfMemory`.
    pub fn storage(&self, label: &str, bytes: u64) -> Result<wgpu::Buffer> {
        use wgpu::BufferUsages as Usage;
        let limits = &self.context.limits;
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > limit {
            let message = format!("{label}: {bytes} bytes, but the GPU binds at most {limit}");
            return Err(Error::new(ErrorKind::Unsupported, message));
        }
        self.context.buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC)
    }

    /// Creates a storage buffer of `size` bytes with the content `bytes`.
    ///
    /// # Errors
    /// The errors of [`Uploader::storage`]; `Internal` if the size was counted wrongly.
    pub fn upload(&self, label: &str, size: u64, bytes: &[u8]) -> Result<wgpu::Buffer> {
        if size != bytes.len() as u64 {
            let message = format!("{label}: {} bytes, but {size} were counted", bytes.len());
            return Err(Error::new(ErrorKind::Internal, message));
        }
        let buffer = self.storage(label, size)?;
        self.write(&buffer, 0, bytes)?;
        Ok(buffer)
    }

    /// Writes to a buffer, from an offset on.
    ///
    /// # Errors
    /// Those of waiting for the GPU.
    pub fn write(&self, buffer: &wgpu::Buffer, first: u64, bytes: &[u8]) -> Result<()> {
        // Written bytes wait in host memory until they are submitted; writing in portions limits them.
        for (n, part) in bytes.chunks(MAX_UNSUBMITTED).enumerate() {
            self.context.queue.write_buffer(buffer, first + (n * MAX_UNSUBMITTED) as u64, part);
            self.unsubmitted.set(self.unsubmitted.get() + part.len());
            if self.unsubmitted.get() >= MAX_UNSUBMITTED {
                self.context.queue.submit([]);
                self.context.wait()?;
                self.unsubmitted.set(0);
            }
        }
        Ok(())
    }
}
