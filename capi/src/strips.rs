//! The bytes of memory that an image's texels occupy, and whether two images share a byte.

use std::ops::Range;

use super::status::{Failure, Outcome};
use vrtm_core::allocation::Vec;

/// Pieces of memory of equal size, arranged in rows: the texels of an image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Strips {
    /// Address of the first piece.
    pub start: usize,
    /// Bytes of a piece.
    pub size: usize,
    /// Number of pieces in a row and bytes from one piece to the next, then number of rows and bytes from one row to
    /// the next. Neither pieces nor rows overlap.
    pub steps: [(usize, usize); 2],
}

impl Strips {
    /// True if the two share a byte. Interleaved pieces, such as two parts of one image, share none. Takes time
    /// proportional to the number of rows if the pieces of both have the same spacing, and otherwise to the
    /// number of pieces.
    pub fn meet(&self, other: &Strips) -> bool {
        let (mut own, mut others) = (0, 0);
        while own < self.steps[1].0 && others < other.steps[1].0 {
            let (a, b) = (self.row(own), other.row(others));
            if a.start < b.end && b.start < a.end && self.rows_meet(a.start, other, b.start) {
                return true;
            }
            // The row that ends first overlaps no later row.
            if a.end <= b.end { own += 1 } else { others += 1 }
        }
        false
    }

    /// All addresses, from the first to the last.
    fn span(&self) -> Range<usize> {
        let rows = self.steps[1].0;
        if rows == 0 { self.start..self.start } else { self.start..self.row(rows - 1).end }
    }

    /// Addresses of a row.
    fn row(&self, row: usize) -> Range<usize> {
        let [(count, step), (_, row_step)] = self.steps;
        let start = self.start + row * row_step;
        start..start + (count - 1) * step + self.size
    }

    /// True if the row that begins at `a` shares a byte with the row of `other` that begins at `b`.
    fn rows_meet(&self, a: usize, other: &Strips, b: usize) -> bool {
        let ([(count, step), _], [(other_count, other_step), _]) = (self.steps, other.steps);
        if b < a {
            return other.rows_meet(b, self, a);
        }
        // The first pieces of this row that could reach the other row's beginning.
        let mut own = ((b - a) / step).min(count - 1);
        if step == other_step {
            // With equal spacing, later pairs of pieces have the same offset as this one.
            let near = |k: usize| k < count && a + k * step < b + other.size && b < a + k * step + self.size;
            return near(own) || near(own + 1);
        }
        let mut others = 0;
        while own < count && others < other_count {
            let (p, q) = (a + own * step, b + others * other_step);
            if p < q + other.size && q < p + self.size {
                return true;
            }
            if p + self.size <= q + other.size { own += 1 } else { others += 1 }
        }
        false
    }
}

/// Rejects outputs that write the same byte, which would be undefined behaviour. Outputs may be interleaved, such as
/// two pairs of channels of one image. Positions are read as one slice of all bytes that they span, so no output may
/// write there.
pub(super) fn check_apart(mut outputs: Vec<(String, Strips)>, positions: Range<usize>) -> Outcome<()> {
    let overlap = |a: &str, b: &str| Err(Failure::argument(format!("{a} and {b} overlap in memory")));
    outputs.sort_unstable_by(|(a, of_a), (b, of_b)| (of_a.start, a).cmp(&(of_b.start, b)));
    for (k, (name, strips)) in outputs.iter().enumerate() {
        let span = strips.span();
        if span.start < positions.end && positions.start < span.end {
            return overlap(name, "positions");
        }
        for (other, of_other) in outputs[k + 1..].iter().take_while(|(_, of_other)| of_other.start < span.end)
        {
            if strips.meet(of_other) {
                return overlap(name, other);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `Strips::meet` by comparing all bytes.
    fn plainly(a: &Strips, b: &Strips) -> bool {
        let bytes = |s: &Strips| {
            let (start, size, [(count, step), (rows, row_step)]) = (s.start, s.size, s.steps);
            let of_row = move |row| (0..count).map(move |k| start + row * row_step + k * step);
            let pieces = (0..rows).flat_map(of_row);
            pieces.flat_map(move |first| first..first + size).collect::<std::collections::BTreeSet<_>>()
        };
        !bytes(a).is_disjoint(&bytes(b))
    }

    #[test]
    #[cfg_attr(miri, ignore = "too long, and safe code")]
    fn layouts_meet_where_they_share_a_byte() {
        let mut seed = 1u64;
        let mut random = |below: u64| {
            seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            ((seed >> 33) % below) as usize
        };
        let mut met = 0;
        for _ in 0..20_000 {
            let common = 4 + random(9);
            let [a, b] = [0, 1].map(|_| {
                let size = [1, 2, 4, 8][random(4)];
                let step = if random(2) == 0 { common.max(size) } else { size + random(9) };
                let count = 1 + random(6);
                let row = (count - 1) * step + size;
                let row_step = row + random(30);
                Strips { start: 100 + random(60), size, steps: [(count, step), (1 + random(4), row_step)] }
            });
            assert_eq!(a.meet(&b), plainly(&a, &b), "{a:?} {b:?}");
            met += usize::from(a.meet(&b));
        }
        assert!((2000..18_000).contains(&met), "{met}");
    }
}
