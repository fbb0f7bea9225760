//! Folds of the interpolated map.

use crate::allocation::filled;
use crate::error::Result;

use super::desc::MapDesc;
use super::strip::{Reader, bands};
use crate::map::smallest_jacobian;

pub struct Folds {
    /// Quads that fold.
    pub folds: u64,
    /// Smallest Jacobian at a corner of a quad.
    pub min_jacobian: f64,
}

/// Counts the quads of a map that fold; stops early once there are `enough`.
pub fn count(reader: &mut Reader, desc: &MapDesc, enough: u64) -> Result<Folds> {
    let [width, height] = desc.sizes();
    let size = [width as f64, height as f64];
    let mut all = Folds { folds: 0, min_jacobian: 1.0 };
    for rows in bands(width, height) {
        let strip = reader.read(desc, rows.clone())?;
        let mut found = filled((0, 1.0f64), rows.len() - 1);
        reader.team.fill(&mut found, |k, (folds, least)| {
            let [low, high] = [0, 1].map(|above| strip.row(rows.start + k + above));
            for (low, high) in low.windows(2).zip(high.windows(2)) {
                let smallest = smallest_jacobian([low[0], low[1], high[0], high[1]], size);
                *folds += u64::from(smallest <= 0.0);
                *least = least.min(smallest);
            }
        });
        all.folds += found.iter().map(|row| row.0).sum::<u64>();
        all.min_jacobian = found.iter().map(|row| row.1).fold(all.min_jacobian, f64::min);
        if all.folds >= enough {
            break;
        }
    }
    Ok(all)
}
