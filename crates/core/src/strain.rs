//! Strain on the mesh: the change of painted lengths on the surface, as an artist sees it, from the warp and the mesh
//! in f64 and never from the solver's own quantities.
//!
//! An edge that is painted into the texture from node a to node b lies on the surface from W(a) to W(b). Its strain is
//! its chord in the pose, divided by its chord at rest without the warp, minus 1. Both ends are located in the
//! triangles exactly.

pub mod exact;
pub mod features;

use glam::{DVec2, DVec3};

use crate::allocation::{Vec, vec};
use crate::grid::coverage::NodeMaps;
use crate::grid::planes::EDGES;
use crate::mesh::{Mesh, NONE, TileMesh};
use crate::report::{Strain, StrainReport, report};
use crate::strain::exact::{Locator, Surface};
use crate::strain::features::Features;

/// Edges with an end this near to a chart's border (in cells, along the axis of the greater distance) count as border
/// edges.
pub const BORDER: usize = 10;
/// An edge whose |strain| rises by more than this counts as harmed.
const HARM: f64 = 0.25;
/// An edge whose |strain| falls by more than this counts as helped.
const HELP: f64 = 0.10;

/// |Strain| is limited to this: enough for any scene, and statistics stay finite in f32.
const LARGEST: f64 = 1e12;

/// Measures the strain of a warp of one tile, whose triangles `coverage` and `maps` name. `u(i, j)` is the displacement
/// of node (i, j) in cells; `pose` has one position per vertex. An edge counts if both of its ends are covered and
/// rigid. If at least one end may move, one chart must cover both. Edges with two fixed ends are counted separately, if
/// the surface continues from one end to the other: no warp changes their strain.
pub fn measure(
    mesh: &Mesh,
    tile: &TileMesh,
    maps: &NodeMaps,
    pose: &[[f64; 3]],
    u: &dyn Fn(usize, usize) -> [f32; 2],
) -> StrainReport {
    let (nx, ny) = (maps.nx, maps.ny);
    let width = nx + 1;
    let locator = Locator::new(tile, nx, ny, maps.triangle.clone());
    let rest = Surface::new(tile, &locator, |v| mesh.rest[v]);
    let posed = Surface::new(tile, &locator, |v| pose[v]);
    let near_border = near_border(maps);
    let rigid = features::rigid(maps);
    let mut features = Features::new(rigid.len());
    let mut ends = vec![End::default(); width * (ny + 1)];
    for (n, end) in ends.iter_mut().enumerate().filter(|(n, _)| rigid[*n]) {
        let (i, j) = (n % width, n / width);
        let (at, home) = (DVec2::new(i as f64, j as f64), maps.triangle[n]);
        let warped = at + DVec2::from(u(i, j).map(f64::from));
        *end = End {
            rest: rest.at(home, at).into(),
            before: posed.at(home, at).into(),
            after: posed.at(locator.find(warped, home), warped).into(),
        };
    }
    let mut edges = Edges::default();
    for a in (0..ends.len()).filter(|&a| rigid[a]) {
        for (di, dj) in EDGES {
            let (i, j) = ((a % width) as i64 + di, (a / width) as i64 + dj);
            if i < 0 || i > nx as i64 || j > ny as i64 {
                continue;
            }
            let b = j as usize * width + i as usize;
            if !rigid[b] {
                continue;
            }
            let mut of_feature = |strain: [f64; 2]| {
                if locator.chart(maps.triangle[a]) == locator.chart(maps.triangle[b]) {
                    features.add([a, b], strain);
                }
            };
            if maps.chart[a] == NONE && maps.chart[b] == NONE {
                // Follow the surface from a: the triangle under b may belong to another chart, or to another layer.
                let at = DVec2::new(i as f64, j as f64);
                let Some(under) = locator.walk(maps.triangle[a], at) else { continue };
                let length = distance(ends[a].rest, rest.at(under, at).into());
                if length > 0.0 {
                    let strain = strain(distance(ends[a].before, posed.at(under, at).into()), length);
                    edges.fixed += 1;
                    edges.fixed_squares += strain * strain;
                    of_feature([strain; 2]);
                }
                continue;
            }
            // With collars, nodes next to a border move, too: on its other side another part of the surface may begin.
            if !tile.sources.is_empty() {
                let at = DVec2::new(i as f64, j as f64);
                let under = locator.walk(maps.triangle[a], at);
                if under.is_none_or(|t| t as usize >= tile.own()) {
                    continue;
                }
            }
            let length = distance(ends[a].rest, ends[b].rest);
            if length > 0.0 {
                let before = strain(distance(ends[a].before, ends[b].before), length);
                let after = strain(distance(ends[a].after, ends[b].after), length);
                let place = Place {
                    border: near_border[a] || near_border[b],
                    free: maps.chart[a] != NONE && maps.chart[b] != NONE,
                };
                edges.add(before, after, place);
                of_feature([before, after]);
            }
        }
    }
    features.report(maps, tile.origin(), edges.report())
}

/// |Strain| of an edge from its lengths in the pose and at rest. NaN, from a pose near the limits of f64, also becomes
/// `LARGEST`.
fn strain(posed: f64, rest: f64) -> f64 {
    (posed / rest - 1.0).abs().min(LARGEST)
}

/// Place of an edge.
#[derive(Clone, Copy)]
struct Place {
    /// True if an end is near a chart's border.
    border: bool,
    /// True if both ends may move.
    free: bool,
}

/// Positions of a node on the surface: at rest, in the pose without the warp, and in the pose with it.
#[derive(Clone, Copy, Default)]
struct End {
    rest: DVec3,
    before: DVec3,
    after: DVec3,
}

/// The measured edges: their |strain| before and after the warp.
#[derive(Default)]
struct Edges {
    before: Vec<f64>,
    after: Vec<f64>,
    place: Vec<Place>,
    harmed: u64,
    helped: u64,
    /// Number of edges with two fixed ends, followed by the sum of the squares of their strains.
    fixed: u64,
    fixed_squares: f64,
}

impl Edges {
    fn add(&mut self, before: f64, after: f64, place: Place) {
        self.harmed += u64::from(after - before > HARM);
        self.helped += u64::from(before - after > HELP);
        self.before.push(before);
        self.after.push(after);
        self.place.push(place);
    }

    fn report(mut self) -> StrainReport {
        let count = self.before.len();
        let fraction = |n: u64| if count > 0 { (n as f64 / count as f64) as f32 } else { 0.0 };
        report!(StrainReport {
            segments: count as u64,
            harm: fraction(self.harmed),
            help: fraction(self.helped),
            before: statistics(&mut self.before, &self.place),
            after: statistics(&mut self.after, &self.place),
            segments_fixed: self.fixed,
            fixed: (self.fixed_squares / self.fixed.max(1) as f64).sqrt() as f32,
        })
    }
}

/// Statistics of |strain|; reorders the values.
fn statistics(values: &mut [f64], places: &[Place]) -> Strain {
    if values.is_empty() {
        return Strain::default();
    }
    let rms = |which: &dyn Fn(&Place) -> bool| {
        let chosen = || values.iter().zip(places).filter(|(_, place)| which(place)).map(|(v, _)| v);
        let count = chosen().count().max(1);
        (chosen().map(|v| v * v).sum::<f64>() / count as f64).sqrt() as f32
    };
    let (all, near, far) = (rms(&|_| true), rms(&|place| place.border), rms(&|place| !place.border));
    let free = rms(&|place| place.free);
    // The smallest value that is not less than a fraction q of all values.
    let mut quantile = |q: f64| {
        let at = ((q * values.len() as f64).ceil() as usize).clamp(1, values.len()) - 1;
        *values.select_nth_unstable_by(at, f64::total_cmp).1 as f32
    };
    report!(Strain {
        rms: all,
        median: quantile(0.5),
        p95: quantile(0.95),
        p99: quantile(0.99),
        max: quantile(1.0),
        border_rms: near,
        interior_rms: far,
        free_rms: free,
    })
}

/// Per node, true if a node within `BORDER` nodes along both axes is outside of every chart. (Such a node always lies
/// between the interiors of two charts.) Computed along rows first, then along columns.
pub fn near_border(maps: &NodeMaps) -> Vec<bool> {
    let (width, height) = (maps.nx + 1, maps.ny + 1);
    let mut near: Vec<bool> = maps.interior.iter().map(|inside| !inside).collect();
    let mut line = Vec::new();
    for j in 0..height {
        dilate(&mut near, j * width, 1, width, &mut line);
    }
    for i in 0..width {
        dilate(&mut near, i, width, height, &mut line);
    }
    near
}

/// Sets all values of one row or column within `BORDER` of a true one.
fn dilate(values: &mut [bool], first: usize, stride: usize, count: usize, line: &mut Vec<bool>) {
    line.clear();
    line.extend((0..count).map(|k| values[first + k * stride]));
    let mut inside: usize = line[..BORDER.min(count)].iter().filter(|&&b| b).count();
    for k in 0..count {
        inside += usize::from(line.get(k + BORDER).is_some_and(|&b| b));
        if k > BORDER {
            inside -= usize::from(line[k - BORDER - 1]);
        }
        values[first + k * stride] = inside > 0;
    }
}

/// The distance of two points.
fn distance(a: DVec3, b: DVec3) -> f64 {
    let d = b - a;
    // Scales first, so that squares of 1e300 or 1e-300 do not overflow or vanish.
    let largest = d.to_array().into_iter().fold(0.0, |m: f64, x| m.max(x.abs()));
    if largest == 0.0 { 0.0 } else { largest * (d / largest).length() }
}
