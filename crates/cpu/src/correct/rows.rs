//! The storage of a level's matrix (method §7.2). The 2x2 block of each pair of neighbouring nodes is stored once, with
//! the node that owns the edge, as two words that each hold two numbers with 8 bits of mantissa. The rounding errors of
//! a pair are added to the diagonal blocks of both of its nodes, so that row sums stay exact. The force on a rigid
//! feature that moves as a whole is the sum of thousands of row sums; it must come from the feature's surroundings and
//! not from rounding.

use super::super::allocate::Allocator;
use super::super::lanes::{LANES, Lanes, each};
use super::super::prefetch::prefetch;
use super::super::row::Row;
use vrtm_core::allocation::Vec;
use vrtm_core::grid::codes::unpack_two;
use vrtm_core::grid::planes::{EDGES, NODES, Plane, SIDE, slot};
use vrtm_core::grid::window::{Window, place};
use vrtm_core::mesh::NONE;

/// The encoded pairs that a block's rows need, as in `Words`, in windows.
pub type WordWindows = [[Window<u32>; 2]; 4];

/// The encoded pairs that a block's nodes own: per owned edge, the two words of `encode`.
pub type Words = [[Plane<u32>; 2]; 4];

/// The encoded pairs between a block and its halo that nodes of the halo own, in the order of `HALO_GROUPS` and
/// `HALO_CORNERS`: a copy, so that a block's rows can be read without its neighbour blocks.
pub type Halo = [[u32; HALO_GROUPS.len() * LANES + HALO_CORNERS.len()]; 2];

/// The rows of all blocks of a level.
#[derive(Debug, Default)]
pub struct Rows {
    /// (xx, xy, yy) of the diagonal block per node. Until `complete`, the symmetric part of the row's sum.
    pub diagonal: Vec<[Plane; 3]>,
    /// Per block, true if all of its nodes have the same row: they and their neighbours are movable and elastic,
    /// nothing holds them, and no corner is crowded.
    pub is_uniform: Vec<bool>,
    /// Per block, its pairs. Where there are `FEWEST_BLOCKS`, one more element has the pairs of all uniform blocks.
    pub words: Vec<Words>,
    /// Per block, the pairs of its halo, with one more element likewise.
    pub halo: Vec<Halo>,
}

/// Fewest blocks of a level with uniform ones: fewer would hardly pay for the memory of one more.
const FEWEST_BLOCKS: usize = 64;

/// The row of each node of a uniform block: multiples of the unit matrix.
#[derive(Clone, Copy)]
pub struct UniformRow {
    pub diagonal: f32,
    /// The factors in pairs along axes and along diagonals.
    pub pairs: [f32; 2],
}

impl Rows {
    pub fn new(allocator: &mut Allocator, blocks: usize) -> Rows {
        let all = blocks + usize::from(blocks >= FEWEST_BLOCKS);
        Rows {
            diagonal: allocator.zeros(blocks),
            is_uniform: allocator.zeros(blocks),
            words: allocator.zeros(all),
            halo: allocator.zeros(all),
        }
    }

    /// Sets the pairs of uniform blocks, given the factors of the unit matrix along axes and along diagonals.
    pub fn set_uniform(&mut self, factors: [f32; 2]) {
        // As by `encode`.
        let words = factors.map(|factor| (factor.to_bits() + 0x8000) & 0xffff_0000);
        if let Some(uniform) = self.words.get_mut(self.is_uniform.len()) {
            *uniform = std::array::from_fn(|e| [[words[e / 2]; NODES]; 2]);
            self.halo[self.is_uniform.len()] = halo_words(|_| uniform, &[0; 9]);
        }
    }

    /// The element of `words` and `halo` for block `b`.
    #[inline(always)]
    fn element(&self, b: usize) -> usize {
        if self.is_uniform[b] { self.is_uniform.len() } else { b }
    }

    /// The pairs of block `b`.
    #[inline(always)]
    pub fn words_of(&self, b: usize) -> &Words {
        &self.words[self.element(b)]
    }

    /// The rows of block `b`.
    #[inline(always)]
    pub fn block(&self, b: usize) -> BlockRows<'_> {
        let (diagonal, words) = (&self.diagonal[b], self.words_of(b));
        let uniform = self.is_uniform[b].then(|| UniformRow {
            diagonal: diagonal[0][0],
            pairs: [0, 2].map(|e| unpack_two(words[e][0][0])[0]),
        });
        BlockRows { diagonal, words, halo: &self.halo[self.element(b)], uniform }
    }

    /// Prefetches the rows of the next block.
    #[inline(always)]
    pub fn prefetch(&self, b: usize) {
        if !self.is_uniform[b] {
            prefetch(&self.words[b]);
            prefetch(&self.halo[b]);
            prefetch(&self.diagonal[b]);
        }
    }
}

/// The rows of one block.
#[derive(Clone, Copy)]
pub struct BlockRows<'a> {
    pub diagonal: &'a [Plane; 3],
    pub words: &'a Words,
    pub halo: &'a Halo,
    /// The row of each node, if the block is uniform.
    pub uniform: Option<UniformRow>,
}

/// Encodes a row-major 2x2 block per lane as two words: (xx, xy), (yy, yx).
#[inline(always)]
pub fn encode<V: Lanes>([xx, xy, yx, yy]: [V; 4]) -> [V::Index; 2] {
    [V::pack_two(xx, xy), V::pack_two(yy, yx)]
}

/// Decodes the words of `encode` to row-major 2x2 blocks.
#[inline(always)]
pub fn decode<V: Lanes>([first, second]: [V::Index; 2]) -> [V; 4] {
    let ([xx, xy], [yy, yx]) = (V::unpack_two(first), V::unpack_two(second));
    [xx, xy, yx, yy]
}

/// `decode` for one node.
#[inline(always)]
pub fn decode_one(words: [u32; 2]) -> [f32; 4] {
    let [[xx, xy], [yy, yx]] = words.map(unpack_two);
    [xx, xy, yx, yy]
}

/// Eight nodes of a block's halo that own an edge into the block.
pub struct HaloGroup {
    /// Index of the edge in `EDGES`.
    edge: usize,
    /// Index of the 3x3 neighbour block that holds the nodes.
    neighbour: usize,
    /// First slot of the nodes in that block, and stride.
    slot: [usize; 2],
    /// First place of the nodes in the window, and stride.
    place: [usize; 2],
    /// First place of the edges' other ends.
    far: usize,
}

/// The place of an edge's other end, whose owner is the window's node (i, j).
const fn far(edge: usize, i: usize, j: usize) -> usize {
    place((i as i64 + EDGES[edge].0) as usize, (j as i64 + EDGES[edge].1) as usize)
}

/// Eight nodes of one colour in the southern row of the halo.
const fn south(edge: usize, ci: usize) -> HaloGroup {
    let (slot, far) = (slot(ci, SIDE - 1), far(edge, ci + 1, 0));
    HaloGroup { edge, neighbour: 1, slot: [slot, 1], place: [place(ci + 1, 0), 1], far }
}

/// Eight nodes of one colour in the western column of the halo.
const fn west(edge: usize, cj: usize) -> HaloGroup {
    let (slot, far) = (slot(SIDE - 1, cj), far(edge, 0, cj + 1));
    HaloGroup { edge, neighbour: 3, slot: [slot, SIDE / 2], place: [place(0, cj + 1), 9], far }
}

/// Eight nodes of one colour in the eastern column of the halo.
const fn east(edge: usize, cj: usize) -> HaloGroup {
    let (slot, far) = (slot(0, cj), far(edge, SIDE + 1, cj + 1));
    HaloGroup { edge, neighbour: 5, slot: [slot, SIDE / 2], place: [place(SIDE + 1, cj + 1), 9], far }
}

/// The halo's nodes that own an edge into the block, without the corners. Nodes of the northern row own no such edge.
const HALO_GROUPS: [HaloGroup; 12] = [
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

/// The halo's two corner nodes that own an edge into the block: edge, neighbour block, slot, place, place of the edge's
/// other end.
const HALO_CORNERS: [[usize; 5]; 2] = [
    [2, 0, slot(SIDE - 1, SIDE - 1), place(0, 0), far(2, 0, 0)],
    [3, 2, slot(0, SIDE - 1), place(SIDE + 1, 0), far(3, SIDE + 1, 0)],
];

impl BlockRows<'_> {
    /// Gathers the words of all pairs of the block's rows. The other entries of the halo in `words` are left unchanged.
    #[inline(always)]
    pub fn gather<V: Lanes>(&self, words: &mut WordWindows) {
        for row in Row::all() {
            for (windows, planes) in words.iter_mut().zip(self.words) {
                for w in 0..2 {
                    V::store_index(V::load_index(&planes[w], row.slot()), &mut windows[w], row.at(0, 0));
                }
            }
        }
        for (g, group) in HALO_GROUPS.iter().enumerate() {
            let [first, step] = group.place;
            for w in 0..2 {
                for k in 0..LANES {
                    words[group.edge][w][first + k * step] = self.halo[w][g * LANES + k];
                }
            }
        }
        for (n, &[edge, _, _, place, _]) in HALO_CORNERS.iter().enumerate() {
            for w in 0..2 {
                words[edge][w][place] = self.halo[w][HALO_GROUPS.len() * LANES + n];
            }
        }
    }
}

impl BlockRows<'_> {
    /// Adds A z without the diagonal blocks to `sum`, at the nodes of the block and, as far as z lies in the block, of
    /// its halo: each pair is decoded once, for both of its nodes.
    #[inline(always)]
    pub fn add_product<V: Lanes>(&self, z: &[Window; 2], sum: &mut [Window; 2]) {
        for row in Row::all() {
            let [x, y] = each!([0, 1], |c| row.near::<V>(&z[c], 0, 0));
            let mut own = each!([0, 1], |c| row.near::<V>(&sum[c], 0, 0));
            each!([0, 1, 2, 3], |e| {
                let (di, dj) = EDGES[e];
                let s = row.slot();
                let pair = decode::<V>(each!([0, 1], |w| V::load_index(&self.words[e][w], s)));
                let [far_x, far_y] = each!([0, 1], |c| row.near::<V>(&z[c], di, dj));
                own[0] += pair[0] * far_x + pair[1] * far_y;
                own[1] += pair[2] * far_x + pair[3] * far_y;
                let at = row.at(di, dj);
                (V::load(&sum[0], at) + (pair[0] * x + pair[2] * y)).store(&mut sum[0], at);
                (V::load(&sum[1], at) + (pair[1] * x + pair[3] * y)).store(&mut sum[1], at);
            });
            each!([0, 1], |c| row.store_in_window(&mut sum[c], own[c]));
        }
        for (g, group) in HALO_GROUPS.iter().enumerate() {
            let pair = decode::<V>(each!([0, 1], |w| V::load_index(&self.halo[w], g * LANES)));
            let (near, far) = (Places(group.place), Places([group.far, group.place[1]]));
            let [x, y] = each!([0, 1], |c| near.load::<V>(&z[c]));
            let [far_x, far_y] = each!([0, 1], |c| far.load::<V>(&z[c]));
            near.add::<V>(&mut sum[0], pair[0] * far_x + pair[1] * far_y);
            near.add::<V>(&mut sum[1], pair[2] * far_x + pair[3] * far_y);
            far.add::<V>(&mut sum[0], pair[0] * x + pair[2] * y);
            far.add::<V>(&mut sum[1], pair[1] * x + pair[3] * y);
        }
        for (n, &[_, _, _, near, far]) in HALO_CORNERS.iter().enumerate() {
            let at = HALO_GROUPS.len() * LANES + n;
            let pair = decode_one([self.halo[0][at], self.halo[1][at]]);
            for c in 0..2 {
                sum[c][near] += pair[2 * c] * z[0][far] + pair[2 * c + 1] * z[1][far];
                sum[c][far] += pair[c] * z[0][near] + pair[2 + c] * z[1][near];
            }
        }
    }
}

/// Eight places of a window: the first one and the stride.
#[derive(Clone, Copy)]
struct Places([usize; 2]);

impl Places {
    #[inline(always)]
    fn load<V: Lanes>(self, window: &Window) -> V {
        let Places([first, step]) = self;
        if step == 1 {
            return V::load(window, first);
        }
        V::from_array(each!([0, 1, 2, 3, 4, 5, 6, 7], |k| window[first + k * step]))
    }

    #[inline(always)]
    fn add<V: Lanes>(self, window: &mut Window, x: V) {
        let Places([first, step]) = self;
        if step == 1 {
            return (V::load(window, first) + x).store(window, first);
        }
        for (k, x) in x.to_array().into_iter().enumerate() {
            window[first + k * step] += x;
        }
    }
}

/// Gathers the halo's encoded pairs from the neighbour blocks; `words` returns a block's pairs.
pub fn halo_words<'a>(words: impl Fn(usize) -> &'a Words, neighbours: &[u32; 9]) -> Halo {
    let mut halo = [[0; HALO_GROUPS.len() * LANES + HALO_CORNERS.len()]; 2];
    for (g, &HaloGroup { edge, neighbour, slot: [first, step], .. }) in HALO_GROUPS.iter().enumerate() {
        if neighbours[neighbour] != NONE {
            let from = &words(neighbours[neighbour] as usize)[edge];
            for (halo, from) in halo.iter_mut().zip(from) {
                for k in 0..LANES {
                    halo[g * LANES + k] = from[first + k * step];
                }
            }
        }
    }
    for (n, &[edge, neighbour, slot, ..]) in HALO_CORNERS.iter().enumerate() {
        if neighbours[neighbour] != NONE {
            let from = &words(neighbours[neighbour] as usize)[edge];
            for (halo, from) in halo.iter_mut().zip(from) {
                halo[HALO_GROUPS.len() * LANES + n] = from[slot];
            }
        }
    }
    halo
}
