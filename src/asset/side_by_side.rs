//! Which tiles of a solve all threads solve together, one after the other; the others are solved side by side, on one
//! thread each, which avoids waiting. The results are bit-identical either way.

use vrtm_core::allocation::zeroed;

/// Efficiency of all threads together on one tile, relative to the same threads on separate tiles.
const EFFICIENCY: f64 = 0.9;

/// The number of tiles, largest first, that are best solved by all threads together.
pub(super) fn together(nodes: &[u64], threads: usize) -> usize {
    let time = |together: usize| {
        let (large, small) = nodes.split_at(together);
        let mut busy = zeroed::<u64>(threads);
        for &n in small {
            // The first free thread takes the next tile.
            if let Some(first) = busy.iter_mut().min() {
                *first += n;
            }
        }
        let large = large.iter().sum::<u64>() as f64 / (threads as f64 * EFFICIENCY);
        large + busy.into_iter().max().unwrap_or(0) as f64
    };
    // Only tiles that are a large part of a thread's work qualify, and they are few.
    let (all, parts) = (nodes.iter().sum::<u64>(), 4 * threads as u64);
    let most = nodes.iter().take_while(|&&n| n * parts > all).count();
    // For equal times fewer are better, since no thread waits for another.
    let best = (0..=most).min_by(|&a, &b| time(a).total_cmp(&time(b)));
    if threads > 1 { best.unwrap_or(0) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn large_tiles_are_solved_by_all_threads() {
        // A single tile is always solved by all threads.
        assert_eq!(together(&[1000], 4), 1);
        assert_eq!(together(&[1000], 1), 0);
        assert_eq!(together(&[], 2), 0);
        // As many equal tiles as threads: one each. With one more, it is solved by all threads.
        assert_eq!(together(&[1000; 4], 4), 0);
        assert_eq!(together(&[1000; 3], 2), 1);
        // One tile that outweighs all others, then many small ones.
        assert_eq!(together(&[100_000, 10, 10, 10], 2), 1);
        assert_eq!(together(&[10; 64], 2), 0);
    }
}
