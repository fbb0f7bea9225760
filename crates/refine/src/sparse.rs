//! Values at the points of a grid of which few differ from the others: only blocks of points with a value are stored.

use vrtm_core::allocation::{Vec, vec};
use vrtm_core::mesh::NONE;

/// Points on a side of a block.
const SIDE: usize = 16;

#[derive(Debug)]
pub struct Sparse<T> {
    size: [usize; 2],
    /// Blocks along u.
    width: usize,
    /// Per block, its index in `blocks`, or `NONE`.
    index: Vec<u32>,
    blocks: Vec<[T; SIDE * SIDE]>,
    /// The value of all points that are not stored.
    other: T,
}

impl<T: Copy> Sparse<T> {
    pub fn new(size: [usize; 2], other: T) -> Sparse<T> {
        let [width, height] = size.map(|n| n.div_ceil(SIDE));
        Sparse { size, width, index: vec![NONE; width * height], blocks: Vec::new(), other }
    }

    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    fn place(&self, i: usize, j: usize) -> (usize, usize) {
        (j / SIDE * self.width + i / SIDE, j % SIDE * SIDE + i % SIDE)
    }

    pub fn get(&self, i: usize, j: usize) -> &T {
        let (block, k) = self.place(i, j);
        match self.index[block] {
            NONE => &self.other,
            stored => &self.blocks[stored as usize][k],
        }
    }

    /// The value of a point, which is stored from now on.
    pub fn at(&mut self, i: usize, j: usize) -> &mut T {
        let (block, k) = self.place(i, j);
        if self.index[block] == NONE {
            self.index[block] = self.blocks.len() as u32;
            self.blocks.push([self.other; SIDE * SIDE]);
        }
        &mut self.blocks[self.index[block] as usize][k]
    }

    /// The values that are stored, in the order of their memory.
    pub fn values(&mut self) -> impl Iterator<Item = &mut T> {
        self.blocks.as_flattened_mut().iter_mut()
    }

    /// The blocks that are stored and those around them, ascending.
    pub fn around(&self) -> Vec<usize> {
        let height = self.index.len() / self.width;
        let near = |x: usize, end: usize| x.saturating_sub(1)..(x + 2).min(end);
        let is_near = |&block: &usize| {
            let (x, y) = (block % self.width, block / self.width);
            near(y, height).any(|y| near(x, self.width).any(|x| self.index[y * self.width + x] != NONE))
        };
        (0..self.index.len()).filter(is_near).collect()
    }

    /// The points of a block.
    pub fn nodes_of(&self, block: usize) -> impl Iterator<Item = [usize; 2]> {
        let ([x, y], [nx, ny]) = ([block % self.width * SIDE, block / self.width * SIDE], self.size);
        (y..(y + SIDE).min(ny)).flat_map(move |j| (x..(x + SIDE).min(nx)).map(move |i| [i, j]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_those_that_were_set() {
        let mut sparse = Sparse::new([50, 35], 7u32);
        assert!(sparse.is_empty() && sparse.around().is_empty());
        let set = [[0, 0], [49, 34], [16, 15], [15, 16], [49, 0]];
        set.iter().enumerate().for_each(|(k, &[i, j])| *sparse.at(i, j) = k as u32);
        for j in 0..35 {
            for i in 0..50 {
                let expected = set.iter().position(|point| *point == [i, j]).map_or(7, |k| k as u32);
                assert_eq!(*sparse.get(i, j), expected, "{i} {j}");
            }
        }
        assert_eq!(sparse.values().filter(|value| **value != 7).count(), set.len());
        // All blocks but none twice, and all points of each.
        let around = sparse.around();
        assert_eq!(around.len(), 12);
        assert_eq!(around.iter().flat_map(|&block| sparse.nodes_of(block)).count(), 50 * 35);
    }
}
