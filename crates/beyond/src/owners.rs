//! Which chart the texels of an image or nodes of a grid belong to, if charts go on beyond their seams and may lie over
//! one another there.

use glam::DVec2;

use crate::bands::Bands;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::fill::Fill;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::triangle::barycentrics;
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// Charts that the texels of a part of an image belong to: the one that a texel's centre lies in; beside all charts,
/// the one whose border is nearest on the surface, if its collar lies there.
pub struct Owners(Bands<Owner>);

#[derive(Clone, Copy)]
struct Owner {
    chart: u32,
    /// Distance from the border; 0 inside of a chart.
    distance: f32,
}

const NOBODY: Owner = Owner { chart: NONE, distance: f32::INFINITY };

impl Owner {
    /// Draws a point of a triangle of a chart.
    fn draw(&mut self, tile: &TileMesh, (t, chart): (usize, u32), corners: [DVec2; 3], at: DVec2) {
        let distance = tile.source(t).map_or(0.0, |source| {
            let [s, t] = barycentrics(corners, at).map(|l| l as f32);
            let [p, q, r] = source.distance;
            // Never that of a chart.
            (p + s * (q - p) + t * (r - p)).max(f32::MIN_POSITIVE)
        });
        if distance < self.distance {
            *self = Owner { chart, distance };
        }
    }
}

impl Owners {
    /// The owners of the texels of a part: nobody, before they are drawn.
    pub fn new(part: &ImagePart) -> Owners {
        Owners(Bands::new(part, NOBODY))
    }

    /// Draws the charts of a tile with collars.
    pub fn draw(&mut self, team: &Team, tile: &TileMesh) {
        let charts = tile.chart_of_triangles();
        let draw = |t, corners, at, owner: &mut Owner| owner.draw(tile, (t, charts[t]), corners, at);
        self.0.draw(team, &tile.triangles, |triangle| triangle.uv, draw);
    }

    /// True if a point lies in a chart, not beside all.
    pub fn is_inside(&self, x: usize, y: usize) -> bool {
        self.0.row(y)[x].distance <= 0.0
    }

    /// The chart of a point, or `NONE`.
    pub fn chart(&self, x: usize, y: usize) -> u32 {
        self.0.row(y)[x].chart
    }
}

/// Charts that the nodes of a grid belong to, by the rule of `Owners`, in some of its squares of 16 by 16.
pub struct NodeOwners {
    /// Rows and columns, ascending.
    squares: Vec<[u32; 2]>,
    charts: Vec<Plane<u32>>,
}

impl NodeOwners {
    /// The owners of the nodes of these squares, by row and column, ascending, of a grid of nx by ny cells.
    pub fn new(team: &Team, tile: &TileMesh, [nx, ny]: [usize; 2], squares: Vec<[u32; 2]>) -> NodeOwners {
        let cells = DVec2::new(nx as f64, ny as f64);
        let corners = |t: u32| tile.triangles[t as usize].uv.map(|uv| uv * cells);
        // By square, the triangles that may lie over nodes of it.
        let mut near: Vec<(u32, u32)> = Vec::new();
        for t in 0..tile.triangles.len() as u32 {
            let [a, b, c] = corners(t);
            let square = |at: DVec2| at.clamp(DVec2::ZERO, cells).to_array().map(|x| x as u32 / SIDE as u32);
            let [low, high] = [square(a.min(b).min(c)), square(a.max(b).max(c))];
            for row in low[1]..=high[1] {
                let first = squares.partition_point(|&square| square < [row, low[0]]);
                let here = squares[first..].iter().take_while(|&&square| square <= [row, high[0]]);
                near.extend(here.enumerate().map(|(k, _)| ((first + k) as u32, t)));
            }
        }
        near.sort_unstable();
        let charts = tile.chart_of_triangles();
        let of_square = |k: usize| {
            let first = squares[k].map(|x| x as usize * SIDE);
            let first = [first[1], first[0]];
            let end = [(first[0] + SIDE).min(nx + 1), (first[1] + SIDE).min(ny + 1)];
            let mut owners = [NOBODY; NODES];
            let from = near.partition_point(|&(square, _)| (square as usize) < k);
            for &(_, t) in near[from..].iter().take_while(|&&(square, _)| square as usize == k) {
                let (of, corners) = ((t as usize, charts[t as usize]), corners(t));
                Fill::new(corners).visit_in(first, end, |x, y, _| {
                    let owner = &mut owners[slot(x - first[0], y - first[1])];
                    owner.draw(tile, of, corners, DVec2::new(x as f64, y as f64));
                });
            }
            owners.map(|owner| owner.chart)
        };
        let charts = team.map(squares.len(), of_square);
        NodeOwners { squares, charts }
    }

    /// The charts of the nodes of a square.
    pub fn of(&self, x: u32, y: u32) -> Option<&Plane<u32>> {
        self.squares.binary_search(&[y, x]).ok().map(|k| &self.charts[k])
    }
}
