//! What the library says about a map.

use vrtm::{Asset, ErrorKind, FetchKind, MapDesc, MapReport, PixelFormat};

use super::{folds, map, pairs, solved};
use vrtm_testkit::{Model, cpu, scenes};

fn desc(size: [u32; 2]) -> MapDesc {
    MapDesc { kind: FetchKind::Redirection, format: PixelFormat::F32, size }
}

fn inspect(asset: &Asset, desc: MapDesc) -> MapReport {
    asset.tile(0).inspect_map(&desc).unwrap()
}

#[test]
fn folds_are_counted_and_a_size_without_them_is_named() {
    let asset = solved(&Model::from(scenes::analytic::squash(0.1)), &cpu(0));
    let mut all = 0;
    for size in [[64, 64], [256, 128], [512, 512], [1500, 700]] {
        let own = folds(&pairs(&map(&asset, 0, FetchKind::Redirection, size, 2)), size.map(|n| n as usize));
        let report = inspect(&asset, desc(size));
        assert_eq!(report.folds, own as u64, "{size:?}");
        assert_eq!(report.folds == 0, report.min_jacobian > 0.0, "{size:?}");
        match report.sufficient_size {
            Some(good) => assert_eq!(inspect(&asset, desc(good)).folds, 0, "{size:?}: {good:?}"),
            None => assert!(own > 0),
        }
        if own == 0 {
            assert_eq!(report.sufficient_size, Some(size));
        }
        all += own;
    }
    assert!(all > 0, "nothing folds: nothing was tested");
}

#[test]
fn errors_are_those_of_bilinear_interpolation() {
    // Its charts cover a part of the tile: errors beside them do not count.
    let model = Model::from(scenes::mug_to_jug());
    let asset = solved(&model, &cpu(0));
    // The redirection itself at points whose places differ from the library's samples: texel centres of a map with an
    // odd multiple of the size.
    let (n, fine) = (96usize, 96 * 7);
    let size = |n: usize| [n as u32; 2];
    let coarse = pairs(&map(&asset, 0, FetchKind::RedirectionDelta, size(n), 2));
    let exact = pairs(&map(&asset, 0, FetchKind::RedirectionDelta, size(fine), 2));
    let charts = map(&asset, 0, FetchKind::RedirectionDelta, size(fine), 4);
    let mut errors = Vec::new();
    for y in 4..fine - 4 {
        for x in (4..fine - 4).filter(|x| charts[4 * (y * fine + x) + 3] == 1.0) {
            let at = [x, y].map(|x| (x as f64 + 0.5) / 7.0 - 0.5);
            let (i, j) = (at[0].floor(), at[1].floor());
            let (s, t) = (at[0] - i, at[1] - j);
            let value = |di: usize, dj: usize, c: usize| coarse[(j as usize + dj) * n + i as usize + di][c];
            let d = [0, 1].map(|c| {
                let low = value(0, 0, c) * (1.0 - s) + value(1, 0, c) * s;
                let high = value(0, 1, c) * (1.0 - s) + value(1, 1, c) * s;
                low * (1.0 - t) + high * t - exact[y * fine + x][c]
            });
            errors.push(d[0].hypot(d[1]));
        }
    }
    errors.sort_by(f64::total_cmp);
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let p99 = errors[errors.len() * 99 / 100];
    let found = inspect(&asset, desc(size(n)));
    // Other points of the same function.
    assert!((found.error_rms / rms - 1.0).abs() < 0.05, "{} {rms}", found.error_rms);
    assert!((found.error_p99 / p99 - 1.0).abs() < 0.08, "{} {p99}", found.error_p99);
    let max = errors[errors.len() - 1];
    assert!((found.error_max / max - 1.0).abs() < 0.3, "{} {max}", found.error_max);
    // Finer maps are closer; of 16 bits only the delta is.
    let of = |size, kind, format| inspect(&asset, MapDesc { kind, format, ..desc([size; 2]) });
    let f32s = of(1024, FetchKind::Redirection, PixelFormat::F32);
    let f16s = of(1024, FetchKind::Redirection, PixelFormat::F16);
    let deltas = of(1024, FetchKind::RedirectionDelta, PixelFormat::F16);
    assert!(f32s.error_rms < 0.2 * found.error_rms);
    assert!(f16s.error_max > 1.0 / 8192.0 && f16s.folds > 100, "{f16s:?}");
    // A coarser map of such numbers has no folds, and that is the size that is named.
    let [good, _] = f16s.sufficient_size.unwrap();
    assert!(good < 1024 && of(good, FetchKind::Redirection, PixelFormat::F16).folds == 0, "{f16s:?}");
    assert!(
        deltas.error_rms < 1.05 * f32s.error_rms
            && f16s.error_rms > 5.0 * f32s.error_rms
            && deltas.folds == 0,
        "{deltas:?}"
    );
}

#[test]
fn a_result_at_rest_has_no_error() {
    let model = Model::from(scenes::arm());
    let mut asset = model.asset(0, 128);
    asset.solve(vrtm::Strided::from_slice(&model.rest), &vrtm::SolveOptions::default()).unwrap();
    let found = inspect(&asset, MapDesc { kind: FetchKind::RedirectionDelta, ..desc([200, 300]) });
    assert!(
        found.folds == 0 && found.error_max == 0.0 && (found.min_jacobian - 1.0).abs() < 1e-12,
        "{found:?}"
    );
    assert_eq!(found.sufficient_size, Some([200, 300]));
    // A map of one texel, or of one row, has no quads.
    for size in [[1, 1], [64, 1], [1, 64]] {
        let found = inspect(&asset, desc(size));
        assert!(found.folds == 0 && found.sufficient_size == Some(size), "{found:?}");
    }
}

#[test]
fn impossible_maps_are_refused() {
    let model = Model::from(scenes::analytic::bulge());
    let mut asset = model.asset(0, 64);
    assert_eq!(asset.tile(0).inspect_map(&desc([8, 8])).unwrap_err().kind, ErrorKind::NotSolved);
    asset.solve(model.frame(1), &vrtm::SolveOptions::default()).unwrap();
    let refused = |desc: MapDesc, kind, text: &str| {
        let error = asset.tile(0).inspect_map(&desc).unwrap_err();
        assert!(error.kind == kind && error.message.contains(text), "{error:?}");
    };
    for kind in [FetchKind::Warp, FetchKind::Jacobian, FetchKind::FilterScale] {
        refused(MapDesc { kind, ..desc([8, 8]) }, ErrorKind::InvalidArgument, "kind");
    }
    refused(MapDesc { format: PixelFormat::U8, ..desc([8, 8]) }, ErrorKind::Unsupported, "format");
    for size in [[0, 8], [8, 16385]] {
        refused(desc(size), ErrorKind::InvalidArgument, "size");
    }
    assert_eq!(asset.tile(1).inspect_map(&desc([8, 8])).unwrap_err().kind, ErrorKind::InvalidArgument);
}
