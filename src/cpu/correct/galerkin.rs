//! The coarser level's system: Pᵀ A P with bilinear P, again 9-point and symmetric. Bilinear is linear in x, then linear
//! in y: the product is formed row by row in x, and then between rows, which takes a third of the operations of the
//! whole stencil at once.

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
        for (quarter, &child) in level.children[b].iter().enumerate() {
            if child != NONE && fine_level.blocks.list[child as usize].active {
                let around = masked(fine_level, child as usize);
                let near = [0, 1, 3, 4].map(|k| match around[k] {
                    NONE => None,
                    b => Some(&fine.rows[b as usize]),
                });
                wide(QuarterRows { fine: near, movable: &movable, quarter, out });
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
        let QuarterRows { fine: [south_west, south, west, own], movable, quarter, out } = self;
        let Some(own) = own else { return };
        // Row -1 lies in the blocks to the south, but its pairs are also on this block's ring.
        let mut below = line::<V>(own, 0, south, south_west, SIDE - 1);
        for j in 0..LANES {
            let middle = line::<V>(own, 2 * j + 1, Some(own), west, 2 * j);
            let above = line::<V>(own, 2 * j + 2, Some(own), west, 2 * j + 1);
            put::<V>(&across_rows(&below, &middle, &above), j, movable, quarter, out);
            below = above;
        }
    }
}

/// The product in x for the fine row at `w` of the window, which is row `y` of the blocks `here` and `west` (where its
/// diagonals are).
#[inline(always)]
fn line<V: Lanes>(own: &Rows, w: usize, here: Option<&Rows>, west: Option<&Rows>, y: usize) -> Line<V> {
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
    Line {
        own: each!([0, 1, 2, 3], |k| {
            let t = TRANSPOSED[k];
            dc[k] + (dl[k] + dr[k]) * 0.25 + ((el[k] + el[t]) + (ec[k] + ec[t])) * 0.5
        }),
        east: each!([0, 1, 2, 3], |k| (ec[k] + er[k]) * 0.5 + dr[k] * 0.25),
        north: each!([0, 1, 2, 3], |k| {
            nc[k] + (nl[k] + nr[k]) * 0.25 + ((nel[k] + nec[k]) + (nwc[k] + nwr[k])) * 0.5
        }),
        north_east: each!([0, 1, 2, 3], |k| (nec[k] + ner[k]) * 0.5 + nr[k] * 0.25),
        north_west: each!([0, 1, 2, 3], |k| (nwc[k] + nwl[k]) * 0.5 + nl[k] * 0.25),
        next_north_west: each!([0, 1, 2, 3], |k| (nwn[k] + nwr[k]) * 0.5 + nr[k] * 0.25),
        last_east: each!([0, 1, 2, 3], |k| (east_before[k] + el[k]) * 0.5 + dl[k] * 0.25),
    }
}

/// Where a row-major 2x2 block's numbers are in its transpose.
const TRANSPOSED: [usize; 4] = [0, 2, 1, 3];

/// The product in y, at coarse row J: own, east, north, north-east, north-west. `below`, `middle` and `above` are the fine
/// rows 2J - 1, 2J and 2J + 1.
#[inline(always)]
fn across_rows<V: Lanes>(below: &Line<V>, middle: &Line<V>, above: &Line<V>) -> [Block<V>; 5] {
    let own = each!([0, 1, 2, 3], |k| {
        let t = TRANSPOSED[k];
        let between = (below.north[k] + below.north[t]) + (middle.north[k] + middle.north[t]);
        middle.own[k] + (below.own[k] + above.own[k]) * 0.25 + between * 0.5
    });
    let east = each!([0, 1, 2, 3], |k| {
        let t = TRANSPOSED[k];
        let up = below.north_east[k] + middle.north_east[k];
        let down = below.next_north_west[t] + middle.next_north_west[t];
        middle.east[k] + (below.east[k] + above.east[k]) * 0.25 + (up + down) * 0.5
    });
    let north = each!([0, 1, 2, 3], |k| (middle.north[k] + above.north[k]) * 0.5 + above.own[k] * 0.25);
    let north_east =
        each!([0, 1, 2, 3], |k| (middle.north_east[k] + above.north_east[k]) * 0.5 + above.east[k] * 0.25);
    let north_west = each!([0, 1, 2, 3], |k| {
        let west = above.last_east[TRANSPOSED[k]];
        (middle.north_west[k] + above.north_west[k]) * 0.5 + west * 0.25
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
    /// From one to the next.
    step: [usize; 2],
    count: usize,
}

impl Segment {
    const fn new(from: usize, to: [usize; 2], at: [usize; 2], step: [usize; 2], count: usize) -> Segment {
        Segment { from, to, at, step, count }
    }
}

/// The last place of a window on each side.
const LAST: usize = SIDE + 1;

/// South-west, south, south-east, west, east, north-west, north-east. Nodes of one colour follow one another, so x goes in
/// twos. No node of the north owns a pair with the block.
const RING: [Segment; 8] = [
    Segment::new(0, [0, 0], [SIDE, SIDE], [0, 0], 1),
    Segment::new(1, [1, 0], [1, SIDE], [2, 0], SIDE / 2),
    Segment::new(1, [2, 0], [2, SIDE], [2, 0], SIDE / 2),
    Segment::new(2, [LAST, 0], [1, SIDE], [0, 0], 1),
    Segment::new(3, [0, 1], [SIDE, 1], [0, 1], SIDE),
    Segment::new(5, [LAST, 1], [1, 1], [0, 1], SIDE),
    Segment::new(6, [0, LAST], [SIDE, 1], [0, 0], 1),
    Segment::new(8, [LAST, LAST], [1, 1], [0, 0], 1),
];

/// Copies all pairs that nodes on a block's ring own.
///
/// # Safety
/// No item writes the own nodes' places of any block now, nor the ring of this one.
unsafe fn copy_ring(rows: Shared<Rows>, around: &[u32; 9]) {
    let to = rows.pointer(around[4] as usize);
    for &Segment { from, to: [ti, tj], at: [fi, fj], step: [di, dj], count } in &RING {
        let from = match around[from] {
            NONE => None,
            b => Some(rows.pointer(b as usize)),
        };
        for c in 0..16 {
            for n in 0..count {
                // SAFETY: the caller's promise; no reference to the whole of another item's rows is made.
                unsafe {
                    let value = from.map_or(0.0, |from| {
                        (&raw const (*from).pair[c][place(fi + n * di, fj + n * dj)]).read()
                    });
                    (&raw mut (*to).pair[c][place(ti + n * di, tj + n * dj)]).write(value);
                }
            }
        }
    }
}
