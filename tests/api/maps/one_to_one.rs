//! Maps that are one-to-one when they are interpolated.

use std::sync::{Arc, Mutex};

use vrtm::{
    Asset, Backend, Device, DeviceSettings, ErrorKind, FetchKind, ImageLayout, ImageViewMut, LogLevel,
    MapDesc, Origin, PixelFormat, SolveOptions,
};

use super::{folds, map, pairs, solved};
use crate::common::{self, Model, cpu, long, scenes};

/// Scenes whose warps squeeze, so that their maps fold without help: built-in ones, and real ones where they are there.
fn crowded() -> Vec<Model> {
    let mut models =
        vec![Model::from(scenes::analytic::squash(0.4)), Model::from(scenes::analytic::squash(0.1))];
    models.extend(common::assets());
    models
}

#[test]
fn no_quad_folds_at_any_size() {
    let (mut before, mut worst) = (0, 0.0f64);
    let frames = long::cases(4, 1, "frames of each model") as usize;
    for model in crowded() {
        let mut asset = model.asset(0, 256);
        for frame in 1..=model.frames.len().min(frames) {
            asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
            for tile in 0..asset.tile_count() {
                for size in [64, 256, 1024] {
                    let n = [size as usize; 2];
                    let of = |fixed| pairs(&map(&asset, tile, FetchKind::Redirection, [size; 2], 2, fixed));
                    let (plain, fixed) = (of(false), of(true));
                    let count = folds(&plain, n);
                    before += count;
                    let mut changed = 0;
                    for (a, b) in plain.iter().zip(&fixed).filter(|(a, b)| a != b) {
                        changed += 1;
                        worst = worst.max((a[0] - b[0]).hypot(a[1] - b[1]) * f64::from(size));
                    }
                    // Only what folds is touched, and a little around it.
                    assert!(changed <= 30 * count + 60, "{}: {changed} changed for {count}", model.name);
                }
            }
        }
    }
    println!("{before} quads folded; values moved by at most {worst:.2} texels");
    assert!(before > 10, "only {before} quads folded: nothing was tested");
    assert!(worst < 4.0, "a value moved by {worst} texels");
}

#[test]
fn it_depends_neither_on_threads_nor_on_the_form() {
    let model = Model::from(scenes::analytic::squash(0.1));
    let size = [512, 512];
    let of = |threads, kind| {
        let asset = solved(&model, &cpu(threads));
        map(&asset, 0, kind, size, 3, true)
    };
    let one = of(1, FetchKind::Redirection);
    assert!(
        one != map(&solved(&model, &cpu(1)), 0, FetchKind::Redirection, size, 3, false),
        "nothing is changed"
    );
    for threads in [2, 5] {
        let same =
            of(threads, FetchKind::Redirection).iter().zip(&one).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{threads} threads");
    }
    // The other forms round differently: they are one-to-one for themselves.
    let n = size.map(|n| n as usize);
    let delta = of(1, FetchKind::RedirectionDelta);
    let absolute: Vec<[f64; 2]> = delta
        .chunks_exact(3)
        .enumerate()
        .map(|(k, d)| {
            let centre = [k % n[0], k / n[0]].map(|x| (x as f64 + 0.5) / n[0] as f64);
            [centre[0] + f64::from(d[0]), centre[1] + f64::from(d[1])]
        })
        .collect();
    assert_eq!(folds(&absolute, n), 0);
}

/// A map in texels.
fn places(asset: &Asset, desc: MapDesc) -> Vec<[f64; 2]> {
    let MapDesc { kind, format, size, one_to_one } = desc;
    let (n, bytes) = (size.map(|n| n as usize), format.size());
    let mut image = vec![0u8; n[0] * n[1] * 2 * bytes];
    let layout =
        ImageLayout { origin: Origin::Bottom, one_to_one, ..ImageLayout::packed(size[0], size[1], format) };
    asset.fetch(0, kind, &mut ImageViewMut::new("image", &mut image, layout).unwrap()).unwrap();
    let number = |b: &[u8]| match format {
        PixelFormat::F16 => half::f16::from_ne_bytes([b[0], b[1]]).to_f64(),
        _ => f64::from(f32::from_ne_bytes([b[0], b[1], b[2], b[3]])),
    };
    let texel = |(k, b): (usize, &[u8])| {
        let value = [number(b), number(&b[bytes..])];
        let at = [k % n[0], k / n[0]];
        [0, 1].map(|c| match kind {
            FetchKind::RedirectionDelta => at[c] as f64 + value[c] * n[c] as f64,
            _ => value[c] * n[c] as f64,
        })
    };
    image.chunks_exact(2 * bytes).enumerate().map(texel).collect()
}

/// The arm with noise on all vertices, which is as large as itself, and a sheet with cubed coordinates: of the former's map 3 %
/// of the quads fold, of the latter's 1 %, some of which do not open one after the other.
fn crumpled() -> [Model; 2] {
    let [mut arm, mut cubed] = [Model::from(scenes::arm()), Model::from(scenes::analytic::squash(0.4))];
    let mut state = 1u64;
    for x in arm.frames.last_mut().unwrap().as_flattened_mut() {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        *x += (state >> 40) as f32 / (1 << 23) as f32 - 1.0;
    }
    cubed.frames[0].as_flattened_mut().iter_mut().for_each(|x| *x = *x * *x * *x);
    [arm, cubed]
}

#[test]
fn no_share_of_folds_is_too_large() {
    let mut largest = 0.0f64;
    for model in crumpled() {
        let [asset, alone] = [cpu(2), cpu(1)].map(|device| solved(&model, &device));
        for size in [[64, 64], [256, 256], [100, 300]] {
            let n = size.map(|n| n as usize);
            for (kind, format) in [
                (FetchKind::Redirection, PixelFormat::F32),
                (FetchKind::RedirectionUdim, PixelFormat::F32),
                (FetchKind::RedirectionDelta, PixelFormat::F32),
                (FetchKind::RedirectionDelta, PixelFormat::F16),
            ] {
                let desc = |one_to_one| MapDesc { kind, format, size, one_to_one };
                let (plain, fixed) = (places(&asset, desc(false)), places(&asset, desc(true)));
                let [before, after] = [&plain, &fixed].map(|map| folds(map, n));
                largest = largest.max(before as f64 / ((n[0] - 1) * (n[1] - 1)) as f64);
                let moved: Vec<f64> =
                    plain.iter().zip(&fixed).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).collect();
                let (count, most) = (
                    moved.iter().filter(|d| **d > 0.0).count(),
                    moved.iter().fold(0.0, |m: f64, d| m.max(*d)),
                );
                println!(
                    "{} {size:?} {kind:?} {format:?}: {before} folds, then {after}; {count} moved by up to {most:.2}",
                    model.name
                );
                assert_eq!(after, 0, "{}: {size:?} {kind:?} {format:?}", model.name);
                assert_eq!(asset.inspect_map(0, &desc(true)).unwrap().folds, 0);
                assert!(places(&alone, desc(true)) == fixed, "one thread");
                // A tenth of the map is farther than anything has to go here.
                assert!(most < 0.1 * f64::from(size[0].max(size[1])), "{most} texels");
            }
        }
    }
    assert!(largest > 0.02, "{largest}: too few for a test");
}

#[test]
fn numbers_that_are_too_coarse_change_nothing_and_it_is_said() {
    // f16 near 1 has steps of 1/2048: at 4096 texels most neighbours are equal, and no change of a few would help.
    let lines = Arc::new(Mutex::new(Vec::new()));
    let (log, to) = (lines.clone(), DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() });
    let log: vrtm::LogFn =
        Arc::new(move |level, line: &str| log.lock().unwrap().push((level, line.to_owned())));
    let device = Device::new(&DeviceSettings { log: Some(log), ..to }).unwrap();
    let asset = solved(&Model::from(scenes::analytic::squash(0.4)), &device);
    let warned = || {
        lines
            .lock()
            .unwrap()
            .iter()
            .filter(|(level, line)| *level == LogLevel::Warning && line.contains("fold"))
            .count()
    };
    // Sizes that are no powers of two, too: equal neighbours are a fold, however their distance is computed.
    for size in [[4096, 64], [3000, 70]] {
        let desc =
            |one_to_one| MapDesc { kind: FetchKind::Redirection, format: PixelFormat::F16, size, one_to_one };
        let before = warned();
        let plain = places(&asset, desc(false));
        assert_eq!(warned(), before, "what nobody asked for is warned of");
        assert!(places(&asset, desc(true)) == plain, "values are changed for nothing");
        assert_eq!(warned(), before + 1, "it is not said");
        let count = folds(&plain, size.map(|n| n as usize)) as u64;
        for one_to_one in [false, true] {
            assert_eq!(asset.inspect_map(0, &desc(one_to_one)).unwrap().folds, count, "{size:?}");
        }
    }
}

#[test]
fn it_has_no_parts_and_the_message_names_the_field() {
    let asset = solved(&Model::from(scenes::analytic::bulge()), &cpu(0));
    let part = |kind, size: [u32; 2]| {
        let mut bytes = vec![7u8; 64 * 16 * 8];
        let layout = ImageLayout { one_to_one: true, ..ImageLayout::packed(64, 16, PixelFormat::F32) };
        let mut image = ImageViewMut::new("image", &mut bytes, layout).unwrap();
        let outcome = asset.fetch_part(0, kind, &mut image, size, [0, 0]);
        (outcome, bytes.iter().all(|&byte| byte == 7))
    };
    for kind in [FetchKind::Redirection, FetchKind::RedirectionDelta, FetchKind::RedirectionUdim] {
        let (outcome, untouched) = part(kind, [64, 64]);
        let error = outcome.unwrap_err();
        assert!(error.kind == ErrorKind::Unsupported && untouched, "{error:?}");
        assert!(error.message.starts_with("image.one_to_one: "), "{}", error.message);
        assert!(part(kind, [64, 16]).0.is_ok(), "the part is the whole");
    }
    assert!(part(FetchKind::Warp, [64, 64]).0.is_ok(), "it is ignored for other kinds");
}
