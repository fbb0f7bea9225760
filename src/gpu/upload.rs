//! What a tile's memory is filled with, in portions.

use std::cell::Cell;
use std::sync::Arc;

use super::context::Context;
use crate::error::{Error, ErrorKind, Result};

/// Bytes that wait in host memory at a time.
const PORTION: usize = 32 << 20;

/// Makes storage buffers, and fills them.
pub struct Uploader<'a> {
    context: &'a Arc<Context>,
    /// Bytes that were written since the last submission.
    waiting: Cell<usize>,
}

impl<'a> Uploader<'a> {
    pub fn new(context: &'a Arc<Context>) -> Uploader<'a> {
        Uploader { context, waiting: Cell::new(0) }
    }

    /// A storage buffer, all zero.
    ///
    /// # Errors
    /// `Unsupported` if it is larger than what can be bound; `OutOfMemory`.
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

    /// A storage buffer of `size` bytes that holds `bytes`.
    ///
    /// # Errors
    /// Those of [`Uploader::storage`]; `Internal` if the size was counted wrongly.
    pub fn upload(&self, label: &str, size: u64, bytes: &[u8]) -> Result<wgpu::Buffer> {
        if size != bytes.len() as u64 {
            let message = format!("{label}: {} bytes, but {size} were counted", bytes.len());
            return Err(Error::new(ErrorKind::Internal, message));
        }
        let buffer = self.storage(label, size)?;
        // What is written waits in host memory until it is submitted: not too much of it at a time.
        for (n, part) in bytes.chunks(PORTION).enumerate() {
            self.context.queue.write_buffer(&buffer, (n * PORTION) as u64, part);
            self.waiting.set(self.waiting.get() + part.len());
            if self.waiting.get() >= PORTION {
                self.context.queue.submit([]);
                self.context.wait()?;
                self.waiting.set(0);
            }
        }
        Ok(buffer)
    }
}
