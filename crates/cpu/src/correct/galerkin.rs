//! The coarser level's matrix (method §7.4): the Galerkin product Pᵀ A P, again with nine points and symmetric. P
//! interpolates along x and then along y, with the weights of `grid/interpolation.rs`. The product is formed along x
//! for each row of fine nodes, and then along y, which takes a third of the operations of forming the whole stencil at
//! once.

use super::super::decode::interpolation;
use super::super::lanes::{LANES, Lanes, Vectorised, dispatch, each};
use super::super::prefetch::prefetch;
use super::super::run::Run;
use super::rows::{WordWindows, Words, decode, decode_one, encode};
use super::transfer::{RestrictQuarter, active_neighbours};
use super::workspace::SolvingLevel;
use vrtm_core::grid::codes::decode_weight;
use vrtm_core::grid::planes::{EDGES, NODES, Plane, SIDE, slot};
use vrtm_core::grid::window::{self, Window, place};
use vrtm_core::mesh::NONE;
use vrtm_core::team::SharedSlice;

/// Forms the owned pairs of level `finer + 1` from the rows of `finer`, and its row sums from the product A P 1 that
/// `complete` stored on `finer`.
pub fn triple_product(run: &Run, finer: usize, fine: &SolvingLevel, coarse: &mut SolvingLevel) {
    let (fine_level, level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    coarse.rows.is_uniform.fill(false);
    let (sums, words) =
        (SharedSlice::new(&mut coarse.rows.diagonal), SharedSlice::new(&mut coarse.rows.words));
    let next = |b: usize| {
        for &child in level.children[b].iter().filter(|&&child| child != NONE) {
            fine.rows.prefetch(child as usize);
            prefetch(&fine.product[child as usize]);
        }
    };
    run.each_block(finer + 1, next, |worker, b, _| {
        // SAFETY: each item has its own block.
        let (sums, words) = unsafe { (sums.get_mut(b), words.get_mut(b)) };
        *sums = [[0.0; NODES]; 3];
        *words = [[[0; NODES]; 2]; 4];
        let movable = window::of(&level.blocks.neighbours[b], 0, |b| &level.movable[b]);
        for (quarter, &child) in level.children[b].iter().enumerate() {
            if child == NONE || !fine_level.blocks.list[child as usize].active {
                continue;
            }
            let neighbours = active_neighbours(fine_level, child as usize);
            let weights = interpolation(fine_level, &neighbours);
            let windows = &window::planes(&neighbours, |b, c| &fine.product[b][c]);
            let (weights, movable_here) = (&weights, &level.movable[b]);
            dispatch(RestrictQuarter { windows, weights, movable: movable_here, quarter, r: sums });
            run.words.with(worker, |windows| {
                let neighbour = |k: usize| (neighbours[k] != NONE).then(|| neighbours[k] as usize);
                let diagonals = [0, 1, 3, 4].map(|k| neighbour(k).map(|b| &fine.rows.diagonal[b]));
                for (e, windows) in windows.iter_mut().enumerate() {
                    for (w, window) in windows.iter_mut().enumerate() {
                        window::load(&neighbours, 0, |b| &fine.rows.words_of(b)[e][w], window);
                    }
                }
                dispatch(QuarterPairs {
                    pairs: windows,
                    diagonals,
                    west: neighbour(3).map(|b| (&fine_level.interpolation[b], &fine.rows.words_of(b)[0])),
                    weights,
                    movable: &movable,
                    quarter,
                    words,
                });
            });
        }
    });
}

/// Forms the pairs that the 8x8 coarse nodes over one fine block own, a row of eight nodes at a time.
struct QuarterPairs<'a> {
    /// The encoded pairs of the fine block.
    pairs: &'a WordWindows,
    /// The diagonal blocks of the fine blocks to the south-west, south and west, and of the fine block itself.
    diagonals: [Option<&'a [Plane; 3]>; 4],
    weights: &'a Window,
    /// The interpolation weights of the fine block to the west, and its pairs along edges to the east.
    west: Option<(&'a Plane<u8>, &'a [Plane<u32>; 2])>,
    movable: &'a Window<u8>,
    quarter: usize,
    /// The encoded pairs of the coarse block.
    words: &'a mut Words,
}

/// A row-major 2x2 block per lane.
type Matrix<V> = [V; 4];

/// The product along x for one row of fine nodes, at eight coarse columns I: the blocks that couple column I of this
/// row with itself, and with its neighbours to the east, north, north-east and north-west.
#[derive(Clone, Copy)]
struct XProduct<V> {
    diagonal: Matrix<V>,
    east: Matrix<V>,
    north: Matrix<V>,
    north_east: Matrix<V>,
    north_west: Matrix<V>,
    /// `north_west` of column I + 1.
    next_north_west: Matrix<V>,
    /// `east` of column I - 1. It is not used for a block's row -1.
    previous_east: Matrix<V>,
}

impl Vectorised for QuarterPairs<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let (pairs, weights) = (self.pairs, self.weights);
        let [south_west, south, west, centre] = self.diagonals;
        let (weights_of_west, east_of_west) = self.west.unzip();
        // Row -1 lies in the blocks to the south, but its pairs are also in this block's halo.
        let mut below = x_product::<V>(pairs, weights, 0, [south, south_west], None, SIDE - 1);
        for j in 0..LANES {
            let middle = x_product::<V>(pairs, weights, 2 * j + 1, [centre, west], east_of_west, 2 * j);
            let above = x_product::<V>(pairs, weights, 2 * j + 2, [centre, west], east_of_west, 2 * j + 1);
            let product = y_product(&below, &middle, &above, &YWeights::new(weights, weights_of_west, j));
            store_pairs::<V>(&product, j, self.movable, self.quarter, self.words);
            below = above;
        }
    }
}

/// The product along x for row `w` of the window, which is row `y` of the fine blocks whose diagonals are `centre` and
/// `west`. `east_of_west` holds the western block's pairs along edges to the east, if they are needed.
#[inline(always)]
fn x_product<V: Lanes>(
    fine: &WordWindows,
    weights: &Window,
    w: usize,
    [centre, west]: [Option<&[Plane; 3]>; 2],
    east_of_west: Option<&[Plane<u32>; 2]>,
    y: usize,
) -> XProduct<V> {
    const ZEROS: Plane = [0.0; NODES];
    // Fine columns 2I - 1 (l), 2I (c), 2I + 1 (r) and 2I + 2 (n).
    let (l, c, r, n) = (place(0, w), place(1, w), place(2, w), place(3, w));
    let diagonal = each!([0, 1, 2], |k| centre.map_or(&ZEROS, |diagonal| &diagonal[k]));
    let (even, odd) = (slot(0, y), slot(1, y));
    let dc = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], even)));
    let dr = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], odd)));
    let dl = symmetric(each!([0, 1, 2], |k| {
        let first = west.map_or(0.0, |diagonal| diagonal[k][slot(SIDE - 1, y)]);
        with_first(V::load(diagonal[k], odd - 1), first)
    }));
    let (el, ec, er) = (pairs::<V>(fine, 0, l), pairs::<V>(fine, 0, c), pairs::<V>(fine, 0, r));
    let (nl, nc, nr) = (pairs::<V>(fine, 1, l), pairs::<V>(fine, 1, c), pairs::<V>(fine, 1, r));
    let (nel, nec, ner) = (pairs::<V>(fine, 2, l), pairs::<V>(fine, 2, c), pairs::<V>(fine, 2, r));
    let (nwl, nwc, nwr) = (pairs::<V>(fine, 3, l), pairs::<V>(fine, 3, c), pairs::<V>(fine, 3, r));
    let nwn = pairs::<V>(fine, 3, n);
    // Column -2 is two columns into the block to the west.
    let first =
        east_of_west.map_or([0.0; 4], |words| decode_one([0, 1].map(|w| words[w][slot(SIDE - 2, y)])));
    let before = pairs::<V>(fine, 0, c - 1);
    let east_before = each!([0, 1, 2, 3], |k| with_first(before[k], first[k]));
    // Weights of the fine columns 2I - 1 and 2I + 1 for the lower of their two coarse columns, in this row and the
    // next.
    let (l_north, r_north) = (place(0, w + 1), place(2, w + 1));
    let [wl, wr, wl_north, wr_north] = each!([0, 1, 2, 3], |k| V::load(weights, [l, r, l_north, r_north][k]));
    // Weights of the same fine columns for the upper of their two coarse columns.
    let (lw, lw_north) = (V::one() - wl, V::one() - wl_north);
    let (rw, rw_north) = (V::one() - wr, V::one() - wr_north);
    XProduct {
        diagonal: each!([0, 1, 2, 3], |k| {
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
        previous_east: each!([0, 1, 2, 3], |k| east_before[k] * lw + el[k] * wl + dl[k] * (wl * lw)),
    }
}

/// For each entry of a row-major 2x2 block, its index in the transpose.
const TRANSPOSED: [usize; 4] = [0, 2, 1, 3];

/// Interpolation weights of the fine rows 2J - 1 (below) and 2J + 1 (above) for coarse row J, at the columns I, I + 1
/// (east) and I - 1 (west).
struct YWeights<V> {
    below: V,
    below_east: V,
    above: V,
    above_east: V,
    above_west: V,
}

impl<V: Lanes> YWeights<V> {
    #[inline(always)]
    fn new(weights: &Window, west: Option<&Plane<u8>>, j: usize) -> YWeights<V> {
        let (below, above) = (2 * j, 2 * j + 2);
        let first = west.map_or(0.0, |west| decode_weight(west[slot(SIDE - 2, 2 * j + 1)]));
        YWeights {
            below: V::one() - V::load(weights, place(1, below)),
            below_east: V::one() - V::load(weights, place(3, below)),
            above: V::load(weights, place(1, above)),
            above_east: V::load(weights, place(3, above)),
            above_west: with_first(V::load(weights, place(1, above) - 1), first),
        }
    }
}

/// The product along y at coarse row J: the pairs to the east, north, north-east and north-west. `below`, `middle` and
/// `above` are the fine rows 2J - 1, 2J and 2J + 1.
#[inline(always)]
fn y_product<V: Lanes>(
    below: &XProduct<V>,
    middle: &XProduct<V>,
    above: &XProduct<V>,
    weights: &YWeights<V>,
) -> [Matrix<V>; 4] {
    let (b, a) = (weights.below, weights.above);
    // Weights of fine row 2J + 1 for coarse row J + 1.
    let rest = V::one() - a;
    let (rest_east, rest_west) = (V::one() - weights.above_east, V::one() - weights.above_west);
    let east = each!([0, 1, 2, 3], |k| {
        let t = TRANSPOSED[k];
        middle.east[k]
            + (below.east[k] * (b * weights.below_east) + above.east[k] * (a * weights.above_east))
            + (below.north_east[k] * b + middle.north_east[k] * weights.above_east)
            + (below.next_north_west[t] * weights.below_east + middle.next_north_west[t] * a)
    });
    let north =
        each!([0, 1, 2, 3], |k| middle.north[k] * rest + above.north[k] * a + above.diagonal[k] * (a * rest));
    let north_east = each!([0, 1, 2, 3], |k| {
        middle.north_east[k] * rest_east + above.north_east[k] * a + above.east[k] * (a * rest_east)
    });
    let north_west = each!([0, 1, 2, 3], |k| {
        let west = above.previous_east[TRANSPOSED[k]];
        middle.north_west[k] * rest_west + above.north_west[k] * a + west * (a * rest_west)
    });
    [east, north, north_east, north_west]
}

/// The pairs along owned edge `e` of the eight nodes from place `at` of the window on.
#[inline(always)]
fn pairs<V: Lanes>(words: &WordWindows, e: usize, at: usize) -> Matrix<V> {
    decode::<V>(each!([0, 1], |w| V::load_index(&words[e][w], at)))
}

/// The row-major 2x2 block of a symmetric (xx, xy, yy).
#[inline(always)]
fn symmetric<V: Lanes>([xx, xy, yy]: [V; 3]) -> Matrix<V> {
    [xx, xy, xy, yy]
}

/// `v` with its first lane replaced by `first`.
#[inline(always)]
fn with_first<V: Lanes>(v: V, first: f32) -> V {
    let mut lanes = v.to_array();
    lanes[0] = first;
    V::from_array(lanes)
}

/// Encodes and stores the pairs of a row of coarse nodes, which are in the order of `EDGES`.
#[inline(always)]
fn store_pairs<V: Lanes>(
    pairs: &[Matrix<V>; 4],
    row: usize,
    movable: &Window<u8>,
    quarter: usize,
    words: &mut Words,
) {
    let (x, j) = (quarter % 2 * LANES, quarter / 2 * LANES + row);
    for (e, &pair) in pairs.iter().enumerate() {
        let (di, dj) = EDGES[e];
        let pair = encode::<V>(pair).map(V::index_to_array);
        for lane in 0..LANES {
            let i = x + lane;
            // Pairs with a fixed node stay 0.
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            if movable[place(i + 1, j + 1)] != 0 && movable[far] != 0 {
                for w in 0..2 {
                    words[e][w][slot(i, j)] = pair[w][lane];
                }
            }
        }
    }
}
