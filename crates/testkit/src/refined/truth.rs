//! The redirection as its map tells it, against what a renderer makes of refined corner UVs.

use vrtm::{Asset, FetchKind};

use super::Refined;
use crate::{barycentric, cross};

/// The largest error at the texel centres of maps of `size` x `size` texels, over all tiles and both ways to cut a quad
/// into triangles, and the number of texels compared.
pub fn largest_error(asset: &mut Asset, refined: &Refined, size: usize) -> (f64, usize) {
    let (mut worst, mut count) = (0.0f64, 0);
    for tile in 0..asset.tile_count() {
        let udim = asset.tile(tile).report().unwrap().udim - 1001;
        let origin = [f64::from(udim % 10), f64::from(udim / 10)];
        let map = crate::fetch(asset, tile, FetchKind::Redirection, [size as u32; 2]);
        for face in refined.faces().filter(|face| face.len() >= 3) {
            let polygon = || face.clone().map(|c| refined.uvs[c].map(f64::from));
            let centre = [0, 1].map(|k| polygon().map(|uv| uv[k]).sum::<f64>() / face.len() as f64);
            if centre.map(f64::floor) != origin {
                continue;
            }
            for other in [false, true] {
                for triangle in refined.triangles(face.clone(), other) {
                    let at = triangle.map(|c| [0, 1].map(|k| f64::from(refined.uvs[c][k]) - origin[k]));
                    let to =
                        triangle.map(|c| [0, 1].map(|k| f64::from(refined.redirected[c][k]) - origin[k]));
                    visit(at, size, |x, y, l| {
                        let seen = [0, 1].map(|k| (0..3).map(|c| l[c] * to[c][k]).sum::<f64>());
                        let right = map[y * size + x].map(f64::from);
                        worst = worst.max((seen[0] - right[0]).hypot(seen[1] - right[1]));
                        count += 1;
                    });
                }
            }
        }
    }
    (worst, count)
}

/// Calls `f(x, y, barycentric coordinates)` for the texels whose centre lies in a triangle.
pub fn visit(at: [[f64; 2]; 3], size: usize, mut f: impl FnMut(usize, usize, [f64; 3])) {
    let corners @ [a, b, c] = at.map(|uv| uv.map(|x| x * size as f64 - 0.5));
    if cross(a, b, c) == 0.0 {
        return;
    }
    let span = |k: usize| {
        let low = a[k].min(b[k]).min(c[k]).ceil().max(0.0);
        let high = a[k].max(b[k]).max(c[k]).floor().min(size as f64 - 1.0);
        low as usize..if high < low { low as usize } else { high as usize + 1 }
    };
    for y in span(1) {
        for x in span(0) {
            let l = barycentric(&corners, [x as f64, y as f64]);
            if l.iter().all(|&l| l >= 0.0) {
                f(x, y, l);
            }
        }
    }
}
