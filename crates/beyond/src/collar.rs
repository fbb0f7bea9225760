//! The *collar* of a chart: the surface beyond the chart's border, laid into the chart's own UV plane. Across a seam
//! the surface continues elsewhere in the UV plane; the collar is a copy of that part of it, continued from the seam
//! with as little change of shape as possible. Beyond an open border the surface continues with its mirror image, if
//! that is asked for: texture that is the same on both sides of a border can only slide along it. The collar depends on
//! the rest pose alone.

mod flatten;
mod patch;
mod surface;

use flatten::BANDS;
pub use flatten::{Across, Collar, CollarTriangle};
pub use surface::{Surface, Twin};

/// The largest reach of a chart's collar on the surface, in mean widths of the chart: the area of a collar is then a
/// few times that of its chart at most, and so is what collars add to a tile of many small charts.
const WIDEST: f64 = 1.0;

/// The collar of a chart of the surface's tile, which reaches over `reach` in UV at most. `check` is called between its
/// stages, and may unwind.
pub fn collar(surface: &Surface, chart: usize, reach: f64, check: &dyn Fn()) -> Collar {
    let [scale, width] = surface.size(chart);
    if !(scale > 0.0 && scale.is_finite()) {
        return Collar::default();
    }
    let (whole, reach) = (reach / scale, (reach / scale).min(WIDEST * width));
    let region = surface.region(chart, reach, check);
    let patch = patch::Patch::new(surface, &region, whole / BANDS as f64);
    check();
    flatten::flatten(surface, &patch, reach, scale, check)
}
