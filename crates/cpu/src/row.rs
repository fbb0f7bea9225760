//! The eight nodes of one vector: nodes of one colour in one row of a block. Gives the indices of these nodes and of
//! their neighbours in planes and windows.

use vrtm_core::grid::planes::{Plane, SIDE};
use vrtm_core::grid::window::{Window, place};

use super::lanes::{LANES, Lanes, each};

/// The eight neighbours of a node: offset along x and y, index in `EDGES` of the edge between the two, and whether the
/// neighbour owns it.
pub const NEIGHBOURS: [(i64, i64, usize, bool); 8] = [
    (1, 0, 0, false),
    (0, 1, 1, false),
    (1, 1, 2, false),
    (-1, 1, 3, false),
    (-1, 0, 0, true),
    (0, -1, 1, true),
    (-1, -1, 2, true),
    (1, -1, 3, true),
];

/// Offsets from a row's nodes to their neighbours, in the order of `NEIGHBOURS`.
pub type Offsets<V> = [[V; 2]; 8];

/// Eight nodes of one node colour in one row of a block.
#[derive(Clone, Copy)]
pub struct Row {
    /// Column of the first lane's node: 0 or 1.
    ci: usize,
    /// Row of nodes, 0..16.
    j: usize,
    /// Indices in a window of the first lane's node and neighbours, row by row.
    places: [usize; 9],
}

/// Rows of a block.
pub const ROWS: usize = 2 * SIDE;

/// The places of each node colour's first row, as in `Row`.
const PLACES: [[usize; 9]; 4] = {
    let mut places = [[0; 9]; 4];
    let mut n = 0;
    while n < 36 {
        let (colour, k) = (n / 9, n % 9);
        places[colour][k] = place((colour & 1) + k % 3, (colour >> 1) + k / 3);
        n += 1;
    }
    places
};

impl Row {
    /// All rows of nodes of a node colour.
    #[inline(always)]
    pub fn of_colour(colour: usize) -> impl Iterator<Item = Row> {
        (0..SIDE / 2).map(move |k| Row::new(colour, k))
    }

    /// All rows of a block, node colour by node colour.
    #[inline(always)]
    pub fn all() -> impl Iterator<Item = Row> {
        (0..ROWS).map(|k| Row::new(k / (SIDE / 2), k % (SIDE / 2)))
    }

    #[inline(always)]
    fn new(colour: usize, k: usize) -> Self {
        let places = each!([0, 1, 2, 3, 4, 5, 6, 7, 8], |n| PLACES[colour][n] + 9 * k);
        Row { ci: colour & 1, j: 2 * k + (colour >> 1 & 1), places }
    }

    /// Column of the first lane's node.
    #[inline(always)]
    pub fn column(self) -> usize {
        self.ci
    }

    /// Row of nodes, 0..16.
    #[inline(always)]
    pub fn line(self) -> usize {
        self.j
    }

    /// Index in a window of the first lane's neighbour at (di, dj). The neighbours of the other lanes follow.
    #[inline(always)]
    pub fn at(self, di: i64, dj: i64) -> usize {
        self.places[((dj + 1) * 3 + di + 1) as usize]
    }

    /// The number of the row in a block.
    #[inline(always)]
    pub fn index(self) -> usize {
        self.slot() / LANES
    }

    /// Index in a plane of the first lane's node. The nodes of the other lanes follow.
    #[inline(always)]
    pub fn slot(self) -> usize {
        vrtm_core::grid::planes::slot(self.ci, self.j)
    }

    /// Loads a window's values at the neighbours at (di, dj), where each is -1, 0 or 1.
    #[inline(always)]
    pub fn near<V: Lanes>(self, window: &Window, di: i64, dj: i64) -> V {
        assert!(di.unsigned_abs() <= 1 && dj.unsigned_abs() <= 1);
        let at = self.at(di, dj);
        // SAFETY: ci < 2 and j < 16, so the eight places end at column 17 and row 17 of the window at most.
        V::load(unsafe { window.get_unchecked(at..at + LANES) }, 0)
    }

    /// Loads a window's indices at the neighbours at (di, dj).
    #[inline(always)]
    pub fn near_index<V: Lanes>(self, window: &Window<u32>, di: i64, dj: i64) -> V::Index {
        assert!(di.unsigned_abs() <= 1 && dj.unsigned_abs() <= 1);
        let at = self.at(di, dj);
        // SAFETY: as in `near`.
        V::load_index(unsafe { window.get_unchecked(at..at + LANES) }, 0)
    }

    /// Loads a plane's values at the row's nodes.
    #[inline(always)]
    pub fn load<V: Lanes>(self, plane: &Plane) -> V {
        let s = self.slot();
        // SAFETY: ci < 2 and j < 16, so the slot begins a row of one of the four colours.
        V::load(unsafe { plane.get_unchecked(s..s + LANES) }, 0)
    }

    /// Stores a plane's values at the row's nodes.
    #[inline(always)]
    pub fn store<V: Lanes>(self, plane: &mut Plane, x: V) {
        let s = self.slot();
        // SAFETY: as in `load`.
        x.store(unsafe { plane.get_unchecked_mut(s..s + LANES) }, 0);
    }

    /// Offsets from the row's nodes, displaced by `here`, to their neighbours at (di, dj), displaced by `u`, in cells.
    #[inline(always)]
    pub fn offset<V: Lanes>(self, u: &[Window; 2], here: &[V; 2], di: i64, dj: i64) -> [V; 2] {
        let (x, y) = (self.near::<V>(&u[0], di, dj), self.near::<V>(&u[1], di, dj));
        [(x - here[0]) + di as f32, (y - here[1]) + dj as f32]
    }

    /// The offsets to all neighbours, as by `offset`.
    #[inline(always)]
    pub fn offsets<V: Lanes>(self, u: &[Window; 2], here: &[V; 2]) -> Offsets<V> {
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| self.offset(u, here, NEIGHBOURS[k].0, NEIGHBOURS[k].1))
    }

    /// Stores a window's values at the row's nodes.
    #[inline(always)]
    pub fn store_in_window<V: Lanes>(self, window: &mut Window, x: V) {
        let at = self.at(0, 0);
        // SAFETY: as in `near`.
        x.store(unsafe { window.get_unchecked_mut(at..at + LANES) }, 0);
    }
}
