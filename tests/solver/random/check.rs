//! Checks what holds for every result, computed in f64 from the library's outputs; its reports are only compared with
//! that.

use vrtm::{
    Asset, Backend, Device, ErrorKind, FetchKind, ImageLayout, ImageView, OpenBorders, Overlap, PixelFormat,
    Seams, SolveOptions, TileSettings,
};
use vrtm_testkit::Lab as _;

use super::borders::{borders, hold};
use super::build::Model;
use super::recipe::{Layer, Recipe, Refusal, Then};
use vrtm_testkit::{Warp, corner_uvs as redirected_corners, cpu, cross, dilation, texels};

/// Events of a case, for counting the cases that test something.
#[derive(Clone, Copy, Debug, Default)]
pub struct Seen {
    /// A chart was solved.
    pub solved: bool,
    /// A node moved by more than a hundredth of a cell.
    pub moved: bool,
    /// A corner Jacobian fell under 0.1.
    pub crushed: bool,
    /// A chart fell back to the identity.
    pub fell_back: bool,
}

/// Panics if a check fails. `device` is that of the first run; `None` = a CPU device with the recipe's number of
/// threads.
pub fn check(recipe: &Recipe, device: Option<&Device>) -> Seen {
    let cpu_device = cpu(recipe.threads);
    let device = device.unwrap_or(&cpu_device);
    let model = recipe.model();
    let mut asset = recipe.asset(&model, device).unwrap();
    let mut seen = Seen::default();
    let bits = run(recipe, &model, &mut asset, &mut seen);
    let again = |mut asset: Asset| run(recipe, &model, &mut asset, &mut Seen::default());
    match &recipe.then {
        Then::Again => {
            assert!(bits == again(recipe.asset(&model, device).unwrap()), "other bits")
        }
        Then::Threads(threads) => {
            // On a GPU device, the CPU's threads only prepare and fetch.
            let other = cpu(*threads);
            let other = if device.info().backend == Backend::Cpu { &other } else { device };
            let fresh = recipe.asset(&model, other).unwrap();
            assert!(dilations(&asset) == dilations(&fresh), "another dilation on {threads} threads");
            assert!(bits == again(fresh), "other bits on {threads} threads");
        }
        Then::Alone if !recipe.options.warm => {
            let mut fresh = recipe.asset(&model, device).unwrap();
            recipe.solve(&mut fresh, model.poses.last().unwrap()).unwrap();
            assert!(displacements(&asset) == displacements(&fresh), "depends on the frames before");
        }
        Then::Alone => {}
        Then::Rest => {
            recipe.solve(&mut asset, &model.rest).unwrap();
            for tile in 0..asset.tile_count() {
                assert!(Warp::of(&asset, tile).is_identity(), "rest is not the identity");
            }
        }
        Then::Refused(refusal) => refused(recipe, &model, &mut asset, refusal),
    }
    seen
}

/// The bits of the dilations of all tiles.
fn dilations(asset: &Asset) -> Vec<u32> {
    const SIZE: u32 = 32;
    let of_tile = |tile| {
        let texels = dilation(asset, tile, 0.2, SIZE, [0.0f32; 4]);
        for &[u, v, zero, known] in &texels {
            assert!(u.is_finite() && v.is_finite() && zero == 0.0, "a dilation with {u} {v} {zero}");
            assert!(known == 0.0 || known == 1.0, "a dilation that is known by {known}");
        }
        texels.into_iter().flatten().map(f32::to_bits)
    };
    (0..asset.tile_count()).flat_map(of_tile).collect()
}

/// The bits of all displacements.
fn displacements(asset: &Asset) -> Vec<u32> {
    (0..asset.tile_count())
        .flat_map(|tile| asset.displacements(tile).unwrap())
        .flatten()
        .map(f32::to_bits)
        .collect()
}

/// Solves and checks all frames; returns the bits of all results.
fn run(recipe: &Recipe, model: &Model, asset: &mut Asset, seen: &mut Seen) -> Vec<u32> {
    let mut bits = Vec::new();
    for pose in &model.poses {
        recipe.solve(asset, pose).unwrap();
        for tile in 0..asset.tile_count() {
            warp(recipe, model, pose, asset, tile, seen);
            bits.extend(redirection(recipe, asset, tile));
        }
        let corners = redirected_corners(asset);
        assert!(corners.iter().flatten().all(|x| x.is_finite()), "a corner's UV is not finite");
        corner_uvs(recipe, model, asset, &corners);
        bits.extend(corners.iter().flatten().map(|x| x.to_bits()));
        bits.extend(displacements(asset));
    }
    bits
}

fn warp(recipe: &Recipe, model: &Model, pose: &[[f64; 3]], asset: &Asset, tile: usize, seen: &mut Seen) {
    let report = asset.tile(tile).report().unwrap();
    let warps = warps(recipe, asset, tile);
    let warp = Warp::of(asset, tile);
    let finite = warps.iter().flat_map(|warp| &warp.u).flatten().all(|x| x.is_finite());
    assert!(finite, "a displacement is not finite");
    let min_jacobian = warps.iter().map(Warp::min_jacobian).fold(f64::INFINITY, f64::min);
    assert!(min_jacobian > 0.0, "min J is {min_jacobian}, reported {}", report.min_jacobian);
    assert_eq!(report.folds, 0, "folds");
    // The GPU's value is a lower bound; for a tile without movable nodes it is the identity's.
    let reported = report.min_jacobian;
    assert!(reported > 0.0 && reported <= min_jacobian + 1e-12, "min J {min_jacobian}, reported {reported}");
    let longest = warps.iter().map(Warp::longest).fold(0.0, f32::max);
    let reported = report.max_displacement;
    assert!(
        (reported - longest).abs() <= 1e-6 * longest,
        "longest displacement {longest}, reported {reported}"
    );
    let (before, after) = (report.energy_before, report.energy);
    assert!(before.is_finite() && after <= before && after >= 0.0, "E before {before}, after {after}");
    for strain in report.strain.iter().flat_map(|strain| [strain.before, strain.after]) {
        let all =
            [strain.rms, strain.median, strain.max, strain.border_rms, strain.interior_rms, strain.free_rms];
        assert!(all.iter().all(|x| x.is_finite()), "{strain:?}");
    }
    seen.solved |= report.charts_active > 0;
    seen.moved |= longest > 0.01;
    seen.crushed |= min_jacobian < 0.1;
    seen.fell_back |= report.charts_fallback > 0;
    if goes_on(recipe) {
        return;
    }
    let held = held(recipe, model, pose, report.udim, [warp.nx, warp.ny]);
    let moved = held.iter().zip(&warp.u).position(|(held, u)| *held && *u != [0.0; 2]);
    assert_eq!(moved, None, "this node may not move");
}

fn goes_on(recipe: &Recipe) -> bool {
    recipe.settings.seams == Seams::Continue || recipe.settings.open_borders == OpenBorders::Slide
}

/// The warps whose displacements of a tile are checked: one of all charts, or one of each if charts go on beyond their
/// borders, where they may lie over one another.
fn warps(recipe: &Recipe, asset: &Asset, tile: usize) -> Vec<Warp> {
    let whole = Warp::of(asset, tile);
    if !goes_on(recipe) {
        return vec![whole];
    }
    let of_charts = asset.displacements_of_charts(tile).unwrap();
    of_charts.into_iter().map(|u| Warp { u, ..whole }).collect()
}

/// Distance from `to` at which the nearest warp puts `from`, along the axis of the greater distance.
fn off(warps: &[Warp], from: [f64; 2], to: [f64; 2], scale: [f64; 2]) -> f64 {
    let of = |warp: &Warp| {
        let back = warp.at(from);
        (0..2).map(|c| ((back[c] - to[c]) * scale[c]).abs()).fold(0.0, f64::max)
    };
    warps.iter().map(of).fold(f64::INFINITY, f64::min)
}

/// The nodes that must be fixed: masked, not wholly surrounded by faces, or at a border. (The library may fix more.)
fn held(recipe: &Recipe, model: &Model, pose: &[[f64; 3]], udim: u32, n: [usize; 2]) -> Vec<bool> {
    let width = n[0] + 1;
    let origin = [(udim - 1001) % 10, (udim - 1001) / 10].map(f64::from);
    let mut covered = vec![false; width * (n[1] + 1)];
    for (face, _) in model.faces.iter().zip(&model.textured).filter(|(_, textured)| **textured) {
        let uvs: Vec<[f64; 2]> = face.iter().map(|&k| model.uvs[k as usize].map(f64::from)).collect();
        if origin_of(&uvs) != origin {
            continue;
        }
        let p: Vec<[f64; 2]> =
            uvs.iter().map(|uv| [0, 1].map(|c| (uv[c] - origin[c]) * n[c] as f64)).collect();
        // These contain the triangles of every triangulation of the polygon.
        for c in 2..p.len() {
            for b in 1..c {
                (0..b).for_each(|a| cover([p[a], p[b], p[c]], n, &mut covered));
            }
        }
    }
    let masked = recipe.mask.as_ref().map(|mask| masked(mask, n));
    let free = |i: usize, j: usize| {
        let inside = (1..n[0]).contains(&i) && (1..n[1]).contains(&j);
        inside && (0..9).all(|k| covered[(j + k / 3 - 1) * width + i + k % 3 - 1])
    };
    let mut held: Vec<bool> = (0..covered.len())
        .map(|k| !free(k % width, k / width) || masked.as_ref().is_some_and(|masked| masked[k]))
        .collect();
    let uv = |v: u32| model.uvs[v as usize].map(f64::from);
    let solid = |face: &[u32]| is_solid(recipe, &face.iter().map(|&v| uv(v)).collect::<Vec<_>>());
    // Shared texels that belong to one chart are not held by the borders of others.
    if recipe.settings.overlap == Overlap::Fixed {
        for (f, edge) in borders(recipe, model, pose, solid) {
            let of_face: Vec<[f64; 2]> = model.faces[f].iter().map(|&v| uv(v)).collect();
            let ends = edge.map(|v| [0, 1].map(|c| (uv(v)[c] - origin[c]) * n[c] as f64));
            if origin_of(&of_face) == origin && !is_along_a_line(ends) {
                hold(ends, n, &mut held);
            }
        }
    }
    held
}

/// Cells from a grid line up to which a border along it counts as on it (method §1).
const OFF_LINE: f64 = 1e-3;

/// True for an edge along a grid line: it is on the line, if it is the border of a chart.
fn is_along_a_line([a, b]: [[f64; 2]; 2]) -> bool {
    let off = |c: usize| (a[c] - a[c].round()).abs().max((b[c] - b[c].round()).abs());
    (0..2).any(|c| a[c].round() == b[c].round() && off(c) > 0.0 && off(c) <= OFF_LINE)
}

/// Marks the nodes inside a triangle.
fn cover(p: [[f64; 2]; 3], n: [usize; 2], covered: &mut [bool]) {
    // UVs are f32, so that a node on an edge may lie outside by rounding.
    const SLACK: f64 = 1e-4;
    let span = |c: usize| {
        let low = p.iter().fold(f64::INFINITY, |m, p| m.min(p[c])) - 1.5 * OFF_LINE;
        let high = p.iter().fold(f64::NEG_INFINITY, |m, p| m.max(p[c])) + 1.5 * OFF_LINE;
        low.ceil().max(0.0) as usize..=high.floor().min(n[c] as f64) as usize
    };
    let sign = cross(p[0], p[1], p[2]).signum();
    if p.iter().flatten().any(|x| *x < -1e6) || span(0).is_empty() || span(1).is_empty() {
        return;
    }
    for j in span(1) {
        for i in span(0) {
            let q = [i as f64, j as f64];
            let inside = (0..3).all(|k| {
                let (a, b) = (p[k], p[(k + 1) % 3]);
                let slack = if is_along_a_line([a, b]) { 1.5 * OFF_LINE } else { SLACK };
                sign * cross(a, b, q) >= -slack * (b[0] - a[0]).hypot(b[1] - a[1])
            });
            covered[j * (n[0] + 1) + i] |= inside;
        }
    }
}

/// Nodes with a texel under 0.5 within half a cell.
fn masked(mask: &Layer, n: [usize; 2]) -> Vec<bool> {
    let values = mask.values();
    let span = |c: usize, node: usize| {
        let per_cell = f64::from(mask.size[c]) / n[c] as f64;
        // Slightly less than half a cell: whether a texel that only touches counts is left to the library.
        let [low, high] = [-0.499, 0.499].map(|half| ((node as f64 + half) * per_cell).floor() as i64);
        let last = i64::from(mask.size[c]) - 1;
        low.clamp(0, last) as usize..=high.clamp(0, last) as usize
    };
    let width = n[0] + 1;
    (0..width * (n[1] + 1))
        .map(|k| {
            span(1, k / width)
                .any(|y| span(0, k % width).any(|x| values[y * mask.size[0] as usize + x] < 0.5))
        })
        .collect()
}

/// Checks that the redirection lies in the tile, and that W maps it back to the texel's centre.
fn redirection(recipe: &Recipe, asset: &mut Asset, tile: usize) -> Vec<u32> {
    let size = recipe.output;
    let texels = texels(asset.results(), tile, FetchKind::Redirection, size, [f32::NAN; 4]);
    let floats = texels.as_flattened();
    // W maps the tile onto itself, so that redirections lie in the tile up to f32 rounding.
    let outside = floats.iter().position(|x| !(-1e-6..=1.0 + 1e-6).contains(x));
    assert_eq!(outside, None, "{:?} is outside of the tile", outside.map(|k| floats[k]));
    let warps = warps(recipe, asset, tile);
    let cells = [warps[0].nx as f64, warps[0].ny as f64];
    let scale = [0, 1].map(|c| f64::from(size[c]) / cells[c]);
    let mut drawn_back = 0;
    for (k, uv) in texels.iter().enumerate() {
        let from = [0, 1].map(|c| f64::from(uv[c]) * cells[c]);
        let centre = [k as u32 % size[0], k as u32 / size[0]].map(|x| f64::from(x) + 0.5);
        let to = [0, 1].map(|c| centre[c] / scale[c]);
        let off = off(&warps, from, to, scale);
        let good = off <= 1e-3 || goes_on(recipe) && is_drawn_back(&warps, from, to, scale);
        assert!(good, "texel {k} comes back {off:?} texels off");
        drawn_back += u64::from(off > 1e-3 && uv[3] > 0.0);
    }
    let limited = asset.tile(tile).report().unwrap().texels_limited;
    assert!(drawn_back <= limited, "{drawn_back} texels of charts are drawn back, but {limited} reported");
    floats.iter().map(|x| x.to_bits()).collect()
}

/// True if a redirection to `from` of the point `to`, both in cells, can be one that was drawn back because there is no
/// room in the gutter: on the ray from `to` through `from`, farther out, lies a point that W maps to `to`.
fn is_drawn_back(warps: &[Warp], from: [f64; 2], to: [f64; 2], scale: [f64; 2]) -> bool {
    let way = [from[0] - to[0], from[1] - to[1]];
    let length = way[0].hypot(way[1]);
    // Drawn back to where it came from, or so near that rounding hides the direction.
    if length < 1e-3 {
        return true;
    }
    let on_ray = |x: f64| off(warps, [0, 1].map(|c| to[c] + x / length * way[c]), to, scale);
    let farthest = 2.0 * warps[0].nx.max(warps[0].ny) as f64;
    const STEPS: usize = 4000;
    // Denser where they begin.
    let place = |k: usize| length + (k as f64 / STEPS as f64).powi(2) * farthest;
    let values: Vec<f64> = (0..=STEPS).map(|k| on_ray(place(k))).collect();
    let is_low = |k: &usize| {
        let beside = [k.saturating_sub(1), (k + 1).min(STEPS)];
        values[*k] < 1.0 && beside.iter().all(|&other| values[*k] <= values[other])
    };
    (0..=STEPS).filter(is_low).any(|k| {
        let [mut low, mut high] = [place(k.saturating_sub(1)), place(k + 1)];
        for _ in 0..60 {
            let [a, b] = [low + (high - low) / 3.0, high - (high - low) / 3.0];
            if on_ray(a) < on_ray(b) { high = b } else { low = a }
        }
        // The rounding of a UV in f32 turns the ray.
        on_ray(0.5 * (low + high)) <= 1e-3 + 1e-4 * low / length
    })
}

/// Checks that W maps each corner's new UV back to the original one.
fn corner_uvs(recipe: &Recipe, model: &Model, asset: &Asset, redirected: &[[f32; 2]]) {
    let mut redirected = redirected.iter();
    for (face, textured) in model.faces.iter().zip(&model.textured) {
        let given: Vec<[f64; 2]> = face.iter().map(|&k| model.uvs[k as usize].map(f64::from)).collect();
        let new: Vec<[f64; 2]> = redirected.by_ref().take(face.len()).map(|uv| uv.map(f64::from)).collect();
        let origin = origin_of(&given);
        let tile = 1001.0 + origin[0] + 10.0 * origin[1];
        // Corners of triangles without area belong to no chart and stay as they are.
        let solid = *textured && is_solid(recipe, &given);
        let Some(tile) = asset.find_tile(tile as u32).filter(|_| solid) else { continue };
        let warps = warps(recipe, asset, tile);
        let cells = [warps[0].nx as f64, warps[0].ny as f64];
        for (given, new) in given.iter().zip(new) {
            let [p, q] = [new, *given].map(|uv| [0, 1].map(|c| (uv[c] - origin[c]) * cells[c]));
            if (0..2).all(|c| (0.0..=cells[c]).contains(&q[c])) {
                let off = off(&warps, p, q, [1.0; 2]);
                // As for texels: the rounding of a UV in f32, magnified by W.
                let good = off <= 1e-3 || goes_on(recipe) && is_drawn_back(&warps, p, q, [1.0; 2]);
                assert!(good, "corner at {q:?}, redirected to {p:?}, comes back {off} cells off");
            }
        }
    }
}

/// Lower corner of the tile that holds a face.
fn origin_of(uvs: &[[f64; 2]]) -> [f64; 2] {
    [0, 1].map(|c| (uvs.iter().map(|uv| uv[c]).sum::<f64>() / uvs.len() as f64).floor())
}

/// False for a face that the library may have dropped a part of. A polygon may be cut into triangles of any three
/// corners that follow one another, or into a fan.
fn is_solid(recipe: &Recipe, p: &[[f64; 2]]) -> bool {
    let n = p.len();
    // Noise in UVs may turn a thin triangle over.
    let least = 10.0 * f64::from(recipe.joints.noise);
    let is_thin = |p: [[f64; 2]; 3]| is_thin(p, least);
    let ear = |k: usize| [p[k], p[(k + 1) % n], p[(k + 2) % n]];
    let fan = |k: usize| [p[0], p[k], p[k + 1]];
    (0..n).map(ear).chain((1..n - 1).map(fan)).all(|corners| !is_thin(corners))
}

fn is_thin(p: [[f64; 2]; 3], least: f64) -> bool {
    let d = |a: usize, b: usize| [p[b][0] - p[a][0], p[b][1] - p[a][1]];
    let (a, b, c) = (d(0, 1), d(0, 2), d(1, 2));
    let longest = [a, b, c].iter().map(|e| e[0] * e[0] + e[1] * e[1]).fold(0.0, f64::max);
    let area = (a[0] * b[1] - a[1] * b[0]).abs();
    area <= 1e-6 * longest || area <= least * longest.sqrt()
}

/// Checks that a refused call names its argument and changes nothing.
fn refused(recipe: &Recipe, model: &Model, asset: &mut Asset, refusal: &Refusal) {
    let before = displacements(asset);
    let mut pose = model.poses[0].clone();
    let (result, argument) = match *refusal {
        Refusal::NanPosition(k) | Refusal::InfinitePosition(k) => {
            let k = k as usize % pose.len();
            let nan = matches!(refusal, Refusal::NanPosition(_));
            pose[k][1] = if nan { f64::NAN } else { f64::INFINITY };
            (recipe.solve(asset, &pose), format!("positions[{k}]: component 1"))
        }
        Refusal::FewPositions => {
            pose.pop();
            (recipe.solve(asset, &pose), "positions: ".into())
        }
        Refusal::BadOption => {
            let options = SolveOptions { tolerance: Some(-1.0), ..recipe.options };
            (recipe.solve_with(asset, &pose, &options), "options.tolerance: ".into())
        }
        Refusal::NanTexel | Refusal::BadSetting if asset.tile_count() == 0 => return,
        Refusal::NanTexel => {
            let bytes = f32::NAN.to_ne_bytes();
            let view = ImageView::new("map", &bytes, ImageLayout::packed(1, 1, PixelFormat::F32)).unwrap();
            (asset.tile_mut(0).set_mask(Some(view)), "mask: texel (0, 0)".into())
        }
        Refusal::BadSetting => {
            let settings = TileSettings { room: -1.0, overlap: Overlap::Fixed, ..recipe.settings };
            (asset.tile_mut(0).set_settings(&settings), "settings.room: ".into())
        }
    };
    let error = result.expect_err(&argument);
    assert_eq!(error.kind, ErrorKind::InvalidArgument);
    assert!(error.message.starts_with(&argument), "{} instead of {argument}", error.message);
    assert!(before == displacements(asset), "a refused call changed the result");
}
