//! The coarser level's system: Pᵀ A P, again 9-point and symmetric. P is linear in x, then in y, each with the weights of
//! `tile/interpolation.rs`: the product is formed row by row in x, and then between rows, which takes a third of the
//! operations of the whole stencil at once.

use super::super::lanes::{Kernel, LANES, Lanes, each, wide};
use super::multigrid::masked;
use super::*;
use crate::mesh::NONE;
use crate::tile::EDGES;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::halo::{self, Window, place};

/// Builds the rows of level `finer + 1` from those of `finer`.
pub fn restrict(run: &Run, finer: usize, fine: &System, coarse: &mut System) {
    let (fine_level, level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let rows = Shared::new(&mut coarse.rows);
    // First each block's own nodes, then the copies of the pairs that lie on its ring.
    run.each_block(finer + 1, |b, _| {
        // SAFETY: each item has its own block.
        let out = unsafe { rows.get_mut(b) };
        *out = Rows::default();
        let mut movable = [0; WINDOW_NODES];
        halo::load(&level.blocks.around[b], 0, |b| &level.movable[b], &mut movable);
        let mut weights: Window = [0.0; WINDOW_NODES];
        for (quarter, &child) in level.children[b].iter().enumerate() {
            if child != NONE && fine_level.blocks.list[child as usize].active {
                let around = masked(fine_level, child as usize);
                let near = [0, 1, 3, 4].map(|k| match around[k] {
                    NONE => None,
                    b => Some(&fine.rows[b as usize]),
                });
                halo::load(&around, 0.0, |b| &fine_level.interpolation[b], &mut weights);
                let west = (around[3] != NONE).then(|| &fine_level.interpolation[around[3] as usize]);
                wide(QuarterRows { fine: near, weights: &weights, west, movable: &movable, quarter, out });
            }
        }
        for s in 0..NODES {
            if level.movable[b][s] == 0 {
                out.diagonal[0][s] = 1.0;
                out.diagonal[2][s] = 1.0;
            }
        }
    });
    copy_rings(run, finer + 1, rows);
}

/// The 8x8 coarse nodes over one fine block, a row of eight at a time.
struct QuarterRows<'a> {
    /// Of the fine blocks to the south-west, south and west, and of the block itself.
    fine: [Option<&'a Rows>; 4],
    /// Of the fine block, and of the one to the west.
    weights: &'a Window,
    west: Option<&'a Plane>,
    movable: &'a Window<u8>,
    quarter: usize,
    out: &'a mut Rows,
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
    /// East of I - 1.
    last_east: Block<V>,
}

impl Kernel for QuarterRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        let QuarterRows {
            fine: [south_west, south, west, own],
            weights,
            west: west_weights,
            movable,
            quarter,
            out,
        } = self;
        let Some(own) = own else { return };
        // Row -1 lies in the blocks to the south, but its pairs are also on this block's ring.
        let mut below = line::<V>(own, weights, 0, south, south_west, SIDE - 1);
        for j in 0..LANES {
            let middle = line::<V>(own, weights, 2 * j + 1, Some(own), west, 2 * j);
            let above = line::<V>(own, weights, 2 * j + 2, Some(own), west, 2 * j + 1);
            let in_y = InY::new(weights, west_weights, j);
            put::<V>(&across_rows(&below, &middle, &above, &in_y), j, movable, quarter, out);
            below = above;
        }
    }
}

/// The product in x for the fine row at `w` of the window, which is row `y` of the blocks `here` and `west` (where its
/// diagonals are).
#[inline(always)]
fn line<V: Lanes>(
    own: &Rows,
    weights: &Window,
    w: usize,
    here: Option<&Rows>,
    west: Option<&Rows>,
    y: usize,
) -> Line<V> {
    const NOTHING: Plane = [0.0; NODES];
    // Columns 2I - 1, 2I, 2I + 1 and 2I + 2.
    let (l, c, r, n) = (place(0, w), place(1, w), place(2, w), place(3, w));
    let diagonal = each!([0, 1, 2], |k| here.map_or(&NOTHING, |rows| &rows.diagonal[k]));
    let (even, odd) = (slot(0, y), slot(1, y));
    let dc = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], even)));
    let dr = symmetric(each!([0, 1, 2], |k| V::load(diagonal[k], odd)));
    let dl = symmetric(each!([0, 1, 2], |k| {
        let first = west.map_or(0.0, |rows| rows.diagonal[k][slot(SIDE - 1, y)]);
        with_first(V::load(diagonal[k], odd - 1), first)
    }));
    let (el, ec, er) = (pairs::<V>(own, 0, l), pairs::<V>(own, 0, c), pairs::<V>(own, 0, r));
    let (nl, nc, nr) = (pairs::<V>(own, 1, l), pairs::<V>(own, 1, c), pairs::<V>(own, 1, r));
    let (nel, nec, ner) = (pairs::<V>(own, 2, l), pairs::<V>(own, 2, c), pairs::<V>(own, 2, r));
    let (nwl, nwc, nwr) = (pairs::<V>(own, 3, l), pairs::<V>(own, 3, c), pairs::<V>(own, 3, r));
    let nwn = pairs::<V>(own, 3, n);
    let east_before = each!([0, 1, 2, 3], |k| {
        // Column -2 is two columns into the block to the west.
        let first = west.map_or(0.0, |rows| rows.pair[k][place(SIDE - 1, y + 1)]);
        with_first(V::load(&own.pair[k], c - 1), first)
    });
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
    fn new(weights: &Window, west: Option<&Plane>, j: usize) -> InY<V> {
        let (below, above) = (2 * j, 2 * j + 2);
        let first = west.map_or(0.0, |west| west[slot(SIDE - 2, 2 * j + 1)]);
        InY {
            below: V::one() - V::load(weights, place(1, below)),
            below_east: V::one() - V::load(weights, place(3, below)),
            above: V::load(weights, place(1, above)),
            above_east: V::load(weights, place(3, above)),
            above_west: with_first(V::load(weights, place(1, above) - 1), first),
        }
    }
}

/// The product in y, at coarse row J: own, east, north, north-east, north-west. `below`, `middle` and `above` are the fine
/// rows 2J - 1, 2J and 2J + 1.
#[inline(always)]
fn across_rows<V: Lanes>(below: &Line<V>, middle: &Line<V>, above: &Line<V>, in_y: &InY<V>) -> [Block<V>; 5] {
    let (b, a) = (in_y.below, in_y.above);
    // Of row 2J + 1, to the row above.
    let rest = V::one() - a;
    let (rest_east, rest_west) = (V::one() - in_y.above_east, V::one() - in_y.above_west);
    let own = each!([0, 1, 2, 3], |k| {
        let t = TRANSPOSED[k];
        middle.own[k]
            + (below.own[k] * b * b + above.own[k] * a * a)
            + (below.north[k] + below.north[t]) * b
            + (middle.north[k] + middle.north[t]) * a
    });
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
    [east, north, north_east, north_west, own]
}

/// The pairs along owned edge `e` of the window's nodes from `at` on.
#[inline(always)]
fn pairs<V: Lanes>(rows: &Rows, e: usize, at: usize) -> Block<V> {
    each!([0, 1, 2, 3], |c| V::load(&rows.pair[4 * e + c], at))
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

/// Stores a row of coarse entries, in the order of `EDGES`, then the diagonal.
#[inline(always)]
fn put<V: Lanes>(entries: &[Block<V>; 5], row: usize, movable: &Window<u8>, quarter: usize, out: &mut Rows) {
    let (x, j) = (quarter % 2 * LANES, quarter / 2 * LANES + row);
    for (entry, block) in entries.iter().enumerate() {
        let (di, dj) = if entry < 4 { EDGES[entry] } else { (0, 0) };
        let block = each!([0, 1, 2, 3], |c| block[c].to_array());
        for lane in 0..LANES {
            let i = x + lane;
            // Only pairs of movable nodes: the others take no part.
            let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
            if movable[place(i + 1, j + 1)] == 0 || movable[far] == 0 {
                continue;
            }
            if entry == 4 {
                for (c, from) in [0, 1, 3].into_iter().enumerate() {
                    out.diagonal[c][slot(i, j)] = block[from][lane];
                }
            } else {
                for c in 0..4 {
                    out.pair[4 * entry + c][place(i + 1, j + 1)] = block[c][lane];
                }
            }
        }
    }
}

/// Copies all pairs that nodes on a block's ring own from the blocks in which they lie, for all active blocks.
pub fn copy_rings(run: &Run, level: usize, rows: Shared<Rows>) {
    run.each_block(level, |b, _| {
        // SAFETY: items write places on the ring, which no item reads, and read own places, which none writes.
        unsafe { copy_ring(rows, &masked(&run.grid.levels[level], b)) };
    });
}

/// Some nodes of a block's ring, in a line: where they lie.
struct Segment {
    /// Which of the 3x3 blocks around.
    from: usize,
    /// Place of the first one in the block's window.
    to: [usize; 2],
    /// Place in the window of the block in which it lies.
    at: [usize; 2],
    extent: Extent,
}

/// The nodes that follow a segment's first.
enum Extent {
    /// None.
    Single,
    /// Every other one of a row: those of one colour, which lie side by side.
    Row,
    /// A whole column.
    Column,
}

impl Segment {
    const fn new(from: usize, to: [usize; 2], at: [usize; 2], extent: Extent) -> Segment {
        Segment { from, to, at, extent }
    }
}

/// The last place of a window on each side.
const LAST: usize = SIDE + 1;

/// South-west, south, south-east, west, east, north-west, north-east. No node of the north owns a pair with the block.
const RING: [Segment; 8] = [
    Segment::new(0, [0, 0], [SIDE, SIDE], Extent::Single),
    Segment::new(1, [1, 0], [1, SIDE], Extent::Row),
    Segment::new(1, [2, 0], [2, SIDE], Extent::Row),
    Segment::new(2, [LAST, 0], [1, SIDE], Extent::Single),
    Segment::new(3, [0, 1], [SIDE, 1], Extent::Column),
    Segment::new(5, [LAST, 1], [1, 1], Extent::Column),
    Segment::new(6, [0, LAST], [SIDE, 1], Extent::Single),
    Segment::new(8, [LAST, LAST], [1, 1], Extent::Single),
];

/// Copies all pairs that nodes on a block's ring own.
///
/// # Safety
/// No item writes the own nodes' places of any block now, nor the ring of this one.
unsafe fn copy_ring(rows: Shared<Rows>, around: &[u32; 9]) {
    static NOTHING: [[f32; WINDOW_NODES]; 16] = [[0.0; WINDOW_NODES]; 16];
    // SAFETY: only an address; no reference to the whole of another item's rows is made.
    let pairs = |b: u32| unsafe { &raw mut (*rows.pointer(b as usize)).pair }.cast::<f32>();
    let to = pairs(around[4]);
    for &Segment { from, to: [ti, tj], at: [fi, fj], ref extent } in &RING {
        let from = match around[from] {
            NONE => NOTHING.as_ptr().cast::<f32>(),
            b => pairs(b).cast_const(),
        };
        for c in 0..16 {
            let (first_to, first_from) = (place(ti, tj), place(fi, fj));
            // SAFETY: places of a window, in plane c of both; the caller's promise.
            unsafe {
                let (to, from) = (to.add(c * WINDOW_NODES), from.add(c * WINDOW_NODES));
                match extent {
                    Extent::Single => to.add(first_to).write(from.add(first_from).read()),
                    Extent::Row => to.add(first_to).copy_from_nonoverlapping(from.add(first_from), LANES),
                    Extent::Column => {
                        for j in 0..SIDE {
                            to.add(place(ti, tj + j)).write(from.add(place(fi, fj + j)).read());
                        }
                    }
                }
            }
        }
    }
}
