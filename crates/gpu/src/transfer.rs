//! Transfers of bytes to an open GPU and back.

use std::ops::Range;
use std::sync::mpsc;
use std::time::Duration;

use super::context::Context;
use vrtm_core::allocation::Vec;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::unwind::caught;

/// The time to wait for a callback after the GPU is done: another thread may be about to call it.
const CALLBACK_TIMEOUT: Duration = Duration::from_secs(10);

impl Context {
    /// Creates a buffer with the content `bytes`, whose length must be a multiple of 4.
    pub fn filled(&self, label: &str, bytes: &[u8], usage: wgpu::BufferUsages) -> Result<wgpu::Buffer> {
        let buffer = self.buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST)?;
        self.contain(|| self.queue.write_buffer(&buffer, 0, bytes))?;
        Ok(buffer)
    }

    /// Creates a staging buffer: results are copied into it, and [`Context::mapped`] reads it.
    pub fn staging(&self, label: &str, size: u64) -> Result<wgpu::Buffer> {
        self.buffer(label, size, wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST)
    }

    /// Waits for all submitted work, then passes the first `size` bytes (a multiple of 4) of a staging buffer to
    /// `read`. The buffer can be used again afterwards, even after an error.
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
            let mapped =
                receiver.recv_timeout(CALLBACK_TIMEOUT).map_err(|error| unread(error.to_string()))?;
            mapped.map_err(|error| unread(error.to_string()))?;
            let bytes = staging.get_mapped_range(0..size).map_err(|error| unread(error.to_string()))?;
            // The buffer must not stay mapped if memory runs out.
            caught(|| Ok(read(&bytes)))
        });
        // The first error is the one to report.
        let unmapped = self.contain(|| staging.unmap());
        let outcome = outcome?;
        unmapped.map(|()| outcome)
    }

    /// Reads a range of bytes of a buffer with the usage COPY_SRC; both ends are multiples of 4.
    pub fn read(&self, buffer: &wgpu::Buffer, range: Range<u64>) -> Result<Vec<u8>> {
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("readback") };
        let mut encoder = self.device.create_command_encoder(&descriptor);
        let readback = self.readback(&[(buffer, range)], &mut encoder)?;
        self.submit([encoder])?;
        self.taken(&readback).map(|mut parts| parts.pop().unwrap_or_default())
    }

    /// Encodes the copies of ranges of bytes into a new staging buffer.
    pub fn readback(
        &self,
        ranges: &[(&wgpu::Buffer, Range<u64>)],
        encoder: &mut wgpu::CommandEncoder,
    ) -> Result<Readback> {
        let lengths: Vec<u64> = ranges.iter().map(|(_, range)| range.end - range.start).collect();
        let staging = self.staging("readback", lengths.iter().sum::<u64>().max(4))?;
        let mut at = 0;
        for (buffer, range) in ranges.iter().filter(|(_, range)| !range.is_empty()) {
            encoder.copy_buffer_to_buffer(buffer, range.start, &staging, at, range.end - range.start);
            at += range.end - range.start;
        }
        Ok(Readback { staging, lengths })
    }

    /// Waits for all submitted work, and returns the bytes of each range.
    pub fn taken(&self, readback: &Readback) -> Result<Vec<Vec<u8>>> {
        self.mapped(&readback.staging, readback.lengths.iter().sum(), |bytes| {
            let mut rest = bytes;
            let mut part = |&length: &u64| {
                let (part, others) = rest.split_at(length as usize);
                rest = others;
                Vec::from(part)
            };
            readback.lengths.iter().map(&mut part).collect()
        })
    }
}

/// Bytes being copied from the GPU.
#[derive(Debug)]
pub struct Readback {
    staging: wgpu::Buffer,
    lengths: Vec<u64>,
}
