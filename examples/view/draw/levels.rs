//! A rigidity map with its mip levels, of which a stroke changes a part.

use crate::brush::canvas::{Canvas, Rect};

/// All levels of a map, 8 bits per texel. Rows run from v = 0 upward, other than in a canvas.
pub struct Levels {
    pub levels: Vec<Level>,
}

pub struct Level {
    pub size: [u32; 2],
    pub texels: Vec<u8>,
}

impl Levels {
    pub fn new(canvas: &Canvas) -> Levels {
        let mut size = canvas.size;
        let mut levels = Vec::new();
        loop {
            levels.push(Level { size, texels: vec![0; (size[0] * size[1]) as usize] });
            if size == [1, 1] {
                break;
            }
            size = size.map(|side| (side / 2).max(1));
        }
        let mut all = Levels { levels };
        all.update(canvas, Rect { first: [0, 0], size: canvas.size });
        all
    }

    /// Follows a canvas whose texels in a rectangle changed. Returns what changed on each level, from the finest on.
    pub fn update(&mut self, canvas: &Canvas, rect: Rect) -> Vec<(Rect, Vec<u8>)> {
        let height = canvas.size[1];
        let mut rect =
            Rect { first: [rect.first[0], height - rect.first[1] - rect.size[1]], size: rect.size };
        let mut parts = Vec::new();
        for level in 0..self.levels.len() {
            let (finer, rest) = self.levels.split_at_mut(level);
            let this = &mut rest[0];
            if let Some(finer) = finer.last() {
                rect = halved(rect, this.size);
                fill(this, rect, |at| finer.mean(at));
            } else {
                fill(this, rect, |[x, y]| (canvas.texels[canvas.index([x, height - 1 - y])] / 257) as u8);
            }
            parts.push((rect, this.copy(rect)));
        }
        parts
    }
}

impl Level {
    /// The mean of the two by two texels under one of the next coarser level.
    fn mean(&self, at: [u32; 2]) -> u8 {
        let column = |k: u32, c: usize| (2 * at[c] + k).min(self.size[c] - 1);
        let texel =
            |x: u32, y: u32| u32::from(self.texels[(column(y, 1) * self.size[0] + column(x, 0)) as usize]);
        ((texel(0, 0) + texel(1, 0) + texel(0, 1) + texel(1, 1) + 2) / 4) as u8
    }

    fn copy(&self, rect: Rect) -> Vec<u8> {
        let rows = rect.first[1]..rect.first[1] + rect.size[1];
        let start = |y: u32| (y * self.size[0] + rect.first[0]) as usize;
        rows.flat_map(|y| &self.texels[start(y)..start(y) + rect.size[0] as usize]).copied().collect()
    }
}

/// The rectangle on the next coarser level, of this size.
fn halved(rect: Rect, size: [u32; 2]) -> Rect {
    let first = [0, 1].map(|c| (rect.first[c] / 2).min(size[c] - 1));
    let end = [0, 1].map(|c| (rect.first[c] + rect.size[c]).div_ceil(2).clamp(first[c] + 1, size[c]));
    Rect { first, size: [0, 1].map(|c| end[c] - first[c]) }
}

fn fill(level: &mut Level, rect: Rect, texel: impl Fn([u32; 2]) -> u8) {
    for y in rect.first[1]..rect.first[1] + rect.size[1] {
        for x in rect.first[0]..rect.first[0] + rect.size[0] {
            level.texels[(y * level.size[0] + x) as usize] = texel([x, y]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_changes_all_levels_as_the_whole_does() {
        let texels = (0..60u32).map(|k| (k * 977 % 65536) as u16).collect();
        let mut canvas = Canvas { size: [10, 6], texels, deep: false };
        let mut levels = Levels::new(&canvas);
        let rect = Rect { first: [3, 1], size: [2, 3] };
        canvas.paste(rect, &[65535; 6]);
        let parts = levels.update(&canvas, rect);
        assert_eq!(parts[0].0, Rect { first: [3, 2], size: [2, 3] });
        assert!(parts[0].1.iter().all(|&texel| texel == 255));
        let whole = Levels::new(&canvas);
        for (a, b) in levels.levels.iter().zip(&whole.levels) {
            assert_eq!((a.size, &a.texels), (b.size, &b.texels));
        }
    }
}
