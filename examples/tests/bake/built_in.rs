//! Built-in scenes and real assets, and the report.

use std::path::Path;

use crate::common::{folder, names, read_exr, report, succeed, succeed_with_warnings, text};

#[test]
fn the_built_in_scene_gives_exactly_its_files() {
    let out = folder("mug");
    let table = succeed(&["--size", "64", "--frames", "2-4x2", "--out", text(&out)]);
    let expected = [
        "redirect.0002.1001.exr",
        "redirect.0004.1001.exr",
        "report.json",
        "sheet.0002.png",
        "sheet.0004.png",
        "turning.png",
        "warp.0002.1001.exr",
        "warp.0004.1001.exr",
    ];
    assert_eq!(names(&out), expected);
    assert!(table.contains("1001") && table.contains("->"), "{table}");

    let (width, height, redirect) = read_exr(&out.join("redirect.0004.1001.exr"));
    assert_eq!((width, height), (64, 64));
    let (columns, rows, warp) = read_exr(&out.join("warp.0004.1001.exr"));
    assert_eq!((columns, rows), (65, 65));
    let mut largest = 0.0f32;
    for y in 0..height {
        for x in 0..width {
            let centre = [(x as f32 + 0.5) / 64.0, 1.0 - (y as f32 + 0.5) / 64.0];
            let uv = redirect[y * width + x];
            let moved = (uv[0] - centre[0]).abs().max((uv[1] - centre[1]).abs());
            // All nodes between the charts of the side (v >= 0.55) and of the handle (v <= 0.40) are fixed; the two
            // rows of cells beside a chart belong to it. One rounding of f32 is allowed.
            if (0.44..0.51).contains(&centre[1]) {
                assert!(moved <= 1e-6, "texel ({x}, {y}) moved by {moved}");
            }
            largest = largest.max(moved);
        }
    }
    assert!(largest > 0.25 / 64.0, "a jug's studs are somewhere else than a mug's: {largest}");
    // Nodes lie at the corners of cells, so that the image reaches from corner to corner of the tile; v points up, and
    // the first row is at the top.
    assert_eq!(warp[0], [0.0, 1.0]);
    assert_eq!(warp[64], [1.0, 1.0]);
    assert_eq!(warp[65 * 64], [0.0, 0.0]);

    let sheet = image::open(out.join("sheet.0004.png")).expect("a picture");
    assert!(sheet.width() > 1500 && sheet.height() > 700);
}

/// A quarter of the sheet of one tile, with its textures, and of two tiles.
#[test]
fn no_part_of_the_sheets_figures_is_empty() {
    for scene in ["mug_to_jug", "arm"] {
        let out = folder(&format!("figures_{scene}"));
        succeed(&["--scene", scene, "--size", "64", "--frames", "3", "--no-film", "--out", text(&out)]);
        let sheet = image::open(out.join("sheet.0003.png")).expect("a sheet").into_rgb8();
        // Two rows of pictures, with a title over the first one, and a label over each.
        let height = (sheet.height() - 180) / 2;
        let [left, top] = [28, 152 + height];
        let paper = sheet.get_pixel(0, 0);
        for (row, column) in (0..10).flat_map(|row| [0, 1].map(|column| (row, column))) {
            let part = |k: u32| (top + height * (row + k) / 10, left + 320 * (column + k));
            let ((y0, x0), (y1, x1)) = (part(0), part(1));
            let drawn = (y0..y1).any(|y| (x0..x1).any(|x| sheet.get_pixel(x, y) != paper));
            assert!(drawn, "{scene}: nothing in row {row} of 10, column {column} of 2");
        }
    }
}

#[test]
fn the_report_has_every_figure() {
    let out = folder("report");
    succeed(&["--scene", "arm", "--size", "64", "--frames", "2-3", "--no-film", "--out", text(&out)]);
    let report = report(&out);
    assert_eq!(report["program"]["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["settings"]["quality"], "normal");
    assert_eq!(report["asset"]["tiles"], 2);
    assert_eq!(report["tiles"][1]["udim"], 1002);
    let frames = report["frames"].as_array().expect("frames");
    let numbers: Vec<_> = frames.iter().map(|f| f["frame"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [2, 3]);
    for frame in frames {
        for tile in frame["tiles"].as_array().expect("tiles") {
            for key in [
                "energy_before",
                "energy",
                "min_jacobian",
                "folds",
                "sweeps",
                "corrections",
                "nodes_active",
                "bytes",
            ] {
                assert!(tile[key].is_number(), "{key}: {}", tile[key]);
            }
            for key in ["surface", "pyramid", "prolong", "relax", "correct", "certify", "invert", "total"] {
                assert!(tile["ms"][key].is_number(), "ms.{key}");
            }
            for side in ["before", "after"] {
                for key in ["rms", "median", "p95", "p99", "max", "border_rms", "interior_rms", "free_rms"] {
                    assert!(tile["strain"][side][key].is_number(), "strain.{side}.{key}");
                }
            }
            assert!(tile["strain"]["harm"].is_number() && tile["strain"]["help"].is_number());
            assert_eq!(tile["folds"], 0);
            let rms = |side: &str| tile["strain"][side]["rms"].as_f64().unwrap();
            assert!(rms("after") < rms("before"), "tile {}", tile["udim"]);
        }
    }
}

/// The assets are optional; if present, they lie beside the checkout.
#[test]
fn real_assets_bake() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/assets");
    if !assets.is_dir() {
        assert!(std::env::var_os("VRTM_REQUIRE_ASSETS").is_none(), "no {}", assets.display());
        println!("skipped: no {}", assets.display());
        return;
    }
    for name in names(&assets) {
        let asset = assets.join(&name);
        if !asset.join("asset.json").is_file() {
            continue;
        }
        let out = folder(&format!("asset_{name}"));
        let arguments =
            ["--asset", text(&asset), "--size", "128", "--frames", "1", "--no-film", "--out", text(&out)];
        let (_, warnings) = succeed_with_warnings(&arguments);
        // What the library says of their meshes: edges that lie together, faces over the rim of a tile.
        assert!(warnings.lines().all(|line| line.starts_with("bake: warning: mesh: ")), "{warnings}");
        let report = report(&out);
        assert_eq!(report["scene"]["name"], name);
        let tiles = report["frames"][0]["tiles"].as_array().expect("tiles");
        assert_eq!(names(&out).len(), 2 * tiles.len() + 2, "{name}");
        for tile in tiles {
            let strain = &tile["strain"];
            println!("{name} {}: {} -> {}", tile["udim"], strain["before"]["rms"], strain["after"]["rms"]);
            assert_eq!(tile["folds"], 0, "{name}");
            assert!(tile["min_jacobian"].as_f64().is_some_and(|j| j > 0.0), "{name}");
        }
    }
}

#[test]
fn help_tells_the_options() {
    let help = succeed(&["--help"]);
    let options = "--scene --asset --rest --pose --rigidity --frames --out --overwrite --no-sheet --no-film --view --size --map-size \
                   --quality draft normal --warm --temporal-weight --device gpu redirect.####.<UDIM>.exr torus";
    for option in options.split_whitespace() {
        assert!(help.contains(option), "{option}");
    }
}

#[test]
fn frames_are_baked_once_and_in_the_order_given() {
    let out = folder("order");
    let list = [
        "--size",
        "16",
        "--no-sheet",
        "--no-film",
        "--frames",
        "5,1-2,2",
        "--map-size",
        "24",
        "--out",
        text(&out),
    ];
    succeed(&list);
    let report = report(&out);
    let numbers: Vec<_> = report["frames"].as_array().unwrap().iter().map(|f| f["frame"].as_u64()).collect();
    assert_eq!(numbers, [Some(5), Some(1), Some(2)]);
    let size = |name: &str| {
        let (width, height, _) = read_exr(&out.join(name));
        [width, height]
    };
    assert_eq!([size("redirect.0005.1001.exr"), size("warp.0005.1001.exr")], [[24, 24], [17, 17]]);
    let map = &report["frames"][0]["tiles"][0]["map"];
    assert_eq!((&map["size"], &map["folds"]), (&serde_json::json!([24, 24]), &0.into()));
    for key in ["error_rms", "error_p99", "error_max"] {
        assert!(map[key].as_f64() > Some(0.0), "{key}: {map}");
    }
}
