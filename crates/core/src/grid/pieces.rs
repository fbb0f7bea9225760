//! The rigid pieces of a tile, and the size of grid that resolves them (method §1).

use std::ops::Range;

use glam::DVec2;

use crate::allocation::{Vec, vec, zeroed};
use crate::grid::fill::Fill;
use crate::grid::maps::Values;
use crate::grid::uv_triangle::uv_triangles;
use crate::image::map::Map;
use crate::mesh::TileMesh;
use crate::mesh::triangle::doubled_area;
use crate::sets::root;
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
pub const BYTES: u64 = 200;

/// The places of a lattice that charts cover.
#[derive(Debug)]
pub struct Covered {
    /// Places on a side.
    side: usize,
    /// Bits of the places that are, row by row from v = 0; each row begins a word.
    places: Vec<u64>,
}

impl Covered {
    fn new(team: &Team, tile: &TileMesh, side: usize) -> Covered {
        let words = side.div_ceil(64);
        let mut places: Vec<u64> = zeroed(words * side);
        let mut bands: Vec<&mut [u64]> = places.chunks_mut(BAND * words).collect();
        team.fill_large(&mut bands, |band, places| {
            let rows = band * BAND..band * BAND + places.len() / words;
            for triangle in &tile.triangles[..tile.own()] {
                draw(triangle.uv, side, &rows, |i, j| {
                    places[(j - rows.start) * words + i / 64] |= 1 << (i % 64);
                });
            }
        });
        Covered { side, places }
    }

    fn row(&self, j: usize) -> &[u64] {
        let words = self.side.div_ceil(64);
        &self.places[j * words..(j + 1) * words]
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        size_of_val(&self.places[..]) as u64
    }
}

/// Calls `f` for the places of some rows in a triangle of the UV plane: a place is the centre of a square.
fn draw(uv: [DVec2; 3], side: usize, rows: &Range<usize>, mut f: impl FnMut(usize, usize)) {
    let fill = Fill::new(uv.map(|uv| uv * side as f64 - 0.5));
    fill.visit_in([0, rows.start], [side, rows.end], |i, j, inside| {
        if inside {
            f(i, j);
        }
    });
}

/// Cells on a side of a grid that resolves the rigid pieces of a tile, or of the finest one that a solve in so many
/// bytes can have; `None` if nothing is rigid. `covered` is kept for the next rigidity of the tile.
pub fn resolving(
    team: &Team,
    tile: &TileMesh,
    rigidity: &Values,
    bytes: Option<u64>,
    covered: &mut Option<Covered>,
) -> Option<u32> {
    let (texels, side, lattice) = match rigidity {
        Values::None => return None,
        Values::Map(map) => {
            let texels = map.width.max(map.height);
            let side = texels.clamp(SIDES[0], SIDES[1]);
            let known = covered.take().filter(|covered| covered.side == side);
            let covered = covered.insert(known.unwrap_or_else(|| Covered::new(team, tile, side)));
            (texels, side, of_map(team, map, covered))
        }
        Values::Vertices(values) => (SIDES[1], SIDES[1], of_vertices(team, tile, values, SIDES[1])),
    };
    // The share of the tile that charts cover.
    let share =
        tile.triangles.iter().map(|triangle| 0.5 * doubled_area(triangle.uv).abs()).sum::<f64>().min(1.0);
    let fits = |&size: &u32| {
        bytes.is_none_or(|bytes| share * f64::from(size).powi(2) * BYTES as f64 <= bytes as f64)
    };
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

/// A map's rigidity at the places of a lattice, 0 to 255, row by row from v = 0; 0 outside of charts.
fn of_map(team: &Team, map: &Map, covered: &Covered) -> Vec<u8> {
    let side = covered.side;
    let mut lattice: Vec<u8> = zeroed(side * side);
    let mut bands: Vec<&mut [u8]> = lattice.chunks_mut(BAND * side).collect();
    team.fill_large(&mut bands, |band, places| {
        let mut texels: Vec<f32> = zeroed(map.width);
        for (j, row) in (band * BAND..).zip(places.chunks_exact_mut(side)) {
            map.row(j * map.height / side, 0, &mut texels);
            let words = covered.row(j);
            for (i, place) in row.iter_mut().enumerate() {
                let is_covered = words[i / 64] >> (i % 64) & 1 != 0;
                let texel = if map.width == side { i } else { i * map.width / side };
                *place = if is_covered { (255.0 * texels[texel]) as u8 } else { 0 };
            }
        }
    });
    lattice
}

/// The same of rigidity per vertex.
fn of_vertices(team: &Team, tile: &TileMesh, values: &[f32], side: usize) -> Vec<u8> {
    let triangles = uv_triangles(tile, side, side);
    let mut lattice: Vec<u8> = zeroed(side * side);
    let mut bands: Vec<&mut [u8]> = lattice.chunks_mut(BAND * side).collect();
    team.fill_large(&mut bands, |band, places| {
        let rows = band * BAND..band * BAND + places.len() / side;
        for chart in &tile.charts {
            for t in chart.triangles.clone() {
                let at_corner = |v| chart.value(v, |v| [f64::from(values[v as usize])])[0] as f32;
                let at_corners = tile.triangles[t].local.map(at_corner);
                draw(tile.triangles[t].uv, side, &rows, |i, j| {
                    let value = triangles[t].interpolate(at_corners, [i, j].map(|i| i as f32 + 0.5));
                    places[(j - rows.start) * side + i] = (255.0 * value.clamp(0.0, 1.0)) as u8;
                });
            }
        }
    });
    lattice
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
