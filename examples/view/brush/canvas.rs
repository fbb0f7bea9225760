//! The rigidity map of a tile while it is painted, and the rectangles that changed.

use vrtm::PixelFormat;

use crate::maps::Map;

/// Texels of a tile without a map, per side.
const SIDE: u32 = 512;

/// A rectangle of texels: first column and row, width and height.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rect {
    pub first: [u32; 2],
    pub size: [u32; 2],
}

impl Rect {
    /// The rectangle around both.
    pub fn with(self, other: Rect) -> Rect {
        let first = [0, 1].map(|c| self.first[c].min(other.first[c]));
        let end = [0, 1].map(|c| (self.first[c] + self.size[c]).max(other.first[c] + other.size[c]));
        Rect { first, size: [0, 1].map(|c| end[c] - first[c]) }
    }

    /// The rectangle around this one and a texel.
    pub fn around(of: Option<Rect>, at: [u32; 2]) -> Rect {
        let texel = Rect { first: at, size: [1, 1] };
        of.map_or(texel, |rect| rect.with(texel))
    }
}

/// Rigidity of 16 bits per texel, first row at the top of the tile (v = 1).
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    pub size: [u32; 2],
    pub texels: Vec<u16>,
    /// True if the opened map had 16 bits: a saved one has as many.
    pub deep: bool,
}

impl Canvas {
    /// The opened map, or an elastic one if there is none.
    pub fn new(map: Option<&Map>) -> Canvas {
        let Some(map) = map else {
            return Canvas { size: [SIDE; 2], texels: vec![0; (SIDE * SIDE) as usize], deep: false };
        };
        let deep = map.format == PixelFormat::U16;
        let texels = if deep {
            map.bytes.chunks_exact(2).map(|b| u16::from_ne_bytes([b[0], b[1]])).collect()
        } else {
            map.bytes.iter().map(|&b| u16::from(b) * 257).collect()
        };
        Canvas { size: map.size, texels, deep }
    }

    /// The texel of a UV within the tile.
    #[cfg(test)]
    pub fn texel(&self, uv: [f32; 2]) -> [u32; 2] {
        let at = |x: f32, size: u32| ((x * size as f32).max(0.0) as u32).min(size - 1);
        [at(uv[0], self.size[0]), at(1.0 - uv[1], self.size[1])]
    }

    /// The UV of a texel's centre.
    #[cfg(test)]
    pub fn uv(&self, at: [u32; 2]) -> [f32; 2] {
        let part = [0, 1].map(|c| (at[c] as f32 + 0.5) / self.size[c] as f32);
        [part[0], 1.0 - part[1]]
    }

    /// Column and row of a texel.
    pub fn place(&self, index: usize) -> [u32; 2] {
        [index as u32 % self.size[0], index as u32 / self.size[0]]
    }

    pub fn index(&self, at: [u32; 2]) -> usize {
        (at[1] * self.size[0] + at[0]) as usize
    }

    /// Copies a rectangle out.
    pub fn copy(&self, rect: Rect) -> Vec<u16> {
        let rows = rect.first[1]..rect.first[1] + rect.size[1];
        let row = |y: u32| {
            let start = self.index([rect.first[0], y]);
            &self.texels[start..start + rect.size[0] as usize]
        };
        rows.flat_map(row).copied().collect()
    }

    /// Copies a rectangle in.
    pub fn paste(&mut self, rect: Rect, texels: &[u16]) {
        for (y, row) in (rect.first[1]..).zip(texels.chunks_exact(rect.size[0] as usize)) {
            let start = self.index([rect.first[0], y]);
            self.texels[start..start + row.len()].copy_from_slice(row);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_are_copied_out_and_in() {
        let mut canvas = Canvas { size: [5, 4], texels: (0..20).collect(), deep: true };
        let rect = Rect { first: [1, 2], size: [3, 2] };
        assert_eq!(canvas.copy(rect), [11, 12, 13, 16, 17, 18]);
        canvas.paste(rect, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(canvas.texels[10..], [10, 1, 2, 3, 14, 15, 4, 5, 6, 19]);
    }

    #[test]
    fn rectangles_grow_around_texels() {
        let one = Rect::around(None, [7, 3]);
        assert_eq!(one, Rect { first: [7, 3], size: [1, 1] });
        assert_eq!(Rect::around(Some(one), [5, 6]), Rect { first: [5, 3], size: [3, 4] });
    }
}
