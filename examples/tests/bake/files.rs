//! A user's own files: poses and maps, and the files that are written.

use std::fs;

use image::{ImageBuffer, Luma};
use vrtm::PixelFormat;
use vrtm_examples::maps::Map;
use vrtm_examples::source::Source;
use vrtm_examples::whole::{self, Whole};

use crate::common::{Files, bake, folder, names, read_exr, succeed, text};

fn borrow(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

#[test]
fn a_users_own_files_bake_and_a_tile_without_a_map_is_the_identity() {
    let files = Files::new("files");
    fs::remove_file(files.path("r.1002.png")).unwrap();
    let out = files.folder.join("out");
    // Frames of several files in their order.
    let arguments = files.bake(&["poses.f32", "pose.obj"], &["--frames", "3", "--out", text(&out)]);
    let (_, warnings) = succeed(&borrow(&arguments));
    let [line] = warnings.lines().collect::<Vec<_>>()[..] else { panic!("one line: {warnings}") };
    assert!(line.contains("warning") && line.contains("r.<UDIM>.png") && line.ends_with(": 1002"), "{line}");
    let expected = [
        "redirect.0003.1001.exr",
        "redirect.0003.1002.exr",
        "sheet.0003.png",
        "warp.0003.1001.exr",
        "warp.0003.1002.exr",
    ];
    assert_eq!(names(&out), expected);
    let apart = |name: &str| {
        let (width, height, texels) = read_exr(&out.join(name));
        // A tile without a map has the size of the other tile's map.
        assert_eq!((width, height), (32, 32));
        let of = |(i, uv): (usize, &[f32; 2])| {
            let centre = [(i % 32) as f32 + 0.5, 31.5 - (i / 32) as f32].map(|x| x / 32.0);
            (uv[0] - centre[0]).abs().max((uv[1] - centre[1]).abs())
        };
        texels.iter().enumerate().map(of).fold(0.0, f32::max)
    };
    assert!(apart("redirect.0003.1002.exr") <= 1e-6 && apart("redirect.0003.1001.exr") > 1e-3);
}

#[test]
fn sixteen_bits_are_kept_and_of_colours_the_luminance_counts() {
    let path = |name: &str| folder("bits").join(name);
    let (deep, colour, flat) = (path("deep.png"), path("colour.png"), folder("bits").join("flat.png"));
    ImageBuffer::from_fn(32, 32, |x, y| Luma([(x * 2000 + y) as u16])).save(&deep).unwrap();
    let deep = Map::load(&deep).expect("a map");
    ImageBuffer::from_fn(32, 32, |x, y| image::Rgb([(x * 2000 + y) as u16; 3])).save(&colour).unwrap();
    let colour = Map::load(&colour).expect("a map");
    ImageBuffer::from_fn(32, 32, |x, _| Luma([x as u8])).save(&flat).unwrap();
    let flat = Map::load(&flat).expect("a map");
    assert_eq!(
        (deep.format, colour.format, flat.format),
        (PixelFormat::U16, PixelFormat::U16, PixelFormat::U8)
    );
    assert!(
        deep.bytes == colour.bytes
            && deep.values()[33] == 2001.0 / 65535.0
            && flat.values()[1] == 1.0 / 255.0
    );
}

#[test]
fn tiles_have_the_tokens_of_other_programs() {
    let files = Files::new("tokens");
    for (pattern, names) in [
        ("p%(UDIM)d.png", ["p1001.png", "p1002.png"]),
        ("t_<UVTILE>.png", ["t_u1_v1.png", "t_u2_v1.png"]),
        ("t_u<U>_v<V>.png", ["t_u1_v1.png", "t_u2_v1.png"]),
        ("z_<u>_<v>.png", ["z_u0_v0.png", "z_u1_v0.png"]),
        ("z<uvtile>.png", ["zu0_v0.png", "zu1_v0.png"]),
    ] {
        for (udim, name) in [1001, 1002].into_iter().zip(names) {
            fs::copy(files.path(&format!("r.{udim}.png")), files.path(name)).expect("a copy");
        }
        let source = Source::load(&files.wanted("pose.obj", pattern)).unwrap_or_else(|e| panic!("{}", e.0));
        for (udim, name) in [1001, 1002].into_iter().zip(names) {
            let map = source.maps[&udim].rigidity.as_ref().expect("a map");
            assert!(map.origin.ends_with(name), "{name}: {}", map.origin);
        }
    }
}

#[test]
fn no_file_that_is_read_is_written_over() {
    let files = Files::new("sheet");
    fs::create_dir(files.folder.join("out")).unwrap();
    for name in ["out/sheet.1001.png", "out/sheet.1002.png"] {
        fs::copy(files.path("r.1001.png"), files.path(name)).expect("a copy");
    }
    // A link to the output folder is that folder.
    #[cfg(unix)]
    std::os::unix::fs::symlink(files.folder.join("out"), files.folder.join("link")).expect("a link");
    for out in ["out", "out/../out", if cfg!(unix) { "link" } else { "out" }] {
        let mut arguments = files.bake(&["pose.obj"], &["--out", &files.path(out)]);
        arguments[3] = files.path("out/sheet.<UDIM>.png");
        let refused = bake(&borrow(&arguments));
        let line = String::from_utf8(refused.stderr).expect("UTF-8");
        assert!(refused.status.code() == Some(2) && line.contains("sheet.1001.png: is read"), "{line}");
        assert_eq!(names(&files.folder.join("out")), ["sheet.1001.png", "sheet.1002.png"]);
    }
}

#[test]
fn a_file_is_there_as_a_whole_or_not_at_all() {
    use std::io::Write as _;
    let folder = folder("whole");
    let path = folder.join("a.txt");
    fs::write(&path, "old").expect("written");
    let (whole, mut file) = Whole::create(&path).expect("created");
    file.write_all(b"half").and_then(|()| file.flush()).expect("written");
    drop(whole);
    assert_eq!(fs::read(&path).expect("read"), b"old");
    whole::write(&path, b"new").expect("written");
    assert_eq!(fs::read(&path).expect("read"), b"new");
    assert_eq!(names(&folder), ["a.txt"]);
    let error = whole::write(&folder.join("none/a.txt"), b"").expect_err("no folder");
    assert!(error.contains("none"), "{error}");
}
