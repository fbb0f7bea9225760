//! Bad input is refused, with a line that names it.

use std::fs;

use vrtm_examples::source::{self, Source};

use crate::common::{Files, REST, bake, folder, names, text};

/// Expects a line that names the culprit.
fn refuse(wanted: &source::Files, culprit: &str, reason: &str) {
    let line = Source::load(wanted).err().unwrap_or_else(|| panic!("{culprit} is read")).0;
    assert!(
        line.lines().count() == 1 && line.contains(culprit) && line.contains(reason),
        "'{reason}' in: {line}"
    );
}

#[test]
fn bad_files_are_refused() {
    let files = Files::new("bad_files");
    let check = |pose: &str, culprit: &str, reason: &str| {
        refuse(&files.wanted(pose, "r.<UDIM>.png"), culprit, reason)
    };
    check("none.obj", "none.obj", "");
    for (name, bytes, reason) in [
        ("short.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n".to_vec(), "3 vertices, but the rest mesh has 6"),
        ("nan.obj", REST.replace("v 2 0 0", "v 2 nan 0").into(), "not finite"),
        ("broken.obj", REST.replace("v 2 0 0", "v 2 zero 0").into(), "line 4: '2 zero 0' is not 3 numbers"),
        ("cut.f32", vec![0; 70], "70 bytes"),
        ("empty.f32", vec![], "0 bytes"),
        ("inf.f32", [f32::INFINITY.to_le_bytes(); 18].concat(), "not finite"),
        // The vertices 2 and 3 in each other's place: their faces go with them.
        (
            "permuted.obj",
            REST.replace("1/1 2/2 5/3", "1/1 3/2 5/3").into(),
            "face 1 has the vertices 1 3 5 4, but that of the rest mesh has 1 2 5 4",
        ),
        ("fewer.obj", REST.replace("f 2/5 3/6 6/7 5/8\n", "").into(), "1 faces, but the rest mesh has 2"),
        ("more.obj", format!("{REST}f 1/1 2/2 5/3\n").into(), "3 faces, but the rest mesh has 2"),
    ] {
        files.write(name, &bytes);
        check(name, name, reason);
    }
    // The same faces, from another corner on; without UVs; no faces at all.
    for text in [
        REST.replace("1/1 2/2 5/3 4/4", "5/3 4/4 1/1 2/2"),
        REST.replace("f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8", "f 1 2 5 4\nf 2 3 6 5"),
        REST[..REST.find("vt").unwrap()].into(),
    ] {
        files.write("same.obj", text.as_bytes());
        let read = Source::load(&files.wanted("same.obj", "r.<UDIM>.png"));
        assert_eq!(read.map(|source| source.frames.len()).map_err(|e| e.0), Ok(1));
    }
    let png = fs::read(files.path("r.1001.png")).expect("the map");
    for (bytes, reason) in [
        (&png[..png.len() / 2], ""),
        (b"not a picture", ""),
        (HUGE, "30000 x 30000 texels are more than 16384 x 16384"),
    ] {
        files.write("r.1001.png", bytes);
        check("pose.obj", "r.1001.png", reason);
    }
    for (pattern, reason) in
        [("r.1001.png", "write <UDIM>"), ("r.<TILE>.png", "write <UDIM>"), ("r_<UDIM>.png", "no such file")]
    {
        refuse(&files.wanted("pose.obj", pattern), pattern, reason);
    }
    for (text, reason) in [
        (REST.replace("6/7", "60/7"), "face 2"),
        (REST.replace("1/1", "1").replace("6/7", "6"), "no faces with UVs (vt)"),
        ("v 0 0 0\n".to_string(), "no faces"),
        ("hello\n".to_string(), "no vertices"),
    ] {
        files.write("rest.obj", text.as_bytes());
        check("pose.obj", "rest.obj", reason);
    }
}

/// The header of a PNG of 30,000 by 30,000 texels of 8 bits, which is not read further.
const HUGE: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0u0\0\0u0\x08\0\0\0\0CL\xa7f\0\0\0\x0bIDATx\x9cc`\x80\x01\0\0\n\0\x01\
    \x7f\x80t^\0\0\0\0IEND\xaeB`\x82";

/// A pipe without a writer waits for ever, and a device may have no end.
#[test]
#[cfg(unix)]
fn only_regular_files_are_read() {
    let files = Files::new("irregular");
    let pipe = files.path("pipe.obj");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    std::os::unix::fs::symlink("/dev/zero", files.path("zero.1001.png")).expect("a link");
    fs::create_dir(files.path("folder.f32")).expect("a folder");
    refuse(&files.wanted("pipe.obj", "r.<UDIM>.png"), "pipe.obj", "not a regular file");
    refuse(&files.wanted("folder.f32", "r.<UDIM>.png"), "folder.f32", "is a folder");
    refuse(&files.wanted("pose.obj", "zero.<UDIM>.png"), "zero.1001.png", "is not a regular file");
}

#[test]
fn bad_assets_are_refused() {
    let base = folder("bad_asset");
    let wanted = source::Files { asset: Some(base.clone()), ..Default::default() };
    refuse(&wanted, "asset.json", "");
    fs::write(base.join("rest.obj"), REST).expect("a file");
    fs::write(base.join("frames.f32"), [0u8; 6 * 12]).expect("a file");
    for (json, culprit, reason) in [
        ("{ \"name\": ", "asset.json", "EOF"),
        ("{ \"rigidity\": { \"1001\": 7 }, \"frames\": 1 }", "asset.json", "rigidity"),
        ("{ \"frames\": 2 }", "frames.f32", "1 frames, but asset.json says 2"),
    ] {
        fs::write(base.join("asset.json"), json).expect("a file");
        refuse(&wanted, culprit, reason);
    }
}

#[test]
fn bad_arguments_are_refused() {
    let out = folder("bad_arguments").join("out");
    let file = folder("bad_out").join("file");
    fs::write(&file, "").expect("a file");
    for (arguments, culprit, reason) in [
        (&["--frames", "0"][..], "--frames", "start at 1"),
        (&["--frames", "3-1"], "--frames", "backwards"),
        // At once, without a list of them all.
        (&["--frames", "1-99999999999999"], "--frames", "5 frames"),
        (&["--size", "100000"], "--size", "16384"),
        (&["--scene", "teapot"], "teapot", "mug_to_jug"),
        (&["--view", "30"], "--view", "two angles"),
        (&["--size", "16", "--frames", "1", "--out", text(&file)], text(&file), ""),
    ] {
        let out = if arguments.contains(&"--out") { vec![] } else { vec!["--out", text(&out)] };
        let refused = bake(&[arguments, &out].concat());
        let line = String::from_utf8(refused.stderr).expect("UTF-8");
        assert!(
            refused.status.code() == Some(2) && line.contains(culprit) && line.contains(reason),
            "{line}"
        );
    }
    assert_eq!(names(&out), Vec::<String>::new());
}
