//! Measures how much longer a pose's edges are than at rest: for features that follow the size of a pose, and to detect
//! one in other units, or with vertices in another order.

use glam::DVec3;

use crate::device::Device;
use vrtm_core::allocation::Vec;
use vrtm_core::log::LogCode;
use vrtm_core::mesh::Mesh;
use vrtm_core::settings::Scale;
use vrtm_core::view::Strided;

/// Most edges that are measured: enough for a median, and cheap compared to a solve.
const SAMPLES: usize = 4096;
/// A median above this, or below its inverse, is no deformation that features could survive.
const IMPLAUSIBLE: f64 = 3.0;
/// A pose is also implausible if a larger share of its edges than this is stretched by more than that factor. In real
/// animation the share is at most 1 %; a tenth of the vertices in a wrong order makes it 10 %.
const IMPLAUSIBLE_SHARE: f64 = 0.05;
/// A spread under this is the rounding of a pose that is only scaled.
const ONE_FACTOR: f64 = 1e-3;
/// The share of edges within the spread: some slivers are all rounding.
const WITHIN: f64 = 0.95;

/// The lengths of a pose's edges, as multiples of those at rest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch {
    /// Their median.
    pub median: f64,
    /// The distance from the median, as a fraction of it, within which 95 % of them are.
    pub spread: f64,
    /// The share of them that is over 3, or over 3 medians for features that follow the pose.
    pub share: f64,
}

/// The values for a mesh without edges.
impl Default for Stretch {
    fn default() -> Stretch {
        Stretch { median: 1.0, spread: 0.0, share: 0.0 }
    }
}

impl Stretch {
    /// Measures some thousand edges of the textured triangles, evenly chosen from all of them.
    pub fn new(mesh: &Mesh, pose: &Strided, scale: Scale) -> Stretch {
        let sides: usize = mesh.tiles.iter().map(|tile| 3 * tile.triangles.len()).sum();
        let step = sides.div_ceil(SAMPLES).max(1);
        // Avoids measuring the same side of all triangles.
        let step = if step > 1 && step.is_multiple_of(3) { step + 1 } else { step };
        let mut stretches = Vec::<f64>::with_capacity(sides.div_ceil(step));
        let (mut next, mut first) = (0, 0);
        for tile in &mesh.tiles {
            for chart in &tile.charts {
                let end = first + 3 * chart.triangles.len();
                while next < end {
                    let triangle = &tile.triangles[chart.triangles.start + (next - first) / 3];
                    let side = (next - first) % 3;
                    let ends = [side, (side + 1) % 3].map(|k| chart.vertices[triangle.local[k] as usize]);
                    let [a, b] = ends.map(|v| DVec3::from(mesh.rest[v as usize]));
                    let [p, q] = ends.map(|v| DVec3::from(pose.get3(v as usize)));
                    let rest = a.distance(b);
                    if rest > 0.0 && rest.is_finite() {
                        stretches.push(p.distance(q) / rest);
                    }
                    next += step;
                }
                first = end;
            }
        }
        if stretches.is_empty() {
            return Stretch::default();
        }
        let nth = |values: &mut [f64], share: f64| {
            let n = ((values.len() as f64 * share) as usize).min(values.len() - 1);
            *values.select_nth_unstable_by(n, f64::total_cmp).1
        };
        let median = nth(&mut stretches, 0.5);
        let unit = if scale == Scale::Follow { median } else { 1.0 };
        let long = stretches.iter().filter(|&&stretch| stretch > IMPLAUSIBLE * unit).count();
        let share = long as f64 / stretches.len() as f64;
        stretches.iter_mut().for_each(|stretch| *stretch = (*stretch - median).abs());
        let spread = if median > 0.0 { nth(&mut stretches, WITHIN) / median } else { 0.0 };
        Stretch { median, spread, share }
    }

    /// The factor from the pose's positions to those that are solved. A pose that has shrunk to a point has no size to
    /// follow.
    pub fn factor(&self, scale: Scale) -> f64 {
        if scale == Scale::Follow && self.median.is_normal() { 1.0 / self.median } else { 1.0 }
    }

    /// True if all edges share one factor other than 1.
    fn is_scaled(&self) -> bool {
        self.spread < ONE_FACTOR && (self.median - 1.0).abs() > ONE_FACTOR
    }

    /// Warns of a pose that cannot be meant, and of the first of those that are only scaled; `before` is the last pose.
    pub fn warn(&self, device: &Device, scale: Scale, before: &Stretch) {
        let Stretch { median, share, .. } = *self;
        let keeps = scale == Scale::Keep;
        let (code, value, message) = if keeps && self.is_scaled() {
            if before.is_scaled() {
                return;
            }
            let message = format!(
                "pose: all of its edges are {median:.3} times as long as at rest, and rigid features keep their size: \
                 if they are to grow with it, or it is in other units, set the option scale to follow"
            );
            (LogCode::PoseScale, median, message)
        } else if keeps && !(1.0 / IMPLAUSIBLE..=IMPLAUSIBLE).contains(&median) {
            let message = format!(
                "pose: its edges are {median:.3} times as long as at rest (median): is it in other units, or are its \
                 vertices in another order?"
            );
            (LogCode::PoseScale, median, message)
        } else if share > IMPLAUSIBLE_SHARE {
            let percent = 100.0 * share;
            let message = format!(
                "pose: {percent:.1} % of its edges are more than 3 times as long as at rest: are its vertices in the \
                 order of the mesh?"
            );
            (LogCode::PoseOrder, share, message)
        } else {
            return;
        };
        device.log(code, None, &[value], &message);
    }
}
