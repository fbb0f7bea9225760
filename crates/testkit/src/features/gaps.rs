//! How far both sides of a seam are apart: where the two redirections of a point on a seam lead, on the surface.

use std::collections::HashMap;

use vrtm::Asset;

use super::beyond::Beyond;
use super::charts::{Charts, distance};
use crate::model::Model;

/// The distances on the surface at rest between what both charts show at the vertices on seams, in texels of a texture
/// of 4096 by 4096, ascending.
pub fn gaps(model: &Model, asset: &Asset) -> Vec<f64> {
    let (warps, collars) = super::warps(model, asset);
    let charts = Charts::new(model, &warps);
    let beyond = Beyond::new(&charts, &warps, &collars);
    let corners = crate::model::corner_uvs(asset);
    // Per edge of the mesh, the triangles at it.
    let mut edges: HashMap<[usize; 2], Vec<usize>> = HashMap::new();
    for (t, triangle) in charts.triangles.iter().enumerate() {
        for k in 0..3 {
            let [a, b] = [triangle.vertices[k], triangle.vertices[(k + 1) % 3]];
            edges.entry([a.min(b), a.max(b)]).or_default().push(t);
        }
    }
    let mut gaps = Vec::new();
    for (ends, at_edge) in edges {
        let [s, t] = at_edge[..] else { continue };
        if charts.triangles[s].neighbours.contains(&Some(t)) {
            continue;
        }
        for vertex in ends {
            let places = [s, t].map(|t| {
                let triangle = &charts.triangles[t];
                let k = triangle.vertices.iter().position(|&v| v == vertex).unwrap();
                let w = charts.warp_of[t];
                let cells = [warps[w].nx as f64, warps[w].ny as f64];
                let origin = [(model.maps[w].udim - 1001) % 10, (model.maps[w].udim - 1001) / 10];
                let uv = corners[triangle.corners[k]].map(f64::from);
                let at = [0, 1].map(|c| (uv[c] - f64::from(origin[c])) * cells[c]);
                let to = beyond.position(&charts, w, t, at, &model.rest);
                // The length of a texel at the vertex.
                let at = triangle.at[k];
                let step = cells[0] / 4096.0;
                let on_surface = |d: [f64; 2]| {
                    super::charts::interpolate(triangle, &model.rest, [at[0] + d[0], at[1] + d[1]])
                };
                let texel = distance(on_surface([0.0; 2]), on_surface([step, 0.0]))
                    .max(distance(on_surface([0.0; 2]), on_surface([0.0, step])));
                (to, texel)
            });
            let [(a, texel), (b, other)] = places;
            if texel > 0.0 && other > 0.0 {
                gaps.push(distance(a, b) / texel.max(other));
            }
        }
    }
    gaps.sort_by(f64::total_cmp);
    gaps
}
