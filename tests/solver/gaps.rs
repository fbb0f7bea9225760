//! Gaps of a chart that are thinner than a cell: slits, notches and crossings, at all angles, in sheets that a pose
//! squashes and shears, with more than half of them rigid. No node ends in one, whether the gap is a border of the
//! chart or welding has closed it. Nodes are found among the triangles that the host gave, by brute force in f64.

use std::f64::consts::PI;

use vrtm::{Quality, Weld, WeldBy};
use vrtm_testkit::{Maps, Model, Warp, cpu, cross, long, on_all_cores, options};

/// The side of the sheet in the tile.
const SIDE: f64 = 0.66;
/// Nodes that end farther outside than this, in cells, are outside.
const ROUNDING: f64 = 1e-3;

/// A straight gap along the lines of the sheet's quads.
#[derive(Clone, Copy, Debug)]
struct Gap {
    /// True if it runs along the second axis.
    upright: bool,
    /// Its position, and its two ends, as parts of the sheet's side.
    at: f64,
    from: f64,
    to: f64,
}

const fn along(at: f64, from: f64, to: f64) -> Gap {
    Gap { upright: false, at, from, to }
}

const fn across(at: f64, from: f64, to: f64) -> Gap {
    Gap { upright: true, at, from, to }
}

/// Relation of the corners on both sides of a gap.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sides {
    /// Vertices of their own: the gap is a border.
    Apart,
    /// One vertex with two UVs, closer than the tolerance.
    SameVertex,
    /// Two vertices at one place, welded by position, with UVs closer than the tolerance.
    SamePlace,
}

#[derive(Clone, Copy, Debug)]
struct Case<'a> {
    /// Quads on a side of the sheet, and cells on a side of the grid.
    quads: usize,
    grid: usize,
    gaps: &'a [Gap],
    /// In cells.
    width: f64,
    /// In degrees.
    angle: f64,
    sides: Sides,
    pose: usize,
    quality: Quality,
    /// The tolerance of UVs; `None` = the default.
    tolerance: Option<f64>,
}

/// A sheet with gaps, whose sides are moved apart by half of the width each. They meet where a gap ends.
fn sheet(case: &Case) -> Model {
    let n = case.quads;
    let mut is_cut = vec![[false; 2]; (n + 1) * (n + 1)];
    let vertex = |i: usize, j: usize| j * (n + 1) + i;
    let part = |x: f64| (x * n as f64).round() as usize;
    for gap in case.gaps {
        for k in part(gap.from)..part(gap.to) {
            let (i, j) = if gap.upright { (part(gap.at), k) } else { (k, part(gap.at)) };
            is_cut[vertex(i, j)][usize::from(gap.upright)] = true;
        }
    }
    // The UV corners, each with the vertex of the uncut sheet and how far it is moved, in half widths.
    let mut corners: Vec<(usize, [f64; 2])> = Vec::new();
    let mut quads = vec![[0usize; 4]; n * n];
    for (i, j) in (0..=n).flat_map(|j| (0..=n).map(move |i| (i, j))) {
        // The quads around a vertex, counter-clockwise; edge k lies between quads k and k + 1.
        let around = [(0, 0), (1, 0), (1, 1), (0, 1)];
        let exists =
            around.map(|(di, dj)| (1..=n).contains(&(i + 1 - di)) && (1..=n).contains(&(j + 1 - dj)));
        let edges = [
            is_cut[vertex(i, j)][1],
            i > 0 && is_cut[vertex(i - 1, j)][0],
            j > 0 && is_cut[vertex(i, j - 1)][1],
            is_cut[vertex(i, j)][0],
        ];
        let joined = |k: usize| exists[k] && exists[(k + 1) % 4] && !edges[k];
        let mut fan = [0, 1, 2, 3];
        for _ in 0..4 {
            for k in (0..4).filter(|&k| joined(k)) {
                let least = fan[k].min(fan[(k + 1) % 4]);
                (fan[k], fan[(k + 1) % 4]) = (least, least);
            }
        }
        for first in (0..4).filter(|&k| fan[k] == k && exists[k]) {
            let members: Vec<usize> = (0..4).filter(|&k| fan[k] == first && exists[k]).collect();
            let cut_along = |axis: usize| edges[3 - 3 * axis] || edges[1 + axis];
            let is_alone = (0..4).all(|k| !exists[k] || fan[k] == first);
            // Which side of a line through the vertex a fan lies on; 0 for both.
            let side = |axis: usize| {
                let low = |k: usize| if axis == 0 { around[k].0 == 1 } else { around[k].1 == 1 };
                let lows = members.iter().filter(|&&k| low(k)).count();
                f64::from(u8::from(lows == 0)) - f64::from(u8::from(lows == members.len()))
            };
            let moved = |axis: usize| if !is_alone && cut_along(1 - axis) { side(axis) } else { 0.0 };
            for &k in &members {
                let (x, y) = (i - around[k].0, j - around[k].1);
                quads[y * n + x][k] = corners.len();
            }
            corners.push((vertex(i, j), [moved(0), moved(1)]));
        }
    }
    let place = |v: usize| [v % (n + 1), v / (n + 1)].map(|x| x as f64 / n as f64 - 0.5);
    let (sin, cos) = (case.angle * PI / 180.0).sin_cos();
    let uv = |&(v, moved): &(usize, [f64; 2])| {
        let [x, y] = [0, 1].map(|c| place(v)[c] * SIDE + moved[c] * 0.5 * case.width / case.grid as f64);
        [0.5 + x * cos - y * sin, 0.5 + x * sin + y * cos].map(|x| x as f32)
    };
    let faces: Vec<[usize; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let of_corner = |c: usize| if case.sides == Sides::SameVertex { corners[c].0 } else { c };
    let vertices: Vec<usize> = match case.sides {
        Sides::SameVertex => (0..(n + 1) * (n + 1)).collect(),
        _ => corners.iter().map(|(v, _)| *v).collect(),
    };
    let pose = |[x, y]: [f64; 2]| match case.pose % 4 {
        0 => [0.45 * x, 1.1 * y, 0.0],
        1 => [1.1 * x, 0.45 * y, 0.0],
        2 => [x + 0.35 * (6.0 * y).tanh(), y, 0.0],
        _ => {
            let grown = 1.0 + 0.8 * (-8.0 * (x * x + y * y)).exp();
            [x * grown, y * grown, 0.3 * grown]
        }
    };
    let by = if case.sides == Sides::SamePlace { WeldBy::Position } else { WeldBy::Index };
    Model {
        rest: vertices.iter().map(|&v| [place(v)[0] as f32, place(v)[1] as f32, 0.0]).collect(),
        frames: vec![vertices.iter().map(|&v| pose(place(v)).map(|x| x as f32)).collect()],
        face_counts: vec![3; faces.len()],
        indices: faces.iter().flatten().map(|&c| of_corner(c) as u32).collect(),
        uv_indices: faces.iter().flatten().map(|&c| c as u32).collect(),
        uvs: corners.iter().map(uv).collect(),
        maps: vec![blotches(case.grid)],
        weld: Weld { by, uv_tolerance: case.tolerance, ..Weld::default() },
        ..Model::default()
    }
}

/// Rigid blotches of some cells, on three fifths of the tile.
fn blotches(grid: usize) -> Maps {
    let random = |i: usize, j: usize| {
        let mixed = (i as u64 * 0x9e37_79b9 + j as u64 * 0x85eb_ca6b + 1).wrapping_mul(0xd6e8_feb8_6659_fd93);
        (mixed >> 40) as f64 / (1u64 << 24) as f64
    };
    let rigid = |k: usize| {
        let [x, y] = [k % grid, k / grid].map(|x| x as f64 / 4.3);
        let [i, j] = [x, y].map(|x| x as usize);
        let (s, t) = (x.fract(), y.fract());
        let row = |j: usize| random(i, j) * (1.0 - s) + random(i + 1, j) * s;
        if row(j) * (1.0 - t) + row(j + 1) * t > 0.45 { 255 } else { 0 }
    };
    let (width, rigidity) = (grid as u32, (0..grid * grid).map(rigid).collect());
    Maps { udim: 1001, width, height: width, rigidity, mask: None }
}

/// Triangles, and which of them may meet each cell of a grid or lie a cell from it.
struct Triangles {
    grid: usize,
    corners: Vec<[[f64; 2]; 3]>,
    near: Vec<Vec<u32>>,
}

impl Triangles {
    fn of(model: &Model, grid: usize) -> Triangles {
        let corner = |&c: &u32| model.uvs[c as usize].map(|x| f64::from(x) * grid as f64);
        let corners: Vec<[[f64; 2]; 3]> =
            model.uv_indices.chunks_exact(3).map(|t| [0, 1, 2].map(|k| corner(&t[k]))).collect();
        let mut near = vec![Vec::new(); grid * grid];
        for (t, triangle) in corners.iter().enumerate() {
            let range = |c: usize| {
                let all = triangle.map(|p| p[c]);
                let low = all.into_iter().fold(f64::INFINITY, f64::min) - 1.0;
                let high = all.into_iter().fold(0.0, f64::max) + 1.0;
                low.max(0.0) as usize..(high as usize + 1).min(grid)
            };
            for y in range(1) {
                range(0).for_each(|x| near[y * grid + x].push(t as u32));
            }
        }
        Triangles { grid, corners, near }
    }

    /// Distance of a point from all triangles, in cells; at most 1.
    fn outside(&self, p: [f64; 2]) -> f64 {
        let [x, y] = p.map(|x| (x.max(0.0) as usize).min(self.grid - 1));
        let away = |&t: &u32| distance(&self.corners[t as usize], p);
        self.near[y * self.grid + x].iter().map(away).fold(1.0, f64::min)
    }
}

/// The distance of a point from a triangle; 0 inside.
fn distance(corners: &[[f64; 2]; 3], p: [f64; 2]) -> f64 {
    let edges = [0, 1, 2].map(|k| [corners[k], corners[(k + 1) % 3]]);
    let turns = edges.map(|[a, b]| cross(a, b, p));
    if turns.iter().all(|&x| x >= 0.0) || turns.iter().all(|&x| x <= 0.0) {
        return 0.0;
    }
    let from = |[a, b]: [[f64; 2]; 2]| {
        let d = [b[0] - a[0], b[1] - a[1]];
        let t = (d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1])) / (d[0] * d[0] + d[1] * d[1]);
        let t = t.clamp(0.0, 1.0);
        (p[0] - a[0] - t * d[0]).hypot(p[1] - a[1] - t * d[1])
    };
    edges.into_iter().map(from).fold(f64::INFINITY, f64::min)
}

/// The nodes that move, those of them that end outside, and how far outside at most.
fn solved(case: &Case) -> (usize, usize, f64) {
    let model = sheet(case);
    let mut asset = model.asset(1, case.grid as u32);
    assert_eq!(asset.info().charts, 1, "{case:?}");
    asset.solve(model.frame(1), &options(case.quality)).unwrap();
    let (warp, triangles) = (Warp::of(&asset, 0), Triangles::of(&model, case.grid));
    let (mut moved, mut outside, mut farthest) = (0, 0, 0.0f64);
    for n in (0..warp.u.len()).filter(|&n| warp.u[n] != [0.0; 2]) {
        let away = triangles.outside(warp.node(n % (case.grid + 1), n / (case.grid + 1)));
        moved += 1;
        outside += usize::from(away > ROUNDING);
        farthest = farthest.max(away);
    }
    (moved, outside, farthest)
}

/// Solves cases; prints per kind of sides, width and, for all widths, angle how many nodes move and end outside.
fn assert_none_outside(cases: &[Case]) {
    let results = on_all_cores(cases, solved);
    let report = |name: String, is_one: &dyn Fn(&Case) -> bool| {
        let all = || cases.iter().zip(&results).filter(|(case, _)| is_one(case)).map(|(_, result)| result);
        let [moved, outside] = [0, 1].map(|k| all().map(|r| [r.0, r.1][k]).sum::<usize>());
        let farthest = all().map(|r| r.2).fold(0.0, f64::max);
        if moved > 0 {
            println!("{name}: {moved} nodes move, {outside} end outside, by up to {farthest:.3} cells");
        }
    };
    for sides in [Sides::Apart, Sides::SameVertex, Sides::SamePlace] {
        for tenth in 1..10 {
            let width = f64::from(tenth) / 10.0;
            report(format!("{sides:?}, width {width}"), &|c| c.sides == sides && c.width == width);
        }
    }
    for angle in (0..12).map(|k| f64::from(k) * 15.0) {
        report(format!("from {angle} degrees on"), &|c| (angle..angle + 15.0).contains(&c.angle));
    }
    for (case, (moved, outside, farthest)) in cases.iter().zip(&results) {
        assert!(*moved > case.grid * case.grid / 8, "{moved} nodes move in {case:?}");
        assert_eq!(*outside, 0, "nodes end outside by up to {farthest} cells in {case:?}");
    }
}

const SHAPES: [&[Gap]; 6] = [
    &[along(0.5, 0.25, 0.75)],
    // Its sides are apart at one vertex only.
    &[along(0.5, 0.4, 0.55)],
    // Open at the border.
    &[along(0.5, 0.0, 0.6)],
    &[along(0.5, 0.2, 0.8), across(0.5, 0.2, 0.8)],
    &[along(0.5, 0.2, 0.8), across(0.5, 0.5, 0.9)],
    &[along(0.25, 0.2, 0.8), along(0.5, 0.2, 0.8), along(0.75, 0.2, 0.8)],
];

#[test]
fn no_node_ends_in_a_gap_thinner_than_a_cell() {
    let mut cases = Vec::new();
    for sides in [Sides::Apart, Sides::SameVertex, Sides::SamePlace] {
        for (step, width) in [0.1, 0.3, 0.5, 0.7, 0.9].into_iter().enumerate() {
            for turn in 0..12 {
                for (k, gaps) in SHAPES.into_iter().enumerate().filter(|(k, _)| (k + turn + step) % 3 == 0) {
                    // Multiples of 15 degrees, and others.
                    let angle = 15.0 * turn as f64 + if k % 2 == 0 { 0.0 } else { 1.7 * k as f64 };
                    let (pose, tolerance) = (k + turn + turn / 3, Some(1.0 / 96.0));
                    let quality = [Quality::Draft, Quality::Normal][pose / 4 % 2];
                    let grid = 96;
                    cases.push(Case { quads: 12, grid, gaps, width, angle, sides, pose, quality, tolerance });
                }
            }
        }
    }
    assert_none_outside(&long::share(cases, 4, "sheets"));
}

/// Sheets with gaps of each kind, for a grid of 96 by 96 cells.
pub fn small() -> Vec<(String, Model)> {
    let all =
        [Sides::Apart, Sides::SameVertex, Sides::SamePlace].into_iter().zip([0.3, 0.5, 0.7]).zip([3, 4, 5]);
    all.map(|((sides, width), shape)| {
        let gaps = SHAPES[shape];
        let (angle, pose, quality, tolerance) = (20.0, 2, Quality::Normal, Some(1.0 / 96.0));
        let case = Case { quads: 12, grid: 96, gaps, width, angle, sides, pose, quality, tolerance };
        (format!("{sides:?}, shape {shape}, {width} cells wide"), sheet(&case))
    })
    .collect()
}

/// The default tolerance is a quarter of a cell on a grid of 512, and half a cell on one of 1024.
#[test]
fn no_node_ends_in_a_gap_that_the_default_tolerance_closes() {
    let case = |(k, width): (usize, f64)| Case {
        quads: 40,
        grid: 512 << k,
        gaps: SHAPES[5],
        width,
        angle: 20.0,
        sides: Sides::SameVertex,
        pose: k,
        quality: Quality::Normal,
        tolerance: None,
    };
    let cases: Vec<Case> = [0.2, 0.4].into_iter().enumerate().map(case).collect();
    let cases = long::share(cases, 2, "sheets");
    for case in &cases {
        // It is welded: the chart has no border but that of the sheet.
        let mut asset = sheet(case).asset(1, case.grid as u32);
        assert_eq!(asset.info().border_edges as usize, 4 * case.quads);
        assert!(asset.tile_mut(0).info().unwrap().gap_nodes > 0);
    }
    assert_none_outside(&cases);
}

/// The noise of half floats is no gap: it fixes no node.
#[test]
fn half_floats_fix_no_node() {
    let noise = |x: f32, c: usize| half::f16::from_f32(x + (c % 2) as f32 * 1e-4).to_f32();
    let case = Case {
        quads: 12,
        grid: 96,
        gaps: &[],
        width: 0.0,
        angle: 20.0,
        sides: Sides::SameVertex,
        pose: 0,
        quality: Quality::Normal,
        tolerance: None,
    };
    let whole = sheet(&case);
    let uvs = |f: &dyn Fn(f32, usize) -> f32| {
        let uv = |(c, &k): (usize, &u32)| whole.uvs[k as usize].map(|x| f(x, c));
        let uv_indices = (0..whole.uv_indices.len() as u32).collect();
        let uvs = whole.uv_indices.iter().enumerate().map(uv).collect();
        Model { uvs, uv_indices, ..whole.clone() }
    };
    let movable = |model: &Model| {
        let mut asset = model.asset_on(&cpu(1), case.grid as u32);
        assert_eq!(asset.info().charts, 1);
        let info = asset.tile_mut(0).info().unwrap();
        assert_eq!(info.gap_nodes, 0);
        info.movable_nodes as f64
    };
    let noisy = movable(&uvs(&noise));
    assert!((noisy / movable(&whole) - 1.0).abs() < 0.02, "{noisy}");
    // A third of the corners, moved by as much as a step, but to no half floats.
    let other = movable(&uvs(&|x, c| if c % 3 == 0 { x + 4e-4 } else { x }));
    assert!((other / movable(&whole) - 1.0).abs() < 0.02, "{other}");
}

/// In a small chart a slit has a large share of the edges.
#[test]
fn a_slit_of_a_small_chart_is_no_noise() {
    let notches = [1, 2, 3, 4, 5, 6, 7].map(|k| across(f64::from(k) / 8.0, 0.0, 0.875));
    let case = Case {
        quads: 8,
        grid: 256,
        gaps: &notches,
        width: 4e-4 * 256.0,
        angle: 0.0,
        sides: Sides::SameVertex,
        pose: 0,
        quality: Quality::Normal,
        tolerance: None,
    };
    let triangles = sheet(&case);
    // The same as quads, without the diagonals that dilute the share.
    let quads = |of: &[u32]| of.chunks_exact(6).flat_map(|t| [t[0], t[1], t[2], t[5]]).collect();
    let model = Model {
        face_counts: vec![4; 64],
        indices: quads(&triangles.indices),
        uv_indices: quads(&triangles.uv_indices),
        ..triangles
    };
    assert!(model.asset(1, 256).tile_mut(0).info().unwrap().gap_nodes > 0);
}
