//! Times compute passes with the GPU's timestamps, if it has them.

use super::context::Context;
use vrtm_core::allocation::Vec;
use vrtm_core::error::Result;

/// Timestamps in a query set; a pass uses two.
const QUERIES: u32 = 4096;

/// Query sets, and the buffers that they are resolved into. A solve uses as many as it needs.
#[derive(Clone, Debug, Default)]
pub struct Timestamps {
    sets: Vec<(wgpu::QuerySet, wgpu::Buffer)>,
    passes: u32,
}

impl Timestamps {
    /// Returns a pair of queries for the next pass (query set, index of the first one); `None` without timestamps.
    pub fn next(&mut self, context: &Context) -> Option<(wgpu::QuerySet, u32)> {
        if !context.timestamps {
            return None;
        }
        let (set, first) = (2 * self.passes / QUERIES, 2 * self.passes % QUERIES);
        if set as usize == self.sets.len() {
            self.sets.push(Timestamps::set(context).ok()?);
        }
        self.passes += 1;
        Some((self.sets[set as usize].0.clone(), first))
    }

    fn set(context: &Context) -> Result<(wgpu::QuerySet, wgpu::Buffer)> {
        use wgpu::BufferUsages as Usage;
        let usage = Usage::QUERY_RESOLVE | Usage::COPY_SRC;
        let buffer = context.buffer("times", u64::from(QUERIES) * 8, usage)?;
        let descriptor =
            wgpu::QuerySetDescriptor { label: Some("times"), ty: wgpu::QueryType::Timestamp, count: QUERIES };
        Ok((context.contain(|| context.device.create_query_set(&descriptor))?, buffer))
    }

    /// Encodes the resolution of all queries. Returns the buffers with the timestamps, and their bytes in use.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) -> Vec<(wgpu::Buffer, u64)> {
        let mut left = 2 * self.passes;
        let mut used = Vec::new();
        for (set, buffer) in &self.sets {
            let count = left.min(QUERIES);
            if count > 0 {
                encoder.resolve_query_set(set, 0..count, buffer, 0);
                used.push((buffer.clone(), u64::from(count) * 8));
            }
            left -= count;
        }
        used
    }

    /// Forgets all passes, for the next solve.
    pub fn reset(&mut self) {
        self.passes = 0;
    }

    /// Returns the milliseconds of each pass from the bytes of the resolved buffers.
    pub fn milliseconds(context: &Context, bytes: &[u8]) -> Vec<f32> {
        let period = f64::from(context.queue.get_timestamp_period());
        let tick = |bytes: &[u8]| bytes.try_into().map_or(0, u64::from_le_bytes);
        let pass = |pair: &[u8]| tick(&pair[8..]).saturating_sub(tick(&pair[..8])) as f64 * period * 1e-6;
        bytes.chunks_exact(16).map(|pair| pass(pair) as f32).collect()
    }
}
