//! Which triangles of the UV plane lie over one another, by more than a line.

use glam::DVec2;

use crate::allocation::Vec;
use crate::sets::grouped;

/// Triangles that overlap by less than this, in UV, count as neighbours.
const SLACK: f64 = 1e-9;
/// Most bins along a side.
const MOST_BINS: usize = 1024;
/// Bound on the mean number of bins that a triangle lies in.
const MOST_ENTRIES: f64 = 8.0;

/// Triangles, sorted into square bins.
pub struct Overlaps {
    triangles: Vec<[DVec2; 3]>,
    bins: usize,
    low: DVec2,
    scale: DVec2,
    /// Per bin, the index of its first entry, followed by the number of entries.
    starts: Vec<u32>,
    entries: Vec<u32>,
}

impl Overlaps {
    pub fn of(triangles: Vec<[DVec2; 3]>) -> Overlaps {
        let infinite = DVec2::splat(f64::INFINITY);
        let corners = || triangles.iter().flatten();
        let low = corners().fold(infinite, |low, p| low.min(*p));
        let high = corners().fold(-infinite, |high, p| high.max(*p));
        let extent = (high - low).max(DVec2::splat(SLACK));
        // Large triangles that lie over one another would be in many bins each.
        let entries = |bins: f64| {
            let size = |[a, b, c]: &[DVec2; 3]| a.max(*b).max(*c) - a.min(*b).min(*c);
            let of =
                |triangle| (size(triangle) / extent * bins + 1.0).to_array().into_iter().product::<f64>();
            triangles.iter().map(of).sum::<f64>()
        };
        let mut bins = (triangles.len() as f64).sqrt().ceil().clamp(1.0, MOST_BINS as f64);
        while bins > 1.0 && entries(bins) > MOST_ENTRIES * triangles.len() as f64 {
            bins = (0.5 * bins).ceil();
        }
        let (bins, scale) = (bins as usize, bins / extent);
        let mut overlaps = Overlaps { triangles, bins, low, scale, starts: Vec::new(), entries: Vec::new() };
        let in_bins =
            |(triangle, t): (&[DVec2; 3], u32)| overlaps.bins_of(*triangle).map(move |bin| (bin, t));
        (overlaps.starts, overlaps.entries) =
            grouped(bins * bins, overlaps.triangles.iter().zip(0..).flat_map(in_bins));
        overlaps
    }

    /// True if a triangle lies over one of the triangles for which `counts` is true.
    pub fn any(&self, triangle: [DVec2; 3], mut counts: impl FnMut(usize) -> bool) -> bool {
        self.near(triangle).any(|t| counts(t) && overlap(triangle, self.triangles[t]))
    }

    /// The triangles whose bins a triangle's bounding box meets; some more than once.
    pub fn near(&self, triangle: [DVec2; 3]) -> impl Iterator<Item = usize> + '_ {
        let of_bin = |bin: usize| &self.entries[self.starts[bin] as usize..self.starts[bin + 1] as usize];
        self.bins_of(triangle).flat_map(of_bin).map(|&t| t as usize)
    }

    /// The bins that a triangle's bounding box meets.
    fn bins_of(&self, [a, b, c]: [DVec2; 3]) -> impl Iterator<Item = usize> + Clone + use<> {
        let (bins, last) = (self.bins, (self.bins - 1) as f64);
        let bin = |p: DVec2| ((p - self.low) * self.scale).floor().clamp(DVec2::ZERO, DVec2::splat(last));
        let (from, to) = (bin(a.min(b).min(c)), bin(a.max(b).max(c)));
        let range = |from: f64, to: f64| from as usize..=to as usize;
        range(from.y, to.y).flat_map(move |y| range(from.x, to.x).map(move |x| y * bins + x))
    }
}

/// True unless a side of one of the triangles separates them.
pub(super) fn overlap(a: [DVec2; 3], b: [DVec2; 3]) -> bool {
    !separates(a, b) && !separates(b, a)
}

fn separates(a: [DVec2; 3], b: [DVec2; 3]) -> bool {
    (0..3).any(|k| {
        let [p, q, inside] = [0, 1, 2].map(|d| a[(k + d) % 3]);
        let normal = (q - p).perp().normalize_or_zero();
        let inward = if normal.dot(inside - p) < 0.0 { -normal } else { normal };
        b.iter().all(|&r| inward.dot(r - p) <= SLACK)
    })
}
