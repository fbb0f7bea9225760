//! A pose in the form that the solver reads (method §1, Positions): each chart's vertices relative to its centre and in
//! its own unit, and the triangles with their tangents (method §2).

use glam::DVec3;

use crate::allocation::Vec;
use crate::mesh::{Chart, TileMesh};

/// The bound to which coordinates are clamped, in units of the chart: squares of lengths divided by rest lengths have
/// to stay finite in f32.
const FARTHEST: f64 = (1u32 << 20) as f64;

/// Positions of one chart, relative to its own centre and in units of its own rest size, so that f32 suffices
/// wherever and however large the mesh is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChartPose {
    /// One position per vertex of the chart.
    pub positions: Vec<[f32; 3]>,
    /// The factor from the mesh's units to the chart's: a power of two near 1 / (extent at rest).
    pub scale: f64,
}

/// Positions of all charts of a tile.
#[derive(Debug, Default, PartialEq)]
pub struct Pose {
    pub charts: Vec<ChartPose>,
}

impl Pose {
    /// Converts the positions of the tile's vertices. `rest` holds the scales; it is absent for the rest pose itself.
    pub fn new(tile: &TileMesh, position: impl Fn(u32) -> [f64; 3], rest: Option<&Pose>) -> Pose {
        let charts = tile
            .charts
            .iter()
            .enumerate()
            .map(|(c, chart)| {
                let mut low = [f64::INFINITY; 3];
                let mut high = [f64::NEG_INFINITY; 3];
                chart.positions(&position).for_each(|p| {
                    for axis in 0..3 {
                        low[axis] = low[axis].min(p[axis]);
                        high[axis] = high[axis].max(p[axis]);
                    }
                });
                let extent = (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
                let scale = rest.map_or_else(|| power_of_two_near_inverse(extent), |r| r.charts[c].scale);
                let centre: [f64; 3] = std::array::from_fn(|axis| 0.5 * low[axis] + 0.5 * high[axis]);
                let relative = |p: [f64; 3]| {
                    std::array::from_fn(|axis| {
                        ((p[axis] - centre[axis]) * scale).clamp(-FARTHEST, FARTHEST) as f32
                    })
                };
                let positions = chart.positions(&position).map(relative).collect();
                ChartPose { positions, scale }
            })
            .collect();
        Pose { charts }
    }

    /// Bytes of memory in use.
    pub fn bytes(&self) -> usize {
        self.charts.iter().map(|c| c.positions.len() * 12 + 32).sum()
    }

    /// True if every triangle edge of chart `c` is as long as in `rest`, to the precision of f32 positions: the chart
    /// then moved as a rigid body or bent without stretching, and the identity is its best warp.
    pub fn is_isometric(&self, rest: &Pose, tile: &TileMesh, c: usize) -> bool {
        let (pose, rest) = (&self.charts[c].positions, &rest.charts[c].positions);
        let length = |p: &[[f32; 3]], a: u32, b: u32| {
            let [a, b] = [a, b].map(|v| DVec3::from(p[v as usize].map(f64::from)));
            a.distance(b)
        };
        // Extents at rest are 0.5 to 1, so the end of an edge is rounded by up to 2^-25 and its length by a few times
        // that.
        const ROUNDING: f64 = 4.0 / (1u64 << 24) as f64;
        let Chart { triangles, collar, .. } = &tile.charts[c];
        // Mirror images move as what they are images of, to a greater rounding.
        let is_real = |t: &usize| !tile.is_image(*t as u32);
        triangles.clone().chain(collar.clone()).filter(is_real).all(|t| {
            let t = &tile.triangles[t];
            (0..3).all(|k| {
                let (a, b) = (t.local[k], t.local[(k + 1) % 3]);
                let (was, is) = (length(rest, a, b), length(pose, a, b));
                (is - was).abs() <= ROUNDING + 1e-6 * was
            })
        })
    }
}

/// The power of two 2^k with extent * 2^k in 0.5..1, or near that range at the limits of f64; 1 for an extent of 0. It
/// is formed from the exponent's bits, so that it is exact on every platform.
fn power_of_two_near_inverse(extent: f64) -> f64 {
    if !extent.is_normal() && !extent.is_infinite() {
        return 1.0;
    }
    let exponent = (extent.to_bits() >> 52 & 0x7ff) as i64 - 1023;
    f64::from_bits(((-exponent - 1).clamp(-1022, 1022) + 1023).unsigned_abs() << 52)
}

/// A triangle of a pose: its first vertex and the tangents T along u and v, per cell of level 0 (method §2).
#[derive(Clone, Copy, Debug, Default)]
pub struct PoseTriangle {
    /// f at the first UV corner.
    pub origin: [f32; 3],
    /// The tangents ∂f/∂u and ∂f/∂v, per cell of level 0.
    pub tangent: [[f32; 3]; 2],
}

impl PoseTriangle {
    /// The triangle with these positions of its corners and the `barycentric` matrix of its UVs.
    pub fn new(corners: [[f32; 3]; 3], barycentric: &[[f32; 2]; 2]) -> PoseTriangle {
        let [a, b, c] = corners;
        let e1: [f32; 3] = std::array::from_fn(|k| b[k] - a[k]);
        let e2: [f32; 3] = std::array::from_fn(|k| c[k] - a[k]);
        let tangent = [0, 1]
            .map(|axis| std::array::from_fn(|k| e1[k] * barycentric[0][axis] + e2[k] * barycentric[1][axis]));
        PoseTriangle { origin: a, tangent }
    }

    /// The entries (E, F, G) of the metric TᵀT, per cell squared of level 0 (method §3).
    pub fn metric(&self) -> [f32; 3] {
        let dot = |a: &[f32; 3], b: &[f32; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let [x, y] = &self.tangent;
        [dot(x, x), dot(x, y), dot(y, y)]
    }
}
