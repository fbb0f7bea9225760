//! Decides which corners of triangles are one UV corner (method §1): first which vertices lie at one place, then which
//! of their UVs match. In both, later ones join the first, so that the result does not depend on the order of a hash
//! table, and chains of neighbours never join distant points.

use std::hash::Hash;

use glam::{DVec2, DVec3};

use super::hash::{Table, enter};
use super::triangle::doubled_area;
use super::{NONE, RawTriangle};
use crate::allocation::{Vec, vec};

/// Most entries examined in a cell of the hash. Vertices or UVs of one place that differ are few; the limit keeps a
/// host's input from making this quadratic.
const LOOKED_AT: usize = 16;

/// The vertices that lie at one place: per vertex, the first vertex there. Vertices that are not `wanted` stay
/// separate.
///
/// `tolerance` is a length. For each vertex it is limited to a quarter of its shortest edge (`shortest`), so that the
/// ends of an edge stay apart. Vertices with edges shorter than half of the tolerance are welded to equal ones only:
/// any number of them may lie within the tolerance.
pub fn places(
    rest: &[[f64; 3]],
    shortest: &[f64],
    tolerance: f64,
    wanted: impl Fn(usize) -> bool,
) -> Vec<u32> {
    let mut low = [f64::INFINITY; 3];
    rest.iter().for_each(|p| low = [0, 1, 2].map(|c| low[c].min(p[c])));
    let reach = |v: usize| {
        if shortest[v] < 0.5 * tolerance { 0.0 } else { tolerance.min(0.25 * shortest[v]) }
    };
    // Adding 0.0 turns -0.0 into 0.0.
    let bits = |p: [f64; 3]| p.map(|x| (x + 0.0).to_bits());
    let mut exact: Table<[u64; 3], u32> = Table::default();
    let mut cells = Cells::default();
    let mut place = Vec::with_capacity(rest.len());
    for (v, &p) in rest.iter().enumerate() {
        if !wanted(v) {
            place.push(v as u32);
            continue;
        }
        if let Some(&first) = exact.get(&bits(p)) {
            place.push(first);
            continue;
        }
        let mut found = v as u32;
        if reach(v) > 0.0 {
            let cell = |c: usize, d: f64| ((p[c] - low[c] + d) / (2.0 * tolerance)).floor() as i64;
            let span = |c: usize| cell(c, -reach(v))..=cell(c, reach(v));
            let mut nearest = f64::INFINITY;
            for x in span(0) {
                for y in span(1) {
                    for z in span(2) {
                        for w in cells.at([x, y, z]) {
                            let d = DVec3::from(p).distance(rest[w as usize].into());
                            if d <= reach(v).min(reach(w as usize)) && d < nearest {
                                (nearest, found) = (d, w);
                            }
                        }
                    }
                }
            }
            if found == v as u32 {
                cells.add([0, 1, 2].map(|c| cell(c, 0.0)), found);
            }
        }
        enter(&mut exact, bits(p), found);
        place.push(found);
    }
    place
}

/// Items, by the cells in which they lie.
#[derive(Default)]
struct Cells<K> {
    /// The last item of each cell, as its index in `items`.
    last: Table<K, u32>,
    /// Each item, and the index of the previous item in its cell, or `NONE`.
    items: Vec<(u32, u32)>,
}

impl<K: Eq + Hash> Cells<K> {
    fn add(&mut self, cell: K, item: u32) {
        let before = enter(&mut self.last, cell, self.items.len() as u32);
        self.items.push((item, before.unwrap_or(NONE)));
    }

    /// The last items of a cell.
    fn at(&self, cell: K) -> impl Iterator<Item = u32> + '_ {
        let item = |k: u32| self.items.get(k as usize).copied();
        let first = self.last.get(&cell).and_then(|&k| item(k));
        std::iter::successors(first, move |&(_, before)| item(before)).map(|(item, _)| item).take(LOOKED_AT)
    }
}

/// Per vertex, how far the UVs of its corners may be moved: a quarter of the least height of the triangles at it,
/// slivers left out. Even if all three corners of a triangle move, it keeps its orientation and more than a quarter of
/// its height; and since two of its corners are a height apart, they never merge.
pub(super) fn rooms<'a>(triangles: impl Iterator<Item = &'a RawTriangle>, vertices: usize) -> Vec<f64> {
    /// A triangle whose height is under this share of its longest side is a sliver, as at a corner in the middle of a
    /// polygon's side: it would be as thin as the noise, and keep all corners there apart.
    const SLIVER: f64 = 0.01;
    let mut room = vec![f64::INFINITY; vertices];
    for triangle in triangles {
        let [a, b, c] = triangle.uv;
        let longest = a.distance(b).max(b.distance(c)).max(c.distance(a));
        let height = doubled_area(triangle.uv).abs() / longest;
        if height < SLIVER * longest {
            continue;
        }
        for v in triangle.vertices {
            room[v as usize] = room[v as usize].min(0.25 * height);
        }
    }
    room
}

/// Numbers UV corners.
pub(super) struct Corners<'a> {
    place: &'a dyn Fn(u32) -> u32,
    room: &'a [f64],
    tolerance: f64,
    exact: Table<(u32, [u64; 2]), u32>,
    cells: Cells<(u32, [i64; 2])>,
    /// Per UV corner: its UV, and the distance within which others join it.
    firsts: Vec<(DVec2, f64)>,
}

impl<'a> Corners<'a> {
    /// `place` maps a vertex to its place; UVs of a vertex join others within `tolerance`, and within its `room`.
    pub fn new(place: &'a dyn Fn(u32) -> u32, room: &'a [f64], tolerance: f64) -> Corners<'a> {
        let (exact, cells, firsts) = (Table::default(), Cells::default(), Vec::new());
        Corners { place, room, tolerance, exact, cells, firsts }
    }

    /// The number of a corner with this vertex and UV, and the UV of the first such corner.
    pub fn number(&mut self, vertex: u32, uv: DVec2) -> (u32, DVec2) {
        let place = (self.place)(vertex);
        let key = (place, uv.to_array().map(|x| (x + 0.0).to_bits()));
        let id = match self.exact.get(&key) {
            Some(&id) => id,
            None => {
                let id = self.near(place, uv, self.room[vertex as usize].min(self.tolerance));
                enter(&mut self.exact, key, id);
                id
            }
        };
        (id, self.firsts[id as usize].0)
    }

    /// The nearest corner within reach, or a new one.
    fn near(&mut self, place: u32, uv: DVec2, reach: f64) -> u32 {
        let new = self.firsts.len() as u32;
        let (mut found, mut nearest) = (new, f64::INFINITY);
        if reach > 0.0 {
            let cell = |c: usize, d: f64| ((uv[c] + d) / (2.0 * self.tolerance)).floor() as i64;
            for x in cell(0, -reach)..=cell(0, reach) {
                for y in cell(1, -reach)..=cell(1, reach) {
                    for id in self.cells.at((place, [x, y])) {
                        let (first, of_first) = self.firsts[id as usize];
                        let d = (first - uv).abs().max_element();
                        if d <= reach.min(of_first) && d < nearest {
                            (nearest, found) = (d, id);
                        }
                    }
                }
            }
            if found == new {
                self.cells.add((place, [0, 1].map(|c| cell(c, 0.0))), new);
            }
        }
        if found == new {
            self.firsts.push((uv, reach));
        }
        found
    }
}
