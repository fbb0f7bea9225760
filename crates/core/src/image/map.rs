//! An asset's copy of a host's rigidity map or mask: in its original number format, and only near the tile's charts.

use std::ops::Range;

use xxhash_rust::xxh3::Xxh3;

use crate::allocation::{Vec, vec, zeroed};
use crate::mesh::NONE;

use super::format::{PixelFormat, decode};

/// Texels on a side of a page.
pub const PAGE: usize = 64;

/// A rectangle of texels: from `first` (inclusive) to `end` (exclusive).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelRect {
    pub first: [usize; 2],
    pub end: [usize; 2],
}

/// A copied map, with values from 0 to 1 and rows from v = 0 upward. Pages far from all charts are not stored; their
/// texels are 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    pub width: usize,
    pub height: usize,
    format: PixelFormat,
    /// Per page, row by row, its index in `texels`, in pages; `NONE` if it is not stored.
    places: Vec<u32>,
    /// The stored pages, each `PAGE` x `PAGE` texels.
    texels: Vec<u8>,
}

impl Map {
    /// A zeroed map. `wanted(rect)` tells whether to store the page with these texels.
    pub fn new([width, height]: [usize; 2], format: PixelFormat, wanted: impl Fn(&TexelRect) -> bool) -> Map {
        let [columns, rows] = [width.div_ceil(PAGE), height.div_ceil(PAGE)];
        let mut map = Map { width, height, format, places: Vec::new(), texels: Vec::new() };
        map.places.reserve_exact(columns * rows);
        let mut count = 0;
        for page in 0..columns * rows {
            let is_wanted = wanted(&map.rect(page));
            map.places.push(if is_wanted { count } else { NONE });
            count += u32::from(is_wanted);
        }
        let bytes = count as usize * map.page_bytes();
        map.texels = zeroed(bytes);
        map
    }

    /// A map of f32 values, with all pages stored.
    #[doc(hidden)]
    pub fn from_values(width: usize, height: usize, values: &[f32]) -> Map {
        let mut map = Map::new([width, height], PixelFormat::F32, |_| true);
        for (n, value) in values.iter().enumerate() {
            map.put(n % width, n / width, &value.to_ne_bytes());
        }
        map
    }

    /// The texels of the stored pages, page by page.
    pub fn stored(&self) -> impl Iterator<Item = TexelRect> {
        (0..self.places.len()).filter(|&page| self.places[page] != NONE).map(|page| self.rect(page))
    }

    /// Texels along u and v, and their format.
    pub fn shape(&self) -> ([usize; 2], PixelFormat) {
        ([self.width, self.height], self.format)
    }

    /// Sets a texel from its bytes in the map's format; does nothing if its page is not stored.
    pub fn put(&mut self, x: usize, y: usize, bytes: &[u8]) {
        if let Some(at) = self.offset(x, y) {
            let size = self.format.size();
            self.texels[at..at + size].copy_from_slice(&bytes[..size]);
        }
    }

    /// A texel's value, 0..1.
    pub fn value(&self, x: usize, y: usize) -> f32 {
        self.offset(x, y).map_or(0.0, |at| decode(self.format, &self.texels[at..]).clamp(0.0, 1.0))
    }

    /// Texels along u and v.
    fn size(&self) -> [usize; 2] {
        [self.width, self.height]
    }

    /// The largest value near the tile's charts, not clamped.
    pub fn largest(&self) -> f32 {
        let values = self.texels.chunks_exact(self.format.size()).map(|texel| decode(self.format, texel));
        values.fold(0.0, f32::max)
    }

    /// Adds the map to a hash: its shape and its texels.
    pub fn add_to(&self, hash: &mut Xxh3) {
        let format = self.format.size() as u64 + 8 * u64::from(self.format == PixelFormat::F16);
        for number in [self.width as u64, self.height as u64, format] {
            hash.update(&number.to_le_bytes());
        }
        self.places.iter().for_each(|place| hash.update(&place.to_le_bytes()));
        hash.update(&self.texels);
    }

    /// Bytes held.
    pub fn bytes(&self) -> u64 {
        self.texels.len() as u64 + self.places.len() as u64 * 4
    }

    fn page_bytes(&self) -> usize {
        PAGE * PAGE * self.format.size()
    }

    fn rect(&self, page: usize) -> TexelRect {
        let columns = self.width.div_ceil(PAGE);
        let first = [page % columns * PAGE, page / columns * PAGE];
        TexelRect { first, end: [(first[0] + PAGE).min(self.width), (first[1] + PAGE).min(self.height)] }
    }

    /// The offset of a texel's bytes, if its page is stored.
    fn offset(&self, x: usize, y: usize) -> Option<usize> {
        let place = self.places[y / PAGE * self.width.div_ceil(PAGE) + x / PAGE];
        let texel = (y % PAGE * PAGE + x % PAGE) * self.format.size();
        (place != NONE).then(|| place as usize * self.page_bytes() + texel)
    }
}

/// Calls `put(i, j, value)` with a map's values at some nodes of a grid: first[0]..first[0] + count[0] along u, and likewise
/// along v; (i, j) are counted from `first`. A value is the mean over a box of one cell around the node where the map is finer
/// than the grid, and else interpolates bilinearly between texel centres (method §1).
pub fn at_nodes(
    map: &Map,
    cells: [usize; 2],
    first: [usize; 2],
    count: [usize; 2],
    mut put: impl FnMut(usize, usize, f32),
) {
    if count.contains(&0) {
        return;
    }
    let taps = |axis: usize, k: usize| Taps::new(map.size()[axis], cells[axis], (first[axis] + k) as f64);
    let texels = taps(0, 0).texels.start..taps(0, count[0] - 1).texels.end;
    let mut line = Line::new((texels.end - texels.start) as usize, 0.0f32);
    let line = line.all();
    for j in 0..count[1] {
        // Sums over v first, then over u.
        line.fill(0.0);
        for (y, weight) in taps(1, j).each() {
            for (sum, x) in line.iter_mut().zip(texels.clone()) {
                *sum += weight * map.value(clamp(x, map.width), clamp(y, map.height));
            }
        }
        for i in 0..count[0] {
            let weighted = |(x, weight): (i64, f32)| weight * line[(x - texels.start) as usize];
            let value: f32 = taps(0, i).each().map(weighted).sum();
            put(i, j, value.clamp(0.0, 1.0));
        }
    }
}

/// A line of texels that mostly fits on the stack: a square's, where a map has up to 16 texels per cell.
struct Line<T> {
    small: [T; 320],
    large: Vec<T>,
    count: usize,
}

impl<T: Copy> Line<T> {
    fn new(count: usize, value: T) -> Line<T> {
        let large = if count > 320 { vec![value; count] } else { Vec::new() };
        Line { small: [value; 320], large, count }
    }

    fn all(&mut self) -> &mut [T] {
        if self.count > 320 { &mut self.large } else { &mut self.small[..self.count] }
    }
}

/// A map's value at a point, as at a node of a grid that lies there.
pub fn at_point(map: &Map, cells: [usize; 2], uv: [f64; 2]) -> f32 {
    let taps = |axis: usize| Taps::new(map.size()[axis], cells[axis], uv[axis] * cells[axis] as f64);
    let (columns, rows) = (taps(0), taps(1));
    let mut sum = 0.0;
    for (y, of_row) in rows.each() {
        for (x, of_column) in columns.each() {
            sum += of_row * of_column * map.value(clamp(x, map.width), clamp(y, map.height));
        }
    }
    sum.clamp(0.0, 1.0)
}

/// True if a mask has no texel under 0.5 within half a cell of a point.
pub fn is_free(mask: &Map, cells: [usize; 2], uv: [f64; 2]) -> bool {
    let texels = |axis: usize, texels: usize| span(texels, cells[axis], uv[axis] * cells[axis] as f64);
    let columns = texels(0, mask.width);
    texels(1, mask.height).all(|y| columns.clone().all(|x| mask.value(x, y) >= 0.5))
}

/// Calls `put(i, j)` for the nodes, counted from `first`, at which the mask has no texel under 0.5 within half a cell. A fixed
/// line one texel wide is thus a barrier, however coarse the grid.
pub fn free_nodes(
    mask: &Map,
    cells: [usize; 2],
    first: [usize; 2],
    count: [usize; 2],
    mut put: impl FnMut(usize, usize),
) {
    if count.contains(&0) {
        return;
    }
    let texels = |axis: usize, k: usize| span(mask.size()[axis], cells[axis], (first[axis] + k) as f64);
    let columns = texels(0, 0).start..texels(0, count[0] - 1).end;
    let mut line = Line::new(columns.len(), true);
    let line = line.all();
    for j in 0..count[1] {
        line.fill(true);
        for y in texels(1, j) {
            for (free, x) in line.iter_mut().zip(columns.clone()) {
                *free &= mask.value(x, y) >= 0.5;
            }
        }
        for i in 0..count[0] {
            let of_node = texels(0, i);
            if line[of_node.start - columns.start..of_node.end - columns.start].iter().all(|&free| free) {
                put(i, j);
            }
        }
    }
}

/// The texels along one axis that are averaged for a node's value, with weights that sum to 1. Texels beyond the map
/// repeat its outermost ones.
#[derive(Clone)]
struct Taps {
    texels: Range<i64>,
    /// The box around the node, in texels.
    low: f64,
    high: f64,
}

impl Taps {
    fn new(texels: usize, cells: usize, node: f64) -> Taps {
        let per_cell = texels as f64 / cells as f64;
        let half = 0.5 * per_cell.max(1.0);
        let centre = node * per_cell;
        // A box one texel wide, sampled between texel centres, equals the bilinear filter.
        let (low, high) = (centre - half, centre + half);
        Taps { texels: low.floor() as i64..high.ceil() as i64, low, high }
    }

    /// The contributing texels, as (texel, weight).
    fn each(&self) -> impl Iterator<Item = (i64, f32)> {
        let Taps { texels, low, high } = self.clone();
        let weight = move |texel: i64| {
            ((high.min(texel as f64 + 1.0) - low.max(texel as f64)).max(0.0) / (high - low)) as f32
        };
        texels.map(move |texel| (texel, weight(texel))).filter(|&(_, weight)| weight > 0.0)
    }
}

fn clamp(texel: i64, texels: usize) -> usize {
    texel.clamp(0, texels as i64 - 1) as usize
}

/// The texels along one axis that are within half a cell of a node.
fn span(texels: usize, cells: usize, node: f64) -> Range<usize> {
    let per_cell = texels as f64 / cells as f64;
    let centre = node * per_cell;
    let first = (centre - 0.5 * per_cell).floor().max(0.0) as usize;
    let last = (centre + 0.5 * per_cell).ceil().max(0.0) as usize;
    first.min(texels - 1)..last.clamp(1, texels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::allocation::vec;

    fn at_nodes(map: &Map, cells: [usize; 2], first: [usize; 2], count: [usize; 2]) -> Vec<f32> {
        let mut values = vec![f32::NAN; count[0] * count[1]];
        super::at_nodes(map, cells, first, count, |i, j, value| values[j * count[0] + i] = value);
        values
    }

    fn free_nodes(mask: &Map, cells: [usize; 2], first: [usize; 2], count: [usize; 2]) -> Vec<bool> {
        let mut free = vec![false; count[0] * count[1]];
        super::free_nodes(mask, cells, first, count, |i, j| free[j * count[0] + i] = true);
        free
    }

    fn map(width: usize, height: usize, f: impl Fn(usize, usize) -> f32) -> Map {
        let values: Vec<f32> = (0..width * height).map(|i| f(i % width, i / width)).collect();
        Map::from_values(width, height, &values)
    }

    #[test]
    fn nodes_of_a_constant_map_are_that_constant() {
        for (w, h) in [(1, 1), (3, 7), (16, 16), (100, 33), (64, 129)] {
            let nodes = at_nodes(&map(w, h, |_, _| 0.75), [32, 16], [0, 0], [33, 17]);
            assert_eq!(nodes.len(), 33 * 17);
            assert!(nodes.iter().all(|v| (v - 0.75).abs() < 1e-6));
        }
    }

    #[test]
    fn nodes_of_a_ramp_lie_on_the_ramp() {
        // A linear map keeps its values under both filters, except near the clamped edge.
        for w in [8, 16, 64, 200] {
            let ramp = map(w, 4, |x, _| (x as f32 + 0.5) / w as f32);
            let nodes = at_nodes(&ramp, [16, 16], [0, 0], [17, 17]);
            for (i, node) in nodes.iter().enumerate().take(15).skip(2) {
                assert!((node - i as f32 / 16.0).abs() < 1e-6, "{w}: {node} at {i}");
            }
        }
    }

    #[test]
    fn a_part_of_the_nodes_has_the_values_of_the_whole() {
        let rough = map(150, 90, |x, y| (x * 37 + y * 101) as f32 % 17.0 / 16.0);
        for cells in [[16, 32], [160, 96], [320, 80]] {
            let all = at_nodes(&rough, cells, [0, 0], cells.map(|n| n + 1));
            let free = free_nodes(&rough, cells, [0, 0], cells.map(|n| n + 1));
            let (first, count) = ([5, 7], [cells[0] - 5, 9]);
            let part = at_nodes(&rough, cells, first, count);
            let free_part = free_nodes(&rough, cells, first, count);
            for n in 0..part.len() {
                let whole = (first[1] + n / count[0]) * (cells[0] + 1) + first[0] + n % count[0];
                assert_eq!(part[n].to_bits(), all[whole].to_bits(), "{cells:?} {n}");
                assert_eq!(free_part[n], free[whole]);
            }
        }
    }

    #[test]
    fn a_line_of_one_texel_is_a_barrier_on_any_grid() {
        let mask = map(128, 128, |x, _| f32::from(x != 70));
        for n in [16, 32, 128, 256] {
            let free = free_nodes(&mask, [n, n], [0, 0], [n + 1, n + 1]);
            let row = &free[..n + 1];
            assert!(row.iter().any(|f| !f), "{n}");
            assert!(row.iter().filter(|f| !**f).count() <= 3, "{n}");
        }
    }

    #[test]
    fn pages_that_nobody_wants_are_not_stored() {
        let whole = Map::new([200, 100], PixelFormat::U8, |_| true);
        assert_eq!(whole.stored().count(), 8);
        let wanted = |rect: &TexelRect| rect.first == [64, 0];
        let mut map = Map::new([200, 100], PixelFormat::U8, wanted);
        for (x, y) in [(64, 0), (127, 63), (128, 0), (10, 99)] {
            map.put(x, y, &[255]);
        }
        assert_eq!(
            [map.value(64, 0), map.value(127, 63), map.value(128, 0), map.value(10, 99)],
            [1., 1., 0., 0.]
        );
        assert!(map.bytes() < whole.bytes() / 6);
    }
}
