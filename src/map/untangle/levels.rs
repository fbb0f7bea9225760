//! Makes any map one-to-one, from coarse to fine. A lattice of a few distant texels has no folds where it is the
//! identity; and the bilinear interpolation of a lattice without folds is a lattice twice as fine without folds. On each
//! lattice texels first take the wanted values. Where those fold, texels keep the interpolated values, which then move
//! towards the wanted ones as far as no quad folds (method §9).

use std::sync::atomic::{AtomicBool, AtomicU8, AtomicUsize, Ordering};

use vrtm_core::allocation::{Grow, with_capacity, zeroed};
use vrtm_core::team::{SharedSlice, Team};

use super::lattice::{Bound, Lattice, advance, slack, way};
use super::written::{LEAST, WrittenMap, cross};

/// Passes from coarse to fine: each later pass gives more room to the quads that rounding has folded.
const PASSES: usize = 8;
/// Most quad checks, per texel of the map. One pass over all lattices without folds takes 4/3.
const LOOKS: usize = 32;
/// Sweeps on each lattice that bring texels closer to the wanted values.
const SWEEPS: usize = 16;

/// Marks of a texel, and of a row with such a texel: the texel has its interpolated value, ...
const HELD: u8 = 1;
/// ... got it in this round, ...
const NEW: u8 = 2;
/// ... the quad with this texel as its lower corner (least u and v) folds, ...
const FOLDED: u8 = 4;
/// ... and rounding has folded a quad around the texel before.
const TIGHT: u8 = 8;

/// All memory that the work needs: 9 bytes per texel.
pub(super) struct Levels {
    /// The original values of the map.
    wanted: Vec<[f32; 2]>,
    texels: Vec<AtomicU8>,
    rows: Vec<AtomicU8>,
    /// Quads that rounding has folded.
    tight: Vec<[usize; 2]>,
}

impl Levels {
    /// Memory for maps of this size, of which rounding may fold up to `most` quads.
    pub fn new([width, height]: [usize; 2], most: usize) -> Levels {
        let (texels, rows) = (zeroed(width * height), zeroed(height));
        Levels { wanted: zeroed(width * height), texels, rows, tight: with_capacity(most) }
    }

    /// Stores the map's values as the wanted ones.
    pub fn keep(&mut self, team: &Team, map: &WrittenMap) {
        let wanted = SharedSlice::new(&mut self.wanted);
        team.run(map.size[1], |y| {
            for x in 0..map.size[0] {
                // SAFETY: each item has its own row, and nothing else accesses the rows meanwhile.
                unsafe { *wanted.get_mut(y * map.size[0] + x) = map.value([x, y]) };
            }
        });
    }

    /// Writes the stored values back.
    pub fn restore(&self, team: &Team, map: &WrittenMap) {
        let row = |y: usize| &self.wanted[y * map.size[0]..][..map.size[0]];
        team.run(map.size[1], |y| {
            row(y).iter().enumerate().for_each(|(x, &value)| map.put_value([x, y], value));
        });
    }

    /// Untangles a map of at least 2 x 2 texels, whose values were kept. Returns true if no quad folds. Concurrent work
    /// never reads what is written meanwhile, so the result does not depend on the number of threads. `rows` is scratch
    /// memory for a number per row of quads.
    pub fn untangle(&mut self, team: &Team, map: &WrittenMap, rows: &mut [u32]) -> bool {
        let looks = AtomicUsize::new(0);
        for _ in 0..PASSES {
            let mut stride = map.size[0].max(map.size[1]).next_power_of_two();
            while stride > 1 {
                stride /= 2;
                let coarsest = 2 * stride >= map.size[0].max(map.size[1]);
                let level = Level { map, lattice: Lattice { size: map.size, stride }, levels: self };
                level.interpolate(team, coarsest);
                if !level.hold(team, &looks) {
                    return false;
                }
                level.relax(team);
            }
            team.fill(rows, |y, count| {
                *count = 0;
                map.each_fold(y, LEAST, |_| *count += 1);
            });
            let before = self.tight.len();
            let room = self.tight.capacity() - before;
            if rows.iter().map(|&count| count as usize).sum::<usize>() > room {
                return false;
            }
            for y in (0..rows.len()).filter(|&y| rows[y] > 0) {
                map.each_fold(y, LEAST, |x| self.tight.put([x, y]));
            }
            if self.tight.len() == before {
                return true;
            }
        }
        false
    }
}

struct Level<'a> {
    map: &'a WrittenMap<'a>,
    lattice: Lattice,
    levels: &'a Levels,
}

impl Level<'_> {
    fn index(&self, [x, y]: [usize; 2]) -> usize {
        y * self.map.size[0] + x
    }

    fn mark(&self, texel: [usize; 2]) -> &AtomicU8 {
        &self.levels.texels[self.index(texel)]
    }

    fn is(&self, texel: [usize; 2], mark: u8) -> bool {
        self.mark(texel).load(Ordering::Relaxed) & mark != 0
    }

    fn row_is(&self, j: usize, mark: u8) -> bool {
        self.levels.rows[j].load(Ordering::Relaxed) & mark != 0
    }

    /// Clears marks in all rows.
    fn clear_rows(&self, marks: u8) {
        self.levels.rows.iter().for_each(|row| _ = row.fetch_and(!marks, Ordering::Relaxed));
    }

    fn wanted(&self, texel: [usize; 2]) -> [f64; 2] {
        self.map.place_of(texel, self.levels.wanted[self.index(texel)])
    }

    /// Gives the nodes that are not in the coarser lattice their interpolated values, and marks the nodes of tight quads.
    fn interpolate(&self, team: &Team, coarsest: bool) {
        let (lattice, map) = (self.lattice, self.map);
        team.run(lattice.count(1), |j| {
            let y = lattice.at(1, j);
            let (ys, t) = lattice.around(1, y);
            for i in 0..lattice.count(0) {
                let x = lattice.at(0, i);
                let (xs, s) = lattice.around(0, x);
                self.mark([x, y]).store(0, Ordering::Relaxed);
                if coarsest {
                    map.put([x, y], [x as f64, y as f64]);
                } else if s != 0.0 || t != 0.0 {
                    let [low, high] = ys.map(|y| {
                        let [a, b] = xs.map(|x| map.place([x, y]));
                        [0, 1].map(|k| a[k] + s * (b[k] - a[k]))
                    });
                    map.put([x, y], [0, 1].map(|k| low[k] + t * (high[k] - low[k])));
                }
            }
        });
        self.clear_rows(HELD | NEW | FOLDED);
        for quad in &self.levels.tight {
            let around = |axis: usize| {
                let k = quad[axis] / lattice.stride;
                k.saturating_sub(1)..(k + 3).min(lattice.count(axis))
            };
            for (i, j) in around(1).flat_map(|j| around(0).map(move |i| (i, j))) {
                self.mark(lattice.texel([i, j])).fetch_or(TIGHT, Ordering::Relaxed);
            }
        }
    }

    /// Gives nodes the wanted values, except where quads would then fold: their nodes are held. Returns false if the
    /// remaining quad checks do not suffice.
    fn hold(&self, team: &Team, looks: &AtomicUsize) -> bool {
        let lattice = self.lattice;
        let [columns, rows] = [0, 1].map(|axis| lattice.count(axis));
        for round in 0.. {
            team.run(rows - 1, |j| {
                if round > 0 && !self.row_is(j, NEW) && !self.row_is(j + 1, NEW) {
                    return;
                }
                looks.fetch_add(columns, Ordering::Relaxed);
                for i in 0..columns - 1 {
                    let mark = self.mark(lattice.texel([i, j]));
                    if self.folds([i, j]) {
                        mark.fetch_or(FOLDED, Ordering::Relaxed);
                        self.levels.rows[j].fetch_or(FOLDED, Ordering::Relaxed);
                    } else {
                        mark.fetch_and(!FOLDED, Ordering::Relaxed);
                    }
                }
            });
            self.clear_rows(NEW);
            let grew = AtomicBool::new(false);
            team.run(rows, |j| {
                if !self.row_is(j, FOLDED) && (j == 0 || !self.row_is(j - 1, FOLDED)) {
                    return;
                }
                for i in 0..columns {
                    let folded = |di: usize, dj: usize| {
                        i >= di && j >= dj && self.is(lattice.texel([i - di, j - dj]), FOLDED)
                    };
                    let texel = lattice.texel([i, j]);
                    let beside = folded(0, 0) || folded(1, 0) || folded(0, 1) || folded(1, 1);
                    if beside && !self.is(texel, HELD) {
                        self.mark(texel).fetch_or(HELD, Ordering::Relaxed);
                        self.levels.rows[j].fetch_or(HELD | NEW, Ordering::Relaxed);
                        grew.store(true, Ordering::Relaxed);
                    }
                }
            });
            self.clear_rows(FOLDED);
            if !grew.into_inner() {
                break;
            }
            if looks.load(Ordering::Relaxed) > LOOKS * self.levels.texels.len() {
                return false;
            }
        }
        team.run(rows, |j| {
            for texel in (0..columns).map(|i| lattice.texel([i, j])).filter(|&texel| !self.is(texel, HELD)) {
                self.map.put_value(texel, self.levels.wanted[self.index(texel)]);
            }
        });
        true
    }

    /// True if a quad folds, or might, when its nodes take the wanted values unless they are held. Tight quads include
    /// rounding.
    fn folds(&self, node: [usize; 2]) -> bool {
        let (from, to) = (self.lattice.texel(node), self.lattice.texel(node.map(|k| k + 1)));
        let texels = [from, [to[0], from[1]], [from[0], to[1]], to];
        let now = |texel| if self.is(texel, HELD) { self.map.place(texel) } else { self.wanted(texel) };
        let [a, b, c, d] = texels.map(now);
        let sides = way(from.map(|x| x as f64), to.map(|x| x as f64));
        let least = cross(a, b, c).min(cross(b, d, a)).min(cross(c, a, d)).min(cross(d, c, b))
            / (sides[0] * sides[1]);
        let tight = self.lattice.stride > 1 && self.is(from, TIGHT);
        least <= LEAST || tight && least <= LEAST + slack(self.map.rounding(from), [a, b, c, d], sides)
    }

    /// Brings held nodes closer to the wanted values. Nodes of one of four colours share no quad.
    fn relax(&self, team: &Team) {
        let [columns, rows] = [0, 1].map(|axis| self.lattice.count(axis));
        for _ in 0..SWEEPS {
            let moves = AtomicBool::new(false);
            for [first, second] in [[0, 0], [1, 0], [0, 1], [1, 1]] {
                team.run((rows - second).div_ceil(2), |k| {
                    let j = 2 * k + second;
                    if !self.row_is(j, HELD) {
                        return;
                    }
                    for i in (first..columns).step_by(2) {
                        if self.is(self.lattice.texel([i, j]), HELD) && self.approach([i, j]) {
                            moves.store(true, Ordering::Relaxed);
                        }
                    }
                });
            }
            if !moves.into_inner() {
                break;
            }
        }
    }

    /// Moves a node towards its wanted value as far as the Jacobians at the corners of its quads allow: first straight,
    /// then along the bound of the limiting one. Returns true if it moved by more than a hundredth of a texel.
    fn approach(&self, node: [usize; 2]) -> bool {
        let (map, texel) = (self.map, self.lattice.texel(node));
        let (old, from, wanted) = (map.value(texel), map.place(texel), self.wanted(texel));
        let mut bounds = [Bound::default(); 12];
        let count = self.lattice.bounds(map, node, self.is(texel, TIGHT), &mut bounds);
        let bounds = &bounds[..count];
        let least = |at: [f64; 2]| bounds.iter().map(|bound| bound.at(at)).fold(f64::INFINITY, f64::min);
        let (mut to, met) = advance(bounds, from, way(from, wanted));
        match met {
            None => map.put_value(texel, self.levels.wanted[self.index(texel)]),
            Some(g) => {
                let rest = way(to, wanted);
                let along = (rest[0] * g[0] + rest[1] * g[1]) / (g[0] * g[0] + g[1] * g[1]);
                to = advance(bounds, to, [0, 1].map(|k| rest[k] - along * g[k])).0;
                map.put(texel, to);
            }
        }
        let now = map.place(texel);
        let squared = |[x, y]: [f64; 2]| x * x + y * y;
        // If rounding spoils the move, it is undone.
        if least(now) < least(from).min(2.0 * LEAST)
            || squared(way(now, wanted)) >= squared(way(from, wanted))
        {
            map.put_value(texel, old);
            return false;
        }
        squared(way(from, now)) > 1e-4
    }
}
