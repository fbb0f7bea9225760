//! Charts that go on beyond their seams: what holds for every result, and how near both sides of a seam come together.

use std::f64::consts::TAU;

use vrtm::{
    Asset, Device, DeviceSettings, FetchKind, ImageViewMut, OpenBorders, Origin, Quality, Seams,
    SolveOptions, SolveRequest, Solver, Strided,
};
use vrtm_testkit::Lab as _;

use crate::open_borders;
use vrtm_testkit::features::{Borders, Kind, Summary, set_borders};
use vrtm_testkit::table::{self, judge};
use vrtm_testkit::{
    self, Maps, Model, Warp, bits, change, corner_uvs, cpu, dilation, long, on_all_cores, options, texels,
    view,
};

/// Place of a cut sheet's second half in the UV plane: turned by an angle, mirrored or not, scaled, and moved.
#[derive(Clone, Copy)]
pub struct Place {
    turn: f64,
    mirrored: bool,
    scale: f64,
    shift: [f64; 2],
}

const STAYS: Place = Place { turn: 0.0, mirrored: false, scale: 1.0, shift: [0.0, 0.0] };

/// A flat sheet over the square from 0.06 to 0.46 of the UV plane, with columns of rigid discs, two of them over its
/// middle; beyond the middle its UVs lie elsewhere, so that it has two charts. Without a place it is whole.
pub fn sheet(second: Option<Place>) -> Model {
    const N: usize = 40;
    let point = |i: usize, j: usize| [i as f64 / N as f64, j as f64 / N as f64];
    let rest: Vec<[f32; 3]> = (0..(N + 1) * (N + 1))
        .map(|k| {
            let [x, y] = point(k % (N + 1), k / (N + 1));
            [x as f32, y as f32, 0.0]
        })
        .collect();
    let own = |[x, y]: [f64; 2]| [0.06 + 0.4 * x, 0.06 + 0.4 * y];
    let moved = |p: [f64; 2]| {
        let Some(Place { turn, mirrored, scale, shift }) = second else { return own(p) };
        let [u, v] = own(p).map(|x| x * scale);
        let (sin, cos) = turn.sin_cos();
        let u = if mirrored { -u } else { u };
        [cos * u - sin * v + shift[0], sin * u + cos * v + shift[1]]
    };
    let mut model = Model { name: "sheet".into(), rest, ..Model::default() };
    for j in 0..N {
        for i in 0..N {
            for (di, dj) in [(0, 0), (1, 0), (1, 1), (0, 1)] {
                let p = point(i + di, j + dj);
                let uv = if i < N / 2 { own(p) } else { moved(p) };
                model.indices.push(((j + dj) * (N + 1) + i + di) as u32);
                model.uv_indices.push(model.uvs.len() as u32);
                model.uvs.push(uv.map(|x| x as f32));
            }
            model.face_counts.push(4);
        }
    }
    // Discs of a diameter of 0.036 in the UV plane.
    let is_rigid = |[x, y]: [f64; 2]| {
        let near = |x: f64, step: f64| (x / step - (x / step).round()) * step;
        (x > 0.05 && x < 0.95 && y > 0.05 && y < 0.95)
            && near(x - 0.5, 0.15).hypot(near(y - 0.5, 0.15)) < 0.045
    };
    let inverse = |uv: [f64; 2]| -> Option<[f64; 2]> {
        let on = |uv: [f64; 2]| uv.map(|x| (x - 0.06) / 0.4);
        let inside = |p: [f64; 2], x: [f64; 2]| (0.0..=1.0).contains(&p[1]) && (x[0]..=x[1]).contains(&p[0]);
        let first = on(uv);
        if inside(first, [0.0, if second.is_some() { 0.5 } else { 1.0 }]) {
            return Some(first);
        }
        let Place { turn, mirrored, scale, shift } = second?;
        let (sin, cos) = turn.sin_cos();
        let [u, v] = [uv[0] - shift[0], uv[1] - shift[1]];
        let [u, v] = [cos * u + sin * v, cos * v - sin * u];
        let p = on([if mirrored { -u } else { u } / scale, v / scale]);
        inside(p, [0.5, 1.0]).then_some(p)
    };
    let size = 1024;
    let mut udims: Vec<u32> = model
        .uvs
        .chunks(4)
        .map(|face| {
            let mean = |c: usize| face.iter().map(|uv| f64::from(uv[c])).sum::<f64>() / 4.0;
            1001 + mean(0).floor() as u32 + 10 * mean(1).floor() as u32
        })
        .collect();
    udims.sort_unstable();
    udims.dedup();
    for udim in udims {
        let origin = [(udim - 1001) % 10, (udim - 1001) / 10].map(f64::from);
        let texel = |k: usize| {
            let at = |k: usize| (k as f64 + 0.5) / size as f64;
            let uv = [at(k % size) + origin[0], 1.0 - at(k / size) + origin[1]];
            255 * u8::from(inverse(uv).is_some_and(is_rigid))
        };
        let rigidity = (0..size * size).map(texel).collect();
        model.maps.push(Maps { udim, width: size as u32, height: size as u32, rigidity, mask: None });
    }
    // The middle is stretched along both axes, and the sheet bends.
    let pose = |p: &[f32; 3]| {
        let [x, y] = [p[0], p[1]].map(f64::from);
        let bump = |x: f64| x + 0.06 * (TAU * x).sin() / TAU.sqrt();
        [
            bump(x) as f32,
            (y + 0.05 * (TAU * y).sin() * (2.0 * x).sin()) as f32,
            (0.2 * (3.0 * x).sin()) as f32,
        ]
    };
    model.frames = vec![model.rest.iter().map(pose).collect()];
    model
}

/// Beside the first half, turned and mirrored, one and a half times as large, and in another tile.
pub fn places() -> [(&'static str, Place); 5] {
    [
        ("apart", Place { shift: [0.2, 0.0], ..STAYS }),
        ("turned", Place { turn: 0.7, shift: [0.5, -0.1], ..STAYS }),
        ("mirrored", Place { mirrored: true, shift: [1.0, 0.4], ..STAYS }),
        ("larger", Place { scale: 1.4, shift: [0.1, 0.2], ..STAYS }),
        ("in another tile", Place { shift: [1.0, 0.0], ..STAYS }),
    ]
}

fn with(model: &Model, device: &Device, grid: u32, seams: Seams) -> Asset {
    let mut asset = model.asset_on(device, grid);
    set_borders(&mut asset, (seams, OpenBorders::Fixed));
    asset
}

/// The distances, in cells, between the warp of a cut sheet and that of the whole one at the nodes of the first half.
fn from_whole(device: &Device, second: Place, seams: Seams) -> Vec<f64> {
    let whole = sheet(None);
    let mut asset = with(&whole, device, 256, Seams::Shut);
    asset.solve(whole.frame(1), &SolveOptions::default()).unwrap();
    let expected = Warp::of(&asset, 0);
    let cut = sheet(Some(second));
    let mut asset = with(&cut, device, 256, seams);
    asset.solve(cut.frame(1), &SolveOptions::default()).unwrap();
    let warp = Warp::of(&asset, 0);
    let mut distances = Vec::new();
    for j in 0..=256usize {
        for i in 0..=256usize {
            let at = [i, j].map(|k| (k as f64 / 256.0 - 0.06) / 0.4);
            if (0.0..=1.0).contains(&at[1]) && (0.0..=0.5).contains(&at[0]) {
                let [a, b] = [expected.node(i, j), warp.node(i, j)];
                distances.push((a[0] - b[0]).hypot(a[1] - b[1]));
            }
        }
    }
    distances.sort_by(f64::total_cmp);
    distances
}

fn at(sorted: &[f64], share: f64) -> f64 {
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

#[test]
fn a_cut_sheet_warps_as_the_whole_one() {
    let device = cpu(0);
    for (name, place) in places() {
        let [shut, open] = [Seams::Shut, Seams::Continue].map(|seams| from_whole(&device, place, seams));
        let row = |d: &[f64]| [0.5, 0.9, 0.999, 1.0].map(|share| (at(d, share) * 1000.0).round() / 1000.0);
        println!(
            "{name}: cells from the whole sheet's warp: shut {:?}, continued {:?}",
            row(&shut),
            row(&open)
        );
        assert!(at(&open, 0.999) < 0.6 * at(&shut, 0.999), "{name}");
    }
}

/// Sheets whose charts go on: beyond seams within a tile and into another one, and at open borders.
fn sheets() -> [(Model, Borders); 3] {
    let beyond = (Seams::Continue, OpenBorders::Fixed);
    let [turned, in_another_tile] = [1, 4].map(|place: usize| sheet(Some(places()[place].1)));
    [(turned, beyond), (in_another_tile, beyond), (open_borders::sheet(true).model, open_borders::SLIDE)]
}

fn solved(model: &Model, device: &Device, grid: u32, borders: Borders, options: &SolveOptions) -> Asset {
    let mut asset = model.asset_on(device, grid);
    set_borders(&mut asset, borders);
    asset.solve(model.frame(1), options).unwrap();
    asset
}

#[test]
fn rest_and_rigid_motions_are_the_identity() {
    let (sin, cos) = 0.4f64.sin_cos();
    let turn = |p: &[f64; 3]| [cos * p[0] - sin * p[1] + 3.0, sin * p[0] + cos * p[1] - 0.5, p[2] - 1.0];
    for (model, borders) in sheets() {
        let mut asset = solved(&model, &cpu(2), 128, borders, &SolveOptions::default());
        assert!(!Warp::of(&asset, 0).is_identity());
        let rest = vrtm_testkit::doubles(&model.rest);
        let turned: Vec<[f64; 3]> = rest.iter().map(turn).collect();
        for pose in [&rest, &turned] {
            asset.solve(Strided::from_slice(pose), &SolveOptions::default()).unwrap();
            assert!(Warp::of(&asset, 0).is_identity(), "{borders:?}");
        }
    }
}

#[test]
fn bits_depend_neither_on_threads_nor_on_frames_before() {
    for (model, borders) in sheets() {
        let solved = |threads: u32| solved(&model, &cpu(threads), 256, borders, &SolveOptions::default());
        let expected = all_bits(&solved(1));
        assert!(expected == all_bits(&solved(3)), "other bits on three threads");
        let mut asset = solved(2);
        for pose in [&model.rest, &model.frames[0]] {
            asset.solve(Strided::from_slice(pose), &SolveOptions::default()).unwrap();
        }
        assert!(expected == all_bits(&asset), "the frames before are seen");
    }
}

#[test]
fn a_gpu_gives_the_same_to_a_fraction_of_a_cell() {
    let Some(gpu) = vrtm_testkit::gpu(&DeviceSettings::default()) else { return };
    let (larger, open) = (sheet(Some(places()[3].1)), open_borders::sheet(true).model);
    for (model, borders, solver) in [
        (&larger, (Seams::Continue, OpenBorders::Fixed), Solver::Descent),
        (&open, open_borders::SLIDE, Solver::Descent),
        (&open, open_borders::SLIDE, Solver::Pbd),
    ] {
        let options = SolveOptions { solver, ..options(Quality::Normal) };
        let [of_cpu, of_gpu] = [&cpu(0), &gpu].map(|device| {
            let mut asset = solved(model, device, 128, borders, &options);
            let map = vrtm_testkit::fetch(&mut asset, 0, FetchKind::Redirection, [300, 300]);
            (Warp::of(&asset, 0), map)
        });
        let apart = |a: &[[f32; 2]], b: &[[f32; 2]]| {
            let both = a.as_flattened().iter().zip(b.as_flattened());
            both.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
        };
        let [warp, map] = [apart(&of_cpu.0.u, &of_gpu.0.u), apart(&of_cpu.1, &of_gpu.1)];
        assert!(warp < 0.01 && of_cpu.0.longest() > 0.2, "{borders:?}, {solver:?}: {warp} cells");
        assert!(map < 0.01 / 128.0 || borders == open_borders::SLIDE, "{map}");
    }
}

/// A call that names the vertices that have moved gives what a solve of the whole pose gives: also for vertices on
/// which only the far end of a collar depends, and where charts of the other tile do not go on.
#[test]
fn tiles_that_nothing_moved_in_are_kept_with_the_same_bits() {
    let model = sheet(Some(places()[4].1));
    let assets = |seams: Seams| {
        let mut asset = with(&model, &cpu(2), 256, Seams::Continue);
        change(&mut asset, 1, |settings| settings.seams = seams);
        asset
    };
    for seams in [Seams::Continue, Seams::Shut] {
        let mut asset = assets(seams);
        asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
        let mut pose = model.frames[0].clone();
        for column in [0.4f32, 0.55, 0.575, 0.6, 0.625] {
            let near = |v: &u32| {
                let [x, y, _] = model.rest[*v as usize];
                (x - column).abs() < 1e-3 && (y - 0.5).abs() < 1e-3
            };
            let moved: Vec<u32> = (0..pose.len() as u32).filter(near).collect();
            assert_eq!(moved.len(), 1);
            pose[moved[0] as usize][2] += 0.03;
            solve_moved(&mut asset, &pose, &moved);
            let mut fresh = assets(seams);
            fresh.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
            assert!(all_bits(&fresh) == all_bits(&asset), "{seams:?}, a vertex at {column}");
        }
    }
}

/// Solves a pose in which no more than some vertices have moved.
fn solve_moved(asset: &mut Asset, pose: &[[f32; 3]], moved: &[u32]) {
    let positions = Strided::from_slice(pose);
    let request = SolveRequest { positions, dirty_vertices: Some(moved), ..SolveRequest::default() };
    asset.run(&request, &mut []).unwrap();
}

/// The bits of all tiles' displacements and of a redirection of each.
fn all_bits(asset: &Asset) -> Vec<u32> {
    let mut all = Vec::new();
    for tile in 0..asset.tile_count() {
        all.extend(asset.displacements(tile).unwrap().as_flattened().iter().map(|x| x.to_bits()));
        let map = texels(asset.results(), tile, FetchKind::Redirection, [100; 2], [0.0f32; 2]);
        all.extend(map.as_flattened().iter().map(|x| x.to_bits()));
    }
    all
}

#[test]
fn a_tile_follows_the_maps_of_its_neighbour() {
    let model = sheet(Some(places()[4].1));
    let mut asset = with(&model, &cpu(2), 256, Seams::Continue);
    let solve = |asset: &mut Asset| {
        asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
        bits(asset)
    };
    let before = solve(&mut asset);
    let saved = asset.tile_mut(0).save().unwrap();
    let elastic = vec![0u8; 1024 * 1024];
    let image = |bytes| view(bytes, 1024, 1024);
    asset.tile_mut(1).set_rigidity(Some(image(&elastic))).unwrap();
    assert!(before != solve(&mut asset), "the first tile does not see the second one's map");
    let error = asset.tile_mut(0).load(&saved).unwrap_err();
    assert!(error.message.contains("another mesh, map or setting"), "{error}");
    let mut fresh = with(&model, &cpu(2), 256, Seams::Continue);
    fresh.tile_mut(0).load(&saved).unwrap();
    assert!(before == solve(&mut fresh), "a loaded tile");
}

/// A scene; of its features at seams how many may have an error over 0.05, how many may be worse than with the original
/// UVs by 0.02, and the largest mean error; the same of features inside of charts; and how far both sides of a seam may
/// be apart at 50, 90 and 99 % of the vertices on seams, in texels of a texture of 4096 by 4096.
type Bars = (&'static str, (usize, usize, f64), (usize, usize, f64), [f64; 3]);

const BARS: [Bars; 6] = [
    ("creature", (0, 0, 0.003), (2, 0, 0.0155), [0.1, 4.7, 10.5]),
    ("mh_face", (2, 0, 0.0135), (9, 0, 0.0055), [0.01, 0.5, 2.5]),
    ("spot", (0, 0, 0.0045), (6, 0, 0.0285), [0.05, 1.3, 7.7]),
    ("cesium_man", (4, 0, 0.0115), (6, 0, 0.0062), [0.05, 0.5, 2.1]),
    ("fox", (39, 0, 0.072), (16, 0, 0.0385), [0.4, 7.9, 41.0]),
    ("ict_inner", (27, 0, 0.0225), (13, 0, 0.008), [0.18, 1.0, 2.6]),
];

#[test]
fn features_over_seams_keep_their_shape_and_stay_together() {
    let cases: Vec<_> =
        BARS.iter().filter_map(|bars| Some((table::model(bars.0)?, table::frame(bars.0), bars))).collect();
    let cases = long::share(cases, 3, "scenes");
    let failed = on_all_cores(&cases, |&(model, frame, bars)| {
        let judged = judge(model, frame, (Seams::Continue, OpenBorders::Fixed));
        let [seam, inside] = [Kind::Seam, Kind::Inner].map(|kind| judged.of(kind));
        let apart = [0.5, 0.9, 0.99].map(|share| at(&judged.gaps, share));
        let line = format!("{} {frame}: seam {seam:?}, inside {inside:?}, apart {apart:.2?}", model.name);
        let holds = |s: &Summary, bar: (usize, usize, f64)| {
            s.bad[1] <= bar.0 && s.worse <= bar.1 && s.mean[1] <= bar.2
        };
        let near = apart.iter().zip(bars.3).all(|(apart, bar)| *apart <= bar);
        (line, holds(&seam, bars.1) && holds(&inside, bars.2) && near)
    });
    for (line, _) in &failed {
        println!("{line}");
    }
    let failed: Vec<_> = failed.into_iter().filter(|(_, holds)| !holds).map(|(line, _)| line).collect();
    assert!(failed.is_empty(), "\n{}", failed.join("\n"));
}

/// Two charts with a gutter of one and a half cells between them: what leads over a seam ends in its own half of the
/// gutter, where a dilated texture shows what lies beyond the chart, and the report tells.
#[test]
fn redirections_end_where_the_gutter_does() {
    const GUTTER: f64 = 0.006;
    let (left, right) = (0.26, 0.26 + GUTTER);
    let mut model = sheet(Some(Place { shift: [GUTTER, 0.0], ..STAYS }));
    // One half shrinks and the other one grows, so that the texture moves over the seam.
    let pose = |p: &[f32; 3]| [0.5 + (p[0] - 0.5) * (1.0 + 0.6 * ((p[0] - 0.5) / 0.03).tanh()), p[1], 0.0];
    model.frames = vec![model.rest.iter().map(pose).collect()];
    let mut asset = with(&model, &cpu(2), 256, Seams::Continue);
    asset.solve(model.frame(1), &options(Quality::Normal)).unwrap();
    assert_eq!(asset.tile(0).report().unwrap().texels_limited, 0, "before the first image");
    let shown = dilation(&asset, 0, 0.03, 1024, [0.0f32; 2]);
    for size in [256u32, 500, 1024] {
        let map = vrtm_testkit::fetch(&mut asset, 0, FetchKind::Redirection, [size, size]);
        let report = asset.tile(0).report().unwrap();
        let mut over = 0.0f64;
        for (k, uv) in map.iter().enumerate() {
            let [x, y] = [k % size as usize, k / size as usize].map(|n| (n as f64 + 0.5) / f64::from(size));
            let u = f64::from(uv[0]);
            if !(0.06..0.46).contains(&y) || !(0.06..0.46).contains(&x) {
                continue;
            }
            if x < left {
                assert!(u < left, "{x}, {y}: {u}");
            } else if x > right && u < right {
                over = over.max(right - u);
                let [i, j] = uv.map(|x| (x * 1024.0) as usize);
                let shown = f64::from(shown[j * 1024 + i][0]);
                // The texel at the seam itself is the chart's own.
                assert!(shown < left || right - u < 1.0 / 1024.0, "{x}, {y}: {u} shows {shown}");
            }
        }
        println!("{size}: {} by {}, over {over}", report.texels_limited, report.max_limit);
        assert!(over > 0.0015 && over < 0.5 * GUTTER - 1.0 / 1024.0, "{over}");
        assert!(report.texels_limited > 200 && report.max_limit / size as f32 > 0.01, "{report:?}");
        // A part of the image is the same.
        let mut part = [[0.0f32; 2]; 40 * 30];
        let image = ImageViewMut::from_texels("image", &mut part, [40, 30]).unwrap();
        let first = [size * 13 / 50 - 20, size / 4];
        let image = image.with_origin(Origin::Bottom).part_of("image", [size; 2], first);
        asset.tile(0).fetch(FetchKind::Redirection, &mut image.unwrap()).unwrap();
        for (k, uv) in part.iter().enumerate() {
            let [x, y] = [first[0] as usize + k % 40, first[1] as usize + k / 40];
            assert_eq!(*uv, map[y * size as usize + x]);
        }
    }
    let uvs = corner_uvs(&asset);
    let own = |k: usize| model.uvs[model.uv_indices[k] as usize][0];
    let of_right = || (0..uvs.len()).filter(|&k| f64::from(own(k)) >= right - 1e-6);
    let over = of_right().map(|k| right - f64::from(uvs[k][0])).fold(0.0, f64::max);
    assert!(over > 0.0015 && over < 0.5 * GUTTER - 1.0 / 1024.0, "corners: {over}");
}
