//! Rows of a map, written as for a host and read back.

use std::ops::Range;

use glam::DVec2;
use half::f16;

use crate::device::Device;
use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::error::Result;
use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::{ImageLayout, ImagePart, ImageViewMut, Origin};
use vrtm_core::team::Team;

use super::desc::MapDesc;
use crate::map::Form;
use crate::map::fetch::Output;
use crate::map::inverse::Outputs;
use crate::solved::Solved;
use vrtm_core::mesh::Mesh;

/// Writes rows of maps of a result.
pub struct Reader<'a> {
    pub device: &'a Device,
    pub team: &'a Team,
    pub mesh: &'a Mesh,
    pub solved: &'a Solved,
    pub outputs: Outputs,
}

/// Some rows of a map, from v = 0 upward.
pub struct Strip {
    first: usize,
    width: usize,
    deltas: Vec<DVec2>,
}

impl Reader<'_> {
    /// Reads the given rows of a map, as a host would get them.
    pub fn read(&mut self, desc: &MapDesc, rows: Range<usize>) -> Result<Strip> {
        let (size, form) = (desc.sizes(), Form::new(desc.kind, &self.solved.mesh));
        let (width, channel) = (size[0], desc.format.size());
        let mut bytes = zeroed(rows.len() * width * 2 * channel);
        let layout = ImageLayout::packed(desc.size[0], rows.len() as u32, desc.format);
        let layout = ImageLayout { origin: Origin::Bottom, ..layout };
        let part = ImagePart { size, first: [0, rows.start], end: [width, rows.end] };
        let mut image = ImageViewMut::new("map", &mut bytes, layout)?;
        let output = Output::new(self.mesh, self.solved, desc.kind, &part, &image.layout)?;
        output.write(self.device, self.team, &mut self.outputs, &mut image)?;
        let mut deltas = vec![DVec2::ZERO; rows.len() * width];
        let mut lines: Vec<&mut [DVec2]> = deltas.chunks_exact_mut(width).collect();
        let extent = DVec2::new(width as f64, size[1] as f64);
        self.team.fill(&mut lines, |k, line| {
            let bytes = &bytes[k * width * 2 * channel..][..width * 2 * channel];
            for (x, (delta, texel)) in line.iter_mut().zip(bytes.chunks_exact(2 * channel)).enumerate() {
                let value = [&texel[..channel], &texel[channel..]].map(|b| match desc.format {
                    PixelFormat::F16 => f64::from(f16::from_ne_bytes([b[0], b[1]])),
                    _ => f64::from(f32::from_ne_bytes([b[0], b[1], b[2], b[3]])),
                });
                let centre = DVec2::new(x as f64, (rows.start + k) as f64) + 0.5;
                *delta = form.delta(value.into(), centre / extent);
            }
        });
        Ok(Strip { first: rows.start, width, deltas })
    }
}

impl Strip {
    /// The offsets from a row's texel centres to the redirected UVs that are written there; rows count from the whole
    /// map's first.
    pub fn row(&self, y: usize) -> &[DVec2] {
        &self.deltas[(y - self.first) * self.width..][..self.width]
    }
}

/// Divides `count` rows of `width` texels into ranges large enough to be worth writing, each of which shares its last
/// row with the next range.
pub fn bands(width: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    let rows = ((1 << 21) / width).max(64);
    (0..count.max(2) - 1).step_by(rows).map(move |row| row..(row + rows + 1).min(count))
}
