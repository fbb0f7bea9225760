//! The surface of a tile as carriers see it: f on the triangle under any UV, and its tangents as means at vertices,
//! which have no jumps at the sides of triangles.

use glam::{DVec2, DVec3};

use vrtm_core::allocation::{Vec, vec, zeroed};
use vrtm_core::mesh::triangle::{barycentrics, doubled_area};
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

use crate::nearest::weighed;

/// Barycentric coordinates of at least minus this count as inside.
const SLACK: f64 = 1e-12;
/// On badly shaped triangles a walk may go round in circles.
const MOST_STEPS: usize = 1000;

#[derive(Clone, Copy, Debug)]
struct Triangle {
    origin: DVec2,
    /// Rows of the matrix that takes an offset from `origin` to the barycentric coordinates of corners 1 and 2.
    rows: [DVec2; 2],
    neighbours: [u32; 3],
    /// Vertices or points of the chart.
    local: [u32; 3],
    chart: u32,
}

/// A point of a triangle of a tile, by barycentric coordinates.
#[derive(Clone, Copy, Debug)]
pub struct Spot {
    pub triangle: u32,
    pub weights: [f64; 3],
    /// False if the point of the UV plane is outside, as far as neighbours lead; the weights are then those of the
    /// nearest place by clamping.
    pub is_inside: bool,
}

/// The position of a vertex in a pose, or of a point, and the tangents there along u and v.
#[derive(Clone, Copy, Debug, Default)]
pub struct Place {
    pub at: DVec3,
    pub tangents: [DVec3; 2],
}

/// A tile's triangles, those of its collars included.
#[derive(Debug)]
pub struct Surface {
    triangles: Vec<Triangle>,
    /// Number of triangles of charts.
    own: u32,
    /// Per chart and vertex, the sum of the triangles' doubled areas in UV.
    areas: Vec<Vec<f64>>,
}

/// Per chart, the places of its vertices in a pose; none for a chart that carries nothing.
pub type Posed = Vec<Vec<Place>>;

impl Surface {
    pub fn new(tile: &TileMesh) -> Surface {
        let chart_of = tile.chart_of_triangles();
        let triangle = |(t, &chart): (&vrtm_core::mesh::Triangle, &u32)| {
            let [a, b, c] = t.uv;
            let (e1, e2) = (b - a, c - a);
            let det = e1.perp_dot(e2);
            let rows = [-e2.perp() / det, e1.perp() / det];
            Triangle { origin: a, rows, neighbours: t.neighbours, local: t.local, chart }
        };
        let mut areas: Vec<Vec<f64>> = tile.charts.iter().map(|chart| zeroed(chart.count())).collect();
        for (triangle, &chart) in tile.triangles.iter().zip(&chart_of) {
            let area = doubled_area(triangle.uv).abs();
            triangle.local.iter().for_each(|&v| areas[chart as usize][v as usize] += area);
        }
        let triangles = tile.triangles.iter().zip(&chart_of).map(triangle).collect();
        Surface { triangles, own: tile.own() as u32, areas }
    }

    pub fn bytes(&self) -> usize {
        let areas: usize = self.areas.iter().map(|areas| size_of_val(&**areas)).sum();
        size_of_val(&*self.triangles) + areas
    }

    /// Bytes of a tile's surface without collars.
    pub fn bytes_of(tile: &TileMesh) -> usize {
        let vertices: usize = tile.charts.iter().map(|chart| chart.count()).sum();
        tile.triangles.len() * size_of::<Triangle>() + vertices * size_of::<f64>()
    }

    pub fn chart(&self, triangle: u32) -> u32 {
        self.triangles[triangle as usize].chart
    }

    pub fn charts(&self, triangles: impl Iterator<Item = u32>) -> Vec<bool> {
        let mut wanted = vec![false; self.areas.len()];
        triangles.for_each(|t| wanted[self.chart(t) as usize] = true);
        wanted
    }

    /// The places of the vertices of the wanted charts, with tangents if these are `needed`.
    ///
    /// A vertex has the mean of the tangents of its triangles, weighted by their areas in UV: the sum of products of
    /// edges, which needs no division by the area of a sliver, and is linear in the positions.
    pub fn posed(
        &self,
        team: &Team,
        tile: &TileMesh,
        wanted: &[bool],
        needed: bool,
        position: impl Fn(u32) -> [f64; 3] + Copy + Sync,
    ) -> Posed {
        team.map(tile.charts.len(), |c| {
            if !wanted[c] {
                return Vec::new();
            }
            let chart = &tile.charts[c];
            let mut places = Vec::with_capacity(chart.count());
            let of = |at: [f64; 3]| Place { at: at.into(), ..Place::default() };
            places.extend(chart.positions(position).map(of));
            if !needed {
                return places;
            }
            for t in chart.triangles.clone().chain(chart.collar.clone()) {
                let triangle = &tile.triangles[t];
                let [p, q, r] = triangle.local.map(|v| places[v as usize].at);
                let [e1, e2] = [1, 2].map(|k| triangle.uv[k] - triangle.uv[0]);
                let (d1, d2, sign) = (q - p, r - p, e1.perp_dot(e2).signum());
                let [du, dv] = [sign * (e2.y * d1 - e1.y * d2), sign * (e1.x * d2 - e2.x * d1)];
                for v in triangle.local {
                    let [along_u, along_v] = &mut places[v as usize].tangents;
                    (*along_u, *along_v) = (*along_u + du, *along_v + dv);
                }
            }
            for (place, area) in places.iter_mut().zip(&self.areas[c]) {
                place.tangents = place.tangents.map(|tangent| tangent / *area);
            }
            places
        })
    }

    /// The place of a spot, given those of all vertices.
    #[inline(always)]
    pub fn place(&self, posed: &Posed, spot: &Spot) -> Place {
        let triangle = &self.triangles[spot.triangle as usize];
        let chart = &posed[triangle.chart as usize];
        let corners = triangle.local.map(|v| &chart[v as usize]);
        let mean = |of: fn(&Place) -> DVec3| weighed(corners.map(of), spot.weights);
        Place { at: mean(|p| p.at), tangents: [mean(|p| p.tangents[0]), mean(|p| p.tangents[1])] }
    }

    /// The position at a spot: that of its place.
    #[inline(always)]
    pub fn at(&self, posed: &Posed, spot: &Spot) -> DVec3 {
        let triangle = &self.triangles[spot.triangle as usize];
        let chart = &posed[triangle.chart as usize];
        weighed(triangle.local.map(|v| chart[v as usize].at), spot.weights)
    }

    /// The spot of a point of the UV plane, on a triangle or beside it.
    #[inline(always)]
    fn spot(&self, triangle: u32, uv: DVec2) -> Spot {
        let t = &self.triangles[triangle as usize];
        let [b, c] = t.rows.map(|row| row.dot(uv - t.origin));
        let weights = [1.0 - b - c, b, c];
        Spot { triangle, weights, is_inside: weights.iter().all(|&weight| weight >= -SLACK) }
    }

    /// Walks from a triangle to the one under a point of the UV plane: always over the side that the point is farthest
    /// beyond, of those with a neighbour. Ends at the last triangle if there is none.
    #[inline(always)]
    pub fn walk(&self, from: u32, uv: DVec2) -> Spot {
        let spot = self.spot(from, uv);
        if spot.is_inside { spot } else { self.walk_on(spot, uv) }
    }

    fn walk_on(&self, mut spot: Spot, uv: DVec2) -> Spot {
        for _ in 0..MOST_STEPS {
            if spot.is_inside {
                return spot;
            }
            let neighbours = &self.triangles[spot.triangle as usize].neighbours;
            let beyond = |&k: &usize| spot.weights[k] < -SLACK && neighbours[k] != NONE;
            let farthest = |a: usize, b: usize| if spot.weights[b] < spot.weights[a] { b } else { a };
            let Some(k) = (0..3).filter(beyond).reduce(farthest) else { break };
            spot = self.spot(neighbours[k], uv);
        }
        spot.weights = clamped(spot.weights);
        spot
    }

    /// True if the surface leads straight from a triangle to a point that lies on the chart itself.
    pub fn leads_to(&self, from: u32, uv: DVec2) -> bool {
        let spot = self.walk(from, uv);
        spot.is_inside && spot.triangle < self.own
    }
}

/// Barycentric coordinates within the triangle.
pub fn clamped(weights: [f64; 3]) -> [f64; 3] {
    let positive = weights.map(|weight| weight.max(0.0));
    let sum: f64 = positive.iter().sum();
    if sum > 0.0 && sum.is_finite() { positive.map(|weight| weight / sum) } else { [1.0, 0.0, 0.0] }
}

/// The UV of a spot among all tiles: on the chart of a neighbour where it lies beyond a seam.
pub fn uv_of(tile: &TileMesh, spot: &Spot, uv: DVec2, origin: impl Fn(u32) -> DVec2) -> DVec2 {
    match tile.source(spot.triangle as usize) {
        None => uv + tile.origin(),
        Some(source) => weighed(source.uv, spot.weights) + origin(source.tile),
    }
}

pub fn weights(corners: [DVec2; 3], at: DVec2) -> [f64; 3] {
    let [b, c] = barycentrics(corners, at);
    [1.0 - b - c, b, c]
}
