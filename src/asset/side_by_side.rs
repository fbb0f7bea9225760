//! Distributes the tiles of a solve over the threads. Large tiles are solved one after the other by all threads together;
//! the others concurrently, one thread each, which avoids waiting. The results are bit-identical either way.

use std::cmp::Reverse;
use std::time::Duration;

use vrtm_core::allocation::{Collect, Grow, with_capacity, zeroed};
use vrtm_core::error::Result;
use vrtm_core::team::{Crew, Team};

use super::tile::{Prepared, SolveCall, SolveShare, TileState};
use crate::solver::solved::Solved;

/// Efficiency of all threads together on one tile, relative to the same threads on separate tiles.
const EFFICIENCY: f64 = 0.9;

/// The share of a call's progress for preparing its tiles, if any tile needs it.
const PREPARING: f32 = 0.3;

/// A tile to solve, and its result.
struct Queued<'a> {
    tile: usize,
    state: &'a mut TileState,
    prepared: Prepared,
    /// Nodes that may move.
    nodes: u64,
    /// This tile's share of the call's progress.
    progress: f32,
    result: Option<Result<Solved>>,
}

/// Solves tiles.
pub(super) fn solve(
    call: &SolveCall,
    crew: &Crew,
    tiles: Vec<(usize, &mut TileState)>,
) -> Result<Vec<(usize, Solved)>> {
    let mut queue = prepare(call, tiles)?;
    // Longest first, so that no long tile is left for a single thread at the end.
    queue.sort_unstable_by_key(|queued| (Reverse(queued.nodes), queued.tile));
    let nodes: Vec<u64> = queue.iter().map(|queued| queued.nodes).collected();
    // A GPU executes submissions in order, so its threads would only submit work.
    let together = if call.device.gpu().is_some() { 0 } else { together(&nodes, call.team.threads()) };
    let (large, small) = queue.split_at_mut(together);
    for queued in large {
        let share = SolveShare { progress: queued.progress, ..SolveShare::of_all_threads() };
        queued.result = Some(queued.state.solve(call, &share, &queued.prepared));
        if let Some(Err(error)) = &queued.result {
            return Err(error.clone());
        }
    }
    let alone = crew.alone();
    call.team.fill_large(small, |_, queued| {
        let share = SolveShare { progress: queued.progress, learns: false, ..SolveShare::of_all_threads() };
        let solve = |team: &Team| queued.state.solve(&SolveCall { team, ..*call }, &share, &queued.prepared);
        queued.result = Some(Team::of(&alone, solve));
    });
    queue.sort_unstable_by_key(|queued| queued.tile);
    queue
        .into_iter()
        .filter_map(|queued| Some((queued.tile, queued.result?)))
        .map(|(k, r)| Ok((k, r?)))
        .try_collected()
}

/// Solves tiles one after the other within a time budget, dividing the remaining time among the remaining tiles.
pub(super) fn in_turn(
    call: &SolveCall,
    budget: Duration,
    tiles: Vec<(usize, &mut TileState)>,
) -> Result<Vec<(usize, Solved)>> {
    let mut nodes: u64 = tiles.iter().map(|(_, state)| state.movable_nodes()).sum();
    let progress = 1.0 / tiles.len() as f32;
    let mut solved = with_capacity(tiles.len());
    for (tile, state) in tiles {
        let own = state.movable_nodes();
        let spent = call.start.elapsed();
        let part = if own < nodes { own as f64 / nodes as f64 } else { 1.0 };
        let budget = Some(spent.saturating_add(budget.saturating_sub(spent).mul_f64(part)));
        nodes -= own;
        let prepared = state.prepare(call, tile)?;
        let share = SolveShare { budget, progress, ..SolveShare::of_all_threads() };
        solved.put((tile, state.solve(call, &share, &prepared)?));
    }
    Ok(solved)
}

/// Prepares the tiles one after the other, so that the host's log is called on the thread that does the call's work.
fn prepare<'a>(call: &SolveCall, tiles: Vec<(usize, &'a mut TileState)>) -> Result<Vec<Queued<'a>>> {
    let fresh = tiles.iter().any(|(_, state)| state.grid.is_none());
    let (preparing, count) = (if fresh { PREPARING } else { 0.0 }, tiles.len() as f32);
    let mut queue = with_capacity(tiles.len());
    for (tile, state) in tiles {
        let prepared = state.prepare(call, tile)?;
        let nodes = prepared.grid.movable.iter().sum();
        queue.put(Queued { tile, state, prepared, nodes, progress: 0.0, result: None });
        call.advance(preparing / count);
    }
    // Even an empty tile has a fixed cost.
    let weight = |queued: &Queued| (queued.nodes + 1000) as f32;
    let all: f32 = queue.iter().map(weight).sum();
    for queued in &mut queue {
        queued.progress = (1.0 - preparing) * weight(queued) / all;
    }
    Ok(queue)
}

/// The number of tiles, largest first, that are best solved by all threads together.
fn together(nodes: &[u64], threads: usize) -> usize {
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
