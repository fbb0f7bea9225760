//! Windows (method §1): contiguous copies of a block and its halo of one node, on which a stage works.

use crate::grid::planes::{Plane, SIDE, slot};
use crate::mesh::NONE;

/// Nodes of a window: 18 x 18.
pub const WINDOW_NODES: usize = 4 * WINDOW_PLANE;
/// Nodes of one colour of a window: 9 x 9.
const WINDOW_PLANE: usize = 81;

/// One quantity at the nodes (-1..=16, -1..=16) of a block, as four planes of 9x9, one per node colour.
pub type Window<T = f32> = [T; WINDOW_NODES];

/// Index of the node (i - 1, j - 1) of the block in a window; i and j run from 0 to 17.
#[inline(always)]
pub const fn place(i: usize, j: usize) -> usize {
    ((j & 1) * 2 + (i & 1)) * WINDOW_PLANE + (j >> 1) * 9 + (i >> 1)
}

/// Copies the plane of the block `neighbours[4]` and its halo into a window. `plane(b)` is the plane of block `b`; the
/// halo is `default` where a neighbour block is not stored.
#[inline(always)]
pub fn load<'a, T: Copy + 'a>(
    neighbours: &[u32; 9],
    default: T,
    plane: impl Fn(usize) -> &'a Plane<T>,
    window: &mut Window<T>,
) {
    // Not by `map`, which is a call for arrays of this size.
    let mut planes = [None; 9];
    for (to, &b) in planes.iter_mut().zip(neighbours).filter(|(_, b)| **b != NONE) {
        *to = Some(plane(b as usize));
    }
    copy(planes, default, window);
}

/// The window that `load` fills.
#[inline(always)]
pub fn of<'a, T: Copy + 'a>(
    neighbours: &[u32; 9],
    default: T,
    plane: impl Fn(usize) -> &'a Plane<T>,
) -> Window<T> {
    let mut window = [default; WINDOW_NODES];
    load(neighbours, default, plane, &mut window);
    window
}

/// The windows of several planes of a block, 0 in the halo where a neighbour block is not stored; `plane(b, c)` is
/// plane `c` of block `b`.
#[inline(always)]
pub fn planes<'a, const N: usize>(
    neighbours: &[u32; 9],
    plane: impl Fn(usize, usize) -> &'a Plane,
) -> [Window; N] {
    let mut windows = [[0.0; WINDOW_NODES]; N];
    for (c, window) in windows.iter_mut().enumerate() {
        load(neighbours, 0.0, |b| plane(b, c), window);
    }
    windows
}

/// One function for each type: inlined into each kernel, it would take a large part of the time that kernels take to
/// compile. With moves of 32 bytes where the processor has them.
#[inline(never)]
fn copy<T: Copy>(planes: [Option<&Plane<T>>; 9], default: T, window: &mut Window<T>) {
    #[cfg(target_arch = "x86_64")]
    if std::is_x86_feature_detected!("avx") {
        #[target_feature(enable = "avx")]
        fn wide<T: Copy>(planes: [Option<&Plane<T>>; 9], default: T, window: &mut Window<T>) {
            copy_with(planes, default, window);
        }
        // SAFETY: the processor has these instructions.
        return unsafe { wide(planes, default, window) };
    }
    copy_with(planes, default, window);
}

#[inline(always)]
fn copy_with<T: Copy>(planes: [Option<&Plane<T>>; 9], default: T, window: &mut Window<T>) {
    let centre = planes[4].expect("a stored block");
    for colour in 0..4 {
        let (ci, cj) = (colour & 1, colour >> 1);
        for row in 0..8 {
            let to = place(ci + 1, 2 * row + cj + 1);
            let from = colour * 64 + row * 8;
            window[to..to + 8].copy_from_slice(&centre[from..from + 8]);
        }
    }
    // South (j = -1 is row 15 of the block below) and north.
    for (k, from_j, to_j) in [(1, 15, 0), (7, 0, 17)] {
        for ci in 0..2 {
            let (to, from) = (place(ci + 1, to_j), slot(ci, from_j));
            let row = &mut window[to..to + 8];
            match planes[k] {
                Some(plane) => row.copy_from_slice(&plane[from..from + 8]),
                None => row.fill(default),
            }
        }
    }
    let mut set = |to, k: usize, from| {
        window[to] = planes[k].map_or(default, |plane| plane[from]);
    };
    // West and east.
    for (k, from_i, to_i) in [(3, 15, 0), (5, 0, 17)] {
        (0..SIDE).for_each(|j| set(place(to_i, j + 1), k, slot(from_i, j)));
    }
    // The corners.
    for (k, from, to) in
        [(0, (15, 15), (0, 0)), (2, (0, 15), (17, 0)), (6, (15, 0), (0, 17)), (8, (0, 0), (17, 17))]
    {
        set(place(to.0, to.1), k, slot(from.0, from.1));
    }
}
