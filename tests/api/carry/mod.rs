//! Carried points: closed forms, rest and rigid motion, painted rims, features as bodies.

mod misuse;
mod random;
mod seams;
mod sheet;

use sheet::{Layout, P2, P3, Sheet, by_uv, disc, distance, fetch, lattice, solve, turned, uv};
use vrtm::{Bind, Carrier, CarrierSettings, Fit, PointState, Strided, TileSettings};

/// A surface with a bend in both directions.
fn bulge([x, y]: P2) -> P3 {
    [x, y, 0.2 * (1.0 - (2.0 * x - 1.0).powi(2)) * (1.0 - 0.5 * (2.0 * y - 1.0).powi(2))]
}

/// A rotation about (1, 2, 2) / 3 by the angle with cosine 0.6, and a step.
fn rigid(p: P3) -> P3 {
    let n = [1.0 / 3.0, 2.0 / 3.0, 2.0 / 3.0];
    let dot: f64 = (0..3).map(|k| n[k] * p[k]).sum();
    let cross = [n[1] * p[2] - n[2] * p[1], n[2] * p[0] - n[0] * p[2], n[0] * p[1] - n[1] * p[0]];
    std::array::from_fn(|k| 0.6 * p[k] + 0.8 * cross[k] + 0.4 * dot * n[k] + [5.0, -3.0, 2.0][k])
}

fn uvs(layout: Layout, points: &[P2]) -> Vec<P2> {
    points.iter().map(|p| uv(layout, *p, p[0] > 0.5)).collect()
}

/// Carriers of the same points by each of the ways to bind them, and the points' positions at rest.
fn all_ways(sheet: &Sheet, asset: &vrtm::Asset, fit: Fit) -> Vec<(&'static str, Carrier, Vec<P3>)> {
    let points = lattice(9);
    let mut ways = Vec::new();
    ways.push(("uv", by_uv(asset, &uvs(sheet.layout, &points), None, fit, 0)));
    let on_sheet: Vec<P3> = points.iter().map(|p| sheet.at(&sheet.rest, *p, 0)).collect();
    let off: Vec<P3> =
        on_sheet.iter().enumerate().map(|(k, p)| [p[0] + 0.01, p[1], p[2] + 0.002 * k as f64]).collect();
    let frames = vec![[0.6f32, 0.0, 0.0, 0.8]; points.len()];
    let frames = Some(Strided::from_slice(&frames));
    let by = Bind::Nearest { positions: Strided::from_slice(&off), farthest: None };
    ways.push((
        "nearest",
        asset.carrier(&CarrierSettings { fit, frames, ..CarrierSettings::new(by) }).unwrap(),
    ));
    // The first three corners of some faces.
    let corners: Vec<[u32; 3]> = (0..81).map(|k| [4 * k, 4 * k + 1, 4 * k + 3]).collect();
    let weights = vec![[1.0f32, 2.0, 1.0]; 81];
    let weights = Strided::from_slice(&weights);
    let by = Bind::Corners { corners: &corners, weights };
    ways.push(("corners", asset.carrier(&CarrierSettings { fit, ..CarrierSettings::new(by) }).unwrap()));
    let of_corners = |c: &[u32; 3]| {
        let [a, b, c] = c.map(|c| sheet.rest[sheet.indices[c as usize] as usize]);
        std::array::from_fn(|k| 0.25 * a[k] + 0.5 * b[k] + 0.25 * c[k])
    };
    let by_corners: Vec<P3> = corners.iter().map(of_corners).collect();
    ways.into_iter()
        .zip([on_sheet, off, by_corners])
        .map(|((name, carrier), rest)| (name, carrier, rest))
        .collect()
}

#[test]
fn rest_and_rigid_motion_are_exact() {
    for layout in [Layout::Whole, Layout::Cut] {
        for seams in [vrtm::Seams::Shut, vrtm::Seams::Continue] {
            let sheet = Sheet::new(16, layout, bulge);
            let settings = TileSettings { seams, ..TileSettings::default() };
            let mut asset = sheet.asset(1, 64, disc([0.5, 0.5], 0.2), settings);
            for fit in [Fit::Feature, Fit::Surface, Fit::None] {
                let ways = all_ways(&sheet, &asset, fit);
                for (is_moved, motion) in [(false, (|p| p) as fn(P3) -> P3), (true, rigid)] {
                    let pose: Vec<P3> = sheet.rest.iter().map(|p| motion(*p)).collect();
                    solve(&mut asset, &pose);
                    for (name, carrier, rest) in &ways {
                        let all = fetch(carrier);
                        assert_eq!(carrier.info().outside, 0, "{name}");
                        for (k, at) in rest.iter().enumerate() {
                            let error = distance(all.positions[k], motion(*at));
                            assert!(
                                error < 1e-6,
                                "{layout:?} {seams:?} {fit:?} {name} {is_moved} {k}: {error:e}"
                            );
                            let host = |p: P3| match *name {
                                // About x, with 0.6 as sine of half the angle.
                                "nearest" => [p[0], 0.28 * p[1] - 0.96 * p[2], 0.96 * p[1] + 0.28 * p[2]],
                                _ => p,
                            };
                            for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                                let zero = motion([0.0; 3]);
                                let of = motion(host(axis));
                                let expected = std::array::from_fn(|k| of[k] - zero[k]);
                                let error = distance(turned(all.rotations[k], axis), expected);
                                assert!(error < 1e-6, "{fit:?} {name} {k}: turned by {error:e}");
                            }
                            let stretch = all.stretch[k];
                            assert!((stretch[0] - 1.0).abs() < 1e-5 && (stretch[1] - 1.0).abs() < 1e-5);
                        }
                        assert!(carrier.info().rim < 1e-6);
                    }
                }
            }
        }
    }
}

/// Largest errors of points with a height over a pose that is known: of positions, rotations and stretch.
fn errors(
    side: usize,
    rest: fn(P2) -> P3,
    pose: fn(P2) -> P3,
    expected: impl Fn(P2, f64) -> (P3, [f64; 9], P2),
) -> [f64; 3] {
    let sheet = Sheet::new(side, Layout::Whole, rest);
    let mut asset = sheet.asset(1, 32, |_| 0.0, TileSettings::default());
    let points: Vec<P2> = lattice(12).iter().map(|p| p.map(|x| 0.1 + 0.8 * x)).collect();
    let heights: Vec<f64> = (0..points.len()).map(|k| 0.001 * k as f64).collect();
    let carrier = by_uv(&asset, &uvs(Layout::Whole, &points), Some(&heights), Fit::Surface, 0);
    solve(&mut asset, &sheet.pose(pose));
    let all = fetch(&carrier);
    let mut errors = [0.0f64; 3];
    for (k, p) in points.iter().enumerate() {
        let (position, rotation, stretch) = expected(*p, heights[k]);
        let apart = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let of_point = [
            distance(all.positions[k], position),
            apart(&all.rotations[k], &rotation),
            apart(&all.stretch[k], &stretch),
        ];
        errors = [0, 1, 2].map(|c| errors[c].max(of_point[c]));
    }
    errors
}

const IDENTITY: [f64; 9] = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0];

#[test]
fn a_stretched_plane() {
    let pose = |[x, y]: P2| [2.0 * x, y + 0.5, 1.0];
    let flat = |[x, y]: P2| [x, y, 0.0];
    let found = errors(16, flat, pose, |[x, y], h| ([2.0 * x, y + 0.5, 1.0 + h], IDENTITY, [2.0, 1.0]));
    // Everything is affine: what is left is the rounding of f32 UVs.
    assert!(found.iter().all(|error| *error < 1e-6), "{found:?}");
    // A shear turns by the polar angle, arctan of half of it.
    let sheared = |[x, y]: P2| [x + y, y, 0.0];
    let found = errors(16, flat, sheared, |[x, y], h| {
        let (c, s) = (2.0 / 5f64.sqrt(), 1.0 / 5f64.sqrt());
        let golden = (1.0 + 5f64.sqrt()) / 2.0;
        ([x + y, y, h], [c, s, 0.0, -s, c, 0.0, 0.0, 0.0, 1.0], [golden, 1.0 / golden])
    });
    assert!(found.iter().all(|error| *error < 2e-6), "{found:?}");
}

#[test]
fn a_bent_cylinder() {
    fn pose([x, y]: P2) -> P3 {
        [x.sin(), y, 1.0 - x.cos()]
    }
    let of_side = |side: usize| {
        errors(
            side,
            |[x, y]| [x, y, 0.0],
            pose,
            |[x, y], h| {
                let (s, c) = x.sin_cos();
                ([s - h * s, y, 1.0 - c + h * c], [c, 0.0, -s, 0.0, 1.0, 0.0, s, 0.0, c], [1.0; 2])
            },
        )
    };
    let [coarse, fine] = [of_side(32), of_side(64)];
    println!("cylinder: 32 {coarse:?}, 64 {fine:?}");
    // The chord's sagitta is h²/8 = 1.2e-4 at 32; tangents are means over vertices, of second order as well.
    assert!(fine.iter().all(|error| *error < 1.5e-4), "{fine:?}");
    assert!((0..3).all(|k| fine[k] < 0.35 * coarse[k]), "{coarse:?} {fine:?}");
}

#[test]
fn an_inflated_sphere() {
    fn sphere([x, y]: P2) -> P3 {
        let (p, q) = (0.8 * (x - 0.5), 0.8 * (y - 0.5));
        let r = (1.0 + p * p + q * q).sqrt();
        [p / r, q / r, 1.0 / r]
    }
    let of_side = |side: usize| {
        errors(
            side,
            sphere,
            |p| sphere(p).map(|x| 1.5 * x),
            |p, h| {
                let n = sphere(p);
                (n.map(|x| (1.5 + h) * x), IDENTITY, [1.5; 2])
            },
        )
    };
    let [coarse, fine] = [of_side(24), of_side(48)];
    println!("sphere: 24 {coarse:?}, 48 {fine:?}");
    // Frames and stretch are exact, as the pose is a multiple of the rest; positions have the sagitta, and h times the
    // error of the normal.
    assert!(fine[1] < 1e-6 && fine[2] < 1e-5 && fine[0] < 2e-4, "{fine:?}");
    assert!(fine[0] < 0.35 * coarse[0], "{coarse:?} {fine:?}");
}

/// A pose that stretches and bends.
fn warped([x, y]: P2) -> P3 {
    let s = x + 0.35 * x * (1.0 - x) * (1.0 - (2.0 * y - 1.0).powi(2));
    [s.sin(), y * (1.0 + 0.2 * x), 1.0 - s.cos()]
}

#[test]
fn a_feature_is_one_body() {
    let (centre, radius) = ([0.5, 0.5], 0.15);
    let sheet = Sheet::new(24, Layout::Whole, |[x, y]| [x, y, 0.0]);
    let mut asset = sheet.asset(2, 128, disc(centre, radius), TileSettings::default());
    let around = |r: f64| (0..24).map(move |k| (r, f64::from(k) * std::f64::consts::TAU / 24.0));
    let points: Vec<P2> = [0.02, 0.08, 0.13]
        .into_iter()
        .flat_map(around)
        .map(|(r, a)| [0.5 + r * a.cos(), 0.5 + r * a.sin()])
        .collect();
    let heights: Vec<f64> = (0..points.len()).map(|k| 0.002 * k as f64).collect();
    let carriers = [Fit::Feature, Fit::Surface, Fit::None]
        .map(|fit| by_uv(&asset, &uvs(Layout::Whole, &points), Some(&heights), fit, 0));
    solve(&mut asset, &sheet.pose(warped));
    let at_rest: Vec<P3> = points.iter().zip(&heights).map(|(p, h)| [p[0], p[1], *h]).collect();
    let largest = carriers.each_ref().map(|carrier| {
        let all = fetch(carrier);
        let mut largest: f64 = 0.0;
        for a in 0..points.len() {
            for b in 0..a {
                let (rest, posed) =
                    (distance(at_rest[a], at_rest[b]), distance(all.positions[a], all.positions[b]));
                largest = largest.max((posed / rest - 1.0).abs());
            }
        }
        largest
    });
    let info = carriers[0].info();
    println!("a feature's edges change by {largest:?} (feature, surface, none); rim {:e}", info.rim);
    assert_eq!(info.features, 1);
    assert!(largest[0] < 1e-5 && largest[1] > 1e-3 && largest[2] > 0.1, "{largest:?}");
    // The rim of a disc of radius 0.15 on a bend of radius 1 stands off by r²/2 at most.
    assert!(info.rim > 1e-4 && info.rim < 0.15 * 0.15 / 2.0, "{}", info.rim);
    let all = fetch(&carriers[0]);
    for m in &all.rotations {
        let rows = [0, 3, 6].map(|r| [m[r], m[r + 1], m[r + 2]]);
        let cross = [1, 2, 0].map(|k| rows[0][k] * rows[1][(k + 1) % 3] - rows[0][(k + 1) % 3] * rows[1][k]);
        assert!(distance(cross, rows[2]) < 1e-6, "a rotation, no reflection: {m:?}");
        assert!(m.iter().zip(&all.rotations[0]).all(|(a, b)| (a - b).abs() < 1e-6), "all turn alike");
    }
}

#[test]
fn a_feature_whose_motion_is_known() {
    // Squashed and turned about the feature's centre: by symmetry, it only turns.
    let sheet = Sheet::new(24, Layout::Whole, |[x, y]| [x - 0.5, y - 0.5, 0.0]);
    let mut asset = sheet.asset(2, 128, disc([0.5, 0.5], 0.15), TileSettings::default());
    let points: Vec<P2> = lattice(7).iter().map(|p| p.map(|x| 0.4 + 0.2 * x)).collect();
    let carrier = by_uv(&asset, &uvs(Layout::Whole, &points), None, Fit::Feature, 0);
    let pose = |[x, y]: P2| {
        let (x, y) = (0.8 * (x - 0.5), y - 0.5);
        [0.6 * x - 0.8 * y + 3.0, 0.8 * x + 0.6 * y, 1.0]
    };
    solve(&mut asset, &sheet.pose(pose));
    let all = fetch(&carrier);
    for (k, [x, y]) in points.iter().map(|p| p.map(|x| x - 0.5)).enumerate() {
        let error = distance(all.positions[k], [0.6 * x - 0.8 * y + 3.0, 0.8 * x + 0.6 * y, 1.0]);
        // The solve itself is symmetric to about a hundredth of a cell of 1/115.
        assert!(error < 2e-4, "{k}: {error:e}");
        assert!(distance(turned(all.rotations[k], [1.0, 0.0, 0.0]), [0.6, 0.8, 0.0]) < 2e-4);
    }
}

#[test]
fn rigidity_blends_and_skirts_hold_on() {
    let sheet = Sheet::new(24, Layout::Whole, |[x, y]| [x, y, 0.0]);
    let ramp = |p: P2| (1.5 - ((p[0] - 0.5).hypot(p[1] - 0.5)) / 0.2).clamp(0.0, 1.0);
    let mut asset = sheet.asset(1, 64, ramp, TileSettings::default());
    let points: Vec<P2> = (0..200).map(|k| [0.5 + 0.4 * f64::from(k) / 200.0, 0.5]).collect();
    let uvs = uvs(Layout::Whole, &points);
    let low = vec![0.0; points.len()];
    let high = vec![0.02; points.len()];
    let with = |heights: &[f64], skirt: f64| {
        let pairs: Vec<[f32; 2]> = uvs.iter().map(|uv| uv.map(|x| x as f32)).collect();
        let heights: Vec<f32> = heights.iter().map(|h| *h as f32).collect();
        let by = Bind::Uv { uvs: Strided::from_slice(&pairs), layers: None };
        let heights = Some(Strided::from_slice(&heights));
        asset.carrier(&CarrierSettings { heights, skirt, ..CarrierSettings::new(by) }).unwrap()
    };
    let carriers = [with(&low, 0.0), with(&low, 0.02), with(&high, 0.02), with(&high, 0.0)];
    let surface = by_uv(&asset, &uvs, None, Fit::Surface, 0);
    solve(&mut asset, &sheet.pose(warped));
    let [low, skirted, high, plain] = carriers.each_ref().map(fetch);
    let surface = fetch(&surface);
    let mut largest: f64 = 0.0;
    for k in 1..points.len() {
        // From one point to the next, no step: neighbours are 0.002 apart.
        let step = distance(low.positions[k], low.positions[k - 1]);
        assert!(step < 0.004, "{k}: {step}");
        largest = largest.max(distance(low.positions[k], surface.positions[k]));
        // At height 0 the skirt is the surface, and from its height on the body.
        assert!(distance(skirted.positions[k], surface.positions[k]) < 1e-6);
        assert!(distance(high.positions[k], plain.positions[k]) < 1e-9);
    }
    assert!(largest > 1e-4, "the body leaves the surface: {largest}");
    // The UVs of the others are rounded to f32.
    assert!(
        distance(surface.positions[199], low.positions[199]) < 1e-7,
        "beyond the feature there is only the surface"
    );
}

#[test]
fn pieces_are_bodies() {
    let sheet = Sheet::new(24, Layout::Whole, |[x, y]| [x, y, 0.0]);
    let mut asset = sheet.asset(1, 64, |_| 0.0, TileSettings::default());
    let points = lattice(10);
    let rest: Vec<P3> = points.iter().map(|p| [p[0], p[1], 0.01]).collect();
    // Quarters, a point alone, and two that belong to none.
    let quarter = |p: &P2| u32::from(p[0] > 0.5) + 2 * u32::from(p[1] > 0.5);
    let mut pieces: Vec<u32> = points.iter().map(quarter).collect();
    (pieces[0], pieces[1], pieces[2]) = (77, u32::MAX, u32::MAX);
    let by = Bind::Nearest { positions: Strided::from_slice(&rest), farthest: None };
    let settings = CarrierSettings { pieces: Some(&pieces), ..CarrierSettings::new(by) };
    let carrier = asset.carrier(&settings).unwrap();
    let plain = asset.carrier(&CarrierSettings { pieces: None, ..settings }).unwrap();
    solve(&mut asset, &sheet.pose(warped));
    let (all, plain) = (fetch(&carrier), fetch(&plain));
    for k in 0..3 {
        assert_eq!(all.positions[k], plain.positions[k], "a point alone says nothing of how it turns");
    }
    for a in 3..points.len() {
        for b in 3..a {
            let change = distance(all.positions[a], all.positions[b]) / distance(rest[a], rest[b]) - 1.0;
            assert!(pieces[a] != pieces[b] || change.abs() < 1e-6, "{a} {b}: {change}");
        }
    }
}

#[test]
fn what_cannot_be_bound_keeps_the_motion_of_the_skin() {
    let sheet = Sheet::new(8, Layout::Whole, bulge);
    let mut asset = sheet.asset(1, 64, disc([0.5, 0.5], 0.3), TileSettings::default());
    let at = [0.5, 0.5, 0.7];
    let far =
        Bind::Nearest { positions: Strided::from_slice(std::slice::from_ref(&at)), farthest: Some(0.1) };
    let far = asset.carrier(&CarrierSettings::new(far)).unwrap();
    assert_eq!((far.states(), far.info().too_far), (&[PointState::Far][..], 1));
    let outside = by_uv(&asset, &[[0.99, 0.5], [7.3, 0.2], [-1.0, 4.0]], None, Fit::Feature, 0);
    assert_eq!(outside.info().outside, 3);
    solve(&mut asset, &sheet.pose(|p| rigid(bulge(p))));
    assert!(distance(fetch(&far).positions[0], rigid(at)) < 1e-6);
    assert!(distance(fetch(&outside).positions[0], rigid(bulge([1.0, 0.5 - 0.05 + 0.05]))) < 0.1);
    solve(&mut asset, &sheet.pose(warped));
    assert!(fetch(&far).positions[0].iter().chain(&fetch(&outside).positions[1]).all(|x| x.is_finite()));
}

/// Neither the number of threads, nor the points beside it and their order, nor the outputs asked for change where a
/// point is.
#[test]
fn a_point_is_carried_as_if_it_were_alone() {
    let sheet = Sheet::new(16, Layout::Cut, bulge);
    // The map's grid lies across the charts' borders, along which texture slides.
    let mut points = lattice(40);
    points.extend((0..200).map(|k| [f64::from(k) / 199.0, 1e-4]));
    let all = uvs(Layout::Cut, &points);
    let settings = TileSettings { open_borders: vrtm::OpenBorders::Slide, ..TileSettings::default() };
    let of = |threads: u32, numbers: &[usize], height: Option<f64>| {
        let mut asset = sheet.asset(threads, 64, disc([0.5, 0.05], 0.2), settings);
        let uvs: Vec<P2> = numbers.iter().map(|&k| all[k]).collect();
        let heights = height.map(|height| vec![height; uvs.len()]);
        let carrier = by_uv(&asset, &uvs, heights.as_deref(), Fit::Feature, 0);
        solve(&mut asset, &sheet.pose(warped));
        carrier
    };
    let every: Vec<usize> = (0..all.len()).collect();
    let backwards = every.iter().copied().rev().collect();
    let few = every.iter().copied().step_by(7).collect();
    for height in [None, Some(0.01)] {
        let expected = fetch(&of(1, &every, height));
        for (threads, numbers) in [(5, &every), (1, &backwards), (2, &few)] {
            let carrier = of(threads, numbers, height);
            for wanted in 1..16 {
                let found = sheet::fetch_some(&carrier, wanted);
                for (n, &k) in numbers.iter().enumerate() {
                    let same = [
                        found.positions[n] == expected.positions[k],
                        found.rotations[n] == expected.rotations[k],
                        found.stretch[n] == expected.stretch[k],
                        found.uvs[n] == expected.uvs[k],
                    ];
                    let is_as_wanted = |bit: usize| same[bit] || wanted & 1 << bit == 0;
                    assert!((0..4).all(is_as_wanted), "{threads} {wanted} {k} {height:?}: {same:?}");
                }
            }
        }
    }
}

/// Bodies near a line, whose rotation about it is lost in the rounding of f32, go along with the surface instead.
#[test]
fn nearly_collinear_bodies_follow_rigid_motions() {
    let mut draw = vrtm_testkit::random::Random(7);
    for (away, most) in [(0.0, 0.01), (1.0, 0.01), (300.0, 0.05)] {
        let rounded = |p: P3| p.map(|x| f64::from((x + away) as f32));
        // A row of nodes is rigid as well.
        let row = |p: P2| f64::from(u8::from((p[1] - 0.5).abs() < 0.6 / 64.0 && (p[0] - 0.5).abs() < 0.3));
        let sheet = Sheet::new(16, Layout::Whole, |[x, y]| rounded([x, y, 0.0]));
        let mut asset = sheet.asset(1, 64, row, TileSettings::default());
        let (mut points, mut pieces) = (Vec::new(), Vec::new());
        for piece in 0..400 {
            let [from, along]: [P2; 2] =
                std::array::from_fn(|_| [draw.between(0.2, 0.8), draw.between(0.2, 0.8)]);
            let width = 10f64.powf(draw.between(-9.0, -1.0));
            for _ in 0..6 {
                let part = draw.part();
                points.push(
                    [0, 1].map(|c| from[c] + part * (along[c] - from[c]) + width * draw.between(-1.0, 1.0)),
                );
                pieces.push(piece);
            }
        }
        points.extend((0..50).map(|k| [0.25 + 0.01 * f64::from(k), 0.5]));
        pieces.resize(points.len(), u32::MAX);
        let flat: Vec<P2> = uvs(Layout::Whole, &points);
        let by = Bind::Uv { uvs: Strided::from_slice(&flat), layers: None };
        let carrier =
            asset.carrier(&CarrierSettings { pieces: Some(&pieces), ..CarrierSettings::new(by) }).unwrap();
        solve(&mut asset, &sheet.pose(|[x, y]| rounded(rigid([x, y, 0.0]))));
        let all = fetch(&carrier);
        let mut worst: f64 = 0.0;
        for m in &all.rotations {
            for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] {
                let (zero, of) = (rigid([0.0; 3]), rigid(axis));
                worst = worst.max(distance(turned(*m, axis), [0, 1, 2].map(|k| of[k] - zero[k])));
            }
        }
        println!("{away} from the origin: turned by {worst:e} more");
        assert!(worst < most);
    }
}

/// Poses in steps of 0.5 % of a motion give second differences within the bars for warps.
#[test]
fn carried_points_are_smooth_in_the_pose() {
    let sheet = Sheet::new(20, Layout::Whole, bulge);
    let spots = |[x, y]: P2| disc([0.5, 0.5], 0.3)([(5.0 * x).fract(), (5.0 * y).fract()]);
    let mut asset = sheet.asset(2, 128, spots, TileSettings::default());
    let points = lattice(20);
    let heights = vec![0.02; points.len()];
    let carriers = [Fit::Feature, Fit::Surface]
        .map(|fit| by_uv(&asset, &uvs(Layout::Whole, &points), Some(&heights), fit, 0));
    let mut frames: [Vec<sheet::All>; 2] = Default::default();
    for k in 0..12 {
        let t = 0.5 + 0.005 * f64::from(k);
        let pose = sheet.pose(|p| {
            let (a, b) = (bulge(p), warped(p));
            std::array::from_fn(|c| a[c] + t * (b[c] - a[c]))
        });
        solve(&mut asset, &pose);
        frames.iter_mut().zip(&carriers).for_each(|(frames, carrier)| frames.push(fetch(carrier)));
    }
    let cell = 1.0 / (0.9 * 128.0);
    for (frames, name) in frames.iter().zip(["feature", "surface"]) {
        let (mut squares, mut turns, mut jumps, mut count) = (0.0f64, 0.0f64, 0, 0);
        for three in frames.windows(3) {
            for k in 0..points.len() {
                let second =
                    |of: &dyn Fn(&sheet::All) -> f64| of(&three[0]) - 2.0 * of(&three[1]) + of(&three[2]);
                let square: f64 = (0..3).map(|c| second(&|all| all.positions[k][c]).powi(2)).sum();
                turns += (0..9).map(|c| second(&|all| all.rotations[k][c]).powi(2)).sum::<f64>();
                (squares, count) = (squares + square / (cell * cell), count + 1);
                jumps += usize::from(square.sqrt() > 0.1 * cell);
            }
        }
        let [rms, turn] = [squares, turns].map(|sum| (sum / f64::from(count)).sqrt());
        println!("{name}: second differences {rms:e} cells, {turn:e} of rotations, {jumps} of {count} jumps");
        assert!(rms < 0.01 && turn < 2e-3 && 1000 * jumps <= count as usize, "{name}: {rms} {turn} {jumps}");
    }
}
