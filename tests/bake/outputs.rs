//! What is written: names, channels, and what each file tells of itself.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use exr::meta::attribute::AttributeValue;

use crate::common::{Files, borrow, folder, layer, names, refuse, succeed, text};

/// The attributes of a file, as text.
fn attributes(path: &Path) -> BTreeMap<String, String> {
    let own = layer(path).attributes;
    let mut all: BTreeMap<String, String> = own
        .other
        .iter()
        .map(|(name, value)| {
            let text = match value {
                AttributeValue::Text(text) => text.to_string(),
                AttributeValue::I32(number) => number.to_string(),
                other => panic!("{name}: {other:?}"),
            };
            (name.to_string(), text)
        })
        .collect();
    for (name, value) in [("software", own.software_name), ("wrapmodes", own.wrap_mode_name)] {
        all.insert(name.into(), value.expect(name).to_string());
    }
    all
}

#[test]
fn a_file_tells_what_it_holds() {
    let out = folder("attributes");
    succeed(&["--size", "32", "--frames", "4", "--no-sheet", "--out", text(&out)]);
    let version = env!("CARGO_PKG_VERSION");
    let hash = |of: &BTreeMap<String, String>| of["vrtm:inputs"].clone();
    let mut hashes = Vec::new();
    for (name, kind) in [("redirect.0004.1001.exr", "redirect"), ("warp.0004.1001.exr", "warp")] {
        let found = attributes(&out.join(name));
        let expected = [
            ("colorInteropID", "data"),
            ("oiio:ColorSpace", "data"),
            ("software", concat!("vrtm ", env!("CARGO_PKG_VERSION"))),
            ("vrtm:form", "tile"),
            ("vrtm:frame", "4"),
            ("vrtm:kind", kind),
            ("vrtm:udim", "1001"),
            ("vrtm:version", version),
            ("wrapmodes", "clamp"),
        ];
        for (name, value) in expected {
            assert_eq!(found[name], value, "{name}");
        }
        assert_eq!(found.len(), expected.len() + 1, "{found:?}");
        assert!(hash(&found).len() == 32 && hash(&found).bytes().all(|b| b.is_ascii_hexdigit()));
        hashes.push(hash(&found));
    }
    assert_ne!(hashes[0], hashes[1]);
}

#[test]
fn the_hash_of_inputs_follows_what_the_content_depends_on_and_nothing_else() {
    let files = Files::new("hashes");
    let hashes = |name: &str, more: &[&str]| {
        let (mut arguments, _) = files.arguments("pose.obj", more);
        if more.first() == Some(&"--rigidity") {
            // In the place of the other one.
            let at = arguments.iter().position(|a| a == "--rigidity").unwrap();
            arguments.drain(at..at + 2);
        }
        let out = files.folder.join(name);
        let at = arguments.iter().position(|a| a == "--out").unwrap();
        arguments[at + 1] = text(&out).into();
        arguments.extend(["--no-sheet".into(), "--device".into(), "cpu".into()]);
        succeed(&borrow(&arguments));
        ["redirect.0001.1001.exr", "warp.0001.1001.exr", "redirect.0001.1002.exr"].map(|file| {
            (attributes(&out.join(file))["vrtm:inputs"].clone(), fs::read(out.join(file)).unwrap())
        })
    };
    let first = hashes("a", &[]);
    // Another folder, other numbers of threads, other names of the same files: the very same bytes.
    for tile in ["1001", "1002"] {
        let [own, copy] = ["r", "copy"].map(|name| files.path(&format!("{name}.{tile}.png")));
        fs::copy(own, copy).unwrap();
    }
    assert!(hashes("b", &["--threads", "1"]) == first);
    assert!(hashes("c", &["--rigidity", &files.path("copy.<UDIM>.png"), "--threads", "3"]) == first);
    let hash_of = |all: &[(String, Vec<u8>); 3]| all.clone().map(|(hash, _)| hash);
    let first = hash_of(&first);
    let distinct: std::collections::HashSet<_> = first.iter().collect();
    assert_eq!(distinct.len(), 3);
    for (name, more) in [
        ("size", &["--size", "64"][..]),
        ("quality", &["--quality", "high"]),
        ("weld", &["--weld", "off"]),
        ("solver", &["--solver", "pbd"]),
    ] {
        let other = hash_of(&hashes(name, more));
        assert!((0..3).all(|k| other[k] != first[k]), "{name}");
    }
    // The size of the map does not change the warp, nor does one tile's map change another tile.
    let other = hash_of(&hashes("map-size", &["--map-size", "16"]));
    assert!(other[0] != first[0] && other[1] == first[1] && other[2] != first[2]);
    image::GrayImage::from_pixel(32, 32, image::Luma([9])).save(files.path("r.1001.png")).unwrap();
    let other = hash_of(&hashes("map", &[]));
    assert!(other[0] != first[0] && other[1] != first[1] && other[2] == first[2]);
    image::GrayImage::from_pixel(32, 32, image::Luma([255])).save(files.path("m.1002.png")).unwrap();
    let again = hash_of(&hashes("mask", &["--mask", &files.path("m.<UDIM>.png")]));
    assert!((0..3).all(|k| again[k] != other[k]));
    // With a warm start, a frame depends on those before it.
    let frames = |name: &str, list: &str, warm: &[&str]| {
        let pose = files.path("pose.obj");
        files.write("other.obj", crate::common::REST.replace("v 0 1 0", "v 0 1.2 0").as_bytes());
        let (mut arguments, _) =
            files.arguments("other.obj", &["--pose", &pose, "--frames", list, "--no-sheet"]);
        arguments.extend(warm.iter().map(|word| word.to_string()));
        let out = files.folder.join(name);
        let at = arguments.iter().position(|a| a == "--out").unwrap();
        arguments[at + 1] = text(&out).into();
        succeed(&borrow(&arguments));
        attributes(&out.join("redirect.0002.1001.exr"))["vrtm:inputs"].clone()
    };
    assert_eq!(frames("cold 1-2", "1-2", &[]), frames("cold 2", "2", &[]));
    assert_ne!(frames("warm 1-2", "1-2", &["--warm"]), frames("warm 2", "2", &["--warm"]));
}

/// All files below a folder.
fn tree(folder: &Path, prefix: &str) -> Vec<String> {
    let mut all = Vec::new();
    for name in names(folder) {
        let path = folder.join(&name);
        if path.is_dir() {
            all.extend(tree(&path, &format!("{prefix}{name}/")));
        } else {
            all.push(format!("{prefix}{name}"));
        }
    }
    all
}

#[test]
fn names_follow_a_pattern() {
    let files = Files::new("names");
    let check = |more: &[&str], expected: &[&str]| {
        let (arguments, out) = files.arguments("pose.obj", more);
        succeed(&borrow(&arguments));
        assert_eq!(tree(&out, ""), expected);
        fs::remove_dir_all(&out).unwrap();
    };
    check(
        &["--no-sheet", "--name", "<UDIM>/<kind>.<UDIM>.<frame>.exr"],
        &[
            "1001/redirect.1001.0001.exr",
            "1001/warp.1001.0001.exr",
            "1002/redirect.1002.0001.exr",
            "1002/warp.1002.0001.exr",
            "report.json",
        ],
    );
    // What there is one of need not be in the name.
    check(
        &["--no-sheet", "--no-warp", "--name", "st_<UDIM>.exr"],
        &["report.json", "st_1001.exr", "st_1002.exr"],
    );
    check(
        &["--no-warp"],
        &["redirect.0001.1001.exr", "redirect.0001.1002.exr", "report.json", "sheet.0001.png"],
    );
    for (pattern, reason) in [
        ("<UDIM>.<frame>.exr", "2 kinds are written: <kind>"),
        ("<kind>.<frame>.exr", "2 tiles are written: <UDIM>"),
        ("../<kind>.<UDIM>.exr", "inside of the output folder"),
        ("a/../../<kind>.<UDIM>.exr", "inside of the output folder"),
        ("/tmp/<kind>.<UDIM>.exr", "inside of the output folder"),
        ("a\\<kind>.<UDIM>.exr", "inside of the output folder"),
        ("<kind>.<UDIM>", ".exr"),
        ("<kind>.<UDIM>/.exr", ".exr"),
        ("<kind>.<UDIM>.exr/", ".exr"),
        ("<kind>.<udim>.exr", "'<udim>'"),
        ("<kind>.<UDIM.exr", "'<UDIM.exr'"),
        ("", "--name"),
    ] {
        let (arguments, out) = files.arguments("pose.obj", &["--name", pattern]);
        refuse(&arguments, &out, pattern, reason);
    }
    files.write("two.f32", &crate::common::floats(&[0.5; 36]));
    let (arguments, out) = files.arguments("two.f32", &["--name", "<kind>.<UDIM>.exr"]);
    refuse(&arguments, &out, "--name", "2 frames are written: <frame>");
}

#[test]
fn maps_have_a_size_of_their_own() {
    let out = folder("map_size");
    let list = ["--size", "64", "--map-size", "96", "--frames", "4", "--no-sheet", "--out", text(&out)];
    succeed(&list);
    let size = |name: &str| {
        let layer = layer(&out.join(name));
        (layer.size.x(), layer.size.y())
    };
    assert_eq!(size("redirect.0004.1001.exr"), (96, 96));
    assert_eq!(size("warp.0004.1001.exr"), (65, 65));
}

/// What is printed may go to a file on a full disk: the maps are there in any case.
#[test]
#[cfg(target_os = "linux")]
fn a_bake_does_not_fail_for_what_it_prints() {
    let files = Files::new("full_log");
    fs::remove_file(files.path("r.1002.png")).unwrap();
    let (arguments, out) = files.arguments("pose.obj", &["--no-sheet"]);
    let full = || fs::File::options().write(true).open("/dev/full").expect("/dev/full");
    let mut bake = crate::common::command();
    // A tile without a map is warned of.
    bake.args(&arguments).stdout(full()).stderr(full());
    assert_eq!(bake.status().expect("bake runs").code(), Some(0));
    assert!(names(&out).contains(&"report.json".to_string()));
    let mut refused = crate::common::command();
    refused.args(arguments).args(["--frames", "99"]).stderr(full());
    assert_eq!(refused.status().expect("bake runs").code(), Some(2));
}
