//! The built-in scenes: their files, and their sheets.

use crate::common::{folder, mug, names, read_exr, succeed, text};

#[test]
fn the_built_in_scene_gives_exactly_its_files() {
    let (out, (table, warnings)) = mug();
    let expected = [
        "redirect.0001.1001.exr",
        "redirect.0005.1001.exr",
        "sheet.0001.png",
        "sheet.0005.png",
        "turning.png",
        "warp.0001.1001.exr",
        "warp.0005.1001.exr",
    ];
    assert_eq!((names(out), warnings.as_str()), (expected.map(String::from).to_vec(), ""));
    assert!(table.contains("1001") && table.contains("->"), "{table}");

    let (width, height, redirect) = read_exr(&out.join("redirect.0005.1001.exr"));
    assert_eq!((width, height), (64, 64));
    let (columns, rows, warp) = read_exr(&out.join("warp.0005.1001.exr"));
    assert_eq!((columns, rows), (65, 65));
    let mut largest = 0.0f32;
    for (k, uv) in redirect.into_iter().enumerate() {
        let centre = [((k % width) as f32 + 0.5) / 64.0, 1.0 - ((k / width) as f32 + 0.5) / 64.0];
        let moved = (uv[0] - centre[0]).abs().max((uv[1] - centre[1]).abs());
        // All nodes between the charts of the side (v >= 0.55) and of the handle (v <= 0.40) are fixed; the two rows of
        // cells beside a chart belong to it. One rounding of f32 is allowed.
        assert!(!(0.44..0.51).contains(&centre[1]) || moved <= 1e-6, "texel {k} moved by {moved}");
        largest = largest.max(moved);
    }
    assert!(largest > 0.25 / 64.0, "a jug's studs are somewhere else than a mug's: {largest}");
    // Nodes lie at the corners of cells, so that the image reaches from corner to corner of the tile; v points up, and
    // the first row is at the top.
    assert_eq!([warp[0], warp[64], warp[65 * 64]], [[0.0, 1.0], [1.0, 1.0], [0.0, 0.0]]);
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
