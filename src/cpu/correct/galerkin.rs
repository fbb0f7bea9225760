//! The coarser level's system: Pᵀ A P with bilinear P, again 9-point and symmetric.

use std::sync::OnceLock;

use super::super::lanes::{Kernel, LANES, Lanes, each};
use super::super::patch::NEIGHBOURS;
use super::*;
use crate::mesh::NONE;
use crate::tile::EDGES;
use crate::tile::blocks::{SIDE, slot};
use crate::tile::halo::{self, Window, place};

/// Nodes -2..=17 of a fine block on each side, as four colour planes of 10x10.
const WIDE: usize = SIDE + 4;
const WIDE_NODES: usize = WIDE * WIDE;

const fn wide_place(i: usize, j: usize) -> usize {
    ((j & 1) * 2 + (i & 1)) * (WIDE_NODES / 4) + (j >> 1) * (WIDE / 2) + (i >> 1)
}

/// Numbers of a wide window: pairs (16), then diagonals (3).
const WIDE_PLANES: usize = 19;
type Wide = [[f32; WIDE_NODES]; WIDE_PLANES];

/// The terms of one entry. A plain array: a vector in a static would be left behind when the library is unloaded.
struct Terms {
    list: [Term; 81],
    count: usize,
}

/// One term of a coarse entry: `factor` times the 2x2 block that lies at these places of the wide window, seen flat, for
/// the first row of coarse nodes.
#[derive(Clone, Copy, Default)]
struct Term {
    at: [u16; 4],
    factor: f32,
}

/// The terms of the five stored entries of a coarse row: the four owned edges, then the diagonal.
fn terms() -> [&'static [Term]; 5] {
    static TERMS: OnceLock<[Terms; 5]> = OnceLock::new();
    let all = TERMS.get_or_init(|| {
        let hat = |d: i64| [1.0f32, 0.5].get(d.unsigned_abs() as usize).copied().unwrap_or(0.0);
        std::array::from_fn(|entry| {
            let (ci, cj) = if entry < 4 { EDGES[entry] } else { (0, 0) };
            let mut terms = Terms { list: [Term::default(); 81], count: 0 };
            for fj in -1i64..=1 {
                for fi in -1i64..=1 {
                    let own = hat(fi) * hat(fj);
                    let mut add = |gi: i64, gj: i64, edge: usize, theirs| {
                        let factor = own * hat(gi - 2 * ci) * hat(gj - 2 * cj);
                        if factor > 0.0 {
                            let (di, dj) = if theirs { (gi, gj) } else { (fi, fj) };
                            let k = 4 * edge;
                            let planes = match (edge, theirs) {
                                (4, _) => [16, 17, 17, 18],
                                (_, true) => [k, k + 2, k + 1, k + 3],
                                (_, false) => [k, k + 1, k + 2, k + 3],
                            };
                            let place = wide_place((2 + di) as usize, (2 + dj) as usize);
                            let at = planes.map(|plane| (plane * WIDE_NODES + place) as u16);
                            terms.list[terms.count] = Term { at, factor };
                            terms.count += 1;
                        }
                    };
                    add(fi, fj, 4, false);
                    for &(di, dj, e, theirs) in &NEIGHBOURS {
                        add(fi + di, fj + dj, e, theirs);
                    }
                }
            }
            terms
        })
    });
    all.each_ref().map(|terms| &terms.list[..terms.count])
}

/// Builds the rows of level `finer + 1` from those of `finer`.
pub fn restrict(run: &Run, finer: usize, fine: &System, coarse: &mut System) {
    let (fine_level, level) = (&run.grid.levels[finer], &run.grid.levels[finer + 1]);
    let rows = Shared::new(&mut coarse.rows);
    // First each block's own nodes, then the copies of the pairs that lie on its ring.
    run.each_block(finer + 1, |b, _| {
        // SAFETY: each item has its own block.
        let out = unsafe { rows.get_mut(b) };
        *out = Rows::default();
        let mut wide: Wide = [[0.0; WIDE_NODES]; WIDE_PLANES];
        let mut movable = [0; WINDOW_NODES];
        halo::load(&level.blocks.around[b], 0, |b| &level.movable[b], &mut movable);
        for (quarter, &child) in level.children[b].iter().enumerate() {
            if child != NONE && fine_level.blocks.list[child as usize].active {
                gather(&super::multigrid::masked(fine_level, child as usize), &fine.rows, &mut wide);
                super::super::lanes::wide(QuarterRows { wide: &wide, movable: &movable, quarter, out });
            }
        }
        for s in 0..NODES {
            if level.movable[b][s] == 0 {
                out.diagonal[0][s] = 1.0;
                out.diagonal[2][s] = 1.0;
            }
        }
    });
    run.each_block(finer + 1, |b, _| {
        // SAFETY: items write places on the ring, which no item reads, and read own places, which none writes.
        unsafe { copy_ring(rows, &super::multigrid::masked(level, b)) };
    });
}

/// Copies the rows of a fine block and its surroundings side by side.
fn gather(around: &[u32; 9], rows: &[Rows], wide: &mut Wide) {
    for j in 0..WIDE {
        let (bj, y) = ((j + SIDE - 2) / SIDE, (j + SIDE - 2) % SIDE);
        let [west, own, east]: [Option<&Rows>; 3] = std::array::from_fn(|bi| match around[bj * 3 + bi] {
            NONE => None,
            b => Some(&rows[b as usize]),
        });
        // A row of one parity: one node of the west, eight of the middle, one of the east.
        for ci in 0..2 {
            let to = wide_place(ci, j);
            for (k, wide) in wide.iter_mut().enumerate() {
                let at = |rows: Option<&Rows>, x: usize| {
                    rows.map_or(0.0, |rows| match k {
                        0..16 => rows.pair[k][place(x + 1, y + 1)],
                        _ => rows.diagonal[k - 16][slot(x, y)],
                    })
                };
                wide[to] = at(west, SIDE - 2 + ci);
                wide[to + 9] = at(east, ci);
                let middle = &mut wide[to + 1..to + 9];
                match own {
                    None => middle.fill(0.0),
                    Some(rows) if k < 16 => {
                        let from = place(ci + 1, y + 1);
                        middle.copy_from_slice(&rows.pair[k][from..from + LANES]);
                    }
                    Some(rows) => {
                        let from = slot(ci, y);
                        middle.copy_from_slice(&rows.diagonal[k - 16][from..from + LANES]);
                    }
                }
            }
        }
    }
}

/// The 8x8 coarse nodes over one fine block, a row of eight at a time.
struct QuarterRows<'a> {
    wide: &'a Wide,
    movable: &'a Window<u8>,
    quarter: usize,
    out: &'a mut Rows,
}

impl Kernel for QuarterRows<'_> {
    type Output = ();

    #[inline(always)]
    fn run<V: Lanes>(self) {
        quarter_rows::<V>(self.wide, self.movable, self.quarter, self.out);
    }
}

#[inline(always)]
fn quarter_rows<V: Lanes>(wide: &Wide, movable: &Window<u8>, quarter: usize, out: &mut Rows) {
    let (x, y) = (quarter % 2 * LANES, quarter / 2 * LANES);
    let wide = wide.as_flattened();
    for j in 0..LANES {
        // One row of coarse nodes is two of fine ones: the next row of the same parity.
        let wide = &wide[j * (WIDE / 2)..];
        for (entry, terms) in terms().into_iter().enumerate() {
            let mut sum = [V::zero(); 4];
            for term in terms {
                for c in 0..4 {
                    sum[c] += V::load(wide, usize::from(term.at[c])) * term.factor;
                }
            }
            let sum = each!([0, 1, 2, 3], |c| sum[c].to_array());
            for lane in 0..LANES {
                let (i, j) = (x + lane, y + j);
                let (di, dj) = if entry < 4 { EDGES[entry] } else { (0, 0) };
                // Only pairs of movable nodes: the others take no part.
                let far = place((i as i64 + 1 + di) as usize, (j as i64 + 1 + dj) as usize);
                if movable[place(i + 1, j + 1)] == 0 || movable[far] == 0 {
                    continue;
                }
                if entry == 4 {
                    for (c, from) in [0, 1, 3].into_iter().enumerate() {
                        out.diagonal[c][slot(i, j)] = sum[from][lane];
                    }
                } else {
                    for c in 0..4 {
                        out.pair[4 * entry + c][place(i + 1, j + 1)] = sum[c][lane];
                    }
                }
            }
        }
    }
}

/// Copies the pairs between a block and its ring that the ring's nodes own.
///
/// # Safety
/// No item writes the own nodes' places of any block now, nor the ring of this one.
unsafe fn copy_ring(rows: Shared<Rows>, around: &[u32; 9]) {
    let b = around[4] as usize;
    let copy = |i: usize, j: usize, e: usize| {
        let (bi, bj) = (i.div_ceil(SIDE), j.div_ceil(SIDE));
        let (x, y) = ((i + SIDE - 1) % SIDE, (j + SIDE - 1) % SIDE);
        let from = around[bj * 3 + bi];
        for c in 4 * e..4 * e + 4 {
            // SAFETY: the caller's promise; no reference to the whole of another item's rows is made.
            unsafe {
                let to = &raw mut (*rows.pointer(b)).pair[c][place(i, j)];
                to.write(match from {
                    NONE => 0.0,
                    from => (&raw const (*rows.pointer(from as usize)).pair[c][place(x + 1, y + 1)]).read(),
                });
            }
        }
    };
    for k in 0..SIDE + 2 {
        for e in 0..4 {
            // West, south (corners in both: the same value twice), east; no node of the north owns a pair with the block.
            copy(0, k, e);
            copy(k, 0, e);
            copy(17, k, e);
        }
    }
}
