//! Places on the surface of points of a chart's plane beyond the chart's seams.

use std::collections::HashMap;

use crate::asset::{CollarOfChart, CollarTriangleInSpace};

use super::charts::{Charts, interpolate, least};
use crate::warp::{Warp, barycentric};

/// A triangle in cells, and its corners as vertices with weights.
type Triangle = ([[f64; 2]; 3], [[(u32, f64); 3]; 3]);

/// The collars of the charts.
pub struct Beyond {
    /// By warp, chart and cell.
    triangles: HashMap<(usize, usize, [i64; 2]), Vec<Triangle>>,
}

impl Beyond {
    pub fn new(charts: &Charts, warps: &[Warp], collars: &[Vec<CollarOfChart>]) -> Beyond {
        let mut triangles: HashMap<_, Vec<Triangle>> = HashMap::new();
        for (w, (warp, collars)) in warps.iter().zip(collars).enumerate() {
            let cells = |p: [f64; 2]| [p[0] * warp.nx as f64, p[1] * warp.ny as f64];
            for collar in collars.iter().filter(|collar| !collar.triangles.is_empty()) {
                let Some(chart) = charts.chart_at(w, cells(collar.inside)) else { continue };
                for (uv, points) in &collar.triangles {
                    let triangle: CollarTriangleInSpace = (uv.map(cells), *points);
                    let range = |axis: usize| {
                        let of = triangle.0.map(|p| p[axis]);
                        let (low, high) = (of[0].min(of[1]).min(of[2]), of[0].max(of[1]).max(of[2]));
                        low.floor() as i64..=high.floor() as i64
                    };
                    for j in range(1) {
                        for i in range(0) {
                            triangles.entry((w, chart, [i, j])).or_default().push(triangle);
                        }
                    }
                }
            }
        }
        Beyond { triangles }
    }

    /// The position of the surface in a pose at a point in cells, in the chart of the triangle `home` or beyond its
    /// seams.
    pub fn position(
        &self,
        charts: &Charts,
        w: usize,
        home: usize,
        at: [f64; 2],
        pose: &[[f32; 3]],
    ) -> [f64; 3] {
        let own = &charts.triangles[charts.find(w, home, at)];
        let inside = least(&own.at, at);
        let cell = (w, charts.triangles[home].chart, at.map(|x| x.floor() as i64));
        let near = self.triangles.get(&cell).into_iter().flatten();
        let best = near.map(|t| (least(&t.0, at), t)).max_by(|a, b| a.0.total_cmp(&b.0));
        match best.filter(|(depth, _)| inside < -1e-9 && *depth > inside) {
            None => interpolate(own, pose, at),
            Some((_, (corners, points))) => {
                let weights = barycentric(corners, at);
                let corner = |k: usize, axis: usize| {
                    points[k]
                        .iter()
                        .map(|&(v, weight)| weight * f64::from(pose[v as usize][axis]))
                        .sum::<f64>()
                };
                [0, 1, 2].map(|axis| (0..3).map(|k| weights[k] * corner(k, axis)).sum())
            }
        }
    }
}
