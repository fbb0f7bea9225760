//! The features that geometry stands on: connected rigid regions that are nearly ellipses, each with its place, its
//! frame and its size at rest. Halves of a feature on both sides of a seam are one.

use std::collections::HashMap;

use vrtm_examples::islands::{islands, join, root};

use super::outward;
use crate::brush::canvas::Canvas;
use crate::brush::ids::Ids;
use crate::brush::painter::{ids_of, weights};
use crate::model::{Model, cross, dot, length, minus, plus, unit};

/// Over this a texel is rigid: as the library counts features, over a half.
const RIGID: u16 = 32768;
/// Texels that a feature has at least: fewer have no shape.
const LEAST: usize = 12;
/// A feature's area against that of the ellipse with its moments, at least: 0.95 for a square, less where it is ragged
/// or hollow.
const FULL: f32 = 0.85;
/// The shorter side of a feature over its longer one, at least: nothing stands on bars.
const ROUND: f32 = 0.45;
/// The largest feature that carries something, in parts of the mesh's radius.
const LARGEST: f32 = 0.3;
/// The mean of a feature's normals is at least so long: a cap of a sphere up to its equator has a half.
const FLAT: f32 = 0.6;
/// Points of a feature that tell how the skin under it moves.
const SAMPLES: usize = 24;

/// A point of a triangle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Spot {
    pub triangle: usize,
    pub weights: [f32; 3],
}

impl Spot {
    pub fn of(&self, model: &Model, values: &[[f32; 3]]) -> [f32; 3] {
        let corners = model.triangles[self.triangle].vertices.map(|v| values[v as usize]);
        [0, 1, 2].map(|c| (0..3).map(|k| self.weights[k] * corners[k][c]).sum())
    }
}

/// The base of a stud or a spike.
#[derive(Clone, Debug)]
pub struct Piece {
    pub tile: usize,
    /// Within the tile.
    pub uv: [f32; 2],
    pub centre: Spot,
    /// At rest: along the longer and the shorter axis of the feature, and its normal.
    pub frame: [[f32; 3]; 3],
    /// Half of the feature's length along the first two of these.
    pub radii: [f32; 2],
    pub samples: Vec<Spot>,
}

/// A rigid texel.
#[derive(Clone, Copy)]
struct Texel {
    tile: usize,
    spot: Spot,
    position: [f32; 3],
    normal: [f32; 3],
    area: f32,
    /// True if the feature may continue beyond a seam here.
    on_border: bool,
}

/// The features of all tiles.
pub fn find(model: &Model, canvases: &[Canvas]) -> Vec<Piece> {
    let (charts, normals) = (islands(&model.triangles), outward::normals(&model.triangles, &model.rest));
    let (mut texels, mut parts): (Vec<Texel>, Vec<Vec<usize>>) = (Vec::new(), Vec::new());
    for (k, tile) in model.tiles.iter().enumerate() {
        let canvas = &canvases[tile.page];
        let ids = ids_of(model, k, canvas.size);
        parts.extend(parts_of(model, &normals, (k, canvas), (&ids, &charts), &mut texels));
    }
    let whole = across_seams(&texels, parts);
    whole.iter().filter_map(|part| piece(model, &texels, part)).collect()
}

/// The connected parts of a tile, as indices of texels, which are added.
fn parts_of(
    model: &Model,
    normals: &[[f32; 3]],
    (tile, canvas): (usize, &Canvas),
    (ids, charts): (&Ids, &[u32]),
    texels: &mut Vec<Texel>,
) -> Vec<Vec<usize>> {
    let [width, height] = canvas.size.map(|side| side as usize);
    let place = |k: usize| canvas.uv([(k % width) as u32, (k / width) as u32]);
    // The margin around charts is no part of the surface.
    let spot_at = |k: usize| {
        let uv = place(k);
        let triangle = ids.at(uv)?;
        let weights = weights(model.triangles[triangle].uvs.map(|uv| uv.map(|x| x as f32)), uv);
        weights.iter().all(|&w| w > -1e-3).then_some(Spot { triangle, weights })
    };
    let mut taken = vec![false; width * height];
    let mut parts = Vec::new();
    for first in 0..width * height {
        let (mut part, mut waiting) = (Vec::new(), vec![first]);
        while let Some(k) = waiting.pop() {
            if taken[k] || canvas.texels[k] < RIGID {
                continue;
            }
            taken[k] = true;
            let Some(spot) = spot_at(k) else { continue };
            let of = spot.triangle;
            let (x, y) = (k % width, k / width);
            let near = [
                (x > 0).then(|| k - 1),
                (x + 1 < width).then(|| k + 1),
                (y > 0).then(|| k - width),
                (y + 1 < height).then(|| k + width),
            ];
            let mut on_border = false;
            for other in near {
                match other.and_then(|k| Some((k, spot_at(k)?))) {
                    Some((k, spot)) if charts[spot.triangle] == charts[of] => waiting.push(k),
                    _ => on_border = true,
                }
            }
            let corners = model.triangles[of].vertices.map(|v| model.rest[v as usize]);
            let uvs = model.triangles[of].uvs.map(|uv| uv.map(|x| x as f32));
            // The triangle's area on the surface for each of its area in texels.
            let [a, b] = [minus2(uvs[1], uvs[0]), minus2(uvs[2], uvs[0])];
            let flat = (a[0] * b[1] - a[1] * b[0]).abs() * (width * height) as f32;
            let area = length(cross(minus(corners[1], corners[0]), minus(corners[2], corners[0])));
            part.push(texels.len());
            texels.push(Texel {
                tile,
                spot,
                position: spot.of(model, &model.rest),
                normal: unit(spot.of(model, normals)),
                area: if flat > 0.0 { area / flat } else { 0.0 },
                on_border,
            });
        }
        if !part.is_empty() {
            parts.push(part);
        }
    }
    parts
}

fn minus2(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// Joins parts that meet at a seam: texels at borders of charts that are nearly at one place.
fn across_seams(texels: &[Texel], parts: Vec<Vec<usize>>) -> Vec<Vec<usize>> {
    let ends = |part: &Vec<usize>| part.iter().copied().filter(|&t| texels[t].on_border).collect::<Vec<_>>();
    let ends: Vec<Vec<usize>> = parts.iter().map(ends).collect();
    // The next texel beyond a seam lies within three.
    let widest = ends.iter().flatten().map(|&t| 3.0 * texels[t].area.sqrt()).fold(0.0, f32::max);
    if widest == 0.0 {
        return parts;
    }
    let cell = |p: [f32; 3]| p.map(|x| (x / widest).floor() as i32);
    let mut at: HashMap<[i32; 3], Vec<(usize, usize)>> = HashMap::new();
    for (part, ends) in ends.iter().enumerate() {
        for &t in ends {
            at.entry(cell(texels[t].position)).or_default().push((part, t));
        }
    }
    let mut of: Vec<u32> = (0..parts.len() as u32).collect();
    for (part, ends) in ends.iter().enumerate() {
        for &t in ends {
            let [x, y, z] = cell(texels[t].position);
            for k in 0..27 {
                let near = [x + k % 3 - 1, y + k / 3 % 3 - 1, z + k / 9 - 1];
                for &(other, u) in at.get(&near).into_iter().flatten() {
                    let (a, b) = (&texels[t], &texels[u]);
                    let reach = 1.5 * (a.area.sqrt() + b.area.sqrt());
                    let meet = length(minus(a.position, b.position)) < reach && dot(a.normal, b.normal) > 0.0;
                    if other != part && meet {
                        join(&mut of, part as u32, other as u32);
                    }
                }
            }
        }
    }
    let mut whole: Vec<Vec<usize>> = vec![Vec::new(); parts.len()];
    for (k, part) in (0..).zip(parts) {
        whole[root(&mut of, k) as usize].extend(part);
    }
    whole.retain(|part| !part.is_empty());
    whole
}

/// The piece on a feature; nothing if its shape is too far from an ellipse.
fn piece(model: &Model, texels: &[Texel], part: &[usize]) -> Option<Piece> {
    let all = || part.iter().map(|&t| &texels[t]);
    let area: f32 = all().map(|t| t.area).sum();
    if part.len() < LEAST || area <= 0.0 {
        return None;
    }
    let mean = |of: fn(&Texel) -> [f32; 3]| all().fold([0.0; 3], |sum, t| plus(sum, of(t), t.area / area));
    let (middle, up) = (mean(|t| t.position), mean(|t| t.normal));
    if length(up) < FLAT {
        return None;
    }
    let normal = unit(up);
    // Second moments in the plane of the feature; those of an ellipse are a quarter of its squared radii.
    let helper = if normal[0].abs() < 0.8 { [1.0, 0.0, 0.0] } else { [0.0, 1.0, 0.0] };
    let e = unit(cross(normal, helper));
    let f = cross(normal, e);
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for t in all() {
        let way = minus(t.position, middle);
        let [x, y] = [dot(way, e), dot(way, f)];
        let share = t.area / area;
        (xx, xy, yy) = (xx + share * x * x, xy + share * x * y, yy + share * y * y);
    }
    let turn = 0.5 * (2.0 * xy).atan2(xx - yy);
    let along = unit(plus(e.map(|x| x * turn.cos()), f, turn.sin()));
    let (half, root) = (0.5 * (xx + yy), (0.25 * (xx - yy).powi(2) + xy * xy).sqrt());
    let radii = [half + root, half - root].map(|square| 2.0 * square.max(0.0).sqrt());
    let ellipse = std::f32::consts::PI * radii[0] * radii[1];
    if ellipse <= 0.0
        || area / ellipse < FULL
        || radii[0] > LARGEST * model.radius
        || radii[1] < ROUND * radii[0]
    {
        return None;
    }
    // The texel in the middle; a hollow feature has none there.
    let distance = |t: &Texel| {
        let way = minus(t.position, middle);
        length(plus(way, normal, -dot(way, normal)))
    };
    let nearest = all().min_by(|a, b| distance(a).total_cmp(&distance(b)))?;
    if distance(nearest) > 1.5 * nearest.area.sqrt() {
        return None;
    }
    let centre = towards(model, nearest, middle);
    let samples = all().step_by(part.len().div_ceil(SAMPLES)).map(|t| t.spot).collect();
    let frame = [along, cross(normal, along), normal];
    Some(Piece { tile: nearest.tile, uv: uv_of(model, centre), centre, frame, radii, samples })
}

/// The point of a texel's triangle, or of its plane, that is nearest to a place: texels are too coarse for a centre.
fn towards(model: &Model, texel: &Texel, place: [f32; 3]) -> Spot {
    let [a, b, c] = model.triangles[texel.spot.triangle].vertices.map(|v| model.rest[v as usize]);
    let (ab, ac, way) = (minus(b, a), minus(c, a), minus(place, a));
    let (bb, bc, cc) = (dot(ab, ab), dot(ab, ac), dot(ac, ac));
    let det = bb * cc - bc * bc;
    if det <= 0.0 {
        return texel.spot;
    }
    let s = (dot(way, ab) * cc - dot(way, ac) * bc) / det;
    let t = (dot(way, ac) * bb - dot(way, ab) * bc) / det;
    Spot { weights: [1.0 - s - t, s, t], ..texel.spot }
}

fn uv_of(model: &Model, spot: Spot) -> [f32; 2] {
    let uvs = model.triangles[spot.triangle].uvs;
    [0, 1].map(|c| (0..3).map(|k| spot.weights[k] * uvs[k][c] as f32).sum())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gltf::Choice;
    use crate::source::Files;

    #[test]
    fn each_disc_is_a_piece_with_its_place_and_size() {
        // Discs of two sizes, 6 by 6, on a sheet whose positions are its UVs.
        let model = Model::scene("squash");
        let canvas = Canvas::new(model.pages[0].rigidity.as_ref());
        let found = find(&model, std::slice::from_ref(&canvas));
        assert_eq!(found.len(), 36);
        for piece in &found {
            let [i, j] = piece.uv.map(|x| ((x - 0.04) / 0.92 * 6.0 - 0.5).round());
            let radius = if (i + j) % 2.0 == 0.0 { 0.05 } else { 0.22 / 6.0 };
            for (c, k) in [(0, i), (1, j)] {
                assert!((piece.uv[c] - 0.04 - 0.92 * (k + 0.5) / 6.0).abs() < 3e-4, "{:?}", piece.uv);
                // A texel is 0.002 wide.
                assert!((piece.radii[c] - radius).abs() < 0.0015, "{:?}", piece.radii);
            }
            assert!((piece.frame[2][2] - 1.0).abs() < 1e-5);
        }
        // Nothing stands on bars, rings, or what is all rigid.
        let of = |rigid: fn(f32, f32) -> bool| {
            let texel = |k: u32| rigid((k % 512) as f32 / 512.0 - 0.5, (k / 512) as f32 / 512.0 - 0.5);
            let texels = (0..512 * 512).map(|k| if texel(k) { 65535 } else { 0 }).collect();
            find(&model, &[Canvas { texels, ..canvas.clone() }]).len()
        };
        assert_eq!(of(|x, y| x.hypot(y) < 0.08), 1);
        assert_eq!(of(|x, y| x.abs() < 0.08 && y.abs() < 0.02), 0);
        assert_eq!(of(|x, y| (0.05..0.08).contains(&x.hypot(y))), 0);
        assert_eq!(of(|_, _| true), 0);
    }

    /// Two charts side by side on one sheet: a disc on their seam is one piece.
    #[test]
    fn halves_of_a_feature_on_both_sides_of_a_seam_are_one() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-pieces-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let (cells, mut text) = (8, String::new());
        for k in 0..(cells + 1) * (cells + 1) {
            text +=
                &format!("v {} {} 0\n", f64::from(k % (cells + 1)) / 8.0, f64::from(k / (cells + 1)) / 8.0);
        }
        for k in 0..cells * cells {
            let (i, j) = (k % cells, k / cells);
            let beyond = if i < cells / 2 { 0.0 } else { 0.1 };
            for (i, j) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                let [u, v] = [i, j].map(|x| 0.05 + 0.8 * f64::from(x) / 8.0);
                text += &format!("vt {} {v}\n", u + beyond);
            }
            let corner = j * (cells + 1) + i + 1;
            let around = [corner, corner + 1, corner + cells + 2, corner + cells + 1];
            let face: String = (1..5).zip(around).map(|(n, v)| format!(" {v}/{}", 4 * k + n)).collect();
            text += &format!("f{face}\n");
        }
        let rest = folder.join("rest.obj");
        std::fs::write(&rest, text).expect("written");
        let files = Files { rest: Some(rest), ..Files::default() };
        let model = Model::layered(&files, &Choice::default(), 0).expect("a mesh");
        let mut canvas = Canvas { size: [512; 2], texels: vec![0; 512 * 512], deep: false };
        for k in 0..512 * 512 {
            let [u, v] = canvas.uv([k % 512, k / 512]);
            let x = (if u < 0.5 { u - 0.05 } else { u - 0.15 }) / 0.8;
            if (x - 0.5).hypot((v - 0.05) / 0.8 - 0.4) < 0.1 {
                canvas.texels[k as usize] = 65535;
            }
        }
        let found = find(&model, &[canvas]);
        assert_eq!(found.len(), 1, "{found:?}");
        let centre = found[0].centre.of(&model, &model.rest);
        assert!(length(minus(centre, [0.5, 0.4, 0.0])) < 0.002, "{centre:?}");
        assert!(found[0].radii.iter().all(|radius| (radius - 0.1).abs() < 0.004), "{:?}", found[0].radii);
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
