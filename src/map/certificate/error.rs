//! Measures how far the interpolated map is from the redirection.

use glam::DVec2;

use vrtm_beyond::bands::Bands;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::error::Result;
use vrtm_core::image::ImagePart;
use vrtm_core::image::format::PixelFormat;

use super::desc::MapDesc;
use super::strip::{Reader, bands};
use crate::map::FetchKind;

const ITEMS: usize = 16;

struct Found {
    squares: f64,
    max: f64,
    count: u64,
    /// Numbers of samples by the upper bits of their error as an f32: 128 bins for each power of 2.
    bins: Vec<u64>,
}

/// Measures the error of a map on a lattice of samples: at least two per texel and per cell of the grid along each
/// axis. Only samples in charts count. Returns the RMS, the 99th percentile and the maximum.
pub fn measure(reader: &mut Reader, desc: &MapDesc) -> Result<[f64; 3]> {
    let size = desc.sizes();
    let level = &reader.solved.grid.levels[0];
    let cells = [level.nx, level.ny];
    let per_texel = [0, 1].map(|axis| (2 * cells[axis]).div_ceil(size[axis]).max(2));
    let samples = [0, 1].map(|axis| size[axis] * per_texel[axis]);
    let (kind, format) = (FetchKind::RedirectionDelta, PixelFormat::F32);
    let exact_desc = MapDesc { kind, format, size: samples.map(|n| n as u32) };
    let mut all: Vec<Found> = (0..ITEMS).map(|_| Found::new()).collect();
    // The range in which interpolation has four texels around it: from the first texel's centre to the last one's.
    let reached = |axis: usize| {
        let half = per_texel[axis].div_ceil(2);
        half.min(samples[axis])..(samples[axis] - per_texel[axis] / 2).max(half.min(samples[axis]))
    };
    let (columns, lines) = (reached(0), reached(1));
    for band in bands(samples[0], samples[1]) {
        let end = if band.end == samples[1] { band.end } else { band.end - 1 };
        let rows = band.start.max(lines.start)..end.min(lines.end);
        if rows.is_empty() {
            continue;
        }
        let exact = reader.read(&exact_desc, rows.clone())?;
        let texel = |row: usize| place(row, per_texel[1]).0;
        let map = reader.read(desc, texel(rows.start)..(texel(rows.end - 1) + 2).min(size[1]))?;
        let part = ImagePart { size: samples, first: [0, rows.start], end: [samples[0], rows.end] };
        let mut charts = Bands::new(&part, false);
        charts.draw(reader.team, &reader.solved.mesh.triangles, |t| t.uv, |_, _, _, covered| *covered = true);
        reader.team.fill_large(&mut all, |k, found| {
            for y in rows.start + k * rows.len() / ITEMS..rows.start + (k + 1) * rows.len() / ITEMS {
                let (covered, exact) = (charts.row(y - rows.start), exact.row(y));
                let (j, t) = place(y, per_texel[1]);
                let [low, high] = [j, (j + 1).min(size[1] - 1)].map(|row| map.row(row));
                for x in columns.clone().filter(|&x| covered[x]) {
                    let (i, s) = place(x, per_texel[0]);
                    let next = (i + 1).min(size[0] - 1);
                    let corners = [low[i], low[next], high[i], high[next]];
                    found.add(exact[x].distance(interpolated(corners, s, t)));
                }
            }
        });
    }
    Ok(Found::sum(&all))
}

/// The texel before a sample, and the offset from its centre to the sample in texels.
fn place(sample: usize, per_texel: usize) -> (usize, f64) {
    let at = ((sample as f64 + 0.5) / per_texel as f64 - 0.5).max(0.0);
    (at as usize, at - at.floor())
}

/// Bilinear interpolation of the values of four texels, beginning with those of the lower row.
fn interpolated([a, b, c, d]: [DVec2; 4], s: f64, t: f64) -> DVec2 {
    let (low, high) = (a + s * (b - a), c + s * (d - c));
    low + t * (high - low)
}

impl Found {
    fn new() -> Found {
        Found { squares: 0.0, max: 0.0, count: 0, bins: zeroed(1 << 15) }
    }

    fn add(&mut self, error: f64) {
        self.squares += error * error;
        self.max = self.max.max(error);
        self.count += 1;
        self.bins[((error as f32).to_bits() >> 16) as usize & 0x7fff] += 1;
    }

    /// Combines the findings of all items, in order: RMS, 99th percentile and maximum.
    fn sum(all: &[Found]) -> [f64; 3] {
        let count: u64 = all.iter().map(|found| found.count).sum();
        let squares: f64 = all.iter().map(|found| found.squares).sum();
        let max = all.iter().map(|found| found.max).fold(0.0, f64::max);
        let mut above = count / 100;
        let mut bin = (1usize << 15) - 1;
        while bin > 0 {
            let here: u64 = all.iter().map(|found| found.bins[bin]).sum();
            if here > above {
                break;
            }
            above -= here;
            bin -= 1;
        }
        // The upper end of the bin.
        let p99 = f64::from(f32::from_bits((bin as u32 + 1) << 16)).min(max);
        [(squares / count.max(1) as f64).sqrt(), p99, max]
    }
}
