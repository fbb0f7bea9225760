//! Which chart the texels of an image or nodes of a grid belong to, if charts go on beyond their seams and may lie over
//! one another there.

use glam::DVec2;

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::grid::fill::Fill;
use vrtm_core::grid::planes::{NODES, Plane, SIDE, slot};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::triangle::barycentrics;
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// Rows that one item of work draws.
const BAND: usize = 64;

/// Charts that the texels of a part of an image belong to: the one that a texel's centre lies in; beside all charts,
/// the one whose border is nearest on the surface, if its collar lies there.
pub struct Owners {
    width: usize,
    /// Bands of rows, from v = 0 upward.
    bands: Vec<Vec<Owner>>,
}

#[derive(Clone, Copy)]
struct Owner {
    chart: u32,
    /// Distance from the border; 0 inside of a chart.
    distance: f32,
}

const NOBODY: Owner = Owner { chart: NONE, distance: f32::INFINITY };

/// Draws a triangle of a chart on the points from `first` to `end`, which have integer places, `index` in `points`.
fn draw(
    tile: &TileMesh,
    (t, chart): (usize, u32),
    corners: [DVec2; 3],
    [first, end]: [[usize; 2]; 2],
    points: &mut [Owner],
    index: impl Fn(usize, usize) -> usize,
) {
    Fill::new(corners).visit_in(first, end, |x, y, _| {
        let owner = &mut points[index(x, y)];
        let distance = tile.source(t).map_or(0.0, |source| {
            let [s, t] = barycentrics(corners, DVec2::new(x as f64, y as f64)).map(|l| l as f32);
            let [p, q, r] = source.distance;
            // Never that of a chart.
            (p + s * (q - p) + t * (r - p)).max(f32::MIN_POSITIVE)
        });
        if distance < owner.distance {
            *owner = Owner { chart, distance };
        }
    });
}

impl Owners {
    /// The owners of the texels of a part: nobody, before they are drawn.
    pub fn new(part: &ImagePart) -> Owners {
        let [width, height] = part.extent();
        let rows = |band: usize| BAND.min(height - band * BAND);
        let bands = (0..height.div_ceil(BAND)).map(|band| vec![NOBODY; rows(band) * width]).collect();
        Owners { width, bands }
    }

    /// Draws the charts of a tile with collars on the texels of a part.
    pub fn draw(&mut self, team: &Team, tile: &TileMesh, part: &ImagePart) {
        let size = DVec2::new(part.size[0] as f64, part.size[1] as f64);
        let width = self.width;
        let charts = tile.chart_of_triangles();
        team.fill_large(&mut self.bands, |band, texels| {
            let first = [part.first[0], part.first[1] + band * BAND];
            let end = [part.end[0], first[1] + texels.len() / width];
            for (t, triangle) in tile.triangles.iter().enumerate() {
                let corners = triangle.uv.map(|uv| uv * size - 0.5);
                let index = |x: usize, y: usize| (y - first[1]) * width + x - first[0];
                draw(tile, (t, charts[t]), corners, [first, end], texels, index);
            }
        });
    }

    /// True if a point lies in a chart, not beside all.
    pub fn is_inside(&self, x: usize, y: usize) -> bool {
        self.bands[y / BAND][y % BAND * self.width + x].distance <= 0.0
    }

    /// The chart of a point, or `NONE`.
    pub fn chart(&self, x: usize, y: usize) -> u32 {
        self.bands[y / BAND][y % BAND * self.width + x].chart
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
                let index = |x: usize, y: usize| slot(x - first[0], y - first[1]);
                let of = (t as usize, charts[t as usize]);
                draw(tile, of, corners(t), [first, end], &mut owners, index);
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
