//! The certificate of a map: what a fetch writes is not the redirection itself, but its values at texel centres, which
//! renderers interpolate. Whether that folds, and how far it is off (method §9).

mod error;
mod folds;
mod strip;

use crate::device::Device;
use crate::error::{Error, ErrorKind, Result};
use crate::image::PixelFormat;
use crate::memory::caught;
use crate::team::Team;

use super::form::Form;
use super::kind::FetchKind;
use super::output::Outputs;
use super::solved::Solved;
use strip::Reader;

/// Texels on a side of the smallest map that is looked at.
const SMALLEST: u32 = 16;

/// A redirection map that a host may fetch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MapDesc {
    /// One of the redirection's forms.
    pub kind: FetchKind,
    /// Number format of the map: F32 or F16.
    pub format: PixelFormat,
    /// Texels along u and v.
    pub size: [u32; 2],
    /// As in [`crate::ImageLayout::one_to_one`].
    pub one_to_one: bool,
}

/// What a redirection map gives when it is read with bilinear interpolation. Errors are lengths in UV: times the size of a
/// texture they are texels of it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct MapReport {
    /// Texels along u and v.
    pub size: [u32; 2],
    /// Quads of four neighbouring texel centres on which the interpolated map is not one-to-one; 0 certifies that it is on
    /// all of the tile, but for the half texel along its border that interpolation does not reach. More than 0 for a map
    /// that is to be one-to-one: its numbers are too coarse for its size, and nothing was moved.
    pub folds: u64,
    /// Smallest Jacobian of the interpolated map at a corner of a quad (1 where nothing moves): greater than 0 if there are
    /// no folds.
    pub min_jacobian: f64,
    /// Root of the mean square error over the charts.
    pub error_rms: f64,
    /// 99th percentile of the error over the charts, rounded up by at most one percent.
    pub error_p99: f64,
    /// Largest error in the charts.
    pub error_max: f64,
    /// A size at which the map has no folds: this one, or else the first of twice and four times it, a half, a quarter and so
    /// on of it; `None` if there is none. Larger maps often have more folds: [`crate::ImageLayout::one_to_one`] leaves none at
    /// any size if the numbers are fine enough: f32, or f16 of the delta unless what moves far is squeezed.
    pub sufficient_size: Option<[u32; 2]>,
}

impl MapDesc {
    pub(super) fn check(&self) -> Result<()> {
        if !self.kind.is_redirection() {
            return Err(Error::argument(format!("kind: {:?} is no form of the redirection", self.kind)));
        }
        if !matches!(self.format, PixelFormat::F16 | PixelFormat::F32) {
            return Err(Error::new(ErrorKind::Unsupported, "format must be f16 or f32 for an output"));
        }
        match self.size.iter().all(|n| (1..=crate::MAX_GRID).contains(n)) {
            true => Ok(()),
            false => Err(Error::argument(format!(
                "size: {}x{}, but a side is from 1 to {}",
                self.size[0],
                self.size[1],
                crate::MAX_GRID
            ))),
        }
    }

    fn sizes(&self) -> [usize; 2] {
        self.size.map(|n| n as usize)
    }

    fn form(&self, solved: &Solved) -> Form {
        Form::new(self.kind, &solved.mesh)
    }
}

/// Looks at a map of a result; `desc` was checked.
pub(super) fn inspect(device: &Device, team: &Team, solved: &Solved, desc: &MapDesc) -> Result<MapReport> {
    let mut outputs = Outputs::default();
    let mut reader = Reader { device, team, solved, outputs: &mut outputs, whole: None };
    // Memory that is missing must not leave that of the outputs on the device's account.
    let report = caught(|| inspect_with(&mut reader, desc));
    outputs.release(device);
    report
}

fn inspect_with(reader: &mut Reader, desc: &MapDesc) -> Result<MapReport> {
    let found = folds::count(reader, desc, u64::MAX)?;
    let errors = error::measure(reader, desc)?;
    let mut sufficient = (found.folds == 0).then_some(desc.size);
    for size in near_sizes(desc.size) {
        if sufficient.is_some() {
            break;
        }
        // The first fold decides.
        let folds = folds::count(reader, &MapDesc { size, ..*desc }, 1)?.folds;
        sufficient = (folds == 0).then_some(size);
    }
    Ok(MapReport {
        size: desc.size,
        folds: found.folds,
        min_jacobian: found.min_jacobian,
        error_rms: errors.rms,
        error_p99: errors.p99,
        error_max: errors.max,
        sufficient_size: sufficient,
    })
}

/// The sizes to look at if a map folds: twice and four times it, which are closer to the redirection, then halves, which are
/// smoother.
fn near_sizes(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let larger = [2, 4].into_iter().map(move |by| size.map(|n| n.saturating_mul(by)));
    let larger = larger.filter(|size| size.iter().all(|&n| n <= crate::MAX_GRID));
    let halved = |size: &[u32; 2]| {
        let fits = size.iter().all(|n| n % 2 == 0 && *n >= 2 * SMALLEST);
        fits.then(|| size.map(|n| n / 2))
    };
    larger.chain(std::iter::successors(halved(&size), halved))
}
