//! Maps that are one-to-one when they are interpolated.

use vrtm::{FetchKind, ImageLayout, ImageViewMut, PixelFormat, SolveOptions};

use crate::common::{self, Model, cpu, scenes};
use crate::{folds, map, pairs, solved};

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
    for model in crowded() {
        let mut asset = model.asset(0, 256);
        for frame in 1..=model.frames.len().min(4) {
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

#[test]
fn numbers_that_are_too_coarse_are_left_alone() {
    // f16 near 1 has steps of 1/2048: at 4096 texels most neighbours are equal, and no change of a few would help.
    let asset = solved(&Model::from(scenes::analytic::squash(0.4)), &cpu(0));
    let halves = |one_to_one| {
        let mut bytes = vec![0u8; 4096 * 64 * 4];
        let layout = ImageLayout { one_to_one, ..ImageLayout::packed(4096, 64, PixelFormat::F16) };
        let mut image = ImageViewMut::new("image", &mut bytes, layout).unwrap();
        asset.fetch(0, FetchKind::Redirection, &mut image).unwrap();
        bytes
    };
    assert!(halves(true) == halves(false));
}
