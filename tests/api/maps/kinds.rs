//! The kinds of outputs, and their channels.

use vrtm::{Backend, DeviceSettings, ErrorKind, FetchKind, ImageLayout, ImageViewMut, PixelFormat};

use super::{map, pairs, solved};
use vrtm_testkit::{Model, Warp, change, cpu, gpu, scenes};

/// A size that divides nothing.
const SIZE: [u32; 2] = [301, 190];

fn centre(k: usize) -> [f64; 2] {
    let [x, y] = [k % SIZE[0] as usize, k / SIZE[0] as usize];
    [(x as f64 + 0.5) / f64::from(SIZE[0]), (y as f64 + 0.5) / f64::from(SIZE[1])]
}

#[test]
fn the_forms_tell_the_same_in_each_tile() {
    let asset = solved(&Model::from(scenes::arm()), &cpu(0));
    let mut moved = 0;
    for (udim, origin) in [(1001, [0.0, 0.0]), (1002, [1.0, 0.0])] {
        let tile = asset.find_tile(udim).unwrap();
        let of = |kind| pairs(&map(&asset, tile, kind, SIZE, 2));
        let (within, delta) = (of(FetchKind::Redirection), of(FetchKind::RedirectionDelta));
        for (k, among) in of(FetchKind::RedirectionUdim).into_iter().enumerate() {
            for c in 0..2 {
                // Each is rounded to f32 once, below 2.
                assert!((among[c] - origin[c] - within[k][c]).abs() < 1.3e-7, "{udim} {k}");
                assert!((among[c] - origin[c] - centre(k)[c] - delta[k][c]).abs() < 1.3e-7, "{udim} {k}");
                // Far less than half a unit in the last place of 1.
                let off = within[k][c] - centre(k)[c] - delta[k][c];
                assert!(off.abs() < 2.0 * f64::from(f32::EPSILON) / 4.0, "{udim} {k}: {off}");
            }
            moved += usize::from(delta[k] != [0.0; 2]);
        }
    }
    assert!(moved > 1000, "{moved}");
}

#[test]
fn further_channels_are_zero_and_the_coverage_of_charts() {
    let model = Model::from(scenes::mug_to_jug());
    let asset = solved(&model, &cpu(0));
    let faces = faces(&model);
    let inside: Vec<f64> = (0..(SIZE[0] * SIZE[1]) as usize).map(|k| depth(&faces, centre(k))).collect();
    for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta, FetchKind::RedirectionUdim] {
        let two = map(&asset, 0, kind, SIZE, 2);
        let three = map(&asset, 0, kind, SIZE, 3);
        let four = map(&asset, 0, kind, SIZE, 4);
        for (k, uv) in two.chunks_exact(2).enumerate() {
            assert_eq!([three[3 * k], three[3 * k + 1], three[3 * k + 2]], [uv[0], uv[1], 0.0]);
            assert_eq!([four[4 * k], four[4 * k + 1], four[4 * k + 2]], [uv[0], uv[1], 0.0]);
        }
        let mut covered = 0;
        for (k, texel) in four.chunks_exact(4).enumerate() {
            match inside[k] {
                inside if inside > 1e-6 => assert_eq!(texel[3], 1.0, "texel {k}, {inside} inside"),
                inside if inside < -1e-6 => assert_eq!(texel[3], 0.0, "texel {k}, {inside} inside"),
                // On a border.
                _ => assert!(texel[3] == 0.0 || texel[3] == 1.0),
            }
            covered += usize::from(texel[3] == 1.0);
        }
        assert!((5000..55000).contains(&covered), "{covered}");
    }
    let nodes = map(&asset, 0, FetchKind::Warp, [257, 257], 3);
    let plain = map(&asset, 0, FetchKind::Warp, [257, 257], 2);
    assert!(nodes.chunks_exact(3).zip(plain.chunks_exact(2)).all(|(a, b)| a == [b[0], b[1], 0.0]));
}

/// The UVs of a face, and their lowest and highest.
type Face = (Vec<[f64; 2]>, [[f64; 2]; 2]);

fn faces(model: &Model) -> Vec<Face> {
    let uv = |c: usize| model.uvs[model.uv_indices[c] as usize].map(f64::from);
    let bounds = |[low, high]: [[f64; 2]; 2], x: &[f64; 2]| {
        [[0, 1].map(|c| x[c].min(low[c])), [0, 1].map(|c| x[c].max(high[c]))]
    };
    let bounded = |corners: Vec<[f64; 2]>| {
        let ends = corners.iter().fold([[9.0; 2], [-9.0; 2]], bounds);
        (corners, ends)
    };
    model.faces().map(|face| bounded(face.map(uv).collect())).collect()
}

/// Depth of a point inside the convex face that it is deepest in; negative outside of all.
fn depth(faces: &[Face], p: [f64; 2]) -> f64 {
    let mut deepest = f64::NEG_INFINITY;
    for (corners, [low, high]) in faces {
        let far = |c: usize| p[c] < low[c] - 1e-3 || p[c] > high[c] + 1e-3;
        if far(0) || far(1) {
            continue;
        }
        let side = |k: usize| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            let (e, d) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
            (e[0] * d[1] - e[1] * d[0]) / e[0].hypot(e[1])
        };
        let (low, high) = (0..corners.len())
            .map(side)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        deepest = deepest.max(low.max(-high));
    }
    deepest
}

/// The derivatives of the redirection at a texel centre, by inverting those of the warp's triangle there; `None` on an
/// edge.
fn expected(warp: &Warp, redirected: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let cells = [warp.nx as f64, warp.ny as f64];
    let p = [redirected[0] * cells[0], redirected[1] * cells[1]];
    let (i, j) = (p[0].floor(), p[1].floor());
    let (s, t) = (p[0] - i, p[1] - j);
    let edge = [s, 1.0 - s, t, 1.0 - t, (s - t).abs()].into_iter().fold(f64::INFINITY, f64::min);
    if edge < 1e-3 {
        return None;
    }
    let at = |di: usize, dj: usize| warp.node(i as usize + di, j as usize + dj);
    let (along, up) = if s > t {
        ((at(0, 0), at(1, 0)), (at(1, 0), at(1, 1)))
    } else {
        ((at(0, 1), at(1, 1)), (at(0, 0), at(0, 1)))
    };
    // Columns of W's derivatives in UV: differences over a cell, from cells to UV.
    let column =
        |(a, b): ([f64; 2], [f64; 2]), axis: usize| [0, 1].map(|k| (b[k] - a[k]) / cells[k] * cells[axis]);
    let ([a, c], [b, d]) = (column(along, 0), column(up, 1));
    let det = a * d - b * c;
    Some([[d / det, -b / det], [-c / det, a / det]])
}

#[test]
fn the_jacobian_inverts_that_of_the_warp() {
    // A grid whose cells are no squares of the tile.
    let model = Model::from(scenes::mug_to_jug());
    let mut asset = model.asset(0, 256);
    change(&mut asset, 0, |settings| settings.grid = [Some(320), Some(192)]);
    asset.solve(model.frame(5), &vrtm::SolveOptions::default()).unwrap();
    let warp = Warp::of(&asset, 0);
    let redirected = pairs(&map(&asset, 0, FetchKind::Redirection, SIZE, 2));
    let jacobians = map(&asset, 0, FetchKind::Jacobian, SIZE, 4);
    let scales = map(&asset, 0, FetchKind::FilterScale, SIZE, 1);
    let (mut checked, mut turned) = (0, 0);
    for (k, j) in jacobians.chunks_exact(4).enumerate() {
        let j = [[j[0], j[1]], [j[2], j[3]]].map(|row| row.map(f64::from));
        let Some(expected) = expected(&warp, redirected[k]) else { continue };
        let size = expected.as_flattened().iter().fold(1.0f64, |m, x| m.max(x.abs()));
        for (a, b) in j.as_flattened().iter().zip(expected.as_flattened()) {
            // One rounding to f32.
            assert!((a - b).abs() <= 1e-6 * size, "texel {k}: {j:?}, not {expected:?}");
        }
        checked += 1;
        turned += usize::from((j[1][0] - j[0][1]).abs() > 0.1);
        // The largest stretch of a direction, tried at many.
        let longest = (0..720).map(|step| {
            let (y, x) = (f64::from(step) * std::f64::consts::PI / 720.0).sin_cos();
            (j[0][0] * x + j[0][1] * y).hypot(j[1][0] * x + j[1][1] * y)
        });
        let longest = longest.fold(0.0, f64::max);
        let scale = f64::from(scales[k]);
        assert!(scale >= longest * (1.0 - 1e-6) && scale <= longest * 1.0001, "texel {k}: {scale} {longest}");
    }
    assert!(checked > 50_000 && turned > 300, "{checked} {turned}");
}

#[test]
fn a_map_between_its_texels_follows_the_jacobian() {
    let asset = solved(&Model::from(scenes::analytic::bulge()), &cpu(0));
    // As fine as the grid eight times: two texels in a row mostly lie in one triangle.
    let size = [2048u32; 2];
    let redirected = pairs(&map(&asset, 0, FetchKind::Redirection, size, 2));
    let jacobians = map(&asset, 0, FetchKind::Jacobian, size, 4);
    let n = size[0] as usize;
    let (mut near, mut all) = (0, 0);
    for y in (n / 4..3 * n / 4).step_by(7) {
        for x in (n / 4..3 * n / 4).step_by(5) {
            let k = y * n + x;
            let slope = |to: usize, c: usize| (redirected[to][c] - redirected[k][c]) * n as f64;
            let found = [slope(k + 1, 0), slope(k + n, 0), slope(k + 1, 1), slope(k + n, 1)];
            let j = &jacobians[4 * k..4 * k + 4];
            all += 1;
            // f32 within a texel: 6e-8 * 2048.
            near += usize::from((0..4).all(|i| (found[i] - f64::from(j[i])).abs() < 1e-3));
        }
    }
    assert!(near * 10 > all * 6, "{near} of {all}");
}

#[test]
fn a_gpu_gives_the_same_kinds() {
    let Some(device) = gpu(&DeviceSettings { backend: Backend::Gpu, ..DeviceSettings::default() }) else {
        return;
    };
    let asset = solved(&Model::from(scenes::arm()), &device);
    let tile = asset.find_tile(1002).unwrap();
    let of = |kind, channels| map(&asset, tile, kind, SIZE, channels);
    let (two, four) = (of(FetchKind::Redirection, 2), of(FetchKind::RedirectionUdim, 4));
    for (k, uv) in two.chunks_exact(2).enumerate() {
        let texel = &four[4 * k..4 * k + 4];
        assert!((texel[0] - 1.0 - uv[0]).abs() < 2e-7 && (texel[1] - uv[1]).abs() < 1e-7, "{k}");
        assert!(texel[2] == 0.0 && (texel[3] == 0.0 || texel[3] == 1.0), "{k}");
    }
    let warp = Warp::of(&asset, tile);
    let mut checked = 0;
    for (k, j) in of(FetchKind::Jacobian, 4).chunks_exact(4).enumerate() {
        let uv = [f64::from(two[2 * k]), f64::from(two[2 * k + 1])];
        if let Some(expected) = expected(&warp, uv) {
            let off = j.iter().zip(expected.as_flattened()).map(|(a, b)| (f64::from(*a) - b).abs());
            assert!(off.fold(0.0, f64::max) < 1e-5, "{k}");
            checked += 1;
        }
    }
    assert!(checked > 10_000);
}

#[test]
fn channels_that_a_kind_does_not_have_are_refused() {
    let asset = solved(&Model::from(scenes::analytic::bulge()), &cpu(1));
    let mut bytes = vec![0x5Au8; 8 * 8 * 16];
    let all = [
        (FetchKind::Redirection, 2..=4),
        (FetchKind::RedirectionDelta, 2..=4),
        (FetchKind::RedirectionUdim, 2..=4),
        (FetchKind::Warp, 2..=3),
        (FetchKind::Jacobian, 4..=4),
        (FetchKind::FilterScale, 1..=1),
    ];
    for (kind, good) in all {
        assert_eq!(kind.channels(), *good.start());
        for channels in (1..=4).filter(|n| !good.contains(n)) {
            let layout = ImageLayout::packed(8, 8, PixelFormat::F32).with_channels(channels);
            let mut image = ImageViewMut::new("image", &mut bytes, layout).unwrap();
            let error = asset.tile(0).fetch(kind, &mut image).unwrap_err();
            assert_eq!(error.kind, ErrorKind::InvalidArgument);
            assert!(error.message.starts_with(&format!("image: {channels} channels")), "{}", error.message);
        }
    }
    for channels in [0, 5, u32::MAX] {
        let layout = ImageLayout::packed(8, 8, PixelFormat::F32).with_channels(channels);
        let error = ImageViewMut::new("image", &mut bytes, layout).unwrap_err();
        assert_eq!(error.message, format!("image: channels is {channels}, not 1 to 4"));
    }
    assert!(bytes.iter().all(|&b| b == 0x5A));
}
