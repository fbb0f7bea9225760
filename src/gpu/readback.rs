//! From the GPU into host memory: all that is wanted in one copy and one mapping.

use std::ops::Range;

use super::context::Context;
use crate::error::{Error, ErrorKind, Result};

/// The bytes of ranges of buffers, in their order. Waits for all work that was submitted.
pub fn read(context: &Context, wanted: &[(&wgpu::Buffer, Range<u64>)]) -> Result<Vec<Vec<u8>>> {
    let padded = |range: &Range<u64>| (range.end - range.start).next_multiple_of(16);
    let size = wanted.iter().map(|(_, range)| padded(range)).sum::<u64>();
    if size == 0 {
        context.wait()?;
        return Ok(vec![Vec::new(); wanted.len()]);
    }
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let staging = context.buffer("readback", size, usage)?;
    let mut encoder =
        context.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
    let mut at = 0;
    for (buffer, range) in wanted {
        let bytes = range.end - range.start;
        if bytes > 0 {
            encoder.copy_buffer_to_buffer(buffer, range.start, &staging, at, Some(bytes.next_multiple_of(4)));
        }
        at += padded(range);
    }
    context.queue.submit([encoder.finish()]);
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        let _ = sender.send(result);
    });
    context.wait()?;
    let failed =
        |why: String| Error::new(ErrorKind::Internal, format!("the GPU's memory cannot be read: {why}"));
    match receiver.try_recv() {
        Ok(Ok(())) => {}
        Ok(Err(error)) => return Err(failed(error.to_string())),
        Err(error) => return Err(failed(error.to_string())),
    }
    let view = staging.get_mapped_range(..).map_err(|error| failed(error.to_string()))?;
    let mut at = 0;
    let parts = wanted
        .iter()
        .map(|(_, range)| {
            let start = at as usize;
            at += padded(range);
            view[start..start + (range.end - range.start) as usize].to_vec()
        })
        .collect();
    drop(view);
    staging.unmap();
    Ok(parts)
}
