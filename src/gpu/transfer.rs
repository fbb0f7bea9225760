//! Bytes to an open GPU and back.

use std::ops::Range;
use std::sync::mpsc;
use std::time::Duration;

use super::context::Context;
use crate::error::{Error, ErrorKind, Result};

/// How long a callback may take after the wait that it belongs to: another thread may have picked it up.
const CALLBACK: Duration = Duration::from_secs(10);

impl Context {
    /// Makes a buffer that holds `bytes`; their number is a multiple of 4.
    pub fn filled(&self, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let buffer = self.buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST)?;
        self.contain(|| self.queue.write_buffer(&buffer, 0, bytes))?;
        Ok(buffer)
    }

    /// Makes a buffer that results are copied into and [`Context::mapped`] reads.
    pub fn staging(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        self.buffer(label, size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
    }

    /// Waits for all work that was submitted, then hands the first `size` bytes (a multiple of 4) of a staging buffer to
    /// `read`. The buffer is free for new work afterwards, also after an error.
    pub fn mapped<R>(&self, staging: &wgpu::Buffer, size: u64, read: impl FnOnce(&[u8]) -> R) -> Result<R> {
        if size == 0 {
            self.wait()?;
            return Ok(read(&[]));
        }
        let (sender, receiver) = mpsc::channel();
        self.contain(|| {
            staging.map_async(wgpu::MapMode::Read, 0..size, move |outcome| drop(sender.send(outcome)));
        })?;
        let outcome = self.wait().and_then(|()| {
            let unread = |why: String| {
                Error::new(ErrorKind::Internal, format!("the GPU: a result cannot be read: {why}"))
            };
            let mapped = receiver.recv_timeout(CALLBACK).map_err(|error| unread(error.to_string()))?;
            mapped.map_err(|error| unread(error.to_string()))?;
            let bytes = staging.get_mapped_range(0..size).map_err(|error| unread(error.to_string()))?;
            Ok(read(&bytes))
        });
        // An error that stood before is the one to tell.
        let unmapped = self.contain(|| staging.unmap());
        let outcome = outcome?;
        unmapped.map(|()| outcome)
    }

    /// Reads bytes of a buffer with the usage COPY_SRC; the range's ends are multiples of 4.
    pub fn read(&self, buffer: &wgpu::Buffer, range: Range<u64>) -> Result<Vec<u8>> {
        self.read_all(&[(buffer, range)]).map(|mut parts| parts.pop().unwrap_or_default())
    }

    /// The same for several buffers, in one copy and one mapping.
    pub fn read_all(&self, wanted: &[(&wgpu::Buffer, Range<u64>)]) -> Result<Vec<Vec<u8>>> {
        let size = wanted.iter().map(|(_, range)| range.end - range.start).sum();
        if size == 0 {
            return self.check().map(|()| vec![Vec::new(); wanted.len()]);
        }
        let staging = self.staging("readback", size)?;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("readback") };
        let mut encoder = self.device.create_command_encoder(&descriptor);
        let mut at = 0;
        for (buffer, range) in wanted.iter().filter(|(_, range)| !range.is_empty()) {
            encoder.copy_buffer_to_buffer(buffer, range.start, &staging, at, range.end - range.start);
            at += range.end - range.start;
        }
        self.submit([encoder])?;
        self.mapped(&staging, size, |bytes| {
            let mut rest = bytes;
            wanted
                .iter()
                .map(|(_, range)| {
                    let (part, others) = rest.split_at((range.end - range.start) as usize);
                    rest = others;
                    part.to_vec()
                })
                .collect()
        })
    }
}
