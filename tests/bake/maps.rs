//! What the maps hold: forms, channels, derivatives, number formats, and how they do under bilinear lookup.

use std::path::Path;

use exr::image::FlatSamples;
use serde_json::Value;

use crate::common::{channels, folder, layer, names, read_exr, report, succeed, succeed_with_warnings, text};

/// Bakes the arm's second frame, which has two tiles, and reads a file's channels.
fn baked<const N: usize>(name: &str, more: &[&str], file: &str, wanted: [&str; N]) -> Vec<[f32; N]> {
    let out = folder(name);
    let mut list = vec!["--scene", "arm", "--size", "64", "--frames", "2", "--no-sheet", "--out", text(&out)];
    list.extend(more);
    succeed(&list);
    let (width, height, texels) = channels(&out.join(file), wanted);
    assert_eq!((width, height), (64, 64));
    texels
}

const BGR: [&str; 3] = ["B", "G", "R"];
const ABGR: [&str; 4] = ["A", "B", "G", "R"];

/// The centre of a texel of 64 by 64.
fn centre(k: usize) -> [f32; 2] {
    [(k % 64) as f32 + 0.5, 63.5 - (k / 64) as f32].map(|x| x / 64.0)
}

fn largest(differences: impl Iterator<Item = f32>) -> f32 {
    differences.fold(0.0, |m, x| m.max(x.abs()))
}

#[test]
fn the_forms_differ_by_the_tile_and_by_the_texel() {
    for (udim, offset) in [(1001, 0.0), (1002, 1.0)] {
        let file = format!("redirect.0002.{udim}.exr");
        let [tile, absolute, delta] =
            ["tile", "udim", "delta"].map(|form| baked(form, &["--form", form], &file, BGR));
        let moved = largest(delta.iter().flat_map(|[_, v, u]| [*u, *v]));
        assert!(moved > 0.3 / 64.0, "{moved}");
        // One rounding of numbers up to 2.
        let udims = tile.iter().zip(&absolute).flat_map(|(t, a)| [a[2] - t[2] - offset, a[1] - t[1]]);
        assert!(largest(udims) <= 1.2e-7);
        let deltas = tile.iter().zip(&delta).enumerate();
        let off = deltas.flat_map(|(k, (t, d))| [t[2] - centre(k)[0] - d[2], t[1] - centre(k)[1] - d[1]]);
        assert!(largest(off) <= 1.2e-7);
        for texels in [&tile, &absolute, &delta] {
            assert!(texels.iter().all(|texel| texel[0] == 0.0));
        }
    }
}

#[test]
fn alpha_is_where_charts_are() {
    let file = "redirect.0002.1002.exr";
    let plain = baked("plain", &["--form", "delta"], file, BGR);
    let with_alpha = baked("alpha", &["--form", "delta", "--alpha"], file, ABGR);
    let covered = with_alpha.iter().filter(|texel| texel[0] == 1.0).count();
    assert!((64 * 64 / 20..64 * 64).contains(&covered), "{covered}");
    for (plain, [a, b, g, r]) in plain.iter().zip(&with_alpha) {
        assert!(*a == 0.0 || *a == 1.0);
        assert_eq!(plain, &[*b, *g, *r]);
        assert!(*a == 1.0 || (*r == 0.0 && *g == 0.0), "nothing moves outside of the charts");
    }
}

#[test]
fn the_filter_is_the_largest_singular_value_of_the_jacobian() {
    let more = ["--jacobian", "--filter-scale", "--no-warp"];
    let jacobian = baked("jacobian", &more, "jacobian.0002.1001.exr", ABGR);
    let filter = baked("filter", &more, "filter.0002.1001.exr", BGR);
    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake/filter");
    assert!(names(&out).iter().all(|name| !name.starts_with("warp")), "{:?}", names(&out));
    assert_eq!(names(&out).len(), 7, "{:?}", names(&out));
    let mut bent = 0;
    for ([d, c, b, a], [blue, green, red]) in jacobian.iter().zip(&filter) {
        assert!(red == green && red == blue);
        // Of [[a, b], [c, d]].
        let [a, b, c, d] = [*a, *b, *c, *d].map(f64::from);
        let (sum, det) = (a * a + b * b + c * c + d * d, a * d - b * c);
        let expected = ((sum + (sum * sum - 4.0 * det * det).max(0.0).sqrt()) / 2.0).sqrt();
        assert!((f64::from(*red) - expected).abs() < 1e-5 * expected, "{red} {expected}");
        bent += usize::from((expected - 1.0).abs() > 0.1);
    }
    assert!(bent > 50, "{bent}");
}

#[test]
fn sixteen_bits_are_the_rounded_numbers() {
    let out = folder("half");
    let base = ["--scene", "arm", "--size", "64", "--frames", "2", "--no-sheet", "--out", text(&out)];
    succeed(&base);
    let (_, _, full) = read_exr(&out.join("redirect.0002.1001.exr"));
    succeed(&[&base[..], &["--half"]].concat());
    let half = layer(&out.join("redirect.0002.1001.exr"));
    let channels: Vec<_> = half
        .channel_data
        .list
        .iter()
        .map(|channel| match &channel.sample_data {
            FlatSamples::F16(values) => values.iter().map(|x| x.to_f32()).collect::<Vec<_>>(),
            other => panic!("not f16: {other:?}"),
        })
        .collect();
    // f16 has 11 bits.
    let off = full.iter().enumerate().flat_map(|(k, uv)| [uv[0] - channels[2][k], uv[1] - channels[1][k]]);
    let off = largest(off);
    assert!(off > 0.0 && off <= 1.0 / 4096.0, "{off}");
}

/// The figures of a frame's first map.
fn figures(out: &Path, frame: usize) -> Value {
    report(out)["frames"][frame]["tiles"][0]["map"].clone()
}

#[test]
fn the_report_has_the_error_of_the_map_that_was_written() {
    let out = folder("map_figures");
    let bake = |more: &[&str]| {
        let list = ["--size", "128", "--frames", "5", "--no-sheet", "--out", text(&out)];
        succeed(&[&list[..], more].concat());
        figures(&out, 0)
    };
    let number = |map: &Value, key: &str| map["error_texels"][key].as_f64().expect("a number");
    let [at_4096, at_8192] = [bake(&[]), bake(&["--texture-size", "8192"])];
    assert_eq!(at_4096["size"], serde_json::json!([128, 128]));
    assert_eq!((&at_4096["folds"], &at_4096["sufficient_size"]), (&0.into(), &at_4096["size"]));
    assert!(at_4096["min_jacobian"].as_f64().unwrap() > 0.0);
    assert_eq!((number(&at_4096, "texture_size"), number(&at_8192, "texture_size")), (4096.0, 8192.0));
    for key in ["rms", "p99", "max"] {
        assert!(number(&at_4096, key) > 0.0, "{key}");
        assert_eq!(2.0 * number(&at_4096, key), number(&at_8192, key), "{key}");
    }
    assert!(number(&at_4096, "rms") < number(&at_4096, "p99"));
    assert!(number(&at_4096, "p99") < number(&at_4096, "max"));
    let [finer, rounded] = [bake(&["--map-size", "512"]), bake(&["--map-size", "256", "--half"])];
    assert!(number(&finer, "p99") < 0.5 * number(&at_4096, "p99"));
    assert!(number(&rounded, "p99") > 1.5 * number(&finer, "p99"), "f16 shows in a fine map");
}

#[test]
fn a_map_folds_only_if_it_has_to_be_exact_and_then_that_is_said() {
    let out = folder("exact");
    let bake = |more: &[&str]| {
        let list = [
            "--scene",
            "creature",
            "--frames",
            "3",
            "--size",
            "128",
            "--map-size",
            "512",
            "--no-sheet",
            "--out",
        ];
        let (_, warnings) = succeed_with_warnings(&[&list[..], &[text(&out)], more].concat());
        (figures(&out, 0), warnings)
    };
    let (exact, said) = bake(&["--exact"]);
    let folds = exact["folds"].as_u64().expect("a number");
    assert!(folds > 0 && exact["min_jacobian"].as_f64().unwrap() <= 0.0, "{exact}");
    let expected = format!("bake: warning: frame 3: tile 1001: {folds} squares");
    assert!(said.lines().count() == 1 && said.starts_with(&expected) && said.contains("--exact"), "{said}");
    let (map, said) = bake(&[]);
    assert_eq!((map["folds"].as_u64(), said.as_str()), (Some(0), ""));
}

#[test]
fn an_automatic_size_is_the_smallest_that_all_frames_can_do_with() {
    let out = folder("auto");
    let texture = 2048;
    let bake = |size: &str| {
        let wanted = texture.to_string();
        let list =
            ["--size", "128", "--frames", "1,5,3", "--no-sheet", "--out", text(&out), "--map-size", size];
        succeed(&[&list[..], &["--texture-size", &wanted]].concat());
        let of = |frame| {
            let map = figures(&out, frame);
            (map["size"][0].as_u64().unwrap(), map["error_texels"]["p99"].as_f64().unwrap())
        };
        [of(0), of(1), of(2)]
    };
    let all = bake("auto");
    let size = all[0].0;
    assert!(all.iter().all(|(of_frame, p99)| *of_frame == size && *p99 <= 0.5), "{all:?}");
    assert!(size.is_power_of_two() && size > 64, "{size}");
    let smaller = bake(&(size / 2).to_string());
    assert!(smaller.iter().any(|(_, p99)| *p99 > 0.5), "{smaller:?}");
    // The first frame alone could do with less.
    assert!(smaller[0].1 <= 0.5, "{smaller:?}");
}
