//! A solver's storage buffers: what makes them, with their contents submitted in portions, and what counts their bytes.

use std::cell::Cell;
use std::sync::Arc;

use bytemuck::NoUninit;

use super::context::{Context, padded};
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, ErrorKind, Result};

/// The maximum number of uploaded bytes that wait in host memory for submission.
const MAX_UNSUBMITTED: usize = 32 << 20;

/// Makes storage buffers, or counts what they take.
pub trait Maker {
    type Buffer: Clone;

    /// A storage buffer, all zero.
    ///
    /// # Errors
    /// `Unsupported` if it is too large to be bound; `OutOfMemory`.
    fn storage(&self, label: &str, bytes: u64) -> Result<Self::Buffer>;

    /// A storage buffer with some contents, which are `count` in number.
    ///
    /// # Errors
    /// Those of `storage`; `Internal` if they are counted wrongly.
    fn upload<T: NoUninit>(
        &self,
        label: &str,
        count: usize,
        contents: impl FnOnce() -> Vec<T>,
    ) -> Result<Self::Buffer>;
}

/// Counts the bytes of buffers.
#[derive(Default)]
pub struct Counter(pub Cell<u64>);

impl Maker for Counter {
    type Buffer = ();

    fn storage(&self, _: &str, bytes: u64) -> Result<()> {
        self.0.set(self.0.get() + padded(bytes));
        Ok(())
    }

    fn upload<T: NoUninit>(&self, label: &str, count: usize, _: impl FnOnce() -> Vec<T>) -> Result<()> {
        self.storage(label, (count * size_of::<T>()) as u64)
    }
}

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

    /// Writes to a buffer, from an offset on.
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

impl Maker for Uploader<'_> {
    type Buffer = wgpu::Buffer;

    fn storage(&self, label: &str, bytes: u64) -> Result<wgpu::Buffer> {
        use wgpu::BufferUsages as Usage;
        let limits = &self.context.limits;
        let limit = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        if bytes > limit {
            let message = format!("{label}: {bytes} bytes, but the GPU binds at most {limit}");
            return Err(Error::new(ErrorKind::Unsupported, message));
        }
        self.context.buffer(label, bytes, Usage::STORAGE | Usage::COPY_DST | Usage::COPY_SRC)
    }

    fn upload<T: NoUninit>(
        &self,
        label: &str,
        count: usize,
        contents: impl FnOnce() -> Vec<T>,
    ) -> Result<wgpu::Buffer> {
        let contents = contents();
        if contents.len() != count {
            let message = format!("{label}: {}, but {count} were counted", contents.len());
            return Err(Error::new(ErrorKind::Internal, message));
        }
        let bytes = bytemuck::cast_slice(&contents);
        let buffer = self.storage(label, bytes.len() as u64)?;
        self.write(&buffer, 0, bytes)?;
        Ok(buffer)
    }
}
