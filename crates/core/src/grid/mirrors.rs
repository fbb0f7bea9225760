//! Open borders beyond which the surface continues as its own mirror image (method §16): at nodes near such a border,
//! the direction across it, in which they should not move.

use glam::DVec2;

use super::blocks::Blocks;
use super::planes::{NODES, Plane, slot};
use crate::allocation::{Vec, vec};
use crate::mesh::{NONE, TileMesh};

/// The direction across the border with the length 1 - distance in cells, as two 16-bit fractions of 32767, the first
/// one in the lower half; 0 for nodes that nothing holds.
pub type Hold = u32;

const STEPS: f64 = 32767.0;

fn encode(across: DVec2) -> Hold {
    let [x, y] = across.to_array().map(|x| (x * STEPS).round() as i16 as u16);
    u32::from(y) << 16 | u32::from(x)
}

/// The components of what `encode` was given.
#[inline(always)]
pub fn decode(hold: Hold) -> [f32; 2] {
    [hold as u16, (hold >> 16) as u16].map(|x| f32::from(x as i16) / STEPS as f32)
}

/// Stiffness that holds the nodes of the blocks of level `level` of a grid of `cells` on level 0; empty if no
/// chart has an image. `charts` are those of the tile's triangles.
pub(super) fn hold(
    tile: &TileMesh,
    charts: &[u32],
    blocks: &Blocks,
    level: usize,
    cells: [usize; 2],
) -> Vec<Plane<Hold>> {
    let images = || (tile.own()..tile.triangles.len()).filter(|&t| tile.is_image(t as u32));
    if images().next().is_none() {
        return Vec::new();
    }
    // A level's own size is rounded down.
    let size = DVec2::new(cells[0] as f64, cells[1] as f64) / (1u64 << level) as f64;
    let mut hold: Vec<Plane<Hold>> = vec![[0; NODES]; blocks.list.len()];
    let mut nearest: Vec<Plane> = vec![[1.0; NODES]; hold.len()];
    for t in images() {
        let triangle = &tile.triangles[t];
        for k in 0..3 {
            let next = triangle.neighbours[k];
            if next == NONE || tile.is_image(next) {
                continue;
            }
            let ends = [1, 2].map(|d| triangle.uv[(k + d) % 3] * size);
            near(ends, |x, y, distance, across| {
                let b = blocks.find(charts[t], x >> 4, y >> 4);
                if b == NONE {
                    return;
                }
                let s = slot((x & 15) as usize, (y & 15) as usize);
                let nearest = &mut nearest[b as usize][s];
                if (distance as f32) < *nearest {
                    *nearest = distance as f32;
                    hold[b as usize][s] = encode(across * (1.0 - distance));
                }
            });
        }
    }
    hold
}

/// Calls `f` for the nodes that are less than a cell away from a segment: with the node, the distance, and the
/// direction across.
fn near([a, b]: [DVec2; 2], mut f: impl FnMut(i64, i64, f64, DVec2)) {
    let along = (b - a).normalize_or(DVec2::X);
    let [low, high] = [a.min(b) - 1.0, a.max(b) + 1.0].map(|p| p.to_array());
    for y in low[1].ceil() as i64..=high[1].floor() as i64 {
        for x in low[0].ceil() as i64..=high[0].floor() as i64 {
            let from_a = DVec2::new(x as f64, y as f64) - a;
            let foot = from_a.dot(along).clamp(0.0, a.distance(b)) * along;
            let distance = from_a.distance(foot);
            if distance < 1.0 {
                f(x, y, distance, along.perp());
            }
        }
    }
}
