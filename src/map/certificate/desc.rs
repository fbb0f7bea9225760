//! The description of a map that a host asks about, and the report on it.

use crate::map::FetchKind;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::image::format::PixelFormat;
use vrtm_core::settings::MAX_GRID;

/// A redirection map that a host could fetch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapDesc {
    /// One of the redirection's forms.
    pub kind: FetchKind,
    /// Number format of the map: F32 or F16.
    pub format: PixelFormat,
    /// Texels along u and v.
    pub size: [u32; 2],
}

/// Accuracy of a redirection map that is read with bilinear interpolation. Errors are lengths in UV; multiplied by a
/// texture's size they are in its texels.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MapReport {
    /// Texels along u and v.
    pub size: [u32; 2],
    /// Quads of four neighbouring texel centres on which the interpolated map, in the numbers that a fetch writes, is
    /// not one-to-one: 0 certifies that the map is one-to-one everywhere between the centres of the tile's outermost
    /// texels.
    pub folds: u64,
    /// Smallest Jacobian of the interpolated map at a corner of a quad (1 where nothing moves): greater than 0 if there
    /// are no folds.
    pub min_jacobian: f64,
    /// Root mean square error over the tile's charts, relative to the exact redirection.
    pub error_rms: f64,
    /// 99th percentile of the error over the charts, rounded up by at most one percent.
    pub error_p99: f64,
    /// Largest error in the charts.
    pub error_max: f64,
    /// A size at which the map has no folds: this one, or else the first such size among twice, four times, a half, a
    /// quarter and so on of it; `None` if all of them fold. Larger maps often have more folds.
    pub sufficient_size: Option<[u32; 2]>,
}

impl MapDesc {
    pub(crate) fn check(&self) -> Result<()> {
        ensure!(self.kind.is_redirection(), "kind: not a form of the redirection");
        if !matches!(self.format, PixelFormat::F16 | PixelFormat::F32) {
            return Err(Error::new(ErrorKind::Unsupported, "format must be f16 or f32 for an output"));
        }
        let [width, height] = self.size;
        let fits = |side: u32| (1..=MAX_GRID).contains(&side);
        ensure!(fits(width) && fits(height), "size: {width}x{height}, but a side is from 1 to {MAX_GRID}");
        Ok(())
    }

    pub(crate) fn sizes(&self) -> [usize; 2] {
        self.size.map(|n| n as usize)
    }
}
