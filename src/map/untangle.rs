//! Makes a redirection map one-to-one under bilinear interpolation. The inverse of a warp is affine on pieces, and where
//! two pieces with different derivatives meet, the four texel centres of a quad may lie on both sides: its interpolation
//! may then fold, however fine the map is. Values of such quads move, mostly by a fraction of a texel, until the Jacobian
//! at each corner of each quad is positive. If that does not converge, or too many quads fold, the map is rebuilt around
//! these quads, from coarse to fine (`levels`; method §9).

mod lattice;
mod levels;
pub(crate) mod written;

use vrtm_core::allocation::{Grow, with_capacity, zeroed};
use vrtm_core::team::Team;

use levels::Levels;
use written::{LEAST, TARGET, WrittenMap, cross};

/// Most passes over the folding quads.
const ROUNDS: usize = 500;
/// These passes are skipped if more than this many quads fold, or more than one in `FEW` of all quads.
const MOST: usize = 1 << 16;
const FEW: usize = 50;
/// An f16 map is given up at once if more than one in this many of its quads folds.
const HOPELESS: usize = 10;
/// An f16 map is also given up if a folding quad has values with a rounding error above this, in texels.
const COARSE: f64 = 0.05;

/// The corners of a quad: each with the ends of the edges that meet there, ordered from u to v.
const CORNERS: [[[usize; 2]; 3]; 4] =
    [[[0, 0], [1, 0], [0, 1]], [[1, 0], [1, 1], [0, 0]], [[0, 1], [0, 0], [1, 1]], [[1, 1], [0, 1], [1, 0]]];

/// All memory that the work needs, allocated in advance so that it cannot run short once an image is being written.
pub(crate) struct Untangler {
    /// Per row of quads: the number that fold.
    rows: Vec<u32>,
    most: usize,
    /// The folding quads, and the quads around them: each list is allocated for its maximum size.
    quads: Vec<[u32; 2]>,
    near: Vec<[u32; 2]>,
    levels: Levels,
}

impl Untangler {
    /// An untangler for maps of this size in texels.
    pub fn new(size: [usize; 2]) -> Untangler {
        let [width, height] = size;
        let most = (width * height / FEW + FEW).min(MOST);
        let rows = zeroed(height.saturating_sub(1));
        let (quads, near) = (with_capacity(9 * most), with_capacity(9 * most));
        Untangler { rows, most, quads, near, levels: Levels::new(size, most) }
    }

    /// Moves values of folding quads until none folds, and returns 0; or, if the numbers are too coarse for the map's
    /// size, leaves the map unchanged and returns the number of folding quads.
    pub fn untangle(mut self, team: &Team, map: &WrittenMap) -> u64 {
        if map.size.iter().any(|&n| n < 2) {
            return 0;
        }
        match self.count(team, map, LEAST) {
            0 => return 0,
            // Rounding alone causes these folds, and a search would only take time.
            folds if map.is_f16() && self.is_hopeless(map, folds) => return self.count(team, map, 0.0),
            _ => {}
        }
        self.levels.keep(team, map);
        if self.open_few(map) {
            return 0;
        }
        self.levels.restore(team, map);
        if self.levels.untangle(team, map, &mut self.rows) {
            return 0;
        }
        self.levels.restore(team, map);
        self.count(team, map, 0.0)
    }

    /// True if the numbers are so coarse that no search is worthwhile: too many quads fold, or a folding quad has values
    /// whose rounding exceeds the room that a search can give it.
    fn is_hopeless(&self, map: &WrittenMap, folds: u64) -> bool {
        if folds as usize > map.size[0] * map.size[1] / HOPELESS {
            return true;
        }
        let mut coarse = false;
        for (y, _) in self.rows.iter().enumerate().filter(|&(_, &count)| count > 0) {
            map.each_fold(y, LEAST, |x| coarse |= map.rounding([x, y]) > COARSE);
        }
        coarse
    }

    fn count(&mut self, team: &Team, map: &WrittenMap, most: f64) -> u64 {
        team.fill(&mut self.rows, |y, count| {
            *count = 0;
            map.each_fold(y, most, |_| *count += 1);
        });
        self.rows.iter().map(|&count| u64::from(count)).sum()
    }

    /// Opens the counted quads one after the other in a fixed order, so that the result does not depend on the number of
    /// threads. Returns true if none folds any more.
    fn open_few(&mut self, map: &WrittenMap) -> bool {
        let [width, height] = map.size.map(|n| n as u32);
        if self.rows.iter().map(|&count| count as usize).sum::<usize>() > self.most {
            return false;
        }
        for (y, _) in self.rows.iter().enumerate().filter(|&(_, &count)| count > 0) {
            map.each_fold(y, LEAST, |x| self.quads.put([x as u32, y as u32]));
        }
        // Searches that converge take less than half of this.
        let mut visits = 0;
        for _ in 0..ROUNDS {
            visits += self.quads.len();
            if self.quads.is_empty()
                || self.quads.len() > self.most
                || visits > map.size[0] * map.size[1] + MOST
            {
                break;
            }
            self.quads.iter().for_each(|&quad| open(map, quad));
            // Moved values may have folded the surrounding quads.
            self.near.clear();
            for &[x, y] in &self.quads {
                for j in y.saturating_sub(1)..=(y + 1).min(height - 2) {
                    self.near.put_all((x.saturating_sub(1)..=(x + 1).min(width - 2)).map(|i| [i, j]));
                }
            }
            self.near.sort_unstable_by_key(|&[x, y]| (y, x));
            self.near.dedup();
            self.near.retain(|&quad| map.smallest_jacobian(quad.map(|k| k as usize)) <= LEAST);
            std::mem::swap(&mut self.near, &mut self.quads);
        }
        self.quads.is_empty()
    }
}

/// Moves a quad's texels so that the Jacobian at each of its corners reaches the target: for each corner by the shortest
/// move that does so to first order.
fn open(map: &WrittenMap, quad: [u32; 2]) {
    for corner in CORNERS {
        let texels = corner.map(|way| [0, 1].map(|k| quad[k] as usize + way[k]));
        let [a, b, c] = texels.map(|texel| map.place(texel));
        let missing = TARGET - cross(a, b, c);
        // Derivatives of the Jacobian by the three positions.
        let of_b = [c[1] - a[1], a[0] - c[0]];
        let of_c = [a[1] - b[1], b[0] - a[0]];
        let of_a = [-of_b[0] - of_c[0], -of_b[1] - of_c[1]];
        let squares: f64 = [of_a, of_b, of_c].as_flattened().iter().map(|x| x * x).sum();
        if missing <= 0.0 || squares < 1e-12 {
            continue;
        }
        let step = missing / squares;
        for (texel, (place, way)) in texels.into_iter().zip([(a, of_a), (b, of_b), (c, of_c)]) {
            map.put(texel, [0, 1].map(|k| place[k] + (step * way[k]).clamp(-0.5, 0.5)));
        }
    }
}
