//! The coarser level's system: Pᵀ A P, again 9-point and symmetric. P is linear in x, then in y, each with the weights of
//! `tile/interpolation.rs`: the product is formed row by row in x, and then between rows, which takes a third of the
//! operations of the whole stencil at once.

use super::super::lanes::{Kernel, LANES, Lanes, each, wide};
use super::multigrid::{RestrictQuarter, masked};
use super::rows::{BlockRows, Pairs, Words, decode_one, encode, ring_pairs};
use super::*;
use crate::cpu::constants::interpolation;
use crate::mesh::NONE;
use crate::tile::EDGES;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::codes::of_weight;
use crate::tile::window::{self, Window, place};

/// Forms the owned pairs and the sums of the rows of level `finer + 1` from the rows of `finer`, and from the product A P 1
/// that `rows::finish` left there.
pub fn restrict(run: &Run, finer: usize, fine: &SolvingLevel, coarse: &mut SolvingLevel) {
    let (fine_level, level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let (sums, words) =
        (SharedSlice::new(&mut coarse.rows.diagonal), SharedSlice::new(&mut coarse.rows.words));
    run.each_block(finer + 1, |worker, b, _| {
        // SAFETY: each item has its own block.
        let (sums, words) = unsafe { (sums.get_mut(b), words.get_mut(b)) };
        *sums = [[0.0; NODES]; 3];
        *words = [[[0; NODES]; 2]; 4];
        let mut movable = [0; WINDOW_NODES];
        window::load(&level.blocks.neighbours[b], 0, |b| &level.movable[b], &mut movable);
        for (quarter, &child) in level.children[b].iter().enumerate() {
            if child == NONE || !fine_level.blocks.list[child as usize].active {
                continue;
            }
            let around = masked(fine_level, child as usize);
            let weights = interpolation(fine_level, &around);
            let mut windows = [[0.0f32; WINDOW_NODES]; 3];
            for (c, window) in windows.iter_mut().enumerate() {
                window::load(&around, 0.0, |b| &fine.product[b][c], window);
            }
            let own = &level.movable[b];
            wide(RestrictQuarter { windows: &windows, weights: &weights, movable: own, quarter, r: sums });
            run.pairs.with(worker, |pairs| {
                let near = |k: usize| (around[k] != NONE).then(|| around[k] as usize);
                let diagonal = [0, 1, 3, 4].map(|k| near(k).map(|b| &fine.rows.diagonal[b]));
                wide(QuarterRows {
                    own: fine.rows.of(child as usize),
                    all: &fine.rows.words,
                    around: &around,
                    diagonal,
                    west: near(3).map(|b| (&fine_level.interpolation[b], &fine.rows.words[b][0])),
                    weights: &weights,
                    pairs,
                    movable: &movable,
                    quarter,
                    words,
                });
            });
        }
    });
}

/// The 8x8 coarse nodes over one fine block, a row of eight at a time.
struct QuarterRows<'a> {
    own: BlockRows<'a>,
    /// Pairs of all fine blocks, and which of them lie around.
    all: &'a [Words],
    around: &'a [u32; 9],
    /// Of the fine blocks to the south-west, south and west, and of the block itself.
    diagonal: [Option<&'a [Plane; 3]>; 4],
    weights: &'a Window,
    /// Weights and pairs to the east of the fine block to the west.
    west: Option<(&'a Plane<u8>, &'a [Plane<u32>; 2])>,
    pairs: &'a mut Pairs,
    movable: &'a Window<u8>,
    quarter: usize,
    words: &'a mut Words,
}

/// A row-major 2x2 block per lane.
type Block<V> = [V; 4];

/// A row of fine nodes after the product in x, at eight coarse columns I: what the coarse node has with itself, and with
/// the ones to the east, north, north-east and north-west.
#[derive(Clone, Copy)]
struct Line<V> {
    own: Block<V>,
    east: Block<V>,
    north: Block<V>,
    north_east: Block<V>,
    north_west: Block<V>,
    /// North-west of I + 1.
    next_north_west: Block<V>,
    /// East of I - 1; not asked for of a block's row -1.
    last_east: Block<V>,
}

impl Kernel for QuarterRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let QuarterRows { own, all, around, diagonal, weights, west: beside, pairs, movable, quarter, words } =
            self;
        ring_pairs::<V>(all, around, pairs);
        own.own_pairs::<V>(pairs);
        let [south_west, south, west, own] = diagonal;
        let east_of_west = beside.map(|(_, words)| words);
        // Row -1 lies in the blocks to the south, but its pairs are also on this block's ring.
        let mut below = line::<V>(pairs, weights, 0, [south, south_west], None, SIDE - 1);
        for j in 0..LANES {
            let middle = line::<V>(pairs, weights, 2 * j + 1, [own, west], east_of_west, 2 * j);
            let above = line::<V>(pairs, weights, 2 * j + 2, [own, west], east_of_west, 2 * j + 1);
            let in_y = InY::new(weights, beside.map(|(weights, _)| weights), j);
            put::<V>(&across_rows(&below, &middle, &above, &in_y), j, movable, quarter, words);
            below = above;
        }
    }
}

/// The product in x for the fine row at `w` of the window, which is row `y` of the blocks whose diagonals are `here` and
/// `west`.
#[inline(always)]
fn line<V: Lanes>(
    own: &Pairs,
    weights: &Window,
    w: usize,
    [here, west]: [Option<&[Plane; 3]>; 2],
    east_of_west: Option<&[Plane<u32>; 2]>,
    y: usize,
) -> Line<V> {
    const NOTHING: Plane = [0.0; NODES];
    // Columns 2I - 1, 2I, 2I + 1 and 2I + 2.
    let (l, c, r, n) = (place(0, w), place(1, w), place(2, w), place(3, w));
    let diagonal = each!([0, 1, 2], |k| here.map_or(&NOTHING, |diagonal| &diagonal[k]));
    let (even, odd) = (slot(0, y), slot(1, y));
    let dc = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], even)));
    let dr = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], odd)));
    let dl = symmetric(each!([0, 1, 2], |k| {
        let first = west.map_or(0.0, |diagonal| diagonal[k][slot(SIDE - 1, y)]);
        with_first(V::load(diagonal[k], odd - 1), first)
    }));
    let (el, ec, er) = (pairs::<V>(own, 0, l), pairs::<V>(own, 0, c), pairs::<V>(own, 0, r));
    let (nl, nc, nr) = (pairs::<V>(own, 1, l), pairs::<V>(own, 1, c), pairs::<V>(own, 1, r));
    let (nel, nec, ner) = (pairs::<V>(own, 2, l), pairs::<V>(own, 2, c), pairs::<V>(own, 2, r));
    let (nwl, nwc, nwr) = (pairs::<V>(own, 3, l), pairs::<V>(own, 3, c), pairs::<V>(own, 3, r));
    let nwn = pairs::<V>(own, 3, n);
    // Column -2 is two columns into the block to the west.
    let first =
        east_of_west.map_or([0.0; 4], |words| decode_one([0, 1].map(|w| words[w][slot(SIDE - 2, y)])));
    let east_before = each!([0, 1, 2, 3], |k| with_first(V::load(&own[k], c - 1), first[k]));
    // What columns 2I - 1 and 2I + 1 give to the lower one of the coarse columns next to them, on this row and the next.
    let (l_north, r_north) = (place(0, w + 1), place(2, w + 1));
    let [wl, wr, wl_north, wr_north] = each!([0, 1, 2, 3], |k| V::load(weights, [l, r, l_north, r_north][k]));
    // And to the upper one.
    let (lw, lw_north) = (V::one() - wl, V::one() - wl_north);
    let (rw, rw_north) = (V::one() - wr, V::one() - wr_north);
    Line {
        own: each!([0, 1, 2, 3], |k| {
            let t = TRANSPOSED[k];
            dc[k] + (dl[k] * lw * lw + dr[k] * wr * wr) + (el[k] + el[t]) * lw + (ec[k] + ec[t]) * wr
        }),
        east: each!([0, 1, 2, 3], |k| ec[k] * rw + er[k] * wr + dr[k] * (wr * rw)),
        north: each!([0, 1, 2, 3], |k| {
            nc[k]
                + (nl[k] * (lw * lw_north) + nr[k] * (wr * wr_north))
                + ((nel[k] * lw + nec[k] * wr_north) + (nwc[k] * lw_north + nwr[k] * wr))
        }),
        north_east: each!([0, 1, 2, 3], |k| nec[k] * rw_north + ner[k] * wr + nr[k] * (wr * rw_north)),
        north_west: each!([0, 1, 2, 3], |k| nwc[k] * wl_north + nwl[k] * lw + nl[k] * (lw * wl_north)),
        next_north_west: each!([0, 1, 2, 3], |k| nwn[k] * wr_north + nwr[k] * rw + nr[k] * (rw * wr_north)),
        last_east: each!([0, 1, 2, 3], |k| east_before[k] * lw + el[k] * wl + dl[k] * (wl * lw)),
    }
}

/// Where a row-major 2x2 block's numbers are in its transpose.
const TRANSPOSED: [usize; 4] = [0, 2, 1, 3];

/// What the fine rows 2J - 1 and 2J + 1 give to coarse row J, at columns I and the ones beside them.
struct InY<V> {
    below: V,
    below_east: V,
    above: V,
    above_east: V,
    above_west: V,
}

impl<V: Lanes> InY<V> {
    #[inline(always)]
    fn new(weights: &Window, west: Option<&Plane<u8>>, j: usize) -> InY<V> {
        let (below, above) = (2 * j, 2 * j + 2);
        let first = west.map_or(0.0, |west| of_weight(west[slot(SIDE - 2, 2 * j + 1)]));
        InY {
            below: V::one() - V::load(weights, place(1, below)),
            below_east: V::one() - V::load(weights, place(3, below)),
            above: V::load(weights, place(1, above)),
            above_east: V::load(weights, place(3, above)),
            above_west: with_first(V::load(weights, place(1, above) - 1), first),
        }
    }
}

/// The product in y, at coarse row J: east, north, north-east, north-west. `below`, `middle` and `above` are the fine
/// rows 2J - 1, 2J and 2J + 1.
#[inline(always)]
fn across_rows<V: Lanes>(below: &Line<V>, middle: &Line<V>, above: &Line<V>, in_y: &InY<V>) -> [Block<V>; 4] {
    let (b, a) = (in_y.below, in_y.above);
    // Of row 2J + 1, to the row above.
    let rest = V::one() - a;
    let (rest_east, rest_west) = (V::one() - in_y.above_east, V::one() - in_y.above_west);
    let east = each!([0, 1, 2, 3], |k| {
        let t = TRANSPOSED[k];
        middle.east[k]
            + (below.east[k] * (b * in_y.below_east) + above.east[k] * (a * in_y.above_east))
            + (below.north_east[k] * b + middle.north_east[k] * in_y.above_east)
            + (below.next_north_west[t] * in_y.below_east + middle.next_north_west[t] * a)
    });
    let north =
        each!([0, 1, 2, 3], |k| middle.north[k] * rest + above.north[k] * a + above.own[k] * (a * rest));
    let north_east = each!([0, 1, 2, 3], |k| {
        middle.north_east[k] * rest_east + above.north_east[k] * a + above.east[k] * (a * rest_east)
    });
    let north_west = each!([0, 1, 2, 3], |k| {
        let west = above.last_east[TRANSPOSED[k]];
        middle.north_west[k] * rest_west + above.north_west[k] * a + west * (a * rest_west)
    });
    [east, north, north_east, north_west]
}

/// The pairs along owned edge `e` of the window's nodes from `at` on.
#[inline(always)]
fn pairs<V: Lanes>(pairs: &Pairs, e: usize, at: usize) -> Block<V> {
    each!([0, 1, 2, 3], |c| V::load(&pairs[4 * e + c], at))
}

/// (xx, xy, yy) as a whole block.
#[inline(always)]
fn symmetric<V: Lanes>([xx, xy, yy]: [V; 3]) -> Block<V> {
    [xx, xy, xy, yy]
}

/// The same lanes with another first one.
#[inline(always)]
fn with_first<V: Lanes>(v: V, first: f32) -> V {
    let mut lanes = v.to_array();
    lanes[0] = first;
    V::from_array(lanes)
}

/// Stores a row of coarse pairs, in the order of `EDGES`.
#[inline(always)]
fn put<V: Lanes>(pairs: &[Block<V>; 4], row: usize, movable: &Window<u8>, quarter: usize, words: &mut Words) {
    let (x, j) = (quarter % 2 * LANES, quarter / 2 * LANES + row);
    for (e, &pair) in pairs.iter().enumerate() {
        let (di, dj) = EDGES[e];
        let pair = encode::<V>(pair).map(V::index_array);
        for lane in 0..LANES {
            let i = x + lane;
            // Only pairs of movable nodes: the others take no part.
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            if movable[place(i + 1, j + 1)] != 0 && movable[far] != 0 {
                for w in 0..2 {
                    words[e][w][slot(i, j)] = pair[w][lane];
                }
            }
        }
    }
}
