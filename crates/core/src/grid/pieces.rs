//! The rigid pieces of a tile, and the size of grid that resolves them (method §1).

use std::ops::Range;

use glam::DVec2;

use crate::allocation::{Vec, vec, zeroed};
use crate::grid::maps::Values;
use crate::grid::uv_triangle::uv_triangles;
use crate::mesh::TileMesh;
use crate::mesh::triangle::doubled_area;
use crate::team::Team;

/// Sizes of grids, in cells on a side.
pub const SIZES: [u32; 13] = [64, 96, 128, 192, 256, 384, 512, 768, 1024, 1536, 2048, 3072, 4096];
/// Cells across a piece that resolve it.
const ACROSS: f32 = 20.0;
/// Share of the rigid material that may lie in narrower pieces.
const NARROWER: f64 = 0.05;
/// A grid with more cells than this on a side is no finer than the rigidity map.
const COARSE: u32 = 256;

/// Fewest and most places on a side of the lattice on which pieces are measured; between these it has those of the map.
const SIDES: [usize; 2] = [256, 1024];
/// Rows of the lattice that a thread draws at once.
const BAND: usize = 128;

/// Bytes that a solve takes per node of the grid inside of charts, about.
const BYTES: f64 = 200.0;

/// Cells on a side of a grid that resolves the rigid pieces of a tile, or of the finest one that a solve in so many bytes
/// can have; `None` if nothing is rigid.
pub fn resolving(team: &Team, tile: &TileMesh, rigidity: &Values, bytes: Option<u64>) -> Option<u32> {
    let texels = match rigidity {
        Values::Map(map) => map.width.max(map.height),
        Values::Vertices(_) => SIDES[1],
        Values::None => return None,
    };
    let side = texels.clamp(SIDES[0], SIDES[1]);
    let lattice = drawn(team, tile, rigidity, side);
    let covered =
        tile.triangles.iter().map(|triangle| 0.5 * doubled_area(triangle.uv).abs()).sum::<f64>().min(1.0);
    let fits =
        |&size: &u32| bytes.is_none_or(|bytes| covered * f64::from(size).powi(2) * BYTES <= bytes as f64);
    let least = lattice.iter().copied().max().unwrap_or(0) / 2;
    let is_rigid: Vec<bool> = lattice.iter().map(|&value| value > least).collect();
    let cells = ACROSS / width(pieces(&is_rigid, side))?;
    let finest = (texels as u32).max(COARSE);
    let enough = |&size: &u32| size as f32 >= cells || size >= finest;
    let wanted = SIZES.iter().position(enough).unwrap_or(SIZES.len() - 1);
    Some(SIZES[..=wanted].iter().copied().rfind(fits).unwrap_or(SIZES[0]))
}

/// A connected set of rigid places.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Piece {
    places: u64,
    /// Diameter of the largest inscribed circle, in UV.
    width: f32,
}

impl Piece {
    fn add(&mut self, other: Piece) {
        *self = Piece { places: self.places + other.places, width: self.width.max(other.width) };
    }
}

/// The width that nearly all rigid material has at least.
fn width(mut pieces: Vec<Piece>) -> Option<f32> {
    pieces.sort_unstable_by(|a, b| a.width.total_cmp(&b.width));
    let all: u64 = pieces.iter().map(|piece| piece.places).sum();
    let mut narrower = 0;
    let wide = pieces.iter().find(|piece| {
        narrower += piece.places;
        narrower as f64 > NARROWER * all as f64
    });
    wide.map(|piece| piece.width)
}

/// Rigidity at the places of a lattice, 0 to 255, row by row from v = 0; 0 outside of charts. A place is the centre of a
/// square.
fn drawn(team: &Team, tile: &TileMesh, rigidity: &Values, side: usize) -> Vec<u8> {
    let has_map = matches!(rigidity, Values::Map(_));
    let triangles = if has_map { Vec::new() } else { uv_triangles(tile, side, side) };
    let mut lattice: Vec<u8> = zeroed(side * side);
    let mut bands: Vec<&mut [u8]> = lattice.chunks_mut(BAND * side).collect();
    team.fill_large(&mut bands, |band, places| {
        let mut rows = Rows { places, side, first: band * BAND };
        for chart in &tile.charts {
            for t in chart.triangles.clone() {
                let corners = tile.triangles[t].uv.map(|uv| uv * side as f64);
                match rigidity {
                    Values::None => {}
                    Values::Map(map) => rows.draw(corners, |place| {
                        let [x, y] =
                            [(place[0], map.width), (place[1], map.height)].map(|(i, n)| i * n / side);
                        map.value(x, y)
                    }),
                    Values::Vertices(values) => {
                        let at_corner = |v| chart.value(v, |v| [f64::from(values[v as usize])])[0] as f32;
                        let at_corners = tile.triangles[t].local.map(at_corner);
                        let triangle = &triangles[t];
                        rows.draw(corners, |place| {
                            triangle.interpolate(at_corners, place.map(|i| i as f32 + 0.5)).clamp(0.0, 1.0)
                        });
                    }
                }
            }
        }
    });
    lattice
}

/// Some rows of a lattice.
struct Rows<'a> {
    places: &'a mut [u8],
    side: usize,
    /// The number of the first row.
    first: usize,
}

impl Rows<'_> {
    /// Writes values at the places in a triangle, with corners in squares of the lattice.
    fn draw(&mut self, [a, b, c]: [DVec2; 3], value: impl Fn([usize; 2]) -> f32) {
        let rows = self.first..self.first + self.places.len() / self.side;
        for j in centres(a.y.min(b.y).min(c.y), a.y.max(b.y).max(c.y), rows) {
            let y = j as f64 + 0.5;
            let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
            for [p, q] in [[a, b], [b, c], [c, a]] {
                if (p.y <= y) != (q.y <= y) {
                    let x = p.x + (q.x - p.x) * ((y - p.y) / (q.y - p.y));
                    (left, right) = (left.min(x), right.max(x));
                }
            }
            for i in centres(left, right, 0..self.side) {
                self.places[(j - self.first) * self.side + i] = (255.0 * value([i, j])) as u8;
            }
        }
    }
}

/// The squares of a row or column whose centres lie in an interval.
fn centres(low: f64, high: f64, all: Range<usize>) -> Range<usize> {
    let [start, end] =
        [low, high].map(|x| (x + 0.5).floor().clamp(all.start as f64, all.end as f64) as usize);
    start..end
}

/// Lengths of a step along an axis and of one along a diagonal, nearly in their ratio.
const STEPS: [u16; 2] = [5, 7];

/// The pieces of a lattice with rows of `side` places. Neighbours share a side of their squares.
fn pieces(is_rigid: &[bool], side: usize) -> Vec<Piece> {
    let far = distances(is_rigid, side);
    // Places have labels. A piece is a tree of labels, at the root of which stands what is known of it.
    let mut parents: Vec<u32> = Vec::new();
    let mut found: Vec<Piece> = Vec::new();
    let mut below: Vec<Option<u32>> = vec![None; side];
    for (is_rigid, far) in is_rigid.chunks_exact(side).zip(far.chunks_exact(side)) {
        let mut left = None;
        for i in 0..side {
            let label = is_rigid[i].then(|| {
                let [left, below] =
                    [left, below[i]].map(|label| label.map(|label| root(&mut parents, label)));
                let label = left.into_iter().chain(below).min().unwrap_or_else(|| {
                    parents.push(parents.len() as u32);
                    found.push(Piece::default());
                    parents.len() as u32 - 1
                });
                if let Some(other) = left.into_iter().chain(below).max().filter(|&other| other != label) {
                    parents[other as usize] = label;
                    let other = std::mem::take(&mut found[other as usize]);
                    found[label as usize].add(other);
                }
                let across = 2.0 * f32::from(far[i]) / f32::from(STEPS[0]) - 1.0;
                found[label as usize].add(Piece { places: 1, width: across / side as f32 });
                label
            });
            (left, below[i]) = (label, label);
        }
    }
    found
}

/// The root of a label's tree, which is made flatter on the way.
fn root(parents: &mut [u32], mut label: u32) -> u32 {
    while parents[label as usize] != label {
        let next = parents[parents[label as usize] as usize];
        parents[label as usize] = next;
        label = next;
    }
    label
}

/// Per place, the length of the shortest way to one that is not rigid. Those around the lattice are not.
fn distances(is_rigid: &[bool], side: usize) -> Vec<u16> {
    let mut far: Vec<u16> = is_rigid.iter().map(|&rigid| if rigid { u16::MAX } else { 0 }).collect();
    let last = far.len() - 1;
    // Upward, then downward.
    pass(&mut far, side, |n| n);
    pass(&mut far, side, |n| last - n);
    far
}

fn pass(far: &mut [u16], side: usize, place: impl Fn(usize) -> usize) {
    let mut before: Vec<u16> = zeroed(side + 2);
    for j in 0..far.len() / side {
        // The place before this one, and the one diagonally behind it.
        let (mut left, mut corner) = (0, 0);
        for i in 0..side {
            let here = &mut far[place(j * side + i)];
            let straight = before[i + 1].min(left).saturating_add(STEPS[0]);
            let diagonal = before[i + 2].min(corner).saturating_add(STEPS[1]);
            *here = straight.min(diagonal).min(*here);
            corner = std::mem::replace(&mut before[i + 1], *here);
            left = *here;
        }
    }
}
