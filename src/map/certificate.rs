//! The certificate of a map. A fetch writes the redirection's values at texel centres, which renderers interpolate; the
//! certificate tells whether the interpolation folds, and how far it is from the redirection (method §9).

pub(crate) mod desc;
mod error;
mod strip;

use glam::DVec2;

use crate::device::Device;
use vrtm_core::allocation::vec;
use vrtm_core::error::Result;
use vrtm_core::mesh::Mesh;
use vrtm_core::team::Team;

use super::inverse::Outputs;
use super::smallest_jacobian;
use crate::solved::Solved;
use desc::{MapDesc, MapReport};
use strip::{Reader, bands};
use vrtm_core::settings::MAX_GRID;

/// Texels on a side of the smallest map that is inspected.
const SMALLEST: u32 = 16;

/// Inspects a map of a result; `desc` has been checked.
pub(crate) fn inspect(
    device: &Device,
    team: &Team,
    mesh: &Mesh,
    solved: &Solved,
    desc: &MapDesc,
) -> Result<MapReport> {
    let reader = &mut Reader { device, team, mesh, solved, outputs: Outputs::default() };
    let (folds, min_jacobian) = count_folds(reader, desc, u64::MAX)?;
    let [error_rms, error_p99, error_max] = error::measure(reader, desc)?;
    let mut sufficient_size = (folds == 0).then_some(desc.size);
    for size in near_sizes(desc.size) {
        if sufficient_size.is_some() {
            break;
        }
        // One fold decides, so counting stops there.
        let (folds, _) = count_folds(reader, &MapDesc { size, ..*desc }, 1)?;
        sufficient_size = (folds == 0).then_some(size);
    }
    let size = desc.size;
    Ok(MapReport { size, folds, min_jacobian, error_rms, error_p99, error_max, sufficient_size })
}

/// The sizes to try if a map folds: twice and four times its size, which are closer to the redirection, then halves,
/// which are smoother.
fn near_sizes(size: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
    let larger = [2, 4].into_iter().map(move |by| size.map(|n| n.saturating_mul(by)));
    let larger = larger.filter(|size| size.iter().all(|&n| n <= MAX_GRID));
    let halved = |size: &[u32; 2]| {
        let fits = size.iter().all(|n| n % 2 == 0 && *n >= 2 * SMALLEST);
        fits.then(|| size.map(|n| n / 2))
    };
    larger.chain(std::iter::successors(halved(&size), halved))
}

/// Counts the quads of a map that fold, and finds the smallest Jacobian at a corner of one; stops early at `enough`.
fn count_folds(reader: &mut Reader, desc: &MapDesc, enough: u64) -> Result<(u64, f64)> {
    let [width, height] = desc.sizes();
    let size = DVec2::new(width as f64, height as f64);
    let (mut all, mut min_jacobian) = (0, 1.0);
    for rows in bands(width, height) {
        let strip = reader.read(desc, rows.clone())?;
        let mut found = vec![(0, 1.0f64); rows.len() - 1];
        reader.team.fill(&mut found, |k, (folds, least)| {
            let [low, high] = [0, 1].map(|above| strip.row(rows.start + k + above));
            for (low, high) in low.windows(2).zip(high.windows(2)) {
                let smallest = smallest_jacobian([low[0], low[1], high[0], high[1]], size);
                *folds += u64::from(smallest <= 0.0);
                *least = least.min(smallest);
            }
        });
        all += found.iter().map(|row| row.0).sum::<u64>();
        min_jacobian = found.iter().map(|row| row.1).fold(min_jacobian, f64::min);
        if all >= enough {
            break;
        }
    }
    Ok((all, min_jacobian))
}
