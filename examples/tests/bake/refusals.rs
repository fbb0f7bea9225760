//! Bad input is refused, with a line that names it.

use std::fs;

use crate::common::{Files, REST, borrow, floats, folder, names, refuse, succeed, text};

#[test]
fn bad_files_are_refused() {
    let files = Files::new("bad_files");
    let check = |pose: &str, culprit: &str, reason: &str| {
        let (arguments, out) = files.arguments(pose, &[]);
        refuse(&arguments, &out, culprit, reason);
    };
    check("none.obj", "none.obj", "");
    files.write("short.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    check("short.obj", "short.obj", "3 vertices, but the rest mesh has 6");
    files.write("nan.obj", REST.replace("v 2 0 0", "v 2 nan 0").as_bytes());
    check("nan.obj", "nan.obj", "not finite");
    files.write("broken.obj", REST.replace("v 2 0 0", "v 2 zero 0").as_bytes());
    check("broken.obj", "broken.obj", "line 4: '2 zero 0' is not 3 numbers");
    files.write("cut.f32", &floats(&[0.0; 6 * 3])[..70]);
    check("cut.f32", "cut.f32", "70 bytes");
    files.write("empty.f32", b"");
    check("empty.f32", "empty.f32", "0 bytes");
    files.write("inf.f32", &floats(&[f32::INFINITY; 6 * 3]));
    check("inf.f32", "inf.f32", "not finite");
    let path = files.path("r.1001.png");
    let png = fs::read(&path).expect("the map");
    files.write("r.1001.png", &png[..png.len() / 2]);
    check("pose.obj", "r.1001.png", "");
    files.write("r.1001.png", b"not a picture");
    check("pose.obj", "r.1001.png", "");
    fs::remove_file(path).expect("the map");
    fs::remove_file(files.path("r.1002.png")).expect("the other map");
    check("pose.obj", "r.<UDIM>.png", "no such file");
}

#[test]
fn bad_meshes_are_refused() {
    let files = Files::new("bad_meshes");
    for (text, reason) in [
        (REST.replace("v 0 1 0", "v 0 inf 0"), "positions[3]: component 1 is inf"),
        (REST.replace("vt 0.9 0.9", "vt nan 0.9"), "[2]: component 0 is NaN"),
        (REST.replace("6/7", "60/7"), "face 2"),
        (REST.replace("1/1", "1").replace("6/7", "6"), "no faces with UVs (vt)"),
        ("v 0 0 0\n".to_string(), "no faces"),
        ("hello\n".to_string(), "no vertices"),
    ] {
        files.write("rest.obj", text.as_bytes());
        let (arguments, out) = files.arguments("pose.obj", &[]);
        refuse(&arguments, &out, "rest.obj", reason);
    }
}

/// The header of a PNG of 30,000 by 30,000 texels of 8 bits.
const HUGE: &[u8] =
    b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0u0\0\0u0\x08\0\0\0\0CL\xa7f\0\0\0\x0bIDATx\x9cc`\x80\x01\0\0\n\0\x01\
    \x7f\x80t^\0\0\0\0IEND\xaeB`\x82";

#[test]
fn maps_that_are_too_large_are_refused_before_they_are_read() {
    let files = Files::new("huge");
    files.write("r.1001.png", HUGE);
    let (arguments, out) = files.arguments("pose.obj", &[]);
    refuse(&arguments, &out, "r.1001.png", "30000 x 30000 texels are more than 16384 x 16384");
}

/// A pipe without a writer waits for ever, and a device may have no end.
#[test]
#[cfg(unix)]
fn only_regular_files_are_read() {
    let files = Files::new("irregular");
    let pipe = files.path("pipe.obj");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
    std::os::unix::fs::symlink("/dev/zero", files.path("zero.1001.png")).expect("a link");
    fs::create_dir(files.path("folder.f32")).expect("a folder");
    for (option, name, reason) in [
        ("--rest", "pipe.obj", "not a regular file"),
        ("--pose", "pipe.obj", "not a regular file"),
        ("--pose", "folder.f32", "is a folder"),
        ("--rigidity", "zero.<UDIM>.png", "zero.1001.png: is not a regular file"),
    ] {
        let (mut arguments, out) = files.arguments("pose.obj", &[]);
        let at = arguments.iter().position(|a| a == option).expect("the option");
        arguments[at + 1] = files.path(name);
        refuse(&arguments, &out, name.split('<').next().expect("a name"), reason);
    }
}

#[test]
fn bad_assets_are_refused() {
    let base = folder("bad_asset");
    let out = base.join("out");
    let arguments = ["--asset", text(&base), "--out", text(&out)].map(String::from);
    refuse(&arguments, &out, "asset.json", "");
    fs::write(base.join("asset.json"), "{ \"name\": ").expect("a file");
    refuse(&arguments, &out, "asset.json", "EOF");
    fs::write(base.join("asset.json"), "{ \"rigidity\": { \"1001\": 7 }, \"frames\": 1 }").expect("a file");
    fs::write(base.join("rest.obj"), REST).expect("a file");
    fs::write(base.join("frames.f32"), floats(&[0.0; 6 * 3])).expect("a file");
    refuse(&arguments, &out, "asset.json", "rigidity");
    fs::write(base.join("asset.json"), "{ \"frames\": 2 }").expect("a file");
    refuse(&arguments, &out, "frames.f32", "1 frames, but asset.json says 2");
}

#[test]
fn bad_arguments_are_refused() {
    let out = folder("bad_arguments").join("out");
    for (arguments, culprit, reason) in [
        (&["--quality", "best"][..], "--quality", "best"),
        (&["--frames", "0"], "--frames", "start at 1"),
        (&["--frames", "3-1"], "--frames", "backwards"),
        (&["--frames", "99"], "--frames", "5 frames"),
        // At once, without a list of them all.
        (&["--frames", "1-99999999999999"], "--frames", "5 frames"),
        (&["--map-size", "0"], "--map-size", "0"),
        (&["--temporal-weight", "0.1"], "--warm", "required"),
        (&["--size", "0"], "--size", "0"),
        (&["--size", "100000"], "--size", "16384"),
        (&["--scene", "teapot"], "teapot", "mug_to_jug"),
        (&["--device", "tpu"], "--device", "tpu"),
        (&["--view", "30"], "--view", "two angles"),
        (&["--rest", "a.obj"], "--pose", "required"),
        (&["--loud"], "--loud", "unexpected"),
    ] {
        let mut list: Vec<String> = arguments.iter().map(|a| a.to_string()).collect();
        list.extend(["--out".to_string(), text(&out).to_string()]);
        refuse(&list, &out, culprit, reason);
    }
}

#[test]
fn an_output_folder_that_cannot_be_made_is_refused() {
    let base = folder("bad_out");
    let file = base.join("file");
    fs::write(&file, "").expect("a file");
    let out = file.join("out");
    let arguments = ["--size", "16", "--frames", "1", "--out", text(&out)].map(String::from);
    refuse(&arguments, &out, "out", "");
    assert_eq!(names(&base), ["file"]);
}

#[test]
fn a_pose_with_other_faces_is_refused() {
    let files = Files::new("other_faces");
    let check = |pose: &str, reason: &str| {
        files.write("other.obj", pose.as_bytes());
        let (arguments, out) = files.arguments("other.obj", &["--no-sheet"]);
        match reason {
            "" => {
                succeed(&borrow(&arguments));
                fs::remove_dir_all(&out).unwrap();
            }
            _ => refuse(&arguments, &out, "other.obj", reason),
        }
    };
    // The vertices 2 and 3 in each other's place: their faces go with them.
    let permuted = REST
        .replace("v 1 0 0\nv 2 0 0", "v 2 0 0\nv 1 0 0")
        .replace("1/1 2/2 5/3", "1/1 3/2 5/3")
        .replace("2/5 3/6", "3/5 2/6");
    check(&permuted, "face 1 has the vertices 1 3 5 4, but that of the rest mesh has 1 2 5 4");
    let second = REST.replace("f 2/5 3/6 6/7 5/8", "f 2/5 6/6 3/7 5/8");
    check(&second, "face 2 has the vertices 2 6 3 5, but that of the rest mesh has 2 3 6 5");
    check(&REST.replace("f 2/5 3/6 6/7 5/8\n", ""), "1 faces, but the rest mesh has 2");
    check(&format!("{REST}f 1/1 2/2 5/3\n"), "3 faces, but the rest mesh has 2");
    // The same faces, from another corner on; without UVs; no faces at all.
    check(&REST.replace("1/1 2/2 5/3 4/4", "5/3 4/4 1/1 2/2"), "");
    check(&REST.replace("f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8", "f 1 2 5 4\nf 2 3 6 5"), "");
    check(&REST[..REST.find("vt").unwrap()], "");
}
