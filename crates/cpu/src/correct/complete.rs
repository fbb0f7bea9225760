//! Completes the rows of a level after its owned pairs and row sums are formed (method §7.2).

use super::super::lanes::{Lanes, Mask, Vectorised, dispatch, each};
use super::super::prefetch::prefetch;
use super::super::prolong::{CoarseNodes, coarse_nodes};
use super::super::row::{NEIGHBOURS, Row};
use super::super::run::Run;
use super::rows::{BlockRows, Halo, Rows, WordWindows, Words, decode, halo_words};
use super::transfer::{Weights, active_neighbours};
use super::workspace::SolvingLevel;
use vrtm_core::grid::planes::Plane;
use vrtm_core::grid::window::{WINDOW_NODES, Window};
use vrtm_core::team::SharedSlice;

/// Completes a level's rows, whose owned pairs and row sums are formed: copies the halo's pairs and computes the
/// diagonals. If there is a coarser level to form (`coarser`), also sets the product to A P 1, from which `galerkin`
/// computes that level's row sums.
pub fn complete(run: &Run, level: usize, system: &mut SolvingLevel, coarser: bool) {
    let grid = &run.grid.levels[level];
    let Rows { diagonal, is_uniform, words, halo } = &mut *system.rows;
    let (diagonal, halo, product) =
        (SharedSlice::new(diagonal), SharedSlice::new(halo), SharedSlice::new(system.product));
    let (words, is_uniform) = (&*words, &*is_uniform);
    let element = |b: usize| if is_uniform[b] { is_uniform.len() } else { b };
    let next = |b: usize| prefetch(&words[element(b)]);
    run.each_block(level, next, |worker, b, _| {
        next(b);
        let neighbours = active_neighbours(grid, b);
        // P 1 is 1 if all coarse nodes from which the node is interpolated are movable, and less otherwise.
        let coarse = |b: usize, _| &run.grid.levels[level + 1].movable[b];
        let nodes = coarser.then(|| coarse_nodes(run.grid, level, b, coarse)).flatten();
        let is_one = |[nodes]: &[CoarseNodes; 1]| nodes.as_flattened().iter().all(|&x| x == 1.0);
        let ones = nodes.filter(|nodes| !is_one(nodes)).map(|[nodes]| (Weights::new(grid, b), nodes));
        // SAFETY: each item has its own block.
        let (diagonal, own_halo) = unsafe { (diagonal.get_mut(b), halo.get_mut(b)) };
        if !is_uniform[b] {
            *own_halo = halo_words(|b| &words[element(b)], &neighbours);
        }
        // SAFETY: as above; nothing writes that of uniform blocks.
        let (halo, product) = unsafe { (halo.get(element(b)), coarser.then(|| product.get_mut(b))) };
        let (words, movable) = (&words[element(b)], &grid.movable[b]);
        run.words.with(worker, |windows| {
            dispatch(Complete { words, halo, movable, windows, diagonal, ones, product })
        });
    });
}

/// Computes one block's diagonals from its row sums, and the block's part of A P 1 for the coarser level.
struct Complete<'a> {
    words: &'a Words,
    halo: &'a Halo,
    movable: &'a Plane<u8>,
    windows: &'a mut WordWindows,
    diagonal: &'a mut [Plane; 3],
    /// The weights of P and the coarse nodes' mobility, unless all of them can move.
    ones: Option<(Weights, CoarseNodes)>,
    /// The array for A P 1.
    product: Option<&'a mut [Plane; 3]>,
}

impl Vectorised for Complete<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Complete { words, halo, movable, windows, diagonal, ones, mut product } = self;
        let ones = ones.map(|(weights, nodes)| {
            let mut ones: Window = [0.0; WINDOW_NODES];
            weights.interpolate(&nodes, &mut ones);
            ones
        });
        BlockRows { diagonal, words, halo, uniform: None }.gather::<V>(windows);
        for row in Row::all() {
            let sums = each!([0, 1, 2], |c| row.load::<V>(&diagonal[c]));
            let lanes = V::zero().lt(V::load_u8(movable, row.slot()));
            let mut diagonal_block = sums;
            each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                let pair = symmetric_part::<V>(windows, row, k);
                for c in 0..3 {
                    diagonal_block[c] -= pair[c];
                }
            });
            for c in 0..3 {
                // Fixed nodes get the identity, so that nothing divides by zero.
                let identity = if c == 1 { V::zero() } else { V::one() };
                row.store(&mut diagonal[c], lanes.select(diagonal_block[c], identity));
            }
            let Some(product) = &mut product else { continue };
            let mut of_row = sums;
            if let Some(ones) = &ones {
                let here = row.near::<V>(ones, 0, 0);
                of_row = each!([0, 1, 2], |c| sums[c] * here);
                each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                    let (di, dj, ..) = NEIGHBOURS[k];
                    let difference = row.near::<V>(ones, di, dj) - here;
                    let pair = symmetric_part::<V>(windows, row, k);
                    for c in 0..3 {
                        of_row[c] += pair[c] * difference;
                    }
                });
            }
            for c in 0..3 {
                row.store(&mut product[c], lanes.select(of_row[c], V::zero()));
            }
        }
    }
}

/// (xx, xy, yy) of the symmetric part of the pairs between a row's nodes and their neighbours `k`.
#[inline(always)]
fn symmetric_part<V: Lanes>(words: &WordWindows, row: Row, k: usize) -> [V; 3] {
    let (di, dj, e, neighbour_owns) = NEIGHBOURS[k];
    let (oi, oj) = if neighbour_owns { (di, dj) } else { (0, 0) };
    let [xx, xy, yx, yy] = decode::<V>(each!([0, 1], |w| row.near_index::<V>(&words[e][w], oi, oj)));
    [xx, (xy + yx) * 0.5, yy]
}
