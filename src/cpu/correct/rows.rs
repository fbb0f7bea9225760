//! A level's system as it is stored. Each pair of nodes is stored once, with the node that owns the edge, as four bfloat16:
//! f32 without its last 16 bits, rounded. What rounding takes from a pair, the diagonals of both of its nodes give back, so
//! that the sum of a row stays exact: a rigid feature that moves as a whole feels what is around it, a sum over thousands
//! of pairs, and no rounding.

use super::super::allocate::Allocate;
use super::super::constants;
use super::super::lanes::{Kernel, LANES, Lanes, Truth, each, wide};
use super::super::patch::NEIGHBOURS;
use super::super::prefetch::prefetch;
use super::super::row::Row;
use super::*;
use crate::half;
use crate::mesh::NONE;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::window::{self, Window, place};

/// Per owned edge (p, n), the 2x2 block between p (row) and n (column), row-major, at p's place in the window: all pairs that
/// a block's rows need.
pub type Pairs = [[f32; WINDOW_NODES]; 16];

/// The pairs that a block's nodes own, per owned edge: the words of `encode`.
pub type Words = [[Plane<u32>; 2]; 4];

/// The same of the pairs that the block has with its ring and that nodes on the ring own, in the order of `GROUPS` and
/// `CORNERS`, so that a block's rows need no other block's.
pub type Ring = [[u32; GROUPS.len() * LANES + CORNERS.len()]; 2];

/// The rows of all blocks of a level.
#[derive(Debug, Default)]
pub struct Rows {
    /// (xx, xy, yy) per node. Until `finish`: the sum of the row.
    pub diagonal: Vec<[Plane; 3]>,
    pub words: Vec<Words>,
    pub ring: Vec<Ring>,
}

impl Rows {
    pub fn new(allocator: &mut impl Allocate, blocks: usize) -> Rows {
        Rows {
            diagonal: allocator.array([[0.0; NODES]; 3], blocks),
            words: allocator.array([[[0; NODES]; 2]; 4], blocks),
            ring: allocator.array([[0; GROUPS.len() * LANES + CORNERS.len()]; 2], blocks),
        }
    }

    /// Those of a block, which are asked for ahead.
    #[inline(always)]
    pub fn of(&self, b: usize) -> BlockRows<'_> {
        let rows = BlockRows { diagonal: &self.diagonal[b], words: &self.words[b], ring: &self.ring[b] };
        prefetch(rows.words);
        prefetch(rows.ring);
        prefetch(rows.diagonal);
        rows
    }
}

/// The rows of one block.
#[derive(Clone, Copy)]
pub struct BlockRows<'a> {
    pub diagonal: &'a [Plane; 3],
    pub words: &'a Words,
    pub ring: &'a Ring,
}

/// A row-major 2x2 block per lane as two words: (xx, mean of xy and yx), (yy, half their difference).
#[inline(always)]
pub fn encode<V: Lanes>([xx, xy, yx, yy]: [V; 4]) -> [V::Index; 2] {
    [V::halves(xx, (xy + yx) * 0.5), V::halves(yy, (xy - yx) * 0.5)]
}

/// What `encode` was given, rounded.
#[inline(always)]
pub fn decode<V: Lanes>([first, second]: [V::Index; 2]) -> [V; 4] {
    let ((xx, mean), (yy, half)) = (V::from_halves(first), V::from_halves(second));
    [xx, mean + half, mean - half, yy]
}

/// `decode` for one node.
#[inline(always)]
pub fn decode_one(words: [u32; 2]) -> [f32; 4] {
    let [[xx, mean], [yy, half]] = words.map(half::of_bfloat16);
    [xx, mean + half, mean - half, yy]
}

/// Eight nodes of a ring that own an edge into the block.
pub struct Group {
    /// `EDGES` of the edge.
    edge: usize,
    /// In which of the 3x3 blocks around they lie.
    from: usize,
    /// Their slots there: the first, and the step between them.
    slot: [usize; 2],
    /// Their places in the block's window.
    place: [usize; 2],
}

/// Eight nodes of a ring's southern row, those of one colour.
const fn south(edge: usize, ci: usize) -> Group {
    Group { edge, from: 1, slot: [slot(ci, SIDE - 1), 1], place: [place(ci + 1, 0), 1] }
}

/// Eight nodes of a ring's western column.
const fn west(edge: usize, cj: usize) -> Group {
    Group { edge, from: 3, slot: [slot(SIDE - 1, cj), SIDE / 2], place: [place(0, cj + 1), 9] }
}

/// Eight nodes of a ring's eastern column.
const fn east(edge: usize, cj: usize) -> Group {
    Group { edge, from: 5, slot: [slot(0, cj), SIDE / 2], place: [place(SIDE + 1, cj + 1), 9] }
}

/// No node of the north owns an edge into the block.
const GROUPS: [Group; 12] = [
    south(1, 0),
    south(1, 1),
    south(2, 0),
    south(2, 1),
    south(3, 0),
    south(3, 1),
    west(0, 0),
    west(0, 1),
    west(2, 0),
    west(2, 1),
    east(3, 0),
    east(3, 1),
];

/// And those in the corners: edge, block, slot, place.
const CORNERS: [[usize; 4]; 2] =
    [[2, 0, slot(SIDE - 1, SIDE - 1), place(0, 0)], [3, 2, slot(0, SIDE - 1), place(SIDE + 1, 0)]];

impl BlockRows<'_> {
    /// Decodes the pairs of the block's own nodes.
    #[inline(always)]
    pub fn own_pairs<V: Lanes>(&self, pairs: &mut Pairs) {
        for row in Row::all() {
            for (e, words) in self.words.iter().enumerate() {
                let s = row.slot();
                let pair = decode::<V>([V::load_index(&words[0], s), V::load_index(&words[1], s)]);
                for c in 0..4 {
                    row.set_own(&mut pairs[4 * e + c], pair[c]);
                }
            }
        }
    }

    /// Decodes all pairs of the block's rows. Places on the ring that own none of them keep what they had.
    #[inline(always)]
    pub fn pairs<V: Lanes>(&self, pairs: &mut Pairs) {
        self.own_pairs::<V>(pairs);
        for (g, group) in GROUPS.iter().enumerate() {
            let at = g * LANES;
            let pair = decode::<V>(each!([0, 1], |w| V::load_index(&self.ring[w], at)));
            let [first, step] = group.place;
            for c in 0..4 {
                let window = &mut pairs[4 * group.edge + c];
                if step == 1 {
                    pair[c].store(window, first);
                } else {
                    for (k, x) in pair[c].to_array().into_iter().enumerate() {
                        window[first + k * step] = x;
                    }
                }
            }
        }
        for (n, &[edge, _, _, place]) in CORNERS.iter().enumerate() {
            let at = GROUPS.len() * LANES + n;
            let pair = decode_one([self.ring[0][at], self.ring[1][at]]);
            for c in 0..4 {
                pairs[4 * edge + c][place] = pair[c];
            }
        }
    }
}

/// Decodes all pairs that nodes on a block's ring own, from the blocks in which they lie, into the window. `around` as in
/// `masked`. No node of the north owns a pair that matters here.
#[inline(always)]
pub fn ring_pairs<V: Lanes>(words: &[Words], around: &[u32; 9], pairs: &mut Pairs) {
    const NOTHING: &[Plane<u32>; 2] = &[[0; NODES]; 2];
    const LAST: usize = SIDE - 1;
    for e in 0..4 {
        let from = |k: usize| match around[k] {
            NONE => NOTHING,
            b => &words[b as usize][e],
        };
        let pairs = &mut pairs[4 * e..4 * e + 4];
        let south = from(1);
        for ci in 0..2 {
            let pair = decode::<V>(each!([0, 1], |w| V::load_index(&south[w], slot(ci, LAST))));
            for c in 0..4 {
                pair[c].store(&mut pairs[c], place(ci + 1, 0));
            }
        }
        for (k, i, to) in [(3, LAST, 0), (5, 0, SIDE + 1)] {
            let column = from(k);
            for cj in 0..2 {
                let words = each!([0, 1], |w| {
                    let at = slot(i, cj);
                    V::index_from(each!([0, 1, 2, 3, 4, 5, 6, 7], |n| column[w][at + n * (SIDE / 2)]))
                });
                for (c, x) in decode::<V>(words).into_iter().enumerate() {
                    for (n, x) in x.to_array().into_iter().enumerate() {
                        pairs[c][place(to, cj + 1) + 9 * n] = x;
                    }
                }
            }
        }
        for (k, at, to) in [
            (0, slot(LAST, LAST), place(0, 0)),
            (2, slot(0, LAST), place(SIDE + 1, 0)),
            (6, slot(LAST, 0), place(0, SIDE + 1)),
            (8, slot(0, 0), place(SIDE + 1, SIDE + 1)),
        ] {
            for (c, x) in decode_one(from(k).map(|plane| plane[at])).into_iter().enumerate() {
                pairs[c][to] = x;
            }
        }
    }
}

/// Completes a level's rows, of which the owned pairs and the sums are there: the halo's pairs and the diagonals. With a
/// coarser level, the product becomes A P 1, of which that level makes the sums of its own rows; the direction is used.
pub fn finish(run: &Run, level: usize, system: &mut SolvingLevel, coarser: bool) {
    let grid = &run.grid.levels[level];
    if coarser {
        interpolated_ones(run, level, system.direction);
    }
    let Rows { diagonal, words, ring } = &mut *system.rows;
    let (diagonal, ring, t) =
        (SharedSlice::new(diagonal), SharedSlice::new(ring), SharedSlice::new(system.product));
    let (words, z) = (&*words, &*system.direction);
    run.each_block(level, |worker, b, _| {
        prefetch(&words[b]);
        let around = super::multigrid::masked(grid, b);
        let mut ones: Window = [0.0; WINDOW_NODES];
        if coarser {
            window::load(&around, 0.0, |b| &z[b][0], &mut ones);
        }
        // SAFETY: each item has its own block.
        let (diagonal, ring) = unsafe { (diagonal.get_mut(b), ring.get_mut(b)) };
        *ring = ring_of(words, &around);
        // SAFETY: as above.
        let given = coarser.then(|| (&ones, unsafe { t.get_mut(b) }));
        let (words, ring, movable) = (&words[b], &*ring, &grid.movable[b]);
        run.pairs.with(worker, |pairs| wide(Finish { words, ring, movable, pairs, diagonal, given }));
    });
}

/// The words of a block's ring, from the blocks in which its nodes lie.
fn ring_of(words: &[Words], around: &[u32; 9]) -> Ring {
    let mut ring = [[0; GROUPS.len() * LANES + CORNERS.len()]; 2];
    for (g, &Group { edge, from, slot: [first, step], .. }) in GROUPS.iter().enumerate() {
        if around[from] != NONE {
            let from = &words[around[from] as usize][edge];
            for (ring, from) in ring.iter_mut().zip(from) {
                for k in 0..LANES {
                    ring[g * LANES + k] = from[first + k * step];
                }
            }
        }
    }
    for (n, &[edge, from, slot, _]) in CORNERS.iter().enumerate() {
        if around[from] != NONE {
            let from = &words[around[from] as usize][edge];
            for (ring, from) in ring.iter_mut().zip(from) {
                ring[GROUPS.len() * LANES + n] = from[slot];
            }
        }
    }
    ring
}

/// The first plane of `z` becomes P 1: 1 where all that a node is interpolated from may move, less elsewhere.
fn interpolated_ones(run: &Run, level: usize, z: &mut [[Plane; 2]]) {
    let (fine, coarse) = (&run.grid.levels[level], &run.grid.levels[level + 1]);
    let movable = |b: usize| &coarse.movable[b];
    let z = SharedSlice::new(z);
    run.each_block(level, |_, b, _| {
        // SAFETY: each item has its own block.
        let ones = unsafe { &mut z.get_mut(b)[0] };
        *ones = [0.0; NODES];
        let weights = constants::interpolation(fine, &fine.blocks.neighbours[b]);
        super::multigrid::add_interpolated(run, level, b, &weights, movable, ones);
    });
}

/// One block's diagonals from its sums, and what it gives to the coarser level.
struct Finish<'a> {
    words: &'a Words,
    ring: &'a Ring,
    movable: &'a Plane<u8>,
    pairs: &'a mut Pairs,
    diagonal: &'a mut [Plane; 3],
    /// P 1, and where A P 1 goes.
    given: Option<(&'a Window, &'a mut [Plane; 3])>,
}

impl Kernel for Finish<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let Finish { words, ring, movable, pairs, diagonal, mut given } = self;
        BlockRows { diagonal, words, ring }.pairs::<V>(pairs);
        for row in Row::all() {
            let sums = each!([0, 1, 2], |c| row.of::<V>(&diagonal[c]));
            let lanes = V::zero().lt(V::load_u8(movable, row.slot()));
            let mut own = sums;
            each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                let pair = symmetric_part::<V>(pairs, row, k);
                for c in 0..3 {
                    own[c] -= pair[c];
                }
            });
            for c in 0..3 {
                // The identity at fixed nodes, so that nothing divides by zero.
                let identity = if c == 1 { V::zero() } else { V::one() };
                row.set(&mut diagonal[c], lanes.select(own[c], identity));
            }
            if let Some((ones, t)) = &mut given {
                let here = row.near::<V>(ones, 0, 0);
                let mut product = each!([0, 1, 2], |c| sums[c] * here);
                each!([0, 1, 2, 3, 4, 5, 6, 7], |k| {
                    let (di, dj, ..) = NEIGHBOURS[k];
                    let more = row.near::<V>(ones, di, dj) - here;
                    let pair = symmetric_part::<V>(pairs, row, k);
                    for c in 0..3 {
                        product[c] += pair[c] * more;
                    }
                });
                for c in 0..3 {
                    row.set(&mut t[c], lanes.select(product[c], V::zero()));
                }
            }
        }
    }
}

/// (xx, xy, yy) of the symmetric part of the pairs of a row's nodes with neighbour `k`.
#[inline(always)]
fn symmetric_part<V: Lanes>(pairs: &Pairs, row: Row, k: usize) -> [V; 3] {
    let (di, dj, e, theirs) = NEIGHBOURS[k];
    let (oi, oj) = if theirs { (di, dj) } else { (0, 0) };
    let [xx, xy, yx, yy] = each!([0, 1, 2, 3], |c| row.near::<V>(&pairs[4 * e + c], oi, oj));
    [xx, (xy + yx) * 0.5, yy]
}
