//! An asset's copy of a host's rigidity map or mask: in its original number format, and only near the tile's charts.

use std::ops::Range;

use xxhash_rust::xxh3::Xxh3;

use crate::allocation::{Vec, vec, zeroed};
use crate::mesh::NONE;

use super::format::{PixelFormat, decode, decode_all};

/// Texels on a side of a page.
pub const PAGE: usize = 64;

/// A rectangle of texels: from `first` (inclusive) to `end` (exclusive).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TexelRect {
    pub first: [usize; 2],
    pub end: [usize; 2],
}

impl TexelRect {
    /// The least rectangle that has these texels, too.
    #[must_use]
    pub fn with(self, other: TexelRect) -> TexelRect {
        let axes = [0, 1];
        TexelRect {
            first: axes.map(|axis| self.first[axis].min(other.first[axis])),
            end: axes.map(|axis| self.end[axis].max(other.end[axis])),
        }
    }
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
            map.put_row(n % width, n / width, &value.to_ne_bytes());
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

    /// Sets texels of a row, from a column on, from their bytes in the map's format; those on pages that are not stored
    /// are left out.
    pub fn put_row(&mut self, first: usize, y: usize, bytes: &[u8]) {
        let size = self.format.size();
        let end = first + bytes.len() / size;
        let mut x = first;
        while x < end {
            let next = (x / PAGE + 1) * PAGE;
            let part = &bytes[(x - first) * size..(next.min(end) - first) * size];
            if let Some(at) = self.offset(x, y) {
                self.texels[at..at + part.len()].copy_from_slice(part);
            }
            x = next;
        }
    }

    /// A texel's value, 0..1.
    pub fn value(&self, x: usize, y: usize) -> f32 {
        self.offset(x, y).map_or(0.0, |at| decode(self.format, &self.texels[at..]).clamp(0.0, 1.0))
    }

    /// The values of a row of texels, from a column on.
    pub fn row(&self, y: usize, first: usize, values: &mut [f32]) {
        let (size, mut done) = (self.format.size(), 0);
        while done < values.len() {
            let x = first + done;
            let count = (PAGE - x % PAGE).min(values.len() - done);
            let part = &mut values[done..done + count];
            match self.offset(x, y) {
                Some(at) => decode_all(self.format, &self.texels[at..at + count * size], part),
                None => part.fill(0.0),
            }
            done += count;
        }
    }

    /// The largest value near the tile's charts, not clamped.
    pub fn largest(&self) -> f32 {
        match self.format {
            PixelFormat::U8 => decode(self.format, &[self.texels.iter().copied().max().unwrap_or(0)]),
            _ => {
                let texels = self.texels.chunks_exact(self.format.size());
                texels.map(|texel| decode(self.format, texel)).fold(0.0, f32::max)
            }
        }
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

/// A line of texels that mostly fits on the stack: three of a square, where a map has up to 16 texels per cell.
pub struct Line<T> {
    small: [T; 960],
    large: Vec<T>,
    count: usize,
}

impl<T: Copy> Line<T> {
    pub fn new(count: usize, value: T) -> Line<T> {
        let large = if count > 960 { vec![value; count] } else { Vec::new() };
        Line { small: [value; 960], large, count }
    }

    pub fn all(&mut self) -> &mut [T] {
        if self.count > 960 { &mut self.large } else { &mut self.small[..self.count] }
    }
}

/// True if a mask has no texel under 0.5 within half a cell of a point.
pub fn is_free(mask: &Map, cells: [usize; 2], uv: [f64; 2]) -> bool {
    let texels = |axis: usize, texels: usize| span(texels, cells[axis], uv[axis] * cells[axis] as f64);
    let columns = texels(0, mask.width);
    texels(1, mask.height).all(|y| columns.clone().all(|x| mask.value(x, y) >= 0.5))
}

/// Calls `put(i, j)` for the nodes, counted from `first`, at which the mask has no texel under 0.5 within half a cell.
/// A fixed line one texel wide is thus a barrier, however coarse the grid.
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
    let texels = |axis: usize, k: usize| span(mask.shape().0[axis], cells[axis], (first[axis] + k) as f64);
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

/// The texels along one axis that are within half a cell of a node.
fn span(texels: usize, cells: usize, node: f64) -> Range<usize> {
    let per_cell = texels as f64 / cells as f64;
    let centre = node * per_cell;
    let first = (centre - 0.5 * per_cell).floor().max(0.0) as usize;
    let last = (centre + 0.5 * per_cell).ceil().max(0.0) as usize;
    first.min(texels - 1)..last.clamp(1, texels)
}
