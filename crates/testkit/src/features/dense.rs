//! Models that are painted densely, in code: discs and squares of random sizes, as near to each other as two cells of a
//! grid of 1024.

use crate::model::Model;
use crate::random::splitmix;
use crate::scenes::TileMaps as Maps;

/// Texels on a side of the painted maps.
const SIDE: usize = 1024;
/// The largest and the least half-width of a feature, and the gap between two, in texels.
const LARGEST: f64 = 14.0;
const LEAST: f64 = 4.0;
const GAP: f64 = 2.0;
/// Number of places that are tried in a tile. Features then cover 45 % of it.
const TRIES: usize = 60_000;

/// A model with features painted over all of its tiles, in place of its own and of its masks; the same ones each time.
pub fn dense(model: &Model) -> Model {
    let maps = model.maps.iter().map(|maps| painted(maps.udim)).collect();
    Model { name: format!("dense {}", model.name), maps, ..model.clone() }
}

fn painted(udim: u32) -> Maps {
    let mut seed = u64::from(udim);
    let mut random = || splitmix(&mut seed);
    let mut rigidity = vec![0u8; SIDE * SIDE];
    // Texels that lie in a feature or nearer to one than the gap.
    let mut taken = vec![false; SIDE * SIDE];
    for k in 0..TRIES {
        // Large ones first; small ones fill what is left.
        let largest = LARGEST + (LEAST - LARGEST) * (k as f64 / TRIES as f64);
        let half = LEAST + (largest - LEAST) * random();
        let (x, y) = (random() * SIDE as f64, random() * SIDE as f64);
        let is_disc = random() < 0.6;
        let inside = |i: usize, j: usize, half: f64| {
            let (dx, dy) = (i as f64 + 0.5 - x, j as f64 + 0.5 - y);
            if is_disc { dx.hypot(dy) <= half } else { dx.abs().max(dy.abs()) <= 0.85 * half }
        };
        let reach = half + GAP + 1.0;
        let near = |at: f64| (at - reach).max(0.0) as usize..((at + reach) as usize + 1).min(SIDE);
        let texels = || near(y).flat_map(|j| near(x).map(move |i| (i, j)));
        if texels().any(|(i, j)| inside(i, j, half) && taken[j * SIDE + i]) {
            continue;
        }
        for (i, j) in texels() {
            if inside(i, j, half) {
                rigidity[j * SIDE + i] = 255;
            }
            taken[j * SIDE + i] |= inside(i, j, half + GAP);
        }
    }
    Maps { udim, width: SIDE as u32, height: SIDE as u32, rigidity, mask: None }
}
