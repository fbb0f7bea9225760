//! Where redirections may lead beyond the borders of charts: as far as the texture has room for what lies there. A
//! texel beside all charts shows what lies beyond the nearest border; farther out, another chart begins, or its
//! surroundings do (method §16).

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use crate::owners::Owners;
use vrtm_core::allocation::{Vec, zeroed};
use vrtm_core::image::ImagePart;
use vrtm_core::mesh::{NONE, TileMesh};
use vrtm_core::team::Team;

/// Squares along each side of a tile in which owners are looked up. It does not depend on the size of an image, so that
/// images of all sizes hold the same.
const SQUARES: usize = 1024;
/// Least distance of a redirection from texture of another chart, in squares: a bilinear lookup then reads none
/// of it (but of tips that are a square wide), in a texture of this size or a finer one.
const APART: f64 = 1.5;
/// Points around a place at this distance, as unit vectors.
const AROUND: [[f64; 2]; 8] = {
    const D: f64 = std::f64::consts::FRAC_1_SQRT_2;
    [[1.0, 0.0], [D, D], [0.0, 1.0], [-D, D], [-1.0, 0.0], [-D, -D], [0.0, -1.0], [D, -D]]
};
/// Halvings in the search of the last place with room.
const HALVINGS: usize = 6;

/// A square beside the charts of the tile's layer, in a chart of another layer: all of them share one texture.
const OTHERS: u32 = NONE - 1;

/// The room beside the charts of a tile.
#[derive(Debug)]
pub struct Gutter {
    /// Per square, twice the chart that owns it, plus 1 if it lies in the chart itself, or `NONE`, or `OTHERS`; rows
    /// from v = 0 upward.
    squares: Vec<u32>,
}

impl Gutter {
    /// The room beside the charts of a tile with collars; `others` are the other layers of its UDIM number.
    pub fn new<'a>(team: &Team, tile: &TileMesh, others: impl Iterator<Item = &'a TileMesh>) -> Gutter {
        let part = ImagePart { size: [SQUARES; 2], first: [0; 2], end: [SQUARES; 2] };
        let mut owners = Owners::new(&part);
        owners.draw(team, tile);
        let mut of_others = None;
        for other in others {
            of_others.get_or_insert_with(|| Owners::new(&part)).draw(team, other);
        }
        let of_others = of_others.as_ref();
        let mut squares = zeroed(SQUARES * SQUARES);
        let mut rows: Vec<&mut [u32]> = squares.chunks_exact_mut(SQUARES).collect();
        team.fill(&mut rows, |y, row| {
            for (x, square) in row.iter_mut().enumerate() {
                let is_others = || of_others.is_some_and(|of_others| of_others.is_inside(x, y));
                *square = match owners.chart(x, y) {
                    _ if !owners.is_inside(x, y) && is_others() => OTHERS,
                    NONE => NONE,
                    chart => 2 * chart + u32::from(owners.is_inside(x, y)),
                };
            }
        });
        Gutter { squares }
    }

    pub const BYTES: u64 = 4 * (SQUARES * SQUARES) as u64;

    /// Nearest permitted target of a chart's texel, instead of `to`: on the way from there to the texel's
    /// centre `at`, all in UV within the tile. `None` if nothing is in the way.
    pub fn limit(&self, chart: u32, at: [f64; 2], to: [f64; 2]) -> Option<[f64; 2]> {
        let [at, to] = [at, to].map(|p| p.map(|x| x * SQUARES as f64));
        if self.has_room(chart, to, APART) {
            return None;
        }
        // In a narrow gutter, room is all that is the chart's.
        let apart = if self.has_room(chart, at, APART) { APART } else { 0.0 };
        if apart == 0.0 && self.has_room(chart, to, 0.0) {
            return None;
        }
        let on_way = |t: f64| [0, 1].map(|axis| to[axis] + t * (at[axis] - to[axis]));
        // Not `hypot`, for which a system's library would have to be newer.
        let [dx, dy] = [0, 1].map(|axis| at[axis] - to[axis]);
        let steps = (2.0 * (dx * dx + dy * dy).sqrt()).ceil().max(1.0) as usize;
        // Beside its own texture, if nowhere else, a texel is looked up where it is.
        let (mut without, mut with_room) = (0.0, 1.0);
        for t in (1..steps).map(|k| k as f64 / steps as f64) {
            if self.has_room(chart, on_way(t), apart) {
                with_room = t;
                break;
            }
            without = t;
        }
        for _ in 0..HALVINGS {
            let t = 0.5 * (with_room + without);
            *(if self.has_room(chart, on_way(t), apart) { &mut with_room } else { &mut without }) = t;
        }
        Some(on_way(with_room).map(|x| x / SQUARES as f64))
    }

    /// True if a place, in squares, lies in the chart itself, or there is no texture of another one there and around
    /// it, at the distance `apart`.
    fn has_room(&self, chart: u32, [x, y]: [f64; 2], apart: f64) -> bool {
        let owner = |x: f64, y: f64| {
            let is_in = |x: f64| (0.0..SQUARES as f64).contains(&x);
            if is_in(x) && is_in(y) { self.squares[y as usize * SQUARES + x as usize] } else { NONE }
        };
        let here = owner(x, y);
        let is_free = |owner: u32| owner >> 1 == chart || owner == NONE;
        here == 2 * chart + 1
            || is_free(here)
                && (apart == 0.0
                    || AROUND.iter().all(|[dx, dy]| is_free(owner(x + apart * dx, y + apart * dy))))
    }
}

/// The redirections of an image that were limited.
#[derive(Debug, Default)]
pub struct LimitedTexels {
    texels: AtomicU64,
    /// The bits of an f32.
    most: AtomicU32,
}

impl LimitedTexels {
    /// Counts a texel whose redirection was limited by some texels.
    pub fn count(&self, by: f32) {
        self.texels.fetch_add(1, Ordering::Relaxed);
        // Floats that are not negative are ordered as their bits are.
        self.most.fetch_max(by.to_bits(), Ordering::Relaxed);
    }

    /// The number of texels, and by how much a redirection was limited at most, in texels.
    pub fn read(&self) -> (u64, f32) {
        (self.texels.load(Ordering::Relaxed), f32::from_bits(self.most.load(Ordering::Relaxed)))
    }

    pub fn set(&self, other: &LimitedTexels) {
        let (texels, most) = other.read();
        self.texels.store(texels, Ordering::Relaxed);
        self.most.store(most.to_bits(), Ordering::Relaxed);
    }
}
